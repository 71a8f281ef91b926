//! Something that is not as it must be, and where it stands.

use std::fmt;

use glam::{DVec2, DVec3};

use super::advice::Advice;

/// Something that is not as it must be: `what`, at a place, is `found` and must be `expected`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Mismatch {
    /// The thing: a noun in the singular with its article, such as `the climb weight`.
    pub what: String,
    /// Where it stands.
    pub at: Option<Location>,
    /// What it is.
    pub found: String,
    /// What it must be; `None` if that goes without saying, as of a damaged archive.
    pub expected: Option<String>,
    /// What to do, where that is known.
    pub advice: Option<Advice>,
}

/// Where in an input something stands.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Location {
    /// A node of the grid, counted from the north-west one.
    Node {
        /// Column.
        col: usize,
        /// Row.
        row: usize,
    },
    /// Grid coordinates, `(column, row)`.
    Grid(DVec2),
    /// Map coordinates, `(x, y)`.
    Map(DVec2),
    /// A point in space, in metres.
    Space(DVec3),
    /// A byte of a file, counted from 0.
    Byte(u64),
}

impl Mismatch {
    /// What is found, and what it must be and what to do.
    pub(super) fn clauses(&self) -> (String, String) {
        let found = format!("{}{} is {}", self.what, at_clause(self.at), self.found);
        let expected = self.expected.iter().map(|expected| format!("it must be {expected}"));
        let advice: Vec<_> = expected.chain(self.advice.iter().map(Advice::to_string)).collect();
        (found, advice.join("; "))
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (found, advice) = self.clauses();
        match &*advice {
            "" => f.write_str(&found),
            _ => write!(f, "{found}; {advice}"),
        }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Node { col, row } => write!(f, "column {col}, row {row}"),
            Self::Grid(at) => write!(f, "column {}, row {}", at.x, at.y),
            Self::Map(at) => write!(f, "{}, {}", at.x, at.y),
            Self::Space(at) => write!(f, "({}, {}, {})", at.x, at.y, at.z),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// ` at` and the location, if there is one.
pub(super) fn at_clause(at: Option<Location>) -> String {
    at.map(|at| format!(" at {at}")).unwrap_or_default()
}
