//! ESRI ASCII grids (`.asc`): a header of keywords, then numbers from the north-west on.
//!
//! Accepted beyond the specification: keywords in any case and order, `dx` and `dy` for cells that are not
//! square (as GDAL writes), lines broken anywhere, decimal commas, `nan`, a byte order mark, a `.prj` file beside.

use std::fs;
use std::path::Path;

use glam::DVec2;

use super::auxiliary::Auxiliary;
use super::format::{Format, Head, ReadMode};
use crate::error::{Error, Location, Result};
use crate::memory;
use crate::terrain::raster::{Raster, note_of_fill};
use crate::terrain::{Crs, Source};

pub(super) const FORMAT: Format =
    Format { name: "ESRI ASCII grid", is_own: begins_with_keyword, extensions: &["asc"], read };

/// What a grid without a `NODATA_value` line marks voids with.
const DEFAULT_NODATA: f64 = -9999.0;

fn begins_with_keyword(head: &Head) -> bool {
    let keywords = ["ncols", "nrows", "xll", "yll", "cellsize", "nodata_value"];
    keywords.iter().any(|k| head.text.starts_with(k))
}

fn read(path: &Path, bytes: &[u8], _: ReadMode) -> Result<Raster> {
    let auxiliary = Auxiliary::of(path);
    let nodata = auxiliary.nodata(0).and_then(|text| text.parse().ok());
    let (header, grid, heights) = parse(bytes, nodata).map_err(|error| error.in_file(path))?;
    let mut notes: Vec<String> = note_of_fill(&heights).into_iter().collect();
    if header.nodata.is_none() && heights.iter().any(|h| h.is_nan()) {
        notes.push(
            "the file has no NODATA_value line; cells of -9999 were taken as voids".to_owned(),
        );
    }
    Ok(Raster {
        cols: grid.cols,
        rows: grid.rows,
        origin: grid.origin,
        step: DVec2::new(grid.cell.x, -grid.cell.y),
        crs: crs_of(path, &auxiliary)?,
        bands: vec![heights],
        source: Source {
            format: FORMAT.name.to_owned(),
            sample: "text".to_owned(),
            nodata: header.nodata.map(|v| v.to_string()),
            ..Source::default()
        },
        says_height_unit: false,
        notes,
    })
}

/// The header, the grid it describes, and the cells; a nodata value that is given goes before that of the header.
fn parse(bytes: &[u8], nodata: Option<f64>) -> Result<(Header, Grid, Vec<f64>)> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut tokens = bytes.split(u8::is_ascii_whitespace).filter(|t| !t.is_empty()).peekable();
    let mut header = Header::default();
    // A number ends the header; `nan` among the cells is not a keyword.
    while let Some(word) = tokens.next_if(|t| t[0].is_ascii_alphabetic() && number(t).is_none()) {
        let word = String::from_utf8_lossy(word).to_ascii_lowercase();
        let token = tokens.next().unwrap_or_default();
        let value = number(token).ok_or_else(|| {
            let what = format!("the value of `{word}` in the header");
            Error::argument(what, quoted(token), "a number")
        })?;
        header.set(&word, value)?;
    }
    header.nodata = nodata.or(header.nodata);
    let grid = header.check(bytes.len())?;
    let heights = cells(tokens, &grid)?;
    Ok((header, grid, heights))
}

/// A word of the file in quotes, cut to a length that fits in a message.
fn quoted(token: &[u8]) -> String {
    format!("`{}`", String::from_utf8_lossy(&token[..token.len().min(40)]))
}

/// What the keywords said.
#[derive(Default)]
struct Header {
    cols: Option<f64>,
    rows: Option<f64>,
    x: Option<LowerLeft>,
    y: Option<LowerLeft>,
    dx: Option<f64>,
    dy: Option<f64>,
    nodata: Option<f64>,
}

/// One coordinate of the south-western cell.
#[derive(Clone, Copy)]
enum LowerLeft {
    Corner(f64),
    Centre(f64),
}

impl LowerLeft {
    /// Of the centre of a cell of this size.
    fn centre(self, cell: f64) -> f64 {
        match self {
            Self::Corner(value) => value + cell / 2.0,
            Self::Centre(value) => value,
        }
    }
}

