//! Tiles: how the nodes of a grid are cut into squares, and which of these are neighbours, also where the grid is periodic.

use std::ops::Range;

use glam::DVec2;

use crate::linalg::Sym2;
use crate::linalg::bilinear::{CORNERS, corner_weights};
use crate::linalg::lanes::LANES;

/// Side length of a tile in nodes: as many as an AVX-512 register has `f32` lanes. 8 and 32 are slower (the shorter
/// needs more activations, the longer more sweeps; design measurements at ratio 1 to 400).
pub(crate) const SIDE: usize = LANES;
/// Nodes of a tile.
pub(crate) const AREA: usize = SIDE * SIDE;
/// Side of a tile padded with its halo: one node of each neighbour around it.
pub(crate) const PADDED: usize = SIDE + 2;

/// Values of a tile and of its halo, row by row, each `(column, row)` from −1 to 16.
pub(crate) type PaddedTile = [[f32; PADDED]; PADDED];

/// The directions to the neighbours of a tile as (tiles east, tiles south): east, south-east and so on around, as on the ring of a node.
pub(crate) const NEIGHBOURS: [(isize, isize); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// The place in [`NEIGHBOURS`] of the opposite direction: where the neighbour has this tile.
pub(crate) fn opposite(direction: usize) -> usize {
    (direction + 4) % 8
}

/// How the nodes of a grid are cut into tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tiling {
    pub(crate) cols: usize,
    pub(crate) rows: usize,
    /// Tiles in a row of tiles, and in a column.
    pub(crate) across: usize,
    pub(crate) down: usize,
    /// Whether the columns are periodic (after the last comes the first again), and the rows.
    pub(crate) periodic: [bool; 2],
}

/// Coordinates in a periodic direction are less than this: beyond, an `f64` would not tell the points of a cell apart.
const FAR: f64 = 1e12;

impl Tiling {
    pub(crate) fn new(cols: usize, rows: usize) -> Self {
        let (across, down) = (cols.div_ceil(SIDE), rows.div_ceil(SIDE));
        Self { cols, rows, across, down, periodic: [false; 2] }
    }

    pub(crate) fn tiles(&self) -> usize {
        self.across * self.down
    }

    /// Whether a tile is its own neighbour along x and along y.
    pub(crate) fn is_own_neighbour(&self) -> [bool; 2] {
        let [across, down] = self.periodic;
        [across && self.across == 1, down && self.down == 1]
    }

    /// The first node of a tile.
    pub(crate) fn first(&self, tile: usize) -> DVec2 {
        DVec2::new((tile % self.across) as f64, (tile / self.across) as f64) * SIDE as f64
    }

    /// The tiles that touch the square `radius` around a point, and perhaps some next to them.
    pub(crate) fn tiles_around(&self, at: DVec2, radius: f64) -> impl Iterator<Item = usize> {
        let across = self.across;
        let columns = tiles_touching(at.x, radius, self.across);
        let rows = tiles_touching(at.y, radius, self.down);
        rows.flat_map(move |y| columns.clone().map(move |x| y * across + x))
    }

    /// Columns and rows of a tile.
    pub(crate) fn size(&self, tile: usize) -> [usize; 2] {
        let (x, y) = (tile % self.across, tile / self.across);
        [SIDE.min(self.cols - x * SIDE), SIDE.min(self.rows - y * SIDE)]
    }

    /// Tile of a node, and its place there: row-major among the nodes of the tile.
    pub(crate) fn locate(&self, col: usize, row: usize) -> (usize, usize) {
        ((row / SIDE) * self.across + col / SIDE, (row % SIDE) * SIDE + col % SIDE)
    }

    /// Column and row of the node at a place of a tile.
    pub(crate) fn node_at(&self, tile: usize, place: usize) -> (usize, usize) {
        let (x, y) = (tile % self.across, tile / self.across);
        (x * SIDE + place % SIDE, y * SIDE + place / SIDE)
    }

    /// The node at a column and a row, modulo the size of the grid where it is periodic; `None` outside.
    pub(crate) fn node(&self, col: isize, row: isize) -> Option<(usize, usize)> {
        let [across, down] = self.periodic;
        Some((wrap(col, self.cols, across)?, wrap(row, self.rows, down)?))
    }

    /// Whether the nodes within `margin` of `count` consecutive tiles of a row reach over the seam of a periodic direction.
    pub(crate) fn is_over_seam(&self, tile: usize, count: usize, margin: usize) -> bool {
        let over =
            |at: usize, tiles: usize, count: usize| at == 0 || (at + tiles) * SIDE + margin > count;
        let [across, down] = self.periodic;
        across && over(tile % self.across, count, self.cols)
            || down && over(tile / self.across, 1, self.rows)
    }

    /// Tile and place in it of the node at a column and a row counted from the first of a tile; `None` outside.
    ///
    /// The last tile of a periodic direction may be wider than what is left of the grid. The places beyond are closed
    /// and never updated, but counted from the tile they are the first nodes of the grid again, for their neighbours to
    /// read.
    pub(crate) fn seen_from(&self, tile: usize, col: isize, row: isize) -> Option<(usize, usize)> {
        let (x, y) = (tile % self.across, tile / self.across);
        let (col, row) = self.node((x * SIDE) as isize + col, (y * SIDE) as isize + row)?;
        Some(self.locate(col, row))
    }

