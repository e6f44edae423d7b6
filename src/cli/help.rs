//! Help: texts of several commands, lists at the end of a command's help, and an example for
//! `--help`.
//!
//! Laws: `each_command_has_an_example_that_is_accepted` (tests/cli.rs); below,
//! `the_listed_plans_have_the_listed_points` and `the_plan_in_the_help_is_accepted`.

use clap::Command;
use std::fmt::Write;

/// Shared by `NAMES` and `TRACE`.
macro_rules! names {
    () => {
        "Built-in scenes: glass-spheres, checkerboard, torus-knot, terrain;\n\
         volumes nested-shells, marschner-lobb, fuzzy-clouds; Gaussians bouquet, city\n\
         Named machines: reference, lean, tiny, window; volume; gaussian, fp16,\n\
         mixed, weighted, gscore, neo, flicker, nycu, cubed"
    };
}

/// Names of scenes and machines.
pub(super) const NAMES: &str = names!();

/// How a field is set: the first line, and the notation of values.
macro_rules! setting {
    ($first:literal) => {
        concat!(
            $first,
            "\n\n\
             A format is U (unsigned) or I (signed), the number of integer bits,\n\
             which includes the sign bit, F, and the number of fraction bits:\n\
             I4F22 has 26 bits; U-2F16 has 14 bits and holds 0 to 0.25.\n\
             Other values are written as in the file: timing.raster.lanes=[4,1].\n\
             `machine show NAME` lists the fields of a machine, and\n\
             `machine schema` describes them."
        )
    };
}

/// `--set`, in `-h` and in `--help`.
pub(super) const SET: &str = "Set a field: gauss.falloff=U1F12; may repeat";
pub(super) const SET_LONG: &str = setting!("Set a field: gauss.falloff=U1F12; may repeat");
/// `--set` of `compare`.
pub(super) const SET_BOTH_LONG: &str =
    setting!("Set a field of both: gauss.falloff=U1F12; may repeat");
/// `--set` of `replay`.
pub(super) const SET_TIMING_LONG: &str = "Set a field: timing.raster.fifo=4; may repeat\n\n\
    Fields below timing and fields of lists, such as bin.test and\n\
    sort.kind, can be set. `machine show NAME` lists the fields of a\n\
    machine, and `machine schema` describes them.";

/// `--timing`, in `-h` and in `--help`.
pub(super) const EACH: &str = "Compare cycles for each value; may repeat";
pub(super) const EACH_LONG: &str = "Compare cycles for each value; may repeat\n\n\
    timing.memory.bytes_per_cycle=16,32 gives a row per value.\n\
    Several fields are replayed in all combinations of their values.\n\
    Fields below timing and fields of lists, such as bin.test and\n\
    sort.kind, can differ: they change no picture.";

/// `--cameras`, in `-h` and in `--help`.
pub(super) const CAMERAS: &str = "Read cameras of nerfstudio, COLMAP, 3DGS, `search`";
pub(super) const CAMERAS_LONG: &str = "Read cameras of nerfstudio, COLMAP, 3DGS, `search`\n\n\
    The file is transforms.json or camera_path.json of nerfstudio, images\n\
    or cameras of COLMAP as .txt or .bin, cameras.json of programs that\n\
    train Gaussians, or cameras.json of a folder that `search` wrote. In a\n\
    folder, such as a COLMAP project, the file is found.";

/// `run --against`, in `--help`.
pub(super) const AGAINST_LONG: &str = "Compare with photographs: PSNR, SSIM, FLIP\n\n\
    A picture is for one frame, a folder for all frames. Pictures of a\n\
    folder are paired with frames by the names in the file of cameras; if\n\
    it has no names, by the order of the pictures' names:\n\
    splatsim run cloud.ply --cameras sparse/0 --against images";

/// Renderers, and columns of the table of units.
const RUN: &str = "Renderers: fixed is the machine, bit by bit; golden applies its rules in f64;\n\
    ideal, also in f64, has no limit of fragments per pixel. fixed − golden is the\n\
    error of word lengths and tables, golden − ideal that of layers and rules.\n\
    Cycles of a unit: busy, with an item; starved, without an item; blocked, by a\n\
    full FIFO or by a pixel in flight; memory, until data arrive from memory.";

pub(super) fn run() -> String {
    format!("{RUN}\n{NAMES}")
}

