//! Routes, isolines and regions as GeoJSON (RFC 7946): longitude and latitude on WGS84, heights in metres.

use ::geojson::{Feature, FeatureCollection, GeometryValue, JsonObject, Position};
use geo_types::MultiPolygon;
use glam::{DVec2, DVec3};
use serde::Serialize;
use serde_json::Value;

use super::antimeridian::{cut_at_antimeridian, unwrap_ring};
use super::round;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, Isoline};
use crate::route::Route;
use crate::terrain::Crs;

/// A feature per `(name, route)` whose properties are `name` and all of the route's summary.
/// `provenance` becomes the collection's member of that name: what is needed to repeat the run.
///
/// Without a CRS the positions are map coordinates, and the member `coordinate_note` says so.
///
/// # Errors
/// [`Error::Argument`] if only some of the points can be brought to longitude and latitude, or `provenance` is not JSON.
pub fn routes_geojson(
    routes: &[(impl AsRef<str>, &Route)],
    crs: &Crs,
    provenance: &impl Serialize,
) -> Result<String> {
    let features = routes.iter().map(|(name, route)| route_feature(name.as_ref(), route)).collect();
    collection(features, |map| crs.to_lonlat(map), provenance)
}

/// A feature per level that has lines, with the properties `distance` and `unit`. Lines are in the grid coordinates of `frame`, whose map
/// lies in `crs`.
///
/// # Errors
/// As [`routes_geojson`].
pub fn isolines_geojson(
    isolines: &[Isoline],
    frame: &GridFrame,
    unit: &str,
    crs: &Crs,
    provenance: &impl Serialize,
) -> Result<String> {
    let drawn = isolines.iter().filter(|isoline| !isoline.lines.is_empty());
    let features = drawn.map(|isoline| isoline_feature(isoline, frame, unit)).collect();
    collection(features, |map| crs.to_lonlat(map), provenance)
}

/// A feature per region, given by its properties and its polygons in the grid coordinates of `frame`, whose map lies in `crs`. Rings run as RFC 7946 wants them;
/// one that crosses 180° goes on beyond it.
///
/// # Errors
/// As [`routes_geojson`]; [`Error::Argument`] if properties are not a JSON object.
pub fn regions_geojson(
    regions: &[(impl Serialize, MultiPolygon<f64>)],
    frame: &GridFrame,
    crs: &Crs,
    provenance: &impl Serialize,
) -> Result<String> {
    let features = regions
        .iter()
        .map(|(properties, polygons)| {
            Ok(region_feature(object("the properties of a region", properties)?, polygons, frame))
        })
        .collect::<Result<_>>()?;
    collection(features, |map| crs.to_lonlat(map), provenance)
}

/// A geometry in map coordinates (z: height, or `NaN` for none) and its properties.
struct Shape {
    geometry: Geometry,
    properties: JsonObject,
}

enum Geometry {
    Lines(Vec<Vec<DVec3>>),
    /// Polygons of an exterior and holes.
    Areas(Vec<Vec<Vec<DVec3>>>),
}

impl Geometry {
    fn first(&self) -> Option<DVec3> {
        let line = match self {
            Self::Lines(lines) => lines.first(),
            Self::Areas(areas) => areas.first().and_then(|rings| rings.first()),
        };
        line?.first().copied()
    }

    /// In longitude and latitude: lines are cut where they cross 180°, rings go on beyond it.
    fn in_degrees(&self, to_lonlat: impl Fn(DVec2) -> Result<DVec2>) -> Result<Self> {
        match self {
            Self::Lines(lines) => {
                let mut parts = Vec::new();
                for line in lines {
                    parts.extend(cut_at_antimeridian(&in_degrees(line, &to_lonlat)?));
                }
                Ok(Self::Lines(parts))
            }
            Self::Areas(areas) => {
                let ring = |ring: &Vec<DVec3>| Ok(unwrap_ring(in_degrees(ring, &to_lonlat)?));
                let area = |rings: &Vec<Vec<DVec3>>| rings.iter().map(ring).collect();
                Ok(Self::Areas(areas.iter().map(area).collect::<Result<_>>()?))
            }
        }
    }
}

fn route_feature(name: &str, route: &Route) -> Shape {
    let mut properties = JsonObject::new();
    properties.insert("name".into(), name.into());
    properties.extend(object("the summary", &route.summary).expect("named numbers and texts"));
    // A route of one point, start and goal being the same, is still a line of two positions.
    let mut line = route.points.clone();
    if let [only] = line[..] {
        line.push(only);
    }
    Shape { geometry: Geometry::Lines(vec![line]), properties }
}

