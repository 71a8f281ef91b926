//! A file becomes heights in metres on a frame.

mod crs;
pub mod synthetic;

use std::path::Path;

pub use self::crs::Crs;
use crate::{GridFrame, Result};

/// Heights at the nodes of a grid, in metres; `NaN` marks a void.
///
/// Row 0 is the northernmost, whatever the file's order was.
#[derive(Clone, Debug)]
pub struct Terrain {
    frame: GridFrame,
    heights: Vec<f64>,
    crs: Crs,
    notes: Vec<String>,
    source: Source,
}

/// What the file said of itself, for `info`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// Name of the format, such as `GeoTIFF` or `ESRI ASCII grid`.
    pub format: String,
    /// Sample type as stored, such as `int16`.
    pub sample: String,
    /// Unit of the stored heights, such as `metre` or `US survey foot`.
    pub height_unit: String,
    /// Metres in one such unit.
    pub metres_per_height_unit: f64,
    /// The nodata value of the file, as written.
    pub nodata: Option<String>,
    /// Whether the rows of the file ran from south to north and were turned.
    pub south_up: bool,
}

impl Terrain {
    /// Heights in metres, row by row from the north; `NaN` or infinite cells become voids.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) if the number of heights is not that of the frame's nodes.
    pub fn new(frame: GridFrame, heights: Vec<f64>, crs: Crs) -> Result<Self> {
        todo!()
    }

    /// Reads a DEM. The format is told by content first, by extension second.
    ///
    /// # Errors
    /// A file that is damaged, of an unsupported kind, or does not say how big its cells are on the
    /// ground; each says what to do.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        todo!()
    }

    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Heights in metres, row-major from the north-west; `NaN` where void.
    #[must_use]
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// The coordinate reference system.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Things the reader noticed that a user should know, a sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the file said of itself.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Whether the node is a void.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        self.heights[self.frame.index(col, row)].is_nan()
    }

    /// Number of voids, and smallest, largest and mean height in metres (`None` if all are void).
    #[must_use]
    pub fn statistics(&self) -> (usize, Option<[f64; 3]>) {
        todo!()
    }
}
