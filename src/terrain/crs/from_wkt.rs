//! The CRS that a `.prj` file describes.

use std::collections::BTreeMap;

use proj4rs::Proj;

use super::crs::Crs;
use super::epsg_names::{geographic_code, projected_code};
use super::wkt::{
    horizontal_crs, is_projected, wkt_authority, wkt_datum, wkt_geographic_name, wkt_name, wkt_unit,
};
use crate::error::{Error, Remedy, Result};
use crate::grid::Ground;

impl Crs {
    /// The CRS of the text of a `.prj` file: well-known text of either version as OGC, GDAL and ESRI write it, a PROJ.4
    /// text, `EPSG:…`, or the keywords of ArcInfo.
    pub(in crate::terrain) fn from_text(text: &str) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}').trim();
        let code = text.strip_prefix("+init=").unwrap_or(text);
        if let Some((authority, code)) = code.split_once(':')
            && authority.eq_ignore_ascii_case("EPSG")
            && let Ok(code) = code.split_whitespace().next().unwrap_or_default().parse()
        {
            return Self::from_epsg(code);
        }
        // So Web Mercator says that its sphere is none of the datum, in PROJ.4 notation and in GDAL's extension of WKT 1.
        if text.contains("+nadgrids=@null") && text.contains("+a=6378137 +b=6378137") {
            return Self::from_epsg(3857);
        }
        if text.starts_with('+') {
            let known = ["+datum=", "+towgs84=", "+nadgrids=", "+ellps=GRS80", "+ellps=WGS84"];
            let is_known = known.iter().any(|key| text.contains(key));
            let unknown_datum = (!is_known).then(|| "without a name".to_owned());
            let definition = Definition { proj4: text.to_owned(), unknown_datum };
            return match Self::from_proj(text, text) {
                Ok(crs) => Ok(definition.crs(text).unwrap_or(crs)),
                Err(error) => Err(error.advise(Remedy::Reproject)),
            };
        }
        if text.get(..10).is_some_and(|word| word.eq_ignore_ascii_case("projection")) {
            return Self::from_arc_info(text);
        }
        Self::from_wkt(text)
    }

    /// The CRS of well-known text: by its EPSG code, else by what it spells out, else by its unit only.
    ///
    /// A CRS that spells out what an EPSG code of its name stands for gets the code.
    pub(super) fn from_wkt(text: &str) -> Result<Self> {
        let Some(wkt) = horizontal_crs(text) else { return Err(not_understood()) };
        let name = wkt_name(wkt);
        let size = wkt_unit(wkt).map_or(0.0, |(_, size)| size);
        if let Some(crs) = wkt_authority(wkt).and_then(|code| Self::from_epsg(code).ok()) {
            return Ok(crs);
        }
        if !is_projected(wkt) {
            return Self::from_geographic_wkt(wkt, name, size);
        }
        let mut crs = match Definition::from_wkt(wkt) {
            Some(definition) => definition.crs(name),
            None => None,
        };
        if let Some(code) = projected_code(name).map(u32::from)
            && let Ok(known) = Self::from_epsg(code)
            && same_unit(&known, size)
            && crs.is_none() | Definition::same_conversion(wkt, code)
        {
            crs = Some(known);
        }
        match (crs, wkt_unit(wkt)) {
            (Some(crs), _) => Ok(crs),
            (None, Some((unit, size))) if size.is_finite() && size > 0.0 => {
                Ok(Self::named(name, unit, size))
            }
            _ => Err(not_understood()),
        }
    }

    /// A geographic CRS by a name that EPSG knows or by its ellipsoid.
    fn from_geographic_wkt(wkt: &str, name: &str, size: f64) -> Result<Self> {
        if size == 0.0 || !wkt.contains('[') {
            return Err(not_understood());
        }
        if (size - 1f64.to_radians()).abs() > 1e-9 {
            let found = wkt_unit(wkt).map_or_else(String::new, |(unit, _)| format!("`{unit}`"));
            return Err(Error::argument("the unit of angles of the CRS", found, "the degree")
                .advise(Remedy::ReprojectToLonLat));
        }
        if let Some(code) = geographic_code(name)
            && let Ok(known) = Self::from_epsg(code.into())
            && wkt.split_once("PRIMEM[").is_none_or(|(_, prime)| prime.contains("Greenwich"))
        {
            return Ok(known);
        }
        Definition::from_wkt(wkt).and_then(|d| d.crs(name)).ok_or_else(not_understood)
    }
}

