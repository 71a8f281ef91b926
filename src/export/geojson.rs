//! Routes, isolines and regions as GeoJSON (RFC 7946): longitude and latitude on WGS84, heights in metres.

use ::geojson::{Feature, FeatureCollection, GeometryValue, JsonObject, Position};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::round;
use crate::error::Result;
use crate::grid::{GridFrame, Isoline};
use crate::region::Polygon;
use crate::route::Route;
use crate::terrain::Crs;

/// A feature per `(name, route)` whose properties are `name` and all of the route's summary.
/// `provenance`, a JSON object, becomes the collection's member of that name: what is needed to make
/// the run again.
///
/// Without a CRS the positions are map coordinates, and the member `coordinate_note` says so.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) if only some of the points can be brought to longitude and latitude.
pub fn routes_geojson(
    routes: &[(impl AsRef<str>, &Route)],
    crs: &Crs,
    provenance: &Value,
) -> Result<String> {
    let features = routes.iter().map(|(name, route)| route_feature(name.as_ref(), route)).collect();
    collection(features, |map| crs.to_lonlat(map), provenance)
}

/// A feature per level that has lines, with the properties `distance` and `unit`; `frame` places the lines.
///
/// # Errors
/// As [`routes_geojson`].
pub fn isolines_geojson(
    isolines: &[Isoline],
    frame: &GridFrame,
    unit: &str,
    crs: &Crs,
    provenance: &Value,
) -> Result<String> {
    let drawn = isolines.iter().filter(|isoline| !isoline.lines.is_empty());
    let features = drawn.map(|isoline| isoline_feature(isoline, frame, unit)).collect();
    collection(features, |map| crs.to_lonlat(map), provenance)
}

/// A feature per region, given by its properties, a JSON object, and its polygons; `frame` places them. Rings run as RFC 7946 wants them;
/// one that crosses 180° goes on beyond it.
///
/// # Errors
/// As [`routes_geojson`].
pub fn regions_geojson(
    regions: &[(JsonObject, Vec<Polygon>)],
    frame: &GridFrame,
    crs: &Crs,
    provenance: &Value,
) -> Result<String> {
    let features =
        regions.iter().map(|(properties, polygons)| region_feature(properties, polygons, frame));
    collection(features.collect(), |map| crs.to_lonlat(map), provenance)
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

    fn in_degrees(&self, to_lonlat: impl Fn(DVec2) -> Result<DVec2>) -> Result<Self> {
        Ok(match self {
            Self::Lines(lines) => Self::Lines(in_degrees(lines, to_lonlat)?),
            Self::Areas(areas) => {
                let ring = |ring: &Vec<DVec3>| ring_in_degrees(ring, &to_lonlat);
                let area = |rings: &Vec<Vec<DVec3>>| rings.iter().map(ring).collect();
                Self::Areas(areas.iter().map(area).collect::<Result<_>>()?)
            }
        })
    }
}

fn route_feature(name: &str, route: &Route) -> Shape {
    let mut properties = JsonObject::new();
    properties.insert("name".into(), name.into());
    let summary = serde_json::to_value(&route.summary).expect("numbers and texts are JSON");
    if let Value::Object(summary) = summary {
        properties.extend(summary);
    }
    // A route of one point, start and goal being the same, is still a line of two positions.
    let mut line = route.points.clone();
    if let [only] = line[..] {
        line.push(only);
    }
    Shape { geometry: Geometry::Lines(vec![line]), properties }
}

fn isoline_feature(isoline: &Isoline, frame: &GridFrame, unit: &str) -> Shape {
    let place =
        |line: &Vec<DVec2>| line.iter().map(|&p| frame.to_map(p).extend(f64::NAN)).collect();
    let mut properties = JsonObject::new();
    properties.insert("distance".into(), isoline.level.into());
    properties.insert("unit".into(), unit.into());
    Shape { geometry: Geometry::Lines(isoline.lines.iter().map(place).collect()), properties }
}

fn region_feature(properties: &JsonObject, polygons: &[Polygon], frame: &GridFrame) -> Shape {
    let place =
        |ring: &Vec<DVec2>| ring.iter().map(|&p| frame.to_map(p).extend(f64::NAN)).collect();
    let rings = |polygon: &Polygon| {
        std::iter::once(&polygon.exterior).chain(&polygon.holes).map(place).collect()
    };
    let geometry = Geometry::Areas(polygons.iter().map(rings).collect());
    Shape { geometry, properties: properties.clone() }
}

