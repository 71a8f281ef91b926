//! Files that appear whole or not at all: written in the same folder under another name, brought to the disk, then renamed.
//!
//! While its process lives, what is unfinished is locked. What a killed process left behind is not, and whoever writes into that
//! folder next removes it.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::{NamedTempFile, TempDir};

use crate::error::{Error, Result};

/// Where [`write_file`] lets its caller write; it can seek too.
type Output = BufWriter<NamedTempFile>;

/// What names of unfinished files and folders begin and end with.
const PREFIX: &str = ".ridgeway-";
const SUFFIX: &str = ".unfinished";

/// Whether `path` may be written: call it before long work.
///
/// # Errors
/// [`Error::Argument`] if the parent folder is missing or something other than a file is in the way; [`Error::Io`] of kind
/// [`AlreadyExists`](io::ErrorKind::AlreadyExists) if the file exists and `overwrite` is false.
pub fn check_free(path: impl AsRef<Path>, overwrite: bool) -> Result<()> {
    let path = path.as_ref();
    let parent = parent(path);
    if !parent.is_dir() {
        return Err(Error::argument(
            format!("the folder {}", parent.display()),
            "missing",
            format!("there before {} is written", path.display()),
        )
        .advise("create it first"));
    }
    if !path.exists() {
        Ok(())
    } else if !path.is_file() {
        Err(Error::argument(path.display().to_string(), "no regular file", "one, or missing")
            .advise("give another name"))
    } else if !overwrite {
        Err(Error::io(path, io::ErrorKind::AlreadyExists.into()))
    } else {
        Ok(())
    }
}

/// Whether files of these `names` may be written into `folder`, which may be missing but whose parent
/// may not: call it before long work.
///
/// # Errors
/// As [`check_free`] for each file; [`Error::Argument`] if `folder` is a file.
pub fn check_folder_free(folder: impl AsRef<Path>, names: &[&str], overwrite: bool) -> Result<()> {
    let folder = folder.as_ref();
    if folder.is_dir() {
        names.iter().try_for_each(|name| check_free(folder.join(name), overwrite))
    } else if folder.exists() {
        Err(Error::argument(folder.display().to_string(), "a file", "a folder"))
    } else {
        check_free(folder, overwrite)
    }
}

/// Writes the file `path` by `write`. Readers see the old content or the new one, never a part:
/// the content goes to a temporary file in the same folder, which is brought to the disk and renamed at the end, and removed
/// if anything fails.
///
/// # Errors
/// Those of [`check_free`]; [`Error::Io`] with `path` if `write` fails or the disk does.
pub fn write_file(
    path: impl AsRef<Path>,
    overwrite: bool,
    write: impl FnOnce(&mut Output) -> io::Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    check_free(path, overwrite)?;
    // A link is followed, so that its target is replaced and not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    write_and_rename(&target, overwrite, write).map_err(|e| Error::io(path, e))
}

/// Writes a temporary file in the folder of `target` and renames it.
fn write_and_rename(
    target: &Path,
    overwrite: bool,
    write: impl FnOnce(&mut Output) -> io::Result<()>,
) -> io::Result<()> {
    let folder = parent(target);
    remove_abandoned(folder);
    let mut out = BufWriter::new(temporary_file(folder)?);
    write(&mut out)?;
    out.flush()?;
    let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    if overwrite { file.persist(target) } else { file.persist_noclobber(target) }
        .map_err(|e| e.error)?;
    sync_folder(folder);
    Ok(())
}

/// Fills the folder `path` by `fill`, which is given an empty temporary folder: next to it, and renamed into
/// place when `fill` has succeeded; or, if a folder is already there, inside it (its parent may be closed to
/// us or on another disk), whose files are then moved up, and files of other names stay as they are.
///
/// # Errors
/// Those of [`check_folder_free`]; also if a file to be placed exists and `overwrite` is false (nothing is changed then); those of `fill`; [`Error::Io`].
pub fn write_folder(
    path: impl AsRef<Path>,
    overwrite: bool,
    fill: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    check_folder_free(path, &[], overwrite)?;
    let exists = path.is_dir();
    let around = if exists { path } else { parent(path) };
    remove_abandoned(around);
    let (temporary, _lock) = temporary_folder(around).map_err(|e| Error::io(path, e))?;
    fill(temporary.path())?;
    sync_files(temporary.path()).map_err(|e| Error::io(path, e))?;
    if exists {
        move_files(temporary.path(), path, overwrite)?;
    } else {
        fs::rename(temporary.path(), path).map_err(|e| Error::io(path, e))?;
    }
    sync_folder(around);
    Ok(())
}

/// Moves the files of `from` into `to`, after checking that each may go there.
fn move_files(from: &Path, to: &Path, overwrite: bool) -> Result<()> {
    let names = fs::read_dir(from)
        .and_then(|entries| entries.map(|e| Ok(e?.file_name())).collect::<io::Result<Vec<_>>>())
        .map_err(|e| Error::io(from, e))?;
    for name in &names {
        check_free(to.join(name), overwrite)?;
    }
    for name in &names {
        fs::rename(from.join(name), to.join(name)).map_err(|e| Error::io(to.join(name), e))?;
    }
    Ok(())
}