fn same_unit(crs: &Crs, size: f64) -> bool {
    matches!(crs.ground(), Ground::Plane { metres_per_unit } if (metres_per_unit / size - 1.0).abs() < 1e-7)
        || (crs.ground() == Ground::WebMercator && size == 1.0)
}

fn not_understood() -> Error {
    let found = "one without an EPSG code or a unit that is understood";
    Error::argument("the CRS description", found, "one with either")
        .advise(Remedy::ReplaceWkt.after("remove it to have map units taken as metres, or "))
}

/// What well-known text spells out.
struct Definition {
    /// In PROJ.4 notation.
    proj4: String,
    /// A datum whose shift to WGS84 is not known.
    unknown_datum: Option<String>,
}

impl Definition {
    /// `None` for a projection that is not known, or text that is damaged.
    fn from_wkt(wkt: &str) -> Option<Self> {
        let proj4 = proj4wkt::wkt_to_projstring(wkt).ok()?;
        if wkt.contains("TOWGS84[") {
            return Some(Self { proj4, unknown_datum: None });
        }
        let datum = wkt_datum(wkt).unwrap_or("without a name");
        let names = [Some(datum), wkt_geographic_name(wkt)];
        let known = names.into_iter().flatten().filter_map(geographic_code).find_map(datum_of_crs);
        if let Some(known) = known
            && let Some(proj4) = with_datum(&proj4, &known)
        {
            return Some(Self { proj4, unknown_datum: None });
        }
        // A datum on the ellipsoid of WGS84 or GRS80 is within a few metres of WGS84 and has a shift already.
        let unknown = !proj4.contains("+towgs84=");
        Some(Self { proj4, unknown_datum: unknown.then(|| datum.to_owned()) })
    }

    /// The CRS; `None` if `proj4rs` lacks the projection.
    fn crs(self, name: &str) -> Option<Crs> {
        let mut crs = Crs::from_proj(&self.proj4, name).ok()?;
        if self.proj4.starts_with("+proj=webmerc") {
            crs = Crs { ground: Ground::WebMercator, ..crs };
        }
        if let Some(datum) = self.unknown_datum.filter(|_| crs.is_on_earth()) {
            crs.caveat = Some(format!(
                "the shift of the datum {datum} to WGS84 is not known; longitudes and latitudes may be some hundred \
                 metres off"
            ));
        }
        Some(crs)
    }

    /// Whether well-known text spells out the map projection of an EPSG code.
    fn same_conversion(wkt: &str, code: u32) -> bool {
        let known = u16::try_from(code).ok().and_then(crs_definitions::from_code);
        let texts = [Some(wkt), known.map(|known| known.wkt)];
        match texts.map(|wkt| proj4wkt::wkt_to_projstring(wkt?).ok()) {
            [Some(ours), Some(known)] => conversion(&ours) == conversion(&known),
            _ => false,
        }
    }
}

/// The parameters of a map projection other than those of the datum, rounded, less those that change nothing.
fn conversion(proj4: &str) -> BTreeMap<&str, String> {
    let parameters = proj4.split_whitespace().filter(|text| !is_of_datum(text));
    let pairs = parameters.filter_map(|text| text.split_once('='));
    let numbers = pairs.map(|(key, value)| match value.parse::<f64>() {
        Ok(number) => (key, format!("{number:.7}")),
        Err(_) => (key, value.to_owned()),
    });
    numbers
        .filter(|(key, value)| {
            value != if key.starts_with("+k") { "1.0000000" } else { "0.0000000" }
        })
        .collect()
}

