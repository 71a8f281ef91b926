//! A file becomes heights in metres on a frame.
//!
//! [`Terrain::open`] tells the format by content first, by extension second, reads it, and brings everything to
//! one form at the door: heights in metres, `NaN` for voids, row 0 in the north.

mod crs;
mod formats;

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;

pub use self::crs::Crs;
pub(crate) use self::crs::GeoKeys;
use self::formats::{ascii_grid, geotiff, hgt};
use crate::error::{Error, Result};
use crate::grid::GridFrame;

/// Heights at the nodes of a grid, in metres; `NaN` marks a void.
///
/// Row 0 is the northernmost, whatever the file's order was.
#[derive(Clone, Debug)]
pub struct Terrain {
    frame: GridFrame,
    heights: Vec<f64>,
    crs: Crs,
    notes: Vec<String>,
    source: Source,
}

/// What the file said of itself, for `info`.
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

/// No body of the solar system has ground this many metres from its datum.
const HIGHEST: f64 = 1e5;

impl Terrain {
    /// Heights in metres, row by row from the north; `NaN` or infinite cells become voids.
    ///
    /// # Errors
    /// [`Error::Usage`] if the number of heights is not that of the frame's nodes.
    pub fn new(frame: GridFrame, mut heights: Vec<f64>, crs: Crs) -> Result<Self> {
        if heights.len() != frame.nodes() {
            return Err(Error::usage(format!(
                "{} heights do not fill a grid of {} × {} nodes",
                heights.len(),
                frame.cols(),
                frame.rows()
            )));
        }
        void_infinite(&mut heights);
        Ok(Self { frame, heights, crs, notes: Vec::new(), source: Source::default() })
    }

    /// Reads a DEM. The format is told by content first, by extension second.
    ///
    /// # Errors
    /// A file that is damaged, of an unsupported kind, or does not say how big its cells are on the
    /// ground; each says what to do.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut raster = read(path, Want::Heights)?;
        let frame = raster.settle(path)?;
        let mut heights = raster.bands.swap_remove(0);
        let metres = raster.source.metres_per_height_unit;
        if metres != 1.0 {
            heights.par_iter_mut().for_each(|h| *h *= metres);
        }
        let mut terrain = Self::new(frame, heights, raster.crs)?;
        match terrain.statistics().1 {
            None => raster.notes.push("every cell is void: there is no terrain to work on".to_owned()),
            Some([lowest, highest, _]) if highest.max(-lowest) > HIGHEST => raster.notes.push(format!(
                "heights run from {lowest:e} to {highest:e} m, which no terrain does; is a nodata value not declared?"
            )),
            Some(_) => {}
        }
        raster.notes.extend(terrain.crs.caveat().map(str::to_owned));
        raster.notes.extend(terrain.distortion());
        terrain.notes = raster.notes;
        terrain.source = raster.source;
        Ok(terrain)
    }

    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Heights in metres, row-major from the north-west; `NaN` where void.
    #[must_use]
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// Gives the memory of the heights back, once only the place of the terrain matters: [`heights`](Self::heights) is
    /// empty from then on, and no node counts as a void.
    pub fn free_heights(&mut self) {
        self.heights = Vec::new();
    }

    /// The coordinate reference system.
    #[must_use]
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Things the reader noticed that a user should know, a sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the file said of itself.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Whether the node is a void.
    #[must_use]
    pub fn is_void(&self, col: usize, row: usize) -> bool {
        self.heights.get(self.frame.index(col, row)).is_some_and(|height| height.is_nan())
    }

    /// Number of voids, and smallest, largest and mean height in metres (`None` if all are void).
    #[must_use]
    pub fn statistics(&self) -> (usize, Option<[f64; 3]>) {
        const NONE: (usize, f64, f64, f64) = (0, f64::INFINITY, f64::NEG_INFINITY, 0.0);
        let of_row = |row: &[f64]| {
            row.iter().filter(|h| !h.is_nan()).fold(NONE, |(count, min, max, sum), &h| {
                (count + 1, if h < min { h } else { min }, if h > max { h } else { max }, sum + h)
            })
        };
        let rows: Vec<_> = self.heights.par_chunks(self.frame.cols()).map(of_row).collect();
        // Added row by row, so that the sum does not depend on the number of threads.
        let (count, min, max, sum) =
            rows.into_iter().fold(NONE, |a, b| (a.0 + b.0, a.1.min(b.1), a.2.max(b.2), a.3 + b.3));
        (self.heights.len() - count, (count > 0).then(|| [min, max, sum / count as f64]))
    }

    /// Says so if lengths on the map, which distances are measured in, are not those on the ground.
    fn distortion(&self) -> Option<String> {
        const NOTABLE: f64 = 0.01;
        let last = DVec2::new((self.frame.cols() - 1) as f64, (self.frame.rows() - 1) as f64);
        let places = (0..9).map(|i| last * DVec2::new((i % 3) as f64, (i / 3) as f64) / 2.0);
        let (least, most) = places
            .filter_map(|at| self.crs.ground_per_map_metre(self.frame.to_map(at)))
            .fold((f64::INFINITY, 0f64), |(least, most), size| {
                (least.min(size.min_element()), most.max(size.max_element()))
            });
        (least < 1.0 - NOTABLE || most > 1.0 + NOTABLE).then(|| {
            format!(
                "a metre of this map is {least:.2} to {most:.2} m on the ground, and distances are those of the map; \
                 reproject with `gdalwarp -t_srs` to longitude and latitude or to the UTM zone for those of the ground"
            )
        })
    }

    /// Longitude (−180 to 180) and latitude in degrees of grid coordinates; see [`Crs::to_lonlat`].
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no CRS or the point cannot be projected.
    pub fn to_lonlat(&self, at: DVec2) -> Result<DVec2> {
        self.crs.to_lonlat(self.frame.to_map(at))
    }

    /// Grid coordinates of a longitude and latitude in degrees, inside the grid or not; see [`Crs::from_lonlat`].
    ///
    /// Where the grid is one of longitudes, the turn nearest to its middle is taken, so that 179.9° E and
    /// 179.9° W are neighbours on a grid across the date line.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no CRS or the point cannot be projected.
    pub fn from_lonlat(&self, lonlat: DVec2) -> Result<DVec2> {
        let mut map = self.crs.from_lonlat(lonlat)?;
        if self.crs.is_geographic() {
            let middle = self.frame.to_map(DVec2::new((self.frame.cols() - 1) as f64 / 2.0, 0.0)).x;
            map.x += ((middle - map.x) / 360.0).round() * 360.0;
        }
        Ok(self.frame.to_grid(map))
    }
}

