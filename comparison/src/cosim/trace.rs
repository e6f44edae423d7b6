//! Trace: writes the records on the wires between units, to verify RTL against the machine.
//!
//! ```text
//! DIR/manifest.json     contents: machine, scene, window, streams with fields, keys, counts and digests; written last
//!     README.md         the same as text, and a description of each unit
//!     frame.hex …       constants: registers, lights, materials          one record per line, hexadecimal, for $readmemh
//!     raster.in.hex …   one file per stream, one record per transfer through the port
//!     keys/…            origin of each record: splat, pixel, slot, parent, flags of its words
//!     rom/…             tables
//!     coverage.csv          roundings, limits and decisions, and how often they occurred
//!     waves.vcd waves.fst   cycles in which units took their items; only with --waves
//!     machine_pkg.sv records.svh records.h      formats and records in SystemVerilog and C
//!     splatsim_dpi.sv                           the live model of each unit, over DPI-C
//!     machine_pkg.core Bender.yml               lists of these files, for FuseSoC and Bender
//! ```
//! Streams are in the order of a machine that draws splat after splat, and each box row by row.
//!
//! Laws: `a_trace_replays_through_the_units`, `a_window_replays_alone` (tests/trace.rs).

mod coverage;
mod dpi;
mod headers;
mod observer;
mod record;
mod roms;
pub mod rtl;
mod stimulus;
mod transfers;
mod waves;

pub use observer::flag;
pub use record::{Malformed, RecordLayout, without_comment};
pub use transfers::{Key, NONE};

pub(super) use observer::outcome;
pub(super) use stimulus::made_up;
pub(super) use transfers::constants as constant_records;

use crate::error::{Error, Result, in_order};
use crate::hardware::fixed;
use crate::hardware::quantise::quantise;
use crate::output::files;
use crate::output::files::{write_beside, write_two_beside};
use crate::output::text::{aligned, hex, plain_table, thousands, wrapped};
use crate::scene::Scene;
use crate::scene::digest::digest_of;
use coverage::Coverage;
use observer::Observations;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::frame::Frame;
use rtl_model::pipeline;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Order, Stream};
use rtl_model::timing::{self, Detail};
use rtl_model::units::fragment::Slot;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::Write;
use std::path::Path;
use stimulus::CaseTag;
use transfers::{RecordSource, Rectangle, Transfers};
use waves::{Timed, Waves};

/// Part of a frame that a trace contains.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Units whose ports are traced; all if empty.
    pub units: Vec<String>,
    /// Splats A to B − 1, by their index in the scene.
    pub splats: Option<[u32; 2]>,
    /// First column and row, last column and row.
    pub pixels: Option<[u32; 4]>,
    /// One in N splats and pixels.
    pub sample: Option<u32>,
    /// N random cases per unit, in addition to corner cases, instead of the scene's transfers.
    pub stimulus: Option<u32>,
    /// Waves of cycles A to B − 1.
    pub waves: Option<[u64; 2]>,
    /// Seed of the sample or of the random cases.
    pub seed: u64,
}

/// Origin of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin<'a> {
    /// The text of its file, if it has one.
    pub text: Option<&'a str>,
    /// The file, or the built-in name.
    pub source: Option<&'a str>,
    /// Index of the frame in a sequence.
    pub frame: usize,
}

/// Result of a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Streams: name, number of records, bytes.
    pub streams: Vec<(String, u64, u64)>,
    /// Cases that occurred, and all cases (coverage.csv).
    pub coverage: [u64; 2],
    /// Notes for the user, one sentence each.
    pub notes: Vec<String>,
}

/// If splats are sorted, or fragments grouped by windows, the output of these units depends on all
/// splats of a pixel.
const OF_ALL_SPLATS: [&str; 4] = ["sort", "fragment", "shade", "resolve"];

/// Most cycles of waves.
const MOST_WAVES: u64 = 10_000_000;

/// Most stimulus cases per unit.
const MOST_CASES: u32 = 5_000_000;
/// Records that one thread converts to text at a time.
const CHUNK: usize = 16_384;

