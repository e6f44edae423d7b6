//! Live: runs one unit record by record on given inputs, for a filter, a testbench or another
//! language.
//!
//! ```text
//! record ─►[ read ]─►[ check ]─►( the unit )─► outputs
//!                                 │     ▲      at the end: fragments held, splats sorted
//!                             request ─► shade
//! ```
//! Records are those of a trace's streams ([`ports`]). Inputs that no unit can produce are refused
//! here, so that the unit itself cannot fail.
//!
//! Laws: `a_unit_answers_as_the_trace_says`, `a_bad_record_is_refused_by_its_field`,
//! `no_record_makes_a_unit_fail` (tests/live.rs).

use crate::cosim::trace::{Malformed, RecordLayout, Window, constant_records, made_up, outcome};
use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::hardware::quantise::quantise;
use crate::scene::Scene;
use rtl_model::Machine;
use rtl_model::frame::Frame;
use rtl_model::num::Format;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Order, Stream, project_out_words};
use rtl_model::pipeline::unit_replay::{self, Fragments, Sheets, Windows};
use rtl_model::probe::{NoProbe, Observer};
use rtl_model::records::unit;
use rtl_model::units::fragment::{Premultiplied, Slot, TILE_PX};
use rtl_model::units::resolve::Layer;
use rtl_model::units::shade;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt;

/// The words of a record, field by field.
pub type Record = Vec<i64>;

/// A machine and the constants of a frame: everything that units read besides their records.
#[derive(Clone, Debug)]
pub struct Constants {
    machine: Elaborated,
    frame: Frame,
}

/// Why a record is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The field at fault, if there is one.
    pub field: Option<String>,
    /// What is wrong.
    pub sentence: String,
}

/// One stream of a unit: its fields and their layout in a line.
#[derive(Clone, Debug)]
pub struct Port {
    /// Its fields, and the order of its records.
    pub stream: Stream,
    layout: RecordLayout,
}

/// A unit with its state.
pub struct Unit<'a> {
    of: &'a Constants,
    /// Its name.
    pub name: &'static str,
    /// Input records.
    pub input: Port,
    /// Output records.
    pub output: Port,
    /// `fragment` only: requests to shade, and its answers.
    pub shade: Option<[Port; 2]>,
    /// `fragment` only: fragments held at the end of a frame.
    pub held: Option<Port>,
    state: State<'a>,
}

/// Records at the end of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct End {
    /// Output records: the splats that `sort` sorted.
    pub out: Vec<Record>,
    /// Fragments that `fragment` holds, pixel by pixel.
    pub held: Vec<Record>,
}

/// Returns the light for a request of `fragment`: colour and opacity.
pub type Shade<'a> = dyn FnMut(&[i64]) -> [i64; 4] + 'a;

/// By row and column of tiles.
type TileMap<T> = BTreeMap<[i64; 2], T>;