pub(super) const COMPARE: &str = "A and B are two machines (a name or a file), or two results (a folder that\n\
    `run --out` wrote, or its report.json). Machines are compared by fields and\n\
    areas; with --scene both draw a scene, with --replay both replay a record.";

pub(super) const STRESS: &str = "Exits with status 1 if a pixel exceeds its bound, a flip has no explanation, or\n\
    a failure is not reported.";

/// Built-in plans.
pub(super) const SWEEP: &str = "Built-in plans; each draws glass-spheres on machines made from reference:\n  \
      precision              212 points: each word with 4 or 2 fraction bits less,\n                         \
                                        or 2 more\n  \
      precision-in-lockstep  212 points: the same, also in lockstep\n  \
      curves                  45 points: bits of splat.rgb, raster.offset,\n                         \
                                        gauss.weight and project.camera\n  \
      architecture           200 points: timing.raster.lanes, timing.raster.fifo,\n                         \
                                        timing.tile.side_px, timing.shade.latency\n  \
      layers                  12 points: fragment.merge, fragment.layers\n  \
      clock                   72 points: timing.clock_hz with latencies\n\
    A plan without `machine` uses reference, which draws only discs: volumes need\n\
    volume, Gaussians gaussian. `scene plan-schema` prints the format of plans.\n\
    Exits with status 1 if no machine of the plan can draw its scenes.";

/// A complete plan.
pub(super) const PLAN: &str = r#"{"scenes": ["bouquet"], "size": [64, 64], "machine": "gaussian", "axes": [
    {"field": "gauss.weight", "add_frac_bits": [-8, -4, 0]},
    {"field": "timing.raster.fifo", "values": [4, 16]}]}"#;

pub(super) fn sweep() -> String {
    let plan = PLAN.replace('\n', "\n  ");
    with_example(
        &format!("{SWEEP}\n\nA complete plan, as a file:\n  {plan}"),
        "splatsim sweep layers --out rows",
    )
}

pub(super) const SEARCH: &str = "Targets combine: all must hold on each scene; --over takes only --target-psnr.\n\
    Errors are of fixed − golden, or of fixed − ideal with --against ideal. The time\n\
    grows with the size of the picture, the number of words and --tries: --size and\n\
    --only reduce it.";

pub(super) fn search() -> String {
    format!("{SEARCH}\n{NAMES}")
}

pub(super) const CHART: &str = "Figures; each is drawn if its values vary:\n  \
      accuracy-area   errors against area; a ring marks a machine that no other\n                  \
                                beats in both\n  \
      accuracy-speed  errors against frames/s\n  \
      speed-area      frames/s against area\n  \
      sensitivity     PSNR of each word with fewer or more fraction bits\n  \
      curves          PSNR by bits of one word\n  \
      flicker         pixels that jump from frame to frame, by bits of one word\n  \
      layers          golden − ideal and merges, by layers and merge rule\n  \
      clock           gates, latency and frames/s by clock\n  \
      cycles          busy, starved, blocked and memory cycles of each unit\n  \
      host-speed      accuracy against speed of the simulator";

pub(super) const VIEW: &str = "The page is served to this computer only, and needs the token in its address.\n\
    Other users of this computer may see the token in the list of processes while\n\
    the browser starts; with --no-open it is only printed.\n\
    Exact values of pixels are computed from the scene on request; an exported page\n\
    does not have them.";

pub(super) const TRACE: &str = concat!(
    "UNIT.in.hex and UNIT.out.hex have one record per line, README.md describes the\n\
     fields, machine_pkg.sv and records.svh (C: records.h) define them. A frame can\n\
     have a million records: --sample, --pixels or --stimulus limits them.\n\
     Units: pipeline, project, ellipse, colour (of harmonics), sort (of Gaussians),\n\
     raster, gauss, fragment, shade, resolve\n",
    names!()
);

pub(super) const DIFF: &str = "FILE has one record per line in hexadecimal, as DIR/gauss.out.hex has;\n\
    DIR/README.md describes the fields.\n\
    Records of streams that are ordered per pixel may come in another order. A file\n\
    in tile order is recognised, and a line of the output says so; --order decides.\n\
    Fields without a meaning, as the pixel of a culled splat, must be 0: --strict\n\
    compares them.\n\
    Exit status: 0 if all records are equal, 1 if not, 2 if a file is malformed.";

