//! Coordinate reference systems: which one a file is in, and the way to longitude and latitude.
//!
//! Projections are those of [`proj4rs`], definitions those of [`crs_definitions`] (the EPSG data set in PROJ.4
//! notation). Datum shifts are three- or seven-parameter ones; grid files are not at hand, and where that
//! matters [`Crs::caveat`] says how much.

mod geo_keys;
mod wkt;

use std::sync::{Arc, LazyLock};

use glam::DVec2;
use proj4rs::Proj;
use proj4rs::adaptors::transform_xy;

pub(crate) use self::geo_keys::GeoKeys;
pub(super) use self::geo_keys::key;
use self::wkt::{geographic_code, utm_code, wkt_authority, wkt_ellipsoid, wkt_name, wkt_unit};
use crate::error::{Error, Result};
use crate::grid::Ground;

/// The coordinate reference system of a terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    epsg: Option<u32>,
    name: String,
    unit: String,
    ground: Ground,
    projection: Option<Arc<Projection>>,
    caveat: Option<String>,
    keys: Option<Arc<GeoKeys>>,
}

/// A projection and the PROJ.4 text it was made from.
struct Projection {
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
    fn named(name: &str, unit: &str, metres_per_unit: f64) -> Self {
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
    /// [`Error::Usage`] for an unknown code or one whose coordinates are neither lengths nor degrees.
    pub fn from_epsg(code: u32) -> Result<Self> {
        // Numbers that Web Mercator went by before it had its own.
        let code = if matches!(code, 900_913 | 102_100 | 102_113) { 3857 } else { code };
        let definition =
            u16::try_from(code).ok().and_then(crs_definitions::from_code).ok_or_else(|| {
                Error::usage(format!(
                    "EPSG:{code} is not a known code of a horizontal CRS; reproject with \
                 `gdalwarp -t_srs EPSG:...` to one that is, such as the UTM zone"
                ))
            })?;
        let (name, wkt) = (wkt_name(definition.wkt), definition.wkt);
        let mut crs = match (Self::from_proj(definition.proj4, name), wkt_unit(wkt)) {
            (Ok(crs), _) => crs,
            // A projection that is not at hand: no way to longitude and latitude, but distances are right.
            (Err(_), Some((unit, size))) if wkt.starts_with("PROJCS") => {
                Self::named(name, unit, size)
            }
            (Err(e), _) => return Err(e),
        };
        crs.epsg = Some(code);
        if crs.is_geographic() && wkt.contains("UNIT[\"grad\"") {
            return Err(Error::usage(format!(
                "EPSG:{code} counts angles in grads, not degrees; reproject with `gdalwarp -t_srs EPSG:4326`"
            )));
        }
        if code == 3857 {
            crs.ground = Ground::WebMercator;
        }
        Ok(crs)
    }

    /// The CRS of a PROJ.4 text.
    fn from_proj(definition: &str, name: &str) -> Result<Self> {
        let (definition, caveat) = without_shift_grids(definition);
        let proj = Proj::from_proj_string(&definition)
            .map_err(|e| Error::usage(format!("CRS `{definition}` is not understood: {e}")))?;
        if proj.is_geocent() {
            return Err(Error::usage(format!(
                "{name} has geocentric coordinates (X, Y, Z), which are no map; reproject with `gdalwarp -t_srs`"
            )));
        }
        let (ground, unit) = if proj.is_latlong() {
            let (a, b) = proj.ellipse_parameters();
            (Ground::Ellipsoid { semi_major: a, flattening: (a - b) / a }, "degree".to_owned())
        } else {
            let metres_per_unit = proj.to_meter();
            (Ground::Plane { metres_per_unit }, unit_name(metres_per_unit))
        };
        // South-African "Lo" grids count west and south; which way their files do is anyone's guess.
        let known = proj.is_normalized_axis();
        let projection = known.then(|| Arc::new(Projection { definition, proj }));
        Ok(Self { epsg: None, name: name.to_owned(), unit, ground, projection, caveat, keys: None })
    }

    /// The CRS that the GeoKeys of a GeoTIFF describe.
    pub(super) fn from_geo_keys(keys: GeoKeys) -> Result<Self> {
        let codes = [key::PROJECTED_CRS, key::GEOGRAPHIC_CRS].map(|k| keys.code(k));
        let crs = match (keys.short(key::MODEL_TYPE), codes) {
            (Some(3), _) => {
                return Err(Error::usage(
                    "the coordinates are geocentric (X, Y, Z), which are no map; reproject with `gdalwarp -t_srs`",
                ));
            }
            (_, [Some(code), _]) => Self::from_epsg(code).or_else(|e| keys.named_crs().ok_or(e))?,
            (Some(2) | None, [None, Some(code)]) => {
                Self::from_epsg(code).or_else(|e| keys.user_geographic_crs().map_err(|_| e))?
            }
            (Some(1), _) => keys.user_projected_crs()?,
            (Some(2), _) => keys.user_geographic_crs()?,
            _ => match keys.named_crs() {
                Some(crs) => crs,
                None => return Ok(Self::none()),
            },
        };
        Ok(Self { keys: Some(Arc::new(keys.horizontal())), ..crs })
    }

    /// The CRS of well-known text, as in a `.prj` file: by its EPSG code, by a name that tells one, or else by
    /// its ellipsoid or unit only.
    pub(super) fn from_wkt(wkt: &str) -> Result<Self> {
        let (name, wkt) = (wkt_name(wkt), wkt.trim_start());
        let size = wkt_unit(wkt).map_or(0.0, |(_, size)| size);
        let geographic = wkt.starts_with("GEOG") && (size - 1f64.to_radians()).abs() < 1e-9;
        let code = wkt_authority(wkt).or_else(|| match geographic {
            true => geographic_code(name),
            false => utm_code(name).filter(|_| size == 1.0),
        });
        if let Some(crs) = code.and_then(|code| Self::from_epsg(code).ok()) {
            return Ok(crs);
        }
        if let (true, Some(ellipsoid)) = (geographic, wkt_ellipsoid(wkt)) {
            return Self::from_proj(&format!("+proj=longlat {ellipsoid}"), name);
        }
        match wkt_unit(wkt) {
            Some((unit, size)) if wkt.starts_with("PROJ") && size.is_finite() && size > 0.0 => {
                Ok(Self::named(name, unit, size))
            }
            _ => Err(Error::usage(
                "the CRS description names no EPSG code and no unit that is understood; replace it by the WKT that \
                 `gdalsrsinfo -o wkt1 EPSG:...` prints, or remove it to have map units taken as metres",
            )),
        }
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
    /// [`Error::Usage`] if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, map: DVec2) -> Result<DVec2> {
        let proj = self.projection()?;
        let from = if proj.is_latlong() { radians(map) } else { map };
        let to = transform(proj, &WGS84, from).ok_or_else(|| {
            Error::usage(format!(
                "map coordinates {map} lie outside the projection {}",
                self.name()
            ))
        })?;
        Ok(DVec2::new(wrap_degrees(to.x.to_degrees()), to.y.to_degrees()))
    }

    /// Map coordinates of WGS84 longitude and latitude in degrees (its own sphere's for another body).
    ///
    /// In a geographic CRS the result lies within −180 and 180;
    /// [`Terrain::from_lonlat`](crate::Terrain::from_lonlat) finds it on a grid across the date line too.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        let proj = self.projection()?;
        let to = transform(&WGS84, proj, radians(lonlat)).ok_or_else(|| {
            Error::usage(format!(
                "longitude {} and latitude {} lie outside the projection {}",
                lonlat.x,
                lonlat.y,
                self.name()
            ))
        })?;
        if !proj.is_latlong() {
            return Ok(to);
        }
        Ok(DVec2::new(wrap_degrees(to.x.to_degrees()), to.y.to_degrees()))
    }

