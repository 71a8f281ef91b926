//! What to do about an error.

use std::fmt;

/// What to do, in words; and what has to be done to a file, as data, so that a program can name a tool for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Advice {
    /// What to do: an imperative that ends, if there is one, with the remedy.
    pub text: String,
    /// What makes the file usable.
    pub remedy: Option<Remedy>,
}

/// What makes a file usable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// Convert it to GeoTIFF.
    Convert,
    /// Write it as GeoTIFF with the program that made it: no converter reads it.
    Export,
    /// Convert its samples to 32-bit floating point.
    ConvertSamples,
    /// Compress it in a way that is read: by Deflate, without a predictor.
    Recompress,
    /// Take one of its bands.
    TakeBand,
    /// Resample it to a grid whose axes run east and north.
    TurnNorthUp,
    /// The same by its ground control points.
    Rectify,
    /// Reproject it to a CRS that is known.
    Reproject,
    /// Reproject it to longitude and latitude.
    ReprojectToLonLat,
    /// Say which CRS its coordinates are in.
    SetCrs,
    /// Replace a description of its CRS by WKT 1.
    ReplaceWkt,
    /// Scale its heights to metres.
    ScaleToMetres,
    /// Resample it to the grid of the DEM.
    ResampleToDem,
    /// Reproject it to the CRS of the DEM and resample it to its grid.
    ReprojectToDem,
    /// Convert geometry to GeoJSON in longitude and latitude.
    ConvertToGeoJson,
    /// Unpack it.
    Unpack,
    /// Fetch what a Git LFS pointer points to.
    FetchFromLfs,
}

impl Remedy {
    /// An advice that ends with this remedy.
    #[must_use]
    pub fn after(self, text: &str) -> Advice {
        Advice { text: format!("{text}{self}"), remedy: Some(self) }
    }
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Convert => "convert it to GeoTIFF",
            Self::Export => "write it as a GeoTIFF",
            Self::ConvertSamples => "convert its samples to 32-bit floating point",
            Self::Recompress => "compress it by Deflate without a predictor",
            Self::TakeBand => "take the band that holds heights",
            Self::TurnNorthUp => "resample it to a north-up grid",
            Self::Rectify => "resample it to a north-up grid by these points",
            Self::Reproject => "reproject it to a CRS that is known, such as the UTM zone",
            Self::ReprojectToLonLat => "reproject it to longitude and latitude",
            Self::SetCrs => "set its CRS",
            Self::ReplaceWkt => "replace it by the WKT 1 of its EPSG code",
            Self::ScaleToMetres => "scale the heights to metres",
            Self::ResampleToDem => "resample it to the grid of the DEM",
            Self::ReprojectToDem => "reproject it to the CRS and the grid of the DEM",
            Self::ConvertToGeoJson => "convert it to GeoJSON in longitude and latitude, EPSG:4326",
            Self::Unpack => "unpack it first",
            Self::FetchFromLfs => "fetch what it points to",
        })
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl From<Remedy> for Advice {
    fn from(remedy: Remedy) -> Self {
        remedy.after("")
    }
}

impl From<String> for Advice {
    fn from(text: String) -> Self {
        Self { text, remedy: None }
    }
}

impl From<&str> for Advice {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}
