//! Headers: writes a machine's formats and records as SystemVerilog, C and Markdown.

use super::observer::outcomes;
use rtl_model::frame::Frame;
use rtl_model::machine::{FunctionUnit, Interpolation, Merge, Rows};
use rtl_model::num::{Format, Overflow, Word};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Field, Kind, Order, Stream};
use std::collections::BTreeMap;
use std::fmt::Write;

/// `project.reciprocal.mantissa` as the name of a constant.
fn constant(name: &str) -> String {
    name.to_uppercase().replace('.', "_")
}

/// Every word of a machine by its path: those of the description and of the function units. Words
/// that only ellipsoids use begin with their unit's name; they are included if ellipsoids are
/// drawn.
fn words(machine: &Elaborated, kind: Kind) -> BTreeMap<String, Word> {
    let mut words: BTreeMap<String, Word> = machine
        .signals
        .iter()
        .map(|signal| (format!("{}.{}", signal.unit, signal.name), signal.word))
        .collect();
    let description = serde_json::to_value(&machine.machine).unwrap_or_default();
    for (unit, fields) in description.as_object().into_iter().flatten() {
        for (name, value) in fields.as_object().into_iter().flatten() {
            if let Ok(word) = serde_json::from_value(value.clone()) {
                words.insert(format!("{unit}.{name}"), word);
            } else if kind != Kind::default() && name != "window" {
                // Words of windows are nested: each is a signal.
                let nested = value.as_object().into_iter().flatten();
                let own = nested.filter_map(|(name, value)| {
                    Some((name, serde_json::from_value(value.clone()).ok()?))
                });
                words.extend(own.map(|(name, word)| (format!("{unit}.{name}"), word)));
            }
        }
    }
    words
}

