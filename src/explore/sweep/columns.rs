//! Columns: lists every figure of a point of a sweep once: its name, the kind of its cells, and its
//! source.
//!
//! A new column is one line here. Charts and summaries use its constant, so a mistyped column does
//! not compile.

use super::plan::Points;
use super::table::{CellKind, Column, Row, named};
use crate::accuracy::flicker::Flicker;
use crate::accuracy::ranges::Overflows;
use crate::accuracy::{Metrics, Summary};
use crate::performance::cost::CostReport;
use crate::performance::cycles::CyclesReport;
use crate::run::report::MachineReport;
use rtl_model::timing::{Account, Cycles};
use rtl_model::units::fragment::Outcomes;
use serde_json::{Value, json};

/// Results of a point. Results that were not measured are None, and their cells are empty.
#[derive(Clone, Debug, Default)]
pub(super) struct Findings {
    /// Why the machine cannot be built or cannot hold the scene.
    pub misfit: Option<String>,
    /// Set if only a sample was drawn, because the PSNR is surely too low.
    pub screened: Option<Screened>,
    pub errors: Option<Errors>,
    pub frame: Option<FrameFindings>,
    pub lockstep: Option<Summary>,
    pub flicker: Option<Flicker>,
    pub replay: Option<ReplayFindings>,
    pub host_seconds: f64,
}

/// Errors of a sample of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screened {
    pub tiles: u64,
    /// Estimate of the PSNR, and the upper end of its interval.
    pub psnr_db: f64,
    pub psnr_high_db: f64,
}

/// Errors of the picture.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    pub fixed_vs_golden: Metrics,
    pub golden_vs_ideal_psnr_db: Option<f64>,
    pub fixed_vs_ideal_psnr_db: Option<f64>,
    pub golden_seconds: f64,
}

/// Counts of the frame.
#[derive(Clone, Debug)]
pub(super) struct FrameFindings {
    pub overflows: Overflows,
    pub outcomes: Outcomes,
    pub fixed_seconds: f64,
    pub ideal_seconds: f64,
}

/// Cycles and costs of the machine.
#[derive(Clone, Debug)]
pub(super) struct ReplayFindings {
    pub cycles: CyclesReport,
    pub cost: CostReport,
    pub machine: MachineReport,
    pub units: Cycles,
    /// From a splat to a pixel's word, through units without stalls.
    pub latency_ns: f64,
}

/// A figure of a point.
struct ColumnFigure {
    name: &'static str,
    kind: CellKind,
    cell: fn(&Findings) -> Value,
}

