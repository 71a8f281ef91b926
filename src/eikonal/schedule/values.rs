//! The values of all nodes, tile by tile.

use rayon::prelude::*;

use crate::eikonal::source::Seeds;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::tensor_field::{TensorField, TensorTile};
use crate::grid::tiling::{AREA, Tiling};

/// Fewest tiles that a thread fills. A small field is filled by one thread alone: waiting for another, it might take up other work of the
/// pool that takes many times as long.
const MIN_TILES: usize = 1024;

/// Values at the nodes, tile by tile, in the field's stored units: infinite where closed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Values {
    tiling: Tiling,
    tiles: Vec<[f32; AREA]>,
}

impl Values {
    pub(crate) fn new(tiling: Tiling, tiles: Vec<[f32; AREA]>) -> Self {
        Self { tiling, tiles }
    }

    pub(crate) fn tiling(&self) -> Tiling {
        self.tiling
    }

    pub(crate) fn tile(&self, tile: usize) -> &[f32; AREA] {
        &self.tiles[tile]
    }

    pub(crate) fn tile_mut(&mut self, tile: usize) -> &mut [f32; AREA] {
        &mut self.tiles[tile]
    }

    pub(crate) fn into_tiles(self) -> Vec<[f32; AREA]> {
        self.tiles
    }

    /// The start values; the rest unreached.
    pub(crate) fn seeded(field: &TensorField, seeds: &[Option<Box<Seeds>>]) -> Self {
        let start = |tile: usize| at_start(field.tensors(tile), seeds[tile].as_deref());
        let tiles =
            (0..field.tiling.tiles()).into_par_iter().with_min_len(MIN_TILES).map(start).collect();
        Self { tiling: field.tiling, tiles }
    }

    /// Lowers values to those of the start.
    pub(crate) fn seed(&mut self, seeds: &[Option<Box<Seeds>>]) {
        for (tile, seeds) in self.tiles.iter_mut().zip(seeds) {
            seeds.iter().for_each(|seeds| lower(tile, seeds));
        }
    }

    /// How many nodes have a value.
    pub(crate) fn reached(&self) -> usize {
        self.tiles.as_flattened().iter().filter(|&&value| value < UNREACHED).count()
    }

    pub(crate) fn get(&self, col: usize, row: usize) -> f32 {
        let (tile, place) = self.tiling.place(col, row);
        self.tiles[tile][place]
    }

    pub(crate) fn lower(&mut self, col: usize, row: usize, value: f32) {
        let (tile, place) = self.tiling.place(col, row);
        let old = &mut self.tiles[tile][place];
        *old = old.min(value);
    }
}

/// The values of a tile before the solve: those of the start, the rest unreached.
pub(crate) fn at_start(tensors: &TensorTile, seeds: Option<&Seeds>) -> [f32; AREA] {
    let mut values = tensors.det.map(|det| if det > 0.0 { UNREACHED } else { f32::INFINITY });
    seeds.into_iter().for_each(|seeds| lower(&mut values, seeds));
    values
}

fn lower(values: &mut [f32; AREA], seeds: &Seeds) {
    for (value, seed) in values.iter_mut().zip(seeds) {
        *value = value.min(*seed);
    }
}
