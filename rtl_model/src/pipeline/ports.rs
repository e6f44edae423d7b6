//! Ports: fields of the records on the wires between units. A trace holds these records, and the
//! RTL implementation of a unit reads and writes them.
//!
//! ```text
//! frame, lights, materials                          constants
//! project.in ─► project.out ─► ellipse.in ─► ellipse.out ─► raster.in ─► raster.out ─► gauss.in ─► gauss.out ─► fragment.in ─► fragment.out
//!                                                                 fragment.request ─► fragment.answer      fragment.held ─► resolve.in ─► resolve.out
//! ```
//! Ellipsoids also carry their axes, may have harmonics instead of colours (`colour.in`,
//! `colour.out`, for each splat that leaves `ellipse`), and may be lit before they are drawn (`ellipse.request`,
//! `ellipse.answer`) and sorted by depth (`sort.in`, `sort.out`). Where fragments are grouped by
//! sheets, contributions carry the sheet's number instead of depth, normal and opacity. Where they
//! are grouped by windows, every splat is lit before it is drawn, a contribution also carries its
//! light and its density, and a pixel finally holds lit layers.
//!
//! A record is one transfer through a port: its words concatenated, the first field in the most
//! significant bits, two's complement. Fields without meaning in a record (a culled splat's pixel)
//! are 0; [`Field::unless`] names the flags for that.
//!
//! Law: `records_have_the_widths_of_their_fields`.

use crate::frame::Frame;
use crate::machine::{Machine, Sight, Window};
use crate::num::{Format, Word};
use crate::pipeline::Elaborated;
use crate::records::unit;
use crate::records::{
    DiscIn, EllipseOut, EllipsoidIn, FragmentIn, GaussIn, PROJECT_FLAGS, PROJECTED, ProjectOut,
    RasterIn, RasterOut, SHEET_BITS, SheetIn, TRANSPARENT, WindowIn,
};
use crate::units::colour;
use crate::units::raster::Raster;

/// Bits of a column or row.
const PIXEL_BITS: i32 = 14;
/// Bits of a power of two's exponent.
const EXPONENT_BITS: i32 = 8;
/// Bits of a material's index.
pub const MATERIAL_BITS: i32 = 8;
/// Bits of a splat's tag in the raster.
const TAG_BITS: i32 = 32;
/// Bits of a slot's number.
const SLOT_BITS: i32 = 4;

/// Properties of a frame that, with the machine, determine its records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kind {
    /// Splats are ellipsoids; otherwise discs.
    pub ellipsoids: bool,
    /// Splats are lit before they are drawn.
    pub preshaded: bool,
    /// Degree of the harmonics that the machine evaluates; 0: splats have colours.
    pub harmonics: u8,
    /// Splats are drawn in depth order.
    pub sorted: bool,
    /// Fragments are grouped by sheets; otherwise by depth.
    pub sheets: bool,
    /// Fragments grouped by depth form intervals or windows.
    pub windows: bool,
    /// Materials reflect their surroundings.
    pub mirrors: bool,
}

impl Kind {
    /// Kind of a frame.
    pub fn of(frame: &Frame) -> Self {
        let ellipsoids = frame.ellipsoids.as_ref();
        let windows = frame.window.is_some();
        Kind {
            ellipsoids: ellipsoids.is_some(),
            preshaded: windows || ellipsoids.is_some_and(|ellipsoids| ellipsoids.preshaded),
            harmonics: ellipsoids.map_or(0, |ellipsoids| ellipsoids.harmonics),
            sorted: ellipsoids.is_some_and(|ellipsoids| ellipsoids.sorted),
            sheets: frame.sheets.is_some(),
            windows,
            mirrors: frame.surroundings.is_some(),
        }
    }
}

impl Kind {
    /// The units that have ports in such a frame, in the order of the diagram.
    pub fn units(self) -> impl Iterator<Item = &'static str> {
        unit::ALL.into_iter().filter(move |name| match *name {
            unit::SORT => self.sorted,
            unit::COLOUR => self.harmonics > 0,
            _ => true,
        })
    }
}