/// Numbers other than formats: tables, rules, timing.
fn numbers(machine: &Elaborated, frame: &Frame) -> Vec<(String, i64)> {
    let mut all = Vec::new();
    let functions = machine
        .reciprocals()
        .map(|(name, unit)| (name, unit.shape()))
        .into_iter()
        .chain(machine.roots().map(|(name, unit)| (name, unit.shape())))
        .chain(
            machine
                .ray_root()
                .filter(|_| frame.ellipsoids.is_some())
                .map(|unit| ("ellipse.ray_root", unit.shape())),
        )
        .chain(
            machine
                .colour()
                .filter(|_| Kind::of(frame).harmonics > 0)
                .map(|unit| ("colour.root", unit.root().shape())),
        )
        .chain(frame.ellipsoids.iter().map(|_| {
            let none = FunctionUnit {
                table_bits: 0,
                newton_steps: 0,
                bits: 0,
            };
            (
                "ellipse.compensation_root",
                machine
                    .compensation_root()
                    .map_or(none, |unit| unit.shape()),
            )
        }))
        .chain(
            machine
                .fragment
                .window_reciprocal()
                .filter(|_| frame.window.is_some())
                .map(|unit| (RECIPROCAL_OF_WINDOWS, unit.shape())),
        );
    let mirror = machine
        .shade
        .reflect()
        .filter(|_| frame.surroundings.is_some())
        .map(|unit| ("reflect.reciprocal", unit.reciprocal().shape()));
    for (name, shape) in functions.chain(mirror) {
        let sizes = [
            ("TABLE_BITS", shape.table_bits),
            ("NEWTON_STEPS", shape.newton_steps),
            ("BITS", shape.bits),
        ];
        all.extend(
            sizes.map(|(size, value)| (format!("{}_{size}", constant(name)), i64::from(value))),
        );
    }
    let m = &machine.machine;
    let f = &m.fragment;
    let sheets = f
        .sheets
        .as_ref()
        .filter(|_| frame.sheets.is_some())
        .map(|words| ("FRAGMENT_RATIO_TABLE", words.table));
    let window = f.window.as_ref().filter(|_| frame.window.is_some());
    let of_windows = window.map(|words| {
        [
            ("FRAGMENT_WINDOW_DENSITY_TABLE", words.density_table),
            ("FRAGMENT_WINDOW_HIDDEN_TABLE", words.hidden_table),
        ]
    });
    let tables = [
        ("GAUSS_TABLE", m.gauss.table),
        ("SHADE_HIGHLIGHT_TABLE", m.shade.highlight_table),
    ];
    for (name, table) in tables
        .into_iter()
        .chain(sheets)
        .chain(of_windows.into_iter().flatten())
    {
        all.push((format!("{name}_BITS"), table.index_bits.into()));
        all.push((
            format!("{name}_LINEAR"),
            (table.interpolation == Interpolation::Linear).into(),
        ));
    }
    let reach_bits = m
        .ellipse
        .ellipsoid
        .filter(|_| frame.ellipsoids.is_some())
        .and_then(|words| words.reach_bits)
        .unwrap_or(0);
    // The opacity of an ellipsoid is compared with a register of the frame.
    let constants = ports::constants(machine, Kind::of(frame));
    let least_opacity = constants[0]
        .fields
        .iter()
        .position(|field| field.name == "least_opacity");
    let [opacity_w, least_opacity_lsb] = least_opacity.map_or([0; 2], |at| {
        [constants[0].fields[at].width(), constants[0].places()[at]]
    });
    // Registers for pixels that are not square, or their substitutes.
    let lsb = |name: &str| {
        constants[0]
            .fields
            .iter()
            .position(|field| field.name == name)
            .map(|at| constants[0].places()[at])
    };
    for axis in ["x", "y"] {
        for (own, usual) in [
            ("focal", "focal"),
            ("inverse_focal", "inverse_focal"),
            ("inverse_focal", "inverse_focal_places"),
        ] {
            let own = usual.replace(own, &format!("{own}_{axis}"));
            let place = lsb(&own)
                .or_else(|| lsb(usual))
                .expect("every frame has a focal length");
            all.push((format!("VIEW_{}_LSB", constant(&own)), place.into()));
        }
    }
    let aspect = m.ellipse.aspect.map_or([0; 2], |word| {
        [word.format.stored_bits(), word.format.frac_bits]
    });
    all.extend([
        ("VIEW_ASPECT_W".to_owned(), aspect[0].into()),
        ("VIEW_ASPECT_F".to_owned(), aspect[1].into()),
    ]);
    all.push((
        "VIEW_ASPECT_YY_LSB".into(),
        lsb("aspect_yy").unwrap_or(0).into(),
    ));
    // Words of weights that fall with depth: all are 0 on machines without them.
    if frame.ellipsoids.is_some() {
        let words = m.depth_weight();
        for (name, word) in [
            ("SHARE", words.map(|words| words.share)),
            ("WEIGHT", words.map(|words| words.weight)),
        ] {
            let sizes = word.map_or([0; 3], |word| {
                [
                    word.format.stored_bits(),
                    word.format.frac_bits,
                    word.round.code().into(),
                ]
            });
            let names = ["W", "F", "ROUND"].map(|size| format!("VIEW_{name}_{size}"));
            all.extend(names.into_iter().zip(sizes.map(i64::from)));
        }
        for name in ["inverse_distance", "inverse_distance_places"] {
            let place = lsb(name).unwrap_or(0).into();
            all.push((format!("VIEW_{}_LSB", constant(name)), place));
        }
    }
    let rules = [
        ("PROJECT_OPACITY_W", opacity_w.into()),
        ("PROJECT_LEAST_OPACITY_LSB", least_opacity_lsb.into()),
        ("ELLIPSE_REACH_BITS", reach_bits.into()),
        (
            "RASTER_DIFFERENCED",
            i64::from(m.raster.rows == Rows::Differenced),
        ),
        (
            "RASTER_EXACT_DEPTH_F",
            ports::exact_depth(m).frac_bits.into(),
        ),
        ("ELLIPSE_INVERSE_TWO_PI_WORD", machine.inverse_two_pi()),
        ("FRAGMENT_LAYERS", f.layers.into()),
        ("FRAGMENT_MERGE", f.merge as i64),
        ("FRAGMENT_EVICT_HIDDEN", f.evict_hidden.into()),
        ("FRAGMENT_TURN_NORMALS", f.turn_normals.into()),
        (
            "FRAGMENT_NEAREST_DEPTH",
            (f.fragment_depth == rtl_model::machine::FragmentDepth::Nearest).into(),
        ),
        (
            "FRAGMENT_OPAQUE_LIMIT",
            f.opaque.format.one() * i64::from(f.opaque_permille) / 1000,
        ),
        ("FRAGMENT_OPAQUE_SHADED", machine.fragment.opaque_shaded()),
        ("LIGHTS", frame.lighting.lights.len() as i64),
        ("MATERIALS", frame.lighting.materials.len() as i64),
    ];
    if let (1.., Some(colour)) = (Kind::of(frame).harmonics, &m.colour) {
        all.push(("COLOUR_DEGREE".into(), colour.degree.into()));
    }
    if m.raster.rows == Rows::Direct {
        all.push(("RASTER_DIRECT".into(), 1));
    }
    if let (Some(_), Some(words)) = (&frame.surroundings, &m.reflect) {
        all.push(("REFLECT_INDEX_BITS".into(), words.index_bits.into()));
    }
    let of_windows = window.map(|words| {
        [
            ("FRAGMENT_GROUP", f.group as i64),
            ("FRAGMENT_LATE", words.late.into()),
            ("FRAGMENT_INSIDE", words.inside.into()),
        ]
    });
    all.extend(
        rules
            .into_iter()
            .chain(of_windows.into_iter().flatten())
            .map(|(name, value)| (name.to_owned(), value)),
    );
    let t = &machine.timing;
    let paces = [
        ("PROJECT", t.project),
        ("ELLIPSE", t.ellipse),
        ("RASTER", t.raster),
        ("GAUSS", t.gauss),
        ("FRAGMENT", t.fragment),
        ("SHADE", t.shade),
        ("RESOLVE", t.resolve),
    ];
    let colour = t.colour.last().filter(|_| Kind::of(frame).harmonics > 0);
    let paces = paces
        .into_iter()
        .chain(colour.map(|of| ("COLOUR", of.pace)));
    for (unit, pace) in paces {
        all.push((format!("{unit}_LATENCY"), pace.latency.into()));
        all.push((format!("{unit}_INTERVAL"), pace.interval.into()));
        all.push((format!("{unit}_ROOM"), pace.room() as i64));
    }
    all.push(("FRAGMENT_HAZARD".into(), t.hazard.into()));
    all.push((
        "FRAGMENT_MERGE_CYCLES".into(),
        t.timing.fragment.merge.into(),
    ));
    all
}

