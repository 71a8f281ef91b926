//! The bands of rasters that hold no heights.

use std::path::Path;

use super::Crs;
use super::formats::{self, ReadMode};
use super::raster::void_infinite;
use crate::error::Result;
use crate::grid::GridFrame;

/// The bands of a raster that does not hold heights.
#[derive(Clone, Debug)]
pub struct RasterBands {
    /// The grid.
    pub frame: GridFrame,
    /// The coordinate reference system.
    pub crs: Crs,
    /// The values of each band, row-major from the north-west; `NaN` where there is no value.
    pub bands: Vec<Vec<f64>>,
}

/// Reads all bands of a raster, such as a tensor field, in the formats that
/// [`Terrain::open`](super::Terrain::open) reads.
///
/// # Errors
/// As [`Terrain::open`](super::Terrain::open).
pub fn read_bands(path: impl AsRef<Path>) -> Result<RasterBands> {
    let path = path.as_ref();
    let mut raster = formats::read(path, ReadMode::Bands)?;
    let frame = raster.turn_north_up(path)?;
    raster.bands.iter_mut().for_each(|band| void_infinite(band));
    Ok(RasterBands { frame, crs: raster.crs, bands: raster.bands })
}
