//! Figure 9 of Seong, Jeong and Cohen (2008): like parts found on surfaces of other size and shape.
//!
//! `cargo run --release --example figure_9 [FOLDER]` prints which parts are matched and what that takes, and draws the surfaces
//! with the parts of a match in one colour into FOLDER or `target/figures`.

#[path = "figures/output.rs"]
mod output;
#[allow(dead_code, reason = "figure 7 uses the rest")]
#[path = "figures/parts.rs"]
mod parts;
#[path = "figures/shapes.rs"]
mod shapes;

use std::time::Instant;

use glam::DVec3;
use ridgeway::Control;
use ridgeway::region::{Match, Neighbours, match_regions, signatures};
use ridgeway::render::{Rgb, SurfacePicture, encode_png, pair_colour, side_by_side};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let views = [DVec3::new(0.3, -1.0, 2.0), DVec3::new(1.0, -2.0, 1.0)];
    let pairs = [parts::letters()?, parts::pieces()?];
    for (((cuts, parts), view), name) in pairs.iter().zip(views).zip(["letters", "pieces"]) {
        let found = match_regions(&cuts[0].signatures, &cuts[1].signatures, false)?;
        println!("{}, {}: unlike, ratio of sizes", cuts[0].name, cuts[1].name);
        for m in &found {
            let [a, b] = [parts[0][m.first], parts[1][m.second]];
            println!("  {a:<10} {b:<10} {:.3} {:.2}", m.distance, m.size_ratio);
        }
        output::save(&format!("figure-9-{name}.png"), &draw(cuts, &found, view)?)?;
    }
    println!("nodes, metric with solve and labels ms, signatures ms");
    for nodes in [100, 1000] {
        let [regions, signatures] = times(nodes)?;
        println!("{nodes} × {nodes} {regions:.1} {signatures:.1}");
    }
    Ok(())
}

/// What the regions of a letter and their signatures take, ms.
fn times(nodes: usize) -> Result<[f64; 2], ridgeway::Error> {
    let letter = parts::swept_letter(1.0, [0.2, 0.17])?.on_grid(nodes, nodes)?;
    let mut fastest = [f64::INFINITY; 2];
    for _ in 0..5 {
        let start = Instant::now();
        let labels = parts::nearest_rings(&letter, &[0.35, 0.78, 0.96])?;
        let cut = Instant::now();
        signatures(&letter, &labels, Neighbours::Surface, &Control::default())?;
        for (fastest, time) in fastest.iter_mut().zip([cut - start, cut.elapsed()]) {
            *fastest = fastest.min(1e3 * time.as_secs_f64());
        }
    }
    Ok(fastest)
}

fn draw(cuts: &[parts::Cut; 2], found: &[Match], view: DVec3) -> Result<Vec<u8>, ridgeway::Error> {
    let mut pictures = Vec::new();
    for (side, cut) in cuts.iter().enumerate() {
        let rank = |region: usize| found.iter().position(|m| [m.first, m.second][side] == region);
        let colour = |label: &Option<u32>| {
            label.map_or(Rgb::WHITE, |label| pair_colour(rank(label as usize)))
        };
        let colours: Vec<Rgb> = cut.labels.iter().map(colour).collect();
        let mut picture = SurfacePicture::new(&*cut.surface, &colours);
        (picture.blend, picture.view, picture.max_side_px) = (false, view, 800);
        picture.regions = &cut.labels;
        picture.title = cut.name.into();
        pictures.push(picture.render()?);
    }
    encode_png(&side_by_side(&pictures)?)
}