/// Codes with names: one type each in the package, one entry each in the manifest's `enums`.
struct EnumCodes {
    name: &'static str,
    /// The fields and numbers that have these codes.
    of: &'static [&'static str],
    /// Bits of the field; None for numbers of the package, or for those with this ending.
    bits: Option<u32>,
    /// In the order of their codes, from 0.
    names: Vec<&'static str>,
}

/// Name of a merge rule. A new rule must be added to [`codes`] too, at the index of its code.
fn rule(merge: Merge) -> &'static str {
    match merge {
        Merge::NearestPair => "nearest-pair",
        Merge::FarthestPair => "farthest-pair",
        Merge::Replace => "replace",
        Merge::Window => "window",
    }
}

/// Path of the reciprocal of windows among the function units.
const RECIPROCAL_OF_WINDOWS: &str = "fragment.window.reciprocal";

fn codes(kind: Kind) -> Vec<EnumCodes> {
    let merges = [
        Merge::NearestPair,
        Merge::FarthestPair,
        Merge::Replace,
        Merge::Window,
    ]
    .map(rule);
    let merges = &merges[..if kind.windows { merges.len() } else { 3 }];
    let mut all = vec![
        EnumCodes {
            name: "outcome",
            of: &["fragment.out.outcome"],
            bits: Some(ports::outcome_bits(kind) as u32),
            names: outcomes(kind).to_vec(),
        },
        EnumCodes {
            name: "merge",
            of: &["FRAGMENT_MERGE"],
            bits: None,
            names: merges.to_vec(),
        },
        EnumCodes {
            name: "round",
            of: &["_ROUND"],
            bits: None,
            names: vec!["truncate", "nearest", "nearest-even"],
        },
        EnumCodes {
            name: "overflow",
            of: &["_WRAP"],
            bits: None,
            names: vec!["saturate", "wrap"],
        },
    ];
    if kind.windows {
        all.push(EnumCodes {
            name: "group",
            of: &["FRAGMENT_GROUP"],
            bits: None,
            names: vec!["first", "interval", "window"],
        });
    }
    if kind.ellipsoids {
        all.push(EnumCodes {
            name: "amplitude",
            of: &["frame.amplitude"],
            bits: Some(2),
            names: vec!["disc", "line-integral", "peak", "compensated"],
        });
    }
    all
}

