//! Heights in metres at the nodes of a grid.

use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;

use super::formats::{self, ReadMode};
use super::raster::{HeightUnit, Source, void_infinite};
use super::{Crs, Georeference};
use crate::error::{Error, Result};
use crate::grid::{GridFrame, Ground};
use crate::linalg::bilinear::{CORNERS, corner_weights};

/// Heights at the nodes of a grid, in metres; `NaN` marks a void.
///
/// Row 0 is the northernmost, whatever the file's order was.
#[derive(Clone, Debug)]
pub struct Terrain {
    georeference: Georeference,
    heights: Vec<f64>,
    notes: Vec<String>,
    source: Source,
}

impl Terrain {
    /// Heights in metres, row by row from the north; `NaN` or infinite cells become voids.
    ///
    /// # Errors
    /// [`Error::Argument`] if the number of heights is not that of the frame's nodes.
    pub fn new(frame: GridFrame, mut heights: Vec<f64>, crs: Crs) -> Result<Self> {
        if heights.len() != frame.nodes() {
            let expected = format!(
                "{}, that of the nodes of a grid of {} × {}",
                frame.nodes(),
                frame.cols(),
                frame.rows()
            );
            return Err(Error::argument("the number of heights", heights.len(), expected));
        }
        void_infinite(&mut heights);
        Ok(Self {
            georeference: Georeference::new(frame, crs),
            heights,
            notes: Vec::new(),
            source: Source::default(),
        })
    }

    /// Reads a DEM. The format is recognised by content first, by extension second.
    ///
    /// # Errors
    /// [`Error::Format`], [`Error::Unsupported`], [`Error::TooLarge`] or [`Error::Io`]: a file that is damaged, of a kind that
    /// is not read, or does not say how big its cells are on the ground; each says what to do.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_in(path, None)
    }

    /// The same where the unit of the stored heights is known better than the file says it.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_in(path: impl AsRef<Path>, unit: Option<HeightUnit>) -> Result<Self> {
        let path = path.as_ref();
        let mut raster = formats::read(path, ReadMode::Heights)?;
        let frame = raster.turn_north_up(path)?;
        if let Some((name, metres)) = unit.map(HeightUnit::describe) {
            raster.source.height_unit = name.to_owned();
            raster.source.metres_per_height_unit = metres;
        } else if !raster.says_height_unit && raster.crs.unit().contains("foot") {
            raster.notes.push(format!(
                "the map unit is the {}, but the file does not say the unit of the heights; \
                 they are taken as metres",
                raster.crs.unit()
            ));
        }
        let mut heights = raster.bands.swap_remove(0);
        let metres = raster.source.metres_per_height_unit;
        if metres != 1.0 {
            heights.par_iter_mut().for_each(|h| *h *= metres);
        }
        let mut terrain = Self::new(frame, heights, raster.crs)?;
        terrain.notes = raster.notes;
        terrain.source = raster.source;
        terrain.notes.extend(terrain.note_of_heights());
        terrain.notes.extend(terrain.crs().caveat().map(str::to_owned));
        terrain.notes.extend(terrain.note_of_unknown_projection());
        terrain.notes.extend(terrain.note_of_distortion());
        terrain.notes.extend(note_of_pole(terrain.frame()));
        Ok(terrain)
    }

    /// Where the nodes lie on the map and on the Earth. A clone of it outlives the heights.
    #[must_use]
    pub fn georeference(&self) -> &Georeference {
        &self.georeference
    }

    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        self.georeference.frame()
    }

    /// Heights in metres, row-major from the north-west; `NaN` where void.
    #[must_use]
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// The coordinate reference system.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        self.georeference.crs()
    }

    /// Things the reader noticed that a user should know, a sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the file says of itself.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Whether the node is a void.
    ///
    /// # Panics
    /// If it is not on the grid.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        self.heights[self.frame().index(col, row)].is_nan()
    }

    /// Height of the DEM in metres at grid coordinates, clamped to the hull of the nodes: bilinear between the nodes, `NaN` where one of
    /// them is void.
    #[must_use]
    pub fn height(&self, at: DVec2) -> f64 {
        let frame = self.frame();
        let (at, cols, last_row) = (frame.clamp(at), frame.cols(), frame.rows() - 1);
        let corner = at.floor();
        let height = |i: isize, j: isize| {
            // Beyond the last column comes the first again, or has no weight.
            let col = (corner.x as isize + i).rem_euclid(cols as isize) as usize;
            self.heights[frame.index(col, (corner.y as usize + j as usize).min(last_row))]
        };
        let corners = CORNERS.into_iter().zip(corner_weights(at - corner));
        corners
            .filter(|&(_, weight)| weight > 0.0)
            .map(|((i, j), weight)| weight * height(i, j))
            .sum()
    }

    /// Number of voids, and smallest, largest and mean height in metres (`None` if all are void).
    #[must_use]
    pub fn statistics(&self) -> (usize, Option<[f64; 3]>) {
        let rows: Vec<_> =
            self.heights.par_chunks(self.frame().cols()).map(Statistics::of_row).collect();
        // Added row by row, so that the sum does not depend on the number of threads.
        let all = rows.into_iter().fold(Statistics::NONE, Statistics::and);
        let voids = self.heights.len() - all.count;
        (voids, (all.count > 0).then(|| [all.min, all.max, all.sum / all.count as f64]))
    }

    /// See [`Georeference::to_lonlat`].
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, at: DVec2) -> Result<DVec2> {
        self.georeference.to_lonlat(at)
    }

    /// See [`Georeference::from_lonlat`].
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        self.georeference.from_lonlat(lonlat)
    }

    /// A note if no terrain has such heights.
    fn note_of_heights(&self) -> Option<String> {
        /// No body of the solar system has ground this many metres from its datum.
        const HIGHEST: f64 = 1e5;
        match self.statistics().1 {
            None => Some("every cell is void: there is no terrain to work on".to_owned()),
            Some([lowest, highest, _]) if highest.max(-lowest) > HIGHEST => Some(format!(
                "heights run from {lowest:e} to {highest:e} m, which no terrain does; is a nodata value not declared?"
            )),
            Some(_) => None,
        }
    }

    /// A note if a CRS has a name but no way to longitude and latitude.
    fn note_of_unknown_projection(&self) -> Option<String> {
        let crs = self.crs();
        (!crs.is_none() && !crs.has_lonlat()).then(|| {
            format!(
                "of the CRS {} no more is known than its name and its unit, the {}: distances are those of the map, which \
                 may be far from those on the ground, there is no way to longitude and latitude, and GeoJSON is written in \
                 map coordinates; set a CRS that is known, or reproject the DEM to one",
                crs.name(),
                crs.unit()
            )
        })
    }

    /// A note if lengths on the map, in which distances are measured, are not those on the ground.
    fn note_of_distortion(&self) -> Option<String> {
        const NOTABLE: f64 = 0.004;
        let [least, most] = self.georeference.ground_per_map_metre()?;
        (least < 1.0 - NOTABLE || most > 1.0 + NOTABLE).then(|| {
            format!(
                "a metre of this map is {least:.3} to {most:.3} m on the ground, and distances are those of the map; \
                 reproject the DEM to longitude and latitude, or on the Earth to the UTM zone, for those of the ground"
            )
        })
    }
}

