//! Routes, isolines and rasters for other programs.
//!
//! Nothing here decides where a file goes: the functions make content, [`write_file`] and
//! [`write_folder`] put it in place whole or not at all.

mod antimeridian;
mod atomic;
mod geojson;
mod geotiff;
mod gpx;
mod profile;

pub use self::atomic::{check_folder_free, check_free, write_file, write_folder};
pub use self::geojson::{isolines_geojson, regions_geojson, routes_geojson};
pub use self::geotiff::{Band, Samples, write_geotiff};
pub use self::gpx::routes_gpx;
pub use self::profile::write_profiles;

/// `value` to so many decimals.
fn round(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

/// A number to four significant digits; whole ones under ten million are all kept.
#[must_use]
pub fn digits(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    if value == 0.0 {
        "0".into()
    } else if (-3.0..7.0).contains(&magnitude) {
        format!("{value:.*}", (3.0 - magnitude).max(0.0) as usize)
    } else {
        format!("{value:.3e}")
    }
}