enum State<'a> {
    None,
    Sort(Vec<Record>),
    Fragments(TileMap<Fragments<'a>>),
    Sheets(Sheets<'a>, TileMap<Sheets<'a>>),
    Windows(TileMap<Windows<'a>>),
    /// The layers so far of the current pixel, and its place.
    Resolve([i64; 2], Vec<Layer>),
}

impl Refused {
    fn new(sentence: impl Into<String>) -> Self {
        Refused {
            field: None,
            sentence: sentence.into(),
        }
    }

    fn of(field: &str, sentence: impl Into<String>) -> Self {
        Refused {
            field: Some(field.to_owned()),
            sentence: sentence.into(),
        }
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let field = self.field.as_deref();
        field.map_or(Ok(()), |field| write!(f, "field {field}: "))?;
        f.write_str(&self.sentence)
    }
}

impl Constants {
    /// The constants of a scene on a machine.
    ///
    /// # Errors
    /// [`Error::Input`] if the machine has elaboration errors, or the scene's constants do not fit
    /// its words.
    pub fn new(scene: &Scene, machine: &Machine) -> Result<Self> {
        let elaborated = fixed::elaborate(machine)?;
        let mut frame = quantise(scene, machine)?.frame;
        Window::default().check(&frame)?;
        frame.lists = None;
        // Units depend on no list of splats, except that ellipsoids may have their own axes.
        frame.splats = Vec::new();
        if let Some(ellipsoids) = &mut frame.ellipsoids {
            ellipsoids.own.truncate(1);
        }
        if let Some(sheets) = &mut frame.sheets {
            sheets.numbers = Vec::new();
        }
        Ok(Constants {
            machine: elaborated,
            frame,
        })
    }

    /// The units that can run alone in such a frame, in the order of the diagram.
    pub fn units(&self) -> Vec<&'static str> {
        Kind::of(&self.frame).units().collect()
    }

    /// Columns and rows of the picture.
    pub fn size_px(&self) -> [u32; 2] {
        [self.frame.width, self.frame.height]
    }

    /// Constants of a frame by name, such as `light`: port and records. None if there are none of
    /// that name.
    pub fn registers(&self, name: &str) -> Option<(Port, Vec<Record>)> {
        let described = ports::constants(&self.machine, Kind::of(&self.frame));
        let stream = described.into_iter().find(|stream| stream.name == name)?;
        let (_, records) = constant_records(&self.machine.machine, &self.frame)
            .into_iter()
            .find(|(other, _)| *other == name)?;
        Some((Port::new(stream), records))
    }

    /// Name of a signal, as `raster.offset`.
    pub fn signal(&self, number: usize) -> String {
        self.machine
            .signals
            .get(number)
            .map_or_else(String::new, |signal| {
                format!("{}.{}", signal.unit, signal.name)
            })
    }

    /// Whether requests to `shade` begin with their pixel.
    fn requests_have_pixel(&self) -> bool {
        ports::asks_for_pixel(&self.machine.machine, Kind::of(&self.frame))
    }

    /// The answer of `shade` to a request.
    pub fn light(&self, request: &[i64]) -> [i64; 4] {
        self.light_observed(request, &mut NoProbe)
    }

    fn light_observed(&self, request: &[i64], observer: &mut dyn Observer<'_>) -> [i64; 4] {
        let (pixel, sums) = if self.requests_have_pixel() {
            request.split_at(2.min(request.len()))
        } else {
            (&[][..], request)
        };
        let &[weight, r, g, b, opacity, x, y, z, material] = sums else {
            return [0; 4];
        };
        let input = shade::Input {
            weight,
            colour: [r, g, b],
            opacity,
            normal: [x, y, z],
            material: material as u32,
            pixel: array(pixel),
        };
        let output = unit_replay::shade(&self.machine, &self.frame, &input, observer);
        let [r, g, b] = output.colour;
        [r, g, b, output.opacity]
    }

    /// Input records of a unit as in a trace's stimulus: corners and thresholds, then about `cases`
    /// random ones, which depend on the seed.
    pub fn made_up(&self, unit: &str, cases: u32, seed: u64) -> Vec<Record> {
        made_up(&self.machine, &self.frame, unit, cases, seed)
    }
}

impl Port {
    fn new(stream: Stream) -> Self {
        Port {
            layout: RecordLayout::new(&stream),
            stream,
        }
    }

    /// Bits of a record.
    pub fn width(&self) -> u32 {
        self.layout.width
    }

    /// Number of fields.
    pub fn fields(&self) -> usize {
        self.stream.fields.len()
    }

    /// Whether only the order of records of one pixel matters.
    pub fn is_per_pixel(&self) -> bool {
        self.stream.order == Order::PerPixel
    }

    /// The words of a line of hexadecimal digits.
    ///
    /// # Errors
    /// [`Refused`], with the field if it is known.
    pub fn read(&self, line: &str) -> std::result::Result<Record, Refused> {
        self.layout.read(line).map_err(|malformed| match malformed {
            Malformed::Digits(0, needed) => {
                Refused::new(format!("the line is empty; {needed} digits are needed"))
            }
            Malformed::Digits(found, needed) => Refused::new(format!(
                "{found} digits, and a record of {} has {needed}",
                self.stream.name
            )),
            Malformed::Digit(digit) => {
                let what = format!("`{}` is not a hexadecimal digit", digit.escape_default());
                let place = line.chars().position(|other| other == digit).unwrap_or(0);
                // In a line of the wrong length the field of a digit is unknown.
                let field = if line.chars().count() == self.layout.digits() {
                    self.field_at(place)
                } else {
                    None
                };
                Refused {
                    field,
                    sentence: what,
                }
            }
            Malformed::TooWide => self.too_wide(),
        })
    }