/// One field of a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name in the record, such as `pixel_x`.
    pub name: String,
    /// Signal of the word, such as `project.pixel`; `None` for numbers that count something.
    pub signal: Option<String>,
    /// Format of its bits, and how the signal rounds and overflows.
    pub word: Word,
    /// Flags of the same record; the field is 0 and has no meaning where one of them is set.
    pub unless: &'static [&'static str],
}

impl Field {
    /// Width in bits.
    pub fn width(&self) -> u32 {
        self.word.format.stored_bits() as u32
    }
}

/// Reordering of a stream's records that does not change their meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// None.
    Total,
    /// Records of different pixels.
    PerPixel,
}

/// The records that cross one port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stream {
    /// Unit and port, such as `raster.in`; or a constant of a frame, such as `light`.
    pub name: &'static str,
    /// Fields from the most significant bits down.
    pub fields: Vec<Field>,
    /// Order that must be kept.
    pub order: Order,
}

impl Stream {
    /// Whether some fields are in floating point.
    pub fn has_floats(&self) -> bool {
        self.fields.iter().any(|field| field.word.format.is_float())
    }

    fn new(name: &'static str) -> Self {
        Stream {
            name,
            fields: Vec::new(),
            order: Order::Total,
        }
    }

    fn per_pixel(self) -> Self {
        Stream {
            order: Order::PerPixel,
            ..self
        }
    }

    fn field(mut self, name: &str, signal: Option<String>, word: Word) -> Self {
        self.fields.push(Field {
            name: name.to_owned(),
            signal,
            word,
            unless: &[],
        });
        self
    }

    fn word(self, name: &str, signal: &str, word: Word) -> Self {
        self.field(name, Some(signal.to_owned()), word)
    }

    fn words(self, names: &[&str], signal: &str, word: Word) -> Self {
        names
            .iter()
            .fold(self, |stream, name| stream.word(name, signal, word))
    }

    fn naturals(self, names: &[&str], bits: i32) -> Self {
        names.iter().fold(self, |stream, name| {
            stream.field(name, None, Word::new(Format::unsigned(bits, 0)))
        })
    }

    /// Fields of a declared record, with what each wire carries.
    fn record<const N: usize>(self, names: &[&str], wires: [Wire; N]) -> Self {
        names
            .iter()
            .zip(wires)
            .fold(self, |stream, (name, Wire { signal, word })| {
                stream.field(name, signal.map(str::to_owned), word)
            })
    }

    fn exponent(self, name: &str) -> Self {
        self.field(name, None, Word::new(Format::signed(EXPONENT_BITS, 0)))
    }

    /// Adds flags to all fields from `first` on: the fields have no meaning where one is set.
    fn unless(mut self, first: usize, flags: &'static [&'static str]) -> Self {
        self.fields[first..]
            .iter_mut()
            .for_each(|field| field.unless = flags);
        self
    }

    /// Bits of a record.
    pub fn width(&self) -> u32 {
        self.fields.iter().map(Field::width).sum()
    }

    /// Position of each field's LSB in the record.
    pub fn places(&self) -> Vec<u32> {
        let mut below = self.width();
        self.fields
            .iter()
            .map(|field| {
                below -= field.width();
                below
            })
            .collect()
    }

    /// Unit of the stream; `None` for constants.
    pub fn unit(&self) -> Option<&'static str> {
        self.name.split_once('.').map(|(unit, _)| unit)
    }
}

/// Content of a wire of a record.
#[derive(Clone, Copy, Debug)]
struct Wire {
    signal: Option<&'static str>,
    word: Word,
}

/// A signal's word.
fn wire(signal: &'static str, word: Word) -> Wire {
    Wire {
        signal: Some(signal),
        word,
    }
}

/// A number that counts something, or a flag.
fn natural(bits: i32) -> Wire {
    Wire {
        signal: None,
        word: Word::new(Format::unsigned(bits, 0)),
    }
}

/// A power of two.
fn power() -> Wire {
    Wire {
        signal: None,
        word: Word::new(Format::signed(EXPONENT_BITS, 0)),
    }
}

/// Clamped depth of the raster.
fn clamped_depth(m: &Machine) -> Wire {
    Wire {
        signal: None,
        word: Word::new(exact_depth(m)),
    }
}

