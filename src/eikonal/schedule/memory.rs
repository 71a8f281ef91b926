//! A tile store in memory, shared by all threads.

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use rayon::prelude::*;

use super::tile_store::{TileReader, TileStore, at_start};
use super::values::Values;
use crate::eikonal::source::Seeds;
use crate::eikonal::tensor_field::TensorField;
use crate::eikonal::tile::Limits;
use crate::error::Result;
use crate::grid::tiling::{AREA, PaddedTile, SIDE, Tiling};

/// Fewest tiles that a thread fills. A small field is filled by one thread alone: waiting for another, it might take up other work of the
/// pool that takes many times as long.
const MIN_TILES: usize = 1024;

/// A [`TileStore`] that holds all tiles in memory.
#[derive(Debug)]
pub(crate) struct MemoryStore {
    pub(crate) values: SharedValues,
    limits: Vec<SharedLimits>,
}

impl MemoryStore {
    /// A store whose values must be set before they are read. The system provides zeroed memory only as it is first written, so that this
    /// is cheap.
    pub(crate) fn unset(tiling: Tiling) -> Self {
        let nodes = bytemuck::zeroed_vec(tiling.tiles() * AREA);
        let limits = (0..tiling.tiles()).map(|_| SharedLimits::default()).collect();
        Self { values: SharedValues { tiling, nodes, outside: f32::INFINITY }, limits }
    }

    /// The start values; the rest unreached.
    pub(crate) fn seeded(field: &TensorField, seeds: &[Option<Box<Seeds>>]) -> Self {
        let start = |tile: usize| at_start(field.tensors(tile), seeds[tile].as_deref());
        Self::filled(field.tiling, start)
    }

    /// What a solve left, to go on from: a copy, unless it is in memory and nobody else reads it.
    ///
    /// # Errors
    /// Those of the store that the solve left it in.
    pub(crate) fn continuing(values: Values) -> Result<Self> {
        let tiling = values.tiling();
        let (tiles, limits) = values.into_tiles()?;
        let limits = limits.into_iter().map(SharedLimits::new).collect();
        Ok(Self { values: SharedValues::new(tiling, tiles, f32::INFINITY), limits })
    }

    /// The given values of each tile.
    pub(crate) fn filled(
        tiling: Tiling,
        values: impl Fn(usize) -> [f32; AREA] + Sync + Send,
    ) -> Self {
        let tiles = (0..tiling.tiles()).into_par_iter().with_min_len(MIN_TILES);
        Self {
            values: SharedValues::new(tiling, tiles.map(values).collect(), f32::INFINITY),
            limits: (0..tiling.tiles()).map(|_| SharedLimits::default()).collect(),
        }
    }

    /// Lowers values to those of the start.
    pub(crate) fn seed(&self, seeds: &[Option<Box<Seeds>>]) {
        for (tile, seeds) in seeds.iter().enumerate() {
            let Some(seeds) = seeds else { continue };
            for (place, &seed) in seeds.iter().enumerate() {
                self.values.set(tile, place, seed.min(self.values.at(tile, place)));
            }
        }
    }

    /// What is known of a tile.
    pub(crate) fn known_limits(&self, tile: usize) -> Limits {
        self.limits[tile].get()
    }

    /// Resets what is known of a tile.
    pub(crate) fn forget_limits(&self, tile: usize) {
        self.limits[tile].set(&Limits::default());
    }
}

impl TileStore for MemoryStore {
    fn read(&self, tile: usize, block: &mut PaddedTile) -> Result<()> {
        self.values.read(tile, block);
        Ok(())
    }

    fn write(&self, tile: usize, block: &PaddedTile) -> Result<()> {
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

    fn into_reader(self) -> Arc<dyn TileReader> {
        let limits = self.limits.iter().map(SharedLimits::get).collect();
        Arc::new(TilesInMemory { tiles: self.values.into_tiles(), limits })
    }
}

/// What a solve left in memory.
#[derive(Clone, Debug)]
struct TilesInMemory {
    tiles: Vec<[f32; AREA]>,
    limits: Vec<Limits>,
}

impl TileReader for TilesInMemory {
    fn tile(&self, tile: usize) -> Result<Cow<'_, [f32]>> {
        Ok(Cow::Borrowed(&self.tiles[tile]))
    }

    fn limits(&self, tile: usize) -> Result<Limits> {
        Ok(self.limits[tile])
    }

    fn into_tiles(self: Arc<Self>, _: usize) -> Result<(Vec<[f32; AREA]>, Vec<Limits>)> {
        let Self { tiles, limits } = Arc::unwrap_or_clone(self);
        Ok((tiles, limits))
    }
}

/// [`Limits`] as the bits of their numbers.
#[derive(Debug, Default)]
struct SharedLimits([AtomicU32; 2]);

impl SharedLimits {
    fn new(limits: Limits) -> Self {
        let shared = Self::default();
        shared.set(&limits);
        shared
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
    pub(crate) fn new(tiling: Tiling, tiles: Vec<[f32; AREA]>, outside: f32) -> Self {
        let nodes = tiles.into_flattened().into_iter();
        let nodes = nodes.map(|value| AtomicU32::new(value.to_bits())).collect();
        Self { tiling, nodes, outside }
    }

    pub(crate) fn into_tiles(self) -> Vec<[f32; AREA]> {
        let nodes: Vec<f32> =
            self.nodes.into_iter().map(|bits| f32::from_bits(bits.into_inner())).collect();
        bytemuck::allocation::cast_vec(nodes)
    }

    fn tile(&self, tile: usize) -> &[AtomicU32] {
        &self.nodes[tile * AREA..][..AREA]
    }

    pub(crate) fn at(&self, tile: usize, place: usize) -> f32 {
        f32::from_bits(self.tile(tile)[place].load(Relaxed))
    }

    /// Stores a value.
    pub(crate) fn set(&self, tile: usize, place: usize, value: f32) {
        self.tile(tile)[place].store(value.to_bits(), Relaxed);
    }

    /// The values of a tile and of the nodes around it.
    pub(crate) fn read(&self, tile: usize, block: &mut PaddedTile) {
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
    fn read_over_seam(&self, tile: usize, block: &mut PaddedTile) {
        for (node, place) in
            block.as_flattened_mut().iter_mut().zip(self.tiling.places_around(tile))
        {
            *node = place.map_or(self.outside, |(tile, place)| self.at(tile, place));
        }
    }

    /// Stores the values of a tile.
    pub(crate) fn write(&self, tile: usize, block: &PaddedTile) {
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
