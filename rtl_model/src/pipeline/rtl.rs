//! RTL: SystemVerilog of the units that are graphs, written for one machine and one kind of frame.
//!
//! ```text
//! record ─┬─► fields ─►┌──────────────────┐─► fields, 0 where a flag is set ─►[ pipe ]─► record
//! frame ──┴─► words ──►│ UNIT_datapath.sv │
//!                      └──────────────────┘
//! ```
//! Each unit has the ports of its implementation by hand in `rtl`, and can take its place. What is
//! around the graph comes from [`ports`]: a field's place, and the flags that clear it.
//!
//! Laws: `generated_rtl_gives_the_records_of_the_machine`,
//! `datapaths_without_records_give_the_results_of_their_graphs` (tests/generated of the bench).

use super::Elaborated;
use super::ports::{self, Field, Kind, Stream};
use crate::elaboration::microarchitecture::BinWords;
use crate::elaboration::{Elaboration, Signal};
use crate::frame::Frame;
use crate::graph::Graph;
use crate::graph::flow::Flow;
use crate::graph::verilog::{Module, Port};
use crate::records::unit;
use crate::units::{colour, ellipse};
use std::collections::BTreeSet;
use std::fmt::Write;

/// A file of SystemVerilog: its name, and its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing {
    /// Name.
    pub name: String,
    /// Content.
    pub text: String,
}

/// Where an input of a graph comes from.
#[derive(Clone, Debug)]
enum Source {
    /// A field of the unit's record.
    Record(String),
    /// A constant of the frame.
    Frame(String),
    /// Its opposite.
    Opposite(String),
    /// One less: the last pixel of a side.
    OneLess(String),
    /// A field below a constant of the frame: a condition.
    Below(String, String),
    /// Always this word.
    Word(i64),
    /// The cutoff of an ellipsoid's box: a ROM, addressed by the opacity.
    Reach,
}

/// A unit around a graph.
struct Unit<'a, const OUTPUTS: usize> {
    /// Name of the module.
    name: &'static str,
    /// The unit whose streams it has.
    stream: &'static str,
    graph: &'a Graph<OUTPUTS>,
    /// Name and source of each input.
    inputs: Vec<(String, Source)>,
    /// Names of the results: those of fields, or others, which are dropped.
    outputs: [&'static str; OUTPUTS],
}

fn record(name: &str) -> (String, Source) {
    (name.to_owned(), Source::Record(name.to_owned()))
}

fn register(name: &str) -> (String, Source) {
    (name.to_owned(), Source::Frame(name.to_owned()))
}

fn each(name: &str, ends: &[&str], of: fn(&str) -> (String, Source)) -> Vec<(String, Source)> {
    ends.iter()
        .map(|end| of(&format!("{name}_{end}")))
        .collect()
}

const XYZ: [&str; 3] = ["x", "y", "z"];
const XY: [&str; 2] = ["x", "y"];

fn rotation() -> Vec<(String, Source)> {
    each(
        "rotation",
        &["00", "01", "02", "10", "11", "12", "20", "21", "22"],
        register,
    )
}

/// `project`.
fn project(elaborated: &Elaborated, kind: Kind) -> Unit<'_, 13> {
    let mut inputs = each("position", &XYZ, record);
    inputs.push((
        "transparent".into(),
        if kind.ellipsoids {
            Source::Below("opacity".into(), "least_opacity".into())
        } else {
            Source::Word(0)
        },
    ));
    inputs.extend(each("eye", &XYZ, register));
    inputs.extend(rotation());
    // A result has the name of the frame's limit.
    inputs.push(("near_plane".into(), Source::Frame("near".into())));
    inputs.extend(each("guard", &XY, register));
    inputs.extend(if elaborated.machine.ellipse.aspect.is_some() {
        each("focal", &XY, register)
    } else {
        XY.map(|axis| (format!("focal_{axis}"), Source::Frame("focal".into())))
            .to_vec()
    });
    inputs.extend(each("centre", &XY, register));
    Unit {
        name: unit::PROJECT,
        stream: unit::PROJECT,
        graph: elaborated.project.graph(),
        inputs,
        outputs: [
            "camera_x",
            "camera_y",
            "forward",
            "exponent",
            "depth",
            "inverse_depth",
            "inverse_depth_exponent",
            "slope_x",
            "slope_y",
            "pixel_x",
            "pixel_y",
            "near",
            "outside",
        ],
    }
}

