//! Surfaces of the figures of Seong, Jeong and Cohen (2008).

use glam::{DVec3, DVec4};
use ridgeway::{Knots, NurbsCurve, NurbsSurface, Result};

/// Radius and height of the control points of a chess piece from the top of its head to the middle of its foot.
const PIECE: [[f64; 2]; 15] = [
    [0.0, 10.0],
    [1.0, 10.0],
    [1.6, 9.2],
    [1.5, 8.2],
    [0.7, 7.6],
    [1.5, 7.1],
    [0.9, 6.6],
    [0.8, 5.0],
    [1.0, 3.4],
    [1.5, 2.4],
    [2.6, 2.0],
    [2.9, 1.2],
    [2.6, 0.4],
    [1.4, 0.0],
    [0.0, 0.0],
];

/// The knight-like surface of revolution of figure 5, with a pole at its top and its bottom. The first parameter goes round, the
/// second down.
pub(crate) fn knight() -> Result<NurbsSurface> {
    let points = PIECE.map(|[r, z]| DVec4::new(r, 0.0, z, 1.0));
    let profile = NurbsCurve::new(Knots::clamped(3, points.len())?, false, &points)?;
    NurbsSurface::revolve(&profile, DVec3::ZERO, DVec3::Z)
}
