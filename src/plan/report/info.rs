//! What a DEM holds.

use std::path::Path;

use serde::Serialize;

use crate::plan::surface::describe_planned_fit;
use crate::surface::FitOptions;
use crate::terrain::Terrain;

/// What a DEM holds, and what surface would be fitted to it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InfoReport {
    /// The file.
    pub file: String,
    /// Its format.
    pub format: String,
    /// Sample type as stored.
    pub sample: String,
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// Width and height of a cell in map units.
    pub cell_size: [f64; 2],
    /// Width and height of a cell in metres, in the middle of the grid.
    pub cell_size_m: [f64; 2],
    /// The coordinate reference system.
    pub crs: CrsRecord,
    /// Unit of the map.
    pub unit: String,
    /// West, south, east and north border of the outermost cells, in map units.
    pub extent: [f64; 4],
    /// Unit of the stored heights.
    pub height_unit: String,
    /// Metres in one of these.
    pub metres_per_height_unit: f64,
    /// The nodata value of the file, as written.
    pub nodata: Option<String>,
    /// Whether the rows of the file ran from south to north.
    pub south_up: bool,
    /// Number of voids.
    pub void_count: usize,
    /// The lowest height in metres, `None` if all are void.
    pub min_height_m: Option<f64>,
    /// The highest.
    pub max_height_m: Option<f64>,
    /// Their mean.
    pub mean_height_m: Option<f64>,
    /// The surface that would be fitted, in words.
    pub surface: String,
    /// What the reader noticed.
    pub notes: Vec<String>,
}

/// A coordinate reference system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrsRecord {
    /// Its name.
    pub name: String,
    /// Its EPSG code, if it has one.
    pub epsg: Option<u32>,
}

impl InfoReport {
    /// What a terrain read from `file` holds.
    #[must_use]
    pub fn new(file: &Path, terrain: &Terrain, fit: &FitOptions) -> Self {
        let (frame, crs, source) = (terrain.frame(), terrain.crs(), terrain.source());
        let (void_count, heights) = terrain.statistics();
        Self {
            file: file.display().to_string(),
            format: source.format.clone(),
            sample: source.sample.clone(),
            columns: frame.cols(),
            rows: frame.rows(),
            cell_size: frame.step().to_array(),
            cell_size_m: frame.mid_spacing().to_array(),
            crs: CrsRecord { name: crs.name().to_owned(), epsg: crs.epsg() },
            unit: crs.unit().to_owned(),
            extent: frame.extent(),
            height_unit: source.height_unit.clone(),
            metres_per_height_unit: source.metres_per_height_unit,
            nodata: source.nodata.clone(),
            south_up: source.south_up,
            void_count,
            min_height_m: heights.map(|[low, ..]| low),
            max_height_m: heights.map(|[_, high, _]| high),
            mean_height_m: heights.map(|[.., mean]| mean),
            surface: describe_planned_fit(fit, frame),
            notes: terrain.notes().to_vec(),
        }
    }
}
