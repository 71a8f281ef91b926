//! Terrains: files are read into heights in metres on a grid.
//!
//! ```text
//! file ──▶ a format is recognised ──▶ raster ──▶ terrain: metres, NaN for voids, row 0 in the north
//!          by content, then by name   as stored
//! ```
//!
//! [`Terrain::open`] reads heights, [`read_bands`] any other raster. A [`Georeference`] says where the nodes lie on
//! the map and on the Earth.
//!
//! A new format is one file in `formats/` and one line in the list of `formats/mod.rs`.

mod bands;
mod crs;
mod formats;
mod georeference;
mod raster;
#[expect(clippy::module_inception, reason = "the folder is named after its main type")]
mod terrain;

pub use self::bands::{RasterBands, read_bands};
pub use self::crs::Crs;
#[cfg(feature = "export")]
pub(crate) use self::crs::GeoKeys;
pub use self::georeference::Georeference;
pub use self::raster::{HeightUnit, Source};
pub use self::terrain::Terrain;
