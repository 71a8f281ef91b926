//! The CRS that a `.prj` file of ArcInfo Workstation describes: a keyword and its value a line, then the parameters.

use super::crs::Crs;
use super::from_wkt::datum_of_crs;
use super::units::length_unit;
use crate::error::{Error, Remedy, Result};

impl Crs {
    /// The CRS that the keywords of ArcInfo describe; which parameter means what is as GDAL reads them
    /// (`OGRSpatialReference::importFromESRI`).
    pub(super) fn from_arc_info(text: &str) -> Result<Self> {
        let file = ArcInfo::new(text);
        let projection = file.value("projection").unwrap_or_default();
        let name = format!("ArcInfo {projection}");
        if projection.eq_ignore_ascii_case("GREATBRITIAN_GRID") {
            return Self::from_epsg(27700);
        }
        let (Some(conversion), Some(datum)) = (file.conversion(&projection), file.datum()) else {
            let expected = "UTM, GEOGRAPHIC, ALBERS, LAMBERT, LAMBERT_AZIMUTHAL, TRANSVERSE, MERCATOR or POLAR, on a \
                            datum or spheroid that is known";
            return Err(Error::argument("the projection of the CRS description", name, expected)
                .advise(Remedy::ReplaceWkt));
        };
        let unit = match projection.eq_ignore_ascii_case("GEOGRAPHIC") {
            true => String::new(),
            false => format!(" +to_meter={}", file.metres_per_unit()?),
        };
        if let (Some(zone), 1.0, Some(base)) =
            (file.utm_zone(&projection), file.metres_per_unit()?, file.utm_base())
        {
            return Self::from_epsg(base + zone);
        }
        Self::from_proj(&format!("{conversion} {datum}{unit} +no_defs"), &name)
    }
}

/// Lines `keyword value`, and after the line `Parameters` the parameters in order.
struct ArcInfo {
    values: Vec<(String, String)>,
    parameters: Vec<f64>,
}

impl ArcInfo {
    fn new(text: &str) -> Self {
        let mut lines = text.lines().map(|line| line.split("/*").next().unwrap_or_default().trim());
        let header = lines.by_ref().take_while(|line| !line.eq_ignore_ascii_case("parameters"));
        let pair = |line: &str| {
            let (keyword, value) = line.split_once(char::is_whitespace)?;
            Some((keyword.to_ascii_lowercase(), value.trim().to_owned()))
        };
        let values = header.filter_map(pair).collect();
        Self { values, parameters: lines.map_while(number).collect() }
    }

    fn value(&self, keyword: &str) -> Option<String> {
        self.values.iter().find(|(k, _)| k == keyword).map(|(_, value)| value.clone())
    }

    /// The parameter of a number from 1 on; 0 if there are fewer.
    fn parameter(&self, number: usize) -> f64 {
        self.parameters.get(number - 1).copied().unwrap_or(0.0)
    }

    /// The map projection in PROJ.4 notation.
    fn conversion(&self, projection: &str) -> Option<String> {
        let [p1, p2, p3, p4, p5, p6] = [1, 2, 3, 4, 5, 6].map(|n| self.parameter(n));
        Some(match projection.to_ascii_uppercase().as_str() {
            "GEOGRAPHIC" => "+proj=longlat".to_owned(),
            "UTM" => {
                let south = if self.is_south() { " +south" } else { "" };
                format!("+proj=utm +zone={}{south}", self.utm_zone(projection)?)
            }
            "ALBERS" => format!(
                "+proj=aea +lat_1={p1} +lat_2={p2} +lon_0={p3} +lat_0={p4} +x_0={p5} +y_0={p6}"
            ),
            "LAMBERT" => format!(
                "+proj=lcc +lat_1={p1} +lat_2={p2} +lon_0={p3} +lat_0={p4} +x_0={p5} +y_0={p6}"
            ),
            "LAMBERT_AZIMUTHAL" => {
                format!("+proj=laea +lon_0={p2} +lat_0={p3} +x_0={p4} +y_0={p5}")
            }
            "TRANSVERSE" => {
                format!("+proj=tmerc +k={p1} +lon_0={p2} +lat_0={p3} +x_0={p4} +y_0={p5}")
            }
            "MERCATOR" => format!("+proj=merc +lon_0={p1} +lat_ts={p2} +x_0={p3} +y_0={p4}"),
            "POLAR" => {
                let pole = 90f64.copysign(p2);
                format!("+proj=stere +lat_0={pole} +lat_ts={p2} +lon_0={p1} +x_0={p3} +y_0={p4}")
            }
            _ => return None,
        })
    }