const XYZ: [&str; 3] = ["x", "y", "z"];

fn each<const N: usize>(name: &str, ends: [&str; N]) -> [String; N] {
    ends.map(|end| format!("{name}_{end}"))
}

fn axes(stream: Stream, name: &str, signal: &str, word: Word) -> Stream {
    let names = each(name, XYZ);
    stream.words(&names.each_ref().map(String::as_str), signal, word)
}

/// Exact format of the raster's clamped depth.
pub fn exact_depth(machine: &Machine) -> Format {
    let exact = Raster::depth_exact(machine);
    Format::signed(exact.int_bits + 1, exact.frac_bits)
}

/// Constants of a frame: registers, lights, materials, and the products of each material and each
/// light.
pub fn constants(elaborated: &Elaborated, kind: Kind) -> Vec<Stream> {
    let m = &elaborated.machine;
    let (p, l, s) = (&m.project, &m.ellipse, &m.shade);
    let mut frame = Stream::new("frame").naturals(&["width", "height"], PIXEL_BITS + 1);
    for row in 0..3 {
        for column in 0..3 {
            frame = frame.word(
                &format!("rotation_{row}{column}"),
                "project.rotation",
                p.rotation,
            );
        }
    }
    let frame = axes(frame, "eye", "project.eye", p.eye)
        .word("near", "project.depth", p.depth)
        .words(&["guard_x", "guard_y"], "project.slope", p.slope)
        .word("focal", "project.focal", p.focal)
        .word("inverse_focal", "ellipse.inverse_focal", l.inverse_focal)
        .exponent("inverse_focal_places")
        .word("low_pass", "ellipse.low_pass", l.low_pass)
        .word("cutoff", "raster.cutoff", m.raster.cutoff)
        .word("root_cutoff", "ellipse.root_cutoff", l.root_cutoff)
        .words(&["centre_x", "centre_y"], "project.pixel", p.pixel);
    let frame = aspect(frame, m)
        .naturals(&["cull_backfaces"], 1)
        .word("z_threshold", "fragment.depth", m.fragment.depth)
        .word(
            "coverage_threshold",
            "fragment.weight_sum",
            m.fragment.weight_sum,
        )
        .word(
            "inverse_threshold",
            "shade.inverse_threshold",
            s.inverse_threshold,
        )
        .exponent("inverse_threshold_places")
        .words(
            &[
                "background_r",
                "background_g",
                "background_b",
                "background_a",
            ],
            "resolve.frame",
            m.resolve.frame,
        );
    let light = axes(Stream::new("light"), "direction", "shade.light", s.light)
        .naturals(&["has_half_way"], 1);
    vec![
        window_registers(sheet_registers(kernel(frame, m, kind), m, kind), m, kind),
        axes(light, "half_way", "shade.light", s.light),
        mirrored(
            Stream::new("material").naturals(&["unlit"], 1).word(
                "ambient",
                "shade.reflectance",
                s.reflectance,
            ),
            m,
            kind,
        ),
        Stream::new("reflection").words(
            &[
                "diffuse_r",
                "diffuse_g",
                "diffuse_b",
                "specular_r",
                "specular_g",
                "specular_b",
            ],
            "shade.reflectance",
            s.reflectance,
        ),
    ]
}

/// Whether a request to shade carries its pixel: reflections are looked up along the pixel's ray.
pub fn asks_for_pixel(m: &Machine, kind: Kind) -> bool {
    kind.mirrors && m.reflect.is_some_and(|reflect| reflect.sight == Sight::Ray)
}

/// Fields of a material that reflects its surroundings.
fn mirrored(material: Stream, m: &Machine, kind: Kind) -> Stream {
    let (true, Some(words)) = (kind.mirrors, &m.reflect) else {
        return material;
    };
    material.words(
        &["kept", "mirrored_r", "mirrored_g", "mirrored_b"],
        "reflect.reflectance",
        words.reflectance,
    )
}

