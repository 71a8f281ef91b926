//! Where values are kept: while a solve runs, and for those who read them later.

use std::borrow::Cow;
use std::fmt::Debug;
use std::sync::Arc;

use crate::eikonal::source::Seeds;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::tensor_field::TensorTile;
use crate::eikonal::tile::Limits;
use crate::error::Result;
use crate::grid::tiling::{AREA, PaddedTile};

/// Values at the nodes, and what is known of each tile, by the number of the tile, while a solve runs.
///
/// Solving a tile reads the tile and its halo and writes only the tile. The tiles of a round are no neighbours, so that no thread reads what
/// another writes; what is written in one round must be visible in the next.
pub(crate) trait TileStore: Sync {
    /// The values of a tile and of the nodes around it; infinite outside the grid.
    fn read(&self, tile: usize, block: &mut PaddedTile) -> Result<()>;

    /// Stores the values of a tile; those of its halo are ignored, and places beyond the grid stay infinite.
    fn write(&self, tile: usize, block: &PaddedTile) -> Result<()>;

    /// The value at a place of a tile.
    fn value(&self, tile: usize, place: usize) -> Result<f32>;

    /// What is known of a tile; the default if it was never set.
    fn limits(&self, tile: usize) -> Result<Limits>;

    /// Stores what is known of a tile.
    fn set_limits(&self, tile: usize, limits: &Limits) -> Result<()>;

    /// Adds what a solve of the tile found: limits only grow.
    fn raise_limits(&self, tile: usize, found: &Limits) -> Result<()> {
        let known = self.limits(tile)?;
        let limits = Limits {
            margin: known.margin.max(found.margin),
            longest_step: known.longest_step.max(found.longest_step),
        };
        self.set_limits(tile, &limits)
    }

    /// The same values when the solve is over.
    fn into_reader(self) -> Arc<dyn TileReader>;
}

/// What a solve left in a store.
pub(crate) trait TileReader: Debug + Send + Sync {
    /// The values of a tile, row by row.
    fn tile(&self, tile: usize) -> Result<Cow<'_, [f32]>>;

    /// What is known of a tile.
    fn limits(&self, tile: usize) -> Result<Limits>;

    /// The values of so many tiles, and what is known of each, to go on from: a copy, unless the reader can give its own away.
    fn into_tiles(self: Arc<Self>, count: usize) -> Result<(Vec<[f32; AREA]>, Vec<Limits>)> {
        let copy = |tile: usize| {
            let mut values = [0.0; AREA];
            values.copy_from_slice(&self.tile(tile)?);
            Ok((values, self.limits(tile)?))
        };
        (0..count).map(copy).collect()
    }
}

/// What a store holds for a tile before a solve: the start values, the rest unreached; infinite where closed.
pub(crate) fn at_start(tensors: &TensorTile, seeds: Option<&Seeds>) -> [f32; AREA] {
    let mut values = tensors.det.map(|det| if det > 0.0 { UNREACHED } else { f32::INFINITY });
    if let Some(seeds) = seeds {
        for (value, seed) in values.iter_mut().zip(seeds) {
            *value = value.min(*seed);
        }
    }
    values
}
