//! GeoKeys: how a GeoTIFF says what its CRS is.

use std::borrow::Cow;

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
pub(super) const USER_DEFINED: u16 = 32767;

/// GeoKey numbers that are used (OGC 19-008r4, annex B).
pub(in crate::terrain) mod key {
    pub(crate) const MODEL_TYPE: u16 = 1024;
    pub(crate) const RASTER_TYPE: u16 = 1025;
    pub(crate) const CITATION: u16 = 1026;
    pub(crate) const GEOGRAPHIC_CRS: u16 = 2048;
    pub(crate) const GEOGRAPHIC_CITATION: u16 = 2049;
    pub(crate) const GEODETIC_DATUM: u16 = 2050;
    pub(crate) const PRIME_MERIDIAN: u16 = 2051;
    pub(crate) const ANGULAR_UNITS: u16 = 2054;
    pub(crate) const ANGULAR_UNIT_SIZE: u16 = 2055;
    pub(crate) const ELLIPSOID: u16 = 2056;
    pub(crate) const SEMI_MAJOR: u16 = 2057;
    pub(crate) const SEMI_MINOR: u16 = 2058;
    pub(crate) const INVERSE_FLATTENING: u16 = 2059;
    pub(crate) const PRIME_MERIDIAN_LON: u16 = 2061;
    /// Three or seven parameters of the shift to WGS84 (libgeotiff).
    pub(crate) const TO_WGS84: u16 = 2062;
    pub(crate) const PROJECTED_CRS: u16 = 3072;
    pub(crate) const PROJECTED_CITATION: u16 = 3073;
    pub(crate) const CONVERSION: u16 = 3074;
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
    pub(crate) const AZIMUTH: u16 = 3094;
    pub(crate) const RECTIFIED_GRID_ANGLE: u16 = 3096;
    pub(crate) const VERTICAL_CRS: u16 = 4096;
    pub(crate) const VERTICAL_UNITS: u16 = 4099;
}

impl GeoKeys {
    /// The keys that name an EPSG code (OGC 19-008r4, sections 7.4 and 7.5); none if it does not fit 16 bits.
    #[cfg(any(feature = "export", test))]
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

    pub(super) fn double(&self, key: u16) -> Option<f64> {
        self.doubles_of(key)?.first().copied()
    }

    pub(super) fn doubles_of(&self, key: u16) -> Option<&[f64]> {
        let (location, count, offset) = self.find(key)?;
        let start = usize::from(offset);
        (location == 34736).then(|| self.doubles.get(start..start + count)).flatten()
    }

    pub(super) fn text(&self, key: u16) -> Option<Cow<'_, str>> {
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
}