/// The bands of a raster that does not hold heights.
#[derive(Clone, Debug)]
pub struct RasterBands {
    /// The grid.
    pub frame: GridFrame,
    /// The coordinate reference system.
    pub crs: Crs,
    /// The values of each band, row-major from the north-west; `NaN` where there is no value.
    pub bands: Vec<Vec<f64>>,
}

/// Reads all bands of a raster, such as a tensor field, in the formats that [`Terrain::open`] reads.
///
/// # Errors
/// As [`Terrain::open`].
pub fn read_bands(path: impl AsRef<Path>) -> Result<RasterBands> {
    let path = path.as_ref();
    let mut raster = read(path, Want::Bands)?;
    let frame = raster.settle(path)?;
    raster.bands.iter_mut().for_each(|band| void_infinite(band));
    Ok(RasterBands { frame, crs: raster.crs, bands: raster.bands })
}

/// Infinite cells carry no height either.
fn void_infinite(values: &mut [f64]) {
    values.par_iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = f64::NAN);
}

/// What a reader is asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Want {
    /// The first band, which must be heights.
    Heights,
    /// All bands, whatever they are.
    Bands,
}

/// What a reader hands over: values as stored (scaled, not yet in metres), rows in the file's order.
#[derive(Debug)]
struct Raster {
    cols: usize,
    rows: usize,
    /// Map coordinates of the centre of the first stored cell.
    origin: DVec2,
    /// Map units per column and per stored row; `y` is negative if the rows run southwards.
    step: DVec2,
    crs: Crs,
    bands: Vec<Vec<f64>>,
    source: Source,
    notes: Vec<String>,
}

impl Raster {
    /// Turns the rows north-up and gives the frame.
    fn settle(&mut self, path: &Path) -> Result<GridFrame> {
        if self.step.x < 0.0 {
            return Err(Error::unsupported(
                path,
                "the columns run from east to west; turn the raster with `gdalwarp IN OUT.tif`",
            ));
        }
        if self.step.y > 0.0 {
            self.origin.y += self.step.y * (self.rows - 1) as f64;
            for band in &mut self.bands {
                turn_rows(band, self.cols);
            }
            self.source.south_up = true;
            self.notes
                .push("the rows of the file run from south to north; they were turned".to_owned());
        }
        self.step.y = self.step.y.abs();
        if self.crs.is_none() {
            self.guess_crs();
        }
        GridFrame::new(self.cols, self.rows, self.origin, self.step, self.crs.ground())
            .map_err(|e| Error::format(path, e.to_string()))
    }

