//! What a format is, and what it is recognised by.

use std::path::Path;

use crate::error::Result;
use crate::terrain::raster::Raster;

/// A format that is read.
pub(super) struct Format {
    /// Its name, for people.
    pub(super) name: &'static str,
    /// Whether the file is of this format beyond doubt.
    pub(super) is_own: fn(&Head) -> bool,
    /// Lower-case extensions of files that are taken for this format where nothing else is known of them.
    pub(super) extensions: &'static [&'static str],
    /// Reads a file whose content is given; the path serves messages, files beside it, and formats whose
    /// file names give the place.
    pub(super) read: fn(&Path, &[u8], ReadMode) -> Result<Raster>,
}

/// What a reader is asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReadMode {
    /// The first band, which must be heights.
    Heights,
    /// All bands, whatever they are.
    Bands,
}

/// What a format is recognised by: the beginning of a file and its name.
pub(super) struct Head<'a> {
    /// The first [`LENGTH`](Self::LENGTH) bytes, or all if there are fewer.
    pub(super) bytes: &'a [u8],
    /// The same as lower-case text, without what may stand before the first word.
    pub(super) text: String,
    /// The extension in lower case; empty if there is none.
    pub(super) extension: String,
    /// The extension before the last one: `hgt` of `N42E001.hgt.gz`.
    pub(super) inner_extension: String,
}

impl<'a> Head<'a> {
    /// Bytes that suffice to recognise a format.
    pub(super) const LENGTH: u64 = 512;

    pub(super) fn new(path: &Path, bytes: &'a [u8]) -> Self {
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_start_matches('\u{feff}').trim_start().to_ascii_lowercase();
        let inner = path.file_stem().map(Path::new);
        Self {
            bytes,
            text,
            extension: extension(path),
            inner_extension: inner.map(extension).unwrap_or_default(),
        }
    }
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}