/// The header, complete and checked.
struct Grid {
    cols: usize,
    rows: usize,
    /// Centre of the north-western cell.
    origin: DVec2,
    cell: DVec2,
    nodata: f64,
}

impl Header {
    fn set(&mut self, keyword: &str, value: f64) -> Result<()> {
        match keyword {
            "ncols" => self.cols = Some(value),
            "nrows" => self.rows = Some(value),
            "xllcorner" => self.x = Some(LowerLeft::Corner(value)),
            "yllcorner" => self.y = Some(LowerLeft::Corner(value)),
            "xllcenter" | "xllcentre" => self.x = Some(LowerLeft::Centre(value)),
            "yllcenter" | "yllcentre" => self.y = Some(LowerLeft::Centre(value)),
            "cellsize" => (self.dx, self.dy) = (Some(value), Some(value)),
            "dx" | "xdim" => self.dx = Some(value),
            "dy" | "ydim" => self.dy = Some(value),
            "nodata_value" | "nodata" => self.nodata = Some(value),
            _ => {
                let expected = "one of an ESRI ASCII grid, such as `ncols`";
                return Err(Error::argument(
                    "a keyword of the header",
                    format!("`{keyword}`"),
                    expected,
                ));
            }
        }
        Ok(())
    }

    /// The grid that the header describes. Bounds the number of cells by the size of the file, so that none is allocated for which there is no byte.
    fn check(&self, bytes: usize) -> Result<Grid> {
        let cols = count(self.cols, "ncols")?;
        let rows = count(self.rows, "nrows")?;
        if cols * rows > bytes / 2 + 1 {
            let found = format!("{cols} × {rows}, more than the file's {bytes} bytes can hold");
            return Err(Error::argument(
                "the number of cells in the header",
                found,
                "what the file holds",
            )
            .advise("the file is cut short"));
        }
        let cell = DVec2::new(present(self.dx, "cellsize")?, present(self.dy, "cellsize")?);
        if !cell.is_finite() || cell.min_element() <= 0.0 {
            let found = format!("{} × {}", cell.x, cell.y);
            return Err(Error::argument("the cell size", found, "positive"));
        }
        let x = present(self.x, "xllcorner` or `xllcenter")?.centre(cell.x);
        let south = present(self.y, "yllcorner` or `yllcenter")?.centre(cell.y);
        let origin = DVec2::new(x, south + cell.y * (rows - 1) as f64);
        Ok(Grid { cols, rows, origin, cell, nodata: self.nodata.unwrap_or(DEFAULT_NODATA) })
    }
}

/// The value of a keyword that a grid cannot do without.
fn present<T>(value: Option<T>, keyword: &str) -> Result<T> {
    value.ok_or_else(|| {
        Error::argument(format!("the value of `{keyword}` in the header"), "missing", "a number")
    })
}

/// A whole number of at least 1.
fn count(value: Option<f64>, keyword: &str) -> Result<usize> {
    let value = present(value, keyword)?;
    // Beyond 2³² the product with the other count could overflow, and no file has so many.
    if value.fract() == 0.0 && (1.0..4_294_967_296.0).contains(&value) {
        Ok(value as usize)
    } else {
        Err(Error::argument(format!("`{keyword}`"), value, "a whole number of at least 1"))
    }
}

/// The cells in metres, voids as `NaN`.
fn cells<'a>(tokens: impl Iterator<Item = &'a [u8]>, grid: &Grid) -> Result<Vec<f64>> {
    let due = grid.cols * grid.rows;
    let wrong_count = |found: String, advice| {
        let expected = format!("{due}, that of {} × {} cells of the header", grid.cols, grid.rows);
        Error::argument("the number of heights", found, expected).advise(advice)
    };
    memory::check_cells("a grid of", [grid.cols, grid.rows], size_of::<f64>())?;
    let mut heights = Vec::with_capacity(due);
    for token in tokens {
        let at = heights.len();
        if at == due {
            return Err(wrong_count(format!("more than {due}"), "is `ncols` or `nrows` wrong?"));
        }
        let height = number(token).ok_or_else(|| {
            Error::argument("the height", quoted(token), "a number")
                .at(Location::Node { col: at % grid.cols, row: at / grid.cols })
        })?;
        // Writers hold heights as `f32`, and print the nodata value of the header and of the cells with other digits.
        let is_void = height == grid.nodata || height as f32 == grid.nodata as f32;
        heights.push(if is_void { f64::NAN } else { height });
    }
    if heights.len() < due {
        return Err(wrong_count(heights.len().to_string(), "the file is cut short"));
    }
    Ok(heights)
}

