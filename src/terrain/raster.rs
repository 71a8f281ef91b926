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
    /// Whether the file says the unit of the heights.
    pub(super) says_height_unit: bool,
    pub(super) notes: Vec<String>,
}

/// A note if the lowest or the highest stored value stands so far off all others that it must mark voids.
pub(super) fn note_of_fill(values: &[f64]) -> Option<String> {
    /// Heights are beyond one of these before a look at the others is worth the time, and so far off the next.
    const SUSPICIOUS: [f64; 2] = [-990.0, 9000.0];
    const FAR: f64 = 500.0;
    /// Nothing on the Earth or the Moon lies deeper than 11 km below the datum.
    const DEEPEST: f64 = -12_000.0;
    let [low, high] = extremes(values, [f64::INFINITY, f64::NEG_INFINITY]);
    if low > SUSPICIOUS[0] && high < SUSPICIOUS[1] {
        return None;
    }
    // Of the rest: the lowest and the highest that are neither.
    let [next_low, next_high] = extremes(values, [low, high]);
    let range = next_high - next_low;
    let stands_off = |gap: f64| gap > range.max(FAR);
    let fill = if low < DEEPEST
        || low == -9999.0
        || (low <= SUSPICIOUS[0] && stands_off(next_low - low))
    {
        low
    } else if high >= SUSPICIOUS[1] && stands_off(high - next_high) {
        high
    } else {
        return None;
    };
    let written = if fill.abs() < 1e7 { fill.to_string() } else { format!("{fill:e}") };
    Some(format!(
        "some cells hold {written}, which looks like a void that is not declared; \
         declare it as the nodata value of the file"
    ))
}

/// Lowest and highest of the values that are neither `NaN` nor one of two.
fn extremes(values: &[f64], [low, high]: [f64; 2]) -> [f64; 2] {
    const PART: usize = 1 << 14;
    let of_part = |part: &[f64]| {
        let counted = part.iter().filter(|&&v| v != low && v != high);
        counted.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| {
            [if v < a { v } else { a }, if v > b { v } else { b }]
        })
    };
    values
        .par_chunks(PART)
        .map(of_part)
        .reduce(|| [f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Unit that heights are stored in, where a file does not say it or is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightUnit {
    /// Metre.
    Metre,
    /// International foot, 0.3048 m.
    Foot,
    /// US survey foot, 1200/3937 m.
    UsSurveyFoot,
}

impl HeightUnit {
    /// Its name, and how many metres it is.
    pub(super) fn describe(self) -> (&'static str, f64) {
        match self {
            Self::Metre => ("metre", 1.0),
            Self::Foot => ("foot", 0.3048),
            Self::UsSurveyFoot => ("US survey foot", 1200.0 / 3937.0),
        }
    }
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
            says_height_unit: false,
            notes: Vec::new(),
        };
        let frame = raster.turn_north_up(Path::new("globe.tif")).unwrap();
        assert!(frame.is_periodic() && frame.cols() == 4);
        assert_eq!(raster.bands[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert!(raster.notes[0].contains("dropped"));
    }

    #[test]
    fn fills_that_are_not_declared_are_noted() {
        let ground: Vec<f64> = (0..500).map(f64::from).collect();
        let with = |fill: f64| note_of_fill(&[&ground[..], &[fill, fill]].concat());
        for fill in [32767.0, -32767.0, 65535.0, -9999.0, -999.0, 99999.0] {
            assert!(with(fill).is_some_and(|note| note.contains(&fill.to_string())), "{fill}");
        }
        assert!(with(-3.4e38).is_some_and(|note| note.contains("hold -3.4e38,")));
        // The Dead Sea, Everest, a rover's Moon in half metres, the sea's floor.
        let slope =
            |low: i32, high: i32| note_of_fill(&(low..high).map(f64::from).collect::<Vec<_>>());
        assert_eq!((with(-430.0), with(f64::NAN), slope(-430, 8849)), (None, None, None));
        assert_eq!((slope(-18_000, 21_000).is_some(), slope(-11_000, 21_572)), (true, None));
        assert_eq!(note_of_fill(&[]), None);
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