/// `ellipse` of a kind of splat.
fn ellipse_unit(elaborated: &Elaborated, variant: ellipse::Variant) -> Unit<'_, 17> {
    let unit = &elaborated.ellipse;
    let mut inputs = each("normal", &XYZ, record);
    for name in [
        "radius",
        "exponent",
        "forward",
        "inverse_depth",
        "inverse_depth_exponent",
        "slope_x",
        "slope_y",
        "pixel_x",
        "pixel_y",
    ] {
        inputs.push(record(name));
    }
    let ellipsoid = variant.ellipsoid();
    if let Some(ellipsoid) = ellipsoid {
        inputs.push(record("opacity"));
        inputs.push(("cutoff".into(), Source::Reach));
        if ellipsoid.own {
            inputs.extend(each("quaternion", &["w", "x", "y", "z"], record));
            inputs.extend(each("scale", &["0", "1", "2"], record));
        }
    }
    // Results have the same names.
    for (name, _) in &mut inputs {
        *name = format!("splat_{name}");
    }
    inputs.extend(rotation());
    inputs.extend(["cull_backfaces", "focal", "low_pass", "root_cutoff"].map(register));
    inputs.push(("inverse_two_pi".into(), Source::Word(unit.inverse_two_pi())));
    if ellipsoid.is_none() {
        inputs.push(register("cutoff"));
    }
    let steps: &[&str] = if variant.has_aspect() {
        &["inverse_focal_x", "inverse_focal_y"]
    } else {
        &["inverse_focal"]
    };
    for step in steps {
        let places = format!("{step}_places");
        inputs.push((format!("{step}_exponent"), Source::Opposite(places)));
        inputs.push(register(step));
    }
    if variant.has_aspect() {
        inputs.extend(each("aspect", &["xx", "xy", "yy"], register));
    }
    for side in ["width", "height"] {
        for name in ["middle", "last"] {
            inputs.push((format!("{name}_{side}"), Source::OneLess(side.into())));
        }
    }
    if let Some(ellipsoid) = ellipsoid {
        inputs.extend(each("jacobian", &XY, register));
        if !ellipsoid.own {
            for axis in ["axis_0", "axis_1", "axis_2"] {
                inputs.extend(each(axis, &XYZ, register));
            }
            inputs.extend(each("scale", &["0", "1", "2"], register));
        }
        if ellipsoid.depth_weight(&elaborated.machine).is_some() {
            let places = Source::Opposite("inverse_distance_places".into());
            inputs.push(("inverse_distance_exponent".into(), places));
            inputs.push(register("inverse_distance"));
        }
    }
    Unit {
        name: if ellipsoid.is_some() {
            "ellipsoid"
        } else {
            unit::ELLIPSE
        },
        stream: unit::ELLIPSE,
        graph: &unit.datapath(variant).graph,
        inputs,
        outputs: [
            "normal_x",
            "normal_y",
            "normal_z",
            "conic_xx",
            "conic_xy",
            "conic_yy",
            "amplitude",
            "first_column",
            "last_column",
            "first_row",
            "last_row",
            "depth_slope_x",
            "depth_slope_y",
            "depth_range",
            "backface",
            "faint",
            "outside",
        ],
    }
}

