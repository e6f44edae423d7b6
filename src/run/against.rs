//! Against: compares golden and fixed with photographs of the same views: `run --against`
//! (docs/book/photographs.md).
//!
//! ```text
//! IMAGE or DIR ─► matching: one picture per frame ─► photograph: code values over the background ─┐
//! golden, fixed ─► code values with as many bits ─────────────────────────────────────────────────┴─► PSNR, SSIM, FLIP
//! ```
//! Every photograph is decoded before the first frame is drawn, so a run starts only if all
//! photographs can be compared.

mod matching;
mod photograph;
mod report;

pub use report::{Against, Loss, Means};

use crate::error::{Error, Result, in_order};
use crate::input;
use crate::output::colour::srgb_encode;
use crate::output::picture::Picture;
use crate::output::text::listed;
use crate::scene::{Image, Sequence};
use matching::{MatchedFiles, matched};
use photograph::Photograph;
use rayon::prelude::*;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The photographs of a run: one per drawn frame.
#[derive(Clone, Debug)]
pub struct Photographs {
    /// By frame; none for a frame that is not drawn.
    files: Vec<Option<PathBuf>>,
    /// The photograph, if there is only one: a pipe can be read only once.
    kept: Option<Photograph>,
    notes: Vec<String>,
    view: FrameView,
}

/// Properties that all pictures of a run share.
#[derive(Clone, Copy, Debug)]
struct FrameView {
    width: usize,
    height: usize,
    /// Code values behind a transparent pixel.
    background: [f64; 3],
    /// As in [`Image::encoded`].
    encoded: bool,
}

impl FrameView {
    /// A background that is not opaque is composited over black.
    fn new(image: &Image) -> Self {
        let [r, g, b, alpha] = image.background;
        let code = |value: f64| {
            alpha
                * if image.encoded {
                    value
                } else {
                    srgb_encode(value)
                }
        };
        FrameView {
            width: image.width,
            height: image.height,
            background: [r, g, b].map(code),
            encoded: image.encoded,
        }
    }
}

impl Photographs {
    /// Finds the photograph of each frame, or of the `only` one, and checks that it can be
    /// compared.
    ///
    /// # Errors
    /// [`Error::Input`] if a frame has no photograph, or a photograph cannot be read or has a
    /// different size than the frame.
    pub fn open(path: &Path, sequence: &Sequence, only: Option<usize>) -> Result<Self> {
        let MatchedFiles { files, mut notes } = matched(path, sequence, only)?;
        let view = FrameView::new(&sequence.scene().image);
        let wanted: Vec<(usize, &PathBuf)> = files
            .iter()
            .enumerate()
            .filter_map(|(frame, file)| Some((frame, file.as_ref()?)))
            .collect();
        let whose = |frame: usize| {
            if sequence.is_sequence() {
                format!("frame {frame}")
            } else {
                "the scene".into()
            }
        };
        let read = |(frame, file): &(usize, &PathBuf)| view.read(file, &whose(*frame));
        let mut kept = None;
        let all = match wanted.as_slice() {
            [one] => {
                let one = kept.insert(read(one)?);
                vec![(one.name.clone(), one.is_transparent, one.orientation)]
            }
            many => {
                let seen = many.par_iter().map(|one| {
                    read(one).map(|read| (read.name, read.is_transparent, read.orientation))
                });
                in_order(seen)?
            }
        };
        let transparent: Vec<String> = all
            .iter()
            .filter(|(_, is_transparent, _)| *is_transparent)
            .map(|(name, ..)| name.clone())
            .collect();
        if !transparent.is_empty() {
            let [r, g, b] = view.background.map(|code| (255.0 * code).round());
            let names = listed(&transparent);
            notes.push(format!("photographs: transparent pixels are over the scene's background, {r} {g} {b} of 255, in {names}"));
        }
        let turned: Vec<String> = all
            .into_iter()
            .filter_map(|(name, _, turn)| turn.map(|turn| format!("{name} ({turn})")))
            .collect();
        if !turned.is_empty() {
            let names = listed(&turned);
            notes.push(format!("photographs: compared as stored, although their Exif data specify a rotation: {names}"));
        }
        Ok(Photographs {
            files,
            kept,
            notes,
            view,
        })
    }

    /// How photographs were matched with frames, and how they were read, for the summary.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Compares the pictures of a frame with its photograph.
    ///
    /// # Errors
    /// [`Error::Input`] if the photograph's file has changed.
    ///
    /// # Panics
    /// If the frame is not one of those that [`Photographs::open`] matched.
    pub fn compare(&self, frame: usize, golden: &Picture, fixed: &Picture) -> Result<Against> {
        let photograph = match &self.kept {
            Some(kept) => Cow::Borrowed(kept),
            None => {
                let file = self.files[frame]
                    .as_ref()
                    .expect("frames that are drawn have a photograph");
                Cow::Owned(self.view.read(file, &format!("frame {frame}"))?)
            }
        };
        Ok(Against::new(&photograph, golden, fixed, self.view.encoded))
    }
}

impl FrameView {
    fn read(&self, file: &Path, whose: &str) -> Result<Photograph> {
        let input_error =
            |what: String| Error::input(format!("--against {}: {what}", file.display()));
        let bytes =
            input::read(file).map_err(|error| input_error(format!("cannot be read: {error}")))?;
        let name = file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Photograph::decode(&bytes, name, self, whose).map_err(input_error)
    }
}
