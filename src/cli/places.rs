//! Places: how the user writes them, and where they lie on the grid.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use geo_types::Geometry;
use geojson::GeoJson;
use glam::DVec2;
use ridgeway::grid::Shapes;
use ridgeway::terrain::Georeference;
use ridgeway::{Error, GridFrame, Result, StartRegion, Terrain};

use crate::args::pair;
use crate::report::coordinate;

/// A place as the user wrote it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Place {
    At(Notation, DVec2),
    File(PathBuf),
}

/// What two numbers mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Notation {
    /// Map coordinates of the DEM.
    Map,
    /// Longitude and latitude in degrees, WGS84.
    LonLat,
    /// Column and row.
    Pixel,
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if let Some(rest) = text.strip_prefix("lonlat:") {
            return pair(rest)
                .map(|at| Self::At(Notation::LonLat, at))
                .map_err(|_| "expected lonlat:LON,LAT, for example lonlat:1.62,42.57".into());
        }
        if let Some(rest) = text.strip_prefix("pixel:") {
            return pair(rest)
                .map(|at| Self::At(Notation::Pixel, at))
                .map_err(|_| "expected pixel:COL,ROW, for example pixel:40,60".into());
        }
        if let Ok(at) = pair(text) {
            return Ok(Self::At(Notation::Map, at));
        }
        let path = PathBuf::from(text);
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        if extension.is_some_and(|e| e == "geojson" || e == "json") {
            return Ok(Self::File(path));
        }
        Err("expected X,Y, lonlat:LON,LAT, pixel:COL,ROW or a .geojson file".into())
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

    /// Grid coordinates of two numbers.
    fn to_grid(self, at: DVec2, georeference: &Georeference) -> Result<DVec2> {
        match self {
            Self::Map => Ok(georeference.frame().to_grid(at)),
            Self::LonLat => georeference.from_lonlat(at),
            Self::Pixel => Ok(at),
        }
    }

    /// Grid coordinates as the user would write them, to about a hundredth of a cell.
    fn write(self, grid: DVec2, georeference: &Georeference) -> Result<String> {
        let frame = georeference.frame();
        let map = frame.to_map(grid);
        let (at, cell) = match self {
            Self::Map => (map, frame.step().min_element()),
            Self::LonLat => {
                (georeference.to_lonlat(grid)?, frame.mid_spacing().min_element() / 111_000.0)
            }
            Self::Pixel => (grid, 1.0),
        };
        let [x, y] = at.to_array().map(|value| coordinate(value, cell));
        Ok(format!("{}{x},{y}", self.prefix()))
    }
}

/// One point on the grid that remembers how the user wrote it.
#[derive(Clone, Debug)]
pub(crate) struct Spot {
    /// The option it was given to.
    option: &'static str,
    /// As the user wrote it, such as `pixel:3,4`.
    pub(crate) name: String,
    /// Grid coordinates.
    pub(crate) at: DVec2,
    notation: Notation,
}

impl Spot {
    /// Puts a point on the grid.
    ///
    /// # Errors
    /// It lies outside the DEM: the message names the nearest place inside, and says if x and y look swapped.
    fn new(
        option: &'static str,
        name: String,
        notation: Notation,
        at: DVec2,
        terrain: &Terrain,
    ) -> Result<Self> {
        let frame = terrain.frame();
        let grid = notation.to_grid(at, terrain.georeference())?;
        if frame.covers(grid) {
            // The surface ends at the outermost nodes, half a cell before the raster does.
            return Ok(Self { option, name, at: frame.clamp(grid), notation });
        }
        let last = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
        let (low, high) = match notation {
            Notation::Pixel => (DVec2::ZERO, last),
            _ => (DVec2::new(0.0, last.y), DVec2::new(last.x, 0.0)),
        };
        let mut message = format!(
            "{option} {name} lies outside the DEM, which reaches from {} to {}",
            notation.write(low, terrain.georeference())?,
            notation.write(high, terrain.georeference())?,
        );
        let swapped = DVec2::new(at.y, at.x);
        if notation.to_grid(swapped, terrain.georeference()).is_ok_and(|grid| frame.covers(grid)) {
            let names = match notation {
                Notation::Map => "x and y",
                Notation::LonLat => "longitude and latitude",
                Notation::Pixel => "column and row",
            };
            message += &format!("; {names} look swapped: try {}", Place::At(notation, swapped));
        } else if let Some(near) = nearest(frame, frame.clamp(grid), |c, r| !terrain.is_void(c, r))
        {
            message += &format!(
                "; the nearest place on it is {}",
                notation.write(near, terrain.georeference())?
            );
        }
        Err(Error::usage(message))
    }

