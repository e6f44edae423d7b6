//! Files: written whole or not at all.

use crate::error::{Error, Result, in_order};
use rayon::prelude::*;
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
        let written = fs::create_dir_all(path).and_then(|()| probe(path));
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

/// Whether a file can be put into a folder: puts one there and takes it away.
///
/// # Errors
/// Why not.
pub fn probe(folder: &Path) -> std::io::Result<()> {
    let probe = folder.join(format!(".{}.part", std::process::id()));
    fs::write(&probe, []).and_then(|()| fs::remove_file(&probe))
}

fn cannot(folder: &Path, why: &str) -> Error {
    Error::input(format!("--out {}: cannot be written: {why}", folder.display()))
}

/// Writes a file under a temporary name beside its own, then renames it: whoever looks finds all of it or nothing.
///
/// Behind a link it is the file that the link leads to. What is there and is no file, as a device or a pipe, stays.
///
/// # Errors
/// [`Error::Job`] where it cannot be written, or something is there that is no file.
pub fn write_beside(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), String>) -> Result<()> {
    let path = &behind_links(path);
    if path.exists() && !path.is_file() {
        return Err(Error::job(format!("{}: cannot be written: it is no file", path.display())));
    }
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

/// How a file is written.
pub type Writing<'a> = Box<dyn FnOnce(&Path) -> Result<()> + Send + 'a>;
/// A file that is to be written, and how.
pub type Unwritten<'a> = (PathBuf, Writing<'a>);

/// Writes files side by side; says which, in this order.
///
/// # Errors
/// That of the first which cannot be written; the others are there.
pub fn write_all(files: Vec<Unwritten>) -> Result<Vec<PathBuf>> {
    in_order(files.into_par_iter().map(|(path, write)| write(&path).map(|()| path)))
}

/// Where a link leads to; the path itself where it is none.
pub fn behind_links(path: &Path) -> PathBuf {
    let is_link = fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink());
    if is_link { fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()) } else { path.to_owned() }
}

/// Whether two paths lead to one file that is there.
pub fn are_one(a: &Path, b: &Path) -> bool {
    matches!([a, b].map(fs::canonicalize), [Ok(a), Ok(b)] if a == b)
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
    fn of_several_files_the_first_that_cannot_be_written_is_named_and_the_others_are_there() {
        let folder = tempfile::tempdir().unwrap();
        let put = |text: &'static str| -> Writing<'static> {
            Box::new(move |path: &Path| write_beside(path, |file| file.write_all(text.as_bytes()).map_err(|e| e.to_string())))
        };
        let at = |name: &str| folder.path().join(name);
        let all = || vec![(at("a"), put("1")), (at("b"), put("2"))];
        assert_eq!(write_all(all()).unwrap(), [at("a"), at("b")]);
        let broken = ["none/x", "none/y"].map(|name| (at(name), put("3")));
        let error = write_all(broken.into_iter().chain([(at("c"), put("4"))]).collect()).unwrap_err();
        assert!(error.to_string().contains("none/x"), "{error}");
        assert_eq!(["a", "b", "c"].map(|name| fs::read_to_string(at(name)).unwrap()), ["1", "2", "4"]);
    }

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