/// `colour`, where the machine has it and the frame has harmonics.
fn colour_unit(elaborated: &Elaborated, kind: Kind) -> Option<Unit<'_, 3>> {
    let unit = elaborated.colour.as_ref().filter(|_| kind.harmonics > 0)?;
    let mut inputs = each("position", &XYZ, record);
    inputs.extend(each("eye", &XYZ, register));
    for nth in 0..unit.coefficients() {
        inputs.extend(["red", "green", "blue"].map(|channel| record(&format!("{channel}_{nth}"))));
    }
    Some(Unit {
        name: unit::COLOUR,
        stream: unit::COLOUR,
        graph: unit.graph(),
        inputs,
        outputs: ["red", "green", "blue"],
    })
}

/// `gauss`.
fn gauss(elaborated: &Elaborated) -> Unit<'_, 2> {
    Unit {
        name: unit::GAUSS,
        stream: unit::GAUSS,
        graph: elaborated.gauss.graph(),
        inputs: ["radial", "amplitude"].map(record).to_vec(),
        outputs: ["radial_index", "weight"],
    }
}

/// A module of a graph alone, without a record.
#[derive(Clone, Debug)]
pub struct Datapath {
    /// Its name and text.
    pub module: Module,
    /// Name of the module.
    pub name: String,
    words: Words,
}

/// The words of a graph.
#[derive(Clone, Debug)]
pub struct Words {
    /// The unit that has it.
    pub unit: &'static str,
    /// The unit, or what this graph of it does.
    pub name: String,
    /// Its words, each after those that it is made from.
    pub words: Vec<Flow>,
}

const CONIC: [&str; 3] = ["conic_xx", "conic_xy", "conic_yy"];
const BOUNDS: [&str; 6] = [
    "first_x",
    "first_y",
    "threshold",
    "limit_x",
    "limit_y",
    "whole",
];
const SIDES: [&str; 4] = ["first_column", "last_column", "first_row", "last_row"];
const STATE: [&str; 4] = ["transmittance", "sum_red", "sum_green", "sum_blue"];