/// Registers for pixels that are not square; none where the machine draws only square pixels.
fn aspect(frame: Stream, m: &Machine) -> Stream {
    let Some(word) = m.ellipse.aspect else {
        return frame;
    };
    let inverse = m.ellipse.inverse_focal;
    frame
        .words(&["focal_x", "focal_y"], "project.focal", m.project.focal)
        .word("inverse_focal_x", "ellipse.inverse_focal", inverse)
        .exponent("inverse_focal_x_places")
        .word("inverse_focal_y", "ellipse.inverse_focal", inverse)
        .exponent("inverse_focal_y_places")
        .words(
            &["aspect_xx", "aspect_xy", "aspect_yy"],
            "ellipse.aspect",
            word,
        )
}

/// Registers common to all ellipsoids.
fn kernel(frame: Stream, m: &Machine, kind: Kind) -> Stream {
    let (true, Some(words)) = (kind.ellipsoids, &m.ellipse.ellipsoid) else {
        return frame;
    };
    let mut frame = frame
        .naturals(&["amplitude"], 2)
        .naturals(&["preshaded", "own_axes"], 1);
    frame = frame.words(
        &["jacobian_x", "jacobian_y"],
        "project.slope",
        m.project.slope,
    );
    for axis in each("axis", ["0", "1", "2"]) {
        frame = axes(frame, &axis, "ellipse.normal", m.ellipse.normal);
    }
    frame = frame.words(&SCALES, "ellipse.scale", words.scale).word(
        "least_opacity",
        "splat.opacity",
        m.splat.opacity,
    );
    match m.depth_weight() {
        None => frame,
        Some(words) => frame
            .word("inverse_distance", "sort.share", words.share)
            .exponent("inverse_distance_places"),
    }
}

/// Registers common to all sheets.
fn sheet_registers(frame: Stream, m: &Machine, kind: Kind) -> Stream {
    if !kind.sheets {
        return frame;
    }
    frame
        .naturals(&["each_splat", "back_to_front"], 1)
        .word("stop", "fragment.opacity_sum", m.fragment.opacity_sum)
        .naturals(&["keeps_last"], 1)
        .words(
            &["least_weight", "most_weight"],
            "gauss.weight",
            m.gauss.weight,
        )
        .naturals(&["has_ratio"], 1)
}

/// Registers common to all windows.
fn window_registers(frame: Stream, m: &Machine, kind: Kind) -> Stream {
    if kind.windows {
        frame.word("reach", "fragment.depth", m.fragment.depth)
    } else {
        frame
    }
}

/// The ports of the units, in the order of the diagram.
pub fn streams(elaborated: &Elaborated, kind: Kind) -> Vec<Stream> {
    let m = &elaborated.machine;
    let mut streams = vec![
        pipeline_in(m, kind),
        project_in(m, kind),
        project_out(m, kind),
        ellipse_in(m, kind),
        ellipse_out(m),
    ];
    if let (1.., Some(unit)) = (kind.harmonics, &elaborated.colour) {
        let position = axes(
            Stream::new("colour.in"),
            "position",
            "splat.position",
            m.splat.position,
        );
        streams.extend([
            coefficients(position, m, unit.coefficients()),
            Stream::new("colour.out").words(&RGB, "splat.rgb", m.splat.rgb),
        ]);
    }
    if kind.preshaded {
        streams.extend([
            sums(Stream::new("ellipse.request"), m),
            premultiplied(Stream::new("ellipse.answer"), m),
        ]);
    }
    if let (true, Some(sort)) = (kind.sorted, m.sorting()) {
        let splat = |name| Stream::new(name).naturals(&["tag"], TAG_BITS);
        streams.extend([
            splat("sort.in").word("depth", "project.depth", m.project.depth),
            splat("sort.out").word("key", "sort.key", sort.key),
        ]);
    }
    streams.extend([
        raster_in(m),
        raster_out(m),
        gauss_in(m),
        Stream::new("gauss.out").word("weight", "gauss.weight", m.gauss.weight),
        match (kind.sheets, kind.windows, &m.fragment.window) {
            (true, ..) => sheet_in(m),
            (false, true, Some(words)) => window_in(m, words),
            _ => fragment_in(m),
        },
        fragment_out(kind),
    ]);
    if kind.sheets {
        streams.extend([
            composite("fragment.start", m).per_pixel(),
            lit(composite("fragment.held", m), m).per_pixel(),
        ]);
    } else if kind.windows {
        let layer = Stream::new("fragment.held")
            .naturals(&["x", "y"], PIXEL_BITS)
            .naturals(&["slot"], SLOT_BITS);
        streams.extend([
            sums(Stream::new("fragment.request"), m),
            premultiplied(Stream::new("fragment.answer"), m),
            lit(layer.word("depth", "fragment.depth", m.fragment.depth), m).per_pixel(),
        ]);
    } else {
        streams.extend([
            shade_request("fragment.request", m, kind),
            premultiplied(Stream::new("fragment.answer"), m),
            start(m),
            lit(slot("fragment.held", m).unless(6, &["shaded"]), m).per_pixel(),
        ]);
    }
    streams.extend([
        shade_request("shade.in", m, kind),
        premultiplied(Stream::new("shade.out"), m),
        premultiplied(
            Stream::new("resolve.in")
                .naturals(&["x", "y"], PIXEL_BITS)
                .naturals(&["last", "empty"], 1),
            m,
        )
        .unless(4, &["empty"])
        .per_pixel(),
        frame_words("resolve.out", m),
        frame_words("pipeline.out", m),
    ]);
    streams
}

