//! Files that are recognised but not read, and what to do with them.

use std::path::Path;

use super::format::Head;
use crate::error::{Error, Remedy, Result};

/// The first bytes of a file, what it is, and what to do with it.
const MAGIC: [(&[u8], &str, Remedy); 13] = [
    (b"\x1f\x8b", "a gzip file", Remedy::Unpack),
    (b"PK\x03\x04", "a zip archive", Remedy::Unpack),
    (b"\x89PNG", "a picture (PNG), not read yet", Remedy::Convert),
    (b"\xff\xd8\xff", "a picture (JPEG), not read yet", Remedy::Convert),
    (b"P5", "a picture (PGM), not read yet", Remedy::Convert),
    (b"DSAA", "a Surfer grid, not read yet", Remedy::Convert),
    (b"DSBB", "a Surfer grid, not read yet", Remedy::Convert),
    (b"DSRB", "a Surfer grid, not read yet", Remedy::Convert),
    (b"\x89HDF", "an HDF5 or netCDF file, which is not read", Remedy::Convert),
    (b"CDF", "a netCDF file, which is not read", Remedy::Convert),
    (b"UHL1", "a DTED file, which is not read", Remedy::Convert),
    (b"Lerc2 ", "a LERC file, which is not read", Remedy::Convert),
    (b"\x93NUMPY", "a NumPy array, not read yet", Remedy::Export),
];

/// Extensions of DEMs that cannot be recognised by their content.
const EXTENSIONS: [&str; 7] = ["flt", "bil", "bip", "bsq", "xyz", "csv", "dem"];

/// Refuses what failed downloads leave: an HTML page, a Git LFS pointer.
pub(super) fn refuse_failed_download(path: &Path, head: &Head) -> Result<()> {
    let begins = |start: &str| head.text.starts_with(start);
    if begins("<!doctype html") || begins("<html") {
        let page = Error::argument("the file", "an HTML page", "a DEM");
        return Err(page.advise("the download went wrong: fetch the file again").in_file(path));
    }
    if begins("version https://git-lfs") {
        let pointer = Error::argument("the file", "a Git LFS pointer", "the DEM itself");
        return Err(pointer.advise(Remedy::FetchFromLfs).in_file(path));
    }
    Ok(())
}

/// Refuses files of formats that are known but not read.
pub(super) fn refuse_known(path: &Path, head: &Head) -> Result<()> {
    if let Some((_, found, remedy)) = MAGIC.iter().find(|(magic, ..)| head.bytes.starts_with(magic))
    {
        return Err(Error::unsupported(path, *found, *remedy));
    }
    if EXTENSIONS.contains(&head.extension.as_str()) {
        let found = format!("a .{} file, not read yet", head.extension);
        return Err(Error::unsupported(path, found, Remedy::Convert));
    }
    Ok(())
}