/// Draws a scene on a machine and writes the records at the ports. With `stimulus`, writes made-up
/// cases for each unit, with the scene's constants. `pages` are for the README.
///
/// # Errors
/// [`Error::Input`] if the window or the machine is not possible, [`Error::Job`] if a file cannot
/// be written.
pub fn trace(
    scene: &Scene,
    origin: Origin,
    machine: &Machine,
    window: &Window,
    pages: &Pages,
    folder: &Path,
) -> Result<Written> {
    // The text is complete if it is of the first frame, and the scene needs no other file.
    let complete = origin
        .text
        .filter(|text| origin.frame == 0 && is_complete(text));
    let elaborated = fixed::elaborate(machine)?;
    let mut frame = quantise(scene, machine)?.frame;
    let kind = Kind::of(&frame);
    let is_of_setup = |unit: &String| ["project", "ellipse"].contains(&unit.as_str());
    let is_only_setup =
        window.waves.is_none() && !window.units.is_empty() && window.units.iter().all(is_of_setup);
    if frame.lists.is_some() && window.stimulus.is_none() && !is_only_setup {
        return Err(Error::input(format!(
            "sort.kind is incremental, and the lists of frame {} depend on the frames before it, which a trace does not have: trace frame 0, --units project,ellipse, or use another sort.kind",
            scene.cameras_before().len()
        )));
    }
    frame.lists = None;
    let rectangle = window.check(&frame)?;
    let mut notes = Vec::new();
    let without_raster;
    let window = if elaborated.tests_blocks(&frame).is_some() && window.stimulus.is_none() {
        without_raster = window.without_raster(kind, &mut notes)?;
        &without_raster
    } else {
        window
    };
    if window.waves.is_some()
        && frame.surroundings.is_some()
        && machine.timing.environment.is_some()
    {
        return Err(Error::input(
            "--waves: surroundings come from memory, and waves do not show the stalls; without --waves records are written",
        ));
    }
    let _open = files::Folder::open(folder)?;
    // The manifest is written last: without it, no stream of an earlier trace is mistaken for one
    // of this.
    files::remove_if_there(&folder.join("manifest.json"))?;
    let folder = TraceWriter {
        folder,
        machine: &elaborated,
        frame: &frame,
    };
    let mut contents = if let Some(cases) = window.stimulus {
        let stimulus::Stimulus {
            made,
            tags,
            coverage,
        } = stimulus::stimulus(&elaborated, &frame, cases, window.seed, |units| {
            window.includes_any(units)
        });
        let sources: Vec<RecordSource> = made.iter().map(RecordSource::of).collect();
        folder.contents(window, &sources, &coverage, &tags)?
    } else {
        let whole = WholeFrame {
            machine: &elaborated,
            frame: &frame,
        };
        let (shown, splats, before) = whole.part(window, rectangle);
        let start = if before.splats.is_empty() {
            Vec::new()
        } else {
            held(&elaborated, &before, rectangle)
        };
        let mut observer = Observations::new(&elaborated, &shown, before.splats.len() as u32);
        let setup = pipeline::set_up_observed(&elaborated, &shown, &mut observer);
        let fills = window.includes_any(&[
            "raster", "gauss", "fragment", "shade", "resolve", "pipeline",
        ]);
        // Waves are of all units.
        if fills || window.waves.is_some() {
            pipeline::fill_observed(&elaborated, &shown, &setup, &mut observer);
        }
        let mut coverage = std::mem::take(&mut observer.coverage);
        observer.decisions(&mut coverage);
        let transfers = Transfers::new(&elaborated, &shown, &splats, observer, start, rectangle);
        let sources = transfers.sources();
        if let Some(cycles) = window.waves {
            let (_, _, work) = pipeline::draw_measured(&elaborated, &shown);
            let replayed = timing::replay(&elaborated.timing, &work, Detail::Log);
            let timed = Timed {
                machine: &elaborated,
                kind,
                work: &work,
                splats: &splats,
                units: &replayed.units,
                sources: &sources,
            };
            let waves = Waves::new(&timed, cycles);
            waves.write(folder.folder)?;
            if waves.is_empty() {
                let last = replayed
                    .units
                    .iter()
                    .filter_map(|unit| unit.log.last())
                    .max()
                    .copied()
                    .unwrap_or(0);
                notes.push(format!(
                    "--waves {}..{}: no unit takes an item in these cycles, and the waves are empty; the last item of the frame is taken in cycle {last}",
                    cycles[0], cycles[1]
                ));
            }
        }
        folder.contents(window, &sources, &coverage, &[])?
    };
    let description = serde_json::to_string_pretty(machine).unwrap_or_default() + "\n";
    let mut manifest = json!({
        "format": "splatsim-trace-1",
        "version": env!("CARGO_PKG_VERSION"),
        "machine": {"name": machine.name, "sha256": hex(&Sha256::digest(&description)), "description": machine},
        "scene": {
            "name": scene.name, "sha256": digest_of(scene), "splats": scene.splats.len(),
            "width": frame.width, "height": frame.height, "text": origin.text.filter(|_| origin.frame == 0),
            "complete": complete.is_some(), "source": origin.source.filter(|_| complete.is_none()), "frame": origin.frame,
        },
        "window": {
            "units": if window.units.is_empty() { units(kind).iter().map(|&unit| unit.to_owned()).collect() } else { window.units.clone() },
            "splats": window.splats.unwrap_or([0, frame.splats.len() as u32]),
            "pixels": [rectangle[0], rectangle[1], rectangle[2] - 1, rectangle[3] - 1],
            "sample": window.sample, "stimulus": window.stimulus, "seed": window.seed,
        },
        "records": "one per line: hexadecimal digits of the whole record, two's complement, first field in the most significant bits",
        "keys": {
            "fields": key_fields(), "flags": flag::NAMES,
            "none": "all ones; a record's sequence number is the number of its line, from 0, and `parent` is one of the stream before",
        },
        "enums": headers::enums(kind),
    });
    let mut formats = headers::words_and_numbers(&elaborated, &frame);
    for more in [&mut formats, &mut contents] {
        if let (Some(manifest), Some(more)) = (manifest.as_object_mut(), more.as_object_mut()) {
            manifest.append(more);
        }
    }
    let names: Vec<&str> = manifest["streams"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|stream| stream["name"].as_str())
        .collect();
    folder.headers(pages, &scene.name, &names)?;
    folder.text("machine.json", &description)?;
    if let Some(text) = complete {
        folder.text("scene.json", text)?;
    }
    folder.text(
        "manifest.json",
        &(serde_json::to_string_pretty(&manifest).unwrap_or_default() + "\n"),
    )?;
    Ok(Written {
        notes,
        ..Written::new(&manifest)
    })
}

