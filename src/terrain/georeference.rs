//! Where the nodes of a raster lie: on the map, and on the Earth.

use glam::DVec2;

use super::Crs;
use crate::error::Result;
use crate::grid::GridFrame;

/// A grid on a map, and the coordinate reference system of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Georeference {
    frame: GridFrame,
    crs: Crs,
}

impl Georeference {
    /// The grid `frame` on a map of `crs`.
    #[must_use]
    pub fn new(frame: GridFrame, crs: Crs) -> Self {
        Self { frame, crs }
    }

    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// The coordinate reference system.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Longitude (−180 to 180) and latitude in degrees of grid coordinates; see [`Crs::to_lonlat`].
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, at: DVec2) -> Result<DVec2> {
        self.crs.to_lonlat(self.frame.to_map(at))
    }

    /// Grid coordinates of a longitude and latitude in degrees, inside the grid or not; see [`Crs::from_lonlat`].
    ///
    /// On a grid of longitudes, the longitude is shifted by multiples of 360° to be nearest to its middle, so that 179.9° E and
    /// 179.9° W are neighbours on a grid across the date line.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        let mut map = self.crs.from_lonlat(lonlat)?;
        if self.crs.is_geographic() {
            let middle = self.frame.to_map(DVec2::new((self.frame.cols() - 1) as f64 / 2.0, 0.0)).x;
            map.x += ((middle - map.x) / 360.0).round() * 360.0;
        }
        Ok(self.frame.to_grid(map))
    }

    /// Metres on the ground in a metre of the map, the least and the most over nine places of the grid; `None` where that is
    /// not known, and on maps whose [`Ground`](crate::grid::Ground) corrects lengths.
    pub(super) fn ground_per_map_metre(&self) -> Option<[f64; 2]> {
        let last = DVec2::new((self.frame.cols() - 1) as f64, (self.frame.rows() - 1) as f64);
        let places = (0..9).map(|i| last * DVec2::new((i % 3) as f64, (i / 3) as f64) / 2.0);
        places
            .filter_map(|at| self.crs.ground_per_map_metre(self.frame.to_map(at)))
            .map(|size| [size.min_element(), size.max_element()])
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_date_line_is_no_edge() {
        let crs = Crs::from_epsg(4326).unwrap();
        let frame =
            GridFrame::new(11, 3, DVec2::new(179.5, -16.0), DVec2::splat(0.1), crs.ground())
                .unwrap();
        let place = Georeference::new(frame, crs);
        for at in [DVec2::new(1.0, 1.0), DVec2::new(9.0, 1.0)] {
            let lonlat = place.to_lonlat(at).unwrap();
            assert!(lonlat.x.abs() <= 180.0);
            assert!((place.from_lonlat(lonlat).unwrap() - at).length() < 1e-9);
        }
        assert!(place.to_lonlat(DVec2::new(9.0, 1.0)).unwrap().x < 0.0);
    }
}