    fn too_wide(&self) -> Refused {
        Refused::new(format!(
            "bits above the {} of a record of {} are set",
            self.width(),
            self.stream.name
        ))
    }

    /// The field with the most significant bit of a digit, or the first field.
    fn field_at(&self, digit: usize) -> Option<String> {
        let bit = (self.layout.digits() - digit) as u32 * 4 - 1;
        let holds = |(_, lsb): &(_, u32)| *lsb <= bit;
        let (field, _) = self
            .stream
            .fields
            .iter()
            .zip(self.stream.places())
            .find(holds)?;
        Some(field.name.clone())
    }

    /// The words of a JSON object with an integer for each field.
    ///
    /// # Errors
    /// [`Refused`], with the field if it is known.
    pub fn read_json(&self, line: &str) -> std::result::Result<Record, Refused> {
        let object: Map<String, Value> = serde_json::from_str(line)
            .map_err(|e| Refused::new(format!("not a JSON object: {e}")))?;
        if let Some(unknown) = object
            .keys()
            .find(|name| self.stream.fields.iter().all(|field| field.name != **name))
        {
            let names: Vec<&str> = self
                .stream
                .fields
                .iter()
                .map(|field| field.name.as_str())
                .collect();
            return Err(Refused::of(
                unknown,
                format!(
                    "{} has no such field; it has {}",
                    self.stream.name,
                    names.join(", ")
                ),
            ));
        }
        let word = |field: &ports::Field| match object.get(&field.name) {
            None => Err(Refused::of(&field.name, "it is missing")),
            Some(value) => value.as_i64().ok_or_else(|| {
                Refused::of(
                    &field.name,
                    format!("{value}, and a whole number is needed"),
                )
            }),
        };
        self.stream.fields.iter().map(word).collect()
    }

    /// Appends a record as a line.
    pub fn write(&self, words: &[i64], text: &mut Vec<u8>) {
        self.layout.write(words, text);
    }

    /// Appends a record as a line of JSON.
    pub fn write_json(&self, words: &[i64], text: &mut Vec<u8>) {
        let names = self.stream.fields.iter().map(|field| field.name.clone());
        let object: Map<String, Value> = names
            .zip(words.iter().map(|word| Value::from(*word)))
            .collect();
        text.extend(Value::Object(object).to_string().bytes());
        text.push(b'\n');
    }

    /// The words of a record in 32-bit words, the least significant first.
    ///
    /// # Errors
    /// [`Refused`] if there are too few, or if bits above the record are set.
    pub fn unpack(&self, halves: &[u32]) -> std::result::Result<Record, Refused> {
        let digits = self.layout.digits();
        let text: String = halves
            .iter()
            .rev()
            .map(|half| format!("{half:08x}"))
            .collect();
        let Some(start) = text.len().checked_sub(digits) else {
            return Err(Refused::new(format!(
                "{} words of 32 bits, and a record of {} has {} bits",
                halves.len(),
                self.stream.name,
                self.width()
            )));
        };
        if text.bytes().take(start).any(|digit| digit != b'0') {
            return Err(self.too_wide());
        }
        self.read(&text[start..])
    }

    /// A record as 32-bit words, the least significant first. Words above it are 0; excess bits are
    /// dropped.
    pub fn pack(&self, words: &[i64], halves: &mut [u32]) {
        let mut text = Vec::new();
        self.write(words, &mut text);
        let digits = text.strip_suffix(b"\n").unwrap_or(&text);
        let mut eights = digits.rchunks(8);
        for half in halves {
            let eight = eights
                .next()
                .and_then(|eight| std::str::from_utf8(eight).ok());
            *half = eight
                .and_then(|eight| u32::from_str_radix(eight, 16).ok())
                .unwrap_or(0);
        }
    }

