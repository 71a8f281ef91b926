//! What GDAL keeps in a file `….aux.xml` beside a raster that it may not change: nodata, scale, offset and unit of bands.
//!
//! It goes before what the raster itself says, as it does for GDAL (*Persistent Auxiliary Metadata*).

use std::fs;
use std::path::Path;

/// The text of such a file; empty if there is none.
#[derive(Default)]
pub(super) struct Auxiliary(String);

impl Auxiliary {
    /// Of the raster `path`.
    pub(super) fn beside(path: &Path) -> Self {
        let mut beside = path.as_os_str().to_owned();
        beside.push(".aux.xml");
        Self(fs::read_to_string(beside).unwrap_or_default())
    }

    /// The nodata value of a band, numbered from 0, as written.
    pub(super) fn nodata(&self, band: usize) -> Option<&str> {
        self.text(band, "NoDataValue")
    }

    /// The unit of a band.
    pub(super) fn unit(&self, band: usize) -> Option<&str> {
        self.text(band, "UnitType")
    }

    /// The `scale` or `offset` of a band.
    pub(super) fn number(&self, band: usize, role: &str) -> Option<f64> {
        let element = if role == "scale" { "Scale" } else { "Offset" };
        self.text(band, element)?.parse().ok().filter(|number: &f64| number.is_finite())
    }

    /// The text of an element of a band.
    fn text(&self, band: usize, element: &str) -> Option<&str> {
        let number = format!("band=\"{}\"", band + 1);
        let bands = self.0.split("<PAMRasterBand").skip(1);
        let of_band = bands.filter_map(|text| text.split_once('>'));
        let (_, inside) = of_band.into_iter().find(|(tag, _)| tag.contains(&number))?;
        let inside = inside.split("</PAMRasterBand").next()?;
        // The tag may have attributes, and other tags may begin alike.
        let (_, rest) = inside.split_once(&format!("<{element}"))?;
        let rest = rest.strip_prefix('>').or_else(|| {
            rest.starts_with(char::is_whitespace)
                .then(|| rest.split_once('>'))
                .flatten()
                .map(|r| r.1)
        })?;
        Some(rest.split('<').next()?.trim())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_of_a_band_are_found() {
        let file = Auxiliary(
            "<PAMDataset><PAMRasterBand band=\"1\"><NoDataValue le_hex_equiv=\"00\">-9.999E+03</NoDataValue>\
             <Offset>5</Offset><Scale>0.5</Scale><UnitType>ft</UnitType></PAMRasterBand>\
             <PAMRasterBand band=\"2\"><Description>x</Description></PAMRasterBand></PAMDataset>"
                .to_owned(),
        );
        assert_eq!(file.nodata(0), Some("-9.999E+03"));
        assert_eq!((file.number(0, "scale"), file.number(0, "offset")), (Some(0.5), Some(5.0)));
        assert_eq!((file.unit(0), file.unit(1), file.nodata(2)), (Some("ft"), None, None));
        assert_eq!(Auxiliary::default().nodata(0), None);
    }
}