impl EnumCodes {
    /// The constants and their codes: `MERGE_NEAREST_PAIR`.
    fn constants(&self) -> impl Iterator<Item = (String, usize)> {
        let prefix = self.name.to_uppercase();
        self.names.iter().enumerate().map(move |(number, name)| {
            (
                format!("{prefix}_{}", constant(&name.replace('-', "_"))),
                number,
            )
        })
    }

    /// The type in SystemVerilog.
    fn enumeration(&self) -> String {
        let base = self
            .bits
            .map_or("int".to_owned(), |bits| format!("logic [{}:0]", bits - 1));
        let number = |number: usize| {
            self.bits
                .map_or(number.to_string(), |bits| format!("{bits}'d{number}"))
        };
        let items: Vec<String> = self
            .constants()
            .map(|(name, code)| format!("{name} = {}", number(code)))
            .collect();
        format!(
            "\n  // Codes of {}.\n  typedef enum {base} {{\n    {}\n  }} {}_t;\n",
            self.of.join(", "),
            items.join(",\n    "),
            self.name
        )
    }
}

/// The codes for the manifest.
pub fn enums(kind: Kind) -> serde_json::Value {
    let entry = codes(kind).into_iter().map(|codes| {
        let numbers = codes.names.iter().enumerate().map(|(number, name)| ((*name).to_owned(), number.into()));
        (codes.name.to_owned(), serde_json::json!({"of": codes.of, "codes": numbers.collect::<serde_json::Map<_, _>>()}))
    });
    serde_json::Value::Object(entry.collect())
}

/// Whether some words are in floating point.
fn has_floats(machine: &Elaborated, kind: Kind) -> bool {
    words(machine, kind)
        .iter()
        .any(|(_, word)| word.format.is_float())
}

