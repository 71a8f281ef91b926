//! Routes as GPX 1.1 tracks, for navigation devices.

use ::gpx::{Gpx, GpxVersion, Track, TrackSegment, Waypoint};
use glam::DVec2;

use super::{digits, round};
use crate::error::{Error, Result};
use crate::route::Route;
use crate::terrain::Crs;

/// A GPX document with one track per `(name, route)`, heights in metres.
///
/// # Errors
/// [`Error::Argument`] if points in `crs` cannot be brought to longitude and latitude, which GPX needs.
pub fn routes_gpx(routes: &[(impl AsRef<str>, &Route)], crs: &Crs) -> Result<String> {
    document(routes, |map| crs.to_lonlat(map))
}

fn document(
    routes: &[(impl AsRef<str>, &Route)],
    to_lonlat: impl Fn(DVec2) -> Result<DVec2>,
) -> Result<String> {
    let tracks = routes
        .iter()
        .map(|(name, route)| track(name.as_ref(), route, &to_lonlat))
        .collect::<Result<Vec<_>>>()?;
    let gpx = Gpx {
        version: GpxVersion::Gpx11,
        creator: Some(concat!("ridgeway ", env!("CARGO_PKG_VERSION")).to_owned()),
        tracks,
        ..Gpx::default()
    };
    let mut out = Vec::new();
    ::gpx::write(&gpx, &mut out).map_err(|e| Error::damaged("the GPX document", e))?;
    String::from_utf8(out).map_err(|e| Error::damaged("the GPX document", e))
}

fn track(name: &str, route: &Route, to_lonlat: impl Fn(DVec2) -> Result<DVec2>) -> Result<Track> {
    let mut segment = TrackSegment::new();
    for p in &route.points {
        let lonlat = to_lonlat(p.truncate()).map_err(|e| {
            e.advise(
                "name the CRS of the DEM, or write .geojson or .csv, which hold map coordinates",
            )
        })?;
        let mut point = Waypoint::new((wrapped(lonlat.x), round(lonlat.y, 7)).into());
        point.elevation = p.z.is_finite().then(|| round(p.z, 2));
        segment.points.push(point);
    }
    Ok(Track {
        name: Some(name.to_owned()),
        description: Some(description(route)),
        segments: vec![segment],
        ..Track::default()
    })
}

/// Longitude in [−180, 180), as the GPX schema asks, to 7 decimals.
fn wrapped(lon: f64) -> f64 {
    let lon = round((lon + 180.0).rem_euclid(360.0) - 180.0, 7);
    if lon == 180.0 { -180.0 } else { lon }
}

fn description(route: &Route) -> String {
    let s = &route.summary;
    format!(
        "metric {}, cost {} {}, length {:.1} m, climb {:.1} m, descent {:.1} m, max grade {:.1} %, \
         mean grade {:.1} %",
        s.metric,
        digits(s.cost),
        s.cost_unit,
        s.length_m,
        s.climb_m,
        s.descent_m,
        s.max_grade_percent,
        s.mean_grade_percent
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::geojson::tests::route;

    #[test]
    fn a_track_reads_back() {
        let text = document(&[("to <B> & back", &route())], Ok).unwrap();
        let gpx = ::gpx::read(text.as_bytes()).unwrap();
        let track = &gpx.tracks[0];
        assert_eq!(track.name.as_deref(), Some("to <B> & back"));
        assert!(track.description.as_deref().unwrap().contains("cost 1.000 m, "));
        assert!(track.description.as_deref().unwrap().contains("climb 20.0 m"));
        let point = &track.segments[0].points[1];
        assert_eq!((point.point().x(), point.point().y()), (2.25, 41.5));
        assert_eq!(point.elevation, Some(120.12));
    }

    #[test]
    fn without_a_crs_gpx_says_what_to_do() {
        let error =
            document(&[("a", &route())], |_| Err(Error::argument("the CRS", "unknown", "known")))
                .unwrap_err();
        assert!(error.to_string().contains("write .geojson"), "{error}");
    }

    #[test]
    fn longitudes_are_wrapped() {
        assert_eq!(wrapped(181.0), -179.0);
        assert_eq!(wrapped(-180.0), -180.0);
        assert_eq!(wrapped(179.999_999_99), -180.0);
    }
}