/// A note if a grid in degrees comes so near to a pole that the length of a cell changes by much from row to row.
fn note_of_pole(frame: &GridFrame) -> Option<String> {
    /// Rows; measured on level ground at 1° and ¼°, against geodesics.
    const NEAR: f64 = 20.0;
    let last = frame.to_map(DVec2::new(0.0, (frame.rows() - 1) as f64)).y;
    let highest = frame.origin().y.abs().max(last.abs());
    // From row to row the length of a cell changes by tan(latitude) × step: near a pole, one over the number of rows to it.
    let change = highest.to_radians().tan() * frame.step().y.to_radians();
    let is_near = matches!(frame.ground(), Ground::Ellipsoid { .. })
        && (highest >= 90.0 || change > 1.0 / NEAR);
    is_near.then(|| {
        format!(
            "within {NEAR} rows of a pole distances may be 10 % off, within 4 rows more; \
             reproject the DEM to a polar stereographic map for those"
        )
    })
}

/// Sums over heights; voids do not count.
struct Statistics {
    count: usize,
    min: f64,
    max: f64,
    sum: f64,
}

impl Statistics {
    const NONE: Self = Self { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0 };

    fn of_row(row: &[f64]) -> Self {
        row.iter().filter(|h| !h.is_nan()).fold(Self::NONE, |all, &h| Self {
            count: all.count + 1,
            min: if h < all.min { h } else { all.min },
            max: if h > all.max { h } else { all.max },
            sum: all.sum + h,
        })
    }

    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            sum: self.sum + other.sum,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(cols: usize, rows: usize) -> GridFrame {
        GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap()
    }

    #[test]
    fn infinite_and_nan_heights_are_voids() {
        let heights = vec![1.0, f64::NAN, f64::INFINITY, 5.0];
        let terrain = Terrain::new(frame(2, 2), heights, Crs::none()).unwrap();
        assert!(terrain.is_void(1, 0) && terrain.is_void(0, 1) && !terrain.is_void(1, 1));
        assert_eq!(terrain.statistics(), (2, Some([1.0, 5.0, 3.0])));
        let void = Terrain::new(frame(1, 1), vec![f64::NAN], Crs::none()).unwrap();
        assert_eq!(void.statistics(), (1, None));
        let error = Terrain::new(frame(2, 2), vec![0.0; 3], Crs::none()).unwrap_err();
        assert!(error.to_string().starts_with("the number of heights is 3; it must be 4"));
    }

    #[test]
    fn heights_are_bilinear_between_nodes_and_void_beside_voids() {
        let heights = vec![0.0, 10.0, f64::NAN, 20.0, 30.0, 40.0];
        let terrain = Terrain::new(frame(3, 2), heights, Crs::none()).unwrap();
        let height = |x, y| terrain.height(DVec2::new(x, y));
        assert_eq!([height(0.5, 0.5), height(1.0, 0.0), height(2.0, 1.0)], [15.0, 10.0, 40.0]);
        assert_eq!([height(-3.0, 9.0), height(1.25, 1.0)], [20.0, 32.5]);
        assert!(height(1.5, 0.5).is_nan() && height(2.0, 0.0).is_nan());
    }

    #[test]
    fn grids_near_a_pole_get_a_note() {
        let note = |north: f64, step: f64| {
            let origin = DVec2::new(10.0, north);
            let frame = GridFrame::new(9, 11, origin, DVec2::splat(step), Ground::WGS84).unwrap();
            note_of_pole(&frame).is_some()
        };
        assert!(note(90.0, 1.0) && note(-79.5, 1.0) && note(85.0, 0.5));
        assert!(!note(69.0, 1.0) && !note(85.0, 0.1));
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Terrain::open("no/such/dem.tif").unwrap_err();
        assert!(matches!(error, Error::Io { .. }));
        assert!(error.to_string().contains("no/such/dem.tif"));
    }
}
