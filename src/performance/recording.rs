//! Recording: a frame's work in a file, so that its time can be computed again without drawing it.
//!
//! ```text
//! run --record FILE ─► FILE (cosim/work_file.rs) ─► replay FILE: any timing of the same machine
//! ```
//! The events depend on all fields of a machine except `timing`: only `timing` can be changed.
//!
//! Laws (tests/recording.rs): `a_record_that_is_read_is_the_one_that_was_written`,
//! `no_damage_is_taken_for_a_record`, `a_replay_takes_the_cycles_of_the_run`.

use crate::cosim::work_file::{HEAD, WorkFile, is_head};
use crate::error::{Error, Result};
use crate::hardware::quantise::lacks_tile_bits;
use crate::hardware::{fixed, machines};
use crate::input;
use crate::output::chart;
use crate::output::chart::Chart;
use crate::output::files::{Unwritten, Writing, probe, write_as_one, write_beside};
use crate::output::text::wrapped;
use crate::performance::answers::Answers;
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::{CyclesReport, Requests};
use crate::performance::roofline;
use crate::performance::timings::{
    Axes, Timings, Variants, can_be_replayed, draws_as, fields_of_lists, holds_stack,
};
use crate::scene::MOST_PIXELS;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::BinWords;
use rtl_model::machine::{Sort, SortKind};
use rtl_model::num::Word;
use rtl_model::timing::{Detail, RecordedFrame};
use rtl_model::work::{TestedWords, Work};
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Columns and rows of the roofline.
const ROOFLINE_PX: [u32; 2] = [860, 600];

/// A frame's work, with its scene and machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The scene's name.
    pub scene: String,
    /// Machine that drew it.
    pub machine: Machine,
    /// Events of the frame.
    pub work: Work,
}

/// Outcome of a replay.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// The frame's time.
    pub cycles: CyclesReport,
    /// Times with other values of fields.
    pub timings: Option<Timings>,
    /// What-if results, if requested.
    pub answers: Option<Answers>,
    /// Requests to memory, if requested.
    pub requests: Option<Requests>,
    /// Area of the machine, and energy of the frame.
    pub cost: CostReport,
}

