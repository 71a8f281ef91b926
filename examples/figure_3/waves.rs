//! The surface of figures 2 and 3 and its clusters, for the example and for the test on it.

use glam::DVec2;
use ridgeway::eikonal::TensorField;
use ridgeway::{
    Control, Crs, Curvature, Error, FitOptions, GridFrame, Ground, HeightSurface, Metric,
    Modifiers, Smoothing, Terrain,
};

pub(crate) const SIDE: usize = 121;
pub(crate) const CELL: f64 = 10.0;

/// Level in the west, waves in the east that grow from nothing in between.
fn height(x: f64, y: f64) -> f64 {
    let share = 1.0 / (1.0 + (-x / 60.0).exp());
    12.0 * share * (x / 40.0).sin() * (y / 40.0).sin()
}

pub(crate) fn terrain() -> Result<Terrain, Error> {
    let half = 0.5 * CELL * (SIDE - 1) as f64;
    let frame =
        GridFrame::new(SIDE, SIDE, DVec2::new(-half, half), DVec2::splat(CELL), Ground::METRES)?;
    let node = |i: usize| frame.to_map(DVec2::new((i % SIDE) as f64, (i / SIDE) as f64));
    let heights = (0..SIDE * SIDE).map(node).map(|at| height(at.x, at.y)).collect();
    Terrain::new(frame, heights, Crs::none())
}

pub(crate) fn surface(terrain: &Terrain) -> Result<HeightSurface, Error> {
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    HeightSurface::fit(terrain, &options, &Control::default())
}

pub(crate) fn field(surface: &HeightSurface) -> Result<TensorField, Error> {
    let metric = Curvature::default().on(surface, &Modifiers::default(), &Control::default())?;
    TensorField::sample(&metric, &Control::default())
}
