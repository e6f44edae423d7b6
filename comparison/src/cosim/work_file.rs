//! Work file: the bytes of a frame's work, as `run --record` writes them.
//!
//! ```text
//! "splatsim-work-5\n", scene's name, machine, events
//! "splatsim-work-6\n", the same, and the keys of sorted splats, where buckets depend on them
//! "splatsim-work-7\n", the same, and the words of splats, where tests of tiles depend on them
//! "splatsim-work-8\n", the same, and the masks of blocks, where blocks are tested
//! "splatsim-work-9\n", the same, and the lists of tiles, where they are kept from frame to frame
//! ```
//! What a version adds may be empty in the next one.
//!
//! Laws (tests/recording.rs): `a_record_that_is_read_is_the_one_that_was_written`,
//! `no_damage_is_taken_for_a_record`.

use rtl_model::work::Work;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufWriter, Write};

/// Beginnings of a file.
const MAGICS: [&[u8]; 5] = [
    b"splatsim-work-5\n",
    b"splatsim-work-6\n",
    b"splatsim-work-7\n",
    b"splatsim-work-8\n",
    b"splatsim-work-9\n",
];
/// Indices of the versions that add something.
const KEYS: usize = 1;
const TESTED: usize = 2;
const MASKS: usize = 3;
const LISTS: usize = 4;

/// Length of the beginning of a file.
pub const HEAD: usize = MAGICS[0].len();

/// Contents of the file.
#[derive(Serialize, Deserialize)]
pub struct WorkFile {
    /// The scene's name.
    pub scene: String,
    /// The machine that drew it, in JSON.
    pub machine: String,
    /// Events of the frame.
    pub work: Work,
}

/// Whether a file that begins with these [`HEAD`] bytes is of this kind.
pub fn is_head(bytes: &[u8]) -> bool {
    MAGICS.contains(&bytes)
}

impl WorkFile {
    /// Writes the file.
    ///
    /// # Errors
    /// A sentence if it cannot be written.
    pub fn write(&self, file: &mut BufWriter<File>) -> Result<(), String> {
        let work = &self.work;
        let masks = work.masks();
        let version = match () {
            () if work.lists.is_some() => LISTS,
            () if !masks.is_empty() => MASKS,
            () if !work.tested.is_empty() => TESTED,
            () if !work.keys.is_empty() => KEYS,
            () => 0,
        };
        file.write_all(MAGICS[version])
            .map_err(|error| error.to_string())?;
        append(file, self)?;
        if version >= KEYS {
            append(file, &work.keys)?;
        }
        if version >= TESTED {
            append(file, &(&work.tested, work.cutoff))?;
        }
        if version >= MASKS {
            append(file, &masks)?;
        }
        if version >= LISTS {
            append(file, &work.lists)?;
        }
        Ok(())
    }

    /// Reads the bytes of a file. The events are not checked ([`Work::check`]).
    ///
    /// # Errors
    /// The rest of a sentence that begins with the name of the file.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let (version, mut rest) = (MAGICS.iter().enumerate())
            .find_map(|(version, magic)| Some((version, bytes.strip_prefix(*magic)?)))
            .ok_or("is not a record of a frame's work, as `run --record` writes it")?;
        let mut file: WorkFile =
            next(&mut rest).ok_or_else(|| damaged("it is truncated or has invalid values"))?;
        let work = &mut file.work;
        if version >= KEYS {
            work.keys = next(&mut rest).ok_or_else(|| damaged("its keys are truncated"))?;
        }
        if version >= TESTED {
            (work.tested, work.cutoff) =
                next(&mut rest).ok_or_else(|| damaged("its words are truncated"))?;
        }
        if version >= MASKS {
            let masks: Vec<u16> =
                next(&mut rest).ok_or_else(|| damaged("its masks are truncated"))?;
            if version == MASKS || !masks.is_empty() {
                work.take_masks(&masks).map_err(|what| damaged(&what))?;
            }
        }
        if version >= LISTS {
            work.lists = next(&mut rest).ok_or_else(|| damaged("its lists are truncated"))?;
        }
        if !rest.is_empty() {
            return Err(damaged("it has data after its end"));
        }
        Ok(file)
    }
}

fn damaged(what: &str) -> String {
    format!("is damaged: {what}")
}

fn append(file: &mut BufWriter<File>, value: &impl Serialize) -> Result<(), String> {
    // On a full disk, postcard's own error reports a full buffer.
    let written = postcard::to_io(value, &mut *file).map(drop);
    written.map_err(|error| {
        let full = file.flush().err();
        full.map_or(error.to_string(), |full| full.to_string())
    })
}

/// The value that comes next; `None` if there is none.
fn next<T: DeserializeOwned>(rest: &mut &[u8]) -> Option<T> {
    let (value, left) = postcard::take_from_bytes(rest).ok()?;
    *rest = left;
    Some(value)
}
