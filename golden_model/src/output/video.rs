//! Video: writes consecutive frames as YUV4MPEG2, which ffmpeg, mpv and VLC can read.
//!
//! ```text
//! picture ─► sRGB, over black ─► Y'CbCr, BT.601, limited range ─► three planes of 8 bits, 4:4:4
//! ```
//! BT.601 and limited range are the defaults of readers for files of this kind (ITU-R BT.601-7,
//! §2.5.1 to §2.5.3).

use super::colour::srgb_encode;
use super::files::{Unfinished, behind_links};
use super::picture::Picture;
use crate::error::{Error, Result};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Frames per second of the video, independent of the hardware's.
pub const FRAMES_PER_SECOND: u32 = 30;

/// First bytes of a video.
const MAGIC: &str = "YUV4MPEG2";

/// A video being written: under a temporary name, until it is finished.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    part: Unfinished,
    file: Option<BufWriter<File>>,
}

impl Video {
    /// Checks, before any work is done, that a video can be written to a path: a file that is not a
    /// video is not overwritten.
    ///
    /// # Errors
    /// [`Error::Input`] if the path is a folder, or a file that does not begin like a video.
    pub fn may_be_written(path: &Path) -> Result<()> {
        let input_error =
            |what: String| Err(Error::input(format!("--y4m {}: {what}", path.display())));
        if path.is_dir() {
            return input_error("is a folder, and a file is needed".into());
        }
        if !path.exists() {
            return Ok(());
        }
        if !path.is_file() {
            return input_error("is not a file, and a file is needed".into());
        }
        let mut begins = Vec::new();
        let read = File::open(path)
            .and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut begins));
        if read.is_ok() && (begins.is_empty() || begins == MAGIC.as_bytes()) {
            return Ok(());
        }
        input_error("already exists and is not a video; it is not overwritten".into())
    }

    /// Begins a video whose frames have this size.
    ///
    /// # Errors
    /// [`Error::Input`] if no file can be written there.
    pub fn create(path: &Path, width: usize, height: usize) -> Result<Self> {
        let path = &behind_links(path);
        let input_error = |e: std::io::Error| {
            Error::input(format!("--y4m {}: cannot be written: {e}", path.display()))
        };
        Video::may_be_written(path)?;
        let part = Unfinished::beside(path);
        let file = BufWriter::new(File::create(part.path()).map_err(input_error)?);
        let mut video = Video {
            path: path.to_owned(),
            part,
            file: Some(file),
        };
        let head = format!("{MAGIC} W{width} H{height} F{FRAMES_PER_SECOND}:1 Ip A1:1 C444\n");
        video.write(head.as_bytes()).map(|()| video)
    }

    /// Adds a frame; `encoded` is whether colours are values for a screen instead of linear light.
    ///
    /// # Errors
    /// [`Error::Job`] if it cannot be written.
    pub fn push(&mut self, picture: &Picture, encoded: bool) -> Result<()> {
        let pixels: Vec<[u8; 3]> = picture
            .rgba
            .par_iter()
            .map(|[r, g, b, _]| components([*r, *g, *b], encoded))
            .collect();
        self.write(b"FRAME\n")?;
        for plane in 0..3 {
            let bytes: Vec<u8> = pixels.iter().map(|pixel| pixel[plane]).collect();
            self.write(&bytes)?;
        }
        Ok(())
    }

    /// Finishes the video and renames it.
    ///
    /// # Errors
    /// [`Error::Job`] if it cannot be completed.
    pub fn finish(self) -> Result<()> {
        let Video { path, part, file } = self;
        let done = file.map_or(Ok(()), |mut file| file.flush());
        done.and_then(|()| part.finish(&path))
            .map_err(|e| error(&path, &e))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self
            .file
            .as_mut()
            .map_or(Ok(()), |file| file.write_all(bytes));
        written.map_err(|e| error(&self.path, &e))
    }
}

fn error(path: &Path, e: &std::io::Error) -> Error {
    Error::job(format!("{}: cannot be written: {e}", path.display()))
}

/// Y', Cb and Cr of a colour: premultiplied, and therefore over black.
fn components(rgb: [f64; 3], encoded: bool) -> [u8; 3] {
    let [r, g, b] = rgb
        .map(|value| value.clamp(0.0, 1.0))
        .map(|value| if encoded { value } else { srgb_encode(value) });
    let luma = 0.299 * r + 0.587 * g + 0.114 * b;
    let [y, cb, cr] = [
        16.0 + 219.0 * luma,
        128.0 + 224.0 * (b - luma) / 1.772,
        128.0 + 224.0 * (r - luma) / 1.402,
    ];
    [y, cb, cr].map(|value| value.round() as u8)
}