impl Recording {
    /// Checks that a file can be written, before any work is done for it.
    ///
    /// # Errors
    /// [`Error::Input`] where its folder does not exist or is not writable, or where another kind
    /// of file has that name.
    pub fn may_be_written(path: &Path) -> Result<()> {
        let input_error = |what: &str| {
            Err(Error::input(format!(
                "--record {}: cannot be written: {what}",
                path.display()
            )))
        };
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            return input_error(&format!("there is no folder {}", folder.display()));
        }
        if path.is_dir() {
            return input_error("it is a folder, and a file is needed");
        }
        let is_recording = || {
            let mut begins = Vec::new();
            let read = fs::File::open(path)
                .and_then(|file| file.take(HEAD as u64).read_to_end(&mut begins));
            read.is_ok() && (begins.is_empty() || is_head(&begins))
        };
        if path.exists() && !(path.is_file() && is_recording()) {
            return input_error("it exists and is not a recording");
        }
        probe(folder.unwrap_or(Path::new("."))).or_else(|error| input_error(&error.to_string()))
    }

    /// Writes it into a file.
    ///
    /// # Errors
    /// [`Error::Job`] where it cannot be written; then no file is left.
    pub fn write(self, path: &Path) -> Result<()> {
        let machine =
            serde_json::to_string(&self.machine).map_err(|error| Error::job(error.to_string()))?;
        let file = WorkFile {
            scene: self.scene,
            machine,
            work: self.work,
        };
        write_beside(path, |to| file.write(to))
    }

    /// Reads a file written by [`write`](Self::write).
    ///
    /// # Errors
    /// [`Error::Input`], one sentence, where the file is of another kind or damaged.
    pub fn read(path: &Path) -> Result<Self> {
        let input_error = |what: &str| Error::input(format!("{}: {what}", path.display()));
        let bytes =
            input::read(path).map_err(|error| input_error(&format!("cannot be read: {error}")))?;
        let damaged = |what: &str| input_error(&format!("is damaged: {what}"));
        let parts = WorkFile::read(&bytes).map_err(|what| input_error(&what))?;
        let machine =
            serde_json::from_str(&parts.machine).map_err(|_| damaged("its machine is not JSON"))?;
        let machine = machines::from_value(&machine, &format!("{}: its machine", path.display()))?;
        let [width, height] = [parts.work.width, parts.work.height].map(|side| side as usize);
        if width.saturating_mul(height) > MOST_PIXELS {
            return Err(input_error(&format!(
                "its picture has {width}×{height} pixels; at most {MOST_PIXELS} are drawn and replayed"
            )));
        }
        parts.work.check().map_err(|what| damaged(&what))?;
        holds_keys(&machine, &parts.work)
            .map_err(|_| damaged("its machine has buckets, but it has no keys"))?;
        holds_words(&machine, &parts.work).map_err(|_| {
            damaged("its machine tests tiles, but it has no words of its splats for this test")
        })?;
        holds_lists(&machine, &parts.work)
            .map_err(|_| damaged("its lists are not those of its machine"))?;
        if machine.contribution.is_some() && !parts.work.has_masks() {
            return Err(damaged("its machine tests blocks, but it has no masks"));
        }
        Ok(Recording {
            scene: parts.scene,
            machine,
            work: parts.work,
        })
    }

    /// Changes the machine's timing, as `--set timing.…=…`.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such field, or it is not one of `timing`.
    pub fn set(&mut self, setting: &str) -> Result<()> {
        let flag = machines::flag("--set", setting);
        let field = setting.split('=').next().unwrap_or_default().trim();
        if !can_be_replayed(field) {
            return Err(Error::input(format!(
                "{flag}: the record contains what happened in the frame; only fields below `timing` can change, and {}",
                fields_of_lists()
            )));
        }
        let machine = machines::changed(&self.machine, setting, &flag)?;
        self.can_replay(&machine)
            .map_err(|what| Error::input(format!("{flag}: {what}")))?;
        self.machine = machine;
        Ok(())
    }

    /// Checks that the record can be replayed on another machine: it differs only in fields that
    /// [`Recording::set`] accepts, and the record has what it needs.
    ///
    /// # Errors
    /// A sentence.
    pub fn can_replay(&self, machine: &Machine) -> std::result::Result<(), String> {
        draws_as(machine, &self.machine)?;
        let sort = self
            .machine
            .sort
            .zip(machine.sort)
            .map(|(own, other)| Sort {
                kind: other.kind,
                tile_bits: other.tile_bits,
                digit_bits: other.digit_bits,
                ..own
            });
        let replayed = Machine {
            name: machine.name.clone(),
            timing: machine.timing,
            bin: machine.bin,
            sort: sort.or(self.machine.sort),
            ..self.machine.clone()
        };
        if replayed != *machine {
            return Err(format!(
                "differs from the recorded machine outside `timing` and {}: draw the scene on it, with --scene",
                fields_of_lists()
            ));
        }
        self.can_time(machine)
    }

    /// Checks that the record has what the machine, with its own timing and each other value of it,
    /// needs: stack for the frame's walk, keys, words for tests.
    ///
    /// # Errors
    /// [`Error::Input`] with what is missing.
    pub fn check(&self, axes: &[Axes]) -> Result<()> {
        self.can_time(&self.machine).map_err(Error::input)?;
        Variants::new(&self.machine, axes)?.map_or(Ok(()), |variants| {
            variants.check(|machine| self.can_time(machine))
        })
    }

    /// Whether the record has what a machine needs.
    fn can_time(&self, machine: &Machine) -> std::result::Result<(), String> {
        holds_stack(machine.timing.walk, self.work.deepest_stack())?;
        holds_lists(machine, &self.work)?;
        holds_keys(machine, &self.work)?;
        holds_words(machine, &self.work)?;
        let size = [self.work.width, self.work.height].map(|side| side as usize);
        lacks_tile_bits(machine, size)
            .filter(|_| !self.work.order.is_empty())
            .map_or(Ok(()), Err)
    }

    /// Computes the frame's time; with `answers` also what-if results.
    ///
    /// # Errors
    /// [`Error::Input`] where a timing is invalid.
    pub fn replay(
        &self,
        axes: &[Axes],
        requests: bool,
        answers: Option<&Prices>,
    ) -> Result<Replayed> {
        self.replay_priced(
            axes,
            requests,
            answers.is_some(),
            answers.unwrap_or(&Prices::default()),
        )
    }

    /// [`Recording::replay`] with other unit costs.
    ///
    /// # Errors
    /// As [`Recording::replay`].
    pub fn replay_priced(
        &self,
        axes: &[Axes],
        requests: bool,
        answers: bool,
        prices: &Prices,
    ) -> Result<Replayed> {
        let elaborated = fixed::elaborate(&self.machine)?;
        let variants = Variants::new(&self.machine, axes)?;
        let detail = if requests {
            Detail::Log
        } else {
            Detail::Histograms
        };
        let frame = RecordedFrame::new(&self.work);
        let cycles = frame.replay(&elaborated.timing, detail);
        let report = CyclesReport::on(&elaborated.timing, &frame, &cycles);
        let answers = answers.then(|| Answers::new(&elaborated, &frame, &cycles, prices));
        let cost = CostReport::new(&elaborated, &cycles, prices);
        let requests = requests.then(|| Requests::new(&elaborated.timing, cycles.requests));
        let timings = variants.map(|variants| Timings::new(&variants, &frame));
        Ok(Replayed {
            cycles: report,
            timings,
            answers,
            requests,
            cost,
        })
    }
}

