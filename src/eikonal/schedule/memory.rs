//! A tile store in memory, shared by all threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use super::tile_store::TileStore;
use super::values::Values;
use crate::eikonal::tile::{Block, Limits};
use crate::error::Result;
use crate::grid::tiling::{AREA, SIDE, Tiling};

/// A [`TileStore`] that holds all tiles in memory.
#[derive(Debug)]
pub(crate) struct MemoryStore {
    pub(crate) values: SharedValues,
    limits: Vec<SharedLimits>,
}

impl MemoryStore {
    pub(crate) fn new(values: Values, limits: Vec<Limits>) -> Self {
        Self {
            values: SharedValues::new(values, f32::INFINITY),
            limits: limits.into_iter().map(SharedLimits::new).collect(),
        }
    }

    /// A store whose values must be set before they are read. The system provides zeroed memory only as it is first written, so that this
    /// is cheap.
    pub(crate) fn unset(tiling: Tiling) -> Self {
        let nodes = bytemuck::zeroed_vec(tiling.tiles() * AREA);
        let limits = (0..tiling.tiles()).map(|_| SharedLimits::default()).collect();
        Self { values: SharedValues { tiling, nodes, outside: f32::INFINITY }, limits }
    }

    /// What is known of a tile.
    pub(crate) fn known_limits(&self, tile: usize) -> Limits {
        self.limits[tile].get()
    }

    /// Resets what is known of a tile.
    pub(crate) fn forget_limits(&self, tile: usize) {
        self.limits[tile].set(&Limits::default());
    }

    pub(crate) fn into_parts(self) -> (Values, Vec<Limits>) {
        (self.values.into_values(), self.limits.iter().map(SharedLimits::get).collect())
    }
}

impl TileStore for MemoryStore {
    fn read(&self, tile: usize, block: &mut Block) -> Result<()> {
        self.values.read(tile, block);
        Ok(())
    }

    fn write(&self, tile: usize, block: &Block) -> Result<()> {
        self.values.write(tile, block);
        Ok(())
    }

    fn value(&self, tile: usize, place: usize) -> Result<f32> {
        Ok(self.values.at(tile, place))
    }

    fn limits(&self, tile: usize) -> Result<Limits> {
        Ok(self.known_limits(tile))
    }

    fn set_limits(&self, tile: usize, limits: &Limits) -> Result<()> {
        self.limits[tile].set(limits);
        Ok(())
    }
}

/// [`Limits`] as the bits of their numbers.
#[derive(Debug, Default)]
struct SharedLimits([AtomicU32; 2]);

impl SharedLimits {
    fn new(Limits { margin, longest_step }: Limits) -> Self {
        Self([margin, longest_step].map(|limit| AtomicU32::new(limit.to_bits())))
    }

    fn get(&self) -> Limits {
        let [margin, longest_step] =
            self.0.each_ref().map(|limit| f32::from_bits(limit.load(Relaxed)));
        Limits { margin, longest_step }
    }

    fn set(&self, &Limits { margin, longest_step }: &Limits) {
        for (bits, limit) in self.0.iter().zip([margin, longest_step]) {
            bits.store(limit.to_bits(), Relaxed);
        }
    }
}

/// Values at the nodes as the bits of `f32`, tile by tile.
///
/// The tiles that the threads write in a round are no neighbours, so that no thread reads what another writes, and nothing is
/// copied from thread to thread: a tile stays in the cache of the core that solved it last. The accesses are atomic only to
/// tell the compiler that this is safe; relaxed ones cost what plain ones do. The end of a round orders them.
#[derive(Debug)]
pub(crate) struct SharedValues {
    tiling: Tiling,
    nodes: Vec<AtomicU32>,
    /// What is read outside the grid.
    outside: f32,
}

impl SharedValues {
    pub(crate) fn new(values: Values, outside: f32) -> Self {
        let tiling = values.tiling();
        let nodes = values.into_tiles().into_flattened();
        Self {
            tiling,
            outside,
            nodes: nodes.into_iter().map(|value| AtomicU32::new(value.to_bits())).collect(),
        }
    }

    pub(crate) fn into_values(self) -> Values {
        let nodes: Vec<f32> =
            self.nodes.into_iter().map(|bits| f32::from_bits(bits.into_inner())).collect();
        Values::new(self.tiling, bytemuck::allocation::cast_vec(nodes))
    }

    fn tile(&self, tile: usize) -> &[AtomicU32] {
        &self.nodes[tile * AREA..][..AREA]
    }

    pub(crate) fn at(&self, tile: usize, place: usize) -> f32 {
        f32::from_bits(self.tile(tile)[place].load(Relaxed))
    }

    /// The values of a tile and of the nodes around it.
    pub(crate) fn read(&self, tile: usize, block: &mut Block) {
        if self.tiling.is_over_seam(tile, 1, 1) {
            return self.read_over_seam(tile, block);
        }
        let outside = self.outside;
        let (tx, ty) = (tile % self.tiling.across, tile / self.tiling.across);
        for (j, line) in block.iter_mut().enumerate() {
            // The row of the grid, counted from one tile above the first row so that it is not negative.
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

    /// [`read`](Self::read) node by node, for tiles at the seam of a periodic direction.
    fn read_over_seam(&self, tile: usize, block: &mut Block) {
        for (node, place) in
            block.as_flattened_mut().iter_mut().zip(self.tiling.places_around(tile))
        {
            *node = place.map_or(self.outside, |(tile, place)| self.at(tile, place));
        }
    }

    /// Stores the values of a tile.
    pub(crate) fn write(&self, tile: usize, block: &Block) {
        for (line, solved) in self.tile(tile).chunks_exact(SIDE).zip(&block[1..]) {
            for (bits, value) in line.iter().zip(&solved[1..=SIDE]) {
                bits.store(value.to_bits(), Relaxed);
            }
        }
        if self.tiling.is_over_seam(tile, 1, 1) {
            self.close_beyond(tile);
        }
    }

    /// Stores values at all places of a tile.
    pub(crate) fn fill(&self, tile: usize, values: &[f32; AREA]) {
        for (bits, value) in self.tile(tile).iter().zip(values) {
            bits.store(value.to_bits(), Relaxed);
        }
    }

    /// Sets the places of a tile that lie beyond the grid to `outside` again.
    fn close_beyond(&self, tile: usize) {
        let [cols, rows] = self.tiling.size(tile);
        for (row, line) in self.tile(tile).chunks_exact(SIDE).enumerate() {
            for bits in &line[if row < rows { cols } else { 0 }..] {
                bits.store(self.outside.to_bits(), Relaxed);
            }
        }
    }
}
