//! ESRI ASCII grids (`.asc`): a header of keywords, then numbers from the north-west on.
//!
//! Accepted beyond the specification: keywords in any case and order, `dx` and `dy` for cells that are not
//! square (as GDAL writes), lines broken anywhere, decimal commas, `nan`, a byte order mark, a `.prj` beside.

use std::fs;
use std::path::Path;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::terrain::{Crs, Raster, Source};

/// A fault is a sentence; [`read`] adds the path.
type Checked<T> = std::result::Result<T, String>;

/// What a grid without a `NODATA_value` line marks voids with.
const DEFAULT_NODATA: f64 = -9999.0;

/// Whether lower-case text begins with a keyword of the header.
pub(in crate::terrain) fn is_header(text: &str) -> bool {
    ["ncols", "nrows", "xll", "yll", "cellsize", "nodata_value"].iter().any(|k| text.starts_with(k))
}

/// Reads a grid.
pub(in crate::terrain) fn read(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut tokens = bytes.split(u8::is_ascii_whitespace).filter(|t| !t.is_empty()).peekable();
    let mut header = Header::default();
    // A number ends the header; `nan` among the cells is not a keyword.
    while let Some(word) = tokens.next_if(|t| t[0].is_ascii_alphabetic() && number(t).is_none()) {
        let word = String::from_utf8_lossy(word).to_ascii_lowercase();
        let value = tokens.next().and_then(number).ok_or_else(|| {
            Error::format(path, format!("`{word}` in the header is not followed by a number"))
        })?;
        header.set(&word, value).map_err(|message| Error::format(path, message))?;
    }
    let grid = header.check(bytes.len()).map_err(|message| Error::format(path, message))?;
    let heights = cells(tokens, &grid).map_err(|message| Error::format(path, message))?;
    let mut notes = Vec::new();
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
        crs: crs_beside(path)?,
        bands: vec![heights],
        source: Source {
            format: "ESRI ASCII grid".to_owned(),
            sample: "text".to_owned(),
            nodata: header.nodata.map(|v| v.to_string()),
            ..Source::default()
        },
        notes,
    })
}

/// What the keywords said.
#[derive(Default)]
struct Header {
    cols: Option<f64>,
    rows: Option<f64>,
    /// Value, and whether it is the centre of the cell rather than its corner.
    x: Option<(f64, bool)>,
    y: Option<(f64, bool)>,
    dx: Option<f64>,
    dy: Option<f64>,
    nodata: Option<f64>,
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
    fn set(&mut self, keyword: &str, value: f64) -> Checked<()> {
        match keyword {
            "ncols" => self.cols = Some(value),
            "nrows" => self.rows = Some(value),
            "xllcorner" => self.x = Some((value, false)),
            "yllcorner" => self.y = Some((value, false)),
            "xllcenter" | "xllcentre" => self.x = Some((value, true)),
            "yllcenter" | "yllcentre" => self.y = Some((value, true)),
            "cellsize" => (self.dx, self.dy) = (Some(value), Some(value)),
            "dx" | "xdim" => self.dx = Some(value),
            "dy" | "ydim" => self.dy = Some(value),
            "nodata_value" | "nodata" => self.nodata = Some(value),
            _ => return Err(format!("`{keyword}` is not a keyword of an ESRI ASCII grid")),
        }
        Ok(())
    }

    /// `bytes` is the size of the file, which bounds the number of cells.
    fn check(&self, bytes: usize) -> Checked<Grid> {
        let need = |value: Option<f64>, keyword: &str| {
            value.ok_or_else(|| format!("the header has no `{keyword}`; is it an ESRI ASCII grid?"))
        };
        let count = |value: f64, keyword: &str| {
            // Beyond 2³² the product with the other count could overflow, and no file has so many.
            if value.fract() == 0.0 && (1.0..4_294_967_296.0).contains(&value) {
                Ok(value as usize)
            } else {
                Err(format!("`{keyword}` is {value}; it must be a whole number of at least 1"))
            }
        };
        let cols = count(need(self.cols, "ncols")?, "ncols")?;
        let rows = count(need(self.rows, "nrows")?, "nrows")?;
        if cols * rows > bytes / 2 + 1 {
            return Err(format!(
                "the header claims {cols} × {rows} cells, more than the file's {bytes} bytes can hold; it is cut short"
            ));
        }
        let cell = DVec2::new(need(self.dx, "cellsize")?, need(self.dy, "cellsize")?);
        if !cell.is_finite() || cell.min_element() <= 0.0 {
            return Err(format!("the cell size is {} × {}; it must be positive", cell.x, cell.y));
        }
        let centre = |(value, is_centre): (f64, bool), cell: f64| {
            if is_centre { value } else { value + cell / 2.0 }
        };
        let missing =
            |axis| format!("the header has neither `{axis}llcorner` nor `{axis}llcenter`");
        let x = centre(self.x.ok_or_else(|| missing('x'))?, cell.x);
        let south = centre(self.y.ok_or_else(|| missing('y'))?, cell.y);
        let origin = DVec2::new(x, south + cell.y * (rows - 1) as f64);
        Ok(Grid { cols, rows, origin, cell, nodata: self.nodata.unwrap_or(DEFAULT_NODATA) })
    }
}

