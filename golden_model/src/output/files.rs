//! Files: writes files completely or not at all, and results of several files all or none.

use crate::error::{Error, Result, in_order};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Extension of an unfinished file, after the number of the process that writes it.
const PART: &str = ".splatsim.part";
/// How often a folder is created again after another process removed it.
const TRIES: u32 = 100;

/// A folder into which files are being written, exclusively by this process until it is dropped.
///
/// A folder that was created by [`Folder::open`] and stays empty is removed afterwards. Only a
/// process that holds the lock of a folder removes it.
#[derive(Debug)]
pub struct Folder {
    /// The open folder itself is locked: the system releases the lock when the process ends in any
    /// way, and there is no lock file.
    open: Option<File>,
    /// Created folders, the outermost first.
    made: Vec<PathBuf>,
}

impl Folder {
    /// Checks that files can be written into a folder, before any work is done for them; removes
    /// unfinished files of killed processes.
    ///
    /// # Errors
    /// [`Error::Input`] if they cannot be written, or another process is writing there.
    pub fn open(path: &Path) -> Result<Self> {
        let folder = Folder::locked(path, File::try_lock)?;
        remove_unfinished(path);
        Ok(folder)
    }

    /// The same for a folder into which several processes may write, each its own files.
    ///
    /// # Errors
    /// [`Error::Input`] if the folder is not writable, or one process is writing there exclusively.
    pub fn shared(path: &Path) -> Result<Self> {
        Folder::locked(path, File::try_lock_shared)
    }

    fn locked(
        path: &Path,
        lock: fn(&File) -> std::result::Result<(), TryLockError>,
    ) -> Result<Self> {
        if path.exists() && !path.is_dir() {
            return Err(cannot(path, "it is a file, and a folder is needed"));
        }
        let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut missing = None;
        for _ in 0..TRIES {
            let mut made: Vec<PathBuf> = path
                .ancestors()
                .take_while(is_missing)
                .map(Path::to_owned)
                .collect();
            made.reverse();
            // `made` is filled in after locking. A folder that is dropped before would remove one
            // that another process has locked.
            let mut folder = Folder {
                open: None,
                made: Vec::new(),
            };
            match fs::create_dir_all(path) {
                Ok(()) => missing = None,
                Err(error) if error.kind() == ErrorKind::NotFound && !made.is_empty() => {
                    missing = Some(error);
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                }
                Err(error) => {
                    remove_free(&made);
                    return Err(cannot(path, &error.to_string()));
                }
            }
            folder.open = match File::open(path) {
                Ok(open) => Some(open),
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                // Some network file systems cannot open or lock folders; then other processes are
                // not excluded.
                Err(_) => None,
            };
            if let Some(Err(TryLockError::WouldBlock)) = folder.open.as_ref().map(lock) {
                return Err(cannot(path, "another process is writing there"));
            }
            // The previous holder of the lock may have removed the folder in the meantime.
            if folder.open.as_ref().is_none_or(|open| leads_to(path, open)) {
                folder.made = made;
                return probe(path)
                    .map(|()| folder)
                    .map_err(|error| cannot(path, &error.to_string()));
            }
        }
        let reason = missing.map_or_else(
            || "other processes remove it again and again".into(),
            |error| format!("the folder cannot be made: {error}"),
        );
        Err(cannot(path, &reason))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Other processes that share it continue to write; the last one removes it.
        if let Some(open) = self.open.take() {
            release(&open);
        }
        remove_free(&self.made);
    }
}

/// Releases a lock at once. Closing the file is not enough: a child process has a copy of it from
/// `fork` to `exec`, and would keep the lock.
fn release(open: &File) {
    // If it fails, the lock ends with the last copy.
    let _ = open.unlock();
}

/// Removes folders, the innermost first, that are empty and not locked by another process.
fn remove_free(made: &[PathBuf]) {
    for folder in made.iter().rev() {
        let open = File::open(folder).ok();
        let is_free = open
            .as_ref()
            .is_none_or(|open| !matches!(open.try_lock(), Err(TryLockError::WouldBlock)));
        let is_removed = is_free && fs::remove_dir(folder).is_ok();
        if let Some(open) = open {
            release(&open);
        }
        if !is_removed {
            return;
        }
    }
}

