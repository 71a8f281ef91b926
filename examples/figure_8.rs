//! Figure 8 of Seong, Jeong and Cohen (2008): two half-cylinders divided between two seeds. On the curvature tensor the border lies
//! wherever the seeds put it; on the difference tensor it is the seam.
//!
//! `cargo run --release --example figure_8 [FOLDER]` prints how well each does, and draws them into FOLDER or `target/figures`.

#[path = "figures/half_cylinders.rs"]
mod half_cylinders;
#[path = "figures/output.rs"]
mod output;

use glam::{DVec2, DVec3};
use ridgeway::metric::{Difference, DifferenceForm};
use ridgeway::render::{Rgb, SurfacePicture, encode_png, side_by_side};
use ridgeway::{Curvature, Delta, Metric};

use half_cylinders::{HalfCylinders, divide};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The paper has one δ for both tensors.
    let literal = Difference {
        form: DifferenceForm::Literal,
        curvature_delta: Delta::default(),
        delta: Delta::default(),
    };
    let metrics: [(&str, &dyn Metric); 3] = [
        ("curvature tensor", &Curvature::default()),
        ("difference tensor", &Difference::default()),
        ("difference tensor, literal", &literal),
    ];
    println!("share of the nodes that fall to the seed of their own half");
    for nodes in [50, 100, 200, 400] {
        let surface = HalfCylinders { nodes };
        for (name, metric) in metrics {
            println!("{nodes} x {nodes}, {name}: {:.4}", divide(&surface, metric)?.1);
        }
    }
    let surface = HalfCylinders { nodes: 100 };
    let mut pictures = Vec::new();
    for (name, metric) in metrics {
        let (second, _) = divide(&surface, metric)?;
        let colour =
            |second: &bool| if *second { Rgb(0xf2, 0xb1, 0x34) } else { Rgb(0x5a, 0xa9, 0xe6) };
        let colours: Vec<Rgb> = second.iter().map(colour).collect();
        let mut picture = SurfacePicture::new(&surface, &colours);
        let last = (surface.nodes - 1) as f64;
        let seam = [0.0, last].map(|row| DVec2::new(surface.seam(), row));
        picture.view = DVec3::new(1.0, -2.0, 4.0);
        picture.lines.push((seam.to_vec(), Rgb::INK));
        picture.points.extend(surface.seeds().map(|at| (at, Rgb::INK)));
        (picture.blend, picture.max_side_px) = (false, 900);
        picture.title = format!("{name}; the line is the seam");
        pictures.push(picture.render()?);
    }
    output::save("figure-8.png", &encode_png(&side_by_side(&pictures)?)?)?;
    Ok(())
}
