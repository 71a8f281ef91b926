//! The eight neighbours of a node.

use crate::linalg::lanes::least;

/// The ring of neighbours, counter-clockwise in index coordinates, axis neighbours at even places.
pub(crate) const RING: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// A diagonal neighbour, hidden where both nodes beside the step to it are closed: the step would leak through.
#[inline(always)]
pub(crate) fn pass(diagonal: f32, a: f32, b: f32) -> f32 {
    if least(a, b) < f32::INFINITY { diagonal } else { f32::INFINITY }
}
