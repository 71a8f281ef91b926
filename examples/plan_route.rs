//! A route over a real DEM in a dozen lines.
//!
//! `cargo run --release --example plan_route`

use glam::DVec2;
use ridgeway::{
    Control, Curvature, FitOptions, HeightSurface, Metric, Modifiers, Solver, Stop, Terrain,
    route::trace,
};

fn main() -> Result<(), ridgeway::Error> {
    let control = Control::default();
    let terrain = Terrain::open("data/jacksboro.tif")?;
    let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control)?;
    let metric = Curvature::default().on(&surface, &Modifiers::default(), &Control::default())?;
    let start = terrain.from_lonlat(DVec2::new(-84.38, 36.21))?;
    let goal = terrain.from_lonlat(DVec2::new(-84.10, 36.39))?;
    let distance =
        Solver::default().solve(&metric, &[start.into()], &Stop::AllGoals(vec![goal]), &control)?;
    let route = trace(&distance, &metric, goal)?;
    println!("{:.2} km, climb {:.0} m", route.summary.length_m / 1000.0, route.summary.climb_m);
    Ok(())
}