impl Written {
    fn new(manifest: &Value) -> Self {
        let entry = |file: &Value| {
            let number = |name: &str| file[name].as_u64().unwrap_or(0);
            (
                file["name"].as_str().unwrap_or_default().to_owned(),
                number("records"),
                number("records") * (number("digits") + 1),
            )
        };
        let number = |name: &str| manifest["coverage"][name].as_u64().unwrap_or(0);
        Written {
            streams: manifest["streams"]
                .as_array()
                .into_iter()
                .flatten()
                .map(entry)
                .collect(),
            coverage: [number("met"), number("cases")],
            notes: Vec::new(),
        }
    }

    /// The streams, their records and sizes.
    pub fn table(&self) -> String {
        let mut table = plain_table(&["stream", "records", "bytes"]);
        for (name, records, bytes) in &self.streams {
            table.add_row([name.clone(), thousands(*records), thousands(*bytes)]);
        }
        let [met, cases] = self.coverage.map(thousands);
        let notes: String = self
            .notes
            .iter()
            .map(|note| format!("\n\n{}", wrapped(note)))
            .collect();
        format!(
            "{}\n\n{met} of {cases} cases met: coverage.csv has roundings, limits, decisions{notes}",
            aligned(table).trim_fmt()
        )
    }
}

/// The pipeline and its units that have ports in a frame of this kind, in the order of the diagram.
fn units(kind: Kind) -> Vec<&'static str> {
    std::iter::once("pipeline").chain(kind.units()).collect()
}