    /// Sets unused fields of a record to 0.
    pub fn mask(&self, words: &mut [i64]) {
        self.layout.mask(words);
    }

    /// Index of a field.
    fn place(&self, name: &str) -> Option<usize> {
        self.stream
            .fields
            .iter()
            .position(|field| field.name == name)
    }

    /// Checks that each word is in the range of its field.
    ///
    /// # Errors
    /// The first that is not.
    pub fn hold(&self, words: &[i64]) -> std::result::Result<(), Refused> {
        if words.len() != self.fields() {
            return Err(Refused::new(format!(
                "{} words, and a record of {} has {}",
                words.len(),
                self.stream.name,
                self.fields()
            )));
        }
        for (field, word) in self.stream.fields.iter().zip(words) {
            let format = field.word.format;
            if !(format.min()..=format.max()).contains(word) {
                return Err(between(&field.name, *word, [format.min(), format.max()]));
            }
            if format.representable(*word) != *word {
                let sentence = if word.abs() < format.least_magnitude() {
                    format!("{word}, and {format} has no subnormal numbers")
                } else {
                    format!(
                        "{word}, and a word of {format} has {} significant bits",
                        format.significant_bits
                    )
                };
                return Err(Refused::of(&field.name, sentence));
            }
        }
        Ok(())
    }
}

fn between(field: &str, word: i64, [least, most]: [i64; 2]) -> Refused {
    Refused::of(field, format!("{word}, and {least} to {most} are possible"))
}

impl<'a> Unit<'a> {
    /// An empty unit of this name.
    ///
    /// # Errors
    /// [`Error::Input`] if such a frame has no such unit.
    pub fn new(of: &'a Constants, name: &str) -> Result<Self> {
        let units = of.units();
        let Some(name) = units.iter().copied().find(|unit| *unit == name) else {
            return Err(Error::input(format!(
                "{name}: no such unit; there are {}",
                units.join(", ")
            )));
        };
        let mut streams: BTreeMap<&str, Stream> = ports::streams(&of.machine, Kind::of(&of.frame))
            .into_iter()
            .map(|stream| (stream.name, stream))
            .collect();
        let mut port = |end: &str| {
            streams
                .remove(format!("{name}.{end}").as_str())
                .map(Port::new)
        };
        let (Some(input), Some(output)) = (port("in"), port("out")) else {
            return Err(Error::input(format!("{name} has no ports in such a frame")));
        };
        let shade = if name == unit::FRAGMENT {
            port("request").zip(port("answer")).map(<[Port; 2]>::from)
        } else {
            None
        };
        let state = match name {
            unit::SORT => State::Sort(Vec::new()),
            unit::RESOLVE => State::Resolve([0; 2], Vec::new()),
            unit::FRAGMENT => match &of.frame {
                Frame {
                    sheets: Some(sheets),
                    ..
                } => State::Sheets(Sheets::new(&of.machine, sheets), TileMap::new()),
                Frame {
                    window: Some(_), ..
                } => State::Windows(TileMap::new()),
                _ => State::Fragments(TileMap::new()),
            },
            _ => State::None,
        };
        Ok(Unit {
            of,
            name,
            input,
            output,
            shade,
            held: port("held"),
            state,
        })
    }

