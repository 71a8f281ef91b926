//! The coordinate reference system of a map.

use std::sync::{Arc, LazyLock};

use glam::DVec2;
use proj4rs::Proj;
use proj4rs::adaptors::transform_xy;

use super::datum_shift::without_shift_grids;
use super::geo_keys::GeoKeys;
use super::units::unit_name;
use super::wkt::{wkt_name, wkt_unit};
use crate::error::{Error, Location, Remedy, Result};
use crate::grid::Ground;

/// The coordinate reference system of a terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    pub(super) epsg: Option<u32>,
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) ground: Ground,
    pub(super) projection: Option<Arc<Projection>>,
    pub(super) caveat: Option<String>,
    pub(super) keys: Option<Arc<GeoKeys>>,
}

/// A projection and the PROJ.4 text it was made from.
pub(super) struct Projection {
    definition: String,
    proj: Proj,
}

impl PartialEq for Projection {
    fn eq(&self, other: &Self) -> bool {
        self.definition == other.definition
    }
}

impl std::fmt::Debug for Projection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.definition.fmt(f)
    }
}

static WGS84: LazyLock<Proj> = LazyLock::new(|| {
    Proj::from_proj_string("+proj=longlat +datum=WGS84").expect("a constant that proj4rs reads")
});

impl Crs {
    /// No CRS: map coordinates in metres on a plane, place unknown.
    #[must_use]
    pub fn none() -> Self {
        Self::named("none", "metre", 1.0)
    }

    /// A projected CRS of which only the name and the unit are known.
    pub(super) fn named(name: &str, unit: &str, metres_per_unit: f64) -> Self {
        Self {
            epsg: None,
            name: name.to_owned(),
            unit: unit.to_owned(),
            ground: Ground::Plane { metres_per_unit },
            projection: None,
            caveat: None,
            keys: None,
        }
    }

    /// The CRS of an EPSG code.
    ///
    /// # Errors
    /// [`Error::Argument`] for an unknown code or one whose coordinates are neither lengths nor degrees.
    pub fn from_epsg(code: u32) -> Result<Self> {
        // Numbers that Web Mercator went by before it had its own.
        let code = if matches!(code, 900_913 | 102_100 | 102_113) { 3857 } else { code };
        let definition =
            u16::try_from(code).ok().and_then(crs_definitions::from_code).ok_or_else(|| {
                Error::argument("the EPSG code", code, "that of a horizontal CRS that is known")
                    .advise(Remedy::Reproject)
            })?;
        let (name, wkt) = (wkt_name(definition.wkt), definition.wkt);
        let mut crs = match (Self::from_proj(definition.proj4, name), wkt_unit(wkt)) {
            (Ok(crs), _) => crs,
            // A projection that `proj4rs` lacks: no way to longitude and latitude, but distances are right.
            (Err(_), Some((unit, size))) if wkt.starts_with("PROJCS") => {
                Self::named(name, unit, size)
            }
            (Err(e), _) => return Err(e),
        };
        crs.epsg = Some(code);
        if crs.is_geographic() && wkt.contains("UNIT[\"grad\"") {
            let what = format!("the unit of the angles of EPSG:{code}");
            return Err(
                Error::argument(what, "the grad", "the degree").advise(Remedy::ReprojectToLonLat)
            );
        }
        if code == 3857 {
            crs.ground = Ground::WebMercator;
        }
        Ok(crs)
    }

    /// The CRS of a PROJ.4 text.
    pub(super) fn from_proj(definition: &str, name: &str) -> Result<Self> {
        let (definition, caveat) = without_shift_grids(definition);
        let proj = Proj::from_proj_string(&definition).map_err(|e| {
            let found = format!("`{definition}`, which is not understood ({e})");
            Error::argument(format!("the definition of {name}"), found, "one in PROJ.4 notation")
        })?;
        if proj.is_geocent() {
            return Err(Error::argument(
                format!("the CRS {name}"),
                "geocentric (X, Y, Z)",
                "a map",
            )
            .advise(Remedy::Reproject));
        }
        let (ground, unit) = if proj.is_latlong() {
            let (a, b) = proj.ellipse_parameters();
            (Ground::Ellipsoid { semi_major: a, flattening: (a - b) / a }, "degree".to_owned())
        } else {
            let metres_per_unit = proj.to_meter();
            (Ground::Plane { metres_per_unit }, unit_name(metres_per_unit))
        };
        // South-African "Lo" grids count west and south; in which direction a given file counts is not known.
        let known = proj.is_normalized_axis();
        let projection = known.then(|| Arc::new(Projection { definition, proj }));
        Ok(Self { epsg: None, name: name.to_owned(), unit, ground, projection, caveat, keys: None })
    }