    /// # Errors
    /// Its cell is not good: the message says `why` and names the nearest good place.
    pub(crate) fn check(
        &self,
        georeference: &Georeference,
        good: impl Fn(usize, usize) -> bool,
        why: &str,
    ) -> Result<()> {
        let (col, row) = cell(self.at);
        if good(col, row) {
            return Ok(());
        }
        Err(Error::usage(self.refusal(georeference, good, why)?))
    }

    /// The sentence that refuses this place and names the nearest good one.
    pub(crate) fn refusal(
        &self,
        georeference: &Georeference,
        good: impl Fn(usize, usize) -> bool,
        why: &str,
    ) -> Result<String> {
        let Self { option, name, .. } = self;
        Ok(match nearest(georeference.frame(), self.at, good) {
            Some(near) => {
                let near = self.notation.write(near, georeference)?;
                format!("{option} {name} {why}; the nearest good place is {near}")
            }
            None => format!("{option} {name} {why}, and so does every other cell"),
        })
    }
}

/// The start regions of the places of `option`, one for each, and their points by themselves.
///
/// # Errors
/// A point outside the DEM; a file that cannot be read or holds nothing.
pub(crate) fn regions(
    option: &'static str,
    places: &[Place],
    terrain: &Terrain,
) -> Result<(Vec<StartRegion>, Vec<Spot>)> {
    let (mut regions, mut spots) = (Vec::new(), Vec::new());
    for place in places {
        let first = spots.len();
        let mut shapes = Shapes::default();
        match place {
            Place::At(notation, at) => {
                spots.push(Spot::new(option, place.to_string(), *notation, *at, terrain)?);
            }
            Place::File(path) => {
                shapes = read_shapes(path, terrain.georeference())?;
                for &grid in &shapes.points {
                    spots.push(file_spot(option, path, grid, terrain)?);
                }
            }
        }
        shapes.points = spots[first..].iter().map(|spot| spot.at).collect();
        regions.push(shapes.into());
    }
    Ok((regions, spots))
}

/// The points of the places of `option`.
///
/// # Errors
/// As [`regions`]; a file with lines or areas.
pub(crate) fn points(
    option: &'static str,
    places: &[Place],
    terrain: &Terrain,
) -> Result<Vec<Spot>> {
    let (regions, spots) = regions(option, places, terrain)?;
    let only_points = |shapes: &Shapes| shapes.lines.is_empty() && shapes.polygons.is_empty();
    if regions.iter().all(|region| only_points(&region.shapes)) {
        return Ok(spots);
    }
    Err(Error::usage(format!("{option} takes points; its file also holds lines or areas")))
}

fn file_spot(option: &'static str, path: &Path, grid: DVec2, terrain: &Terrain) -> Result<Spot> {
    let lonlat = terrain.to_lonlat(grid)?;
    let name = format!("{} (point at {:.6},{:.6})", path.display(), lonlat.x, lonlat.y);
    Spot::new(option, name, Notation::LonLat, lonlat, terrain)
}

