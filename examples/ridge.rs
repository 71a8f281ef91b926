//! Isotropic against curvature route over a ridge: figure 1 (c, d) of Seong, Jeong, Cohen (SMI 2008).
//!
//! A long ridge lies between start and goal. The geodesic goes straight over it; the curvature route, to which
//! bending over the crest is costly, goes far along the ridge to where it is low, and crosses there.
//!
//! `cargo run --release --example ridge [FOLDER]` prints their numbers, and draws them into FOLDER or `target/figures`.

#[path = "figures/output.rs"]
mod output;

use glam::DVec2;
use ridgeway::grid::isolines;
use ridgeway::render::{IsolineLayer, MapPicture, Rgb, RouteLayer};
use ridgeway::{
    Comparison, Control, Crs, Curvature, Error, FitOptions, GridFrame, Ground, HeightSurface,
    Isotropic, Metric, Modifiers, Smoothing, Solver, Terrain,
};

const N: usize = 161;
const CELL: f64 = 10.0;

/// A ridge along the east, 120 m high in the west and falling to nothing in the east.
fn height(x: f64, y: f64) -> f64 {
    let crest = 120.0 / (1.0 + ((x - 300.0) / 150.0).exp());
    crest * (-0.5 * (y / 120.0).powi(2)).exp()
}

fn main() -> Result<(), Error> {
    let control = Control::default();
    let half = 0.5 * CELL * (N - 1) as f64;
    let frame = GridFrame::new(N, N, DVec2::new(-half, half), DVec2::splat(CELL), Ground::METRES)?;
    let heights = (0..N * N)
        .map(|i| frame.to_map(DVec2::new((i % N) as f64, (i / N) as f64)))
        .map(|at| height(at.x, at.y))
        .collect();
    let terrain = Terrain::new(frame.clone(), heights, Crs::none())?;
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    let surface = HeightSurface::fit(&terrain, &options, &control)?;

    let none = Modifiers::default();
    let metrics = [
        Isotropic.on(&surface, &none, &Control::default())?,
        Curvature::default().on(&surface, &none, &Control::default())?,
    ];
    let start = frame.to_grid(DVec2::new(0.0, -500.0));
    let goal = frame.to_grid(DVec2::new(0.0, 500.0));
    let comparison =
        Comparison::between(Solver::default(), &metrics, &[start.into()], goal, &control)?;
    println!("route, length m, climb m, total normal curvature rad, x isotropic, x curvature");
    for (r, route) in comparison.routes.iter().enumerate() {
        let s = &route.summary;
        println!(
            "{}, {:.1}, {:.1}, {:.3}, {:.3}, {:.3}",
            s.metric,
            s.length_m,
            s.climb_m,
            s.total_normal_curvature_rad,
            comparison.ratio(0, r),
            comparison.ratio(1, r)
        );
    }
    let mut picture = MapPicture::new(&frame, terrain.heights());
    picture.title = "A ridge: geodesic and curvature route".to_owned();
    let rings = comparison
        .distances
        .iter()
        .map(|distance| {
            let values = distance.to_row_major();
            let farthest = values.iter().copied().fold(0.0, f32::max);
            let levels: Vec<f64> =
                (1..20).map(|i| f64::from(farthest) * f64::from(i) / 20.0).collect();
            isolines(&frame, &values, &levels)
        })
        .collect::<Result<Vec<_>, _>>()?;
    for ((route, rings), colour) in
        comparison.routes.iter().zip(&rings).zip([Rgb::BLUE, Rgb::ORANGE])
    {
        let label = format!("{} route: {:.0} m", route.summary.metric, route.summary.length_m);
        picture.routes.push(RouteLayer { grid: &route.grid, colour, label });
        let label = format!("{} distance", route.summary.metric);
        picture.isolines.push(IsolineLayer { isolines: rings, colour, label });
    }
    picture.starts = vec![start];
    picture.goals = vec![goal];
    output::save("ridge.png", &picture.png()?)
}