    /// The tile `(dx, dy)` from another.
    pub(crate) fn neighbour(&self, tile: usize, dx: isize, dy: isize) -> Option<usize> {
        let [across, down] = self.periodic;
        let x = wrap((tile % self.across) as isize + dx, self.across, across)?;
        let y = wrap((tile / self.across) as isize + dy, self.down, down)?;
        Some(y * self.across + x)
    }

    /// The neighbours of a tile, each with its direction as a place in [`NEIGHBOURS`].
    pub(crate) fn neighbours(&self, tile: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let &Self { across, down, periodic, .. } = self;
        let (x, y) = (tile % across, tile / across);
        let is_inner = x > 0 && x + 1 < across && y > 0 && y + 1 < down;
        NEIGHBOURS.into_iter().enumerate().filter_map(move |(direction, (dx, dy))| {
            if is_inner {
                return Some((direction, tile.wrapping_add_signed(dy * across as isize + dx)));
            }
            let x = wrap(x as isize + dx, across, periodic[0])?;
            let y = wrap(y as isize + dy, down, periodic[1])?;
            Some((direction, y * across + x))
        })
    }

    /// Tile and place in it, as in [`seen_from`](Self::seen_from), of the nodes of a tile and of those around it, row by row.
    pub(crate) fn places_around(
        &self,
        tile: usize,
    ) -> impl Iterator<Item = Option<(usize, usize)>> + '_ {
        let span = -1..=SIDE as isize;
        span.clone()
            .flat_map(move |row| span.clone().map(move |col| self.seen_from(tile, col, row)))
    }

    /// Least and greatest coordinates of points on the grid.
    pub(crate) fn bounds(&self) -> (DVec2, DVec2) {
        let [across, down] = self.periodic;
        let least = DVec2::new(if across { -FAR } else { 0.0 }, if down { -FAR } else { 0.0 });
        let last = DVec2::new(self.cols as f64, self.rows as f64) - 1.0;
        (least, DVec2::select(least.cmplt(DVec2::ZERO), -least, last))
    }

    pub(crate) fn contains(&self, at: DVec2) -> bool {
        let (least, most) = self.bounds();
        at.cmpge(least).all() && at.cmple(most).all()
    }

    /// Columns (`axis` 0) or rows (1) of the grid between two coordinates.
    pub(crate) fn span(&self, axis: usize, from: f64, to: f64) -> Range<isize> {
        let (least, most) = self.bounds();
        from.max(least[axis]).ceil() as isize..to.min(most[axis]).floor() as isize + 1
    }

    /// The metric at a point from those of the nodes, `None` where closed: bilinear over the open corners of the cell.
    pub(crate) fn bilinear(
        &self,
        at: DVec2,
        metric: impl Fn(isize, isize) -> Option<Sym2>,
    ) -> Option<Sym2> {
        let (col, row) = self.cell(at);
        let inside = at - DVec2::new(col as f64, row as f64);
        let mut sum = Sym2::default();
        let mut weight = 0.0;
        for ((i, j), w) in CORNERS.into_iter().zip(corner_weights(inside)) {
            if let Some(metric) = metric(col + i, row + j) {
                // A little weight for every open corner, so that a point on a closed one has a metric too.
                let w = w + 1e-9;
                sum = sum + metric * w;
                weight += w;
            }
        }
        (weight > 0.0).then(|| sum * (1.0 / weight))
    }

    /// The first corner of the cell that holds a point, or is nearest to it.
    fn cell(&self, at: DVec2) -> (isize, isize) {
        let corner = |axis: usize, count: usize| match at[axis].floor() as isize {
            corner if self.periodic[axis] => corner,
            corner => corner.clamp(0, count.saturating_sub(2) as isize),
        };
        (corner(0, self.cols), corner(1, self.rows))
    }

    /// The shifts from a point to its periodic images between `least` and `most`; in a direction that is not periodic there is
    /// only the point itself.
    pub(crate) fn images(
        &self,
        at: DVec2,
        least: DVec2,
        most: DVec2,
    ) -> impl Iterator<Item = DVec2> + use<> {
        let period = DVec2::new(self.cols as f64, self.rows as f64);
        let (first, last) = ((least - at) / period, (most - at) / period);
        let periodic = self.periodic;
        let along = move |axis: usize| match periodic[axis] {
            true => first[axis].ceil() as isize..=last[axis].floor() as isize,
            false => 0..=0,
        };
        let image = move |i: isize, j: isize| DVec2::new(i as f64, j as f64) * period;
        along(1).flat_map(move |j| along(0).map(move |i| image(i, j)))
    }
}

/// Columns or rows of `count` tiles that come within `radius` of a coordinate, and perhaps one more on either side.
fn tiles_touching(at: f64, radius: f64, count: usize) -> Range<usize> {
    let [from, to] = [at - radius - 1.0, at + radius + 1.0].map(|x| (x / SIDE as f64).floor());
    // `as` clamps to zero and above.
    from as usize..count.min((to + 1.0) as usize)
}

/// `at` if it is below `count`; modulo `count` if periodic, else `None`.
pub(crate) fn wrap(at: isize, count: usize, periodic: bool) -> Option<usize> {
    match usize::try_from(at) {
        Ok(at) if at < count => Some(at),
        _ => periodic.then(|| at.rem_euclid(count as isize) as usize),
    }
}
