//! The values that a solve left, for all that reads them later.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::tile_store::{TileReader, TileStore};
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::tile::Limits;
use crate::error::{Error, Result};
use crate::grid::tiling::{AREA, Tiling};

/// Values at the nodes, in the field's stored units, where a solve left them. Clones share them.
///
/// A value that the store cannot read counts as unreached, so that reading one is not a matter of [`Result`] at every node. The first failure is
/// remembered by all clones; what can fail asks for it by [`check`](Self::check) when it has read all it needs.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    tiling: Tiling,
    reader: Arc<dyn TileReader>,
    failure: Arc<OnceLock<Error>>,
}

impl Values {
    pub(crate) fn new(tiling: Tiling, store: impl TileStore) -> Self {
        Self { tiling, reader: store.into_reader(), failure: Arc::default() }
    }

    pub(crate) fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// The value at a place of a tile.
    pub(crate) fn at(&self, tile: usize, place: usize) -> f32 {
        self.tile(tile)[place]
    }

    /// The values of a tile.
    pub(crate) fn tile(&self, tile: usize) -> Cow<'_, [f32]> {
        self.reader.tile(tile).unwrap_or_else(|error| {
            self.failure.get_or_init(|| error);
            Cow::Borrowed(&[UNREACHED; AREA])
        })
    }

    /// A copy of the values of a tile.
    pub(crate) fn copy_tile(&self, tile: usize) -> [f32; AREA] {
        let mut copy = [0.0; AREA];
        copy.copy_from_slice(&self.tile(tile));
        copy
    }

    /// All tiles and what is known of each, as [`TileReader::into_tiles`].
    pub(super) fn into_tiles(self) -> Result<(Vec<[f32; AREA]>, Vec<Limits>)> {
        self.reader.into_tiles(self.tiling.tiles())
    }

    /// How many nodes have a value.
    pub(crate) fn reached(&self) -> usize {
        (0..self.tiling.tiles()).map(|tile| count_reached(&self.tile(tile))).sum()
    }

    /// # Errors
    /// The first failure of the store, if there was any.
    pub(crate) fn check(&self) -> Result<()> {
        self.failure.get().map_or(Ok(()), |error| Err(error.clone()))
    }
}

/// How many of these nodes have a value.
pub(crate) fn count_reached(values: &[f32]) -> usize {
    values.iter().filter(|&&value| value < UNREACHED).count()
}

#[cfg(test)]
impl PartialEq for Values {
    fn eq(&self, other: &Self) -> bool {
        self.tiling == other.tiling
            && (0..self.tiling.tiles()).all(|tile| self.tile(tile) == other.tile(tile))
    }
}
