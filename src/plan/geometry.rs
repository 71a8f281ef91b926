//! Geometry files.

use std::fmt;
use std::fs::File;
use std::path::Path;

use geo_types::Geometry;
use geojson::{GeoJson, GeometryValue, Position};
use glam::DVec2;
use serde::Deserialize;
use serde_json::Value;

use crate::error::{Error, Remedy, Result};
use crate::grid::{Shapes, rasterise};
use crate::memory;
use crate::terrain::{Crs, Georeference};

/// What a file of geometry must be.
const EXPECTED: &str = "GeoJSON, in longitude and latitude (RFC 7946)";

/// How much larger GeoJSON is in memory than in a file: a position of 13 characters is a list of numbers in a list.
const TIMES_IN_MEMORY: u64 = 10;

/// Points, lines and areas of a GeoJSON file in grid coordinates. Positions are longitude and latitude (RFC 7946), or in the CRS that a
/// member `crs` names by an EPSG code (GeoJSON 2008). UTF-8 or UTF-16, with or without a byte order mark.
///
/// Shapes may lie outside the grid.
///
/// # Errors
/// The file cannot be read, is not GeoJSON, holds no geometry, names an unknown CRS, has latitude before longitude; the grid has no CRS.
pub fn read_geojson(path: impl AsRef<Path>, georeference: &Georeference) -> Result<Shapes> {
    let path = path.as_ref();
    let mut file = File::open(path).map_err(|source| Error::io(path, source))?;
    let mut bytes = Vec::new();
    memory::read_rest(path, &mut file, TIMES_IN_MEMORY, &mut bytes)?;
    shapes_of(&bytes, georeference).map_err(|error| error.in_file(path))
}

/// Whether any cell of the grid is touched.
pub(super) fn touches(shapes: &Shapes, georeference: &Georeference) -> bool {
    let frame = georeference.frame();
    shapes.vertices().any(|at| frame.is_on_cell(at)) || rasterise(frame, shapes).contains(&true)
}

fn shapes_of(bytes: &[u8], georeference: &Georeference) -> Result<Shapes> {
    /// The file code of a shapefile.
    const SHAPEFILE: [u8; 4] = 9994_u32.to_be_bytes();
    if bytes.is_empty() {
        return Err(Error::argument("the file", "empty", "GeoJSON"));
    }
    if bytes.starts_with(&SHAPEFILE) {
        return Err(
            Error::argument("the file", "a shapefile", EXPECTED).advise(Remedy::ConvertToGeoJson)
        );
    }
    let text = decoded(bytes)?;
    let shapes = shapes_in_file(&text).map_err(not_geojson)?;
    let crs = named_crs(&text)?;
    if shapes.vertices().next().is_none() {
        return Err(Error::argument("the number of points, lines and areas", 0, "1 or more"));
    }
    on_grid(shapes, crs.as_ref(), georeference)
}

