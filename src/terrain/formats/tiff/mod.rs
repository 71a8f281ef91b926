//! The TIFF container: directories of tags, and strips or tiles of samples.
//!
//! ```text
//! container ──▶ directory ──▶ layout ──▶ codec ──▶ predictor ──▶ sample
//! bytes         tags of an    chunks     unpacks    undoes        numbers
//!               image                    a chunk    differences
//! ```
//!
//! Everything is read from one slice of bytes with checked ranges, so a damaged file gives an error and
//! nothing else. The `tiff` crate is not used for reading: it inverts `MinIsWhite` samples, has no notion of
//! sparse (absent) chunks or packed 12-bit samples, misreads planar tiles, and allows 32768 chunks only.
//!
//! References: *TIFF Revision 6.0* (Adobe, 1992); *TIFF Technical Note 3* (floating-point predictor);
//! *The BigTIFF file format* (AWare Systems).

mod codec;
mod container;
mod directory;
mod error;
mod layout;
mod predictor;
mod sample;
pub(super) mod tag;

pub(super) use self::container::{Tiff, is_tiff};
pub(super) use self::directory::Directory;
pub(super) use self::error::{TiffError, TiffResult, damaged, unsupported};
pub(super) use self::layout::Layout;
pub(super) use self::sample::Sample;
