//! Places: how people write them.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::terrain::Georeference;

/// A place as it was given: not yet on a grid.
///
/// ```
/// use ridgeway::plan::Place;
///
/// assert_eq!("lonlat:1.62,42.57".parse::<Place>()?, Place::lonlat(1.62, 42.57));
/// assert_eq!(Place::pixel(3.0, 4.5).to_string(), "pixel:3,4.5");
/// # Ok::<(), ridgeway::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// Two numbers and what they mean.
    At(Notation, DVec2),
    /// The geometry of a GeoJSON file.
    File(PathBuf),
}

/// What two numbers mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notation {
    /// Map coordinates of the DEM.
    Map,
    /// Longitude and latitude in degrees, WGS84.
    LonLat,
    /// Column and row.
    Pixel,
}

impl Place {
    /// Map coordinates of the DEM.
    #[must_use]
    pub fn map(x: f64, y: f64) -> Self {
        Self::At(Notation::Map, DVec2::new(x, y))
    }

    /// Longitude and latitude in degrees, WGS84.
    #[must_use]
    pub fn lonlat(lon: f64, lat: f64) -> Self {
        Self::At(Notation::LonLat, DVec2::new(lon, lat))
    }

    /// Column and row of the grid from the north-west; whole numbers are the centres of cells.
    #[must_use]
    pub fn pixel(col: f64, row: f64) -> Self {
        Self::At(Notation::Pixel, DVec2::new(col, row))
    }
}

impl FromStr for Place {
    type Err = Error;

    /// Reads `X,Y`, `lonlat:LON,LAT`, `pixel:COL,ROW` or the name of a GeoJSON file.
    ///
    /// # Errors
    /// [`Error::Argument`] that says which form was expected.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = |expected: &str| Error::argument("the place", text, expected);
        if let Some(rest) = text.strip_prefix(Notation::LonLat.prefix()) {
            return match pair(rest) {
                Some(at) => Ok(Self::At(Notation::LonLat, at)),
                None => Err(wrong("lonlat:LON,LAT, for example lonlat:1.62,42.57")),
            };
        }
        if let Some(rest) = text.strip_prefix(Notation::Pixel.prefix()) {
            return match pair(rest) {
                Some(at) => Ok(Self::At(Notation::Pixel, at)),
                None => Err(wrong("pixel:COL,ROW, for example pixel:40,60")),
            };
        }
        if let Some(at) = pair(text) {
            return Ok(Self::At(Notation::Map, at));
        }
        let path = PathBuf::from(text);
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        if extension.is_some_and(|e| e == "geojson" || e == "json") {
            return Ok(Self::File(path));
        }
        Err(wrong("X,Y, lonlat:LON,LAT, pixel:COL,ROW or a .geojson file"))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At(notation, at) => write!(f, "{}{},{}", notation.prefix(), at.x, at.y),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl Notation {
    fn prefix(self) -> &'static str {
        match self {
            Self::Map => "",
            Self::LonLat => "lonlat:",
            Self::Pixel => "pixel:",
        }
    }

    /// What the two numbers are called.
    pub(super) fn axes(self) -> &'static str {
        match self {
            Self::Map => "x and y",
            Self::LonLat => "longitude and latitude",
            Self::Pixel => "column and row",
        }
    }

    /// Grid coordinates of two numbers.
    ///
    /// # Errors
    /// Longitude and latitude without a CRS, or that cannot be projected.
    pub fn to_grid(self, at: DVec2, georeference: &Georeference) -> Result<DVec2> {
        match self {
            Self::Map => Ok(georeference.frame().to_grid(at)),
            Self::LonLat => georeference.from_lonlat(at),
            Self::Pixel => Ok(at),
        }
    }

    /// Grid coordinates written in this notation, to about a hundredth of a cell.
    ///
    /// # Errors
    /// Longitude and latitude without a CRS, or that cannot be projected.
    pub fn write(self, grid: DVec2, georeference: &Georeference) -> Result<String> {
        let frame = georeference.frame();
        let (at, cell) = match self {
            Self::Map => (frame.to_map(grid), frame.step().min_element()),
            Self::LonLat => {
                (georeference.to_lonlat(grid)?, frame.mid_spacing().min_element() / 111_000.0)
            }
            Self::Pixel => (grid, 1.0),
        };
        let [x, y] = at.to_array().map(|value| coordinate(value, cell));
        Ok(format!("{}{x},{y}", self.prefix()))
    }
}

/// Two finite numbers `X,Y`.
fn pair(text: &str) -> Option<DVec2> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let (x, y) = text.split_once(',')?;
    Some(DVec2::new(number(x)?, number(y)?))
}

/// A coordinate as text, rounded to about a hundredth of a cell; `cell` is the cell's size in the unit of the coordinate.
#[must_use]
pub fn coordinate(value: f64, cell: f64) -> String {
    let decimals = (2.0 - cell.log10()).ceil().clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_parse_and_print_alike() {
        for text in ["388400,4711200", "-1.5,-2", "lonlat:-71.5,42", "pixel:3,4.5", "a/b.geojson"] {
            assert_eq!(text.parse::<Place>().unwrap().to_string(), text);
        }
        for text in ["", "3", "3,", "lonlat:a.geojson", "pixel:3", "nan,3", "valley.tif"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
    }

    #[test]
    fn coordinates_have_the_digits_that_matter() {
        assert_eq!(coordinate(500_000.123_4, 30.0), "500000.1");
        assert_eq!(coordinate(1.0 / 1200.0, 1e-5 / 1200.0), "0.00083333333");
        assert_eq!(coordinate(1.999_583_333, 1.0 / 1200.0), "1.999583");
    }
}