const RGB: [&str; 3] = ["red", "green", "blue"];

/// Coefficients of harmonics.
fn coefficients(stream: Stream, m: &Machine, count: usize) -> Stream {
    let word = m.colour.unwrap_or_default().coefficient;
    (0..count).fold(stream, |stream, nth| {
        let names = RGB.map(|channel| format!("{channel}_{nth}"));
        stream.words(
            &names.each_ref().map(String::as_str),
            "colour.coefficient",
            word,
        )
    })
}

/// A splat's colour, or its harmonics.
fn own_colour(stream: Stream, m: &Machine, kind: Kind) -> Stream {
    match u32::from(kind.harmonics) {
        0 => stream.words(&RGB, "splat.rgb", m.splat.rgb),
        degree => coefficients(stream, m, colour::coefficients(degree)),
    }
}

fn pipeline_in(m: &Machine, kind: Kind) -> Stream {
    let centre = axes(
        Stream::new("pipeline.in"),
        "position",
        "splat.position",
        m.splat.position,
    );
    let disc = axes(centre, "normal", "splat.normal", m.splat.normal).word(
        "radius",
        "splat.radius",
        m.splat.radius,
    );
    let splat = own_colour(orientation(disc, m, kind), m, kind)
        .word("opacity", "splat.opacity", m.splat.opacity)
        .naturals(&["material"], MATERIAL_BITS);
    if kind.sheets {
        splat.naturals(&["sheet"], SHEET_BITS)
    } else {
        splat
    }
}

const SCALES: [&str; 3] = ["scale_0", "scale_1", "scale_2"];

/// A splat's own axes; 0 where the frame's axes are used.
fn orientation(stream: Stream, m: &Machine, kind: Kind) -> Stream {
    let (true, Some(words)) = (kind.ellipsoids, &m.ellipse.ellipsoid) else {
        return stream;
    };
    let quaternion = each("quaternion", ["w", "x", "y", "z"]);
    stream
        .words(
            &quaternion.each_ref().map(String::as_str),
            "ellipse.quaternion",
            words.quaternion,
        )
        .words(&SCALES, "ellipse.scale", words.scale)
}

/// The point, and for an ellipsoid its opacity.
fn project_in(m: &Machine, kind: Kind) -> Stream {
    let point = axes(
        Stream::new("project.in"),
        "position",
        "splat.position",
        m.splat.position,
    );
    if kind.ellipsoids {
        point.word("opacity", "splat.opacity", m.splat.opacity)
    } else {
        point
    }
}

/// The words of a record of `project.out`: discs have no flag [`TRANSPARENT`].
pub fn project_out_words(kind: Kind, words: [i64; PROJECTED]) -> impl Iterator<Item = i64> {
    words
        .into_iter()
        .enumerate()
        .filter(move |(place, _)| kind.ellipsoids || *place != TRANSPARENT)
        .map(|(_, word)| word)
}