/// Whether a path leads to this open folder, and not to one that was created after its removal.
#[cfg(unix)]
fn leads_to(path: &Path, open: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((fs::metadata(path).map(place), open.metadata().map(place)), (Ok(now), Ok(then)) if now == then)
}

/// On other systems an open folder cannot be removed.
#[cfg(not(unix))]
fn leads_to(_: &Path, _: &File) -> bool {
    true
}

/// Removes unfinished files of ended processes in a folder that this process has locked.
fn remove_unfinished(folder: &Path) {
    let is_left = |name: &str| {
        let process = name
            .strip_suffix(PART)
            .and_then(|name| name.rsplit_once('.'))
            .and_then(|(_, number)| number.parse::<u32>().ok());
        // Files next to a result, such as a video, are written without its lock.
        process.is_some_and(|number| {
            number != std::process::id() && !Path::new(&format!("/proc/{number}")).exists()
        })
    };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_left) {
            remove(&entry.path());
        }
    }
}

/// Removes a file or a whole folder. Errors are ignored.
fn remove(path: &Path) {
    let _ = fs::remove_file(path).or_else(|_| fs::remove_dir_all(path));
}

/// Checks that a file can be put into a folder, by writing and removing one.
///
/// # Errors
/// The reason if it cannot.
pub fn probe(folder: &Path) -> std::io::Result<()> {
    let probe = Unfinished::beside(&folder.join("probe"));
    fs::write(&probe.0, [])
}

fn cannot(folder: &Path, why: &str) -> Error {
    Error::input(format!(
        "--out {}: cannot be written: {why}",
        folder.display()
    ))
}

/// A file or a folder being written under a temporary name. Removed when it is dropped, and when a
/// signal ends the process.
#[derive(Debug)]
pub struct Unfinished(PathBuf);

/// All unfinished files of this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Unfinished {
    /// A temporary name next to the final path; nothing is created yet.
    pub fn beside(path: &Path) -> Self {
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}{PART}", std::process::id()));
        let part = path.with_file_name(name);
        unfinished().insert(part.clone());
        Unfinished(part)
    }

    /// Its temporary path.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Renames it to its final name.
    ///
    /// # Errors
    /// The reason if it cannot be renamed.
    pub fn finish(self, path: &Path) -> std::io::Result<()> {
        fs::rename(&self.0, path)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        // It may never have been created, or may already be renamed; then there is nothing to
        // remove.
        remove(&self.0);
        unfinished().remove(&self.0);
    }
}

/// Makes SIGINT and SIGTERM remove unfinished files before they end the process. To be called by a
/// program's main thread.
pub fn clean_up_on_signals() {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGINT, SIGTERM};
        let wanted: Vec<i32> = [SIGINT, SIGTERM]
            .into_iter()
            .filter(|signal| !is_ignored(*signal))
            .collect();
        let Ok(mut signals) = signal_hook::iterator::Signals::new(wanted) else {
            return;
        };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                // Held until the process ends, so that no other thread begins to write a file.
                let unfinished = unfinished();
                unfinished.iter().for_each(|path| remove(path));
                let _ = signal_hook::low_level::emulate_default_handler(signal);
            }
        });
    }
}

/// Whether a signal was ignored when the process was started, for example by `nohup` or in the
/// background of a script.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Writes a file under a temporary name next to its own, then renames it: readers find the complete
/// file or none.
///
/// A link is followed, and its target is written. A device or a pipe is not replaced.
///
/// # Errors
/// [`Error::Job`] if it cannot be written, or the path is not a regular file.
pub fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), String>,
) -> Result<()> {
    let path = &behind_links(path);
    check_replaceable(path)?;
    let part = Unfinished::beside(path);
    let written = write_and_close(&part.0, write)
        .and_then(|()| part.finish(path).map_err(|error| error.to_string()));
    written.map_err(|error| cannot_be_written(path, &error))
}