    /// Without a CRS, coordinates that look like degrees are taken for degrees: as metres they would make
    /// every slope a wall.
    fn guess_crs(&mut self) {
        /// Degrees; two kilometres.
        const LARGEST_CELL: f64 = 0.02;
        let half = self.step * DVec2::new(self.cols as f64, -(self.rows as f64)) / 2.0;
        let middle = self.origin + half;
        let within = (middle.abs() + half.abs()).cmple(DVec2::new(360.0, 90.0)).all();
        // Scans of models have small cells too, but begin or are centred at the origin.
        let near_zero =
            |p: DVec2| p.cmple(1.5 * self.step).all() && p.cmpge(-1.5 * self.step).all();
        let local = near_zero(middle) || near_zero(middle - half.abs());
        let degrees = within && !local && self.step.max_element() < LARGEST_CELL;
        let note = match Crs::from_epsg(4326) {
            Ok(wgs84) if degrees => {
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
}

/// Reverses the order of rows.
fn turn_rows(values: &mut [f64], cols: usize) {
    let rows = values.len() / cols;
    let (upper, lower) = values.split_at_mut(rows.div_ceil(2) * cols);
    for (a, b) in upper.chunks_exact_mut(cols).zip(lower.chunks_exact_mut(cols).rev()) {
        a.swap_with_slice(b);
    }
}

/// Reads any of the formats.
fn read(path: &Path, want: Want) -> Result<Raster> {
    let io = |e| Error::io(path, e);
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.by_ref().take(512).read_to_end(&mut bytes).map_err(io)?;
    let format = Format::of(&bytes, path)?;
    file.read_to_end(&mut bytes).map_err(io)?;
    match format {
        Format::GeoTiff => geotiff::read(path, &bytes, want),
        Format::AsciiGrid => ascii_grid::read(path, &bytes),
        Format::Hgt => hgt::read(path, &bytes),
        Format::HgtGzip => hgt::read(path, &hgt::gunzip(path, &bytes)?),
        Format::HgtZip => hgt::read(path, &hgt::unzip(path, &bytes)?),
    }
}

/// A format that is read.
#[derive(Debug, PartialEq, Eq)]
enum Format {
    GeoTiff,
    AsciiGrid,
    Hgt,
    HgtGzip,
    HgtZip,
}

impl Format {
    /// The format of a file that begins with `head`, or what is wrong with it.
    fn of(head: &[u8], path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or("").to_ascii_lowercase();
        let inner = path.file_stem().map(Path::new).and_then(Path::extension).unwrap_or_default();
        let holds_hgt = inner.eq_ignore_ascii_case("hgt");
        let text = String::from_utf8_lossy(head)
            .trim_start_matches('\u{feff}')
            .trim_start()
            .to_ascii_lowercase();
        let starts = |magic: &[u8]| head.starts_with(magic);
        let convert = |what: &str| {
            Err(Error::unsupported(
                path,
                format!("{what}; convert it with `gdal_translate IN OUT.tif`"),
            ))
        };

        if head.is_empty() {
            return Err(Error::format(path, "the file is empty"));
        }
        if geotiff::is_tiff(head) {
            return Ok(Self::GeoTiff);
        }
        if ascii_grid::is_header(&text) {
            return Ok(Self::AsciiGrid);
        }
        if text.starts_with("<!doctype html") || text.starts_with("<html") {
            return Err(Error::format(
                path,
                "an HTML page, not a DEM: the download went wrong; fetch the file again",
            ));
        }
        if text.starts_with("version https://git-lfs") {
            return Err(Error::format(
                path,
                "a Git LFS pointer, not the file itself; fetch it with `git lfs pull`",
            ));
        }
        // From here on a magic number could as well be a pair of heights.
        if extension == "hgt" {
            return Ok(Self::Hgt);
        }
        if starts(&[0x1f, 0x8b]) {
            return if holds_hgt {
                Ok(Self::HgtGzip)
            } else {
                Err(Error::unsupported(path, "a gzip file; unpack it with `gunzip`"))
            };
        }
        if starts(b"PK\x03\x04") {
            return if holds_hgt {
                Ok(Self::HgtZip)
            } else {
                Err(Error::unsupported(path, "a zip archive; unpack it first"))
            };
        }
        if starts(b"\x89PNG") || starts(b"\xff\xd8\xff") || starts(b"P5") {
            return convert("a picture (PNG, JPEG or PGM), not read yet");
        }
        if starts(b"DSAA") || starts(b"DSBB") || starts(b"DSRB") {
            return convert("a Surfer grid, not read yet");
        }
        if starts(b"\x89HDF") || starts(b"CDF") {
            return convert("an HDF5 or netCDF file, which is not read");
        }
        if starts(b"\x93NUMPY") {
            return Err(Error::unsupported(
                path,
                "a NumPy array, not read yet; write it as a GeoTIFF",
            ));
        }
        match extension.as_str() {
            "asc" => Ok(Self::AsciiGrid),
            "flt" | "bil" | "bip" | "bsq" | "xyz" | "csv" | "dem" => {
                convert(&format!("a .{extension} file, not read yet"))
            }
            _ => Err(Error::format(
                path,
                format!(
                    "not a DEM of a format that is read (GeoTIFF, ESRI ASCII grid, SRTM .hgt): it begins with \
                     bytes {:02x?}",
                    &head[..head.len().min(8)]
                ),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    fn frame(cols: usize, rows: usize) -> GridFrame {
        GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap()
    }

    #[test]
    fn infinite_and_nan_heights_are_voids() {
        let heights = vec![1.0, f64::NAN, f64::INFINITY, 5.0];
        let mut terrain = Terrain::new(frame(2, 2), heights, Crs::none()).unwrap();
        assert!(terrain.is_void(1, 0) && terrain.is_void(0, 1) && !terrain.is_void(1, 1));
        assert_eq!(terrain.statistics(), (2, Some([1.0, 5.0, 3.0])));
        terrain.free_heights();
        assert!(terrain.heights().is_empty() && !terrain.is_void(1, 0));
        assert_eq!(terrain.frame().nodes(), 4);
        let void = Terrain::new(frame(1, 1), vec![f64::NAN], Crs::none()).unwrap();
        assert_eq!(void.statistics(), (1, None));
        assert!(Terrain::new(frame(2, 2), vec![0.0; 3], Crs::none()).is_err());
    }

    #[test]
    fn rows_turn() {
        let mut values = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        turn_rows(&mut values, 2);
        assert_eq!(values, [5.0, 6.0, 3.0, 4.0, 1.0, 2.0]);
        turn_rows(&mut values, 3);
        assert_eq!(values, [4.0, 1.0, 2.0, 5.0, 6.0, 3.0]);
    }

    #[test]
    fn the_date_line_is_no_edge() {
        let crs = Crs::from_epsg(4326).unwrap();
        let frame =
            GridFrame::new(11, 3, DVec2::new(179.5, -16.0), DVec2::splat(0.1), crs.ground())
                .unwrap();
        let terrain = Terrain::new(frame, vec![0.0; 33], crs).unwrap();
        for at in [DVec2::new(1.0, 1.0), DVec2::new(9.0, 1.0)] {
            let lonlat = terrain.to_lonlat(at).unwrap();
            assert!(lonlat.x.abs() <= 180.0);
            assert!((terrain.from_lonlat(lonlat).unwrap() - at).length() < 1e-9);
        }
        assert!(terrain.to_lonlat(DVec2::new(9.0, 1.0)).unwrap().x < 0.0);
    }

    #[test]
    fn formats_are_told_by_content_then_by_extension() {
        let of = |head: &[u8], path: &str| Format::of(head, Path::new(path));
        assert_eq!(of(b"II*\0abcd", "dem.asc").unwrap(), Format::GeoTiff);
        assert_eq!(of(b"\xef\xbb\xbfNCOLS 3\n", "dem.tif").unwrap(), Format::AsciiGrid);
        assert_eq!(of(b"anything", "N42E001.hgt").unwrap(), Format::Hgt);
        assert_eq!(of(b"\x1f\x8b\x08", "N42E001.hgt.gz").unwrap(), Format::HgtGzip);
        for (head, path, word) in [
            (&b""[..], "a.tif", "empty"),
            (b"<!DOCTYPE html><html>", "a.tif", "HTML"),
            (b"version https://git-lfs.github.com/spec/v1", "a.tif", "git lfs pull"),
            (b"\x89PNG\r\n", "a.png", "not read yet"),
            (b"DSAA\n", "a.grd", "Surfer"),
            (b"PK\x03\x04", "a.zip", "unpack"),
            (b"1.0 2.0 3.0", "a.xyz", "gdal_translate"),
            (b"\0\0\0\0", "a.tif", "not a DEM"),
        ] {
            let message = of(head, path).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains(path), "{message}");
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Terrain::open("no/such/dem.tif").unwrap_err();
        assert!(matches!(error, Error::Io { .. }));
        assert!(error.to_string().contains("no/such/dem.tif"));
    }
}
