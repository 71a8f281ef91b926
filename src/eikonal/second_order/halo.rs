//! Tiles side by side with the nodes around them.

use crate::eikonal::stencil::ring::rings;
use crate::grid::tiling::{AREA, SIDE, Tiling};
use crate::linalg::lanes::{Lanes, lanes};

/// Nodes around the tiles that the functional looks at.
pub(super) const MARGIN: usize = 2;
const HIGH: usize = SIDE + 2 * MARGIN;

pub(super) const WIDE: usize = STRIP * SIDE + 2 * MARGIN;
/// Most tiles of a strip: what is looked at around so many fits into the nearest cache.
pub(super) const STRIP: usize = 4;
pub(super) type Strip = [[f32; WIDE]; HIGH];

/// Fills a strip with `tiles` tiles from `first` on and the nodes around them, `outside` beyond the grid.
pub(super) fn fill<'a>(
    strip: &mut Strip,
    tiling: &Tiling,
    (first, tiles): (usize, usize),
    outside: f32,
    values: impl Fn(usize) -> &'a [f32; AREA],
) {
    if tiling.is_over_seam(first, tiles, MARGIN) {
        return fill_over_seam(strip, tiling, first, outside, values);
    }
    let (x, y) = (first % tiling.across, first / tiling.across);
    // What is copied covers all but beyond the grid.
    let surrounded = x > 0 && x + tiles < tiling.across && y > 0 && y + 1 < tiling.down;
    if !surrounded || tiles < STRIP {
        *strip = [[outside; WIDE]; HIGH];
    }
    let rows = [(-1, SIDE - MARGIN..SIDE, 0), (0, 0..SIDE, MARGIN), (1, 0..MARGIN, MARGIN + SIDE)];
    for (dy, from, to) in rows {
        for k in 0..tiles + 2 {
            let Some(tile) = tiling.neighbour(first, k as isize - 1, dy) else { continue };
            let lines = values(tile).as_chunks::<SIDE>().0[from.clone()].iter();
            let lines = lines.zip(&mut strip[to..]);
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
fn fill_over_seam<'a>(
    strip: &mut Strip,
    tiling: &Tiling,
    first: usize,
    outside: f32,
    values: impl Fn(usize) -> &'a [f32; AREA],
) {
    for (row, line) in (-(MARGIN as isize)..).zip(strip) {
        for (col, value) in (-(MARGIN as isize)..).zip(line) {
            let place = tiling.seen_from(first, col, row);
            *value = place.map_or(outside, |(tile, place)| values(tile)[place]);
        }
    }
}

/// The values `(dx, dy)` from the nodes of a row of the tile that begins at column `from`.
#[inline(always)]
pub(super) fn seen(strip: &Strip, (from, row): (usize, usize), (dx, dy): (i32, i32)) -> Lanes {
    let line = &strip[(row as i32 + dy + MARGIN as i32) as usize];
    lanes(line, (from as i32 + dx + MARGIN as i32) as usize)
}

/// The rings of the nodes of a row.
#[inline(always)]
pub(super) fn rings_of(strip: &Strip, (from, row): (usize, usize)) -> [Lanes; 8] {
    let above = row + MARGIN - 1;
    rings([&strip[above], &strip[above + 1], &strip[above + 2]], from + MARGIN)
}