    /// EPSG code, if it has one.
    #[must_use]
    pub fn epsg(&self) -> Option<u32> {
        self.epsg
    }

    /// Name for people: `EPSG:32631 WGS 84 / UTM zone 31N`, `none`, or what the file calls it.
    #[must_use]
    pub fn name(&self) -> String {
        match self.epsg {
            Some(code) => format!("EPSG:{code} {}", self.name).trim_end().to_owned(),
            None => self.name.clone(),
        }
    }

    /// Name of the map unit: `metre`, `US survey foot`, `degree`.
    #[must_use]
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// How map units measure on the ground.
    #[must_use]
    pub fn ground(&self) -> Ground {
        self.ground
    }

    /// Whether map coordinates are longitude and latitude in degrees.
    #[must_use]
    pub fn is_geographic(&self) -> bool {
        matches!(self.ground, Ground::Ellipsoid { .. })
    }

    /// The same map in a unit of `metres`; a code stands for its own unit only, so there is none if that is another.
    pub(super) fn in_unit(self, metres: f64) -> Result<Self> {
        let size = match self.ground {
            Ground::Plane { metres_per_unit } => metres_per_unit,
            Ground::WebMercator => 1.0,
            Ground::Ellipsoid { .. } => return Ok(self),
        };
        if (size / metres - 1.0).abs() < 1e-7 {
            return Ok(self);
        }
        let Some(projection) = &self.projection else {
            return Ok(Self {
                keys: self.keys,
                ..Self::named(&self.name, &unit_name(metres), metres)
            });
        };
        let of_unit = |parameter: &str| {
            parameter.starts_with("+units=") || parameter.starts_with("+to_meter=")
        };
        let parameters = projection.definition.split_whitespace().filter(|p| !of_unit(p));
        let mut definition = parameters.collect::<Vec<_>>().join(" ");
        definition += &format!(" +to_meter={metres}");
        Ok(Self {
            caveat: self.caveat,
            keys: self.keys,
            ..Self::from_proj(&definition, &self.name)?
        })
    }

    /// Whether map coordinates lead to longitude and latitude.
    #[must_use]
    pub fn has_lonlat(&self) -> bool {
        self.projection.is_some()
    }

    /// Whether it is a CRS of the Earth rather than of another body.
    pub(super) fn is_on_earth(&self) -> bool {
        self.projection.as_ref().is_none_or(|projection| {
            let (a, _) = projection.proj.ellipse_parameters();
            (a - 6_371_000.0).abs() < 20_000.0
        })
    }

