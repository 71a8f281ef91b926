//! Which changes in a tile can improve its neighbours.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use std::array::from_fn;

use super::{ALL, LineMask};
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::RING;
use crate::grid::tiling::{PaddedTile, SIDE};
use crate::linalg::lanes::{choose, lanes, least};

/// Four units in the last place of an `f32`: changes below are rounding.
pub(crate) const ROUNDING: f32 = 2.4e-7;

/// The rows and the columns of a tile of the given size next to a set of neighbours, which has one bit each in the order of [`RING`]; for
/// a neighbour at a corner, the row. Bit 8 is the tile itself: all rows.
pub(super) fn lines_next_to(neighbours: u16, [cols, rows]: [usize; 2]) -> [LineMask; 2] {
    let line = |at: i32, count: usize| if at > 0 { 1 << (count - 1) } else { 1 };
    let itself = if neighbours & 1 << RING.len() != 0 { ALL } else { 0 };
    let set = (0..RING.len()).filter(|direction| neighbours & 1 << direction != 0);
    set.fold([itself, 0], |[by_rows, by_cols], direction| match RING[direction] {
        (dx, 0) => [by_rows, by_cols | line(dx, cols)],
        (_, dy) => [by_rows | line(dy, rows), by_cols],
    })
}

/// For each neighbour, in the order of [`RING`], the least value among the changes in a tile of the given size that could improve it, or
/// on which its values were based; infinite if none. `margins` are those of the neighbours: a node `x` can be improved by a neighbour `y` only if
/// `g(y) < g(x) + margin`.
pub(super) fn for_neighbours(
    before: &PaddedTile,
    after: &PaddedTile,
    [cols, rows]: [usize; 2],
    margins: [f32; 8],
) -> [f32; 8] {
    let across = |direction: usize, row: usize| {
        let neighbour = row.wrapping_add_signed(RING[direction].1 as isize);
        let [old, new, neighbour] =
            [&before[row], &after[row], &after[neighbour]].map(|line| lanes(line, 1));
        least_change(cols, old, new, neighbour, margins[direction])
    };
    let down = |direction: usize, col: usize| {
        let line = |block: &PaddedTile, col: usize| from_fn(|row| block[row + 1][col]);
        let neighbour = line(after, col.wrapping_add_signed(RING[direction].0 as isize));
        least_change(rows, line(before, col), line(after, col), neighbour, margins[direction])
    };
    let corner = |direction: usize, col: usize, row: usize| {
        let (dx, dy) = RING[direction];
        let neighbour =
            after[row.wrapping_add_signed(dy as isize)][col.wrapping_add_signed(dx as isize)];
        improving(change(before[row][col], after[row][col]), neighbour, margins[direction])
    };
    [
        down(0, cols),
        corner(1, cols, rows),
        across(2, rows),
        corner(3, 1, rows),
        down(4, 1),
        corner(5, 1, 1),
        across(6, 1),
        corner(7, cols, 1),
    ]
}

/// The least of the changes in the first `count` nodes of a line that could improve the `neighbour` line.
fn least_change(
    count: usize,
    old: [f32; SIDE],
    new: [f32; SIDE],
    neighbour: [f32; SIDE],
    margin: f32,
) -> f32 {
    // With one place before and after.
    let mut padded = [f32::INFINITY; SIDE + 2];
    for i in 0..SIDE {
        padded[i + 1] = choose(i < count, change(old[i], new[i]), f32::INFINITY);
    }
    let mut found = [f32::INFINITY; SIDE];
    for i in 0..SIDE {
        let change = least(least(padded[i], padded[i + 1]), padded[i + 2]);
        found[i] = choose(i < count, improving(change, neighbour[i], margin), f32::INFINITY);
    }
    found.into_iter().fold(f32::INFINITY, least)
}

/// The lower of the old and the new value where a node changed; infinite where it did not.
#[inline(always)]
fn change(old: f32, new: f32) -> f32 {
    choose((old - new).abs() > ROUNDING * new, least(old, new), f32::INFINITY)
}

/// The change, if it could improve a value; else infinite.
#[inline(always)]
fn improving(change: f32, value: f32, margin: f32) -> f32 {
    choose((value <= UNREACHED) & (change < value + margin), change, f32::INFINITY)
}
