//! Output files, checked before the work starts.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use ridgeway::Error;
use ridgeway::export::{
    Band, Samples, check_folder_free, check_free, write_file, write_folder, write_geotiff,
};
use ridgeway::terrain::Georeference;

use crate::failure::{Failure, Result};

/// The extension of an output in lower case, which picks its format, after checks that the file can
/// be written once the work is done.
///
/// # Errors
/// An extension that is not in `known`; the file exists and may not be replaced, or is the input; the
/// folder is missing or not writable.
pub(crate) fn check_file(
    path: &Path,
    known: &[&str],
    overwrite: bool,
    input: Option<&Path>,
) -> Result<String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let Some(extension) = extension.filter(|e| known.contains(&e.as_str())) else {
        let known: Vec<_> = known.iter().map(|e| format!(".{e}")).collect();
        return Err(Failure::usage(format!(
            "{}: cannot tell the format from the name; end it in {}",
            path.display(),
            known.join(", ")
        )));
    };
    if input.is_some_and(|input| same_file(path, input)) {
        return Err(Failure::usage(format!(
            "{}: is the DEM itself; choose another name for the output",
            path.display()
        )));
    }
    check_free(path, overwrite)?;
    check_writable(folder_of(path))?;
    Ok(extension)
}

/// Checks that the folder `path` can be filled with files of these `names`.
///
/// # Errors
/// It is a file; one of the files exists and may not be replaced; the place is missing or not writable.
pub(crate) fn check_outputs_in(path: &Path, names: &[&str], overwrite: bool) -> Result<()> {
    check_folder_free(path, names, overwrite)?;
    Ok(check_writable(if path.is_dir() { path } else { folder_of(path) })?)
}

/// Refuses to name one output twice.
pub(crate) fn check_distinct(paths: &[&PathBuf]) -> Result<()> {
    for (i, path) in paths.iter().enumerate() {
        if paths[..i].contains(path) {
            return Err(Failure::usage(format!("{}: named twice as an output", path.display())));
        }
    }
    Ok(())
}

/// Checks that files can be made in a folder, by making one without a name.
fn check_writable(folder: &Path) -> ridgeway::Result<()> {
    tempfile::tempfile_in(folder).map(drop).map_err(|source| Error::io(folder, source))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Writes bands, each with what it holds and its unit, on the grid of the DEM.
///
/// # Errors
/// The disk's.
pub(crate) fn write_raster(
    path: &Path,
    overwrite: bool,
    georeference: &Georeference,
    bands: &[(String, Samples<'_>)],
) -> ridgeway::Result<()> {
    let bands: Vec<_> = bands
        .iter()
        .map(|(description, samples)| Band { description, samples: *samples })
        .collect();
    let (frame, crs) = (georeference.frame(), georeference.crs());
    write_file(path, overwrite, |out| write_geotiff(out, frame, crs, &bands))
}

/// Writes a file whose content is ready.
///
/// # Errors
/// The disk's.
pub(crate) fn write_content(path: &Path, overwrite: bool, content: &[u8]) -> ridgeway::Result<()> {
    write_file(path, overwrite, |out| out.write_all(content))
}

/// Fills a folder with files whose content is ready, with all or none.
///
/// # Errors
/// The disk's.
pub(crate) fn write_contents(
    folder: &Path,
    overwrite: bool,
    names: &[&str],
    contents: &[Vec<u8>],
) -> ridgeway::Result<()> {
    write_folder(folder, overwrite, |temporary| {
        names.iter().zip(contents).try_for_each(|(name, content)| {
            fs::write(temporary.join(name), content)
                .map_err(|source| Error::io(folder.join(name), source))
        })
    })
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}