fn project_out(m: &Machine, kind: Kind) -> Stream {
    let p = &m.project;
    let [slope, pixel] = [
        wire("project.slope", p.slope),
        wire("project.pixel", p.pixel),
    ];
    let wires = ProjectOut {
        near: natural(1),
        outside: natural(1),
        transparent: natural(1),
        forward: wire("project.camera", p.camera),
        exponent: power(),
        depth: wire("project.depth", p.depth),
        inverse_depth: wire(
            "project.reciprocal.result",
            Word::new(p.reciprocal.format()),
        ),
        inverse_depth_exponent: power(),
        slope_x: slope,
        slope_y: slope,
        pixel_x: pixel,
        pixel_y: pixel,
    };
    let record = Stream::new("project.out").record(ProjectOut::NAMES, wires.into_words());
    let mut record = record
        .unless(PROJECT_FLAGS, &["near", "outside", "transparent"])
        .unless_first(1, &["near"]);
    record.fields[TRANSPARENT].unless = &["near", "outside"];
    if !kind.ellipsoids {
        record.fields.remove(TRANSPARENT);
        record = record.unless(PROJECT_FLAGS - 1, &["near", "outside"]);
    }
    record
}

fn ellipse_in(m: &Machine, kind: Kind) -> Stream {
    let p = &m.project;
    let [slope, pixel, normal] = [
        wire("project.slope", p.slope),
        wire("project.pixel", p.pixel),
        wire("splat.normal", m.splat.normal),
    ];
    let disc = DiscIn {
        normal_x: normal,
        normal_y: normal,
        normal_z: normal,
        radius: wire("splat.radius", m.splat.radius),
        forward: wire("project.camera", p.camera),
        exponent: power(),
        inverse_depth: wire(
            "project.reciprocal.result",
            Word::new(p.reciprocal.format()),
        ),
        inverse_depth_exponent: power(),
        slope_x: slope,
        slope_y: slope,
        pixel_x: pixel,
        pixel_y: pixel,
    };
    let stream = Stream::new("ellipse.in");
    let (true, Some(words)) = (kind.ellipsoids, &m.ellipse.ellipsoid) else {
        return stream.record(DiscIn::NAMES, disc.into_words());
    };
    let [quaternion, scale] = [
        wire("ellipse.quaternion", words.quaternion),
        wire("ellipse.scale", words.scale),
    ];
    let ellipsoid = EllipsoidIn {
        normal_x: normal,
        normal_y: normal,
        normal_z: normal,
        radius: disc.radius,
        quaternion_w: quaternion,
        quaternion_x: quaternion,
        quaternion_y: quaternion,
        quaternion_z: quaternion,
        scale_0: scale,
        scale_1: scale,
        scale_2: scale,
        opacity: wire("splat.opacity", m.splat.opacity),
        forward: disc.forward,
        exponent: disc.exponent,
        inverse_depth: disc.inverse_depth,
        inverse_depth_exponent: disc.inverse_depth_exponent,
        slope_x: slope,
        slope_y: slope,
        pixel_x: pixel,
        pixel_y: pixel,
    };
    stream.record(EllipsoidIn::NAMES, ellipsoid.into_words())
}

fn ellipse_out(m: &Machine) -> Stream {
    let l = &m.ellipse;
    let [normal, conic, slope] = [
        wire("fragment.normal", m.fragment.normal),
        wire("ellipse.conic", l.conic),
        wire("ellipse.depth_slope", l.depth_slope),
    ];
    let wires = EllipseOut {
        backface: natural(1),
        faint: natural(1),
        outside: natural(1),
        normal_x: normal,
        normal_y: normal,
        normal_z: normal,
        conic_xx: conic,
        conic_xy: wire("ellipse.conic_cross", l.conic_cross),
        conic_yy: conic,
        amplitude: wire("ellipse.amplitude", l.amplitude),
        first_column: natural(PIXEL_BITS),
        last_column: natural(PIXEL_BITS),
        first_row: natural(PIXEL_BITS),
        last_row: natural(PIXEL_BITS),
        depth_slope_x: slope,
        depth_slope_y: slope,
        depth_range: wire("ellipse.depth_range", l.depth_range),
    };
    Stream::new("ellipse.out")
        .record(EllipseOut::NAMES, wires.into_words())
        .unless(3, &["backface", "faint", "outside"])
        .unless_first(1, &["backface"])
        .unless_first(2, &["backface", "faint"])
}