    /// The machine and the constants that it reads.
    pub fn constants(&self) -> &'a Constants {
        self.of
    }

    /// Whether its output depends on earlier records.
    pub fn has_state(&self) -> bool {
        !matches!(self.state, State::None)
    }

    /// Refuses records that no other unit and no stimulus gives: words out of range, pixels outside
    /// the picture, materials that do not exist.
    ///
    /// # Errors
    /// The first field that is out of range.
    pub fn check(&self, words: &[i64]) -> std::result::Result<(), Refused> {
        self.input.hold(words)?;
        let [width, height] = self.of.size_px().map(i64::from);
        let materials = self.of.frame.lighting.materials.len() as i64;
        let mut limits: Vec<(&str, [i64; 2])> = Vec::new();
        let format = |name: &str| {
            self.input
                .place(name)
                .map_or(Format::unsigned(1, 0), |place| {
                    self.input.stream.fields[place].word.format
                })
        };
        match self.name {
            unit::ELLIPSE => limits.extend([("forward", [1, format("forward").max()])]),
            unit::RASTER => {
                let [left, top] = ["first_column", "first_row"]
                    .map(|name| self.input.place(name).map_or(0, |place| words[place]));
                limits.extend([
                    ("first_column", [0, width - 1]),
                    ("first_row", [0, height - 1]),
                ]);
                limits.extend([
                    ("last_column", [left, width - 1]),
                    ("last_row", [top, height - 1]),
                ]);
            }
            unit::GAUSS => limits.push(("radial", [0, format("radial").max()])),
            unit::FRAGMENT => {
                limits.extend([
                    ("x", [0, width - 1]),
                    ("y", [0, height - 1]),
                    ("weight", [1, format("weight").max()]),
                ]);
                limits.push(("material", [0, materials - 1]));
            }
            unit::SHADE => limits.extend([
                ("x", [0, width - 1]),
                ("y", [0, height - 1]),
                ("material", [0, materials - 1]),
            ]),
            _ => {}
        }
        for (name, range) in limits {
            if let Some(word) = self.input.place(name).map(|place| words[place])
                && !(range[0]..=range[1]).contains(&word)
            {
                return Err(between(name, word, range));
            }
        }
        self.check_layers(words)
    }

    /// A pixel has at most `layers` of the machine, all of them before the next pixel's.
    fn check_layers(&self, words: &[i64]) -> std::result::Result<(), Refused> {
        let State::Resolve([x, y], layers) = &self.state else {
            return Ok(());
        };
        if !layers.is_empty() && words[..2] != [*x, *y] {
            let (field, word) = if words[0] == *x {
                ("y", words[1])
            } else {
                ("x", words[0])
            };
            return Err(Refused::of(
                field,
                format!("{word}, and the last layer of pixel ({x}, {y}) is missing"),
            ));
        }
        let most = self.of.machine.machine.fragment.layers as usize;
        if words[EMPTY] == 0 && layers.len() >= most {
            return Err(Refused::of(
                "last",
                format!("a pixel has at most {most} layers, and none of them was the last"),
            ));
        }
        Ok(())
    }

    /// Takes an input record; returns the output records.
    ///
    /// # Errors
    /// As [`Unit::check`]; the state is then unchanged.
    pub fn step(
        &mut self,
        words: &[i64],
        shade: &mut Shade,
    ) -> std::result::Result<Vec<Record>, Refused> {
        self.step_observed(words, shade, &mut NoProbe)
    }

    /// [`Unit::step`] with an observer of every intermediate word.
    ///
    /// # Errors
    /// As [`Unit::step`].
    pub fn step_observed(
        &mut self,
        words: &[i64],
        shade: &mut Shade,
        observer: &mut dyn Observer<'_>,
    ) -> std::result::Result<Vec<Record>, Refused> {
        self.check(words)?;
        let mut out = self.outputs(words, shade, observer);
        out.iter_mut().for_each(|words| self.output.mask(words));
        Ok(out)
    }

    fn outputs(
        &mut self,
        words: &[i64],
        shade: &mut Shade,
        probe: &mut dyn Observer<'_>,
    ) -> Vec<Record> {
        let (machine, frame) = (&self.of.machine, &self.of.frame);
        let deepest = machine.machine.fragment.layers as u8 - 1;
        let tile = |at: &[i64]| [at[1] / TILE_PX as i64, at[0] / TILE_PX as i64];
        let place = if self.of.requests_have_pixel() {
            &words[..2]
        } else {
            &[]
        };
        let light = |slot: &Slot| {
            premultiplied(shade(
                &[place, &slot.sums[..], &[slot.material.into()]].concat(),
            ))
        };
        let decision = match &mut self.state {
            State::None => return self.of.once(self.name, words, probe),
            State::Sort(depths) => {
                depths.push(words.to_vec());
                return Vec::new();
            }
            State::Resolve(at, layers) => {
                if words[EMPTY] == 0 {
                    *at = array(&words[..2]);
                    layers.push(Layer {
                        colour: array(&words[4..7]),
                        opacity: words[7],
                        ..Layer::default()
                    });
                }
                if words[LAST] == 0 {
                    return Vec::new();
                }
                let word = unit_replay::resolve(machine, frame, layers, probe);
                layers.clear();
                return vec![[&words[..2], &word].concat()];
            }
            State::Fragments(tiles) => tiles
                .entry(tile(words))
                .or_insert_with(|| Fragments::new(machine, frame))
                .take(array(words), light, probe),
            State::Sheets(empty, tiles) => tiles
                .entry(tile(words))
                .or_insert_with(|| empty.clone())
                .take(array(words), probe),
            State::Windows(tiles) => {
                if let std::collections::btree_map::Entry::Vacant(vacant) = tiles.entry(tile(words))
                    && let Some(windows) = Windows::new(machine, frame)
                {
                    vacant.insert(windows);
                }
                let Some(windows) = tiles.get_mut(&tile(words)) else {
                    return Vec::new();
                };
                windows.take(array(words), light, probe)
            }
        };
        let words_of_outcome = outcome(decision, deepest).map(i64::from);
        let fields = self.output.fields() - 2;
        vec![[&words[..2], &words_of_outcome[..fields]].concat()]
    }

    /// Ends a frame: returns the records at its end and empties the unit.
    ///
    /// # Errors
    /// [`Refused`] if the last layer of a pixel is missing.
    pub fn end(&mut self, shade: &mut Shade) -> std::result::Result<End, Refused> {
        self.end_observed(shade, &mut NoProbe)
    }

    /// [`Unit::end`] with an observer of every intermediate word.
    ///
    /// # Errors
    /// As [`Unit::end`].
    pub fn end_observed(
        &mut self,
        shade: &mut Shade,
        observer: &mut dyn Observer<'_>,
    ) -> std::result::Result<End, Refused> {
        let machine = &self.of.machine;
        let mut end = End::default();
        match &mut self.state {
            State::None => {}
            State::Sort(depths) => {
                let keys: Vec<i64> = depths.iter().map(|words| words[1]).collect();
                let sorted = unit_replay::sort(machine, &keys, observer).unwrap_or_default();
                end.out = sorted
                    .into_iter()
                    .map(|(nth, key)| vec![depths[nth][0], key])
                    .collect();
                depths.clear();
            }
            State::Resolve(_, layers) if layers.is_empty() => {}
            State::Resolve(_, layers) => {
                layers.clear();
                return Err(Refused::of(
                    "last",
                    "the last pixel has no record in which it is 1",
                ));
            }
            State::Fragments(tiles) => {
                in_rows(tiles, |tile, at, pixel| {
                    end.held.extend(fragments_held(tile, at, pixel))
                });
                tiles.clear();
            }
            State::Sheets(_, tiles) => {
                in_rows(tiles, |tile, at, pixel| {
                    end.held.extend(sheets_held(tile, at, pixel))
                });
                tiles.clear();
            }
            State::Windows(tiles) => {
                in_rows(tiles, |tile, at, pixel| {
                    let light = |slot: &Slot| {
                        premultiplied(shade(&[&slot.sums[..], &[slot.material.into()]].concat()))
                    };
                    let layers = tile.layers(pixel, light, observer).into_iter();
                    end.held.extend(layers.map(|layer| {
                        let [r, g, b] = layer.colour;
                        vec![
                            at[0],
                            at[1],
                            layer.slot as i64,
                            layer.depth,
                            r,
                            g,
                            b,
                            layer.opacity,
                        ]
                    }));
                });
                tiles.clear();
            }
        }
        if let Some(held) = &self.held {
            end.held.iter_mut().for_each(|words| held.mask(words));
        }
        Ok(end)
    }
}