fn isoline_feature(isoline: &Isoline, frame: &GridFrame, unit: &str) -> Shape {
    let lines = isoline.lines.iter().map(|line| on_map(line.iter().copied(), frame));
    let mut properties = JsonObject::new();
    properties.insert("distance".into(), isoline.level.into());
    properties.insert("unit".into(), unit.into());
    Shape { geometry: Geometry::Lines(lines.collect()), properties }
}

fn region_feature(
    properties: JsonObject,
    polygons: &MultiPolygon<f64>,
    frame: &GridFrame,
) -> Shape {
    let areas = polygons.iter().map(|polygon| {
        let rings = std::iter::once(polygon.exterior()).chain(polygon.interiors());
        rings.map(|ring| on_map(ring.coords().map(|at| DVec2::new(at.x, at.y)), frame)).collect()
    });
    Shape { geometry: Geometry::Areas(areas.collect()), properties }
}

/// Grid coordinates as map coordinates without heights.
fn on_map(line: impl Iterator<Item = DVec2>, frame: &GridFrame) -> Vec<DVec3> {
    line.map(|at| frame.to_map(at).extend(f64::NAN)).collect()
}

fn collection(
    features: Vec<Shape>,
    to_lonlat: impl Fn(DVec2) -> Result<DVec2>,
    provenance: &impl Serialize,
) -> Result<String> {
    let first = features.iter().find_map(|f| f.geometry.first());
    let no_lonlat = first.and_then(|p| to_lonlat(p.truncate()).err());
    let mut members = JsonObject::new();
    members.insert("provenance".into(), json("the provenance", provenance)?);
    if let Some(reason) = &no_lonlat {
        members.insert(
            "coordinate_note".into(),
            format!(
                "positions are the DEM's map coordinates, not longitude and latitude: {reason}"
            )
            .into(),
        );
    }
    let geographic = no_lonlat.is_none();
    let features = features
        .into_iter()
        .map(|Shape { geometry, properties }| {
            let geometry = if geographic { geometry.in_degrees(&to_lonlat)? } else { geometry };
            Ok(Feature { properties: Some(properties), ..Feature::from(value(&geometry)) })
        })
        .collect::<Result<Vec<_>>>()?;
    let collection =
        FeatureCollection { foreign_members: Some(members), ..FeatureCollection::new(features) };
    Ok(collection.to_string())
}

fn object(what: &str, value: &impl Serialize) -> Result<JsonObject> {
    match json(what, value)? {
        Value::Object(object) => Ok(object),
        other => Err(Error::argument(what, other, "a JSON object")),
    }
}

fn json(what: &str, value: &impl Serialize) -> Result<Value> {
    serde_json::to_value(value)
        .map_err(|e| Error::argument(what, format!("no JSON ({e})"), "a JSON object"))
}

/// A line or ring in longitude and latitude.
fn in_degrees(line: &[DVec3], to_lonlat: impl Fn(DVec2) -> Result<DVec2>) -> Result<Vec<DVec3>> {
    line.iter().map(|p| Ok(to_lonlat(p.truncate())?.extend(p.z))).collect()
}

fn value(geometry: &Geometry) -> GeometryValue {
    match geometry {
        Geometry::Lines(lines) => match &lines[..] {
            [line] => GeometryValue::LineString { coordinates: positions(line) },
            _ => GeometryValue::MultiLineString { coordinates: all_positions(lines) },
        },
        Geometry::Areas(areas) => match &areas[..] {
            [area] => GeometryValue::Polygon { coordinates: all_positions(area) },
            _ => GeometryValue::MultiPolygon {
                coordinates: areas.iter().map(|area| all_positions(area)).collect(),
            },
        },
    }
}

fn all_positions(lines: &[Vec<DVec3>]) -> Vec<Vec<Position>> {
    lines.iter().map(|line| positions(line)).collect()
}

fn positions(line: &[DVec3]) -> Vec<Position> {
    line.iter().map(|&p| position(p)).collect()
}

/// The position to 7 decimals (a centimetre, if degrees) and the height to 2, or none if `NaN`.
fn position(p: DVec3) -> Position {
    let [x, y] = [p.x, p.y].map(|v| round(v, 7));
    if p.z.is_finite() { Position::from([x, y, round(p.z, 2)]) } else { Position::from([x, y]) }
}

#[cfg(test)]
pub(super) mod tests {
    use geo_types::{LineString, Polygon};
    use serde_json::json;

    use super::*;
    use crate::grid::Ground;
    use crate::metric::Unit;
    use crate::route::Summary;