fn datapath<const OUTPUTS: usize>(
    (unit, name): (&'static str, &str),
    graph: &Graph<OUTPUTS>,
    signals: &[Signal],
    inputs: &[&[&str]],
    outputs: [&str; OUTPUTS],
) -> Datapath {
    let inputs: Vec<String> = inputs.concat().into_iter().map(str::to_owned).collect();
    let words: Vec<Option<String>> = (inputs.iter())
        .map(|input| Some(without_axis(input).to_owned()))
        .collect();
    let module = format!("{name}_datapath");
    Datapath {
        module: graph.module(signals, &module, &inputs, outputs),
        name: module,
        words: Words {
            unit,
            name: name.to_owned(),
            words: graph.flow(signals, &words),
        },
    }
}

/// A name without its axis, or its row and column.
fn without_axis(name: &str) -> &str {
    match name.rsplit_once('_') {
        Some((base, "x" | "y" | "z")) => base,
        Some((base, end)) if end.bytes().all(|byte| byte.is_ascii_digit()) => base,
        _ => name,
    }
}

/// Graphs of units that keep a state, or have no records: what `resolve` does with a layer and at
/// the end of a pixel, the test of tiles, for a splat and for a tile, and the test of a block.
pub fn datapaths(elaborated: &Elaborated) -> Vec<Datapath> {
    let [layer, frame] = elaborated.resolve.graphs();
    let signals = &elaborated.signals[..];
    let mut all = vec![
        datapath(
            (unit::RESOLVE, "resolve_layer"),
            layer,
            signals,
            &[&STATE, &["red", "green", "blue", "opacity"]],
            ["behind", "next_red", "next_green", "next_blue"],
        ),
        datapath(
            (unit::RESOLVE, "resolve_frame"),
            frame,
            signals,
            &[
                &STATE,
                &["behind_red", "behind_green", "behind_blue", "behind_alpha"],
            ],
            ["red", "green", "blue", "alpha"],
        ),
    ];
    if let Some(words) = BinWords::of(&elaborated.machine) {
        let e = &mut Elaboration::default();
        let splat = words.splat_in(e);
        all.push(datapath(
            (unit::BIN, "bin_splat"),
            &splat,
            &e.signals,
            &[
                &["pixel_x", "pixel_y"],
                &CONIC,
                &SIDES,
                &["cutoff", "middle_x", "middle_y"],
            ],
            BOUNDS,
        ));
        let e = &mut Elaboration::default();
        let tile = words.tile_in(e);
        all.push(datapath(
            (unit::BIN, "bin_tile"),
            &tile,
            &e.signals,
            &[&CONIC, &BOUNDS, &SIDES],
            ["listed"],
        ));
    }
    if let Some(unit) = &elaborated.contribution {
        all.push(datapath(
            (unit::CONTRIBUTION, "contribution"),
            unit.graph(),
            signals,
            &[
                &["pixel_x", "pixel_y"],
                &CONIC,
                &["cutoff"],
                &SIDES,
                &["middle_x", "middle_y"],
            ],
            ["kept"],
        ));
    }
    all
}

/// The files of the units for this machine and kind of frame.
pub fn files(elaborated: &Elaborated, frame: &Frame) -> Vec<Listing> {
    let kind = Kind::of(frame);
    let writer = Writer::new(elaborated, kind);
    let mut files = writer.unit(&project(elaborated, kind));
    files.extend(writer.unit(&ellipse_unit(
        elaborated,
        elaborated.ellipse.variant_of(frame),
    )));
    files.extend(
        colour_unit(elaborated, kind)
            .iter()
            .flat_map(|unit| writer.unit(unit)),
    );
    files.extend(writer.unit(&gauss(elaborated)));
    files.extend(datapaths(elaborated).into_iter().map(|datapath| Listing {
        text: writer.head(&format!("Arithmetic of {}", datapath.words.name))
            + &datapath.module.text,
        name: format!("{}.sv", datapath.name),
    }));
    files
}

/// The words of all graphs, of the kind of splat that takes longest.
pub fn words(elaborated: &Elaborated) -> Vec<Words> {
    let kind = Kind {
        ellipsoids: elaborated.machine.ellipse.ellipsoid.is_some(),
        harmonics: elaborated
            .colour
            .as_ref()
            .map_or(0, |_| colour::MOST_DEGREE as u8),
        ..Kind::default()
    };
    let writer = Writer::new(elaborated, kind);
    let slowest = elaborated.ellipse.slowest();
    let mut all = vec![
        writer.flow(&project(elaborated, kind)),
        writer.flow(&ellipse_unit(elaborated, slowest)),
    ];
    all.extend(
        colour_unit(elaborated, kind)
            .iter()
            .map(|unit| writer.flow(unit)),
    );
    all.push(writer.flow(&gauss(elaborated)));
    all.extend(datapaths(elaborated).into_iter().map(|graph| graph.words));
    all
}

/// The modules that the units are made of.
pub fn library() -> Vec<Listing> {
    macro_rules! files {
        ($($name:literal),*) => {
            [$(($name, include_str!(concat!("../../rtl/", $name)))),*]
        };
    }
    files![
        "fit.sv",
        "fit_float.sv",
        "fit_shifted.sv",
        "float_pack.sv",
        "float_unpack.sv",
        "lookup.sv",
        "normalise.sv",
        "pipe.sv",
        "reciprocal.sv",
        "reciprocal_root.sv"
    ]
    .map(|(name, text)| Listing {
        name: name.into(),
        text: text.into(),
    })
    .into()
}

struct Writer<'a> {
    elaborated: &'a Elaborated,
    streams: Vec<Stream>,
}

fn constant(stream: &Stream, field: &str) -> String {
    let name = format!("{}_{field}", stream.name.replace('.', "_"));
    format!("machine_pkg::{}", name.to_uppercase())
}

