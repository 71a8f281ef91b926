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

mod advice;
mod mismatch;
mod place;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use self::advice::{Advice, Remedy};
use self::mismatch::at_clause;
pub use self::mismatch::{Location, Mismatch};
pub use self::place::{Obstacle, PlaceError, PlaceErrorKind, Role};

/// `Result` with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What can go wrong: in a file, in what the caller asked for, in the computation, on the machine.
#[derive(Clone, Debug, thiserror::Error)]
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
    #[error("{}: {found}{}", path.display(), advice_clause(advice))]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// How to make a file of it that can be read.
        advice: Advice,
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
        /// The kinds of obstacle there are on this terrain; any of them may lie between.
        between: Vec<Obstacle>,
        /// The place nearest to the goal that a path leads to; `None` if it was not searched for.
        nearest: Option<Location>,
    },
    /// The distance does not converge: the tensors of the metric are too extreme.
    #[error(
        "the distance has not converged after {activations} activations of tiles{}; the tensors of the metric are too extreme",
        at_clause(*at)
    )]
    NotConverged {
        /// How often a tile was solved before the solver gave up.
        activations: usize,
        /// A place where the distance still changed.
        at: Option<Location>,
    },
    /// Something needs more memory than there is.
    #[error("{what} needs about {} of memory, {}", size(*bytes), limit_clause(*limit))]
    TooLarge {
        /// What needs it.
        what: String,
        /// How much of it, in bytes.
        bytes: u64,
        /// How much is available, in bytes; `None` if that is not known, but the machine refused.
        limit: Option<u64>,
    },
    /// Reading or writing failed.
    #[error("{}: {}", path.display(), cause(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: Arc<io::Error>,
    },
    /// The work was cancelled through a [`CancelToken`](crate::CancelToken).
    #[error("cancelled")]
    Cancelled,
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
    pub fn unsupported(
        path: impl AsRef<Path>,
        found: impl Into<String>,
        advice: impl Into<Advice>,
    ) -> Self {
        Self::Unsupported {
            path: path.as_ref().to_path_buf(),
            found: found.into(),
            advice: advice.into(),
        }
    }

    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source: Arc::new(source) }
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
    pub fn advise(mut self, advice: impl Into<Advice>) -> Self {
        if let Self::Argument(mismatch) | Self::Format { mismatch, .. } = &mut self {
            mismatch.advice = Some(advice.into());
        }
        self
    }

    /// What makes the file usable that this error is about, where that is known. The sentence of the error ends with it.
    #[must_use]
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Argument(mismatch) | Self::Format { mismatch, .. } => {
                mismatch.advice.as_ref()?.remedy
            }
            Self::Unsupported { advice, .. } => advice.remedy,
            _ => None,
        }
    }

    /// Names the file that the argument came from: an [`Error::Argument`] becomes an [`Error::Format`];
    /// the others stay as they are.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> Self {
        match self {
            Self::Argument(mismatch) => {
                Self::Format { path: path.as_ref().to_path_buf(), mismatch }
            }
            other => other,
        }
    }

    /// Names the file where it is in order but holds what this crate does not read: an [`Error::Argument`] becomes an
    /// [`Error::Unsupported`]; the others stay as they are.
    #[must_use]
    pub fn unsupported_in(self, path: impl AsRef<Path>) -> Self {
        match self {
            Self::Argument(mismatch) => {
                let (found, text) = mismatch.clauses();
                let remedy = mismatch.advice.and_then(|advice| advice.remedy);
                Self::unsupported(path, found, Advice { text, remedy })
            }
            other => other,
        }
    }
}

fn advice_clause(advice: &Advice) -> String {
    if advice.text.is_empty() { String::new() } else { format!("; {advice}") }
}

fn between_clause(between: &[Obstacle]) -> String {
    if between.is_empty() {
        return String::new();
    }
    format!(": {} lie between", Obstacle::any_of(between))
}

fn nearest_clause(nearest: &Option<Location>) -> String {
    nearest.map(|at| format!("; the nearest place that can be reached is {at}")).unwrap_or_default()
}

fn limit_clause(limit: Option<u64>) -> String {
    match limit {
        Some(limit) => format!("{} is available", size(limit)),
        None => "which this machine does not have".to_owned(),
    }
}

/// A number of bytes for people: `512 bytes`, `1.5 MB`, `1.50 GB`.
fn size(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e6 => format!("{bytes} bytes"),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.2} GB", b / 1e9),
    }
}

/// The cause in plain words where those of the system are not plain.
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
    use glam::DVec2;

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
    fn sentences_end_with_the_remedy() {
        let advice = Remedy::SetCrs.after("use map coordinates, or ");
        let error = Error::argument("the CRS", "unknown", "known").advise(advice).in_file("a.tif");
        let unsupported =
            Error::argument("the map", "geocentric", "flat").advise(Remedy::Reproject);
        for error in [error, unsupported.unsupported_in("a.tif")] {
            let remedy = error.remedy().unwrap();
            assert!(error.to_string().ends_with(&remedy.to_string()), "{error}");
        }
    }

    #[test]
    fn no_path_names_the_obstacles_between() {
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
            "the raster needs about 12.40 GB of memory, which this machine does not have"
        );
        assert!(error(Some(300_000_000)).ends_with("of memory, 300.0 MB is available"));
    }
}