fn raster_in(m: &Machine) -> Stream {
    let l = &m.ellipse;
    let [pixel, conic, slope] = [
        wire("project.pixel", m.project.pixel),
        wire("ellipse.conic", l.conic),
        wire("ellipse.depth_slope", l.depth_slope),
    ];
    let wires = RasterIn {
        pixel_x: pixel,
        pixel_y: pixel,
        conic_xx: conic,
        conic_xy: wire("ellipse.conic_cross", l.conic_cross),
        conic_yy: conic,
        depth: wire("project.depth", m.project.depth),
        depth_slope_x: slope,
        depth_slope_y: slope,
        depth_range: wire("ellipse.depth_range", l.depth_range),
        first_column: natural(PIXEL_BITS),
        last_column: natural(PIXEL_BITS),
        first_row: natural(PIXEL_BITS),
        last_row: natural(PIXEL_BITS),
    };
    Stream::new("raster.in")
        .naturals(&["tag"], TAG_BITS)
        .record(RasterIn::NAMES, wires.into_words())
}

fn raster_out(m: &Machine) -> Stream {
    let wires = RasterOut {
        x: natural(PIXEL_BITS),
        y: natural(PIXEL_BITS),
        radial: wire("raster.radial", m.raster.radial),
        depth: clamped_depth(m),
    };
    Stream::new("raster.out")
        .naturals(&["tag"], TAG_BITS)
        .record(RasterOut::NAMES, wires.into_words())
}

fn gauss_in(m: &Machine) -> Stream {
    let wires = GaussIn {
        radial: wire("raster.radial", m.raster.radial),
        amplitude: wire("ellipse.amplitude", m.ellipse.amplitude),
    };
    Stream::new("gauss.in").record(GaussIn::NAMES, wires.into_words())
}

fn fragment_in(m: &Machine) -> Stream {
    let [rgb, normal] = [
        wire("splat.rgb", m.splat.rgb),
        wire("fragment.normal", m.fragment.normal),
    ];
    let wires = FragmentIn {
        x: natural(PIXEL_BITS),
        y: natural(PIXEL_BITS),
        weight: wire("gauss.weight", m.gauss.weight),
        depth: clamped_depth(m),
        red: rgb,
        green: rgb,
        blue: rgb,
        opacity: wire("splat.opacity", m.splat.opacity),
        normal_x: normal,
        normal_y: normal,
        normal_z: normal,
        material: natural(MATERIAL_BITS),
    };
    Stream::new("fragment.in")
        .record(FragmentIn::NAMES, wires.into_words())
        .per_pixel()
}

/// A contribution to windows, with its splat's light and density.
fn window_in(m: &Machine, words: &Window) -> Stream {
    let fragment = fragment_in(m);
    let light = fragment.words(
        &WindowIn::NAMES[FragmentIn::WORDS..][..3],
        "splat.rgb",
        m.splat.rgb,
    );
    light.word("density", "fragment.window.density", words.density)
}

/// Decision on a contribution. For windows it includes the place among the slots where a pixel
/// overflows.
fn fragment_out(kind: Kind) -> Stream {
    let pixel = Stream::new("fragment.out").naturals(&["x", "y"], PIXEL_BITS);
    let decision = pixel
        .naturals(&["outcome"], outcome_bits(kind))
        .naturals(&["slot"], SLOT_BITS)
        .per_pixel();
    if kind.windows {
        decision.naturals(&["place"], SLOT_BITS)
    } else {
        decision
    }
}

/// Bits of a decision.
pub fn outcome_bits(kind: Kind) -> i32 {
    if kind.windows { 4 } else { 3 }
}

/// A contribution to a sheet.
fn sheet_in(m: &Machine) -> Stream {
    let rgb = wire("splat.rgb", m.splat.rgb);
    let wires = SheetIn {
        x: natural(PIXEL_BITS),
        y: natural(PIXEL_BITS),
        weight: wire("gauss.weight", m.gauss.weight),
        sheet: natural(SHEET_BITS),
        red: rgb,
        green: rgb,
        blue: rgb,
    };
    Stream::new("fragment.in")
        .record(SheetIn::NAMES, wires.into_words())
        .per_pixel()
}

