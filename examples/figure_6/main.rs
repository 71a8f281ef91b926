//! Four bumps that meet, cut into four regions: figure 6 of Seong, Jeong, Cohen (SMI 2008).
//!
//! The bumps have broad tops, a hollow lies between each two and one in the middle. Every bump gets a region, also if the order of
//! the seeds is perturbed. A watershed of the total curvature cuts the surface into nine, marching between walls of directional
//! curvature into five.
//!
//! `cargo run --release --example figure_6 [FOLDER]` prints the numbers of regions, and draws those of the first cut into FOLDER or
//! `target/figures`.

mod four_bumps;
#[path = "../figures/output.rs"]
mod output;

use glam::DVec2;
use ridgeway::Error;
use ridgeway::region::outlines;
use ridgeway::render::{MapPicture, RegionLayer, contrasting_colours};

use four_bumps::SIDE;

fn main() -> Result<(), Error> {
    let terrain = four_bumps::terrain()?;
    let surface = four_bumps::surface(&terrain)?;
    println!("perturbation, regions, share of nodes in their own quarter");
    for (perturbation, seed) in
        [0.0, 0.005, 0.01, 0.02, 0.02, 0.02, 0.05, 0.05].into_iter().zip(0..)
    {
        let cut = four_bumps::segmentation(&surface, perturbation, seed)?;
        let regions = cut.levels[0].regions.len();
        println!("{perturbation}, {regions}, {:.4}", four_bumps::agreement(&cut));
    }
    let (gaussian, larger) = four_bumps::curvatures(&surface);
    println!("watershed of total curvature, {}", four_bumps::total_curvature_watershed(&gaussian));
    println!("marching between walls, {}", four_bumps::marching_between_walls(&larger));
    println!(
        "standard deviation of Gaussian bumps as a share of their distance, regions, share of nodes in their own quarter"
    );
    for share in [0.2, 0.25, 0.3, 0.35, 0.4] {
        let surface = four_bumps::surface(&four_bumps::gaussians(share)?)?;
        let cut = four_bumps::segmentation(&surface, 0.0, 0)?;
        let regions = cut.levels[0].regions.len();
        println!("{share}, {regions}, {:.4}", four_bumps::agreement(&cut));
    }
    let cut = four_bumps::segmentation(&surface, 0.0, 0)?;
    let level = &cut.levels[0];
    let outlines = outlines(level, SIDE);
    let mut picture = MapPicture::new(terrain.frame(), terrain.heights());
    picture.title = "Four bumps, four regions".into();
    picture.regions = Some(RegionLayer {
        labels: &level.labels,
        colours: contrasting_colours(&level.labels, SIDE, level.regions.len()),
        borders: vec![&outlines],
        seeds: level
            .regions
            .iter()
            .map(|r| DVec2::new(r.seed[0] as f64, r.seed[1] as f64))
            .collect(),
    });
    output::save("figure-6.png", &picture.png()?)
}