    /// Ground metres in a map metre, eastward and northward, at map coordinates of a plane map; `None` where that is not
    /// known, and on maps whose [`Ground`] knows.
    pub(super) fn ground_per_map_metre(&self, map: DVec2) -> Option<DVec2> {
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
            None => Err(Error::usage(format!(
                "the terrain {}, so there is no way to longitude and latitude; \
                 give places in map coordinates or pixels, or set a CRS with `gdal_edit.py -a_srs EPSG:...`",
                if self.is_none() {
                    "has no CRS".to_owned()
                } else {
                    format!("is in {}, which cannot be projected", self.name())
                }
            ))),
        }
    }
}

/// Through `proj4rs`, which takes radians for degrees; `None` where the projection has no answer.
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

/// Puts mean datum shifts in the place of grid files that are not at hand, and says what that costs.
fn without_shift_grids(definition: &str) -> (String, Option<String>) {
    /// What to replace, by what, and the caveat. NAD27: EPSG transformation 1173. NZGD49: the
    /// definitions give a seven-parameter shift besides the grid.
    const SHIFTS: [(&str, &str, &str); 3] = [
        (
            "+datum=NAD27",
            "+ellps=clrk66 +towgs84=-8,160,176",
            "longitudes and latitudes from NAD27 use the mean shift of the contiguous United States, good to \
             about 10 m there and possibly 100 m off elsewhere",
        ),
        (
            "+nadgrids=nzgd2kgrid0005.gsb",
            "",
            "longitudes and latitudes from NZGD49 use its mean shift, good to about 4 m",
        ),
        (
            "+proj=krovak",
            "+proj=krovak",
            "longitudes and latitudes from the Krovak projection are about 8 m off",
        ),
    ];
    match SHIFTS.iter().find(|(grid, ..)| definition.contains(grid)) {
        Some((grid, shift, caveat)) => {
            (definition.replace(grid, shift), Some((*caveat).to_owned()))
        }
        None => (definition.to_owned(), None),
    }
}

/// Name of a unit of length by its size in metres.
fn unit_name(metres: f64) -> String {
    let named = [
        (1.0, "metre"),
        (0.3048, "foot"),
        (1200.0 / 3937.0, "US survey foot"),
        (1000.0, "kilometre"),
    ];
    match named.iter().find(|(size, _)| (size - metres).abs() < 1e-9 * size) {
        Some((_, name)) => (*name).to_owned(),
        None => format!("unit of {metres} m"),
    }
}