macro_rules! figures {
    ($all:ident: $($constant:ident = $name:literal, $kind:ident, $cell:expr;)*) => {
        $(#[doc = concat!("`", $name, "`")] pub const $constant: &str = $name;)*
        const $all: &[ColumnFigure] = &[$(ColumnFigure { name: $name, kind: CellKind::$kind, cell: $cell }),*];
    };
}

/// The cell of a result that may not have been measured.
fn of<T>(part: &Option<T>, cell: impl FnOnce(&T) -> Value) -> Value {
    part.as_ref().map_or(Value::Null, cell)
}

// A PSNR is also empty if the pictures are equal.
figures! { FIGURES:
    MISFIT = "misfit", Text, |f| json!(f.misfit);
    PSNR_DB = "psnr_db", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.psnr_db));
    PSNR_COVERED_DB = "psnr_covered_db", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.psnr_covered_db));
    SSIM = "ssim", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.ssim));
    MAX_ERROR = "max_error", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.max_error));
    MEAN_ERROR = "mean_error", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.mean_error));
    PIXELS_OVER_1_255 = "pixels_over_1_255", Whole, |f| of(&f.errors, |e| json!(e.fixed_vs_golden.pixels_over_1_255));
    GOLDEN_VS_IDEAL_PSNR_DB = "golden_vs_ideal_psnr_db", Number, |f| of(&f.errors, |e| json!(e.golden_vs_ideal_psnr_db));
    FIXED_VS_IDEAL_PSNR_DB = "fixed_vs_ideal_psnr_db", Number, |f| of(&f.errors, |e| json!(e.fixed_vs_ideal_psnr_db));
    LOCKSTEP_PSNR_DB = "lockstep_psnr_db", Number, |f| of(&f.lockstep, |l| json!(l.psnr_db));
    LOCKSTEP_MAX_ERROR = "lockstep_max_error", Number, |f| of(&f.lockstep, |l| json!(l.max_error));
    BOUND_VIOLATIONS = "bound_violations", Whole, |f| of(&f.lockstep, |l| json!(l.bound_violations));
    DECISION_FLIPS = "decision_flips", Whole, |f| of(&f.lockstep, |l| json!(l.decision_flips));
    FLICKER_MEAN = "flicker_mean", Number, |f| of(&f.flicker, |f| json!(f.fixed_vs_golden.mean));
    FLICKER_JUMPS = "flicker_jumps", Number, |f| of(&f.flicker, |f| json!(f.fixed_vs_golden.jumps));
    GOLDEN_VS_IDEAL_FLICKER_MEAN = "golden_vs_ideal_flicker_mean", Number, |f| of(&f.flicker, |f| json!(f.golden_vs_ideal.mean));
    GOLDEN_VS_IDEAL_FLICKER_JUMPS = "golden_vs_ideal_flicker_jumps", Number, |f| of(&f.flicker, |f| json!(f.golden_vs_ideal.jumps));
    FIXED_VS_IDEAL_FLICKER_MEAN = "fixed_vs_ideal_flicker_mean", Number, |f| of(&f.flicker, |f| json!(f.fixed_vs_ideal.mean));
    FIXED_VS_IDEAL_FLICKER_JUMPS = "fixed_vs_ideal_flicker_jumps", Number, |f| of(&f.flicker, |f| json!(f.fixed_vs_ideal.jumps));
    SATURATED = "saturated", Whole, |f| of(&f.frame, |frame| json!(frame.overflows.saturated));
    WRAPPED = "wrapped", Whole, |f| of(&f.frame, |frame| json!(frame.overflows.wrapped));
    CONTRIBUTIONS = "contributions", Whole, |f| of(&f.frame, |frame| json!(frame.outcomes.total()));
    MERGED = "merged", Whole, |f| of(&f.frame, |frame| json!(frame.outcomes.merged));
    EVICTED = "evicted", Whole, |f| of(&f.frame, |frame| json!(frame.outcomes.evicted));
    CYCLES = "cycles", Whole, |f| of(&f.replay, |r| json!(r.cycles.total));
    FRAMES_PER_SECOND = "frames_per_second", Number, |f| of(&f.replay, |r| json!(r.cycles.frames_per_second));
    BOTTLENECK = "bottleneck", Text, |f| of(&f.replay, |r| json!(r.cycles.bottleneck));
    MEMORY_BYTES = "memory_bytes", Whole, |f| of(&f.replay, |r| json!(r.cycles.memory.bytes));
    AREA = "area", Number, |f| of(&f.replay, |r| json!(r.cost.cost.area));
    MULTIPLIER_BLOCKS_18 = "multiplier_blocks_18", Whole, |f| of(&f.replay, |r| json!(r.blocks_18()));
    FIFO_BITS = "fifo_bits", Whole, |f| of(&f.replay, |r| json!(r.cost.cost.fifo_bits));
    MEMORY_BITS = "memory_bits", Whole, |f| of(&f.replay, |r| json!(r.cost.cost.memory_bits));
    FRAME_BITS_PER_PIXEL = "frame_bits_per_pixel", Whole, |f| of(&f.replay, |r| json!(r.cost.cost.frame_bits_per_pixel));
    FRAGMENT_BITS = "fragment_bits", Whole, |f| of(&f.replay, |r| json!(r.machine.fragment_bits));
    WIDEST_OPERAND_BITS = "widest_operand_bits", Whole, |f| of(&f.replay, |r| json!(r.machine.widest_operand_bits));
    ENERGY_J = "energy_j", Number, |f| of(&f.replay, |r| json!(r.cost.energy.total));
    GATES = "gates", Number, |f| of(&f.replay, |r| json!(r.cost.cost.gates.total));
    SRAM_KBIT = "sram_kbit", Number, |f| of(&f.replay, |r| json!(r.cost.cost.gates.sram_kbit));
    LATENCY_NS = "latency_ns", Number, |f| of(&f.replay, |r| json!(r.latency_ns));
}

