//! The one error of the crate: few kinds, each with what is known of it as fields.
//!
//! ```
//! use ridgeway::error::{Error, Location};
//!
//! let error = Error::argument("the cost", -1, "above 0").at_node(3, 4).advise("mark barriers by NaN");
//! assert_eq!(error.to_string(), "the cost at column 3, row 4 is -1; it must be above 0; mark barriers by NaN");
//! let Error::Argument(mismatch) = error else { unreachable!() };
//! assert_eq!(mismatch.at, Some(Location::Node { col: 3, row: 4 }));
//! ```

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

/// `Result` with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What can go wrong, by who can mend it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file contradicts its own format: cut short, damaged, or not what its name says.
    #[error("{}: {mismatch}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What in it is not as it must be.
        mismatch: Box<Mismatch>,
    },
    /// A file is in order but holds something that this crate does not read or write.
    #[error("{}: {found}{}", path.display(), clause(advice))]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// How to make a file of it that can be read.
        advice: String,
    },
    /// The caller asked for something impossible: a place outside the grid, a negative length, …
    #[error("{0}")]
    Argument(Box<Mismatch>),
    /// A start or a goal cannot be used.
    #[error("{0}")]
    Place(Box<PlaceError>),
    /// No path leads from the start to the goal.
    #[error(
        "no path leads from the start to the goal at {goal}{}{}",
        between_clause(between),
        nearest_clause(nearest)
    )]
    NoPath {
        /// The goal.
        goal: Location,
        /// What there is on this ground that closes places to every path.
        between: Vec<Obstacle>,
        /// The place nearest to the goal that a path leads to, where somebody looked for it.
        nearest: Option<Location>,
    },
    /// The distance does not converge: the tensors of the metric are too extreme.
    #[error(
        "the distance has not converged after {activations} activations of tiles{}; the tensors of the metric are too extreme",
        at_clause(at)
    )]
    NotConverged {
        /// How often a tile was solved before the solver gave up.
        activations: usize,
        /// A place where the distance still changed.
        at: Option<Location>,
    },
    /// Something needs more memory than there is, or than is ever granted.
    #[error("{what} needs {} of memory, {}", size(*bytes), limit_clause(*limit))]
    TooLarge {
        /// What needs it.
        what: String,
        /// How much of it, in bytes.
        bytes: u64,
        /// The most that is granted, in bytes; `None` if the machine refused.
        limit: Option<u64>,
    },
    /// Reading or writing failed.
    #[error("{}: {}", path.display(), cause(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The work was cancelled through a [`CancelToken`](crate::CancelToken).
    #[error("cancelled")]
    Cancelled,
    /// Gives way to [`Error::Argument`].
    #[doc(hidden)]
    #[error("{0}")]
    Usage(String),
    /// Gives way to [`Error::NoPath`].
    #[doc(hidden)]
    #[error("{0}")]
    NoWay(String),
}

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
    pub advice: Option<String>,
}

/// A start or a goal that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceError {
    /// What the place is for.
    pub role: Role,
    /// The place as it was given, such as `pixel:3,4`.
    pub name: String,
    /// What is wrong with it.
    pub kind: PlaceErrorKind,
    /// The nearest place that would do, written in the same way; `None` if there is none, or it makes no sense to look for one.
    pub nearest: Option<String>,
}

/// What a place is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Paths begin there.
    Start,
    /// Paths end there.
    Goal,
}

/// What is wrong with a place.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PlaceErrorKind {
    /// It lies outside the DEM.
    Outside {
        /// The first corner of the DEM: south-west, or of pixels north-west.
        from: String,
        /// The opposite corner.
        to: String,
        /// What its two numbers are called, and the place with the two swapped, if that lies on the DEM.
        swapped: Option<(&'static str, String)>,
    },
    /// It lies on a void.
    Void,
    /// It lies on a barrier.
    Barrier,
    /// The metric lets nobody enter because of these; if none, because it is too extreme there.
    Closed(Vec<Obstacle>),
    /// It is a file with lines or areas where points are needed.
    NotPoints,
    /// It is a file whose lines and areas touch no open cell of the DEM.
    OffGround,
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
    /// A line of a text, counted from 1.
    Line(usize),
    /// A byte of a file, counted from 0.
    Byte(u64),
}