/// Writes two files in parallel, each as by [`write_beside`].
///
/// # Errors
/// [`Error::Job`] naming the file that cannot be written.
pub fn write_two_beside(
    [one, other]: [&Path; 2],
    write: impl FnOnce([&mut BufWriter<File>; 2]) -> std::result::Result<(), String>,
) -> Result<()> {
    let mut of_other = None;
    let written = write_beside(one, |one| {
        let written = write_beside(other, |other| write([one, other]));
        written.map_err(|error| of_other.insert(error).to_string())
    });
    of_other.map_or(written, Err)
}

fn check_replaceable(path: &Path) -> Result<()> {
    if path.exists() && !path.is_file() {
        Err(cannot_be_written(path, "it is not a file"))
    } else {
        Ok(())
    }
}

fn cannot_be_written(path: &Path, why: &str) -> Error {
    Error::job(format!("{}: cannot be written: {why}", path.display()))
}

/// Writes the files of one result into a folder: all of them or, if one cannot be written, none. In
/// that case the files of the previous result stay.
///
/// The last file describes the others, for example `report.json`, and is absent while they are
/// replaced. `stale` are files of a previous result that this one does not have. All files are
/// first written into a temporary folder, in parallel, then moved. Returns the paths.
///
/// # Errors
/// [`Error::Job`] naming the first file that cannot be written.
pub fn write_as_one<'a>(
    folder: &Path,
    files: Vec<Unwritten<'a>>,
    stale: &[&str],
) -> Result<Vec<PathBuf>> {
    let finals: Vec<PathBuf> = files.iter().map(|(path, _)| path.clone()).collect();
    finals
        .iter()
        .try_for_each(|path| check_replaceable(&behind_links(path)))?;
    let stage = Unfinished::beside(&folder.join(".files"));
    remove(&stage.0);
    fs::create_dir(&stage.0).map_err(|error| cannot_be_written(folder, &error.to_string()))?;
    let staged = |path: &Path| stage.0.join(path.file_name().unwrap_or_default());
    let files = files
        .into_iter()
        .map(|(path, write)| (staged(&path), write))
        .collect();
    // Error messages contain the final name instead of the temporary one.
    write_all(files).map_err(|error| {
        Error::job(
            error
                .to_string()
                .replace(&*stage.0.to_string_lossy(), &folder.to_string_lossy()),
        )
    })?;
    let (last, others) = finals.split_last().expect("a result has files");
    let exchange = || {
        remove_if_there(last)?;
        others
            .iter()
            .try_for_each(|path| move_to(&staged(path), path))?;
        let is_stale = |path: &PathBuf| !finals.contains(path);
        stale
            .iter()
            .map(|name| folder.join(name))
            .filter(is_stale)
            .try_for_each(|path| remove_if_there(&path))?;
        move_to(&staged(last), last)
    };
    exchange().map(|()| finals.clone()).map_err(|error| {
        let name = last.file_name().unwrap_or_default().to_string_lossy();
        Error::job(format!(
            "{error}; files of two results are in {}, without {name}: write it again",
            folder.display()
        ))
    })
}

fn move_to(from: &Path, to: &Path) -> Result<()> {
    // The target of a link may be on another disk.
    let copy = |file: &mut BufWriter<File>| {
        let copied = File::open(from).and_then(|mut from| std::io::copy(&mut from, file));
        copied.map(drop).map_err(|error| error.to_string())
    };
    fs::rename(from, behind_links(to)).or_else(|_| write_beside(to, copy))
}

/// Removes a file that describes others, before those are replaced.
///
/// # Errors
/// [`Error::Job`] if it exists and cannot be removed.
pub fn remove_if_there(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::job(format!(
            "{}: cannot be removed: {error}",
            path.display()
        ))),
        _ => Ok(()),
    }
}

/// Function that writes a file.
pub type Writing<'a> = Box<dyn FnOnce(&Path) -> Result<()> + Send + 'a>;
/// A file to be written, and its function.
pub type Unwritten<'a> = (PathBuf, Writing<'a>);

/// Writes files in parallel; returns their paths in this order.
///
/// # Errors
/// The error of the first file that cannot be written; the others exist.
pub fn write_all(files: Vec<Unwritten>) -> Result<Vec<PathBuf>> {
    in_order(
        files
            .into_par_iter()
            .map(|(path, write)| write(&path).map(|()| path)),
    )
}

