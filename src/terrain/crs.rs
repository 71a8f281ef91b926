//! Coordinate reference systems: which one a file is in, and the way to longitude and latitude.

use glam::DVec2;

use crate::{Ground, Result};

/// The coordinate reference system of a terrain.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    // private
}

impl Crs {
    /// No CRS: map coordinates in metres on a plane, place unknown.
    #[must_use]
    pub fn none() -> Self {
        todo!()
    }

    /// The CRS of an EPSG code.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for an unknown code or a unit other than metre, foot and degree.
    pub fn from_epsg(code: u32) -> Result<Self> {
        todo!()
    }

    /// EPSG code, if it has one.
    #[must_use]
    pub fn epsg(&self) -> Option<u32> {
        todo!()
    }

    /// Name for people: `EPSG:32631 WGS 84 / UTM zone 31N`, `none`, or what the file calls it.
    #[must_use]
    pub fn name(&self) -> String {
        todo!()
    }

    /// Name of the map unit: `metre`, `US survey foot`, `degree`.
    #[must_use]
    pub fn unit(&self) -> &str {
        todo!()
    }

    /// How map units measure on the ground.
    #[must_use]
    pub fn ground(&self) -> Ground {
        todo!()
    }

    /// Whether map coordinates are longitude and latitude in degrees.
    #[must_use]
    pub fn is_geographic(&self) -> bool {
        todo!()
    }

    /// WGS84 longitude and latitude in degrees of map coordinates.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, map: DVec2) -> Result<DVec2> {
        todo!()
    }

    /// Map coordinates of WGS84 longitude and latitude in degrees.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        todo!()
    }
}