    /// Whether nothing is known but that map coordinates are metres: [`Crs::none`].
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::none()
    }

    /// How far longitudes and latitudes may be off, if more than a few metres.
    #[must_use]
    pub fn caveat(&self) -> Option<&str> {
        self.caveat.as_deref()
    }

    /// What a GeoTIFF says of this CRS: the GeoKeys of the file it was read from, else its EPSG code; empty if
    /// there is neither.
    ///
    /// The horizontal part only, as heights are in metres here, and always for `PixelIsArea`.
    #[cfg(any(feature = "export", test))]
    pub(crate) fn geo_keys(&self) -> GeoKeys {
        match (&self.keys, self.epsg) {
            (Some(keys), _) => GeoKeys::clone(keys),
            (None, Some(code)) => GeoKeys::from_epsg(code, self.is_geographic()),
            (None, None) => GeoKeys::default(),
        }
    }

    /// Longitude (−180 to 180) and latitude in degrees of map coordinates: on WGS84 for the Earth, on its own
    /// sphere for another body.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, map: DVec2) -> Result<DVec2> {
        let proj = self.projection()?;
        let from = if proj.is_latlong() { radians(map) } else { map };
        let to = transform(proj, &WGS84, from).ok_or_else(|| {
            let found = format!("outside the projection {}", self.name());
            Error::argument("the place", found, "within it").at(Location::Map(map))
        })?;
        Ok(DVec2::new(wrap_degrees(to.x.to_degrees()), to.y.to_degrees()))
    }

    /// Map coordinates of WGS84 longitude and latitude in degrees (its own sphere's for another body).
    ///
    /// In a geographic CRS the result lies within −180 and 180;
    /// [`Terrain::from_lonlat`](crate::Terrain::from_lonlat) finds it on a grid across the date line too.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        let proj = self.projection()?;
        let to = transform(&WGS84, proj, radians(lonlat)).ok_or_else(|| {
            let what = format!("the place at longitude {}, latitude {}", lonlat.x, lonlat.y);
            Error::argument(what, format!("outside the projection {}", self.name()), "within it")
        })?;
        if !proj.is_latlong() {
            return Ok(to);
        }
        Ok(DVec2::new(wrap_degrees(to.x.to_degrees()), to.y.to_degrees()))
    }

    /// Ground metres in a map metre, eastward and northward, at map coordinates of a plane map; `None` where that is not
    /// known, and on maps whose [`Ground`] knows.
    pub(in crate::terrain) fn ground_per_map_metre(&self, map: DVec2) -> Option<DVec2> {
        /// Map metres, many times what inverse projections are iterated to.
        const STEP: f64 = 100.0;
        let Ground::Plane { metres_per_unit } = self.ground else { return None };
        let (a, b) = self.projection().ok()?.ellipse_parameters();
        let here = self.to_lonlat(map).ok()?;
        let ellipsoid = Ground::Ellipsoid { semi_major: a, flattening: (a - b) / a };
        let metres = |along: DVec2| {
            let there = self.to_lonlat(map + along * (STEP / metres_per_unit)).ok()?;
            let by = DVec2::new(wrap_degrees(there.x - here.x), there.y - here.y);
            Some((by * ellipsoid.metres_per_unit(here.y)).length() / STEP)
        };
        Some(DVec2::new(metres(DVec2::X)?, metres(DVec2::Y)?))
    }

    fn projection(&self) -> Result<&Proj> {
        match &self.projection {
            Some(projection) => Ok(&projection.proj),
            None => {
                let found = match self.is_none() {
                    true => "unknown".to_owned(),
                    false => format!("{}, which cannot be projected", self.name()),
                };
                let expected = "one that leads to longitude and latitude";
                Err(Error::argument("the CRS", found, expected)
                    .advise(Remedy::SetCrs.after("use map or grid coordinates, or ")))
            }
        }
    }
}

/// A point in another projection, by `proj4rs`: longitudes and latitudes in radians; `None` where the projection has no answer.
fn transform(from: &Proj, to: &Proj, point: DVec2) -> Option<DVec2> {
    let (x, y) = transform_xy(from, to, point.x, point.y).ok()?;
    let result = DVec2::new(x, y);
    result.is_finite().then_some(result)
}

fn radians(lonlat: DVec2) -> DVec2 {
    DVec2::new(wrap_degrees(lonlat.x).to_radians(), lonlat.y.to_radians())
}