/// Points, lines and areas of a GeoJSON file (RFC 7946: longitude and latitude) in grid coordinates.
///
/// # Errors
/// The file cannot be read, is not GeoJSON, holds no geometry; the DEM has no CRS.
pub(crate) fn read_shapes(path: &Path, georeference: &Georeference) -> Result<Shapes> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
    if text.is_empty() {
        return Err(Error::format(path, "the file is empty"));
    }
    let shapes = lonlat_shapes(&text)
        .map_err(|error| Error::format(path, format!("is not GeoJSON: {error}")))?
        .try_map(|lonlat| georeference.from_lonlat(lonlat))
        .map_err(|error| Error::format(path, error.to_string()))?;
    if shapes.is_empty() {
        return Err(Error::format(path, "holds no points, lines or areas"));
    }
    Ok(shapes)
}

/// All geometry of a GeoJSON text, in longitude and latitude.
fn lonlat_shapes(text: &str) -> std::result::Result<Shapes, geojson::Error> {
    let geometries: Vec<_> = match text.parse()? {
        GeoJson::Geometry(geometry) => vec![geometry],
        GeoJson::Feature(feature) => feature.geometry.into_iter().collect(),
        GeoJson::FeatureCollection(all) => {
            all.features.into_iter().filter_map(|feature| feature.geometry).collect()
        }
    };
    let mut shapes = Shapes::default();
    for geometry in geometries {
        shapes.add(Geometry::try_from(geometry)?);
    }
    Ok(shapes)
}

/// The cell of a point of the grid's hull.
pub(crate) fn cell(at: DVec2) -> (usize, usize) {
    (at.x.round() as usize, at.y.round() as usize)
}

/// The good node nearest to `at` on the ground.
fn nearest(frame: &GridFrame, at: DVec2, good: impl Fn(usize, usize) -> bool) -> Option<DVec2> {
    let spacing = frame.spacing(at.y);
    let nodes = (0..frame.rows()).flat_map(|row| (0..frame.cols()).map(move |col| (col, row)));
    nodes
        .filter(|&(col, row)| good(col, row))
        .map(|(col, row)| DVec2::new(col as f64, row as f64))
        .min_by(|a, b| {
            let square = |node: DVec2| ((node - at) * spacing).length_squared();
            square(*a).total_cmp(&square(*b))
        })
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
    fn geojson_gives_all_its_geometry() {
        let point = r#"{"type":"Point","coordinates":[1,2,300]}"#;
        let line = r#"{"type":"LineString","coordinates":[[1,2],[3,4]]}"#;
        let polygon = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[0,1],[0,0]]]}"#;
        let feature = |geometry: &str| {
            format!(r#"{{"type":"Feature","properties":{{}},"geometry":{geometry}}}"#)
        };
        let all = format!(r#"{{"type":"GeometryCollection","geometries":[{point},{polygon}]}}"#);
        let features = [feature(line), feature(&all), feature("null")].join(",");
        let text = format!(r#"{{"type":"FeatureCollection","features":[{features}]}}"#);
        let shapes = lonlat_shapes(&text).unwrap();
        assert_eq!(shapes.points, [DVec2::new(1.0, 2.0)]);
        assert_eq!((shapes.lines.len(), shapes.polygons.len()), (1, 1));
    }

    #[test]
    fn positions_of_one_number_are_refused() {
        for coordinates in ["[1]", "[]"] {
            let kinds = [("Point", 0), ("LineString", 1), ("Polygon", 2), ("MultiPolygon", 3)];
            for (kind, depth) in kinds {
                let nested = "[".repeat(depth) + coordinates + &"]".repeat(depth);
                let text = format!(r#"{{"type":"{kind}","coordinates":{nested}}}"#);
                assert!(lonlat_shapes(&text).is_err(), "{text}");
            }
        }
    }

    #[test]
    fn nearest_counts_ground_distance() {
        let frame =
            GridFrame::new(9, 9, DVec2::ZERO, DVec2::new(10.0, 50.0), ridgeway::Ground::METRES)
                .unwrap();
        let good = |col, row| (col, row) == (4, 6) || (col, row) == (8, 4);
        assert_eq!(nearest(&frame, DVec2::splat(4.0), good), Some(DVec2::new(8.0, 4.0)));
        assert_eq!(nearest(&frame, DVec2::ZERO, |_, _| false), None);
    }
}
