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

/// `value` rounded to `decimals` decimals.
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

/// A length with its unit: `823 m`, `12.34 km`; under a hundredth of a millimetre, which only
/// rounding makes, `0 m`.
#[must_use]
pub fn metres(value: f64) -> String {
    if value.abs() < 1e-5 {
        "0 m".into()
    } else if value.abs() >= 10_000.0 {
        format!("{:.2} km", value / 1000.0)
    } else if value.abs() >= 100.0 {
        format!("{value:.0} m")
    } else {
        format!("{} m", digits(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(digits(0.012_345_6), "0.01235");
        assert_eq!(digits(3.0), "3.000");
        assert_eq!(digits(123_456.7), "123457");
        assert_eq!(digits(1.5e-9), "1.500e-9");
        assert_eq!(digits(f64::NAN), "NaN");
        assert_eq!(metres(12_344.0), "12.34 km");
        assert_eq!(metres(823.4), "823 m");
        assert_eq!(metres(0.007_108), "0.007108 m");
        assert_eq!(metres(-2.7e-13), "0 m");
    }
}