/// The target of a link; the path itself if it is not a link.
pub fn behind_links(path: &Path) -> PathBuf {
    let is_link = fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink());
    if is_link {
        fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
    } else {
        path.to_owned()
    }
}

/// Whether two paths lead to the same existing file.
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
    #[cfg(target_os = "linux")]
    fn a_folder_that_cannot_be_made_is_not_blamed_on_other_processes() {
        let error = Folder::open(Path::new("/proc/splatsim")).unwrap_err();
        let told = error.to_string();
        assert!(
            told.contains("/proc/splatsim") && told.contains("cannot be made"),
            "{told}"
        );
    }

    #[test]
    fn the_first_file_that_cannot_be_written_is_named_and_the_others_exist() {
        let folder = tempfile::tempdir().unwrap();
        let put = |text: &'static str| -> Writing<'static> {
            Box::new(move |path: &Path| {
                write_beside(path, |file| {
                    file.write_all(text.as_bytes()).map_err(|e| e.to_string())
                })
            })
        };
        let at = |name: &str| folder.path().join(name);
        let all = || vec![(at("a"), put("1")), (at("b"), put("2"))];
        assert_eq!(write_all(all()).unwrap(), [at("a"), at("b")]);
        let broken = ["none/x", "none/y"].map(|name| (at(name), put("3")));
        let error =
            write_all(broken.into_iter().chain([(at("c"), put("4"))]).collect()).unwrap_err();
        assert!(error.to_string().contains("none/x"), "{error}");
        assert_eq!(
            ["a", "b", "c"].map(|name| fs::read_to_string(at(name)).unwrap()),
            ["1", "2", "4"]
        );
    }

    #[test]
    fn a_failed_write_leaves_nothing_and_names_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let error = write_beside(&path, |_| Err("disk full".to_string())).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("{}: cannot be written: disk full", path.display())
        );
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // The error names the one of the two that cannot be written.
        let [one, missing] = [folder.path().join("one"), folder.path().join("none/other")];
        let message = |paths: [&Path; 2], error: Option<&str>| {
            let error = write_two_beside(paths, |_| {
                error.map_or(Ok(()), |error| Err(error.to_owned()))
            })
            .unwrap_err()
            .to_string();
            assert_eq!(
                (
                    error.matches("cannot be written").count(),
                    fs::read_dir(folder.path()).unwrap().count()
                ),
                (1, 0),
                "{error}"
            );
            error
        };
        assert!(message([&one, &missing], None).contains("none/other"));
        assert!(message([&missing, &one], None).contains("none/other"));
        assert!(message([&one, &path], Some("disk full")).contains("picture.png"));
    }

    #[test]
    fn a_folder_is_written_by_one_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Folder::open(folder.path()).unwrap();
        assert!(
            Folder::open(folder.path())
                .unwrap_err()
                .to_string()
                .ends_with("another process is writing there")
        );
        assert!(Folder::shared(folder.path()).is_err());
        drop(first);
        let parts = [
            Folder::shared(folder.path()).unwrap(),
            Folder::shared(folder.path()).unwrap(),
        ];
        assert!(Folder::open(folder.path()).is_err());
        drop(parts);
        Folder::open(folder.path()).unwrap();
    }

    #[test]
    fn a_new_folder_without_files_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        drop(Folder::open(&deep).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let open = Folder::open(&deep).unwrap();
        fs::write(deep.join("c"), "").unwrap();
        drop(open);
        assert!(deep.join("c").exists());
        // A folder that existed before stays.
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        drop(Folder::open(&empty).unwrap());
        assert!(empty.exists());
    }

    #[test]
    fn only_a_process_that_holds_a_folder_removes_it() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("new");
        let first = Folder::open(&new).unwrap();
        Folder::open(&new).unwrap_err();
        assert!(new.is_dir(), "the refused one removed it");
        drop(first);
        assert!(!new.exists());
        let [one, other] = [Folder::shared(&new).unwrap(), Folder::shared(&new).unwrap()];
        drop(one);
        assert!(new.is_dir(), "the first of two that share it removed it");
        drop(other);
        // The outer folder is the result of another process that has not written anything yet.
        let inner = Folder::open(&new.join("inner")).unwrap();
        let outer = Folder::open(&new).unwrap();
        drop(inner);
        assert!(new.is_dir());
        drop(outer);
    }

    #[test]
    fn concurrent_processes_never_lose_a_locked_folder() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("a/b");
        let held = std::sync::atomic::AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for turn in 0..200 {
                        let Ok(open) = Folder::open(&new) else {
                            continue;
                        };
                        held.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        let file = new.join("file");
                        fs::write(&file, "").expect("the folder that is held is there");
                        if turn % 2 == 0 {
                            std::thread::yield_now();
                        }
                        fs::remove_file(&file).unwrap();
                        drop(open);
                    }
                });
            }
        });
        assert!(held.into_inner() > 10);
    }

    #[test]
    fn unfinished_files_of_a_killed_process_are_removed_and_other_files_are_not() {
        let folder = tempfile::tempdir().unwrap();
        // No process has such a high number.
        let [left, of_us, others] = [
            format!("a.png.4194999{PART}"),
            format!("b.png.{}{PART}", std::process::id()),
            "c.png.4194999.part".to_owned(),
        ];
        for name in [&left, &of_us, &others] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join(format!(".files.4194999{PART}"))).unwrap();
        drop(Folder::open(folder.path()).unwrap());
        let mut names: Vec<String> = fs::read_dir(folder.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(names, [of_us, others]);
    }

    #[test]
    fn a_result_is_the_old_one_or_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let put = |text: &'static str| -> Writing<'static> {
            Box::new(move |path: &Path| {
                write_beside(path, |file| {
                    file.write_all(text.as_bytes()).map_err(|e| e.to_string())
                })
            })
        };
        let fails = || -> Writing<'static> {
            Box::new(|path: &Path| write_beside(path, |_| Err("disk full".into())))
        };
        let held = || {
            let all =
                ["a", "b", "report"].map(|name| fs::read_to_string(at(name)).unwrap_or_default());
            (all, fs::read_dir(folder.path()).unwrap().count())
        };
        let first = vec![
            (at("a"), put("1")),
            (at("b"), put("2")),
            (at("report"), put("3")),
        ];
        assert_eq!(
            write_as_one(folder.path(), first, &["b"]).unwrap(),
            [at("a"), at("b"), at("report")]
        );
        let old = (["1", "2", "3"].map(String::from), 3);
        assert_eq!(held(), old);
        let broken = vec![
            (at("a"), put("4")),
            (at("b"), fails()),
            (at("report"), put("5")),
        ];
        let error = write_as_one(folder.path(), broken, &[])
            .unwrap_err()
            .to_string();
        assert_eq!(
            (error, held()),
            (
                format!("{}: cannot be written: disk full", at("b").display()),
                old
            )
        );
        // While the files are replaced, no file describes them.
        let second = vec![(at("a"), put("6")), (at("report"), put("7"))];
        write_as_one(folder.path(), second, &["b"]).unwrap();
        assert_eq!(held(), (["6", "", "7"].map(String::from), 2));
        fs::create_dir(at("b")).unwrap();
        let third = vec![
            (at("a"), put("8")),
            (at("b"), put("8")),
            (at("report"), put("8")),
        ];
        assert!(
            write_as_one(folder.path(), third, &[])
                .unwrap_err()
                .to_string()
                .ends_with("it is not a file")
        );
        assert_eq!(held(), (["6", "", "7"].map(String::from), 3));
    }

    /// A child process has copies of all open files from `fork` to `exec`.
    #[test]
    fn a_copy_of_an_open_folder_keeps_no_lock() {
        let outside = tempfile::tempdir().unwrap();
        for path in [outside.path().to_owned(), outside.path().join("made")] {
            let folder = Folder::open(&path).unwrap();
            let _copy = folder.open.as_ref().unwrap().try_clone().unwrap();
            fs::write(path.join("result"), "").unwrap();
            drop(folder);
            Folder::open(&path).unwrap();
        }
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        fs::write(&path, "old").unwrap();
        write_beside(&path, |_| Err("disk full".to_string())).unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"old");
    }
}