    pub(in crate::export) fn route() -> Route {
        Route {
            grid: vec![DVec2::ZERO, DVec2::new(1.0, 1.0)],
            points: vec![DVec3::new(2.0, 41.0, 100.0), DVec3::new(2.25, 41.5, 120.123)],
            summary: Summary {
                metric: "isotropic".into(),
                parameters: Vec::new(),
                cost: 1.0,
                cost_unit: Unit::Metres,
                length_m: 10.0,
                plan_length_m: 9.0,
                climb_m: 20.0,
                descent_m: 0.0,
                max_grade_percent: 5.0,
                mean_grade_percent: 4.0,
                max_side_slope_deg: 3.0,
                total_normal_curvature_rad: 0.1,
                start: [2.0, 41.0],
                goal: [2.25, 41.5],
                software: "ridgeway".into(),
            },
        }
    }

    fn written(routes: &[(&str, &Route)], to_lonlat: impl Fn(DVec2) -> Result<DVec2>) -> Value {
        let features = routes.iter().map(|(name, route)| route_feature(name, route)).collect();
        let text = collection(features, to_lonlat, &json!({"command": "ridgeway route"})).unwrap();
        text.parse::<::geojson::GeoJson>().unwrap();
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn a_route_carries_its_summary_and_provenance() {
        let json = written(&[("short", &route())], Ok);
        assert_eq!(json["type"], "FeatureCollection");
        assert_eq!(json["provenance"]["command"], "ridgeway route");
        let feature = &json["features"][0];
        assert_eq!(feature["properties"]["name"], "short");
        assert_eq!(feature["properties"]["climb_m"], 20.0);
        assert_eq!(feature["geometry"]["type"], "LineString");
        assert_eq!(
            feature["geometry"]["coordinates"],
            json!([[2.0, 41.0, 100.0], [2.25, 41.5, 120.12]])
        );
        assert!(json.get("coordinate_note").is_none());
    }

    #[test]
    fn without_a_crs_the_file_says_so() {
        let json = written(&[("short", &route())], |_| {
            Err(Error::argument("the CRS", "unknown", "known"))
        });
        let note = json["coordinate_note"].as_str().unwrap();
        assert!(note.contains("map coordinates") && note.contains("the CRS is unknown"), "{note}");
    }

    #[test]
    fn a_route_over_the_date_line_is_cut_there() {
        let mut over = route();
        over.points = vec![
            DVec3::new(179.0, 10.0, 0.0),
            DVec3::new(181.0, 12.0, 100.0),
            DVec3::new(182.0, 12.0, 100.0),
        ];
        let json = written(&[("over", &over)], Ok);
        assert_eq!(json["features"][0]["geometry"]["type"], "MultiLineString");
        assert_eq!(
            json["features"][0]["geometry"]["coordinates"],
            json!([
                [[179.0, 10.0, 0.0], [180.0, 11.0, 50.0]],
                [[-180.0, 11.0, 50.0], [-179.0, 12.0, 100.0], [-178.0, 12.0, 100.0]]
            ])
        );
    }

    #[test]
    fn regions_are_polygons_with_holes() {
        let square = |from: f64, to: f64| {
            LineString::from(vec![(from, to), (to, to), (to, from), (from, from)])
        };
        let mut hole = square(0.5, 1.5);
        hole.0.reverse();
        let polygon = Polygon::new(square(-0.5, 2.5), vec![hole]);
        // The middle column lies on 180°.
        let frame =
            GridFrame::new(3, 3, DVec2::new(179.0, 1.0), DVec2::ONE, Ground::WGS84).unwrap();
        let mut properties = JsonObject::new();
        properties.insert("region".into(), 7.into());
        let wrapped = |p: DVec2| Ok(DVec2::new(p.x - 360.0 * (p.x / 360.0).round(), p.y));
        let features = vec![region_feature(properties, &polygon.into(), &frame)];
        let text = collection(features, wrapped, &Value::Null).unwrap();
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["features"][0]["properties"]["region"], 7);
        let rings = &json["features"][0]["geometry"]["coordinates"];
        assert_eq!(json["features"][0]["geometry"]["type"], "Polygon");
        assert_eq!(
            rings[0],
            json!([[178.5, -1.5], [181.5, -1.5], [181.5, 1.5], [178.5, 1.5], [178.5, -1.5]])
        );
        assert_eq!(rings[1].as_array().unwrap().len(), 5);
    }

    #[test]
    fn isolines_carry_distance_and_unit() {
        let frame =
            GridFrame::new(3, 3, DVec2::new(2.0, 41.0), DVec2::splat(0.5), Ground::WGS84).unwrap();
        let isoline =
            Isoline { level: 250.0, lines: vec![vec![DVec2::ZERO, DVec2::new(1.0, 1.0)]] };
        let features = vec![isoline_feature(&isoline, &frame, "m")];
        let text = collection(features, Ok, &Value::Null).unwrap();
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["features"][0]["properties"], json!({"distance": 250.0, "unit": "m"}));
        assert_eq!(
            json["features"][0]["geometry"]["coordinates"],
            json!([[2.0, 41.0], [2.5, 40.5]])
        );
    }
}