// Only in sweeps that screen: empty if the machine was drawn in full.
figures! { SCREENED:
    SAMPLED_TILES = "tiles", Whole, |f| of(&f.screened, |s| json!(s.tiles));
    SAMPLED_PSNR_DB = "sampled_psnr_db", Number, |f| of(&f.screened, |s| json!(s.psnr_db));
    SAMPLED_PSNR_HIGH_DB = "sampled_psnr_high_db", Number, |f| of(&f.screened, |s| json!(s.psnr_high_db));
}

// On this computer: for a point in total, and for a frame of each renderer.
figures! { SECONDS:
    HOST_SECONDS = "host_seconds", Number, |f| json!(f.host_seconds);
    HOST_FIXED_SECONDS = "host_fixed_seconds", Number, |f| of(&f.frame, |frame| json!(frame.fixed_seconds));
    HOST_GOLDEN_SECONDS = "host_golden_seconds", Number, |f| of(&f.errors, |e| json!(e.golden_seconds));
    HOST_IDEAL_SECONDS = "host_ideal_seconds", Number, |f| of(&f.frame, |frame| json!(frame.ideal_seconds));
}

/// `point`: the number of a row.
pub const POINT: &str = "point";
/// `key`: a digest of all that determines a row.
pub const KEY: &str = "key";
/// `scene`: name of the scene.
pub const SCENE: &str = "scene";
/// `changes`: how the machine differs from the plan's.
pub const CHANGES: &str = "changes";

/// Columns before the plan's own fields.
const HEAD: [(&str, CellKind); 4] = [
    (POINT, CellKind::Whole),
    (KEY, CellKind::Text),
    (SCENE, CellKind::Text),
    (CHANGES, CellKind::Text),
];

/// Units with an account of their cycles each; parallel units are added up. Empty if a machine
/// lacks the unit.
pub use rtl_model::timing::UNITS;

/// States of a unit in a cycle.
pub const ACCOUNTS: [&str; 4] = ["busy", "starved", "blocked", "memory"];

/// Name of the column of a unit's account.
pub fn account(unit: &str, account: &str) -> String {
    format!("{unit}_{account}")
}

/// All columns of a plan.
pub(super) fn all(points: &Points) -> Vec<Column> {
    let accounts = UNITS
        .iter()
        .flat_map(|unit| ACCOUNTS.map(|name| (account(unit, name), CellKind::Whole)));
    let figure = |figure: &ColumnFigure| (figure.name.to_owned(), figure.kind);
    named(&HEAD)
        .into_iter()
        .chain(points.columns())
        .chain(FIGURES.iter().chain(screened(points)).map(figure))
        .chain(accounts)
        .chain(SECONDS.iter().map(figure))
        .collect()
}

fn screened(points: &Points) -> &'static [ColumnFigure] {
    if points.plan.screen.is_some() {
        SCREENED
    } else {
        &[]
    }
}

/// The cells after the plan's own fields.
pub(super) fn cells(points: &Points, findings: &Findings) -> Row {
    let accounts = UNITS.iter().flat_map(|unit| {
        findings
            .replay
            .as_ref()
            .map_or([const { Value::Null }; 4], |replay| replay.accounts(unit))
    });
    let cell = |figure: &ColumnFigure| (figure.cell)(findings);
    FIGURES
        .iter()
        .chain(screened(points))
        .map(cell)
        .chain(accounts)
        .chain(SECONDS.iter().map(cell))
        .collect()
}

impl ReplayFindings {
    fn blocks_18(&self) -> u64 {
        self.cost
            .cost
            .units
            .iter()
            .map(|unit| unit.bits.blocks_18)
            .sum()
    }

    /// Cycles of a unit, and of those of its kind, by [`ACCOUNTS`]; None if the machine lacks it.
    fn accounts(&self, unit: &str) -> [Value; 4] {
        let same = || self.units.units.iter().filter(|other| other.name == unit);
        let of = |count: fn(&Account) -> u64| {
            json!(same().map(|other| count(&other.account)).sum::<u64>())
        };
        if same().next().is_none() {
            return [const { Value::Null }; 4];
        }
        [
            of(|a| a.busy),
            of(|a| a.starved),
            of(|a| a.blocked),
            of(|a| a.memory),
        ]
    }
}
