//! The CRS that the GeoKeys of a GeoTIFF describe.

use std::borrow::Cow;
use std::sync::Arc;

use super::crs::Crs;
use super::from_wkt::datum_of_crs;
use super::geo_keys::{GeoKeys, USER_DEFINED, key};
use super::units::{angle_unit, length_unit, unit_name};
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
            (_, [Some(code), _]) => {
                let crs = Self::from_epsg(code).or_else(|e| keys.named_crs().ok_or(e))?;
                match keys.own_unit()? {
                    Some(metres) => crs.in_unit(metres)?,
                    None => crs,
                }
            }
            (Some(2) | None, [None, Some(code)]) => {
                Self::from_epsg(code).or_else(|e| keys.user_geographic_crs().map_err(|_| e))?
            }
            _ if keys.esri_text().is_some() => keys.esri_crs()?,
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

/// What stands before well-known text in a citation.
const ESRI_TEXT: &str = "ESRI PE String = ";

impl GeoKeys {
    /// Metres per unit that the keys give for a projected CRS beside its code or parameters; `None` if they say nothing.
    fn own_unit(&self) -> Result<Option<f64>> {
        let size = self.double(key::LINEAR_UNIT_SIZE).filter(|m| m.is_finite() && *m > 0.0);
        let code = match self.short(key::LINEAR_UNITS) {
            None | Some(0) => return Ok(None),
            Some(USER_DEFINED) if self.code(key::PROJECTED_CRS).is_some() => return Ok(size),
            Some(code) => code,
        };
        let metres = if code == USER_DEFINED { size } else { length_unit(code).map(|(_, m)| m) };
        metres.map(Some).ok_or_else(|| {
            Error::argument("the unit of the map coordinates", "unknown", "a unit of length")
                .advise(
                    Remedy::SetCrs
                        .after("without it the size of a cell on the ground is not known: "),
                )
        })
    }

    /// Metres per unit of a projected CRS; metres if nothing is said.
    fn metres_per_unit(&self) -> Result<f64> {
        Ok(self.own_unit()?.unwrap_or(1.0))
    }

    /// Degrees per unit of the angles among the parameters: the keys', else that of the geographic CRS.
    fn degrees_per_unit(&self) -> Result<f64> {
        let degrees = match self.short(key::ANGULAR_UNITS) {
            Some(USER_DEFINED) => self.double(key::ANGULAR_UNIT_SIZE).map(f64::to_degrees),
            Some(code) => angle_unit(code),
            None => {
                let code = self.short(key::GEOGRAPHIC_CRS).and_then(crs_definitions::from_code);
                let in_grads = code.is_some_and(|known| known.wkt.contains("UNIT[\"grad\""));
                Some(if in_grads { 0.9 } else { 1.0 })
            }
        };
        degrees.ok_or_else(|| {
            let found = format!("EPSG unit {}", self.short(key::ANGULAR_UNITS).unwrap_or_default());
            Error::argument("the unit of angles of the CRS", found, "the degree or the grad")
                .advise(Remedy::ReprojectToLonLat)
        })
    }

