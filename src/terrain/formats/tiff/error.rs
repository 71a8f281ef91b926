//! Why a TIFF cannot be read.

use std::path::Path;

use crate::error::{Advice, Error};

/// Why a TIFF cannot be read; the caller adds the path.
#[derive(Debug)]
pub(crate) enum TiffError {
    /// The file contradicts itself.
    Damaged(Error),
    /// The file is in order but of a kind that is not read.
    Unsupported {
        /// What it holds.
        found: String,
        /// How to make one that is read.
        advice: Advice,
    },
    /// The CRS is not one that is known.
    Crs(Error),
    /// A band does not fit in memory.
    TooLarge {
        /// What it takes.
        bytes: u64,
    },
}

/// What reading a part of a TIFF comes to.
pub(crate) type TiffResult<T> = Result<T, TiffError>;

impl TiffError {
    /// The same with the file it was found in.
    pub(crate) fn in_file(self, path: &Path) -> Error {
        match self {
            Self::Damaged(error) => error.in_file(path),
            Self::Unsupported { found, advice } => Error::unsupported(path, found, advice),
            Self::Crs(error) => error.unsupported_in(path),
            Self::TooLarge { bytes } => Error::TooLarge {
                what: format!("a band of {}", path.display()),
                bytes,
                limit: None,
            },
        }
    }
}

impl From<Error> for TiffError {
    fn from(error: Error) -> Self {
        Self::Damaged(error)
    }
}

/// A [`TiffError::Damaged`]: `what` is `found` and must be `expected`.
pub(crate) fn damaged<T>(
    what: impl Into<String>,
    found: impl std::fmt::Display,
    expected: impl Into<String>,
) -> TiffResult<T> {
    Err(TiffError::Damaged(Error::argument(what, found, expected)))
}

/// A [`TiffError::Unsupported`].
pub(crate) fn unsupported<T>(found: impl Into<String>, advice: impl Into<Advice>) -> TiffResult<T> {
    Err(TiffError::Unsupported { found: found.into(), advice: advice.into() })
}