/// Whether a record has the keys that a machine with buckets needs.
fn holds_keys(machine: &Machine, work: &Work) -> std::result::Result<(), String> {
    let has_buckets = machine
        .sort
        .is_some_and(|sort| sort.kind == SortKind::Hierarchical);
    if has_buckets && work.keys.len() != work.order.len() {
        return Err("the record lacks the keys of its splats, which buckets depend on: record the frame with sort.kind=hierarchical".into());
    }
    Ok(())
}

/// Whether the lists of a record are those of a machine: kept from frame to frame, or sorted
/// completely.
fn holds_lists(machine: &Machine, work: &Work) -> std::result::Result<(), String> {
    match (machine.keeps_lists(), &work.lists) {
        (None, Some(_)) => Err("lists that are kept from frame to frame (sort.kind incremental) have another order than those of other kinds: draw the frame again".into()),
        (Some(_), None) if !work.order.is_empty() => Err("the record has no lists that are kept from frame to frame (sort.kind incremental), and its order is another one: draw the frame again".into()),
        (Some(kept), Some(lists)) if [kept.tile_px, kept.chunk] != [lists.tile_px, lists.chunk] => {
            Err("sort.incremental decides the picture: draw the frame again".into())
        }
        _ => Ok(()),
    }
}

/// Whether a record has the words of splats that a machine with a test of tiles needs, and they are
/// words of the machine.
fn holds_words(machine: &Machine, work: &Work) -> std::result::Result<(), String> {
    let Some(words) = BinWords::of(machine) else {
        return Ok(());
    };
    let fits = |word: Word, bits: i64| (word.format.min()..=word.format.max()).contains(&bits);
    let is_word = |of: &TestedWords| {
        let [xx, xy, yy] = of.conic.map(i64::from);
        of.pixel.iter().all(|at| fits(words.pixel, i64::from(*at)))
            && [xx, yy].iter().all(|at| fits(words.conic, *at))
            && fits(words.conic_cross, xy)
    };
    let has_words = work.tested.len() == work.footprints.len()
        && work.tested.iter().all(is_word)
        && fits(words.cutoff, work.cutoff);
    if !has_words {
        return Err("the record lacks the words of its splats, which the test of tiles depends on: record the frame with bin.test=ellipse".into());
    }
    Ok(())
}