/// Fields of `resolve.in`.
const LAST: usize = 2;
const EMPTY: usize = 3;

impl Constants {
    /// Output records of a unit without state for a checked record.
    fn once(&self, name: &str, words: &[i64], probe: &mut dyn Observer<'_>) -> Vec<Record> {
        let (machine, frame) = (&self.machine, &self.frame);
        let size_px = self.size_px();
        match name {
            unit::PROJECT => {
                let opacity = words.get(3).copied().unwrap_or_default();
                let made = unit_replay::project(machine, frame, array(&words[..3]), opacity, probe);
                vec![project_out_words(Kind::of(frame), made).collect()]
            }
            unit::ELLIPSE if frame.ellipsoids.is_some() => {
                unit_replay::ellipsoid(machine, frame, array(words), probe)
                    .into_iter()
                    .map(|made| made.to_vec())
                    .collect()
            }
            unit::ELLIPSE => vec![
                unit_replay::ellipse(machine, &frame.view, size_px, array(words), probe).to_vec(),
            ],
            unit::COLOUR => unit_replay::colour(machine, frame, words, probe)
                .into_iter()
                .map(|made| made.to_vec())
                .collect(),
            unit::RASTER => {
                let made =
                    unit_replay::raster(machine, &frame.view, size_px, array(&words[1..]), probe);
                made.into_iter()
                    .map(|fragment| [&words[..1], &fragment].concat())
                    .collect()
            }
            unit::GAUSS => vec![vec![unit_replay::gauss(machine, array(words), probe)]],
            unit::SHADE => vec![self.light_observed(words, probe).to_vec()],
            _ => Vec::new(),
        }
    }
}

