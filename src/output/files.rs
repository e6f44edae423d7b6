//! Files: written whole or not at all.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Makes sure that files can be written into a folder, before any work is done for them.
///
/// # Errors
/// [`Error::Input`] where they cannot.
pub fn open_folder(folder: &Path) -> Result<()> {
    let told = |e: std::io::Error| Error::input(format!("--out {}: cannot be written: {e}", folder.display()));
    if folder.exists() && !folder.is_dir() {
        return Err(Error::input(format!("--out {}: cannot be written: it is a file, and a folder is needed", folder.display())));
    }
    fs::create_dir_all(folder).map_err(told)?;
    let probe = folder.join(format!(".{}.part", std::process::id()));
    fs::write(&probe, []).and_then(|()| fs::remove_file(&probe)).map_err(told)
}

/// Writes a file under a temporary name beside its own, then renames it: whoever looks finds all of it or nothing.
pub fn write_beside(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), String>) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = write_and_close(&part, write).and_then(|()| fs::rename(&part, path).map_err(|error| error.to_string()));
    written.map_err(|error| {
        // It may never have come to be; then there is nothing to remove.
        let _ = fs::remove_file(&part);
        Error::job(format!("{}: cannot be written: {error}", path.display()))
    })
}

fn write_and_close(
    part: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), String>,
) -> std::result::Result<(), String> {
    let mut file = BufWriter::new(File::create(part).map_err(|error| error.to_string())?);
    write(&mut file)?;
    file.flush().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_and_names_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let error = write_beside(&path, |_| Err("disk full".to_string())).unwrap_err();
        assert_eq!(error.to_string(), format!("{}: cannot be written: disk full", path.display()));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_failed_write_keeps_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        fs::write(&path, "old").unwrap();
        write_beside(&path, |_| Err("disk full".to_string())).unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"old");
    }
}
