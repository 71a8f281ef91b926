//! GeoKeys: what a GeoTIFF says of its CRS.

use std::borrow::Cow;

use super::{Crs, length_unit, unit_name};
use crate::error::{Error, Result};

/// The GeoKey directory of a GeoTIFF and the values it points to (OGC 19-008r4, section 7.1).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GeoKeys {
    /// Tag 34735: version, revision, minor revision, number of keys; then four numbers a key.
    pub(crate) directory: Vec<u16>,
    /// Tag 34736.
    pub(crate) doubles: Vec<f64>,
    /// Tag 34737, without the final NUL. Bytes, as the keys count them: files hold Latin-1 and UTF-8 too.
    pub(crate) ascii: Vec<u8>,
}

/// Value of a key whose meaning the file spells out itself.
const USER_DEFINED: u16 = 32767;

/// GeoKey numbers that are used (OGC 19-008r4, annex B).
pub(in crate::terrain) mod key {
    pub(crate) const MODEL_TYPE: u16 = 1024;
    pub(crate) const RASTER_TYPE: u16 = 1025;
    pub(crate) const CITATION: u16 = 1026;
    pub(crate) const GEOGRAPHIC_CRS: u16 = 2048;
    pub(crate) const GEOGRAPHIC_CITATION: u16 = 2049;
    pub(crate) const GEODETIC_DATUM: u16 = 2050;
    pub(crate) const ANGULAR_UNITS: u16 = 2054;
    pub(crate) const ELLIPSOID: u16 = 2056;
    pub(crate) const SEMI_MAJOR: u16 = 2057;
    pub(crate) const SEMI_MINOR: u16 = 2058;
    pub(crate) const INVERSE_FLATTENING: u16 = 2059;
    pub(crate) const PROJECTED_CRS: u16 = 3072;
    pub(crate) const PROJECTED_CITATION: u16 = 3073;
    pub(crate) const METHOD: u16 = 3075;
    pub(crate) const LINEAR_UNITS: u16 = 3076;
    pub(crate) const LINEAR_UNIT_SIZE: u16 = 3077;
    pub(crate) const STD_PARALLEL_1: u16 = 3078;
    pub(crate) const STD_PARALLEL_2: u16 = 3079;
    /// Longitude of natural origin, false origin, centre, or straight vertical pole.
    pub(crate) const ORIGIN_LON: [u16; 4] = [3080, 3084, 3088, 3095];
    /// Latitude of natural origin, false origin, centre.
    pub(crate) const ORIGIN_LAT: [u16; 3] = [3081, 3085, 3089];
    /// False easting at natural origin, false origin, centre.
    pub(crate) const EASTING: [u16; 3] = [3082, 3086, 3090];
    /// False northing at natural origin, false origin, centre.
    pub(crate) const NORTHING: [u16; 3] = [3083, 3087, 3091];
    /// Scale at natural origin or centre.
    pub(crate) const SCALE: [u16; 2] = [3092, 3093];
    pub(crate) const VERTICAL_CRS: u16 = 4096;
    pub(crate) const VERTICAL_UNITS: u16 = 4099;
}

impl GeoKeys {
    /// The keys that name an EPSG code (OGC 19-008r4, sections 7.4 and 7.5); none if it does not fit 16 bits.
    pub(super) fn from_epsg(code: u32, geographic: bool) -> Self {
        let Ok(code) = u16::try_from(code) else { return Self::default() };
        // 1 is projected, 2 geographic.
        let (model, crs) =
            if geographic { (2, key::GEOGRAPHIC_CRS) } else { (1, key::PROJECTED_CRS) };
        let directory = [
            [1, 1, 0, 3],
            [key::MODEL_TYPE, 0, 1, model],
            [key::RASTER_TYPE, 0, 1, 1],
            [crs, 0, 1, code],
        ];
        Self { directory: directory.concat(), ..Self::default() }
    }

    /// `(location, count, value or offset)` of a key.
    fn find(&self, key: u16) -> Option<(u16, usize, u16)> {
        let (entries, _) = self.directory.get(4..)?.as_chunks::<4>();
        entries.iter().find(|e| e[0] == key).map(|e| (e[1], e[2].into(), e[3]))
    }

    /// A key's code.
    pub(in crate::terrain) fn short(&self, key: u16) -> Option<u16> {
        self.find(key).filter(|(location, ..)| *location == 0).map(|(.., value)| value)
    }

