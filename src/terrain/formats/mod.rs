//! The formats that heights are read from.
//!
//! **A new format** is a file beside this one that holds a [`Format`], and a line in [`FORMATS`].

mod ascii_grid;
mod auxiliary;
mod foreign;
mod format;
mod geotiff;
mod hgt;
mod tiff;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub(super) use self::format::ReadMode;
use self::format::{Format, Head};
use super::raster::Raster;
use crate::error::{Error, Result};
use crate::memory;

/// All formats, in the order in which they are asked for a file: those that recognise theirs beyond doubt first.
const FORMATS: [Format; 3] = [geotiff::FORMAT, ascii_grid::FORMAT, hgt::FORMAT];

/// Reads a file of any of the formats.
///
/// # Errors
/// [`Error::Io`]; [`Error::TooLarge`]; the errors of the format's reader; [`Error::Format`] or
/// [`Error::Unsupported`] for a file of no format that is read.
pub(super) fn read(path: &Path, mode: ReadMode) -> Result<Raster> {
    let io = |e| Error::io(path, e);
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.by_ref().take(Head::LENGTH).read_to_end(&mut bytes).map_err(io)?;
    let format = detect(path, &bytes)?;
    memory::read_rest(path, &mut file, 1, &mut bytes)?;
    (format.read)(path, &bytes, mode)
}

/// The format of a file that begins with `bytes`, or what is wrong with it.
fn detect(path: &Path, bytes: &[u8]) -> Result<&'static Format> {
    if bytes.is_empty() {
        return Err(Error::argument("the file", "empty", "a DEM").in_file(path));
    }
    let head = Head::new(path, bytes);
    foreign::refuse_failed_download(path, &head)?;
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
    fn formats_are_recognised_by_content_then_by_extension() {
        let of = |head: &[u8], path: &str| detect(Path::new(path), head).map(|format| format.name);
        assert_eq!(of(b"II*\0abcd", "dem.asc").unwrap(), "GeoTIFF");
        assert_eq!(of(b"\xef\xbb\xbfNCOLS 3\n", "dem.tif").unwrap(), "ESRI ASCII grid");
        assert_eq!(of(b"1 2 3", "dem.asc").unwrap(), "ESRI ASCII grid");
        assert_eq!(of(b"anything", "N42E001.hgt").unwrap(), "SRTM HGT");
        assert_eq!(of(b"\x1f\x8b\x08", "N42E001.hgt.gz").unwrap(), "SRTM HGT");
        for (head, path, word) in [
            (&b""[..], "a.tif", "empty"),
            (b"<!DOCTYPE html><html>", "a.tif", "HTML"),
            (b"version https://git-lfs.github.com/spec/v1", "a.tif", "Git LFS"),
            (b"\x89PNG\r\n", "a.png", "not read yet"),
            (b"\x89PNG\r\n", "a.asc", "not read yet"),
            (b"DSAA\n", "a.grd", "Surfer"),
            (b"PK\x03\x04", "a.zip", "unpack"),
            (b"1.0 2.0 3.0", "a.xyz", "convert it"),
            (b"\0\0\0\0", "a.tif", "no known format"),
        ] {
            let message = of(head, path).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains(path), "{message}");
        }
    }
}
