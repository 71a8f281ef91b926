//! Figure 5 of Seong, Jeong and Cohen (2008): distances on a knight-like surface and on the same surface with other parameters.
//!
//! `cargo run --release --example figure_5 [FOLDER]` prints how far they are apart, and draws both into FOLDER or `target/figures`.

#[path = "figures/output.rs"]
mod output;
#[path = "figures/parametrisations.rs"]
mod parametrisations;
#[path = "figures/shapes.rs"]
mod shapes;

use glam::{DVec2, DVec3};
use ridgeway::grid::{isolines, levels_by_step};
use ridgeway::render::{Gradient, Rgb, SurfacePicture, encode_png, side_by_side};
use ridgeway::{Curvature, GridFrame, Ground, Isotropic, Metric};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let metrics: [&dyn Metric; 2] = [&Isotropic, &Curvature::default()];
    for metric in metrics {
        println!(
            "{metric:?}: nodes, mean and greatest difference as shares of the greatest distance"
        );
        for n in [50, 100, 200, 400] {
            let compared = parametrisations::compare(metric, n)?;
            let [mean, greatest] = [compared.mean_difference, compared.greatest_difference];
            println!("{:>4} × {:<4} {mean:.2e} {greatest:.2e}", 2 * n, n + 1);
        }
    }
    let compared = parametrisations::compare(&Curvature::default(), 200)?;
    let mut pictures = Vec::new();
    for ((surface, map), title) in
        compared.surfaces.iter().zip(&compared.maps).zip(["as made", "reweighted"])
    {
        let values = map.to_row_major();
        let colours = Gradient::Sequential.colours(&values);
        let mut picture = SurfacePicture::new(surface, &colours);
        (picture.view, picture.max_side_px) = (DVec3::new(-1.0, 2.0, 1.0), 1000);
        picture.title = format!("Knight, {title}");
        // Rings of nodes in white, to show the parameters, and isolines.
        let (cols, rows) = (map.cols(), map.rows());
        for row in (0..rows).step_by(10) {
            let ring = (0..=cols).map(|col| DVec2::new(col as f64, row as f64)).collect();
            picture.lines.push((ring, Rgb::WHITE));
        }
        let frame = GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES)?;
        for isoline in isolines(&frame, &values, &levels_by_step(&values, 0.5)?)? {
            picture.lines.extend(isoline.lines.into_iter().map(|line| (line, Rgb::INK)));
        }
        pictures.push(picture.render()?);
    }
    output::save("figure-5.png", &encode_png(&side_by_side(&pictures)?)?)?;
    Ok(())
}
