//! Distances and clusters adapt to the ground: figures 2 and 3 of Seong, Jeong, Cohen (SMI 2008).
//!
//! The surface is level in the west and wavy in the east. At the same radius, a cluster of level ground is much larger.
//!
//! `cargo run --release --example figure_3 [FOLDER]` draws both into FOLDER or `target/figures`.

#[path = "../figures/output.rs"]
mod output;
mod waves;

use glam::DVec2;
use ridgeway::region::{
    SegmentOptions, Segmentation, cluster, gaussian_ranks, outlines, region_statistics,
};
use ridgeway::render::{FieldPicture, Gradient, MapPicture, RegionLayer, contrasting_colours};
use ridgeway::{Control, Error, Solver, Stop, Terrain};

use waves::SIDE;

/// Radius of the clusters, AG units.
const EPSILON: f64 = 12.0;

fn main() -> Result<(), Error> {
    let terrain = waves::terrain()?;
    let surface = waves::surface(&terrain)?;
    let field = waves::field(&surface)?;
    let control = Control::default();
    let middle = SIDE / 2;
    println!("cluster around, nodes within {EPSILON} AG units");
    for (name, col) in [("level ground", middle / 2), ("waves", 3 * middle / 2)] {
        println!("{name}, {}", cluster(&field, [col, middle], EPSILON, &control)?.len());
    }
    let options = SegmentOptions { epsilons: vec![EPSILON], ..SegmentOptions::default() };
    let ranks = gaussian_ranks(&surface);
    let cut = Segmentation::of(&field, &ranks, &options, &control)?;
    println!("regions, {}", cut.levels[0].regions.len());
    let areas = region_statistics(&surface, &cut.levels[0]).into_iter().map(|m| m.area_m2);
    let (least, most) =
        areas.fold((f64::INFINITY, 0.0), |(a, b), x| (f64::min(a, x), f64::max(b, x)));
    println!("area of the smallest and the largest m2, {least:.0}, {most:.0}");
    let start = DVec2::splat(middle as f64).into();
    let map = Solver::default().solve_field(field, &[start], &Stop::Never, &control)?;
    let distance = map.to_row_major();
    let mut picture =
        FieldPicture::new(terrain.frame(), &distance, Gradient::Sequential, "distance (AG units)");
    picture.title = "Distance from the middle under the curvature tensor".into();
    output::save("figure-2.png", &picture.png()?)?;
    output::save("figure-3.png", &clusters(&terrain, &cut)?)
}

fn clusters(terrain: &Terrain, cut: &Segmentation) -> Result<Vec<u8>, Error> {
    let level = &cut.levels[0];
    let outlines = outlines(level, SIDE);
    let mut picture = MapPicture::new(terrain.frame(), terrain.heights());
    picture.title = format!("Regions around clusters of radius {EPSILON}");
    let seed = |[col, row]: [usize; 2]| DVec2::new(col as f64, row as f64);
    picture.regions = Some(RegionLayer {
        labels: &level.labels,
        colours: contrasting_colours(&level.labels, SIDE, level.regions.len()),
        borders: vec![&outlines],
        seeds: level.regions.iter().map(|region| seed(region.seed)).collect(),
    });
    picture.png()
}