/// The text of a file in UTF-8, or in UTF-16 with a byte order mark, without the mark.
fn decoded(bytes: &[u8]) -> Result<String> {
    match bytes {
        [0xff, 0xfe, text @ ..] => utf16(text, u16::from_le_bytes),
        [0xfe, 0xff, text @ ..] => utf16(text, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, text @ ..] | text => {
            str::from_utf8(text).map(str::to_owned).map_err(not_geojson)
        }
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String> {
    let units: Vec<u16> = bytes.as_chunks().0.iter().copied().map(unit).collect();
    String::from_utf16(&units).map_err(not_geojson)
}

fn not_geojson(cause: impl fmt::Display) -> Error {
    Error::argument("the file", format!("not GeoJSON ({cause})"), EXPECTED)
        .advise(Remedy::ConvertToGeoJson)
}

/// The member of GeoJSON 2008 that RFC 7946 no longer has.
#[derive(Deserialize)]
struct Document {
    crs: Option<Value>,
}

/// The CRS of a member `crs` such as `urn:ogc:def:crs:EPSG::25832`; `None` for longitude and latitude on WGS84.
fn named_crs(text: &str) -> Result<Option<Crs>> {
    let Document { crs: Some(member) } = serde_json::from_str(text).map_err(not_geojson)? else {
        return Ok(None);
    };
    let name = member.pointer("/properties/name").and_then(Value::as_str).unwrap_or_default();
    let upper = name.to_ascii_uppercase();
    if upper.ends_with("CRS84") {
        return Ok(None);
    }
    let code = upper.rsplit([':', '/']).next().and_then(|code| code.parse().ok());
    match code.filter(|_| upper.contains("EPSG")) {
        Some(code) => {
            Ok(Some(Crs::from_epsg(code).map_err(|error| error.advise(Remedy::ConvertToGeoJson))?))
        }
        None => {
            let found = if name.is_empty() { member.to_string() } else { name.to_owned() };
            Err(Error::argument("the member `crs`", found, "the name of an EPSG code")
                .advise(Remedy::ConvertToGeoJson))
        }
    }
}

/// Shapes in the coordinates of the file, put on the grid.
///
/// # Errors
/// Positions that are no longitude and latitude; only with its coordinates swapped does the geometry touch the grid.
fn on_grid(shapes: Shapes, crs: Option<&Crs>, georeference: &Georeference) -> Result<Shapes> {
    let in_degrees = crs.is_none_or(Crs::is_geographic);
    if let Some(at) = shapes.vertices().find(|at| in_degrees && at.abs().max_element() > 360.0) {
        let found = format!("{}, {}", at.x, at.y);
        return Err(Error::argument("a position", found, "longitude and latitude")
            .advise(Remedy::ConvertToGeoJson));
    }
    let to_grid = |at| vertex_on_grid(at, crs, georeference);
    let as_given = shapes.clone().try_map(to_grid);
    if as_given.as_ref().is_ok_and(|shapes| touches(shapes, georeference)) {
        return as_given;
    }
    match shapes.try_map(|at| to_grid(DVec2::new(at.y, at.x))) {
        Ok(swapped) if touches(&swapped, georeference) => {
            let expected = if in_degrees { "longitude before latitude" } else { "x before y" };
            Err(Error::argument("the order of coordinates", "swapped", expected)
                .advise("as it is, the geometry lies outside the DEM; swap the two numbers of each position"))
        }
        _ => as_given,
    }
}

/// Grid coordinates of a vertex. On a grid around the Earth columns run on beyond the last one as longitudes do beyond 180°, so that
/// from 179° to 181° is a short way.
fn vertex_on_grid(at: DVec2, crs: Option<&Crs>, georeference: &Georeference) -> Result<DVec2> {
    let lonlat = crs.map_or(Ok(at), |crs| crs.to_lonlat(at))?;
    let (mut on_grid, frame) = (georeference.from_lonlat(lonlat)?, georeference.frame());
    if frame.is_periodic() {
        let lon = if crs.is_none_or(Crs::is_geographic) { at.x } else { lonlat.x };
        let (col, cols) = ((lon - frame.origin().x) / frame.step().x, frame.cols() as f64);
        on_grid.x += ((col - on_grid.x) / cols).round() * cols;
    }
    Ok(on_grid)
}

/// All geometry of GeoJSON, in its own coordinates.
fn shapes_in_file(text: &str) -> std::result::Result<Shapes, geojson::Error> {
    let geometries: Vec<_> = match text.parse()? {
        GeoJson::Geometry(geometry) => vec![geometry],
        GeoJson::Feature(feature) => feature.geometry.into_iter().collect(),
        GeoJson::FeatureCollection(all) => {
            all.features.into_iter().filter_map(|feature| feature.geometry).collect()
        }
    };
    let mut shapes = Shapes::default();
    for geometry in geometries {
        check_positions(&geometry.value)?;
        shapes.add(Geometry::try_from(geometry)?);
    }
    Ok(shapes)
}

/// Every position must have two numbers at least: the conversion to geometry takes it for granted.
fn check_positions(geometry: &GeometryValue) -> std::result::Result<(), geojson::Error> {
    match geometry {
        GeometryValue::Point { coordinates } => check_position(coordinates),
        GeometryValue::MultiPoint { coordinates } | GeometryValue::LineString { coordinates } => {
            coordinates.iter().try_for_each(check_position)
        }
        GeometryValue::MultiLineString { coordinates } | GeometryValue::Polygon { coordinates } => {
            coordinates.iter().flatten().try_for_each(check_position)
        }
        GeometryValue::MultiPolygon { coordinates } => {
            coordinates.iter().flatten().flatten().try_for_each(check_position)
        }
        GeometryValue::GeometryCollection { geometries } => {
            geometries.iter().try_for_each(|geometry| check_positions(&geometry.value))
        }
    }
}

fn check_position(position: &Position) -> std::result::Result<(), geojson::Error> {
    match position.as_slice().len() {
        0 | 1 => Err(geojson::Error::PositionTooShort(position.as_slice().len())),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{GridFrame, Ground};
    use crate::terrain::Crs;

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
        let shapes = shapes_in_file(&text).unwrap();
        assert_eq!(shapes.points, [DVec2::new(1.0, 2.0)]);
        assert_eq!((shapes.lines.len(), shapes.polygons.len()), (1, 1));
    }

    #[test]
    fn other_files_are_called_no_geojson() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wall.geojson");
        let frame = GridFrame::new(3, 3, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let georeference = Georeference::new(frame, Crs::none());
        let contents: [&[u8]; 4] = [b"id,x,y", b"\x89PNG\xff", b"{\"a\": 1}", b"{\"type\": \"Poi"];
        for content in contents {
            std::fs::write(&path, content).unwrap();
            let message = read_geojson(&path, &georeference).unwrap_err().to_string();
            assert!(message.contains("the file is not GeoJSON ("), "{message}");
        }
    }

    #[test]
    fn positions_of_one_number_are_refused() {
        for coordinates in ["[1]", "[]"] {
            let kinds = [("Point", 0), ("LineString", 1), ("Polygon", 2), ("MultiPolygon", 3)];
            for (kind, depth) in kinds {
                let nested = "[".repeat(depth) + coordinates + &"]".repeat(depth);
                let text = format!(r#"{{"type":"{kind}","coordinates":{nested}}}"#);
                assert!(shapes_in_file(&text).is_err(), "{text}");
            }
        }
    }

    /// Nodes every 10 m from 500000, 5000000 (9° E, 45.15° N) eastwards and southwards.
    fn in_zone_32() -> Georeference {
        let (crs, origin) = (Crs::from_epsg(32632).unwrap(), DVec2::new(5e5, 5e6));
        let frame = GridFrame::new(61, 61, origin, DVec2::splat(10.0), crs.ground()).unwrap();
        Georeference::new(frame, crs)
    }

    /// A line between map coordinates as GeoJSON, with the positions that `write` makes of them.
    fn line(write: impl Fn(DVec2) -> DVec2, crs: &str) -> String {
        let ends = [DVec2::new(500_100.0, 4_999_900.0), DVec2::new(500_300.0, 4_999_700.0)];
        let [a, b] = ends.map(write);
        format!(
            r#"{{"type":"LineString","coordinates":[[{},{}],[{},{}]]{crs}}}"#,
            a.x, a.y, b.x, b.y
        )
    }

    fn named(name: &str) -> String {
        format!(r#","crs":{{"type":"name","properties":{{"name":"{name}"}}}}"#)
    }

    fn assert_is_the_line(text: &[u8]) {
        let shapes = shapes_of(text, &in_zone_32()).unwrap();
        let ends: Vec<_> = shapes.vertices().collect();
        let apart =
            (ends[0] - DVec2::splat(10.0)).length() + (ends[1] - DVec2::splat(30.0)).length();
        assert!(apart < 1e-3, "{ends:?}");
    }

    #[test]
    fn a_named_crs_is_reprojected() {
        let crs = Crs::from_epsg(32633).unwrap();
        let georeference = in_zone_32();
        let lonlat = |map| georeference.crs().to_lonlat(map).unwrap();
        for name in [
            "urn:ogc:def:crs:EPSG::32632",
            "EPSG:32632",
            "http://www.opengis.net/def/crs/EPSG/0/32632",
        ] {
            assert_is_the_line(line(|map| map, &named(name)).as_bytes());
        }
        let next_zone = line(
            |map| crs.from_lonlat(lonlat(map)).unwrap(),
            &named("urn:ogc:def:crs:EPSG::32633"),
        );
        assert_is_the_line(next_zone.as_bytes());
        for name in ["urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326"] {
            assert_is_the_line(line(lonlat, &named(name)).as_bytes());
        }
        assert_is_the_line(line(lonlat, r#","crs":null"#).as_bytes());
        let local = line(|map| map, &named("LOCAL:grid"));
        let message = shapes_of(local.as_bytes(), &georeference).unwrap_err().to_string();
        assert!(message.contains("LOCAL:grid") && message.contains("EPSG:4326"), "{message}");
    }

    #[test]
    fn around_the_earth_lines_go_on_beyond_180_degrees() {
        let crs = Crs::from_epsg(4326).unwrap();
        let frame =
            GridFrame::new(36, 3, DVec2::new(-175.0, 10.0), DVec2::splat(10.0), crs.ground());
        let georeference = Georeference::new(frame.unwrap(), crs);
        for (crs, text) in [("", "[[175,0],[185,0]]"), (r#","crs":null"#, "[[-185,0],[-175,0]]")] {
            let text = format!(r#"{{"type":"LineString","coordinates":{text}{crs}}}"#);
            let shapes = shapes_of(text.as_bytes(), &georeference).unwrap();
            let touched = rasterise(georeference.frame(), &shapes);
            let cols: Vec<_> = (0..36).filter(|col| touched[36 + col]).collect();
            assert_eq!(cols, [0, 35], "{text}");
        }
    }

    #[test]
    fn byte_order_marks_and_utf_16_are_read() {
        let georeference = in_zone_32();
        let text = line(|map| georeference.crs().to_lonlat(map).unwrap(), "");
        assert_is_the_line(&[b"\xef\xbb\xbf", text.as_bytes()].concat());
        let units = || std::iter::once(0xfeff).chain(text.encode_utf16());
        assert_is_the_line(&units().flat_map(u16::to_le_bytes).collect::<Vec<_>>());
        assert_is_the_line(&units().flat_map(u16::to_be_bytes).collect::<Vec<_>>());
    }

    #[test]
    fn latitude_first_is_refused_with_what_to_do() {
        let georeference = in_zone_32();
        let text = line(
            |map| {
                let lonlat = georeference.crs().to_lonlat(map).unwrap();
                DVec2::new(lonlat.y, lonlat.x)
            },
            "",
        );
        let message = shapes_of(text.as_bytes(), &georeference).unwrap_err().to_string();
        assert!(message.contains("longitude before latitude"), "{message}");
    }

    #[test]
    fn metres_without_a_crs_are_no_degrees() {
        let message =
            shapes_of(line(|map| map, "").as_bytes(), &in_zone_32()).unwrap_err().to_string();
        assert!(message.contains("500100, 4999900") && message.contains("EPSG:4326"), "{message}");
    }

    #[test]
    fn shapefiles_empty_geometry_and_deep_nesting_are_refused() {
        let empty = br#"{"type":"Polygon","coordinates":[]}"#;
        let message = |bytes: &[u8]| shapes_of(bytes, &in_zone_32()).unwrap_err().to_string();
        assert!(message(empty).contains("the number of points, lines and areas is 0"));
        assert!(message(&[0, 0, 0x27, 0x0a, 0, 0]).contains("is a shapefile"));
        assert!(message("[".repeat(1_000_000).as_bytes()).contains("not GeoJSON"));
    }
}