/// Words whose number was checked.
fn array<const N: usize>(words: &[i64]) -> [i64; N] {
    words.try_into().unwrap_or([0; N])
}

fn premultiplied([r, g, b, opacity]: [i64; 4]) -> Premultiplied {
    Premultiplied {
        colour: [r, g, b],
        opacity,
    }
}

/// Visits the pixels of tiles row by row: tile, pixel coordinates, and index in the tile.
fn in_rows<T>(tiles: &mut TileMap<T>, mut visit: impl FnMut(&mut T, [i64; 2], usize)) {
    let side = TILE_PX as i64;
    let mut rows: Vec<i64> = tiles.keys().map(|[row, _]| *row).collect();
    rows.dedup();
    for row in rows {
        for y in 0..side {
            for ([_, column], tile) in tiles.range_mut([row, 0]..[row + 1, 0]) {
                (0..side).for_each(|x| {
                    visit(
                        tile,
                        [column * side + x, row * side + y],
                        (y * side + x) as usize,
                    )
                });
            }
        }
    }
}

/// Front to back; equal depths by slot.
fn fragments_held(tile: &Fragments, at: [i64; 2], pixel: usize) -> Vec<Record> {
    let slots = tile.held(pixel);
    let mut order: Vec<usize> = (0..slots.len()).collect();
    order.sort_by_key(|slot| slots[*slot].depth);
    let words = order.into_iter().map(|number| {
        let slot = &slots[number];
        let lit = if slot.shaded {
            tile.lit(slot, &mut NoProbe)
        } else {
            Premultiplied::default()
        };
        let head = [
            at[0],
            at[1],
            number as i64,
            slot.shaded.into(),
            slot.depth,
            slot.material.into(),
        ];
        [&head[..], &slot.sums, &lit.colour, &[lit.opacity]].concat()
    });
    words.collect()
}

fn sheets_held(tile: &Sheets, at: [i64; 2], pixel: usize) -> Option<Record> {
    let (held, lit) = (tile.held(pixel)?, tile.lit(pixel, &mut NoProbe)?);
    let (sheet, open) = held.open.unwrap_or_default();
    let head = [
        at[0],
        at[1],
        held.stopped.into(),
        held.open.is_none().into(),
    ];
    Some(
        [
            &head[..],
            &held.composite[1..5],
            &[sheet.into()],
            &open[..4],
            &lit.colour,
            &[lit.opacity],
        ]
        .concat(),
    )
}
