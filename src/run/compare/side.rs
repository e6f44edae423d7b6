//! Side: one of the two sides of a comparison: a machine, a frame on it, or a folder that `run`
//! wrote.

use super::Named;
use crate::error::{Error, Result};
use crate::hardware::{fixed, machines};
use crate::input;
use crate::output::colour::srgb_decode;
use crate::output::picture::Picture;
use crate::performance::cost::{Cost, CostReport, Prices};
use crate::performance::cycles::CyclesReport;
use crate::performance::recording::Recording;
use crate::run::report::MachineReport;
use crate::run::{self, Options};
use crate::scene::{MOST_PIXELS, Scene};
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use serde_json::{Value, json};
use std::path::Path;

/// Greatest number of bytes of a report: one of the largest machine has a thousandth.
const MOST_BYTES: u64 = 256 << 20;

/// Pictures that are compared.
const PICTURES: [&str; 3] = ["fixed", "golden", "ideal"];

/// Numbers that every report has.
const NUMBERS: [&str; 12] = [
    "/scene/width",
    "/scene/height",
    "/scene/splats",
    "/scene/fragments",
    "/accuracy/lockstep/decision_flips",
    "/cycles/total",
    "/cycles/clock_hz",
    "/cycles/frames_per_second",
    "/cycles/memory/bytes",
    "/cost/area",
    "/cost/energy/total",
    "/machine/fragment_bits",
];

/// Decibels that every report has, null if there are none.
const DECIBELS: [&str; 4] = [
    "/accuracy/fixed_vs_golden/psnr_db",
    "/accuracy/golden_vs_ideal/psnr_db",
    "/accuracy/fixed_vs_ideal/psnr_db",
    "/accuracy/lockstep/psnr_db",
];

/// The workload on which two machines are compared.
#[derive(Debug)]
pub enum Workload<'f> {
    /// A scene to be drawn on both.
    Scene(&'f Scene),
    /// A recording to be replayed on both: the machines differ only in `timing`.
    Recording(&'f Recording),
}

/// One side of a comparison.
#[derive(Clone, Debug)]
pub struct ComparisonSide {
    name: String,
    pub(super) report: Value,
    pub(super) pictures: Vec<(&'static str, Picture)>,
}

impl ComparisonSide {
    /// A machine without a frame.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be built.
    pub fn of_machine(name: &str, machine: &Machine, prices: &Prices) -> Result<Self> {
        let built = fixed::elaborate(machine).map_err(|error| with_name(name, error))?;
        let report = json!({"version": env!("CARGO_PKG_VERSION"), "machine": MachineReport::new(&built), "cost": Cost::new(&built, prices)});
        Ok(ComparisonSide {
            name: name.into(),
            report,
            pictures: Vec::new(),
        })
    }

    /// A frame on a machine.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be built, cannot hold the scene, or the record cannot be
    /// replayed on it.
    pub fn of_frame(
        name: &str,
        machine: &Machine,
        frame: &Workload,
        prices: &Prices,
    ) -> Result<Self> {
        match frame {
            Workload::Scene(scene) => ComparisonSide::of_drawing(name, machine, scene, prices),
            Workload::Recording(recording) => {
                ComparisonSide::of_replay(name, machine, recording, prices)
            }
        }
    }

    fn of_drawing(name: &str, machine: &Machine, scene: &Scene, prices: &Prices) -> Result<Self> {
        let outcome = run::run(
            scene,
            machine,
            0.0,
            &Options {
                prices: *prices,
                ..Options::default()
            },
        );
        let outcome = outcome.map_err(|error| with_name(name, error))?;
        let report =
            serde_json::to_value(&outcome.report).map_err(|e| Error::job(e.to_string()))?;
        let shown = |picture: Picture| {
            if outcome.encoded {
                picture.decoded()
            } else {
                picture
            }
        };
        let pictures = PICTURES
            .into_iter()
            .zip([outcome.fixed, outcome.golden, outcome.ideal].map(shown))
            .collect();
        Ok(ComparisonSide {
            name: name.into(),
            report,
            pictures,
        })
    }

    fn of_replay(
        name: &str,
        machine: &Machine,
        recording: &Recording,
        prices: &Prices,
    ) -> Result<Self> {
        recording
            .can_replay(machine)
            .map_err(|what| Error::input(format!("{name}: {what}")))?;
        let built = fixed::elaborate(machine).map_err(|error| with_name(name, error))?;
        let work = &recording.work;
        let cycles = timing::replay(&built.timing, work, Detail::Histograms);
        let report = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scene": {"name": recording.scene, "width": work.width, "height": work.height},
            "machine": MachineReport::new(&built),
            "cycles": CyclesReport::new(&built.timing, work, &cycles),
            "cost": CostReport::new(&built, &cycles, prices),
        });
        Ok(ComparisonSide {
            name: name.into(),
            report,
            pictures: Vec::new(),
        })
    }

    /// A folder that `run` wrote, or its `report.json` without pictures. None if the file is not a
    /// report.
    ///
    /// # Errors
    /// [`Error::Input`], one sentence, if a folder contains no report, a report is incomplete or of
    /// another version, or a picture is absent or of another run.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        let name = path.display().to_string();
        let (file, is_folder) = if path.is_dir() {
            (path.join("report.json"), true)
        } else {
            (path.to_owned(), false)
        };
        let shown = file.display().to_string();
        let input_error = |what: String| Error::input(format!("{shown}: {what}"));
        if is_folder && !file.exists() {
            return Err(Error::input(format!(
                "{name}: has no report.json: a folder that `run --out` wrote is needed"
            )));
        }
        let metadata =
            std::fs::metadata(&file).map_err(|e| input_error(format!("cannot be read: {e}")))?;
        if metadata.len() > MOST_BYTES {
            return Err(input_error(format!(
                "has {} MB; a report has at most {}",
                metadata.len() >> 20,
                MOST_BYTES >> 20
            )));
        }
        let text = input::read_text(&file).map_err(|e| input_error(format!("cannot be read: {e}")));
        let report: Value = match text.and_then(|text| {
            serde_json::from_str(&text).map_err(|e| input_error(format!("is not JSON: {e}")))
        }) {
            Ok(report) => report,
            // A file that is not JSON may be a broken machine, whose reader gives a better message.
            Err(_) if !is_folder => return Ok(None),
            Err(error) => return Err(error),
        };
        if !is_folder && report.pointer("/machine/description").is_none() {
            return Ok(None);
        }
        check(&report, &shown)?;
        let pictures = if is_folder {
            pictures(path, &report)?
        } else {
            Vec::new()
        };
        Ok(Some(ComparisonSide {
            name,
            report,
            pictures,
        }))
    }

    pub(super) fn named(&self) -> Named {
        let text = |pointer: &str| {
            self.report
                .pointer(pointer)
                .and_then(Value::as_str)
                .map(str::to_owned)
        };
        Named {
            name: self.name.clone(),
            machine: text("/machine/description/name").unwrap_or_default(),
            scene: text("/scene/name"),
            size: size(&self.report),
        }
    }
}