/// The stream that the records of a stream are made from.
fn parent(kind: Kind, stream: &str) -> Option<&'static str> {
    let all = [
        ("project.in", "pipeline.in"),
        ("project.out", "project.in"),
        ("ellipse.in", "project.out"),
        ("ellipse.out", "ellipse.in"),
        ("colour.in", "ellipse.out"),
        ("colour.out", "colour.in"),
        ("ellipse.request", "ellipse.out"),
        ("ellipse.answer", "ellipse.request"),
        ("sort.in", "ellipse.out"),
        ("sort.out", "sort.in"),
        (
            "raster.in",
            if kind.sorted {
                "sort.out"
            } else {
                "ellipse.out"
            },
        ),
        ("raster.out", "raster.in"),
        ("gauss.in", "raster.out"),
        ("gauss.out", "gauss.in"),
        ("fragment.in", "gauss.out"),
        ("fragment.out", "fragment.in"),
        ("fragment.request", "fragment.in"),
        ("fragment.answer", "fragment.request"),
        (
            "shade.in",
            if kind.preshaded {
                "ellipse.request"
            } else {
                "fragment.request"
            },
        ),
        ("shade.out", "shade.in"),
        ("resolve.in", "fragment.held"),
        ("resolve.out", "resolve.in"),
        ("pipeline.out", "resolve.out"),
    ];
    let found = all
        .iter()
        .find(|(name, _)| *name == stream)
        .map(|(_, parent)| *parent);
    // Sheets send no requests to shade.
    found.filter(|parent| !kind.sheets || *parent != "fragment.request")
}

/// Pages of the book that a trace's README contains. The caller passes them, because the book is not
/// in the folder of this crate.
#[derive(Clone, Copy, Debug)]
pub struct Pages {
    /// Files and their records.
    pub files: &'static str,
    /// Numbers and their roundings.
    pub numbers: &'static str,
    /// Units up to the weight.
    pub units: &'static str,
    /// Units behind it.
    pub fragments: &'static str,
    /// Ellipsoids and sheets.
    pub ellipsoids: &'static str,
    /// The rule `window`.
    pub windows: &'static str,
}

/// The chapter without the passages that are only for readers of the book.
fn in_readme(chapter: &str) -> String {
    let rest = chapter.split_once("<!-- in the book alone -->\n");
    let cut = rest.and_then(|(head, rest)| {
        Some(
            [
                head,
                rest.split_once("<!-- and in a trace's README -->\n\n")?.1,
            ]
            .concat(),
        )
    });
    cut.unwrap_or_else(|| chapter.to_owned())
}

/// Descriptions of files, records and units: chapters of the book, and one more each for ellipsoids
/// and for windows.
fn explained(pages: &Pages, kind: Kind) -> String {
    let (_, files) = pages
        .files
        .split_once("<!-- a trace's README begins below this line -->\n\n")
        .unwrap_or_default();
    let ellipsoids = (kind.ellipsoids || kind.sheets).then_some(pages.ellipsoids);
    let windows = kind.windows.then_some(pages.windows);
    let chapters = [
        Some(files),
        Some(pages.numbers),
        Some(pages.units),
        Some(pages.fragments),
        ellipsoids,
        windows,
        Some("# This machine\n"),
    ];
    chapters
        .into_iter()
        .flatten()
        .map(in_readme)
        .collect::<Vec<_>>()
        .join("\n")
}

/// Whether a scene's text needs no other file.
fn is_complete(text: &str) -> bool {
    let scene: Value = serde_json::from_str(text).unwrap_or_default();
    scene.is_object() && !reads_files(&scene["splats"])
}

/// Whether a source, or a part of it, is in another file.
fn reads_files(source: &Value) -> bool {
    let is_read = |of: &Value| of.is_string() || of.get("file").is_some();
    match source {
        Value::Array(sources) => sources.iter().any(reads_files),
        _ => {
            is_read(source)
                || is_read(&source["volume"])
                || source.get("place").is_some() && reads_files(&source["splats"])
        }
    }
}

fn key_fields() -> Vec<Value> {
    let mut below: u32 = Key::PARTS.iter().map(|(_, bits)| bits).sum();
    let field = |(name, bits): &(&str, u32)| {
        below -= bits;
        json!({"name": name, "lsb": below, "width": bits})
    };
    Key::PARTS.iter().map(field).collect()
}

