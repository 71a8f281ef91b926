//! Geometry files.

use std::path::Path;
use std::{fmt, fs};

use geo_types::Geometry;
use geojson::{GeoJson, GeometryValue, Position};

use crate::error::{Error, Result};
use crate::grid::Shapes;
use crate::terrain::Georeference;

/// Points, lines and areas of a GeoJSON file (RFC 7946: longitude and latitude) in grid coordinates.
///
/// # Errors
/// The file cannot be read, is not GeoJSON, holds no geometry; the grid has no CRS.
pub fn read_geojson(path: impl AsRef<Path>, georeference: &Georeference) -> Result<Shapes> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    if bytes.is_empty() {
        return Err(Error::argument("the file", "empty", "GeoJSON").in_file(path));
    }
    let text = str::from_utf8(&bytes).map_err(|error| not_geojson(error).in_file(path))?;
    let shapes = lonlat_shapes(text)
        .map_err(|error| not_geojson(error).in_file(path))?
        .try_map(|lonlat| georeference.from_lonlat(lonlat))
        .map_err(|error| error.in_file(path))?;
    if shapes.is_empty() {
        return Err(
            Error::argument("the number of points, lines and areas", 0, "1 or more").in_file(path)
        );
    }
    Ok(shapes)
}

fn not_geojson(cause: impl fmt::Display) -> Error {
    let expected = "GeoJSON, in longitude and latitude (RFC 7946)";
    Error::argument("the file", format!("not GeoJSON ({cause})"), expected)
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
    use glam::DVec2;

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
        let shapes = lonlat_shapes(&text).unwrap();
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
            fs::write(&path, content).unwrap();
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
                assert!(lonlat_shapes(&text).is_err(), "{text}");
            }
        }
    }
}