fn all_sums(stream: Stream, m: &Machine) -> Stream {
    let f = &m.fragment;
    let coloured = stream
        .word("weight", "fragment.weight_sum", f.weight_sum)
        .words(
            &["colour_r", "colour_g", "colour_b"],
            "fragment.colour_sum",
            f.colour_sum,
        )
        .word("opacity", "fragment.opacity_sum", f.opacity_sum);
    axes(coloured, "normal", "fragment.normal_sum", f.normal_sum)
}

fn sums(stream: Stream, m: &Machine) -> Stream {
    all_sums(stream, m).naturals(&["material"], MATERIAL_BITS)
}

/// A request to shade: the pixel, if shade needs its ray, and the fragment's sums.
fn shade_request(name: &'static str, m: &Machine, kind: Kind) -> Stream {
    let stream = Stream::new(name);
    sums(
        if asks_for_pixel(m, kind) {
            stream.naturals(&["x", "y"], PIXEL_BITS)
        } else {
            stream
        },
        m,
    )
}

fn premultiplied(stream: Stream, m: &Machine) -> Stream {
    stream.words(
        &["colour_r", "colour_g", "colour_b", "opacity"],
        "shade.premultiplied",
        m.shade.premultiplied,
    )
}

/// A fragment in its slot; in a shaded slot `colour` and `opacity` are shaded words.
fn slot(name: &'static str, m: &Machine) -> Stream {
    let key = Stream::new(name)
        .naturals(&["x", "y"], PIXEL_BITS)
        .naturals(&["slot"], SLOT_BITS)
        .naturals(&["shaded"], 1);
    all_sums(
        key.word("depth", "fragment.depth", m.fragment.depth)
            .naturals(&["material"], MATERIAL_BITS),
        m,
    )
}

/// A pixel of sheets: the composite, and the open sheet.
fn composite(name: &'static str, m: &Machine) -> Stream {
    let f = &m.fragment;
    let pixel = Stream::new(name)
        .naturals(&["x", "y"], PIXEL_BITS)
        .naturals(&["stopped", "closed"], 1);
    let colours = ["colour_r", "colour_g", "colour_b"];
    let pixel = match f.composite() {
        Some(word) => pixel.words(&colours, "fragment.composite", word).word(
            "opacity",
            "fragment.composite",
            word,
        ),
        None => pixel
            .words(&colours, "fragment.colour_sum", f.colour_sum)
            .word("opacity", "fragment.opacity_sum", f.opacity_sum),
    };
    pixel
        .naturals(&["sheet"], SHEET_BITS)
        .word("weight", "fragment.weight_sum", f.weight_sum)
        .words(
            &["sheet_r", "sheet_g", "sheet_b"],
            "fragment.colour_sum",
            f.colour_sum,
        )
        .unless(8, &["closed"])
}

fn lit(stream: Stream, m: &Machine) -> Stream {
    stream.words(
        &["lit_r", "lit_g", "lit_b", "lit_opacity"],
        "shade.premultiplied",
        m.shade.premultiplied,
    )
}

/// State of a pixel before a window, in the fields of its slots.
fn start(m: &Machine) -> Stream {
    let mut start = slot("fragment.start", m).per_pixel();
    let means_nothing =
        |field: &&mut Field| field.name == "weight" || field.name.starts_with("normal");
    start
        .fields
        .iter_mut()
        .filter(means_nothing)
        .for_each(|field| field.unless = &["shaded"]);
    start
}

fn frame_words(name: &'static str, m: &Machine) -> Stream {
    let pixel = Stream::new(name).naturals(&["x", "y"], PIXEL_BITS);
    pixel
        .words(
            &["red", "green", "blue", "alpha"],
            "resolve.frame",
            m.resolve.frame,
        )
        .per_pixel()
}

impl Stream {
    /// Adds flags to one field: it has no meaning where one is set.
    fn unless_first(mut self, field: usize, flags: &'static [&'static str]) -> Self {
        self.fields[field].unless = flags;
        self
    }
}

#[cfg(test)]
mod tests;