    /// Southern UTM zones are written as northern ones with a shift.
    fn is_south(&self) -> bool {
        let negative = |keyword| self.value(keyword).is_some_and(|v| v.starts_with('-'));
        self.value("yshift").and_then(|v| v.parse::<f64>().ok()).is_some_and(|shift| shift != 0.0)
            || negative("zone")
    }

    fn utm_zone(&self, projection: &str) -> Option<u32> {
        let zone = self.value("zone").filter(|_| projection.eq_ignore_ascii_case("UTM"))?;
        zone.trim_start_matches('-').parse().ok().filter(|zone| (1..=60).contains(zone))
    }

    /// What is added to the number of a UTM zone to get its EPSG code.
    fn utm_base(&self) -> Option<u32> {
        Some(match (self.value("datum")?.to_ascii_uppercase().as_str(), self.is_south()) {
            ("WGS84", false) => 32600,
            ("WGS84", true) => 32700,
            ("NAD83", false) => 26900,
            ("NAD27", false) => 26700,
            _ => return None,
        })
    }

    /// The datum, else the spheroid, in PROJ.4 notation.
    fn datum(&self) -> Option<String> {
        let code = match self.value("datum").unwrap_or_default().to_ascii_uppercase().as_str() {
            "WGS84" => 4326,
            "WGS72" => 4322,
            "NAD27" => 4267,
            "NAD83" => 4269,
            "ED50" | "EUR" => 4230,
            "GDA94" => 4283,
            _ => match self.value("spheroid")?.to_ascii_uppercase().as_str() {
                "GRS80" | "GRS1980" => 4019,
                "WGS84" => 4326,
                "CLARKE1866" => 4008,
                "BESSEL" => 4004,
                "AIRY" => 4001,
                "INT1909" | "INTERNATIONAL1909" => 4022,
                "KRASOVSKY" => 4024,
                "SPHERE" => 4035,
                _ => return None,
            },
        };
        datum_of_crs(code)
    }

    /// Metres per map unit; `FEET` are those of the US survey, and a number is how many units a metre has.
    fn metres_per_unit(&self) -> Result<f64> {
        let unit = self.value("units").unwrap_or_else(|| "METERS".to_owned()).to_ascii_uppercase();
        let metres = match unit.as_str() {
            "METERS" | "DD" | "DS" => Some(1.0),
            "FEET" => length_unit(9003).map(|(_, metres)| metres),
            "INT_FEET" => length_unit(9002).map(|(_, metres)| metres),
            number => {
                number.parse::<f64>().ok().map(f64::recip).filter(|m| m.is_finite() && *m > 0.0)
            }
        };
        metres.ok_or_else(|| {
            Error::argument(
                "the unit of the CRS description",
                format!("`{unit}`"),
                "METERS, FEET or a number",
            )
        })
    }
}

/// A number, or degrees, minutes and seconds.
fn number(line: &str) -> Option<f64> {
    let parts: Vec<f64> = line.split_whitespace().map_while(|t| t.parse().ok()).collect();
    match parts[..] {
        [value] => Some(value),
        [degrees, minutes, seconds] => {
            Some(degrees + (minutes / 60.0 + seconds / 3600.0).copysign(degrees))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn read(lines: &[&str]) -> Result<Crs> {
        Crs::from_text(&lines.join("\r\n"))
    }

    #[test]
    fn keywords_of_arc_info_are_read() {
        let utm = ["Projection    UTM", "Zone  31", "Datum  WGS84", "Units   METERS", "Parameters"];
        assert_eq!(read(&utm).unwrap().epsg(), Some(32631));
        let albers = [
            "Projection ALBERS",
            "Datum NAD83",
            "Units METERS",
            "Spheroid GRS1980",
            "Parameters",
            "29 30 0.0 /* 1st standard parallel",
            "45 30 0.0 /* 2nd standard parallel",
            "-96 0 0.0 /* central meridian",
            "23 0 0.0 /* latitude of the origin",
            "0.0 /* false easting",
            "0.0 /* false northing",
        ];
        let place = DVec2::new(1e6, 1e6);
        let [ours, known] =
            [read(&albers), Crs::from_epsg(5070)].map(|crs| crs.unwrap().to_lonlat(place).unwrap());
        assert!((ours - known).length() < 1e-9);
        assert!(read(&["Projection STATEPLANE", "Zone 3601", "Units FEET"]).is_err());
    }
}
