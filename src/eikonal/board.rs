//! The values while they are being solved, shared by all threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use super::field::{AREA, SIDE, Tiling};
use super::tile::{Block, Limits};
use super::tiles::Values;

/// Values at the nodes as the bits of `f32`, tile by tile.
///
/// The threads of a round write tiles that do not touch, so that nobody reads what another writes, and nothing is
/// copied from thread to thread: a tile stays in the cache of the one that solved it last. The accesses are atomic only to
/// tell the compiler that this is safe; relaxed ones cost what plain ones do. The end of a round orders them.
#[derive(Debug)]
pub(super) struct Board {
    tiling: Tiling,
    nodes: Vec<AtomicU32>,
    /// What is read outside the grid.
    outside: f32,
}

impl Board {
    pub(super) fn new(values: Values, outside: f32) -> Self {
        let nodes = values.tiles.into_flattened();
        Self {
            tiling: values.tiling,
            outside,
            nodes: nodes.into_iter().map(|value| AtomicU32::new(value.to_bits())).collect(),
        }
    }

    /// A board none of whose tiles is filled: not to be read before. Fresh memory is given by the system when it is first written.
    pub(super) fn unfilled(tiling: Tiling, outside: f32) -> Self {
        Self { tiling, nodes: bytemuck::zeroed_vec(tiling.tiles() * AREA), outside }
    }

    pub(super) fn into_values(self) -> Values {
        let nodes: Vec<f32> =
            self.nodes.into_iter().map(|bits| f32::from_bits(bits.into_inner())).collect();
        Values { tiling: self.tiling, tiles: bytemuck::allocation::cast_vec(nodes) }
    }

    fn tile(&self, tile: usize) -> &[AtomicU32] {
        &self.nodes[tile * AREA..][..AREA]
    }

    pub(super) fn at(&self, tile: usize, place: usize) -> f32 {
        f32::from_bits(self.tile(tile)[place].load(Relaxed))
    }

    /// A tile and the nodes around it.
    pub(super) fn load(&self, tile: usize, block: &mut Block) {
        if self.tiling.is_over_seam(tile, 1, 1) {
            return self.load_over_seam(tile, block);
        }
        let outside = self.outside;
        let (tx, ty) = (tile % self.tiling.across, tile / self.tiling.across);
        for (j, line) in block.iter_mut().enumerate() {
            // Row and column of the block, counted in nodes from the tile before the first.
            let row = ty * SIDE + SIDE + j - 1;
            let (ny, y) = (row / SIDE, row % SIDE);
            if ny == 0 || ny > self.tiling.down {
                *line = [outside; SIDE + 2];
                continue;
            }
            let base = (ny - 1) * self.tiling.across;
            let at = |nx: usize, x: usize| self.at(base + nx, y * SIDE + x);
            line[0] = if tx > 0 { at(tx - 1, SIDE - 1) } else { outside };
            let middle = &self.tile(base + tx)[y * SIDE..][..SIDE];
            for (value, bits) in line[1..=SIDE].iter_mut().zip(middle) {
                *value = f32::from_bits(bits.load(Relaxed));
            }
            line[SIDE + 1] = if tx + 1 < self.tiling.across { at(tx + 1, 0) } else { outside };
        }
    }

    /// [`load`](Self::load) node by node.
    fn load_over_seam(&self, tile: usize, block: &mut Block) {
        for (row, line) in (-1..).zip(block) {
            for (col, value) in (-1..).zip(line) {
                let place = self.tiling.seen_from(tile, col, row);
                *value = place.map_or(self.outside, |(tile, place)| self.at(tile, place));
            }
        }
    }

    /// Puts a solved tile back.
    pub(super) fn store(&self, tile: usize, block: &Block) {
        for (line, solved) in self.tile(tile).chunks_exact(SIDE).zip(&block[1..]) {
            for (bits, value) in line.iter().zip(&solved[1..=SIDE]) {
                bits.store(value.to_bits(), Relaxed);
            }
        }
        if self.tiling.is_over_seam(tile, 1, 1) {
            self.close_beyond(tile);
        }
    }

    /// Puts values at all places of a tile.
    pub(super) fn fill(&self, tile: usize, values: &[f32; AREA]) {
        for (bits, value) in self.tile(tile).iter().zip(values) {
            bits.store(value.to_bits(), Relaxed);
        }
    }

    /// Puts the places of a tile beyond the grid outside again.
    fn close_beyond(&self, tile: usize) {
        let [cols, rows] = self.tiling.size(tile);
        for (row, line) in self.tile(tile).chunks_exact(SIDE).enumerate() {
            for bits in &line[if row < rows { cols } else { 0 }..] {
                bits.store(self.outside.to_bits(), Relaxed);
            }
        }
    }
}

/// What is known of each tile, shared and written as the values are: [`Limits`] as the bits of their numbers.
#[derive(Debug)]
pub(super) struct LimitsBoard(Vec<[AtomicU32; 2]>);

impl LimitsBoard {
    pub(super) fn new(limits: Vec<Limits>) -> Self {
        let bits = |Limits { slack, longest_step }| {
            [slack, longest_step].map(|limit: f32| AtomicU32::new(limit.to_bits()))
        };
        Self(limits.into_iter().map(bits).collect())
    }

    pub(super) fn into_limits(self) -> Vec<Limits> {
        (0..self.0.len()).map(|tile| self.at(tile)).collect()
    }

    pub(super) fn at(&self, tile: usize) -> Limits {
        let limit = |k: usize| f32::from_bits(self.0[tile][k].load(Relaxed));
        Limits { slack: limit(0), longest_step: limit(1) }
    }

    /// Nothing is known of the tile any more.
    pub(super) fn forget(&self, tile: usize) {
        self.0[tile].iter().for_each(|limit| limit.store(0, Relaxed));
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Limits> {
        (0..self.0.len()).map(|tile| self.at(tile))
    }

    /// What a solve of the tile found: limits only grow.
    pub(super) fn raise(&self, tile: usize, found: &Limits) {
        let known = self.at(tile);
        let slack = known.slack.max(found.slack);
        let longest_step = known.longest_step.max(found.longest_step);
        self.0[tile][0].store(slack.to_bits(), Relaxed);
        self.0[tile][1].store(longest_step.to_bits(), Relaxed);
    }
}