pub(super) const UNIT: &str = "Units: project, ellipse, colour (of harmonics), sort (of Gaussians), raster,\n\
    gauss, fragment, shade, resolve. Records come from standard input, one per line,\n\
    as in a trace: the output for gauss.in.hex is gauss.out.hex. An empty line, and\n\
    the end of the input, end a frame: then sort prints, and fragment writes what\n\
    its pixels hold.\n\
    Exit status 2 if a record is malformed, with its line and field.";

pub(super) const MACHINE: &str =
    "Records of a frame, with SystemVerilog and C headers, are written by `trace`.";

pub(super) const SHOW: &str = "Optional fields at their default are left out, such as timing.engines;\n\
    `machine schema` describes all fields.";

pub(super) const TIMING: &str = "Latencies and intervals that the machine file leaves out are derived. The clock\n\
    is not printed, and memory only if it has a preset: `machine show` prints\n\
    timing.clock_hz and timing.memory.";

pub(super) const DATAPATH: &str = "A box is a word with its format and its wires, below the words that it is made\n\
    from; white boxes are inputs. Each unit has a file UNIT.svg, or several.";

pub(super) const RTL: &str = "Units whose arithmetic is a graph: project, ellipse or ellipsoid, colour, gauss.\n\
    Words, tables and kind of splats are fixed; ports are those of the units in\n\
    rtl_model/rtl, which are written by hand for all machines.\n\
    Compile machine_pkg.sv first; the simulator runs in DIR, or ROMS is DIR/rom/.";

pub(super) const COST: &str = "area: LUT equivalents, and share; gates: NAND2 equivalents; 18×18: multiplier\n\
    blocks of 18 × 18 bits; adders: bits of adders, comparators, rounding; choices:\n\
    bits of multiplexers of two words; registers: flip-flops; tables: bits.";

pub(super) const SAMPLE: &str = "Meshes: OBJ with its MTL and pictures, PLY with faces, glTF 2.0 and GLB, STL;\n\
    built in is `plane`, a unit square.";

/// The end of a long help: the list, if there is one, and an example command.
pub(super) fn with_example(list: &str, example: &str) -> String {
    let gap = if list.is_empty() { "" } else { "\n\n" };
    format!("{list}{gap}Example:\n  {example}")
}

/// Each group of commands by its first command, in the order of the commands.
const GROUPS: [(&str, &str); 4] = [
    ("run", "Draw a scene"),
    ("sweep", "Explore machines"),
    ("trace", "Verify RTL"),
    ("machine", "Machines, scenes and tools"),
];

/// The end of the program's help.
pub(super) const EXAMPLES: &str = "Examples:\n  \
      splatsim run bouquet --out out\n  \
      splatsim machine show gaussian\n  \
      splatsim search torus-knot --target-psnr 45\n\
    `splatsim COMMAND --help` describes a command.";

/// The program's help, with its commands in groups.
pub(super) fn in_groups(command: Command) -> Command {
    let style = *command.get_styles().get_header();
    let literal = *command.get_styles().get_literal();
    let mut list = String::new();
    for one in command.get_subcommands() {
        let name = one.get_name();
        if let Some((_, heading)) = GROUPS.iter().find(|(first, _)| *first == name) {
            let _ = writeln!(list, "\n{style}{heading}:{style:#}");
        }
        let about = one.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(list, "  {literal}{name:<11}{literal:#}  {about}");
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{list}\n{style}Options:{style:#}\n{{options}}{{after-help}}"
    ))
}

#[cfg(test)]
mod tests {
    use super::{PLAN, SWEEP};
    use crate::explore::sweep::plan::{Points, READY};
    use std::path::Path;

    #[test]
    fn the_listed_plans_have_the_listed_points() {
        for (name, _) in READY {
            let points = Points::load(name).unwrap();
            let line = format!("\n  {name:<21}  {:>3} points: ", points.count());
            assert!(SWEEP.contains(&line), "{line}");
            assert!(
                points.plan.scenes == ["glass-spheres"] && points.base.name == "reference",
                "{name}"
            );
            let fields = points.fields();
            let is_named = |field: &&String| SWEEP.contains(field.as_str());
            assert!(
                name == "clock" || fields.iter().all(|field| is_named(&field)),
                "{fields:?}"
            );
        }
    }

    #[test]
    fn the_plan_in_the_help_is_accepted() {
        let points = Points::from_text(PLAN, "the plan", Path::new("")).unwrap();
        assert_eq!(points.count(), 6);
    }
}
