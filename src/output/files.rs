//! Files: written whole or not at all.

use crate::error::{Error, Result};
use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A folder that files are being written into, by this process alone until it is dropped.
///
/// Where nothing was written into a folder that was not there before, it is gone afterwards.
#[derive(Debug)]
pub struct Folder {
    /// The open folder itself is what is locked: the system lets go of it however the process ends, and no file of ours lies about.
    open: Option<File>,
    /// Folders that were not there before, the outermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Makes sure that files can be written into a folder, before any work is done for them.
    ///
    /// # Errors
    /// [`Error::Input`] where they cannot, or where another process is writing there.
    pub fn open(path: &Path) -> Result<Self> {
        Folder::locked(path, File::try_lock)
    }

    /// Makes sure of it for a folder into which several processes may write, each its own files.
    ///
    /// # Errors
    /// [`Error::Input`] where nobody can write there, or one process does so alone.
    pub fn shared(path: &Path) -> Result<Self> {
        Folder::locked(path, File::try_lock_shared)
    }

    fn locked(path: &Path, lock: fn(&File) -> std::result::Result<(), TryLockError>) -> Result<Self> {
        if path.exists() && !path.is_dir() {
            return Err(cannot(path, "it is a file, and a folder is needed"));
        }
        let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut made: Vec<PathBuf> = path.ancestors().take_while(missing).map(Path::to_owned).collect();
        made.reverse();
        let mut folder = Folder { open: None, made };
        let probe = path.join(format!(".{}.part", std::process::id()));
        let written = fs::create_dir_all(path).and_then(|()| fs::write(&probe, [])).and_then(|()| fs::remove_file(&probe));
        written.map_err(|e| cannot(path, &e.to_string()))?;
        folder.open = File::open(path).ok();
        // Where folders cannot be locked, as on some networks, nobody is kept out.
        match folder.open.as_ref().map(lock) {
            Some(Err(TryLockError::WouldBlock)) => Err(cannot(path, "another process is writing there")),
            _ => Ok(folder),
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder with something in it stays.
        self.made.iter().rev().for_each(|folder| _ = fs::remove_dir(folder));
    }
}

fn cannot(folder: &Path, why: &str) -> Error {
    Error::input(format!("--out {}: cannot be written: {why}", folder.display()))
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
    fn a_folder_is_written_by_one_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Folder::open(folder.path()).unwrap();
        assert!(Folder::open(folder.path()).unwrap_err().to_string().ends_with("another process is writing there"));
        assert!(Folder::shared(folder.path()).is_err());
        drop(first);
        let parts = [Folder::shared(folder.path()).unwrap(), Folder::shared(folder.path()).unwrap()];
        assert!(Folder::open(folder.path()).is_err());
        drop(parts);
        Folder::open(folder.path()).unwrap();
    }

    #[test]
    fn a_new_folder_that_nothing_is_written_into_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        drop(Folder::open(&deep).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let open = Folder::open(&deep).unwrap();
        fs::write(deep.join("c"), "").unwrap();
        drop(open);
        assert!(deep.join("c").exists());
        // One that was there before is none of ours.
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        drop(Folder::open(&empty).unwrap());
        assert!(empty.exists());
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
