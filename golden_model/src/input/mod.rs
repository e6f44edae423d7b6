//! Input: opens every file that a user names, and reads it within limits of bytes and of time.
//!
//! Files are read completely if memory has room for them. From pipes, for example of `<(command)`
//! in a shell, a limited number of bytes is read. Devices are refused, because they need not end.

pub mod memory;

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Greatest number of bytes of a pipe.
const MOST_OF_A_PIPE: u64 = 256 << 20;
/// Time limit for a process to open a pipe for writing.
const NO_WRITER: Duration = Duration::from_secs(5);
/// Time limit for a pipe to deliver a byte.
const NO_BYTES: Duration = Duration::from_secs(60);
/// Bytes per read of a pipe.
const CHUNK: usize = 64 << 10;

/// Opens a file or a pipe.
///
/// # Errors
/// The reason, for the end of a sentence, if it cannot be read, is a folder or a device, or is a
/// pipe that no process writes to.
pub fn open(path: &Path) -> Result<File> {
    let metadata = std::fs::metadata(path)?;
    match () {
        () if metadata.is_file() => File::open(path),
        () if metadata.is_dir() => refuse("it is a folder, and a file is needed"),
        () if is_pipe(&metadata) => open_pipe(path),
        () => refuse("it is a device or a socket, and a file is needed"),
    }
}

/// All bytes of a file or a pipe.
///
/// # Errors
/// As [`open`]; also if memory has no room for it, or a pipe exceeds the limit.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let file = open(path)?;
    let metadata = file.metadata()?;
    if is_pipe(&metadata) {
        return read_pipe(file);
    }
    // Some files of the system report a length of 0 but have contents.
    let most = if metadata.len() == 0 {
        MOST_OF_A_PIPE
    } else {
        metadata.len()
    };
    memory::check(metadata.len()).map_err(Error::other)?;
    let mut bytes = Vec::new();
    let too_many = |_| {
        Error::other(format!(
            "memory has no room for its {} bytes",
            metadata.len()
        ))
    };
    bytes
        .try_reserve_exact(metadata.len() as usize)
        .map_err(too_many)?;
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        refuse("it grows while it is read")
    } else {
        Ok(bytes)
    }
}

/// The text of a file or a pipe, without a byte-order mark: UTF-8, or UTF-16 if a mark declares it.
///
/// # Errors
/// As [`read`]; also if it is neither.
pub fn read_text(path: &Path) -> Result<String> {
    let bytes = read(path)?;
    let wide = |order: fn([u8; 2]) -> u16, bytes: &[u8]| match bytes.as_chunks::<2>() {
        (words, []) => {
            String::from_utf16(&words.iter().map(|word| order(*word)).collect::<Vec<_>>()).ok()
        }
        _ => None,
    };
    let text = match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => wide(u16::from_le_bytes, rest),
        [0xfe, 0xff, rest @ ..] => wide(u16::from_be_bytes, rest),
        _ => String::from_utf8(bytes)
            .ok()
            .map(|text| without_mark(&text).to_owned()),
    };
    text.ok_or_else(|| Error::new(ErrorKind::InvalidData, "it is not UTF-8 text"))
}

/// A text without the byte-order mark at its start.
pub fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

fn refuse<T>(why: &str) -> Result<T> {
    Err(Error::other(why))
}

#[cfg(unix)]
fn is_pipe(metadata: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    metadata.file_type().is_fifo()
}

#[cfg(not(unix))]
fn is_pipe(_: &std::fs::Metadata) -> bool {
    false
}

/// Opening a pipe blocks until a process opens it for writing. After a timeout the thread stays
/// blocked until this process ends.
fn open_pipe(path: &Path) -> Result<File> {
    let (sender, receiver) = mpsc::sync_channel(1);
    let path = path.to_owned();
    std::thread::spawn(move || sender.send(File::open(path)));
    receiver.recv_timeout(NO_WRITER).unwrap_or_else(|_| {
        refuse(&format!(
            "it is a pipe that no process has opened for writing within {NO_WRITER:?}"
        ))
    })
}

fn read_pipe(mut file: File) -> Result<Vec<u8>> {
    let (sender, receiver) = mpsc::sync_channel(4);
    std::thread::spawn(move || {
        loop {
            let mut chunk = vec![0; CHUNK];
            let read = file.read(&mut chunk).map(|read| {
                chunk.truncate(read);
                chunk
            });
            let is_last = read.as_ref().map_or(true, Vec::is_empty);
            if sender.send(read).is_err() || is_last {
                break;
            }
        }
    });
    let mut bytes = Vec::new();
    loop {
        match receiver.recv_timeout(NO_BYTES) {
            Ok(Ok(chunk)) if chunk.is_empty() => return Ok(bytes),
            Ok(Ok(chunk)) => bytes.extend(chunk),
            Ok(Err(error)) => return Err(error),
            Err(RecvTimeoutError::Disconnected) => {
                return refuse("the thread that reads it has ended");
            }
            Err(RecvTimeoutError::Timeout) => {
                return refuse(&format!("it is a pipe without data for {NO_BYTES:?}"));
            }
        }
        if bytes.len() as u64 > MOST_OF_A_PIPE {
            return refuse(&format!(
                "it is a pipe of more than {} MB; a file may be larger",
                MOST_OF_A_PIPE >> 20
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_completely_and_other_paths_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "some text").unwrap();
        assert_eq!(read_text(&path).unwrap(), "some text");
        std::fs::write(&path, [0xff]).unwrap();
        assert_eq!(read(&path).unwrap(), [0xff]);
        assert!(read_text(&path).unwrap_err().to_string().contains("UTF-8"));
        assert!(
            read(folder.path())
                .unwrap_err()
                .to_string()
                .contains("it is a folder")
        );
        assert_eq!(
            read(&folder.path().join("none")).unwrap_err().kind(),
            ErrorKind::NotFound
        );
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_without_an_end_are_refused_and_pipes_with_one_are_read() {
        assert!(
            read(Path::new("/dev/zero"))
                .unwrap_err()
                .to_string()
                .contains("it is a device")
        );
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let start = std::time::Instant::now();
        assert!(
            read(&pipe)
                .unwrap_err()
                .to_string()
                .contains("no process has opened for writing")
        );
        assert!(start.elapsed() < 4 * NO_WRITER, "{:?}", start.elapsed());
        let other = folder.path().join("other");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&other)
                .status()
                .unwrap()
                .success()
        );
        std::thread::scope(|scope| {
            scope.spawn(|| std::fs::write(&other, vec![7; 200_000]).unwrap());
            assert_eq!(read(&other).unwrap(), vec![7; 200_000]);
        });
        let endless = folder.path().join("endless");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&endless)
                .status()
                .unwrap()
                .success()
        );
        let writes = |path: &Path| {
            let mut to = std::fs::OpenOptions::new().write(true).open(path).unwrap();
            while std::io::Write::write_all(&mut to, &[0; CHUNK]).is_ok() {}
        };
        std::thread::scope(|scope| {
            scope.spawn(|| writes(&endless));
            assert!(
                read(&endless)
                    .unwrap_err()
                    .to_string()
                    .contains("a pipe of more than 256 MB")
            );
        });
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_memory_has_no_room_for_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        // The file is sparse and needs no space on the disk.
        std::fs::File::create(&path)
            .unwrap()
            .set_len(1 << 42)
            .unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(
            message.contains("4398.0 GB") && message.contains("free"),
            "{message}"
        );
    }
}
