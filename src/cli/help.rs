//! Help: texts at the end of a command's help: lists for `-h`, and an example for `--help`.
//!
//! Law (tests/cli.rs): `each_command_has_an_example_that_is_accepted`.

/// Shared by `NAMES` and `TRACE`.
macro_rules! names {
    () => {
        "Built-in scenes: glass-spheres, checkerboard, torus-knot, terrain;\n\
         volumes nested-shells, marschner-lobb, fuzzy-clouds; Gaussians bouquet\n\
         Named machines: reference, lean, tiny, window; volume; gaussian"
    };
}

/// Names of scenes and machines.
pub(super) const NAMES: &str = names!();

pub(super) const COMPARE: &str = "A and B are two machines (a name or a file), or two results (a folder that\n\
    `run --out` wrote, or its report.json). Machines are compared by fields and\n\
    areas; with --scene both draw a scene, with --replay both replay a record.";

pub(super) const STRESS: &str = "Exits with status 1 if a pixel exceeds its bound, a flip has no explanation, or\n\
    a failure is not reported.";

pub(super) const SWEEP: &str = "Built-in plans: precision, precision-in-lockstep, curves, architecture, layers,\n\
    clock. `splatsim scene plan-schema` prints the format of plans.";

pub(super) const VIEW: &str = "The page is served to this computer only, and needs the token in its address.\n\
    Other users of this computer may see the token in the list of processes while\n\
    the browser starts; with --no-open it is only printed.\n\
    Exact values of pixels are computed from the scene on request; an exported page\n\
    does not have them.";

pub(super) const TRACE: &str = concat!(
    "Units: pipeline, project, ellipse, sort (of Gaussians), raster, gauss, fragment,\n\
     shade, resolve\n",
    names!()
);

pub(super) const DIFF: &str = "Records of streams that are ordered per pixel may come in another order. A file\n\
    in tile order is recognised, and a line of the output says so; --order decides.\n\
    Fields without a meaning, as the pixel of a culled splat, must be 0: --strict\n\
    compares them.\n\
    Exit status: 0 if all records are equal, 1 if not, 2 if a file is malformed.";

pub(super) const UNIT: &str = "Units: project, ellipse, sort (of Gaussians), raster, gauss, fragment, shade,\n\
    resolve. Records come from standard input, one per line, as in a trace: the\n\
    output for gauss.in.hex is gauss.out.hex. An empty line, and the end of the\n\
    input, end a frame: then sort prints, and fragment writes what its pixels hold.\n\
    Exit status 2 if a record is malformed, with its line and field.";

pub(super) const SAMPLE: &str = "Meshes: OBJ with its MTL and pictures, PLY with faces, glTF 2.0 and GLB, STL;\n\
    built in is `plane`, a unit square.";

/// The end of a long help: the list, if there is one, and an example command.
pub(super) fn with_example(list: &str, example: &str) -> String {
    let gap = if list.is_empty() { "" } else { "\n\n" };
    format!("{list}{gap}Example:\n  {example}")
}