impl<'a> Writer<'a> {
    fn new(elaborated: &'a Elaborated, kind: Kind) -> Self {
        let constants = ports::constants(elaborated, kind).into_iter();
        Writer {
            elaborated,
            streams: constants.chain(ports::streams(elaborated, kind)).collect(),
        }
    }

    /// The words of a unit.
    fn flow<const OUTPUTS: usize>(&self, unit: &Unit<'_, OUTPUTS>) -> Words {
        let into = format!("{}.in", unit.stream);
        let signals = &self.elaborated.signals;
        // A register may have the format of a word that the unit makes.
        let made = unit.graph.flow(signals, &vec![None; unit.inputs.len()]);
        let is_made = |name: &String| made.iter().any(|word| word.name == *name);
        let signal = |stream: &str, name: &str| {
            let stream = self.streams.iter().find(|known| known.name == stream);
            let field = stream?.fields.iter().find(|field| field.name == name)?;
            let signal = field.signal.clone()?;
            Some(if is_made(&signal) {
                format!("{}.{}", unit.stream, without_axis(name))
            } else {
                signal
            })
        };
        let name = |(name, source): &(String, Source)| match source {
            Source::Record(field) => signal(&into, field),
            Source::Frame(field) => signal("frame", field),
            Source::Reach => Some("raster.cutoff".into()),
            Source::Word(0) => None,
            Source::Word(_) => Some(format!("{}.{name}", unit.stream)),
            // Exponents, flags and sides of the picture.
            Source::Below(..) | Source::Opposite(_) | Source::OneLess(_) => None,
        };
        let names: Vec<Option<String>> = unit.inputs.iter().map(name).collect();
        Words {
            unit: unit.stream,
            name: unit.stream.to_owned(),
            words: unit.graph.flow(signals, &names),
        }
    }

    fn stream(&self, name: &str) -> &Stream {
        self.streams
            .iter()
            .find(|stream| stream.name == name)
            .unwrap_or_else(|| panic!("{name} has ports"))
    }

    /// First line of a file.
    fn head(&self, what: &str) -> String {
        format!(
            "// {what}, for the machine {}. Written by splatsim {}.\n",
            self.elaborated.machine.name,
            env!("CARGO_PKG_VERSION")
        )
    }

    fn unit<const OUTPUTS: usize>(&self, unit: &Unit<'_, OUTPUTS>) -> Vec<Listing> {
        let [into, out, frame] = [
            format!("{}.in", unit.stream),
            format!("{}.out", unit.stream),
            "frame".into(),
        ]
        .map(|name| self.stream(&name));
        let signals: &[Signal] = &self.elaborated.signals;
        let names: Vec<String> = unit.inputs.iter().map(|(name, _)| name.clone()).collect();
        let datapath = format!("{}_datapath", unit.name);
        let Module {
            text,
            inputs,
            outputs,
        } = unit.graph.module(signals, &datapath, &names, unit.outputs);
        let shell = Shell {
            unit,
            into,
            out,
            frame,
        };
        vec![
            Listing {
                name: format!("{datapath}.sv"),
                text: self.head(&format!("Arithmetic of {}", unit.name)) + &text,
            },
            Listing {
                name: format!("{}.sv", unit.name),
                text: self.head(&format!("Unit {}", unit.name))
                    + &shell.text(&datapath, &inputs, &outputs),
            },
        ]
    }
}

/// What is around a datapath.
struct Shell<'a, const OUTPUTS: usize> {
    unit: &'a Unit<'a, OUTPUTS>,
    into: &'a Stream,
    out: &'a Stream,
    frame: &'a Stream,
}