/// The package `machine_pkg`, for one machine and the number of lights and materials of a frame.
pub fn package(machine: &Elaborated, frame: &Frame) -> String {
    // Read once, before the RTL implementations, which differ if materials are reflective.
    let mirrors = match ports::asks_for_pixel(&machine.machine, Kind::of(frame)) {
        true => "`define MACHINE_MIRRORS\n`define MACHINE_MIRRORS_ALONG_RAYS\n",
        false if frame.surroundings.is_some() => "`define MACHINE_MIRRORS\n",
        false => "",
    };
    let direct = if machine.machine.raster.rows == Rows::Direct {
        "`define MACHINE_DIRECT\n"
    } else {
        ""
    };
    let composite = if machine.machine.fragment.composite().is_some() {
        "`define MACHINE_COMPOSITE\n"
    } else {
        ""
    };
    let floats = if has_floats(machine, Kind::of(frame)) {
        "// Floating-point words: also _P significant bits, and _FLUSH 1 if subnormal words are flushed to zero. The bits are sign, exponent e and fraction f; the value is f*2^-F if e is 0, else (2^(P-1) + f)*2^(e-1-F).\n"
    } else {
        ""
    };
    let mut text = format!(
        "// Formats, rules, timing and records of the machine {}, written by splatsim {}.\n\
         // For each word: _W bits, _F fraction bits, _S signed, _ROUND 0 truncate, 1 nearest, 2 nearest-even, _WRAP 0 saturate, 1 wrap.\n\
         {floats}\
         // For each record: _W bits, and _LSB and _W of each field.\n\
         `timescale 1ns / 1ps\n{mirrors}{direct}{composite}`default_nettype none\n/* verilator lint_off UNUSEDPARAM */\npackage machine_pkg;\n",
        machine.machine.name,
        env!("CARGO_PKG_VERSION"),
    );
    for (path, word) in words(machine, Kind::of(frame)) {
        let name = constant(&path);
        let round = word.round.code();
        let _ = write!(text, "\n  // {path}: {word}\n");
        let format = word.format;
        let parts = [
            ("W", format.stored_bits()),
            ("F", format.frac_bits),
            ("S", format.signed.into()),
            ("ROUND", round.into()),
            ("WRAP", (word.overflow == Overflow::Wrap).into()),
        ];
        let of_float = [
            ("P", format.significant_bits),
            ("FLUSH", format.flushes.into()),
        ];
        let lines: Vec<String> = parts
            .into_iter()
            .chain(of_float.into_iter().filter(|_| format.is_float()))
            .map(|(part, value)| format!("localparam int {name}_{part} = {value};"))
            .collect();
        let _ = writeln!(text, "  {}", lines.join(" "));
    }
    text.push_str("\n  // Tables, rules and timing.\n");
    for (name, value) in numbers(machine, frame) {
        let kind = if i32::try_from(value).is_ok() {
            "int"
        } else {
            "logic signed [63:0]"
        };
        let _ = writeln!(
            text,
            "  localparam {kind} {name} = {}{value};",
            if kind == "int" { "" } else { "64'sd" }
        );
    }
    let kind = Kind::of(frame);
    codes(kind)
        .iter()
        .for_each(|codes| text.push_str(&codes.enumeration()));
    for stream in ports::constants(machine, kind)
        .iter()
        .chain(&ports::streams(machine, kind))
    {
        let name = constant(stream.name);
        let _ = write!(
            text,
            "\n  // {}\n  localparam int {name}_W = {};\n",
            stream.name,
            stream.width()
        );
        for (field, place) in stream.fields.iter().zip(stream.places()) {
            let field_name = constant(&field.name);
            let _ = writeln!(
                text,
                "  localparam int {name}_{field_name}_LSB = {place}; localparam int {name}_{field_name}_W = {};",
                field.width()
            );
        }
    }
    let lighting = &frame.lighting;
    let (lights, materials) = (
        lighting.lights.len() as u32,
        lighting.materials.len() as u32,
    );
    text.push_str(
        "\n  // All lights, all materials, and the reflection of each light by each material: concatenated, the first in the low bits.\n",
    );
    let constants = ports::constants(machine, kind);
    for (port, stream, count) in [
        ("LIGHTS", &constants[1], lights),
        ("MATERIALS", &constants[2], materials),
        ("REFLECTIONS", &constants[3], lights * materials),
    ] {
        let _ = writeln!(
            text,
            "  localparam int {port}_PORT_W = {};",
            (stream.width() * count).max(1)
        );
    }
    text.push_str("endpackage\n/* verilator lint_on UNUSEDPARAM */\n`default_nettype wire\n");
    text
}

/// The records as packed structs, to be included.
pub fn structs(machine: &Elaborated, kind: Kind) -> String {
    let mut text = String::from(
        "// Records as packed structs, first field in the most significant bits: `include it inside a module.\n",
    );
    for stream in ports::constants(machine, kind)
        .iter()
        .chain(&ports::streams(machine, kind))
    {
        let _ = write!(text, "\ntypedef struct packed {{\n");
        for field in &stream.fields {
            let signed = if field.word.format.signed {
                " signed"
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "  logic{signed} [{}:0] {};  // {}",
                field.width() - 1,
                field.name,
                meaning(field)
            );
        }
        let _ = writeln!(text, "}} {}_t;", stream.name.replace('.', "_"));
    }
    text
}

