//! Where the values of a solve are kept while it runs.

use crate::eikonal::tile::{Block, Limits};
use crate::error::Result;

/// Values at the nodes, and what is known of each tile, by the number of the tile.
///
/// Solving a tile reads the tile and its halo and writes only the tile. The tiles of a round are no neighbours, so that no thread reads what
/// another writes; what is written in one round must be visible in the next.
pub(crate) trait TileStore: Sync {
    /// The values of a tile and of the nodes around it; infinite outside the grid.
    fn read(&self, tile: usize, block: &mut Block) -> Result<()>;

    /// Stores the values of a tile; those of its halo are ignored, and places beyond the grid stay infinite.
    fn write(&self, tile: usize, block: &Block) -> Result<()>;

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
}
