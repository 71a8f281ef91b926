//! The formats that heights are read from, a file each.

pub(super) mod ascii_grid;
pub(super) mod geotiff;
pub(super) mod hgt;
mod tiff;