    /// The well-known text that ESRI's software puts into a citation.
    fn esri_text(&self) -> Option<Cow<'_, str>> {
        [key::PROJECTED_CITATION, key::CITATION, key::GEOGRAPHIC_CITATION]
            .iter()
            .filter_map(|k| self.text(*k))
            .find(|text| text.starts_with(ESRI_TEXT))
    }

    fn esri_crs(&self) -> Result<Crs> {
        let text = self.esri_text().unwrap_or_default();
        Crs::from_text(text.trim_start_matches(ESRI_TEXT))
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
        let degrees = self.degrees_per_unit()?;
        let (Some(conversion), Some((datum, caveat))) =
            (self.conversion(metres, degrees), self.datum()?)
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
        let Some((datum, caveat)) = self.datum()? else {
            return Err(Error::argument("the ellipsoid of the CRS", "missing", "given")
                .advise(Remedy::SetCrs));
        };
        let crs = Crs::from_proj(&format!("+proj=longlat {datum} +no_defs"), &self.crs_name())?;
        Ok(Crs { caveat: crs.caveat.or(caveat), ..crs })
    }

    /// The ellipsoid, datum shift and prime meridian in PROJ.4 notation, and a caveat if the shift is not known.
    fn datum(&self) -> Result<Option<(String, Option<String>)>> {
        // EPSG numbers a datum 6000 + n where the geographic CRS on it is 4000 + n, an ellipsoid 7000 + n
        // where the CRS "on an unknown datum based upon it" is 4000 + n (OGC 19-008r4, annex C).
        let coded = |key, base: u16| {
            self.short(key).filter(|c| (base..base + 1000).contains(c)).map(|c| c - base + 4000)
        };
        // As GDAL has it, the prime meridian of a geographic CRS with a code is that of the code.
        if let Some(known) = self.short(key::GEOGRAPHIC_CRS).and_then(datum_of_crs) {
            return Ok(Some((known, None)));
        }
        let meridian = self.prime_meridian()?;
        if let Some(known) = coded(key::GEODETIC_DATUM, 6000).and_then(datum_of_crs) {
            let known = known.split(" +pm=").next().unwrap_or_default();
            return Ok(Some((format!("{known}{meridian}"), None)));
        }
        let semi_major = self.double(key::SEMI_MAJOR).filter(|a| a.is_finite() && *a > 0.0);
        let ellipsoid = match (
            semi_major,
            self.double(key::INVERSE_FLATTENING),
            self.double(key::SEMI_MINOR),
        ) {
            (Some(a), Some(rf), _) if rf > 1.0 => Some(format!("+a={a} +rf={rf}")),
            (Some(a), _, Some(b)) if b > 0.0 && b < a => Some(format!("+a={a} +b={b}")),
            (Some(a), ..) => Some(format!("+R={a}")),
            (None, ..) => coded(key::ELLIPSOID, 7000).and_then(datum_of_crs),
        };
        let on_earth = semi_major.is_none_or(|a| (a - 6_371_000.0).abs() < 20_000.0);
        let caveat = "the file does not name its datum; longitudes and latitudes may be some hundred metres off";
        let shift = self.datum_shift();
        let caveat = (on_earth && shift.is_empty()).then(|| caveat.to_owned());
        Ok(ellipsoid.map(|text| (text + &shift + &meridian, caveat)))
    }

    /// ` +towgs84=` and the parameters of the datum shift; empty without them.
    fn datum_shift(&self) -> String {
        match self.doubles_of(key::TO_WGS84) {
            Some(shift) if matches!(shift.len(), 3 | 7) && shift.iter().all(|x| x.is_finite()) => {
                let parameters: Vec<_> = shift.iter().map(f64::to_string).collect();
                format!(" +towgs84={}", parameters.join(","))
            }
            _ => String::new(),
        }
    }

    /// ` +pm=` and the longitude of the prime meridian; empty for Greenwich.
    fn prime_meridian(&self) -> Result<String> {
        let lon = self.double(key::PRIME_MERIDIAN_LON);
        let lon = match (lon, self.short(key::PRIME_MERIDIAN)) {
            (Some(lon), _) => lon * self.degrees_per_unit()?,
            (None, None | Some(0 | 8901 | USER_DEFINED)) => 0.0,
            (None, Some(code)) => prime_meridian(code).ok_or_else(|| {
                let found = format!("EPSG:{code}");
                Error::argument("the prime meridian of the CRS", found, "one that is known")
                    .advise(Remedy::ReprojectToLonLat)
            })?,
        };
        Ok(if lon == 0.0 { String::new() } else { format!(" +pm={lon}") })
    }

    /// The conversion of a UTM zone in PROJ.4 notation: EPSG 16000 + n in the north, 16100 + n in the south.
    fn utm_zone(&self) -> Option<String> {
        match self.short(key::CONVERSION)? {
            code @ 16001..=16060 => Some(format!("+proj=utm +zone={}", code - 16000)),
            code @ 16101..=16160 => Some(format!("+proj=utm +zone={} +south", code - 16100)),
            _ => None,
        }
    }

    /// The map projection in PROJ.4 notation, for the methods that DEMs come in.
    fn conversion(&self, metres_per_unit: f64, degrees_per_unit: f64) -> Option<String> {
        if let Some(zone) = self.utm_zone() {
            return Some(zone);
        }
        let first = |keys: &[u16]| keys.iter().find_map(|k| self.double(*k));
        let angle = |keys: &[u16]| first(keys).map(|angle| angle * degrees_per_unit);
        let lat_0 = angle(&key::ORIGIN_LAT).unwrap_or(0.0);
        let lon_0 = angle(&key::ORIGIN_LON).unwrap_or(0.0);
        let parallel_1 = angle(&[key::STD_PARALLEL_1]);
        let parallel_2 = angle(&[key::STD_PARALLEL_2]).or(parallel_1);
        let azimuth = angle(&[key::AZIMUTH]);
        let true_scale = parallel_1.map(|lat| format!(" +lat_ts={lat}")).unwrap_or_default();
        let method = match self.short(key::METHOD)? {
            1 => format!("+proj=tmerc +lat_0={lat_0}"),
            // False easting and northing are those of the natural origin, or of the centre.
            code @ (3 | 9815) => {
                let gamma = angle(&[key::RECTIFIED_GRID_ANGLE]).or(azimuth)?;
                let (alpha, center) = (azimuth?, format!("+lat_0={lat_0} +lonc={lon_0}"));
                let origin = if code == 3 { " +no_uoff" } else { "" };
                format!("+proj=omerc {center} +alpha={alpha} +gamma={gamma}{origin}")
            }
            7 => format!("+proj=merc{true_scale}"),
            8 => format!("+proj=lcc +lat_1={} +lat_2={} +lat_0={lat_0}", parallel_1?, parallel_2?),
            9 => format!("+proj=lcc +lat_1={lat_0} +lat_0={lat_0}"),
            10 => format!("+proj=laea +lat_0={lat_0}"),
            11 => format!("+proj=aea +lat_1={} +lat_2={} +lat_0={lat_0}", parallel_1?, parallel_2?),
            12 => format!("+proj=aeqd +lat_0={lat_0}"),
            13 => {
                format!("+proj=eqdc +lat_1={} +lat_2={} +lat_0={lat_0}", parallel_1?, parallel_2?)
            }
            14 => format!("+proj=stere +lat_0={lat_0}"),
            15 => format!("+proj=stere +lat_0={} +lat_ts={lat_0}", 90f64.copysign(lat_0)),
            16 => format!("+proj=sterea +lat_0={lat_0}"),
            18 => format!("+proj=cass +lat_0={lat_0}"),
            19 => format!("+proj=gnom +lat_0={lat_0}"),
            20 => "+proj=mill".to_owned(),
            21 => format!("+proj=ortho +lat_0={lat_0}"),
            22 => format!("+proj=poly +lat_0={lat_0}"),
            23 => "+proj=robin".to_owned(),
            28 => format!("+proj=cea{true_scale}"),
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

/// Longitude of an EPSG prime meridian in degrees east of Greenwich.
fn prime_meridian(code: u16) -> Option<f64> {
    Some(match code {
        8901 => 0.0,
        8902 => -9.131_906_111_111,
        8903 => 2.337_229_166_667,
        8904 => -74.080_916_666_667,
        8905 => -3.687_938_888_889,
        8906 => 12.452_333_333_333,
        8907 => 7.439_583_333_333,
        8908 => 106.807_719_444_444,
        8909 => -17.666_666_666_667,
        8910 => 4.367_975,
        8911 => 18.058_277_777_778,
        8912 => 23.716_337_5,
        8913 => 10.722_916_666_667,
        _ => return None,
    })
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

    /// Short keys and doubles, which are numbered in order, as a directory.
    fn keys(shorts: &[(u16, u16)], numbers: &[(u16, f64)], ascii: &str) -> GeoKeys {
        let mut entries: Vec<[u16; 4]> =
            shorts.iter().map(|&(k, value)| [k, 0, 1, value]).collect();
        entries.extend(numbers.iter().zip(0..).map(|((k, _), i)| [*k, 34736, 1, i]));
        if !ascii.is_empty() {
            entries.push([key::PROJECTED_CITATION, 34737, ascii.len() as u16, 0]);
        }
        let header = [1, 1, 0, entries.len() as u16];
        GeoKeys {
            directory: [header.to_vec(), entries.concat()].concat(),
            doubles: numbers.iter().map(|(_, number)| *number).collect(),
            ascii: ascii.as_bytes().to_vec(),
        }
    }

    #[test]
    fn a_unit_beside_a_code_counts() {
        // As GDAL has it: the false easting stays where it is on the ground.
        let metres = Crs::from_epsg(2853).unwrap();
        let at = DVec2::new(3_600_000.0, 1_950_000.0);
        let foot = 1200.0 / 3937.0;
        let of = |unit, numbers: &[(u16, f64)]| {
            Crs::from_geo_keys(keys(&[(1024, 1), (3072, 2853), (3076, unit)], numbers, ""))
        };
        for crs in [of(9003, &[]).unwrap(), of(32767, &[(3077, foot)]).unwrap()] {
            let place = crs.to_lonlat(at / foot).unwrap();
            assert_near(place, metres.to_lonlat(at).unwrap(), 1e-9);
            assert_eq!((crs.epsg(), crs.unit()), (None, "US survey foot"));
        }
        assert_eq!(of(9001, &[]).unwrap().epsg(), Some(2853));
        assert!(of(9999, &[]).unwrap_err().to_string().contains("unit"));
    }

    #[test]
    fn meridians_and_grads_count() {
        let paris = [(1024, 2), (2048, 32767), (2051, 8903), (2054, 9102), (2056, 7011)];
        let crs = Crs::from_geo_keys(keys(&paris, &[], "")).unwrap();
        assert_near(
            crs.to_lonlat(DVec2::new(0.0, 48.0)).unwrap(),
            DVec2::new(2.337_229, 48.0),
            1e-5,
        );
        // Lambert II with its parameters in grads, as GDAL reads it.
        let lambert = [(1024, 1), (2048, 4807), (3072, 32767), (3075, 9), (3076, 9001)];
        let numbers = [(3081, 52.0), (3080, 0.0), (3082, 6e5), (3083, 2.2e6), (3092, 0.999_877_42)];
        let ours = Crs::from_geo_keys(keys(&lambert, &numbers, "")).unwrap();
        let known = Crs::from_epsg(27572).unwrap();
        let at = DVec2::new(6.5e5, 2.3e6);
        assert_near(ours.to_lonlat(at).unwrap(), known.to_lonlat(at).unwrap(), 1e-7);
        let unknown = [(1024, 2), (2048, 32767), (2051, 8999), (2056, 7011)];
        assert!(Crs::from_geo_keys(keys(&unknown, &[], "")).is_err());
    }

    #[test]
    fn zones_and_datum_shifts_without_a_code_count() {
        let at = DVec2::new(1.6e6, 1.6e7);
        let foot = 1200.0 / 3937.0;
        let zone = [(1024, 1), (2050, 6326), (3072, 32767), (3074, 16033), (3076, 9003)];
        let ours = Crs::from_geo_keys(keys(&zone, &[], "")).unwrap().to_lonlat(at).unwrap();
        let known = Crs::from_epsg(32633).unwrap().to_lonlat(at * foot).unwrap();
        assert_near(ours, known, 1e-9);
        // GeogTOWGS84GeoKey of seven numbers.
        let airy = [(1024, 2), (2048, 32767), (2056, 7001)];
        let mut keys = keys(&airy, &[(2062, 446.448)], "");
        keys.directory[4 * 4 + 2] = 7;
        keys.doubles.extend([-125.157, 542.06, 0.15, 0.247, 0.842, -20.489]);
        let crs = Crs::from_geo_keys(keys).unwrap();
        let at = DVec2::new(-1.0, 52.0);
        let known = Crs::from_epsg(4277).unwrap().to_lonlat(at).unwrap();
        assert_near(crs.to_lonlat(at).unwrap(), known, 1e-5);
        assert_eq!(crs.caveat(), None);
    }

    #[test]
    fn the_text_of_esri_in_a_citation_counts() {
        let text = r#"ESRI PE String = PROJCS["ETRS_1989_LAEA",GEOGCS["GCS_ETRS_1989",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Azimuthal_Equal_Area"],PARAMETER["False_Easting",4321000.0],PARAMETER["False_Northing",3210000.0],PARAMETER["Central_Meridian",10.0],PARAMETER["Latitude_Of_Origin",52.0],UNIT["Meter",1.0]]|"#;
        let crs = Crs::from_geo_keys(keys(&[(1024, 1), (3072, 32767), (3076, 9001)], &[], text));
        let at = DVec2::new(4.5e6, 3.0e6);
        let known = Crs::from_epsg(3035).unwrap().to_lonlat(at).unwrap();
        assert_near(crs.unwrap().to_lonlat(at).unwrap(), known, 1e-7);
    }
}