fn size(report: &Value) -> Option<[u64; 2]> {
    let side = |name: &str| {
        report
            .pointer(&format!("/scene/{name}"))
            .and_then(Value::as_u64)
    };
    Some([side("width")?, side("height")?])
}

/// Refuses pictures of different sizes.
pub(super) fn check_sizes(a: &ComparisonSide, b: &ComparisonSide) -> Result<()> {
    let (Some(one), Some(other)) = (size(&a.report), size(&b.report)) else {
        return Ok(());
    };
    if one == other || a.pictures.is_empty() || b.pictures.is_empty() {
        return Ok(());
    }
    let text = |[width, height]: [u64; 2]| format!("{width}×{height}");
    let sentence = format!(
        "{} is {} and {} {}: only pictures of the same size can be compared; give the two report.json to compare figures only",
        a.name,
        text(one),
        b.name,
        text(other)
    );
    Err(Error::input(sentence))
}

/// Adds the name of a side to an error.
fn with_name(name: &str, error: Error) -> Error {
    match error {
        Error::Input(sentence) => Error::input(format!("{name}: {sentence}")),
        job @ Error::Job(_) => job,
    }
}

/// Refuses a value that is not a report of this version.
fn check(report: &Value, whose: &str) -> Result<()> {
    let input_error = |what: String| Error::input(format!("{whose}: {what}"));
    let dotted = |pointer: &str| pointer[1..].replace('/', ".");
    let lacks = |pointer: &str| {
        input_error(format!(
            "has no {}: it is not a report of `run`",
            dotted(pointer)
        ))
    };
    let (own, version) = (
        env!("CARGO_PKG_VERSION"),
        report.get("version").and_then(Value::as_str),
    );
    match version {
        None => return Err(lacks("/version")),
        Some(version) if version != own => {
            let version = crate::output::text::clipped(version);
            return Err(input_error(format!(
                "is of splatsim {version}, and this is {own}: draw it again to compare"
            )));
        }
        Some(_) => {}
    }
    if let Some(frames) = report.get("frames").and_then(Value::as_array) {
        return Err(input_error(format!(
            "is of a sequence of {}, and only single frames can be compared: `run --frame N` draws it",
            frames.len()
        )));
    }
    report
        .pointer("/scene/name")
        .filter(|name| name.is_string())
        .ok_or_else(|| lacks("/scene/name"))?;
    if report
        .get("accuracy")
        .is_some_and(|accuracy| accuracy.is_object() && accuracy.get("lockstep").is_none())
    {
        return Err(input_error(
            "was drawn with `--check none`, so its flips are unknown: draw it with `sampled` or `full` to compare".into(),
        ));
    }
    let is_amount = |value: &Value| {
        value
            .as_f64()
            .is_some_and(|amount| (0.0..1e18).contains(&amount))
    };
    NUMBERS
        .iter()
        .find(|pointer| !report.pointer(pointer).is_some_and(is_amount))
        .map_or(Ok(()), |pointer| Err(lacks(pointer)))?;
    let is_decibels = |value: &Value| value.is_number() || value.is_null();
    DECIBELS
        .iter()
        .find(|pointer| !report.pointer(pointer).is_some_and(is_decibels))
        .map_or(Ok(()), |pointer| Err(lacks(pointer)))?;
    let units = report
        .pointer("/cycles/units")
        .and_then(Value::as_array)
        .ok_or_else(|| lacks("/cycles/units"))?;
    let counts = |unit: &Value| {
        ["busy", "starved", "blocked", "memory"]
            .iter()
            .all(|state| unit[state].is_u64())
            && unit["name"].is_string()
    };
    if !units.iter().all(counts) {
        return Err(lacks("/cycles/units/busy"));
    }
    let described = report
        .pointer("/machine/description")
        .ok_or_else(|| lacks("/machine/description"))?;
    let machine = machines::from_value(described, &format!("{whose}: machine.description"))?;
    fixed::elaborate(&machine).map_err(|error| self::with_name(whose, error))?;
    Ok(())
}

