//! The one error of the crate: few kinds, each a sentence that says where, what was found, what was
//! expected and what to try.

use std::io;
use std::path::{Path, PathBuf};

/// What can go wrong, by who can mend it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file contradicts its own format: cut, damaged, or not what its name says.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What was found, what was expected, what to try.
        message: String,
    },
    /// The file is in order but holds something this crate does not read or write.
    #[error("{}: {message}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found and how to convert it.
        message: String,
    },
    /// The caller asked for something impossible: a place outside the grid, a negative length, …
    #[error("{0}")]
    Usage(String),
    /// Reading or writing failed.
    #[error("{}: {}", path.display(), advice(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// There is no way between start and goal.
    #[error("{0}")]
    NoWay(String),
    /// The work was cancelled through a [`CancelToken`](crate::CancelToken).
    #[error("cancelled; nothing was written")]
    Cancelled,
}

/// What went wrong with a file, and what to do where that is known.
fn advice(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => {
            "there is no such file; check its name and the folder you are in".into()
        }
        io::ErrorKind::IsADirectory => "is a folder; name a file".into(),
        io::ErrorKind::PermissionDenied => {
            "permission denied; check who may read and write it".into()
        }
        _ => source.to_string(),
    }
}

/// `Result` with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A [`Error::Format`] for `path`.
    pub fn format(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Format { path: path.as_ref().to_path_buf(), message: message.into() }
    }

    /// A [`Error::Unsupported`] for `path`.
    pub fn unsupported(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Unsupported { path: path.as_ref().to_path_buf(), message: message.into() }
    }

    /// A [`Error::Usage`].
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    /// A [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source }
    }
}
