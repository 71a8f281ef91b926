//! EPSG codes by name, as EPSG, GDAL and ESRI write the names.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::wkt::{wkt_datum, wkt_name};

/// Names of datums by ESRI that no rule turns into those of EPSG, and the geographic CRS on each.
const ESRI_DATUMS: [(&str, u16); 18] = [
    ("Australian_1966", 4202),
    ("Australian_1984", 4203),
    ("Bogota", 4218),
    ("Corrego_Alegre", 4225),
    ("Dealul_Piscului_1933", 4316),
    ("European_1950_ED77", 4154),
    ("Hu_Tzu_Shan", 4236),
    ("Israel", 4141),
    ("Kertau", 4245),
    ("Luxembourg_Reference_Frame", 4181),
    ("NAD_1927_CGQ77", 4267),
    ("NAD_1927_Definition_1976", 4267),
    ("New_Zealand_1949", 4272),
    ("North_American_Michigan", 4267),
    ("Provisional_S_American_1956", 4248),
    ("Pulkovo_1942_Adj_1958", 4179),
    ("Pulkovo_1942_Adj_1983", 4178),
    ("SIRGAS", 4170),
];

/// Codes of the data set by the [`key`] of a name: of geographic CRSs and their datums, and of projected CRSs.
struct Index {
    geographic: HashMap<String, u16>,
    projected: HashMap<String, u16>,
}

static INDEX: LazyLock<Index> = LazyLock::new(|| {
    let mut index = Index { geographic: HashMap::new(), projected: HashMap::new() };
    for (name, code) in ESRI_DATUMS {
        index.geographic.insert(key(name), code);
    }
    for definition in (0..=u16::MAX).filter_map(crs_definitions::from_code) {
        let wkt = definition.wkt;
        if wkt.starts_with("PROJCS") {
            index.projected.entry(key(wkt_name(wkt))).or_insert(definition.code);
        } else if wkt.starts_with("GEOGCS") {
            index.geographic.entry(key(wkt_name(wkt))).or_insert(definition.code);
            if let Some(datum) = wkt_datum(wkt) {
                index.geographic.entry(key(datum)).or_insert(definition.code);
            }
        }
    }
    index
});

/// EPSG code of a geographic CRS by its name or that of its datum: `GCS_WGS_1984`, `D_OSGB_1936`, `NAD83`.
pub(super) fn geographic_code(name: &str) -> Option<u16> {
    INDEX.geographic.get(&key(name)).copied()
}

/// EPSG code of a projected CRS by its name: `NAD27 / UTM zone 10N`, `RGF_1993_Lambert_93`.
pub(super) fn projected_code(name: &str) -> Option<u16> {
    INDEX.projected.get(&key(name)).copied()
}

/// What names of the same thing have in common: letters and digits, years in full, neither `GCS_`, `D_` nor `datum`.
fn key(name: &str) -> String {
    let name = name.to_ascii_lowercase();
    let name = name.strip_prefix("gcs_").or(name.strip_prefix("d_")).unwrap_or(&name);
    let name = name.replace("datum", "").replace("north_american", "nad");
    let characters: Vec<char> = name.chars().collect();
    let class = |c: &char| (c.is_ascii_digit(), c.is_ascii_alphanumeric() || *c == '+');
    let mut key = String::new();
    for run in characters.chunk_by(|a, b| class(a) == class(b)).filter(|run| class(&run[0]).1) {
        if let ['2'..='9', '0'..='9'] = run {
            key.push_str("19");
        }
        key.extend(run);
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_esri_and_epsg_are_the_same() {
        for (name, code) in [
            ("GCS_WGS_1984", 4326),
            ("WGS 84", 4326),
            ("GCS_North_American_1983", 4269),
            ("NAD27", 4267),
            ("D_OSGB_1936", 4277),
            ("GCS_RGF_1993", 4171),
            ("D_ETRS_1989", 4258),
            ("GCS_Amersfoort", 4289),
            ("D_New_Zealand_1949", 4272),
        ] {
            assert_eq!(geographic_code(name), Some(code), "{name}");
        }
        assert_eq!(projected_code("RGF_1993_Lambert_93"), Some(2154));
        assert_eq!(projected_code("NAD_1927_UTM_Zone_10N"), Some(26710));
        assert_eq!(projected_code("ETRS_1989_UTM_Zone_32N"), Some(25832));
        assert_eq!(projected_code("NAD_1983_2011_UTM_Zone_10N"), Some(6339));
        assert_eq!(projected_code("Site grid"), None);
    }
}
