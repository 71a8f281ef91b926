//! Line of sight between points of a grid, some nodes of which are closed.

use glam::DVec2;

/// Whether no wall lies between two points nearby. A wall is a closed node, or the line between two neighbouring closed nodes. `is_open` is
/// called with column and row of a node, also outside the grid.
pub(crate) fn in_sight(a: DVec2, b: DVec2, is_open: impl Fn(isize, isize) -> bool) -> bool {
    /// Samples per cell of length: dense enough that a segment that passes between samples hardly touches a wall.
    const DENSITY: f64 = 8.0;
    let steps = (a.distance(b) * DENSITY).ceil().max(1.0);
    (0..=steps as usize).all(|i| {
        let p = a.lerp(b, i as f64 / steps);
        let (col, row) = (p.x.floor() as isize, p.y.floor() as isize);
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| is_open(col + i, row + j));
        corners == [true; 4] || on_free_side(corners, p - p.floor(), a, b, p.floor())
    })
}

/// In a cell with closed corners: whether the sample `at` of the segment from `a` to `b` is nearest to an open corner, and the segment crosses no
/// wall along a diagonal of the cell.
fn on_free_side(corners: [bool; 4], at: DVec2, a: DVec2, b: DVec2, cell: DVec2) -> bool {
    // The nearest corner, or one of the nearest, must be open, ...
    let distance = |i: usize| at.distance_squared(DVec2::new((i % 2) as f64, (i / 2) as f64));
    let nearest = (0..4).map(distance).fold(f64::INFINITY, f64::min);
    if !(0..4).any(|i| corners[i] && distance(i) <= nearest + 1e-9) {
        return false;
    }
    // ... and where a wall runs along a diagonal, the whole segment must lie on one side of it.
    let (a, b) = (a - cell, b - cell);
    let crosses_rising = (a.x - a.y) * (b.x - b.y) < 0.0;
    let crosses_falling = (a.x + a.y - 1.0) * (b.x + b.y - 1.0) < 0.0;
    let falling_wall = !corners[1] && !corners[2];
    let rising_wall = !corners[0] && !corners[3];
    !(falling_wall && crosses_falling || rising_wall && crosses_rising)
}