/// A number with a decimal point or comma.
fn number(token: &[u8]) -> Option<f64> {
    let text = str::from_utf8(token).ok()?;
    text.parse().ok().or_else(|| text.contains(',').then(|| text.replace(',', ".").parse().ok())?)
}

/// The CRS that a `.prj` file next to the grid describes, else a `.aux.xml`.
fn crs_of(path: &Path, auxiliary: &Auxiliary) -> Result<Crs> {
    for extension in ["prj", "PRJ"] {
        let prj = path.with_extension(extension);
        if let Ok(text) = fs::read(&prj) {
            let text = String::from_utf8_lossy(&text);
            return Crs::from_text(&text).map_err(|e| e.unsupported_in(&prj));
        }
    }
    Ok(auxiliary.crs().unwrap_or_else(Crs::none))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\n";

    fn read(text: &str) -> Result<Raster> {
        super::read(Path::new("grid.asc"), text.as_bytes(), ReadMode::Heights)
    }

    #[test]
    fn corners_and_centres_are_told_apart() {
        let raster = read(&format!("{HEADER}1 2 3\n4 5 -9999\n")).unwrap();
        assert_eq!(raster.origin, DVec2::new(105.0, 215.0));
        assert_eq!(raster.step, DVec2::new(10.0, -10.0));
        assert_eq!(raster.bands[0][..5], [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(raster.bands[0][5].is_nan());
        assert!(raster.notes[0].contains("NODATA"));
        let centre = HEADER.replace("corner", "center");
        assert_eq!(read(&format!("{centre}1 2 3 4 5 6")).unwrap().origin, DVec2::new(100.0, 210.0));
    }

    #[test]
    fn dialects_are_read() {
        let commas = "NROWS 2\r\nNCOLS 3\r\nXLLCENTER 0,5\r\nYLLCENTER 0\r\nDX 1,5\r\nDY 2\r\n\
                      NODATA_VALUE -9,000\r\n1,5\t2e1 3\r\nnan -9 6";
        let raster = read(commas).unwrap();
        assert_eq!(raster.origin, DVec2::new(0.5, 2.0));
        assert_eq!(raster.step, DVec2::new(1.5, -2.0));
        assert_eq!(raster.bands[0][..3], [1.5, 20.0, 3.0]);
        assert!(raster.bands[0][3].is_nan() && raster.bands[0][4].is_nan());
    }

    #[test]
    fn nodata_is_compared_as_single_precision() {
        let header = format!("{HEADER}NODATA_value -3.4028234663852886e+38\n");
        let raster = read(&format!("{header}1 2 3 4 5 -3.4028235e+38")).unwrap();
        assert!(raster.bands[0][5].is_nan() && raster.bands[0][4] == 5.0);
    }

    #[test]
    fn errors_say_what_and_where() {
        for (text, words) in [
            (format!("{HEADER}1 2 3 4 five 6"), "the height at column 1, row 1 is `five`"),
            (format!("{HEADER}1 2 3 4 5"), "is 5; it must be 6, that of 3 × 2"),
            (format!("{HEADER}1 2 3 4 5 6 7"), "more than 6"),
            (HEADER.replace("ncols 3", "ncols 0"), "whole number"),
            (HEADER.replace("ncols 3", "ncols 4000000000"), "can hold"),
            (HEADER.replace("ncols 3\n", ""), "`ncols` in the header is missing"),
            (HEADER.replace("cellsize 10", "cellsize -10") + "1 2 3 4 5 6", "positive"),
            (HEADER.replace("cellsize", "sizecell"), "`sizecell`"),
            ("1 2 3".to_owned(), "`ncols` in the header is missing"),
        ] {
            let message = read(&text).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("grid.asc"), "{message}");
        }
    }
}