/// The records as a C header: positions and widths as constants, one struct per record, and a table
/// of its fields.
pub fn c_header(machine: &Elaborated, kind: Kind) -> String {
    let floats = has_floats(machine, kind);
    let (note, member) = if floats {
        (
            "/* Where significant_bits is not 0, the bits are sign, exponent e and fraction f, and word is f if e is 0, else (2^(significant_bits-1) + f) * 2^(e-1). */\n",
            ", significant_bits",
        )
    } else {
        ("", "")
    };
    let mut text = format!(
        "/* Records of a trace: bit places, structs and tables of fields. value = word * 2^-fraction_bits */\n{note}\
         #ifndef SPLATSIM_RECORDS_H\n#define SPLATSIM_RECORDS_H\n#include <stdint.h>\n\n\
         typedef struct {{\n  const char *name;\n  int lsb, width, is_signed, fraction_bits{member};\n}} splatsim_field;\n",
    );
    for codes in codes(kind) {
        let items: Vec<String> = codes
            .constants()
            .map(|(name, code)| format!("SPLATSIM_{name} = {code}"))
            .collect();
        let _ = write!(
            text,
            "\n/* Codes of {}. */\ntypedef enum {{ {} }} splatsim_{};\n",
            codes.of.join(", "),
            items.join(", "),
            codes.name
        );
    }
    for stream in ports::constants(machine, kind)
        .iter()
        .chain(&ports::streams(machine, kind))
    {
        let (name, upper) = (stream.name.replace('.', "_"), constant(stream.name));
        let _ = write!(
            text,
            "\n#define {upper}_WIDTH {}\n#define {upper}_FIELDS {}\ntypedef struct {{\n",
            stream.width(),
            stream.fields.len()
        );
        for field in &stream.fields {
            let _ = writeln!(text, "  int64_t {}; /* {} */", field.name, meaning(field));
        }
        let _ = write!(
            text,
            "}} {name}_record;\nstatic const splatsim_field {name}_fields[{upper}_FIELDS] = {{\n"
        );
        for (field, place) in stream.fields.iter().zip(stream.places()) {
            let Format {
                signed,
                frac_bits,
                significant_bits,
                ..
            } = field.word.format;
            let significant = if floats {
                format!(", {significant_bits}")
            } else {
                String::new()
            };
            let _ = writeln!(
                text,
                "  {{\"{}\", {place}, {}, {}, {frac_bits}{significant}}},",
                field.name,
                field.width(),
                i32::from(signed)
            );
        }
        text.push_str("};\n");
    }
    text.push_str("\n#endif\n");
    text
}

fn meaning(field: &Field) -> String {
    match &field.signal {
        Some(signal) => format!("{}, {signal}", field.word),
        None => field.word.to_string(),
    }
}

/// Every word and every number, for the manifest.
pub fn words_and_numbers(machine: &Elaborated, frame: &Frame) -> serde_json::Value {
    let described = words(machine, Kind::of(frame)).into_iter().map(|(path, word)| {
        let Format { signed, int_bits, frac_bits, significant_bits, flushes } = word.format;
        let mut entry = serde_json::json!({
            "signed": signed, "int_bits": int_bits, "frac_bits": frac_bits, "round": word.round, "overflow": word.overflow,
        });
        if significant_bits > 0 {
            entry["significant_bits"] = significant_bits.into();
        }
        if flushes {
            entry["flushes_subnormals"] = true.into();
        }
        (path, entry)
    });
    let numbers = numbers(machine, frame)
        .into_iter()
        .map(|(name, value)| (name, value.into()));
    serde_json::json!({
        "words": described.collect::<serde_json::Map<_, _>>(), "numbers": numbers.collect::<serde_json::Map<_, serde_json::Value>>(),
    })
}

/// Name of a rounding or an overflow, as in files.
fn name(value: impl serde::Serialize) -> String {
    serde_json::to_value(value)
        .ok()
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default()
}

/// Tables of the records of the constants and of these streams, in Markdown.
pub fn tables(machine: &Elaborated, kind: Kind, written: &[&str]) -> String {
    let mut text = String::new();
    let streams = ports::streams(machine, kind);
    for stream in ports::constants(machine, kind).iter().chain(
        streams
            .iter()
            .filter(|stream| written.contains(&stream.name)),
    ) {
        let order = match stream.order {
            Order::Total => "in this order",
            Order::PerPixel => "in this order at each pixel",
        };
        let _ = write!(
            text,
            "\n### `{}`: {} bits, {} digits, {order}\n\n| field | bits | format | signal | rounds, overflows | 0 where |\n|---|---|---|---|---|---|\n",
            stream.name,
            stream.width(),
            stream.width().div_ceil(4)
        );
        for (field, place) in stream.fields.iter().zip(stream.places()) {
            let (signal, how) = match &field.signal {
                Some(signal) => {
                    let (round, overflow) = (name(field.word.round), name(field.word.overflow));
                    (format!("`{signal}`"), format!("{round}, {overflow}"))
                }
                None => (String::new(), "exact".into()),
            };
            let bits = format!("{}:{place}", place + field.width() - 1);
            let _ = writeln!(
                text,
                "| `{}` | {bits} | {} | {signal} | {how} | {} |",
                field.name,
                field.word,
                field.unless.join(", ")
            );
        }
    }
    text
}