/// What closes places to every path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Obstacle {
    /// Cells without a height.
    Void,
    /// Barriers.
    Barrier,
    /// Ground steeper than the limit.
    Slope,
    /// Places at which a raster gives no cost or no tensor.
    NoValue,
}

impl Error {
    /// An [`Error::Argument`]: `what`, a noun in the singular with its article, is `found` and must be `expected`.
    pub fn argument(
        what: impl Into<String>,
        found: impl fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Argument(Box::new(Mismatch {
            what: what.into(),
            at: None,
            found: found.to_string(),
            expected: Some(expected.into()),
            advice: None,
        }))
    }

    /// An [`Error::Argument`] that blames the content of a file until [`in_file`](Self::in_file) names it: `what`, such as
    /// `the zip archive`, cannot be read because of `cause`.
    pub fn damaged(what: impl Into<String>, cause: impl fmt::Display) -> Self {
        Self::Argument(Box::new(Mismatch {
            what: what.into(),
            at: None,
            found: format!("damaged: {cause}"),
            expected: None,
            advice: None,
        }))
    }

    /// An [`Error::Unsupported`]: the file holds `found`; `advice` says how to make one that can be read.
    pub fn unsupported_file(
        path: impl AsRef<Path>,
        found: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        Self::Unsupported {
            path: path.as_ref().to_path_buf(),
            found: found.into(),
            advice: advice.into(),
        }
    }

    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source }
    }

    /// Says where: for [`Error::Argument`] and [`Error::Format`]; the others stay as they are.
    #[must_use]
    pub fn at(mut self, at: Location) -> Self {
        if let Self::Argument(mismatch) | Self::Format { mismatch, .. } = &mut self {
            mismatch.at = Some(at);
        }
        self
    }

    /// [`at`](Self::at) a node.
    #[must_use]
    pub fn at_node(self, col: usize, row: usize) -> Self {
        self.at(Location::Node { col, row })
    }

    /// Says what to do: for [`Error::Argument`] and [`Error::Format`]; the others stay as they are.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        if let Self::Argument(mismatch) | Self::Format { mismatch, .. } = &mut self {
            mismatch.advice = Some(advice.into());
        }
        self
    }

    /// Lays the fault at the file that the argument came from: an [`Error::Argument`] becomes an [`Error::Format`];
    /// the others stay as they are.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> Self {
        match self {
            Self::Argument(mismatch) => {
                Self::Format { path: path.as_ref().to_path_buf(), mismatch }
            }
            Self::Usage(message) => Self::format(path, message),
            other => other,
        }
    }

    /// The same for what the file may well say, but this crate does not read: an [`Error::Argument`] becomes an
    /// [`Error::Unsupported`]; the others stay as they are.
    #[must_use]
    pub fn unsupported_in(self, path: impl AsRef<Path>) -> Self {
        match self {
            Self::Argument(mismatch) => {
                let (found, advice) = mismatch.clauses();
                Self::unsupported_file(path, found, advice)
            }
            Self::Usage(message) => Self::unsupported(path, message),
            other => other,
        }
    }

    #[doc(hidden)]
    pub fn format(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Argument(Box::new(Mismatch {
            what: message.into(),
            at: None,
            found: String::new(),
            expected: None,
            advice: None,
        }))
        .in_file(path)
    }

    #[doc(hidden)]
    pub fn unsupported(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::unsupported_file(path, message, "")
    }

    #[doc(hidden)]
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }
}

impl Mismatch {
    /// What is found, and what it must be and what to do.
    fn clauses(&self) -> (String, String) {
        let mut found = format!("{}{}", self.what, at_clause(&self.at));
        if !self.found.is_empty() {
            found += &format!(" is {}", self.found);
        }
        let expected = self.expected.iter().map(|expected| format!("it must be {expected}"));
        let advice: Vec<_> = expected.chain(self.advice.clone()).collect();
        (found, advice.join("; "))
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (found, advice) = self.clauses();
        write!(f, "{found}{}", clause(&advice))
    }
}

impl PlaceError {
    /// What is wrong with the place, and where a better one is: the predicate of a sentence about it.
    #[must_use]
    pub fn reason(&self) -> String {
        let Self { kind, nearest, .. } = self;
        let advice = match (kind, nearest) {
            (PlaceErrorKind::NotPoints | PlaceErrorKind::OffGround, _)
            | (PlaceErrorKind::Outside { swapped: Some(_), .. }, _)
            | (PlaceErrorKind::Outside { .. }, None) => String::new(),
            (PlaceErrorKind::Outside { .. }, Some(near)) => {
                format!("; the nearest place on it is {near}")
            }
            (_, Some(near)) => format!("; the nearest good place is {near}"),
            (_, None) => ", and so does every other cell".to_owned(),
        };
        format!("{kind}{advice}")
    }
}

