//! A tile with the nodes around it.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use super::super::field::{AREA, SIDE, Tiling};
use super::super::tiles::neighbour;
use super::super::update::lanes;

/// A value of each node of a row.
pub(super) type Lanes = [f32; SIDE];

/// Nodes around a tile that the functional looks at.
pub(super) const MARGIN: usize = 2;
pub(super) const WIDE: usize = SIDE + 2 * MARGIN;
pub(super) type Patch = [[f32; WIDE]; WIDE];

/// A tile and the nodes around it, `outside` beyond the grid.
pub(super) fn patch<'a>(
    tiling: &Tiling,
    tile: usize,
    outside: f32,
    values: impl Fn(usize) -> &'a [f32; AREA],
) -> Patch {
    let mut patch = [[outside; WIDE]; WIDE];
    let column = |dy: isize| {
        [-1, 0, 1].map(|dx| Some(values(neighbour(tiling, tile, dx, dy)?).as_chunks::<SIDE>().0))
    };
    let rows = [(-1, SIDE - MARGIN..SIDE, 0), (0, 0..SIDE, MARGIN), (1, 0..MARGIN, MARGIN + SIDE)];
    for (dy, from, to) in rows {
        let [west, middle, east] = column(dy);
        for (row, line) in from.zip(&mut patch[to..]) {
            if let Some(west) = west {
                line[..MARGIN].copy_from_slice(&west[row][SIDE - MARGIN..]);
            }
            if let Some(middle) = middle {
                line[MARGIN..MARGIN + SIDE].copy_from_slice(&middle[row]);
            }
            if let Some(east) = east {
                line[MARGIN + SIDE..].copy_from_slice(&east[row][..MARGIN]);
            }
        }
    }
    patch
}

/// A line of a patch, seen `(dx, dy)` from the nodes of a row.
#[inline(always)]
pub(super) fn seen(patch: &Patch, row: usize, dx: i32, dy: i32) -> Lanes {
    lanes(&patch[(row as i32 + dy + MARGIN as i32) as usize], (dx + MARGIN as i32) as usize)
}

/// Mirrors a patch on its diagonal.
pub(super) fn transpose(block: &mut Patch) {
    for row in 0..WIDE {
        for col in 0..row {
            let value = block[row][col];
            block[row][col] = block[col][row];
            block[col][row] = value;
        }
    }
}
