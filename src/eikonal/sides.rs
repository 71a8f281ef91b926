//! How tiles lie beside each other.

use super::field::{Tiling, wrap};

/// Where news of a tile come from, as (tiles east, tiles south): its neighbours, and itself.
pub(super) const SIDES: [(isize, isize); 9] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (0, 0)];
pub(super) const NEIGHBOURS: [(isize, isize); 8] = {
    let [neighbours @ .., _] = SIDES;
    neighbours
};
pub(super) const ITSELF: usize = 8;

/// The side on which the neighbour sees this tile.
pub(super) fn opposite(side: usize) -> usize {
    (side + 4) % 8
}

/// The tile `(dx, dy)` from another.
pub(super) fn neighbour(tiling: &Tiling, tile: usize, dx: isize, dy: isize) -> Option<usize> {
    let [across, down] = tiling.periodic;
    let x = wrap((tile % tiling.across) as isize + dx, tiling.across, across)?;
    let y = wrap((tile / tiling.across) as isize + dy, tiling.down, down)?;
    Some(y * tiling.across + x)
}

/// The neighbours of a tile, each with its side.
pub(super) fn neighbours(tiling: &Tiling, tile: usize) -> impl Iterator<Item = (usize, usize)> {
    let &Tiling { across, down, periodic, .. } = tiling;
    let (x, y) = (tile % across, tile / across);
    let is_inner = x > 0 && x + 1 < across && y > 0 && y + 1 < down;
    NEIGHBOURS.into_iter().enumerate().filter_map(move |(side, (dx, dy))| {
        if is_inner {
            return Some((side, tile.wrapping_add_signed(dy * across as isize + dx)));
        }
        let x = wrap(x as isize + dx, across, periodic[0])?;
        let y = wrap(y as isize + dy, down, periodic[1])?;
        Some((side, y * across + x))
    })
}