fn is_of_datum(parameter: &str) -> bool {
    ["+a=", "+b=", "+rf=", "+R=", "+towgs84="].iter().any(|key| parameter.starts_with(key))
}

/// A definition with the datum of another, if the two have the same ellipsoid.
fn with_datum(proj4: &str, datum: &str) -> Option<String> {
    let ellipsoid = |parameters: &str| {
        let proj = Proj::from_proj_string(&format!("+proj=longlat {parameters}")).ok()?;
        Some(proj.ellipse_parameters())
    };
    let (ours, others): (Vec<_>, Vec<_>) = proj4.split_whitespace().partition(|p| is_of_datum(p));
    let [(a, b), (known_a, known_b)] =
        [ellipsoid(&ours.join(" "))?, ellipsoid(datum_ellipsoid(datum))?];
    let same = (a - known_a).abs() < 1.0 && (b - known_b).abs() < 1.0;
    same.then(|| format!("{} {datum}", others.join(" ")))
}

/// A datum without shift grids, which are not at hand.
fn datum_ellipsoid(datum: &str) -> &str {
    if datum.contains("NAD27") {
        "+ellps=clrk66"
    } else {
        datum.split("+nadgrids").next().unwrap_or(datum)
    }
}

/// The ellipsoid and datum shift of a geographic CRS in PROJ.4 notation, by its EPSG code.
pub(super) fn datum_of_crs(code: u16) -> Option<String> {
    let definition = crs_definitions::from_code(code)?.proj4;
    let rest = definition.strip_prefix("+proj=longlat ")?;
    Some(rest.trim_end_matches("+no_defs").trim().to_owned())
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

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
        let moon = r#"GEOGCS["GCS_Moon",DATUM["D_Moon",SPHEROID["Moon",1737400.0,0.0]],PRIMEM["Reference",0],UNIT["Degree",0.0174532925199433]]"#;
        let sphere = Ground::Ellipsoid { semi_major: 1_737_400.0, flattening: 0.0 };
        assert_eq!(Crs::from_wkt(moon).unwrap().ground(), sphere);
        assert_eq!(Crs::from_wkt(moon).unwrap().caveat(), None);
        // The code of a part is not the code of the whole.
        let local =
            r#"PROJCS["Site grid",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["foot",0.3048]]"#;
        let crs = Crs::from_wkt(local).unwrap();
        assert_eq!((crs.epsg(), crs.name()), (None, "Site grid".to_owned()));
        assert_eq!(crs.ground(), Ground::Plane { metres_per_unit: 0.3048 });
        assert!(Crs::from_wkt("Projection UTM").is_err());
    }

    #[test]
    fn text_of_any_dialect_is_the_crs_of_its_code() {
        let table = std::fs::read_to_string("data/crs_dialects.csv").unwrap();
        let (mut lines, mut wrong) = (0, Vec::new());
        for line in table.lines().skip(1) {
            let mut fields = line.splitn(7, ';');
            let mut number = || fields.next().unwrap().parse::<f64>().unwrap();
            let (code, x, y, lon, lat, tolerance) =
                (number(), number(), number(), number(), number(), number());
            let text = fields.next().unwrap();
            let place = Crs::from_text(text).and_then(|crs| crs.to_lonlat(DVec2::new(x, y)));
            let place = place.unwrap_or(DVec2::NAN);
            let mut by = place - DVec2::new(lon, lat);
            by.x -= (by.x / 360.0).round() * 360.0;
            let off = by * Ground::WGS84.metres_per_unit(lat);
            if off.is_nan() || off.length() > tolerance {
                wrong.push(format!("EPSG:{code} is {off} m off: {text}"));
            }
            lines += 1;
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        assert!(lines > 40);
    }
}
