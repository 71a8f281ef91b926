//! A raster as the reader of a format returns it.

use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;

use super::Crs;
use crate::error::{Error, Remedy, Result};
use crate::grid::GridFrame;

/// Makes infinite cells voids too.
pub(super) fn void_infinite(values: &mut [f64]) {
    values.par_iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
}

/// What a file says of itself: its format, and how it stores heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Name of the format, such as `GeoTIFF` or `ESRI ASCII grid`.
    pub format: String,
    /// Sample type as stored, such as `int16`.
    pub sample: String,
    /// Unit of the stored heights, such as `metre` or `US survey foot`.
    pub height_unit: String,
    /// Metres in one such unit.
    pub metres_per_height_unit: f64,
    /// The nodata value of the file, as written.
    pub nodata: Option<String>,
    /// Whether the rows of the file ran from south to north and were turned.
    pub south_up: bool,
}

impl Default for Source {
    /// Heights in metres that come from no file.
    fn default() -> Self {
        Self {
            format: "memory".to_owned(),
            sample: "float64".to_owned(),
            height_unit: "metre".to_owned(),
            metres_per_height_unit: 1.0,
            nodata: None,
            south_up: false,
        }
    }
}

/// A raster as the reader of a format returns it: values as stored (scaled, not yet in metres), rows in the file's order.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) cols: usize,
    pub(super) rows: usize,
    /// Map coordinates of the centre of the first stored cell.
    pub(super) origin: DVec2,
    /// Map units per column and per stored row; `y` is negative if the rows run southwards.
    pub(super) step: DVec2,
    pub(super) crs: Crs,
    pub(super) bands: Vec<Vec<f64>>,
    pub(super) source: Source,
    pub(super) notes: Vec<String>,
}

impl Raster {
    /// Turns the rows so that the first is the northernmost, and gives the frame.
    pub(super) fn turn_north_up(&mut self, path: &Path) -> Result<GridFrame> {
        if self.step.x < 0.0 {
            return Err(Error::unsupported(
                path,
                "the columns run from east to west",
                Remedy::TurnNorthUp,
            ));
        }
        if self.step.y > 0.0 {
            self.origin.y += self.step.y * (self.rows - 1) as f64;
            for band in &mut self.bands {
                reverse_rows(band, self.cols);
            }
            self.source.south_up = true;
            self.notes
                .push("the rows of the file run from south to north; they were turned".to_owned());
        }
        self.step.y = self.step.y.abs();
        if self.crs.is_none() {
            self.guess_crs();
        }
        self.drop_repeated_columns();
        GridFrame::new(self.cols, self.rows, self.origin, self.step, self.crs.ground())
            .map_err(|e| e.in_file(path))
    }

    /// Drops columns beyond a full turn: grids of nodes around the Earth have the first meridian twice.
    fn drop_repeated_columns(&mut self) {
        let around = GridFrame::columns_around(self.step.x, self.crs.ground());
        let Some(kept) = around.filter(|kept| *kept < self.cols) else { return };
        for band in &mut self.bands {
            *band = band.chunks_exact(self.cols).flat_map(|row| &row[..kept]).copied().collect();
        }
        let dropped = self.cols - kept;
        self.cols = kept;
        self.notes.push(format!(
            "the columns of the file go more than once around; the last {dropped}, which repeat the first, were dropped"
        ));
    }

    /// Without a CRS, coordinates that look like degrees are taken for degrees: taken for metres, every
    /// slope would be almost vertical.
    fn guess_crs(&mut self) {
        let note = match Crs::from_epsg(4326) {
            Ok(wgs84) if self.looks_like_degrees() => {
                self.crs = wgs84;
                "the file names no CRS; its coordinates look like degrees and are taken as WGS84 \
                 longitude and latitude"
            }
            _ => {
                "the file names no CRS; map units are taken as metres, and there is no way to longitude and latitude"
            }
        };
        self.notes.push(note.to_owned());
    }

    /// Whether the coordinates could be degrees and the cells are small; `step` is positive.
    fn looks_like_degrees(&self) -> bool {
        /// Degrees; two kilometres.
        const LARGEST_CELL: f64 = 0.02;
        let half = self.step * DVec2::new(self.cols as f64, -(self.rows as f64)) / 2.0;
        let middle = self.origin + half;
        let within = (middle.abs() + half.abs()).cmple(DVec2::new(360.0, 90.0)).all();
        // Scans of models have small cells too, but begin or are centred at the origin.
        let near_zero =
            |p: DVec2| p.cmple(1.5 * self.step).all() && p.cmpge(-1.5 * self.step).all();
        let local = near_zero(middle) || near_zero(middle - half.abs());
        within && !local && self.step.max_element() < LARGEST_CELL
    }
}

/// Reverses the order of rows.
fn reverse_rows(values: &mut [f64], cols: usize) {
    let rows = values.len() / cols;
    let (upper, lower) = values.split_at_mut(rows.div_ceil(2) * cols);
    for (a, b) in upper.chunks_exact_mut(cols).zip(lower.chunks_exact_mut(cols).rev()) {
        a.swap_with_slice(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_meridian_that_is_there_twice_is_dropped() {
        let mut raster = Raster {
            cols: 5,
            rows: 2,
            origin: DVec2::new(-180.0, 1.0),
            step: DVec2::new(90.0, -1.0),
            crs: Crs::from_epsg(4326).unwrap(),
            bands: vec![vec![1.0, 2.0, 3.0, 4.0, 1.0, 5.0, 6.0, 7.0, 8.0, 5.0]],
            source: Source::default(),
            notes: Vec::new(),
        };
        let frame = raster.turn_north_up(Path::new("globe.tif")).unwrap();
        assert!(frame.is_periodic() && frame.cols() == 4);
        assert_eq!(raster.bands[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert!(raster.notes[0].contains("dropped"));
    }

    #[test]
    fn rows_reverse() {
        let mut values = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        reverse_rows(&mut values, 2);
        assert_eq!(values, [5.0, 6.0, 3.0, 4.0, 1.0, 2.0]);
        reverse_rows(&mut values, 3);
        assert_eq!(values, [4.0, 1.0, 2.0, 5.0, 6.0, 3.0]);
    }
}
