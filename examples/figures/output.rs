//! Where the pictures of the examples go.

use std::path::PathBuf;

use ridgeway::Error;

/// Writes a picture into the folder that the first argument names, or `target/figures`; the folder is made if it is missing.
pub(crate) fn save(name: &str, picture: &[u8]) -> Result<(), Error> {
    let folder = std::env::args_os().nth(1).map_or("target/figures".into(), PathBuf::from);
    let path = folder.join(name);
    std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&path, picture))
        .map_err(|source| Error::io(&path, source))?;
    eprintln!("wrote {}", path.display());
    Ok(())
}