/// The three pictures of a folder.
fn pictures(folder: &Path, report: &Value) -> Result<Vec<(&'static str, Picture)>> {
    let [width, height] = size(report).unwrap_or_default();
    let read = |name: &'static str| {
        let path = folder.join(name).with_extension("png");
        let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
        if !path.is_file() {
            return Err(input_error(
                "is absent, and report.json is there: draw the folder again".into(),
            ));
        }
        let open =
            || image::ImageReader::open(&path).and_then(image::ImageReader::with_guessed_format);
        let cannot = |e: &dyn std::fmt::Display| input_error(format!("is not a picture: {e}"));
        let (columns, rows) = open()
            .map_err(|e| cannot(&e))?
            .into_dimensions()
            .map_err(|e| cannot(&e))?;
        if [u64::from(columns), u64::from(rows)] != [width, height] {
            return Err(input_error(format!(
                "is {columns}×{rows}, and report.json is of {width}×{height}: it is of another run"
            )));
        }
        if width.saturating_mul(height) > MOST_PIXELS as u64 {
            return Err(input_error(format!(
                "has {width}×{height} pixels; at most {MOST_PIXELS} are drawn"
            )));
        }
        let decoded = open()
            .map_err(|e| cannot(&e))?
            .decode()
            .map_err(|e| cannot(&e))?;
        Ok((name, linear(&decoded.into_rgba8())))
    };
    PICTURES.into_iter().map(read).collect()
}

/// A picture from its file, 8 bits per channel, in linear light.
fn linear(file: &image::RgbaImage) -> Picture {
    let light: Vec<f64> = (0..=255)
        .map(|code| srgb_decode(f64::from(code) / 255.0))
        .collect();
    let pixel = |pixel: &image::Rgba<u8>| {
        let [r, g, b, alpha] = pixel.0;
        let alpha = f64::from(alpha) / 255.0;
        let [r, g, b] = [r, g, b].map(|code| light[usize::from(code)] * alpha);
        [r, g, b, alpha]
    };
    let rgba: Vec<[f64; 4]> = file.pixels().map(pixel).collect();
    // The file does not contain which pixels a splat touched.
    let covered = vec![true; rgba.len()];
    Picture {
        width: file.width() as usize,
        height: file.height() as usize,
        rgba,
        covered,
    }
}