/// Pseudo-random number from a seed and an index (SplitMix64).
fn mixed(seed: u64, number: u64) -> u64 {
    let mut z = seed
        .wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

impl Window {
    /// Checks the window; returns its rectangle, end column and row excluded.
    pub(super) fn check(&self, frame: &Frame) -> Result<Rectangle> {
        let units = units(Kind::of(frame));
        if let Some(unknown) = self
            .units
            .iter()
            .find(|unit| !units.contains(&unit.as_str()))
        {
            return Err(Error::input(format!(
                "--units {unknown}: no such unit; there are {}",
                units.join(", ")
            )));
        }
        if let Some(cases) = self.stimulus.filter(|cases| *cases > MOST_CASES) {
            return Err(Error::input(format!(
                "--stimulus {cases}: at most {MOST_CASES} cases per unit are possible, because all are kept in memory"
            )));
        }
        let of_all = self
            .units
            .iter()
            .find(|unit| OF_ALL_SPLATS.contains(&unit.as_str()));
        if let (true, Some(_), Some(unit)) = (Kind::of(frame).windows, self.splats, of_all) {
            return Err(Error::input(format!(
                "--splats with --units {unit}: these fragments are grouped by windows, and its records depend on earlier splats too; use --pixels, which traces all splats of some pixels"
            )));
        }
        if Kind::of(frame).windows && self.waves.is_some() {
            return Err(Error::input(
                "--waves: fragments are grouped by windows, whose cycles waves do not show; without --waves records are written",
            ));
        }
        if let (true, Some(_), Some(unit)) = (Kind::of(frame).sorted, self.splats, of_all) {
            return Err(Error::input(format!(
                "--splats with --units {unit}: these splats are sorted, and its records depend on the others too; use --pixels, which traces all splats of some pixels"
            )));
        }
        if let Some([first, end]) = self.splats
            && (first >= end || end as usize > frame.splats.len())
        {
            let count = frame.splats.len();
            return Err(Error::input(format!(
                "--splats {first}..{end}: the scene's splats are 0..{count}, and the second number must be greater"
            )));
        }
        if let Some([first, end]) = self.waves
            && (first >= end || end - first > MOST_WAVES)
        {
            return Err(Error::input(format!(
                "--waves {first}..{end}: cycles are needed, at most {MOST_WAVES}, the second number greater"
            )));
        }
        if frame.lighting.materials.len() > 1 << ports::MATERIAL_BITS {
            let count = frame.lighting.materials.len();
            return Err(Error::input(format!(
                "the scene has {count} materials, but a record's index has {} bits",
                ports::MATERIAL_BITS
            )));
        }
        let [across, down] = frame.view.inverse_focals().map(|inverse| inverse.places);
        let places = [
            frame.view.inverse_focal.places,
            across,
            down,
            frame.inverse_threshold.places,
        ];
        if places.iter().any(|places| i8::try_from(*places).is_err()) {
            return Err(Error::input(
                "the focal length or the coverage threshold lies beyond 2^±127, and records have 8 bits for that power",
            ));
        }
        let Some([left, top, right, bottom]) = self.pixels else {
            return Ok([0, 0, frame.width, frame.height]);
        };
        if left > right || top > bottom || right >= frame.width || bottom >= frame.height {
            return Err(Error::input(format!(
                "--pixels {left},{top},{right},{bottom}: first column and row, last column and row are needed, and the picture is {}×{}",
                frame.width, frame.height
            )));
        }
        Ok([left, top, right + 1, bottom + 1])
    }

    /// This window for a machine whose rasteriser passes over blocks of pixels, which the records of
    /// raster do not show.
    fn without_raster(&self, kind: Kind, notes: &mut Vec<String>) -> Result<Window> {
        let reason = "the machine's `contribution` leaves out blocks of pixels, and records of raster have no mask";
        let of_raster = |unit: &String| unit == "raster";
        if self.waves.is_some() || self.units.iter().any(of_raster) {
            return Err(Error::input(format!(
                "{}: {reason}: leave `contribution` out, or use --stimulus without --waves",
                if self.waves.is_some() {
                    "--waves"
                } else {
                    "--units raster"
                }
            )));
        }
        let mut window = self.clone();
        if window.units.is_empty() {
            let others = units(kind).into_iter().filter(|unit| *unit != "raster");
            window.units = others.map(str::to_owned).collect();
            notes.push(format!(
                "raster is not traced: {reason}; --stimulus writes cases for it"
            ));
        }
        Ok(window)
    }

    fn includes(&self, kind: Kind, stream: &Stream) -> bool {
        // A part of a frame has no records of the pipeline.
        let whole = self.splats.is_none() && self.pixels.is_none() && self.sample.is_none();
        let unit = stream.unit().unwrap_or_default();
        // In depth order, a pixel is only complete with all of its splats; pixels of windows have
        // no record of what they held before.
        let by_splat = !(kind.sorted || kind.windows)
            || self.splats.is_none()
            || !OF_ALL_SPLATS.contains(&unit);
        by_splat
            && self.includes_any(&[unit])
            && (whole || unit != "pipeline")
            && (self.splats.is_some() || stream.name != "fragment.start")
    }

    fn includes_any(&self, units: &[&str]) -> bool {
        self.units.is_empty() || self.units.iter().any(|unit| units.contains(&unit.as_str()))
    }

    /// The records that are in the sample.
    fn kept(&self, source: &RecordSource) -> Vec<u32> {
        let unit = source.name.split('.').next().unwrap_or_default();
        let mut words = Vec::new();
        let sampled = |record: &u32| {
            words.clear();
            self.samples(unit, &(source.at)(*record as usize, &mut words))
        };
        (0..source.records as u32).filter(sampled).collect()
    }

    fn samples(&self, unit: &str, key: &Key) -> bool {
        let one_in = self.sample.unwrap_or(1);
        // Fragments depend on earlier ones of their pixel, so whole pixels are sampled; earlier
        // stages are sampled by splat.
        let by_pixel = ["fragment", "shade", "resolve"].contains(&unit);
        let number = if by_pixel {
            u64::from(key.y) << 16 | u64::from(key.x)
        } else {
            u64::from(key.splat)
        };
        mixed(self.seed, number).is_multiple_of(one_in.into())
    }
}

/// A whole frame, of which a window selects a part.
struct WholeFrame<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
}