/// Name and metres of an EPSG unit of length.
pub(super) fn length_unit(code: u16) -> Option<(&'static str, f64)> {
    Some(match code {
        9001 => ("metre", 1.0),
        9002 => ("foot", 0.3048),
        9003 => ("US survey foot", 1200.0 / 3937.0),
        9005 => ("Clarke's foot", 0.304_797_265_4),
        9036 => ("kilometre", 1000.0),
        _ => return None,
    })
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
        assert!(Crs::none().to_lonlat(DVec2::ZERO).unwrap_err().to_string().contains("no CRS"));
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
    fn maps_stretch_the_ground() {
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

    #[test]
    fn well_known_text_gives_the_code_the_zone_or_the_unit() {
        let code = |wkt: &str| Crs::from_wkt(wkt).unwrap().epsg();
        assert_eq!(code(crs_definitions::from_code(31287).unwrap().wkt), Some(31287));
        assert_eq!(
            code(r#"PROJCS["WGS_1984_UTM_Zone_11N",GEOGCS["GCS_WGS_1984"],UNIT["Meter",1.0]]"#),
            Some(32611)
        );
        assert_eq!(code(r#"PROJCS["WGS_1984_UTM_Zone_19S",UNIT["Meter",1.0]]"#), Some(32719));
        assert_eq!(code(r#"GEOGCS["GCS_WGS_1984",UNIT["Degree",0.0174532925199433]]"#), Some(4326));
        let code_or_none = |wkt: &str| Crs::from_wkt(wkt).ok().and_then(|crs| crs.epsg());
        assert_eq!(code_or_none(r#"PROJCS["WGS 84 Lambert",UNIT["Meter",1.0]]"#), None);
        assert_eq!(code_or_none(r#"PROJCS["NAD_1983_UTM_Zone_11N",UNIT["Foot_US",0.3048]]"#), None);
        let moon = r#"GEOGCS["GCS_Moon",SPHEROID["Moon",1737400.0,0.0],UNIT["Degree",0.0174532925199433]]"#;
        let sphere = Ground::Ellipsoid { semi_major: 1_737_400.0, flattening: 0.0 };
        assert_eq!(Crs::from_wkt(moon).unwrap().ground(), sphere);
        // The code of a part is not the code of the whole.
        let local =
            r#"PROJCS["Site grid",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["foot",0.3048]]"#;
        let crs = Crs::from_wkt(local).unwrap();
        assert_eq!((crs.epsg(), crs.name()), (None, "Site grid".to_owned()));
        assert_eq!(crs.ground(), Ground::Plane { metres_per_unit: 0.3048 });
        assert!(Crs::from_wkt("Projection UTM").is_err());
    }

    #[test]
    fn geo_keys_spell_out_a_transverse_mercator_in_feet() {
        let doubles = vec![3.0, 0.9996, 500_000.0 / 0.3048];
        let directory = [
            [1, 1, 0, 9],
            [1024, 0, 1, 1],
            [1025, 0, 1, 2],
            [2048, 0, 1, 4326],
            [3072, 0, 1, 32767],
            [3075, 0, 1, 1],
            [3076, 0, 1, 9002],
            [3080, 34736, 1, 0],
            [3092, 34736, 1, 1],
            [3082, 34736, 1, 2],
            [4099, 0, 1, 9002],
        ];
        let keys = GeoKeys { directory: directory.concat(), doubles, ascii: Vec::new() };
        let crs = Crs::from_geo_keys(keys).unwrap();
        let utm = Crs::from_epsg(32631).unwrap();
        let at = DVec2::new(400_000.0, 4_700_000.0);
        assert_near(crs.to_lonlat(at / 0.3048).unwrap(), utm.to_lonlat(at).unwrap(), 1e-9);
        let kept = crs.geo_keys();
        assert_eq!(kept.short(key::RASTER_TYPE), Some(1));
        assert_eq!(kept.short(key::VERTICAL_UNITS), None);
        assert_eq!(kept.directory.len(), 4 * (1 + usize::from(kept.directory[3])));
    }

    #[test]
    fn geo_keys_come_from_the_file_or_the_code() {
        let utm = [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32631];
        assert_eq!(Crs::from_epsg(32631).unwrap().geo_keys().directory, utm);
        assert_eq!(Crs::from_epsg(4326).unwrap().geo_keys().directory[12..], [2048, 0, 1, 4326]);
        assert_eq!(Crs::none().geo_keys(), GeoKeys::default());
        // Points, with feet for the heights, a key twice and out of order.
        let directory = [
            [1, 1, 0, 5],
            [1025, 0, 1, 2],
            [1024, 0, 1, 1],
            [3072, 0, 1, 32631],
            [3072, 0, 1, 32632],
            [4099, 0, 1, 9002],
        ];
        let keys = GeoKeys { directory: directory.concat(), ..GeoKeys::default() };
        assert_eq!(Crs::from_geo_keys(keys).unwrap().geo_keys().directory, utm);
    }
}