    /// A key's EPSG code, if it is one: neither undefined nor user-defined.
    pub(super) fn code(&self, key: u16) -> Option<u32> {
        self.short(key).filter(|code| *code != 0 && *code != USER_DEFINED).map(u32::from)
    }

    fn double(&self, key: u16) -> Option<f64> {
        let (location, _, offset) = self.find(key)?;
        (location == 34736).then(|| self.doubles.get(usize::from(offset)).copied()).flatten()
    }

    fn text(&self, key: u16) -> Option<Cow<'_, str>> {
        let (location, count, offset) = self.find(key)?;
        let start = usize::from(offset);
        let text = (location == 34737).then(|| self.ascii.get(start..start + count)).flatten()?;
        let text = text.split(|b| *b == b'|').next().filter(|t| !t.is_empty())?;
        Some(String::from_utf8_lossy(text))
    }

    /// Without the vertical part, and for `PixelIsArea`.
    pub(super) fn horizontal(self) -> Self {
        let Some((header, entries)) = self.directory.split_at_checked(4) else {
            return Self::default();
        };
        let (entries, _) = entries.as_chunks::<4>();
        let kept = entries.iter().filter(|e| e[0] < key::VERTICAL_CRS && e[0] != key::RASTER_TYPE);
        let mut kept: Vec<_> = kept.copied().chain([[key::RASTER_TYPE, 0, 1, 1]]).collect();
        // Keys ascend; of two alike the first counts, as it does for `find`.
        kept.sort_by_key(|e| e[0]);
        kept.dedup_by_key(|e| e[0]);
        let directory = [&header[..3], &[kept.len() as u16], &kept.concat()].concat();
        Self { directory, ..self }
    }

    /// Metres per unit of a projected CRS; metres if nothing is said.
    fn metres_per_unit(&self) -> Result<f64> {
        match self.short(key::LINEAR_UNITS) {
            None => Some(1.0),
            Some(USER_DEFINED) => self.double(key::LINEAR_UNIT_SIZE).filter(|m| m.is_finite() && *m > 0.0),
            Some(code) => length_unit(code).map(|(_, metres)| metres),
        }
        .ok_or_else(|| {
            Error::usage(
                "the unit of the map coordinates is not known, so the size of a cell on the ground is not either; \
                 reproject with `gdalwarp -t_srs EPSG:...`, or name the right CRS with `gdal_edit.py -a_srs EPSG:...`",
            )
        })
    }

    fn crs_name(&self) -> Cow<'_, str> {
        let citations = [key::PROJECTED_CITATION, key::CITATION, key::GEOGRAPHIC_CITATION];
        citations.iter().find_map(|k| self.text(*k)).unwrap_or("unnamed".into())
    }

    /// A CRS of which only the unit is known, and perhaps a code.
    pub(super) fn named_crs(&self) -> Option<Crs> {
        self.short(key::LINEAR_UNITS)?;
        let metres = self.metres_per_unit().ok()?;
        Some(Crs {
            epsg: self.code(key::PROJECTED_CRS),
            ..Crs::named(&self.crs_name(), &unit_name(metres), metres)
        })
    }

    pub(super) fn user_projected_crs(&self) -> Result<Crs> {
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

    pub(super) fn user_geographic_crs(&self) -> Result<Crs> {
        let unit = self.short(key::ANGULAR_UNITS).unwrap_or(9102);
        if !matches!(unit, 9102 | 9122) {
            return Err(Error::usage(format!(
                "angles are in EPSG unit {unit}, not degrees; reproject with `gdalwarp -t_srs EPSG:4326`"
            )));
        }
        let Some((datum, caveat)) = self.datum() else {
            return Err(Error::usage(
                "a geographic CRS without an ellipsoid; name the right one with `gdal_edit.py -a_srs EPSG:...`",
            ));
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
        let tokens = |code| {
            let definition = crs_definitions::from_code(code)?.proj4;
            let rest = definition.strip_prefix("+proj=longlat ")?;
            Some(rest.trim_end_matches("+no_defs").trim().to_owned())
        };
        if let Some(known) = code.and_then(tokens) {
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
            (None, ..) => tokens(coded(key::ELLIPSOID, 7000)?)?,
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