impl Replayed {
    /// Text for a terminal, at most 80 columns wide. With other values of fields or what-if
    /// results, the frame's own time is left out: `run` has printed it.
    pub fn summary(&self, recording: &Recording) -> String {
        let Recording {
            scene,
            machine,
            work,
        } = recording;
        let head = wrapped(&format!(
            "{scene} on {}: {} splats, {}×{}",
            machine.name,
            work.cull_reasons.len(),
            work.width,
            work.height
        ));
        let tables = [
            self.timings.as_ref().map(Timings::table),
            self.answers.as_ref().map(Answers::table),
        ];
        let tables: Vec<String> = tables.into_iter().flatten().collect();
        let text = if tables.is_empty() {
            format!("{}\n{}", self.cycles.summary(), self.cost.summary())
        } else {
            tables.join("\n\n")
        };
        format!("{head}\n\n{text}")
    }

    /// Writes tables and charts into a folder; returns what was written.
    ///
    /// # Errors
    /// [`Error::Job`] where a file cannot be written; none is left half-written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let mut files = files_of_cycles(
            &self.cycles,
            self.timings.as_ref(),
            self.answers.as_ref(),
            self.requests.as_ref(),
            folder,
        );
        let json = |path: &Path| {
            write_beside(path, |file| {
                serde_json::to_writer_pretty(file, &self.cycles).map_err(|error| error.to_string())
            })
        };
        files.push((folder.join("cycles.json"), Box::new(json)));
        let cost = |path: &Path| {
            write_beside(path, |file| {
                serde_json::to_writer_pretty(file, &self.cost).map_err(|error| error.to_string())
            })
        };
        files.push((folder.join("cost.json"), Box::new(cost)));
        write_as_one(folder, files, &[])
    }
}

/// Files on a frame's time: charts, a table, and requests to memory.
pub fn files_of_cycles<'a>(
    cycles: &'a CyclesReport,
    timings: Option<&'a Timings>,
    answers: Option<&'a Answers>,
    requests: Option<&'a Requests>,
    folder: &Path,
) -> Vec<Unwritten<'a>> {
    let text = |path: &Path, text: &str| {
        write_beside(path, |file| {
            file.write_all(text.as_bytes()).map_err(|e| e.to_string())
        })
    };
    let mut files: Vec<Unwritten> = Vec::new();
    let mut add = |name: &str, write: Writing<'a>| files.push((folder.join(name), write));
    if let Some(timings) = timings {
        add(
            "timings.png",
            Box::new(|path| chart::write_png(&[&timings.chart()], 1, [760, 520], path)),
        );
    }
    for (requests, (name, format)) in requests
        .into_iter()
        .flat_map(|requests| Requests::FORMATS.map(|format| (requests, format)))
    {
        add(
            name,
            Box::new(move |path| {
                write_beside(path, |file| {
                    requests.write(format, file).map_err(|e| e.to_string())
                })
            }),
        );
    }
    if let Some(requests) = requests {
        let map = move |path: &Path| {
            let map = serde_json::to_string_pretty(&requests.map())
                .map_err(|error| Error::job(error.to_string()))?;
            text(path, &(map + "\n"))
        };
        add(Requests::MAP, Box::new(map));
    }
    add(
        "cycles.png",
        Box::new(|path| {
            let (stacks, over_time) = (cycles.stacks(), cycles.charts());
            let over_time = over_time.iter().map(|chart| chart as &dyn Chart);
            chart::write_png(
                &std::iter::once(&stacks as &dyn Chart)
                    .chain(over_time)
                    .collect::<Vec<_>>(),
                2,
                [460, 320],
                path,
            )
        }),
    );
    let roofline = move || roofline::chart(cycles, timings, answers);
    add(
        "roofline.png",
        Box::new(move |path| chart::write_png(&[&roofline()], 1, ROOFLINE_PX, path)),
    );
    add(
        "roofline.svg",
        Box::new(move |path| text(path, &chart::svg(&[&roofline()], 1, ROOFLINE_PX)?)),
    );
    add(
        "cycles.csv",
        Box::new(move |path| text(path, &cycles.csv())),
    );
    if let Some(tiles) = cycles.tiles_csv() {
        add("tiles.csv", Box::new(move |path| text(path, &tiles)));
    }
    files
}