/// The folder that holds `path`.
fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A locked temporary file with the permissions an ordinary new file has (a temporary file is private
/// otherwise, and stays so when renamed).
fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let file = builder.tempfile_in(folder)?;
        // Some file systems have no locks: nobody removes anything there.
        let _ = file.as_file().lock();
        // Else it was taken for abandoned before it was locked.
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// A temporary folder, and what locks it, where the system can lock folders.
fn temporary_folder(folder: &Path) -> io::Result<(TempDir, Option<File>)> {
    loop {
        let temporary =
            tempfile::Builder::new().prefix(PREFIX).suffix(SUFFIX).tempdir_in(folder)?;
        let lock = File::open(temporary.path()).ok().filter(|lock| lock.lock().is_ok());
        if temporary.path().exists() {
            return Ok((temporary, lock));
        }
    }
}

/// Removes unfinished files and folders whose processes have ended. What cannot be removed, or not be locked, stays.
fn remove_abandoned(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if !(name.starts_with(PREFIX) && name.ends_with(SUFFIX)) {
            continue;
        }
        let path = entry.path();
        let Ok(lock) = File::open(&path) else { continue };
        if lock.try_lock().is_ok() {
            let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
    }
}

/// Brings the files of a folder to the disk.
fn sync_files(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        // Windows syncs what is open for writing only.
        File::options().append(true).open(entry?.path())?.sync_all()?;
    }
    Ok(())
}

/// Brings the names of a folder to the disk, where the system can; the files are there already.
fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn entries(folder: &Path) -> Vec<PathBuf> {
        let mut all: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into()).collect();
        all.sort();
        all
    }

    #[test]
    fn a_file_is_replaced_only_on_request() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_file(&path, false, |out| out.write_all(b"one")).unwrap();
        let error = write_file(&path, false, |out| out.write_all(b"two")).unwrap_err();
        assert!(error.to_string().ends_with("a.txt: exists"));
        assert_eq!(fs::read(&path).unwrap(), b"one");
        write_file(&path, true, |out| out.write_all(b"two")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_file(&path, false, |out| out.write_all(b"one")).unwrap();
        let failed = write_file(&path, true, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("a.txt: disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"one");
        assert_eq!(entries(folder.path()), [PathBuf::from("a.txt")]);
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_what_is_locked_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (file, (out, _lock)) =
            (temporary_file(folder.path()).unwrap(), temporary_folder(folder.path()).unwrap());
        fs::write(folder.path().join(".ridgeway-abc.unfinished"), "half").unwrap();
        fs::create_dir(folder.path().join(".ridgeway-def.unfinished")).unwrap();
        fs::write(folder.path().join(".ridgeway-def.unfinished/map.png"), "half").unwrap();
        fs::write(folder.path().join(".ridgeway-config"), "mine").unwrap();
        write_file(folder.path().join("a.txt"), false, |out| out.write_all(b"one")).unwrap();
        let mut left = [".ridgeway-config", "a.txt"].map(PathBuf::from).to_vec();
        left.extend([file.path(), out.path()].map(|path| path.file_name().unwrap().into()));
        left.sort();
        assert_eq!(entries(folder.path()), left);
    }

    #[test]
    fn a_missing_folder_and_a_folder_in_the_way_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = write_file(folder.path().join("no/a.txt"), false, |_| Ok(())).unwrap_err();
        assert!(missing.to_string().contains("is missing; it must be there before"), "{missing}");
        let taken = write_file(folder.path(), true, |_| Ok(())).unwrap_err();
        assert!(taken.to_string().contains("is no regular file"), "{taken}");
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_the_file_as_the_umask_says() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("plain"), "").unwrap();
        write_file(folder.path().join("ours"), false, |_| Ok(())).unwrap();
        let mode = |name| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("ours"), mode("plain"));
    }

    #[test]
    fn a_folder_keeps_foreign_files_and_is_all_or_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let fill = |text: &'static str| {
            move |dir: &Path| -> Result<()> {
                fs::write(dir.join("b.txt"), text).unwrap();
                fs::write(dir.join("c.txt"), text).unwrap();
                Ok(())
            }
        };
        write_folder(&out, false, fill("one")).unwrap();
        fs::write(out.join("foreign"), "mine").unwrap();
        fs::remove_file(out.join("c.txt")).unwrap();
        assert!(check_folder_free(&out, &["c.txt"], false).is_ok());
        assert!(check_folder_free(&out, &["b.txt", "c.txt"], false).is_err());
        assert!(check_folder_free(out.join("b.txt"), &[], true).is_err());
        assert!(write_folder(&out, false, fill("two")).is_err());
        assert_eq!(entries(&out), [PathBuf::from("b.txt"), PathBuf::from("foreign")]);
        assert!(write_folder(&out, true, |_| Err(Error::Cancelled)).is_err());
        write_folder(&out, true, fill("two")).unwrap();
        assert_eq!(fs::read(out.join("c.txt")).unwrap(), b"two");
        assert_eq!(fs::read(out.join("foreign")).unwrap(), b"mine");
        assert_eq!(entries(folder.path()), [PathBuf::from("out")]);
    }
}
