//! The CRS that the GeoKeys of a GeoTIFF describe.

use std::borrow::Cow;
use std::sync::Arc;

use super::crs::Crs;
use super::from_wkt::datum_of_crs;
use super::geo_keys::{GeoKeys, USER_DEFINED, key};
use super::units::{length_unit, unit_name};
use crate::error::{Error, Remedy, Result};

impl Crs {
    /// The CRS that the GeoKeys of a GeoTIFF describe.
    pub(in crate::terrain) fn from_geo_keys(keys: GeoKeys) -> Result<Self> {
        let codes = [key::PROJECTED_CRS, key::GEOGRAPHIC_CRS].map(|k| keys.code(k));
        let crs = match (keys.short(key::MODEL_TYPE), codes) {
            (Some(3), _) => {
                return Err(Error::argument("the CRS", "geocentric (X, Y, Z)", "a map")
                    .advise(Remedy::Reproject));
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
}

impl GeoKeys {
    /// Metres per unit of a projected CRS; metres if nothing is said.
    fn metres_per_unit(&self) -> Result<f64> {
        match self.short(key::LINEAR_UNITS) {
            None => Some(1.0),
            Some(USER_DEFINED) => {
                self.double(key::LINEAR_UNIT_SIZE).filter(|m| m.is_finite() && *m > 0.0)
            }
            Some(code) => length_unit(code).map(|(_, metres)| metres),
        }
        .ok_or_else(|| {
            Error::argument("the unit of the map coordinates", "unknown", "a unit of length")
                .advise(
                    Remedy::SetCrs
                        .after("without it the size of a cell on the ground is not known: "),
                )
        })
    }

    fn crs_name(&self) -> Cow<'_, str> {
        let citations = [key::PROJECTED_CITATION, key::CITATION, key::GEOGRAPHIC_CITATION];
        citations.iter().find_map(|k| self.text(*k)).unwrap_or("unnamed".into())
    }

    /// A CRS of which only the unit is known, and perhaps a code.
    fn named_crs(&self) -> Option<Crs> {
        self.short(key::LINEAR_UNITS)?;
        let metres = self.metres_per_unit().ok()?;
        Some(Crs {
            epsg: self.code(key::PROJECTED_CRS),
            ..Crs::named(&self.crs_name(), &unit_name(metres), metres)
        })
    }

    fn user_projected_crs(&self) -> Result<Crs> {
        let name = self.crs_name();
        let metres = self.metres_per_unit()?;
        let plain = Crs::named(&name, &unit_name(metres), metres);
        if name.contains("Pseudo-Mercator") || name.contains("Web_Mercator") {
            return Crs::from_epsg(3857);
        }
        let (Some(conversion), Some((datum, caveat))) = (self.conversion(metres), self.datum())
        else {
            return Ok(plain);
        };
        let definition = format!("{conversion} {datum} +to_meter={metres} +no_defs");
        Ok(match Crs::from_proj(&definition, &name) {
            Ok(crs) => Crs { caveat: crs.caveat.or(caveat), ..crs },
            Err(_) => plain,
        })
    }

    fn user_geographic_crs(&self) -> Result<Crs> {
        let unit = self.short(key::ANGULAR_UNITS).unwrap_or(9102);
        if !matches!(unit, 9102 | 9122) {
            let found = format!("EPSG unit {unit}");
            return Err(Error::argument("the unit of angles", found, "the degree")
                .advise(Remedy::ReprojectToLonLat));
        }
        let Some((datum, caveat)) = self.datum() else {
            return Err(Error::argument("the ellipsoid of the CRS", "missing", "given")
                .advise(Remedy::SetCrs));
        };
        let crs = Crs::from_proj(&format!("+proj=longlat {datum} +no_defs"), &self.crs_name())?;
        Ok(Crs { caveat: crs.caveat.or(caveat), ..crs })
    }

    /// The ellipsoid and datum shift in PROJ.4 notation, and a caveat if the shift is not known.
    fn datum(&self) -> Option<(String, Option<String>)> {
        // EPSG numbers a datum 6000 + n where the geographic CRS on it is 4000 + n, an ellipsoid 7000 + n
        // where the CRS "on an unknown datum based upon it" is 4000 + n (OGC 19-008r4, annex C).
        let coded = |key, base: u16| {
            self.short(key).filter(|c| (base..base + 1000).contains(c)).map(|c| c - base + 4000)
        };
        let code = coded(key::GEOGRAPHIC_CRS, 4000).or_else(|| coded(key::GEODETIC_DATUM, 6000));
        if let Some(known) = code.and_then(datum_of_crs) {
            return Some((known, None));
        }
        let semi_major = self.double(key::SEMI_MAJOR).filter(|a| a.is_finite() && *a > 0.0);
        let ellipsoid = match (
            semi_major,
            self.double(key::INVERSE_FLATTENING),
            self.double(key::SEMI_MINOR),
        ) {
            (Some(a), Some(rf), _) if rf > 1.0 => format!("+a={a} +rf={rf}"),
            (Some(a), _, Some(b)) if b > 0.0 && b < a => format!("+a={a} +b={b}"),
            (Some(a), ..) => format!("+R={a}"),
            (None, ..) => datum_of_crs(coded(key::ELLIPSOID, 7000)?)?,
        };
        let on_earth = semi_major.is_none_or(|a| (a - 6_371_000.0).abs() < 20_000.0);
        let caveat = "the file does not name its datum; longitudes and latitudes may be some hundred metres off";
        Some((ellipsoid, on_earth.then(|| caveat.to_owned())))
    }

    /// The map projection in PROJ.4 notation, for the methods that DEMs come in.
    fn conversion(&self, metres_per_unit: f64) -> Option<String> {
        let first = |keys: &[u16]| keys.iter().find_map(|k| self.double(*k));
        let lat_0 = first(&key::ORIGIN_LAT).unwrap_or(0.0);
        let lon_0 = first(&key::ORIGIN_LON).unwrap_or(0.0);
        let parallel_1 = self.double(key::STD_PARALLEL_1);
        let parallel_2 = self.double(key::STD_PARALLEL_2).or(parallel_1);
        let true_scale = parallel_1.map(|lat| format!(" +lat_ts={lat}")).unwrap_or_default();
        let method = match self.short(key::METHOD)? {
            1 => format!("+proj=tmerc +lat_0={lat_0}"),
            7 => format!("+proj=merc{true_scale}"),
            8 => format!("+proj=lcc +lat_1={} +lat_2={} +lat_0={lat_0}", parallel_1?, parallel_2?),
            9 => format!("+proj=lcc +lat_1={lat_0} +lat_0={lat_0}"),
            10 => format!("+proj=laea +lat_0={lat_0}"),
            11 => format!("+proj=aea +lat_1={} +lat_2={} +lat_0={lat_0}", parallel_1?, parallel_2?),
            15 => format!("+proj=stere +lat_0={} +lat_ts={lat_0}", 90f64.copysign(lat_0)),
            17 => format!("+proj=eqc{true_scale} +lat_0={lat_0}"),
            24 => "+proj=sinu".to_owned(),
            _ => return None,
        };
        let scale = first(&key::SCALE).unwrap_or(1.0);
        let [x_0, y_0] =
            [key::EASTING, key::NORTHING].map(|k| first(&k).unwrap_or(0.0) * metres_per_unit);
        Some(format!("{method} +lon_0={lon_0} +k={scale} +x_0={x_0} +y_0={y_0}"))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn assert_near(a: DVec2, b: DVec2, tolerance: f64) {
        assert!((a - b).length() < tolerance, "{a} and {b} differ by {}", (a - b).length());
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
