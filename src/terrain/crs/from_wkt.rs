//! The CRS that a `.prj` file describes.

use super::crs::Crs;
use super::wkt::{geographic_code, utm_code, wkt_authority, wkt_ellipsoid, wkt_name, wkt_unit};
use crate::error::{Error, Remedy, Result};

impl Crs {
    /// The CRS of well-known text, as in a `.prj` file: by its EPSG code, by a name that says one, or else by
    /// its ellipsoid or unit only.
    pub(in crate::terrain) fn from_wkt(wkt: &str) -> Result<Self> {
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
            _ => {
                let found = "one without an EPSG code or a unit that is understood";
                Err(Error::argument("the CRS description", found, "one with either").advise(
                    Remedy::ReplaceWkt.after("remove it to have map units taken as metres, or "),
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

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
}