impl WholeFrame<'_> {
    /// The frame to draw, the indices of its splats in the scene, and the frame of the splats
    /// before the window.
    fn part(&self, window: &Window, rectangle: Rectangle) -> (Frame, Vec<u32>, Frame) {
        let mut splats: Vec<u32> = (0..self.frame.splats.len() as u32).collect();
        if window.pixels.is_some() {
            let touching = self.touching(rectangle);
            splats.retain(|splat| touching.binary_search(splat).is_ok());
        }
        let [first, end] = window.splats.unwrap_or([0, u32::MAX]);
        splats.retain(|splat| *splat < end);
        let Kind {
            sorted, windows, ..
        } = Kind::of(self.frame);
        if sorted || windows {
            splats.retain(|splat| *splat >= first);
        }
        let before = splats.partition_point(|splat| *splat < first);
        (self.of(&splats), splats.clone(), self.of(&splats[..before]))
    }

    /// The frame with these splats only.
    fn of(&self, splats: &[u32]) -> Frame {
        let mut frame = Frame {
            splats: Vec::new(),
            ..self.frame.clone()
        };
        frame.splats = splats
            .iter()
            .map(|splat| self.frame.splats[*splat as usize])
            .collect();
        if let (Some(part), Some(whole)) = (&mut frame.ellipsoids, &self.frame.ellipsoids) {
            part.own = splats
                .iter()
                .filter_map(|splat| whole.own.get(*splat as usize))
                .copied()
                .collect();
        }
        if let (Some(part), Some(whole)) = (&mut frame.sheets, &self.frame.sheets) {
            part.numbers = splats
                .iter()
                .filter_map(|splat| whole.numbers.get(*splat as usize))
                .copied()
                .collect();
        }
        frame
    }

    /// The splats whose boxes overlap a rectangle.
    fn touching(&self, [left, top, right, bottom]: Rectangle) -> Vec<u32> {
        let mut observer = Observations::new(self.machine, self.frame, 0);
        pipeline::set_up_observed(self.machine, self.frame, &mut observer);
        let meets = |splat: &&observer::SetUpTransfer| {
            let [
                backface,
                faint,
                outside,
                ..,
                first_column,
                last_column,
                first_row,
                last_row,
                _,
                _,
                _,
            ] = splat.ellipse;
            let drawn = splat.leaves_project() && [backface, faint, outside] == [0; 3];
            let columns = first_column < i64::from(right) && last_column >= i64::from(left);
            drawn && columns && first_row < i64::from(bottom) && last_row >= i64::from(top)
        };
        observer
            .set_up
            .iter()
            .filter(meets)
            .map(|splat| splat.splat)
            .collect()
    }
}

/// The fragments that a rectangle's pixels hold after a frame, slot by slot.
fn held(
    machine: &Elaborated,
    frame: &Frame,
    [left, top, right, bottom]: Rectangle,
) -> Vec<([u32; 2], Vec<Slot>)> {
    let mut observer = Observations::new(machine, frame, u32::MAX);
    pipeline::draw_observed(machine, frame, &mut observer);
    observer.sort();
    let pixels = observer.held.into_iter().map(|held| {
        let [_, x, y] = observer::parts(held.key);
        ([x, y], held.slots)
    });
    pixels
        .filter(|([x, y], _)| (left..right).contains(x) && (top..bottom).contains(y))
        .collect()
}

