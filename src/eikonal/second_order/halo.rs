//! Tiles next to each other in a row, with the nodes around them.

use std::ops::Deref;

use crate::eikonal::stencil::ring::rings;
use crate::grid::tiling::{SIDE, Tiling};
use crate::linalg::lanes::{Lanes, lanes};

/// Width of the halo: how many nodes beyond the tiles the functional reads.
pub(super) const MARGIN: usize = 2;
/// Rows and columns of a [`BatchBlock`].
const HEIGHT: usize = SIDE + 2 * MARGIN;
pub(super) const WIDTH: usize = BATCH * SIDE + 2 * MARGIN;
/// Most tiles of a batch: the halos and values of so many fit into the nearest cache.
pub(super) const BATCH: usize = 4;
/// One number at each node of a batch and of its halo, row by row.
pub(super) type BatchBlock = [[f32; WIDTH]; HEIGHT];

/// Fills the block of a batch of `tiles` tiles from `first` on and of its halo, with `outside` beyond the grid.
pub(super) fn fill<T: Deref<Target = [f32]>>(
    batch: &mut BatchBlock,
    tiling: &Tiling,
    (first, tiles): (usize, usize),
    outside: f32,
    values: impl Fn(usize) -> T,
) {
    if tiling.is_over_seam(first, tiles, MARGIN) {
        return fill_over_seam(batch, tiling, first, outside, values);
    }
    let (x, y) = (first % tiling.across, first / tiling.across);
    // Copying from tiles fills the whole block only where the batch is complete and does not touch the border of the grid.
    let surrounded = x > 0 && x + tiles < tiling.across && y > 0 && y + 1 < tiling.down;
    if !surrounded || tiles < BATCH {
        *batch = [[outside; WIDTH]; HEIGHT];
    }
    let rows = [(-1, SIDE - MARGIN..SIDE, 0), (0, 0..SIDE, MARGIN), (1, 0..MARGIN, MARGIN + SIDE)];
    for (dy, from, to) in rows {
        for k in 0..tiles + 2 {
            let Some(tile) = tiling.neighbour(first, k as isize - 1, dy) else { continue };
            let values = values(tile);
            let lines = values.as_chunks::<SIDE>().0[from.clone()].iter();
            let lines = lines.zip(&mut batch[to..]);
            if k == 0 {
                lines.for_each(|(line, to)| to[..MARGIN].copy_from_slice(&line[SIDE - MARGIN..]));
            } else if k <= tiles {
                let at = MARGIN + (k - 1) * SIDE;
                lines.for_each(|(line, to)| to[at..at + SIDE].copy_from_slice(line));
            } else {
                let at = MARGIN + tiles * SIDE;
                lines.for_each(|(line, to)| to[at..at + MARGIN].copy_from_slice(&line[..MARGIN]));
            }
        }
    }
}

/// [`fill`] node by node.
fn fill_over_seam<T: Deref<Target = [f32]>>(
    batch: &mut BatchBlock,
    tiling: &Tiling,
    first: usize,
    outside: f32,
    values: impl Fn(usize) -> T,
) {
    // The tile of the node before, which is most nodes' own.
    let mut last: Option<(usize, T)> = None;
    for (row, line) in (-(MARGIN as isize)..).zip(batch) {
        for (col, value) in (-(MARGIN as isize)..).zip(line) {
            *value = outside;
            let Some((tile, place)) = tiling.seen_from(first, col, row) else { continue };
            if last.as_ref().is_none_or(|&(before, _)| before != tile) {
                last = Some((tile, values(tile)));
            }
            if let Some((_, values)) = &last {
                *value = values[place];
            }
        }
    }
}

/// The values of the nodes at offset `(dx, dy)` from those of a row of the tile that begins at column `from`.
#[inline(always)]
pub(super) fn at_offset(
    batch: &BatchBlock,
    (from, row): (usize, usize),
    (dx, dy): (i32, i32),
) -> Lanes {
    let line = &batch[(row as i32 + dy + MARGIN as i32) as usize];
    lanes(line, (from as i32 + dx + MARGIN as i32) as usize)
}

/// The rings of the nodes of a row.
#[inline(always)]
pub(super) fn rings_of(batch: &BatchBlock, (from, row): (usize, usize)) -> [Lanes; 8] {
    let above = row + MARGIN - 1;
    rings([&batch[above], &batch[above + 1], &batch[above + 2]], from + MARGIN)
}
