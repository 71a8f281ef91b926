//! A face of bumps, and the two routes across it.

use glam::DVec2;
use ridgeway::{
    Comparison, Control, Crs, Curvature, Error, FitOptions, GridFrame, Ground, HeightSurface,
    Isotropic, Metric, Modifiers, Smoothing, Solver, Terrain,
};

/// Nodes across and down, 1 m apart.
pub(crate) const SIZE: [usize; 2] = [181, 221];

/// Bumps: height, place (x right, y up from the middle of the face), radii along x and y, m.
const BUMPS: [[f64; 5]; 13] = [
    [70.0, 0.0, 0.0, 62.0, 80.0],  // head
    [9.0, -28.0, 36.0, 20.0, 7.0], // brows
    [9.0, 28.0, 36.0, 20.0, 7.0],
    [-12.0, -27.0, 21.0, 13.0, 9.0], // sockets
    [-12.0, 27.0, 21.0, 13.0, 9.0],
    [8.0, -27.0, 21.0, 6.0, 5.0], // eyes
    [8.0, 27.0, 21.0, 6.0, 5.0],
    [15.0, 0.0, 12.0, 6.0, 20.0], // bridge and tip of the nose
    [13.0, 0.0, -10.0, 9.0, 7.0],
    [7.0, -34.0, -16.0, 15.0, 14.0], // cheeks
    [7.0, 34.0, -16.0, 15.0, 14.0],
    [7.0, 0.0, -38.0, 17.0, 4.5],   // mouth
    [10.0, 0.0, -66.0, 15.0, 10.0], // chin
];

/// The face as a terrain.
pub(crate) fn face() -> Result<Terrain, Error> {
    let [cols, rows] = SIZE;
    let half = DVec2::new(cols as f64 - 1.0, rows as f64 - 1.0) / 2.0;
    let frame =
        GridFrame::new(cols, rows, DVec2::new(-half.x, half.y), DVec2::ONE, Ground::METRES)?;
    let height = |at: DVec2| -> f64 {
        let bump = |&[height, x, y, a, b]: &[f64; 5]| {
            let d = (at - DVec2::new(x, y)) / DVec2::new(a, b);
            height * (-0.5 * d.length_squared()).exp()
        };
        BUMPS.iter().map(bump).sum()
    };
    let heights = (0..cols * rows)
        .map(|i| height(frame.to_map(DVec2::new((i % cols) as f64, (i / cols) as f64))))
        .collect();
    Terrain::new(frame, heights, Crs::none())
}

/// From temple to jaw, in map coordinates.
pub(crate) const START: DVec2 = DVec2::new(-52.0, 52.0);
pub(crate) const GOAL: DVec2 = DVec2::new(36.0, -48.0);

/// The geodesic and the curvature route.
pub(crate) fn routes(terrain: &Terrain) -> Result<Comparison, Error> {
    let control = Control::default();
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    let surface = HeightSurface::fit(terrain, &options, &control)?;
    let none = Modifiers::default();
    let metrics = [
        Isotropic.on(&surface, &none, &Control::default())?,
        Curvature::default().on(&surface, &none, &Control::default())?,
    ];
    let [start, goal] = [START, GOAL].map(|at| terrain.frame().to_grid(at));
    Comparison::between(Solver::default(), &metrics, &[start.into()], goal, &control)
}
