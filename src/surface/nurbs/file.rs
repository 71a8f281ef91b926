//! NURBS surfaces in JSON. `docs/surface_format.md` is the schema.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::DVec4;
use serde::{Deserialize, Serialize};

use super::{Knots, NurbsSurface};
use crate::error::{Error, Result};

/// The longest file, bytes: a million control points with all their digits are half of it.
const LONGEST: u64 = 1 << 28;

/// The JSON form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with degree, knots and points")]
struct Schema {
    degree: [usize; 2],
    #[serde(default)]
    closed: [bool; 2],
    knots: [Vec<f64>; 2],
    /// Rows of `(x, y, z, weight)`.
    points: Vec<Vec<[f64; 4]>>,
}

impl TryFrom<Schema> for NurbsSurface {
    type Error = Error;

    fn try_from(Schema { degree, closed, knots, points }: Schema) -> Result<Self> {
        let [first, second] = knots;
        let knots = [Knots::new(degree[0], first)?, Knots::new(degree[1], second)?];
        let [cols, rows] = [knots[0].controls(), knots[1].controls()];
        if points.len() != rows {
            return Err(Error::argument(
                "the number of rows of control points",
                points.len(),
                format!("{rows}, as the second knots say"),
            ));
        }
        if let Some(row) = points.iter().position(|row| row.len() != cols) {
            return Err(Error::argument(
                format!("the number of control points in row {row}"),
                points[row].len(),
                format!("{cols}, as the first knots say"),
            ));
        }
        let points: Vec<DVec4> = points.into_iter().flatten().map(DVec4::from).collect();
        Self::new(knots, closed, &points)
    }
}

impl From<&NurbsSurface> for Schema {
    fn from(surface: &NurbsSurface) -> Self {
        let points: Vec<[f64; 4]> = surface.points().map(Into::into).collect();
        Self {
            degree: surface.knots.each_ref().map(Knots::degree),
            closed: surface.closed,
            knots: surface.knots.each_ref().map(|knots| knots.as_slice().to_vec()),
            points: points.chunks(surface.knots[0].controls()).map(<[_]>::to_vec).collect(),
        }
    }
}

impl NurbsSurface {
    /// Reads a surface from a JSON file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] if it is longer than 256 MiB, no JSON of this schema or no surface, see
    /// [`new`](Self::new) and [`Knots`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let mut text = Vec::new();
        (&file).take(LONGEST + 1).read_to_end(&mut text).map_err(|e| Error::io(path, e))?;
        if text.len() as u64 > LONGEST {
            let length = file.metadata().map_or(LONGEST + 1, |metadata| metadata.len());
            let expected = format!("at most {LONGEST} bytes");
            return Err(Error::argument("the length of the file", length, expected).in_file(path));
        }
        if text.is_empty() {
            return Err(Error::argument("the file", "empty", "a surface in JSON").in_file(path));
        }
        Self::parse(&text).map_err(|e| e.in_file(path))
    }

    /// The surface of a JSON text.
    ///
    /// # Errors
    /// [`Error::Argument`] that says what is wrong.
    pub fn from_json(text: &str) -> Result<Self> {
        Self::parse(text.as_bytes())
    }

    fn parse(text: &[u8]) -> Result<Self> {
        let schema: Schema =
            serde_json::from_slice(text).map_err(|e| Error::damaged("the surface in JSON", e))?;
        schema.try_into()
    }

    /// The surface as JSON; [`from_json`](Self::from_json) reads it, to the last bits but those of the rounding of weighted points.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(&Schema::from(self)).expect("numbers and lists can be written")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANE: &str = r#"{"degree": [1, 1], "knots": [[0, 0, 1, 1], [0, 0, 1, 1]],
        "points": [[[0, 0, 0, 1], [1, 0, 0, 1]], [[0, 1, 0, 1], [1, 1, 0, 2]]]}"#;

    #[test]
    fn what_is_written_is_read() {
        let plane = NurbsSurface::from_json(PLANE).unwrap();
        assert_eq!(plane.closed(), [false; 2]);
        assert_eq!(NurbsSurface::from_json(&plane.to_json()).unwrap(), plane);
    }

    #[test]
    fn wrong_files_are_refused() {
        for (from, to, said) in [
            ("[0, 0, 1, 1], [", "[0, 1, 0, 1], [", "ascend"),
            ("[0, 0, 1, 1], [", "[0, 0, 1], [", "4 or more"),
            ("[0, 0, 1, 1], [", "[0, 0, 0.5, 1, 1], [", "control points in row 0 is 2"),
            ("[1, 1]", "[1, 99]", "degree of a spline is 99"),
            ("[1, 1]", "[1, -1]", "surface in JSON is damaged"),
            ("[1, 0, 0, 1]", "[1, 0, 0, 0]", "weight of control point 1 is 0"),
            ("[1, 0, 0, 1]", "[1, 0, 0, -1]", "weight of control point 1 is -1"),
            ("[1, 0, 0, 1]", "[1e999, 0, 0, 1]", "surface in JSON is damaged"),
            ("[1, 0, 0, 1]", "[1e300, 0, 0, 1]", "control point 1 is at"),
            ("[1, 0, 0, 1]", "[1, 0, 0]", "surface in JSON is damaged"),
            ("[0, 1, 0, 1], [1, 1, 0, 2]", "[0, 0, 0, 1], [1, 0, 0, 2]", "the area between"),
            (
                "\"degree\"",
                "\"closed\": [true, false], \"degree\"",
                "the end of the surface in the closed first direction",
            ),
            ("\"degree\"", "\"colour\": 1, \"degree\"", "unknown field"),
            ("}", "", "surface in JSON is damaged"),
        ] {
            assert!(PLANE.contains(from), "{from}");
            let error =
                NurbsSurface::from_json(&PLANE.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(said), "{said}: {error}");
        }
        let missing = NurbsSurface::open("no/such/surface.json").unwrap_err();
        assert!(matches!(missing, Error::Io { .. }));
    }
}