/// Words without a field in a stream, and numbers that units need in addition to their records.
pub fn formats(machine: &Elaborated, frame: &Frame) -> String {
    let mut text = String::from("\n| word | format | rounds | overflows |\n|---|---|---|---|\n");
    for (path, word) in words(machine, Kind::of(frame)) {
        let _ = writeln!(
            text,
            "| `{path}` | {word} | {} | {} |",
            name(word.round),
            name(word.overflow)
        );
    }
    text.push_str("\n| number | value |\n|---|---|\n");
    for (name, value) in numbers(machine, frame) {
        let _ = writeln!(text, "| `{name}` | {value} |");
    }
    text.push_str("\n| code | of | number |\n|---|---|---|\n");
    for codes in codes(Kind::of(frame)) {
        let of = codes
            .of
            .iter()
            .map(|of| format!("`{of}`"))
            .collect::<Vec<_>>()
            .join(", ");
        for (number, name) in codes.names.iter().enumerate() {
            let _ = writeln!(text, "| {name} | {of} | {number} |");
        }
    }
    text
}

/// Manifest entries of a stream's fields.
pub fn fields(stream: &Stream, kind: Kind) -> Vec<serde_json::Value> {
    let codes = codes(kind);
    let described = stream.fields.iter().zip(stream.places()).map(|(field, place)| {
        let Format { signed, int_bits, frac_bits, significant_bits, flushes } = field.word.format;
        let full_name = format!("{}.{}", stream.name, field.name);
        let mut entry = serde_json::json!({
            "name": field.name, "lsb": place, "width": field.width(), "signed": signed, "int_bits": int_bits, "frac_bits": frac_bits,
        });
        if significant_bits > 0 {
            entry["significant_bits"] = significant_bits.into();
        }
        if flushes {
            entry["flushes_subnormals"] = true.into();
        }
        if let Some(signal) = &field.signal {
            entry["signal"] = signal.clone().into();
            entry["round"] = serde_json::to_value(field.word.round).unwrap_or_default();
            entry["overflow"] = serde_json::to_value(field.word.overflow).unwrap_or_default();
        }
        if !field.unless.is_empty() {
            entry["zero_where"] = field.unless.into();
        }
        if let Some(codes) = codes.iter().find(|codes| codes.of.contains(&full_name.as_str())) {
            entry["enum"] = codes.name.into();
        }
        entry
    });
    described.collect()
}

/// The package as a FuseSoC core. The tables are in the folder in which the RTL implementations
/// read them: the working directory of the simulation.
pub fn fusesoc(roms: &[&str]) -> String {
    let roms: String = roms
        .iter()
        .map(|rom| format!("      - {rom}: {{copyto: {rom}}}\n"))
        .collect();
    format!(
        "CAPI=2:\n\
         name: splatsim:trace:machine_pkg:{}\n\
         description: Formats, rules, timing and records of a machine, with its tables\n\n\
         filesets:\n  \
         rtl:\n    \
         file_type: systemVerilogSource\n    \
         files:\n      - machine_pkg.sv\n      - records.svh: {{is_include_file: true}}\n  \
         roms:\n    \
         file_type: user\n    \
         files:\n{roms}\n\
         targets:\n  \
         default:\n    \
         filesets: [rtl, roms]\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// The package for Bender.
pub const BENDER: &str = "package:\n  name: machine_pkg\n\n\
    export_include_dirs: [.]\n\n\
    sources:\n  - include_dirs: [.]\n    files:\n      - machine_pkg.sv\n";