impl fmt::Display for PlaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the {} {} {}", self.role, self.name, self.reason())
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

impl fmt::Display for PlaceErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Outside { from, to, swapped } => {
                write!(f, "lies outside the DEM, which reaches from {from} to {to}")?;
                match swapped {
                    Some((axes, place)) => write!(f, "; {axes} look swapped: try {place}"),
                    None => Ok(()),
                }
            }
            Self::Void => f.write_str("lies on a void of the DEM"),
            Self::Barrier => f.write_str("lies on a barrier"),
            Self::Closed(by) if by.is_empty() => {
                f.write_str("lies where the metric is too extreme to compute with")
            }
            Self::Closed(by) => {
                let by: Vec<_> = by.iter().map(Obstacle::to_string).collect();
                write!(f, "lies where the metric lets nobody enter: {}", by.join(", "))
            }
            Self::NotPoints => f.write_str("holds lines or areas; only points will do"),
            Self::OffGround => f.write_str(
                "touches no open cell of the DEM; the file must be in longitude and latitude (RFC 7946) and overlap the DEM",
            ),
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
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Void => "voids",
            Self::Barrier => "barriers",
            Self::Slope => "too steep ground",
            Self::NoValue => "places without a cost or tensor",
        })
    }
}

fn clause(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("; {text}") }
}

fn at_clause(at: &Option<Location>) -> String {
    at.map(|at| format!(" at {at}")).unwrap_or_default()
}

fn between_clause(between: &[Obstacle]) -> String {
    let names: Vec<_> = between.iter().map(Obstacle::to_string).collect();
    match &names[..] {
        [] => String::new(),
        [one] => format!(": {one} lie between"),
        [first @ .., last] => format!(": {} or {last} lie between", first.join(", ")),
    }
}

fn nearest_clause(nearest: &Option<Location>) -> String {
    nearest.map(|at| format!("; the nearest place that can be reached is {at}")).unwrap_or_default()
}

fn limit_clause(limit: Option<u64>) -> String {
    match limit {
        Some(limit) => format!("more than the {} that is granted", size(limit)),
        None => "which this machine does not have".to_owned(),
    }
}

/// A number of bytes for people: `512 bytes`, `1.5 GB`.
fn size(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e6 => format!("{bytes} bytes"),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

/// The cause in plain words where the system's are not.
fn cause(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "there is no such file".into(),
        io::ErrorKind::IsADirectory => "is a folder".into(),
        io::ErrorKind::AlreadyExists => "exists".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        _ => source.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_say_what_where_found_and_expected() {
        let error = Error::argument("the climb weight", -1.5, "0 or more");
        assert_eq!(error.to_string(), "the climb weight is -1.5; it must be 0 or more");
        let error = Error::argument("the speed", 0, "above 0").at_node(3, 4).in_file("a.tif");
        assert_eq!(
            error.to_string(),
            "a.tif: the speed at column 3, row 4 is 0; it must be above 0"
        );
        let zip = Error::damaged("the zip archive", "no end").in_file("a.zip");
        assert_eq!(zip.to_string(), "a.zip: the zip archive is damaged: no end");
    }

    #[test]
    fn no_path_tells_what_lies_between() {
        let between = vec![Obstacle::Void, Obstacle::Barrier, Obstacle::Slope];
        let goal = Location::Map(DVec2::new(1.5, 2.0));
        let nearest = Some(Location::Node { col: 1, row: 2 });
        assert_eq!(
            Error::NoPath { goal, between, nearest }.to_string(),
            "no path leads from the start to the goal at 1.5, 2: voids, barriers or too steep ground lie between; \
             the nearest place that can be reached is column 1, row 2"
        );
    }

    #[test]
    fn sizes_read_well() {
        let error = |limit| {
            Error::TooLarge { what: "the raster".into(), bytes: 12_400_000_000, limit }.to_string()
        };
        assert_eq!(
            error(None),
            "the raster needs 12.4 GB of memory, which this machine does not have"
        );
        assert!(error(Some(300_000_000)).ends_with("more than the 300.0 MB that is granted"));
    }
}
