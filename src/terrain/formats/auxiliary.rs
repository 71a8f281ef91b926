//! What GDAL keeps in a file `….aux.xml` next to a raster that it may not change: the CRS; nodata, scale, offset and unit of bands.
//!
//! It goes before what the raster itself says, as it does for GDAL (*Persistent Auxiliary Metadata*).

use std::fs;
use std::path::Path;

use roxmltree::{Document, Node};

use crate::terrain::Crs;

/// The content of such a file; nothing if there is none, or it is damaged.
#[derive(Default)]
pub(super) struct Auxiliary {
    /// The text of the CRS.
    crs: Option<String>,
    bands: Vec<Band>,
}

struct Band {
    number: String,
    nodata: Option<String>,
    unit: Option<String>,
    scale: Option<f64>,
    offset: Option<f64>,
}

impl Auxiliary {
    /// Of the raster `path`.
    pub(super) fn of(path: &Path) -> Self {
        let mut name = path.as_os_str().to_owned();
        name.push(".aux.xml");
        Self::parse(&fs::read_to_string(name).unwrap_or_default())
    }

    fn parse(xml: &str) -> Self {
        let Ok(document) = Document::parse(xml) else { return Self::default() };
        let nodes = || document.descendants();
        Self {
            crs: nodes().find(|node| node.has_tag_name("SRS")).and_then(text),
            bands: nodes()
                .filter(|node| node.has_tag_name("PAMRasterBand"))
                .map(Band::new)
                .collect(),
        }
    }

    /// The CRS, if it is given and understood.
    pub(super) fn crs(&self) -> Option<Crs> {
        Crs::from_text(self.crs.as_deref()?).ok()
    }

    /// The nodata value of a band, numbered from 0, as written.
    pub(super) fn nodata(&self, band: usize) -> Option<&str> {
        self.band(band)?.nodata.as_deref()
    }

    /// The unit of a band.
    pub(super) fn unit(&self, band: usize) -> Option<&str> {
        self.band(band)?.unit.as_deref()
    }

    /// What the stored numbers of a band are multiplied by.
    pub(super) fn scale(&self, band: usize) -> Option<f64> {
        self.band(band)?.scale
    }

    /// What is then added.
    pub(super) fn offset(&self, band: usize) -> Option<f64> {
        self.band(band)?.offset
    }

    fn band(&self, band: usize) -> Option<&Band> {
        let number = (band + 1).to_string();
        self.bands.iter().find(|band| band.number == number)
    }
}

impl Band {
    fn new(node: Node) -> Self {
        Self {
            number: node.attribute("band").unwrap_or_default().to_owned(),
            nodata: child(node, "NoDataValue"),
            unit: child(node, "UnitType"),
            scale: number(node, "Scale"),
            offset: number(node, "Offset"),
        }
    }
}

/// The text of an element; `None` if it is empty.
fn text(node: Node) -> Option<String> {
    node.text().map(|text| text.trim().to_owned()).filter(|text| !text.is_empty())
}

fn child(node: Node, name: &str) -> Option<String> {
    node.children().find(|child| child.has_tag_name(name)).and_then(text)
}

fn number(node: Node, name: &str) -> Option<f64> {
    child(node, name)?.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crs_and_elements_of_a_band_are_found() {
        let file = Auxiliary::parse(
            "<PAMDataset><SRS dataAxisToSRSAxisMapping=\"1,2\">PROJCS[&quot;x&quot;]</SRS>\
             <PAMRasterBand band=\"1\"><NoDataValue le_hex_equiv=\"00\">-9.999E+03</NoDataValue>\
             <Offset>5</Offset><Scale>0.5</Scale><UnitType>ft</UnitType></PAMRasterBand>\
             <PAMRasterBand band=\"2\"><Description>x</Description><UnitType/></PAMRasterBand></PAMDataset>",
        );
        assert_eq!(file.crs.as_deref(), Some("PROJCS[\"x\"]"));
        assert_eq!(file.nodata(0), Some("-9.999E+03"));
        assert_eq!((file.scale(0), file.offset(0)), (Some(0.5), Some(5.0)));
        assert_eq!((file.unit(0), file.unit(1), file.nodata(2)), (Some("ft"), None, None));
        assert_eq!(Auxiliary::parse("<PAM").nodata(0), None);
    }
}
