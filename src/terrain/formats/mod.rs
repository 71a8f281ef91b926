//! The formats that heights are read from.
//!
//! **A new format** is a file beside this one that holds a [`Format`], and a line in [`FORMATS`].

mod ascii_grid;
mod foreign;
mod geotiff;
mod hgt;
mod tiff;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::raster::Raster;
use crate::error::{Error, Result};

/// All formats, in the order in which a file is offered to them: those that know their own beyond doubt first.
const FORMATS: [Format; 3] = [geotiff::FORMAT, ascii_grid::FORMAT, hgt::FORMAT];

/// A format that is read.
struct Format {
    /// Its name, for people.
    name: &'static str,
    /// Whether the file is of this format beyond doubt.
    is_own: fn(&Head) -> bool,
    /// Lower-case extensions of files that are taken for this format where nothing else is known of them.
    extensions: &'static [&'static str],
    /// Reads a file whose content is given; the path is for messages, for files beside, and where the name tells the place.
    read: fn(&Path, &[u8], ReadMode) -> Result<Raster>,
}

/// What a reader is asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ReadMode {
    /// The first band, which must be heights.
    Heights,
    /// All bands, whatever they are.
    Bands,
}

/// What a format is told by: the beginning of a file and its name.
struct Head<'a> {
    bytes: &'a [u8],
    /// The same as lower-case text, without what may stand before the first word.
    text: String,
    /// The extension in lower case; empty if there is none.
    extension: String,
    /// The extension before the last one: `hgt` of `N42E001.hgt.gz`.
    inner_extension: String,
}

impl<'a> Head<'a> {
    /// Bytes that suffice to tell a format.
    const LENGTH: u64 = 512;

    fn new(path: &Path, bytes: &'a [u8]) -> Self {
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

/// Reads a file of any of the formats.
///
/// # Errors
/// [`Error::Io`]; [`Error::TooLarge`]; what the reader of the format has to say; [`Error::Format`] or
/// [`Error::Unsupported`] for a file of no format that is read.
pub(super) fn read(path: &Path, mode: ReadMode) -> Result<Raster> {
    let io = |e| Error::io(path, e);
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.by_ref().take(Head::LENGTH).read_to_end(&mut bytes).map_err(io)?;
    let format = detect(path, &bytes)?;
    match file.read_to_end(&mut bytes) {
        Ok(_) => (format.read)(path, &bytes, mode),
        Err(e) if e.kind() == io::ErrorKind::OutOfMemory => Err(Error::TooLarge {
            what: format!("the file {}", path.display()),
            bytes: file.metadata().map_or(0, |metadata| metadata.len()),
            limit: None,
        }),
        Err(e) => Err(io(e)),
    }
}

/// The format of a file that begins with `bytes`, or what is wrong with it.
fn detect(path: &Path, bytes: &[u8]) -> Result<&'static Format> {
    if bytes.is_empty() {
        return Err(Error::argument("the file", "empty", "a DEM").in_file(path));
    }
    let head = Head::new(path, bytes);
    foreign::refuse_stand_in(path, &head)?;
    if let Some(format) = FORMATS.iter().find(|format| (format.is_own)(&head)) {
        return Ok(format);
    }
    foreign::refuse_known(path, &head)?;
    let named = |format: &&Format| format.extensions.contains(&head.extension.as_str());
    FORMATS.iter().find(named).ok_or_else(|| {
        let [names @ .., last] = FORMATS.each_ref().map(|format| format.name);
        let first = &bytes[..bytes.len().min(8)];
        Error::argument(
            "the file",
            format!("of no known format: it begins with bytes {first:02x?}"),
            format!("{} or {last}", names.join(", ")),
        )
        .in_file(path)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_content_then_by_extension() {
        let of = |head: &[u8], path: &str| detect(Path::new(path), head).map(|format| format.name);
        assert_eq!(of(b"II*\0abcd", "dem.asc").unwrap(), "GeoTIFF");
        assert_eq!(of(b"\xef\xbb\xbfNCOLS 3\n", "dem.tif").unwrap(), "ESRI ASCII grid");
        assert_eq!(of(b"1 2 3", "dem.asc").unwrap(), "ESRI ASCII grid");
        assert_eq!(of(b"anything", "N42E001.hgt").unwrap(), "SRTM HGT");
        assert_eq!(of(b"\x1f\x8b\x08", "N42E001.hgt.gz").unwrap(), "SRTM HGT");
        for (head, path, word) in [
            (&b""[..], "a.tif", "empty"),
            (b"<!DOCTYPE html><html>", "a.tif", "HTML"),
            (b"version https://git-lfs.github.com/spec/v1", "a.tif", "git lfs pull"),
            (b"\x89PNG\r\n", "a.png", "not read yet"),
            (b"\x89PNG\r\n", "a.asc", "not read yet"),
            (b"DSAA\n", "a.grd", "Surfer"),
            (b"PK\x03\x04", "a.zip", "unpack"),
            (b"1.0 2.0 3.0", "a.xyz", "gdal_translate"),
            (b"\0\0\0\0", "a.tif", "no known format"),
        ] {
            let message = of(head, path).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains(path), "{message}");
        }
    }
}