fn collection(
    features: Vec<Shape>,
    to_lonlat: impl Fn(DVec2) -> Result<DVec2>,
    provenance: &Value,
) -> Result<String> {
    let first = features.iter().find_map(|f| f.geometry.first());
    let no_lonlat = first.and_then(|p| to_lonlat(p.truncate()).err());
    let mut members = JsonObject::new();
    members.insert("provenance".into(), provenance.clone());
    if let Some(reason) = &no_lonlat {
        members.insert(
            "coordinate_note".into(),
            json!(format!(
                "positions are the DEM's map coordinates, not longitude and latitude: {reason}"
            )),
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

/// Lines in longitude and latitude, cut where they cross 180°.
fn in_degrees(
    lines: &[Vec<DVec3>],
    to_lonlat: impl Fn(DVec2) -> Result<DVec2>,
) -> Result<Vec<Vec<DVec3>>> {
    let mut parts = Vec::new();
    for line in lines {
        let degrees = line
            .iter()
            .map(|p| Ok(to_lonlat(p.truncate())?.extend(p.z)))
            .collect::<Result<Vec<_>>>()?;
        parts.extend(cut_at_antimeridian(&degrees));
    }
    Ok(parts)
}

/// A ring in longitude and latitude, going the short way round from each position to the next.
fn ring_in_degrees(
    ring: &[DVec3],
    to_lonlat: impl Fn(DVec2) -> Result<DVec2>,
) -> Result<Vec<DVec3>> {
    let mut before: Option<f64> = None;
    let mut position = |p: &DVec3| {
        let mut here = to_lonlat(p.truncate())?;
        if let Some(before) = before {
            here.x -= 360.0 * ((here.x - before) / 360.0).round();
        }
        before = Some(here.x);
        Ok(here.extend(p.z))
    };
    ring.iter().map(&mut position).collect()
}

fn value(geometry: &Geometry) -> GeometryValue {
    let positions =
        |line: &Vec<DVec3>| -> Vec<Position> { line.iter().map(|p| position(*p)).collect() };
    let rings = |rings: &Vec<Vec<DVec3>>| -> Vec<_> { rings.iter().map(positions).collect() };
    match geometry {
        Geometry::Lines(lines) => match &lines[..] {
            [line] => GeometryValue::LineString { coordinates: positions(line) },
            _ => GeometryValue::MultiLineString { coordinates: rings(lines) },
        },
        Geometry::Areas(areas) => match &areas[..] {
            [area] => GeometryValue::Polygon { coordinates: rings(area) },
            _ => GeometryValue::MultiPolygon { coordinates: areas.iter().map(rings).collect() },
        },
    }
}

/// The position to 7 decimals (a centimetre, if degrees) and the height to 2, or none if `NaN`.
fn position(p: DVec3) -> Position {
    let [x, y] = [p.x, p.y].map(|v| round(v, 7));
    if p.z.is_finite() { Position::from([x, y, round(p.z, 2)]) } else { Position::from([x, y]) }
}

/// Cuts a line (longitude, latitude, height) where it crosses 180°, as RFC 7946 section 3.1.9 asks.
/// Longitudes may be given beyond ±180; two successive ones are taken to go the short way round.
fn cut_at_antimeridian(line: &[DVec3]) -> Vec<Vec<DVec3>> {
    let wrap = |p: DVec3| DVec3::new(p.x - 360.0 * (p.x / 360.0).round(), p.y, p.z);
    let mut parts = vec![Vec::new()];
    let mut last: Option<DVec3> = None;
    for here in line.iter().map(|&p| wrap(p)) {
        if let Some(before) = last.filter(|l| (here.x - l.x).abs() > 180.0) {
            // `side` is the edge of the map left through: 180 going east, −180 going west.
            let side = 180f64.copysign(before.x);
            let unwrapped = here + DVec3::new(360f64.copysign(before.x), 0.0, 0.0);
            let t = (side - before.x) / (unwrapped.x - before.x);
            let edge = before.lerp(unwrapped, t);
            parts.last_mut().expect("never empty").push(edge.with_x(side));
            parts.push(vec![edge.with_x(-side)]);
        }
        parts.last_mut().expect("never empty").push(here);
        last = Some(here);
    }
    // A line that only touches 180° leaves a part of no length.
    let has_length = |part: &Vec<DVec3>| part.iter().any(|p| p.truncate() != part[0].truncate());
    if parts.len() > 1 {
        parts.retain(has_length);
    }
    parts
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::error::Error;
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
        assert!(note.contains("map coordinates") && note.contains("names no CRS"), "{note}");
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
    fn touching_the_date_line_cuts_nothing() {
        let line = [[-179.0, 0.0], [180.0, 0.0], [-179.0, 1.0]];
        let line: Vec<_> = line.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let parts = cut_at_antimeridian(&line);
        assert!(parts.iter().all(|part| part.iter().all(|p| p.x < 0.0)), "{parts:?}");
        assert_eq!(cut_at_antimeridian(&line[..1]).len(), 1);
    }

    #[test]
    fn regions_are_polygons_with_holes() {
        let square = |from: f64, to: f64| {
            [(from, to), (to, to), (to, from), (from, from), (from, to)].map(DVec2::from).to_vec()
        };
        let mut hole = square(0.5, 1.5);
        hole.reverse();
        let polygon = Polygon { exterior: square(-0.5, 2.5), holes: vec![hole] };
        // The middle column lies on 180°.
        let frame =
            GridFrame::new(3, 3, DVec2::new(179.0, 1.0), DVec2::ONE, Ground::WGS84).unwrap();
        let mut properties = JsonObject::new();
        properties.insert("region".into(), 7.into());
        let wrapped = |p: DVec2| Ok(DVec2::new(p.x - 360.0 * (p.x / 360.0).round(), p.y));
        let features = vec![region_feature(&properties, &[polygon], &frame)];
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