impl<const OUTPUTS: usize> Shell<'_, OUTPUTS> {
    fn field_of<'s>(&self, stream: &'s Stream, name: &str) -> &'s Field {
        stream
            .fields
            .iter()
            .find(|field| field.name == name)
            .unwrap_or_else(|| panic!("{} has {name}", stream.name))
    }

    /// A field's stored bits.
    fn stored(&self, stream: &Stream, port: &str, name: &str) -> String {
        let place = constant(stream, &format!("{name}_LSB"));
        format!("{port}[{place}+:{}]", self.field_of(stream, name).width())
    }

    /// A field's bits, and whether they are a signed word.
    fn field(&self, stream: &Stream, port: &str, name: &str) -> (String, bool) {
        let format = self.field_of(stream, name).word.format;
        let word = if format.is_float() {
            format!("{port}_{name}")
        } else {
            self.stored(stream, port, name)
        };
        (word, format.signed)
    }

    /// Floating-point fields that inputs read, as words.
    fn unpacked(&self) -> String {
        let mut text = String::new();
        for (port, stream) in [("s_data", self.into), ("frame", self.frame)] {
            let is_read = |field: &&Field| {
                self.unit.inputs.iter().any(|(_, source)| match source {
                    Source::Record(name) => port == "s_data" && *name == field.name,
                    Source::Frame(name) | Source::Opposite(name) | Source::OneLess(name) => {
                        port == "frame" && *name == field.name
                    }
                    Source::Below(name, limit) => {
                        *(if port == "frame" { limit } else { name }) == field.name
                    }
                    Source::Reach => ["opacity", "cutoff"].contains(&field.name.as_str()),
                    Source::Word(_) => false,
                })
            };
            let floats = stream
                .fields
                .iter()
                .filter(|field| field.word.format.is_float());
            for field in floats.filter(is_read) {
                let (name, top) = (&field.name, field.word.format.width() - 1);
                let _ = writeln!(
                    text,
                    "  wire [{top}:0] {port}_{name};\n  float_unpack #({}) unpack_{port}_{name} (.stored({}), .word({port}_{name}));",
                    shape(field),
                    self.stored(stream, port, name)
                );
            }
        }
        text
    }

    /// Results that are stored as floating-point fields.
    fn packed(&self, outputs: &[Port]) -> String {
        let mut text = String::new();
        for field in &self.out.fields {
            let is_float = field.word.format.is_float();
            let Some(port) = outputs
                .iter()
                .find(|port| is_float && port.name == field.name)
            else {
                continue;
            };
            let (name, top) = (&port.name, field.width() - 1);
            let _ = writeln!(
                text,
                "  wire [{top}:0] packed_{name};\n  float_pack #({}) pack_{name} (.word({}'(out_{name})), .stored(packed_{name}));",
                shape(field),
                field.word.format.width(),
            );
        }
        text
    }

    /// A field as a signed expression.
    fn signed(&self, stream: &Stream, port: &str, name: &str) -> String {
        match self.field(stream, port, name) {
            (slice, true) => format!("$signed({slice})"),
            (slice, false) => format!("$signed({{1'b0, {slice}}})"),
        }
    }

    /// An input's expression.
    fn input(&self, source: &Source, port: &Port) -> String {
        let bits = port.bits;
        match source {
            // A flag of one bit.
            Source::Frame(name) if port.is_condition => self.field(self.frame, "frame", name).0,
            Source::Record(name) => {
                format!("{bits}'({})", self.signed(self.into, "s_data", name))
            }
            Source::Frame(name) => format!("{bits}'({})", self.signed(self.frame, "frame", name)),
            Source::Opposite(name) => {
                format!("-({bits}'({}))", self.signed(self.frame, "frame", name))
            }
            Source::OneLess(name) => format!(
                "{bits}'({}) - {bits}'sd1",
                self.signed(self.frame, "frame", name)
            ),
            Source::Below(field, limit) => {
                let [(a, _), (b, _)] = [
                    self.field(self.into, "s_data", field),
                    self.field(self.frame, "frame", limit),
                ];
                format!("{a} < {b}")
            }
            Source::Word(word) if port.is_condition => format!("1'b{}", -word),
            Source::Word(word) => format!("{bits}'sd{word}"),
            Source::Reach => format!("{bits}'($signed({{1'b0, reach}}))"),
        }
    }

    /// The ROM of cutoffs, where a machine has one.
    fn reach(&self) -> String {
        let opacity = self.field(self.into, "s_data", "opacity").0;
        let opacity_top = self.field_of(self.into, "opacity").word.format.width() - 1;
        let cutoff = self.field(self.frame, "frame", "cutoff").0;
        format!(
            "
  // No weight counts beyond a radial index that depends on the opacity.
  wire [machine_pkg::RASTER_CUTOFF_W-1:0] reach;
  if (machine_pkg::ELLIPSE_REACH_BITS > 0) begin : g_reach
    logic [machine_pkg::RASTER_CUTOFF_W-1:0] cutoffs[0:2**machine_pkg::ELLIPSE_REACH_BITS-1];
    initial $readmemh({{ROMS, \"ellipse.reach.hex\"}}, cutoffs);
    wire [{opacity_top}:0] step = {opacity} >> (machine_pkg::SPLAT_OPACITY_F - machine_pkg::ELLIPSE_REACH_BITS);
    // An opacity of 1 uses the last address.
    wire [machine_pkg::ELLIPSE_REACH_BITS-1:0] address =
        |(step >> machine_pkg::ELLIPSE_REACH_BITS) ? {{machine_pkg::ELLIPSE_REACH_BITS{{1'b1}}}} : machine_pkg::ELLIPSE_REACH_BITS'(step);
    assign reach = cutoffs[address];
  end else begin : g_no_reach
    assign reach = {cutoff};
  end
"
        )
    }

    /// Flags that clear other fields.
    fn flags(&self) -> BTreeSet<&'static str> {
        let is_here = |flag: &&str| self.out.fields.iter().any(|field| field.name == **flag);
        let all = self.out.fields.iter().flat_map(|field| field.unless);
        all.copied().filter(is_here).collect()
    }

    /// A result's field, 0 where a flag is set.
    fn result(&self, field: &Field, outputs: &[Port]) -> String {
        let bits = field.width();
        let is_flag = self.flags().contains(field.name.as_str());
        // A flag that is no result is an input.
        let value = outputs
            .iter()
            .find(|port| port.name == field.name)
            .map_or_else(
                || format!("in_{}", field.name),
                |port| match field.word.format.is_float() {
                    true => format!("packed_{}", port.name),
                    false => format!("out_{}", port.name),
                },
            );
        let flags: Vec<String> = field
            .unless
            .iter()
            .filter(|flag| self.flags().contains(*flag))
            .map(|flag| (*flag).to_owned())
            .collect();
        match (is_flag, flags.is_empty()) {
            (true, true) => value,
            (true, false) => format!("{value} && !({})", flags.join(" || ")),
            (false, true) => format!("{bits}'({value})"),
            (false, false) => format!("{} ? {bits}'d0 : {bits}'({value})", flags.join(" || ")),
        }
    }

    fn text(&self, datapath: &str, inputs: &[Port], outputs: &[Port]) -> String {
        let Unit {
            name,
            stream,
            graph,
            ..
        } = self.unit;
        let upper = stream.to_uppercase();
        let (flags, is_gauss) = (self.flags(), *stream == unit::GAUSS);
        let mut parameters = Vec::new();
        if !flags.is_empty() {
            parameters.push("parameter int DROPS = 0, // 1: culled splats end here".to_owned());
        }
        parameters.push("parameter int TAG_W = 0, // bits of a tag, which passes through".into());
        parameters
            .push("parameter ROMS = \"rom/\"  // folder of the tables, with its slash".into());
        let constants = if is_gauss {
            "input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] least, // constant: the minimum weight; lower weights end here"
        } else {
            "input wire [machine_pkg::FRAME_W-1:0] frame, // constants of the frame"
        };
        let mut text = format!(
            "`timescale 1ns / 1ps\n`default_nettype none\n\nmodule {name} #(\n    {}\n) (
    input wire clk, // clock, rising edge
    input wire rst, // clears records in flight
    {constants}
    input wire s_valid, // a record is there
    output wire s_ready, // and can be taken
    input wire [TAG_W+machine_pkg::{upper}_IN_W-1:0] s_data, // the tag, {stream}.in
    output wire m_valid, // a record is offered
    input wire m_ready, // and taken
    output wire [TAG_W+machine_pkg::{upper}_OUT_W-1:0] m_data // the tag, {stream}.out
);
",
            parameters.join("\n    ")
        );
        let sources = self.unit.inputs.iter().map(|(_, source)| source);
        text += &self.unpacked();
        if sources
            .clone()
            .any(|source| matches!(source, Source::Reach))
        {
            text += &self.reach();
        }
        text += "\n  // Fields of the record, and constants.\n";
        for (source, port) in sources.zip(inputs) {
            let _ = writeln!(
                text,
                "  wire {}in_{} = {};",
                range(port),
                port.name,
                self.input(source, port)
            );
        }
        text += "\n";
        for port in outputs {
            let _ = writeln!(text, "  wire {}out_{};", range(port), port.name);
        }
        let connections = inputs
            .iter()
            .map(|port| format!(".{0}(in_{0})", port.name))
            .chain(
                outputs
                    .iter()
                    .map(|port| format!(".{0}(out_{0})", port.name)),
            )
            .collect::<Vec<_>>()
            .join(",\n      ");
        let roms = if graph.has_roms() {
            "#(.ROMS(ROMS)) "
        } else {
            ""
        };
        let _ = write!(
            text,
            "  {datapath} {roms}datapath (\n      {connections}\n  );\n\n  // The record: a field without a meaning is 0.\n"
        );
        text += &self.packed(outputs);
        let field_name = |field: &Field| {
            if flags.contains(field.name.as_str()) {
                field.name.clone()
            } else {
                format!("field_{}", field.name)
            }
        };
        for field in &self.out.fields {
            let top = field.width() - 1;
            let width = if flags.contains(field.name.as_str()) {
                String::new()
            } else {
                format!("[{top}:0] ")
            };
            let _ = writeln!(
                text,
                "  wire {width}{} = {};",
                field_name(field),
                self.result(field, outputs)
            );
        }
        let fields: Vec<String> = self.out.fields.iter().map(field_name).collect();
        let culled = flags.into_iter().collect::<Vec<_>>().join(" || ");
        let keeps = match (is_gauss, culled.is_empty()) {
            (true, _) => "field_weight >= least".to_owned(),
            (false, true) => "1'b1".into(),
            (false, false) => format!("DROPS == 0 || !({culled})"),
        };
        let unused = outputs
            .iter()
            .map(|port| format!("out_{}", port.name))
            .chain((!is_gauss).then(|| "frame".to_owned()))
            .collect::<Vec<_>>()
            .join(", ");
        let _ = write!(
            text,
            "
  // Other results, and constants for other units.
  wire unused = &{{1'b0, s_data, {unused}}};

  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::{upper}_OUT_W;
  wire keeps = {keeps};
  wire [machine_pkg::{upper}_OUT_W-1:0] result = {{{}}};
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({{s_data >> machine_pkg::{upper}_IN_W, result}});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::{upper}_LATENCY), .INTERVAL(machine_pkg::{upper}_INTERVAL), .ROOM(machine_pkg::{upper}_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(keeps), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
",
            fields.join(", ")
        );
        text
    }
}

/// Parameters of what packs a floating-point field.
fn shape(field: &Field) -> String {
    let format = field.word.format;
    format!(
        ".W({}), .S({}), .P({}), .E({})",
        format.width(),
        u8::from(format.signed),
        format.significant_bits,
        format.exponent_bits()
    )
}

/// Bits of a port.
fn range(port: &Port) -> String {
    if port.is_condition {
        String::new()
    } else {
        format!("signed [{}:0] ", port.bits - 1)
    }
}