/// Writes the files of a trace.
struct TraceWriter<'a> {
    folder: &'a Path,
    machine: &'a Elaborated,
    frame: &'a Frame,
}

impl TraceWriter<'_> {
    fn text(&self, name: &str, text: &str) -> Result<()> {
        write_beside(&self.folder.join(name), |file| {
            file.write_all(text.as_bytes()).map_err(|e| e.to_string())
        })
    }

    /// Writes lines; returns their digest.
    fn lines(&self, name: &str, layout: &RecordLayout, lines: &[Vec<i64>]) -> Result<String> {
        let mut text = Vec::new();
        lines
            .iter()
            .for_each(|words| layout.write(words, &mut text));
        write_beside(&self.folder.join(name), |file| {
            file.write_all(&text).map_err(|e| e.to_string())
        })?;
        Ok(hex(&Sha256::digest(&text)))
    }

    fn constants(&self) -> Result<Vec<Value>> {
        let records = transfers::constants(&self.machine.machine, self.frame);
        let described = ports::constants(self.machine, Kind::of(self.frame));
        let of = |(stream, (_, records)): (&Stream, &(&str, Vec<Vec<i64>>))| {
            let layout = RecordLayout::new(stream);
            let file = format!("{}.hex", stream.name);
            let sha256 = self.lines(&file, &layout, records)?;
            Ok(json!({
                "name": stream.name, "file": file, "records": records.len(), "width": layout.width, "digits": layout.digits(),
                "sha256": sha256, "fields": headers::fields(stream, Kind::of(self.frame)),
            }))
        };
        described.iter().zip(&records).map(of).collect()
    }

    fn roms(&self) -> Result<Vec<Value>> {
        fs::create_dir_all(self.folder.join("rom")).map_err(|e| {
            Error::job(format!("{}: cannot be written: {e}", self.folder.display()))
        })?;
        let of = |rom: &roms::Rom| {
            let file = rom.file();
            let sha256 = self.lines(&file, &rom.layout, &rom.lines)?;
            let (width, digits) = (rom.layout.width, rom.layout.digits());
            Ok(json!({
                "name": rom.name, "file": file, "records": rom.lines.len(), "width": width, "digits": digits, "sha256": sha256,
                "fields": rom.fields,
            }))
        };
        roms::roms(self.machine, self.frame)
            .iter()
            .map(of)
            .collect()
    }

    fn headers(&self, pages: &Pages, scene: &str, streams: &[&str]) -> Result<()> {
        self.text(
            "machine_pkg.sv",
            &headers::package(self.machine, self.frame),
        )?;
        let (machine, frame, kind) = (self.machine, self.frame, Kind::of(self.frame));
        self.text("records.svh", &headers::structs(machine, kind))?;
        self.text("records.h", &headers::c_header(machine, kind))?;
        self.text("splatsim_dpi.sv", &dpi::dpi(machine, kind))?;
        let roms: Vec<String> = roms::roms(machine, self.frame)
            .iter()
            .map(roms::Rom::file)
            .collect();
        self.text(
            "machine_pkg.core",
            &headers::fusesoc(&roms.iter().map(String::as_str).collect::<Vec<_>>()),
        )?;
        self.text("Bender.yml", headers::BENDER)?;
        let head = format!(
            "# {scene} on {}\n\n{}×{} pixels, {} splats, written by splatsim {}.\n\n",
            machine.machine.name,
            frame.width,
            frame.height,
            frame.splats.len(),
            env!("CARGO_PKG_VERSION")
        );
        let units = explained(pages, kind);
        let (tables, formats) = (
            headers::tables(machine, kind, streams),
            headers::formats(machine, frame),
        );
        self.text(
            "README.md",
            &format!("{head}{units}\n## Records\n{tables}\n## Words and numbers\n{formats}"),
        )
    }

    /// Writes constants, tables, streams and coverage; returns their manifest entries.
    fn contents(
        &self,
        window: &Window,
        sources: &[RecordSource],
        coverage: &Coverage,
        tags: &[CaseTag],
    ) -> Result<Value> {
        let job_error = |e: std::io::Error| {
            Error::job(format!("{}: cannot be written: {e}", self.folder.display()))
        };
        fs::create_dir_all(self.folder.join("keys")).map_err(job_error)?;
        fs::create_dir_all(self.folder.join("rom")).map_err(job_error)?;
        let kind = Kind::of(self.frame);
        let streams: Vec<Stream> = ports::streams(self.machine, kind)
            .into_iter()
            .filter(|stream| window.includes(kind, stream))
            .collect();
        let kept: Option<Vec<Vec<u32>>> = window.sample.map(|_| {
            sources
                .par_iter()
                .map(|source| window.kept(source))
                .collect()
        });
        let written = |stream: &Stream| {
            let of = |place: usize| kept.as_ref().map(|kept| &kept[place][..]);
            let place = sources
                .iter()
                .position(|source| source.name == stream.name)?;
            let parents = sources
                .iter()
                .position(|source| Some(source.name) == parent(kind, stream.name))
                .and_then(of);
            Some(self.stream(stream, &sources[place], of(place), parents))
        };
        let files: Vec<Value> = in_order(streams.par_iter().filter_map(written))?;
        self.text("coverage.csv", &coverage.csv())?;
        let [met, cases] = coverage.counts();
        let tags: Vec<Value> =
            tags.iter().map(|tag| json!({"stream": tag.stream, "tag": tag.tag, "first": tag.first, "records": tag.records})).collect();
        Ok(json!({
            "constants": self.constants()?, "roms": self.roms()?, "streams": files, "tags": tags,
            "coverage": {"file": "coverage.csv", "met": met, "cases": cases},
        }))
    }

    /// Writes a stream and its keys, or the sampled records of it; returns its manifest entry.
    fn stream(
        &self,
        stream: &Stream,
        source: &RecordSource,
        kept: Option<&[u32]>,
        parents: Option<&[u32]>,
    ) -> Result<Value> {
        let layout = RecordLayout::new(stream);
        let keys = RecordLayout::of_naturals(&Key::PARTS.map(|(_, bits)| bits));
        let unit = stream.unit().unwrap_or_default();
        let (file, key_file) = (
            format!("{}.hex", stream.name),
            format!("keys/{}.hex", stream.name),
        );
        let (mut sha, mut key_sha) = (Sha256::new(), Sha256::new());
        let records = kept.map_or(source.records, <[u32]>::len);
        let parent_of = |key: &Key| match parents {
            Some(parents) if key.parent != NONE => parents
                .binary_search(&key.parent)
                .map_or(NONE, |record| record as u32),
            _ => key.parent,
        };
        let [key_path, path] = [&key_file, &file].map(|file| self.folder.join(file));
        write_two_beside([&key_path, &path], |[key_out, out]| {
            let starts: Vec<usize> = (0..records).step_by(CHUNK).collect();
            for group in starts.chunks(rayon::current_num_threads() * 2) {
                let chunk = |&start: &usize| {
                    let (mut text, mut key_text, mut words) = (Vec::new(), Vec::new(), Vec::new());
                    for record in start..records.min(start + CHUNK) {
                        words.clear();
                        let key = (source.at)(
                            kept.map_or(record, |kept| kept[record] as usize),
                            &mut words,
                        );
                        layout.mask(&mut words);
                        layout.write(&words, &mut text);
                        keys.write(
                            &Key {
                                parent: parent_of(&key),
                                ..key
                            }
                            .words(),
                            &mut key_text,
                        );
                    }
                    (text, key_text)
                };
                let texts: Vec<(Vec<u8>, Vec<u8>)> = group.par_iter().map(chunk).collect();
                for (text, key_text) in texts {
                    sha.update(&text);
                    key_sha.update(&key_text);
                    out.write_all(&text).map_err(|e| e.to_string())?;
                    key_out.write_all(&key_text).map_err(|e| e.to_string())?;
                }
            }
            Ok(())
        })?;
        let order = match stream.order {
            Order::Total => "total",
            Order::PerPixel => "per-pixel",
        };
        Ok(json!({
            "name": stream.name, "unit": unit, "file": file, "records": records, "width": layout.width, "digits": layout.digits(),
            "order": order, "parent": parent(Kind::of(self.frame), stream.name), "sha256": hex(&sha.finalize()), "keys": {"file": key_file, "sha256": hex(&key_sha.finalize())},
            "fields": headers::fields(stream, Kind::of(self.frame)),
        }))
    }
}
