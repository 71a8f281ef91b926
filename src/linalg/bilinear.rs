//! Bilinear interpolation in a cell.

use glam::DVec2;

/// The corners of a cell, in the order of [`corner_weights`].
pub(crate) const CORNERS: [(isize, isize); 4] = [(0, 0), (1, 0), (0, 1), (1, 1)];

/// Weights of the corners of a cell at a point in it, from (0, 0) to (1, 1).
#[inline(always)]
pub(crate) fn corner_weights(DVec2 { x: u, y: v }: DVec2) -> [f64; 4] {
    [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
}