/// The same longitude within −180 and 180; what is within already stays as it is.
fn wrap_degrees(lon: f64) -> f64 {
    if lon.abs() <= 180.0 { lon } else { (lon + 180.0).rem_euclid(360.0) - 180.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(a: DVec2, b: DVec2, tolerance: f64) {
        assert!((a - b).length() < tolerance, "{a} and {b} differ by {}", (a - b).length());
    }

    #[test]
    fn codes_have_names_units_and_grounds() {
        let utm = Crs::from_epsg(32631).unwrap();
        assert_eq!(utm.name(), "EPSG:32631 WGS 84 / UTM zone 31N");
        assert_eq!((utm.unit(), utm.ground(), utm.epsg()), ("metre", Ground::METRES, Some(32631)));
        let feet = Crs::from_epsg(2225).unwrap();
        assert_eq!(feet.unit(), "US survey foot");
        assert_eq!(feet.ground(), Ground::Plane { metres_per_unit: 1200.0 / 3937.0 });
        assert_eq!(Crs::from_epsg(3857).unwrap().ground(), Ground::WebMercator);
        let wgs84 = Crs::from_epsg(4326).unwrap();
        assert!(wgs84.is_geographic() && wgs84.unit() == "degree");
        let Ground::Ellipsoid { semi_major, flattening } = wgs84.ground() else { panic!() };
        assert_eq!(semi_major, 6_378_137.0);
        assert!((1.0 / flattening - 298.257_223_563).abs() < 1e-6);
        assert_eq!(Crs::none().name(), "none");
        assert!(Crs::none().is_none() && !utm.is_none());
    }

    #[test]
    fn unknown_codes_and_foreign_units_are_refused() {
        assert!(Crs::from_epsg(1).is_err());
        assert!(Crs::from_epsg(4_000_000).is_err());
        // NTF (Paris), in grads.
        assert!(Crs::from_epsg(4807).unwrap_err().to_string().contains("grad"));
        assert!(
            Crs::none()
                .to_lonlat(DVec2::ZERO)
                .unwrap_err()
                .to_string()
                .contains("the CRS is unknown")
        );
    }

    #[test]
    fn known_places_are_where_they_are() {
        // The central meridian of zone 31 is 3° E at easting 500 km.
        let utm = Crs::from_epsg(32631).unwrap();
        assert_near(utm.to_lonlat(DVec2::new(500_000.0, 0.0)).unwrap(), DVec2::new(3.0, 0.0), 1e-9);
        // Web Mercator's corner: 180° at π·a.
        let corner = DVec2::splat(std::f64::consts::PI * 6_378_137.0);
        let web = Crs::from_epsg(3857).unwrap();
        assert_near(web.to_lonlat(corner).unwrap(), DVec2::new(180.0, 85.051_128_78), 1e-6);
        // The worked example of EPSG Guidance Note 7-2 (OSGB36 / British National Grid): the
        // geographic coordinates there are on OSGB36, about 100 m from WGS84.
        let bng = Crs::from_epsg(27700).unwrap();
        let place = bng.to_lonlat(DVec2::new(577_274.99, 69_740.50)).unwrap();
        assert_near(place, DVec2::new(0.5, 50.5), 2e-3);
    }

    #[test]
    fn maps_distort_lengths() {
        let size = |code: u32, map: DVec2| Crs::from_epsg(code).unwrap().ground_per_map_metre(map);
        // The scale of UTM on its central meridian is 0.9996.
        let utm = size(32631, DVec2::new(500_000.0, 5e6)).unwrap();
        assert_near(utm, DVec2::splat(1.0 / 0.9996), 1e-5);
        // That of Mercator is 1 on the equator and about 2 at 60°.
        assert_near(size(3395, DVec2::new(1e7, 0.0)).unwrap(), DVec2::ONE, 1e-4);
        assert_near(size(3395, DVec2::new(1e7, 8.37e6)).unwrap(), DVec2::splat(0.5), 2e-3);
        // Feet; where the ground knows.
        assert_near(size(2225, DVec2::new(6.5e6, 2.0e6)).unwrap(), DVec2::ONE, 2e-4);
        assert_eq!((size(3857, DVec2::ZERO), size(4326, DVec2::ZERO)), (None, None));
    }

    #[test]
    fn there_and_back_is_the_identity() {
        for (code, map) in [
            (32719, DVec2::new(400_000.0, 6_400_000.0)),
            (27700, DVec2::new(340_000.0, 520_000.0)),
            (3031, DVec2::new(-500_000.0, 800_000.0)),
            (2225, DVec2::new(6_000_000.0, 2_000_000.0)),
            (31287, DVec2::new(167_455.0, 361_955.0)),
            (26710, DVec2::new(560_000.0, 5_115_000.0)),
            (4326, DVec2::new(-118.2, 34.6)),
            (4269, DVec2::new(-118.2, 34.6)),
        ] {
            let crs = Crs::from_epsg(code).unwrap();
            let back = crs.from_lonlat(crs.to_lonlat(map).unwrap()).unwrap();
            assert_near(back, map, if crs.is_geographic() { 1e-9 } else { 1e-3 });
        }
    }

    #[test]
    fn nad27_is_shifted_by_about_a_hundred_metres_and_says_so() {
        let nad27 = Crs::from_epsg(4267).unwrap();
        let place = DVec2::new(-122.2, 46.2);
        let shift =
            (nad27.to_lonlat(place).unwrap() - place) * Ground::WGS84.metres_per_unit(place.y);
        assert!((60.0..150.0).contains(&shift.length()), "{shift}");
        assert!(nad27.caveat().unwrap().contains("NAD27"));
    }

    #[test]
    fn longitudes_wrap() {
        let wgs84 = Crs::from_epsg(4326).unwrap();
        assert_near(
            wgs84.to_lonlat(DVec2::new(181.0, 10.0)).unwrap(),
            DVec2::new(-179.0, 10.0),
            1e-9,
        );
        assert_near(
            wgs84.from_lonlat(DVec2::new(350.0, 10.0)).unwrap(),
            DVec2::new(-10.0, 10.0),
            1e-9,
        );
        assert!(wgs84.from_lonlat(DVec2::new(f64::NAN, 10.0)).is_err());
    }
}