/// The cells in metres, voids as `NaN`.
fn cells<'a>(tokens: impl Iterator<Item = &'a [u8]>, grid: &Grid) -> Checked<Vec<f64>> {
    let due = grid.cols * grid.rows;
    let mut heights = Vec::with_capacity(due);
    for token in tokens {
        let at = heights.len();
        if at == due {
            return Err(format!(
                "there are more numbers than the {} × {} cells of the header; is `ncols` or `nrows` wrong?",
                grid.cols, grid.rows
            ));
        }
        let height = number(token).ok_or_else(|| {
            format!(
                "`{}` in row {}, column {} (counted from 0) is not a number",
                String::from_utf8_lossy(&token[..token.len().min(40)]),
                at / grid.cols,
                at % grid.cols
            )
        })?;
        heights.push(if height == grid.nodata { f64::NAN } else { height });
    }
    if heights.len() < due {
        return Err(format!(
            "there are {} numbers where {} × {} cells are due; the file is cut short",
            heights.len(),
            grid.cols,
            grid.rows
        ));
    }
    Ok(heights)
}

/// A number with a decimal point or comma.
fn number(token: &[u8]) -> Option<f64> {
    let text = str::from_utf8(token).ok()?;
    text.parse().ok().or_else(|| text.contains(',').then(|| text.replace(',', ".").parse().ok())?)
}

/// The CRS that a `.prj` file beside the grid describes.
fn crs_beside(path: &Path) -> Result<Crs> {
    for extension in ["prj", "PRJ"] {
        let beside = path.with_extension(extension);
        if let Ok(wkt) = fs::read(&beside) {
            return Crs::from_wkt(&String::from_utf8_lossy(&wkt))
                .map_err(|e| Error::unsupported(&beside, e.to_string()));
        }
    }
    Ok(Crs::none())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\n";

    fn parse(text: &str) -> Result<Raster> {
        read(Path::new("grid.asc"), text.as_bytes())
    }

    #[test]
    fn corners_and_centres_are_told_apart() {
        let raster = parse(&format!("{HEADER}1 2 3\n4 5 -9999\n")).unwrap();
        assert_eq!(raster.origin, DVec2::new(105.0, 215.0));
        assert_eq!(raster.step, DVec2::new(10.0, -10.0));
        assert_eq!(raster.bands[0][..5], [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(raster.bands[0][5].is_nan());
        assert!(raster.notes[0].contains("NODATA"));
        let centre = HEADER.replace("corner", "center");
        assert_eq!(
            parse(&format!("{centre}1 2 3 4 5 6")).unwrap().origin,
            DVec2::new(100.0, 210.0)
        );
    }

    #[test]
    fn dialects_are_read() {
        let commas = "NROWS 2\r\nNCOLS 3\r\nXLLCENTER 0,5\r\nYLLCENTER 0\r\nDX 1,5\r\nDY 2\r\n\
                      NODATA_VALUE -9,000\r\n1,5\t2e1 3\r\nnan -9 6";
        let raster = parse(commas).unwrap();
        assert_eq!(raster.origin, DVec2::new(0.5, 2.0));
        assert_eq!(raster.step, DVec2::new(1.5, -2.0));
        assert_eq!(raster.bands[0][..3], [1.5, 20.0, 3.0]);
        assert!(raster.bands[0][3].is_nan() && raster.bands[0][4].is_nan());
    }

    #[test]
    fn faults_say_what_and_where() {
        for (text, words) in [
            (format!("{HEADER}1 2 3 4 five 6"), "`five` in row 1, column 1"),
            (format!("{HEADER}1 2 3 4 5"), "5 numbers where 3 × 2"),
            (format!("{HEADER}1 2 3 4 5 6 7"), "more numbers"),
            (HEADER.replace("ncols 3", "ncols 0"), "whole number"),
            (HEADER.replace("ncols 3", "ncols 4000000000"), "can hold"),
            (HEADER.replace("ncols 3\n", ""), "no `ncols`"),
            (HEADER.replace("cellsize 10", "cellsize -10") + "1 2 3 4 5 6", "positive"),
            (HEADER.replace("cellsize", "sizecell"), "`sizecell`"),
            ("1 2 3".to_owned(), "no `ncols`"),
        ] {
            let message = parse(&text).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("grid.asc"), "{message}");
        }
    }
}
