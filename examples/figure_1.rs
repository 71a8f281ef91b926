//! Figure 1 of Seong, Jeong, Cohen (SMI 2008): distance and routes on a face, isotropic and by curvature.
//!
//! The geodesic goes straight over brow, eye and nose. The curvature route goes where the face is smooth; its isolines
//! crowd where the face bends.
//!
//! `cargo run --release --example figure_1 [FOLDER]` draws both into FOLDER or `target/figures`.

#[path = "figures/face.rs"]
mod face;
#[path = "figures/output.rs"]
mod output;

use ridgeway::Error;
use ridgeway::grid::isolines;
use ridgeway::render::{IsolineLayer, MapPicture, Rgb, RouteLayer};

fn main() -> Result<(), Error> {
    let terrain = face::face()?;
    let comparison = face::routes(&terrain)?;
    println!("route, length m, total normal curvature rad, x isotropic, x curvature");
    for (r, route) in comparison.routes.iter().enumerate() {
        println!(
            "{}, {:.1}, {:.3}, {:.3}, {:.3}",
            route.summary.metric,
            route.summary.length_m,
            route.summary.total_normal_curvature_rad,
            comparison.ratio(0, r),
            comparison.ratio(1, r)
        );
    }
    let frame = terrain.frame();
    let mut picture = MapPicture::new(frame, terrain.heights());
    picture.title = "A face: geodesic and curvature route, with their isolines".to_owned();
    picture.starts = vec![frame.to_grid(face::START)];
    picture.goals = vec![frame.to_grid(face::GOAL)];
    let rings = comparison
        .distances
        .iter()
        .map(|distance| {
            let values = distance.to_row_major();
            let farthest = f64::from(values.iter().copied().fold(0.0, f32::max));
            let levels: Vec<f64> = (1..25).map(|i| farthest * f64::from(i) / 25.0).collect();
            isolines(frame, &values, &levels)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let colours = [Rgb::BLUE, Rgb::ORANGE];
    for ((route, rings), colour) in comparison.routes.iter().zip(&rings).zip(colours) {
        let metric = route.summary.metric.as_str();
        let label = format!("{metric} route: {:.0} m", route.summary.length_m);
        picture.routes.push(RouteLayer { grid: &route.grid, colour, label });
        let label = format!("{metric} distance");
        picture.isolines.push(IsolineLayer { isolines: rings, colour, label });
    }
    output::save("figure-1.png", &picture.png()?)
}
