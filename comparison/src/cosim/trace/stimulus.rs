//! Stimulus: makes cases for each unit: corner values of every field, thresholds and ties, then
//! seeded random ones.
//!
//! A scene's own transfers seldom meet a limit, a tie or a threshold, where errors in hardware are
//! most likely. Here each unit is driven separately, so its inputs need not be possible outputs of
//! another unit.

mod ellipsoids;
mod windows;

use super::coverage::Coverage;
use super::observer::{flag, least_weight, outcome, outcomes, project_cases, unread, unseen};
use super::transfers::{Key, NONE};
use rtl_model::frame::Frame;
use rtl_model::num::{Fit, Format};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream, asks_for_pixel, project_out_words};
use rtl_model::pipeline::unit_replay::{self, Fragments};
use rtl_model::probe::Observer;
use rtl_model::records::{PROJECT_FLAGS, unit};
use rtl_model::units::fragment::{Decision, Premultiplied, Slot, TILE_PX};
use rtl_model::units::resolve::Layer;
use rtl_model::units::shade;
use std::any::Any;

/// Made-up records of one stream.
#[derive(Clone, Debug, Default)]
pub struct MadeStream {
    /// The stream's name.
    pub name: &'static str,
    /// Its records and their keys.
    pub records: Vec<(Vec<i64>, Key)>,
}

/// Cases of one kind: a range of records of a unit's input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseTag {
    /// Name of the input stream.
    pub stream: &'static str,
    /// Name of the kind.
    pub tag: String,
    /// Index of the first record.
    pub first: usize,
    /// Number of records.
    pub records: usize,
}

/// All made-up records.
#[derive(Clone, Debug, Default)]
pub struct Stimulus {
    /// Every stream.
    pub made: Vec<MadeStream>,
    /// Purpose of the cases.
    pub tags: Vec<CaseTag>,
    /// Coverage of the cases.
    pub coverage: Coverage,
}

/// Pseudo-random numbers from a seed (SplitMix64).
#[derive(Clone, Debug)]
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        super::mixed(0, self.0)
    }

    /// 0 to `end` − 1.
    fn below(&mut self, end: i64) -> i64 {
        (self.next() % end.max(1) as u64) as i64
    }

    fn one_in(&mut self, of: i64) -> bool {
        self.below(of) == 0
    }

    fn among<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as i64) as usize]
    }

    /// Any word: small magnitudes are as likely as large ones.
    fn word(&mut self, format: Format) -> i64 {
        let bits = self.below(i64::from(format.magnitude_bits()) + 1);
        let magnitude = self.below(1 << bits);
        let word = if format.signed && self.one_in(2) {
            -1 - magnitude
        } else {
            magnitude
        };
        if self.one_in(4) {
            self.among(&corners(format))
        } else {
            format.representable(word)
        }
    }
}

/// A word with `places` more fraction bits, or fewer.
fn moved(word: i64, places: i32) -> i64 {
    if places >= 0 {
        word << places.min(62)
    } else {
        word >> (-places).min(63)
    }
}

/// The words of a format at which behaviour may change.
fn corners(format: Format) -> Vec<i64> {
    let one = if (0..format.magnitude_bits()).contains(&format.frac_bits) {
        format.one()
    } else {
        0
    };
    let all = [
        format.min(),
        format.min() + 1,
        -one,
        -1,
        0,
        1,
        one - 1,
        one,
        one + 1,
        format.max() - 1,
        format.max(),
    ];
    let mut corners: Vec<i64> = all
        .into_iter()
        .filter(|word| (format.min()..=format.max()).contains(word))
        .map(|word| format.representable(word))
        .collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

/// Contributions besides the corner cases: many, so that pixels become full.
const CONTRIBUTIONS: usize = 4096;

/// Makes corner cases and N random cases for each traced unit.
pub fn stimulus(
    machine: &Elaborated,
    frame: &Frame,
    cases: u32,
    seed: u64,
    includes: impl Fn(&[&str]) -> bool,
) -> Stimulus {
    let streams = ports::streams(machine, Kind::of(frame));
    let made = streams
        .iter()
        .filter(|stream| stream.unit() != Some("pipeline"))
        .map(|stream| MadeStream {
            name: stream.name,
            records: Vec::new(),
        });
    let made = made.collect();
    let mut maker = Maker {
        machine,
        frame,
        streams,
        random: Random(seed),
        // A stream without cases exists all the same, and is empty.
        out: Stimulus {
            made,
            ..Stimulus::default()
        },
        seen: StimulusObserver {
            coverage: Coverage::new(machine),
            unread: unread(machine, frame),
            unseen: unseen(machine),
            flags: 0,
        },
        cases: cases as usize,
    };
    let of_fragments = match Kind::of(frame) {
        Kind { sheets: true, .. } => Maker::sheets,
        Kind { windows: true, .. } => Maker::windows,
        _ => Maker::fragments,
    };
    let makers: [(&[&str], Make<'_>); 8] = [
        (&["project", "ellipse"], Maker::splats),
        (&["colour"], Maker::colour),
        (&["sort"], Maker::sort),
        (&["raster"], Maker::raster),
        (&["gauss"], Maker::gauss),
        (&["fragment"], of_fragments),
        (&["shade"], Maker::shade),
        (&["resolve"], Maker::resolve),
    ];
    makers
        .iter()
        .filter(|(units, _)| includes(units))
        .for_each(|(_, make)| make(&mut maker));
    let Maker { out, seen, .. } = maker;
    Stimulus {
        coverage: seen.coverage,
        ..out
    }
}

/// Made-up input records of one unit.
pub fn made_up(
    machine: &Elaborated,
    frame: &Frame,
    unit: &str,
    cases: u32,
    seed: u64,
) -> Vec<Vec<i64>> {
    let Stimulus { made, .. } =
        stimulus(machine, frame, cases, seed, |units| units.contains(&unit));
    let input = made
        .into_iter()
        .find(|made| made.name.split_once('.') == Some((unit, "in")));
    let mut records: Vec<Vec<i64>> = input.map_or_else(Vec::new, |made| {
        made.records.into_iter().map(|(words, _)| words).collect()
    });
    // Random ones first: the cases that fill a pixel up do not depend on the seed.
    if unit == unit::FRAGMENT {
        let random = cases as usize
            + if frame.window.is_some() {
                windows::CONTRIBUTIONS
            } else {
                CONTRIBUTIONS
            };
        let filling = records.len().saturating_sub(random);
        records.rotate_left(filling);
    }
    records
}

/// Makes the cases of a unit.
type Make<'a> = fn(&mut Maker<'a>);

struct Maker<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    streams: Vec<Stream>,
    random: Random,
    out: Stimulus,
    seen: StimulusObserver,
    cases: usize,
}

/// Counts cases, and collects the flags of a record's words.
struct StimulusObserver {
    coverage: Coverage,
    /// Words of this signal are not used.
    unread: Option<usize>,
    /// Words of this signal cross no port.
    unseen: Option<usize>,
    flags: u8,
}

impl StimulusObserver {
    /// Flags since the last record.
    fn flush(&mut self) -> u8 {
        std::mem::take(&mut self.flags)
    }
}

impl Observer<'static> for StimulusObserver {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(StimulusObserver {
            coverage: self.coverage.of_another_part(),
            unread: self.unread,
            unseen: self.unseen,
            flags: 0,
        })
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<StimulusObserver>() {
            self.coverage.merge(fork.coverage);
            self.flags |= fork.flags;
        }
    }

    fn word(&mut self, fit: &Fit, exact: i64, more: i64, _word: i64) {
        if self.unread == Some(fit.signal) {
            return;
        }
        self.coverage.fitted(fit, exact, more);
        if self.unseen != Some(fit.signal) {
            self.flags |= flag::of(fit, exact, more);
        }
    }

    fn wrapped(&mut self, _signal: usize) {
        self.flags |= flag::WRAPPED;
    }
}

/// Key of a case without a place in a picture.
fn key(parent: usize) -> Key {
    Key {
        splat: NONE,
        x: 0xffff,
        y: 0xffff,
        slot: 0xff,
        parent: parent as u32,
        flags: 0,
    }
}

fn pixel_key([x, y]: [i64; 2], parent: usize) -> Key {
    Key {
        x: x as u32,
        y: y as u32,
        ..key(parent)
    }
}

const UNKNOWN: usize = NONE as usize;

/// Whether a position is in the camera's view.
fn is_seen(machine: &Elaborated, frame: &Frame, place: [i64; 3]) -> bool {
    let opaque = machine.machine.splat.opacity.format.max();
    unit_replay::project(
        machine,
        frame,
        place,
        opaque,
        &mut rtl_model::probe::NoProbe,
    )[..2]
        == [0, 0]
}

/// Indices of a point's words in a record of `ellipse.in`.
const POINT: usize = 8;

impl Maker<'_> {
    fn formats(&self, stream: &str) -> Vec<Format> {
        let stream = self.streams.iter().find(|other| other.name == stream);
        stream.map_or_else(Vec::new, |stream| {
            stream
                .fields
                .iter()
                .map(|field| field.word.format)
                .collect()
        })
    }

    /// Words as the fields of a stream can hold them.
    fn held(&self, stream: &str, mut words: Vec<i64>) -> Vec<i64> {
        if self.streams.iter().any(Stream::has_floats) {
            let formats = self.formats(stream);
            for (word, format) in words.iter_mut().zip(formats) {
                *word = format.representable(*word);
            }
        }
        words
    }

    fn requests_have_pixel(&self) -> bool {
        asks_for_pixel(&self.machine.machine, Kind::of(self.frame))
    }

    fn push(&mut self, name: &'static str, words: Vec<i64>, key: Key) -> usize {
        let Some(MadeStream { records, .. }) =
            self.out.made.iter_mut().find(|made| made.name == name)
        else {
            return UNKNOWN;
        };
        records.push((words, key));
        records.len() - 1
    }

    /// Adds flags to a record.
    fn flag(&mut self, name: &'static str, record: usize, flags: u8) {
        let made = self.out.made.iter_mut().find(|made| made.name == name);
        if let Some((_, key)) = made.and_then(|made| made.records.get_mut(record)) {
            key.flags |= flags;
        }
    }

    /// Names the records since `first` as one kind of cases; returns the next index.
    fn tag(&mut self, stream: &'static str, tag: &str, first: usize) -> usize {
        let end = self
            .out
            .made
            .iter()
            .find(|made| made.name == stream)
            .map_or(0, |made| made.records.len());
        if end > first {
            self.out.tags.push(CaseTag {
                stream,
                tag: tag.to_owned(),
                first,
                records: end - first,
            });
        }
        end
    }

    /// Every corner of every field, the other fields random; then random words in all fields.
    fn words(&mut self, formats: &[Format]) -> Vec<(String, Vec<Vec<i64>>)> {
        let random = &mut self.random;
        let mut any = |fixed: Option<(usize, i64)>| -> Vec<i64> {
            let mut words: Vec<i64> = formats.iter().map(|format| random.word(*format)).collect();
            if let Some((field, word)) = fixed {
                words[field] = word;
            }
            words
        };
        let mut at_corners = Vec::new();
        for (field, format) in formats.iter().enumerate() {
            for word in corners(*format) {
                (0..4).for_each(|_| at_corners.push(any(Some((field, word)))));
            }
        }
        let anywhere = (0..self.cases).map(|_| any(None)).collect();
        vec![("corners".into(), at_corners), ("random".into(), anywhere)]
    }

    /// Cases of `project`, and of `ellipse` after it.
    fn splats(&mut self) {
        let (mut first, mut first_disc) = (0, 0);
        let mut formats = self.formats("project.in")[..3].to_vec();
        // The fields of `ellipse.in` that belong to the splat, and not to its point.
        let own = self.formats("ellipse.in");
        formats.extend(&own[..own.len() - POINT]);
        let near_eye = self.near_eye();
        let mut kinds = self.words(&formats);
        // Most random positions are outside the view: adds as many cases inside it.
        let mut seen = self.words(&formats).pop().unwrap_or_default().1;
        for words in &mut seen {
            let place = near_eye[self.random.below(near_eye.len() as i64) as usize];
            words[..3].copy_from_slice(&place);
        }
        // Discs seen edge-on, and normals of length 0.
        for words in seen.iter_mut().step_by(8) {
            words[3..6].fill(0);
            words[6] = formats[6].max();
        }
        self.likely_axes(&mut seen);
        self.at_reach(&mut seen);
        let edges = self.edges_of_view(&near_eye, &formats);
        kinds.extend([
            ("in view".into(), seen),
            ("edges of the view".into(), edges),
        ]);
        for (kind, records) in kinds {
            for words in records {
                let words: Vec<i64> = words
                    .iter()
                    .zip(&formats)
                    .map(|(word, format)| format.representable(*word))
                    .collect();
                let (position, own) = ([words[0], words[1], words[2]], &words[3..]);
                // The last word of an ellipsoid is its opacity.
                let opacity = if self.frame.ellipsoids.is_some() {
                    own.last().copied()
                } else {
                    None
                };
                let input = self.push(
                    "project.in",
                    position.into_iter().chain(opacity).collect(),
                    key(UNKNOWN),
                );
                let projected = unit_replay::project(
                    self.machine,
                    self.frame,
                    position,
                    opacity.unwrap_or_default(),
                    &mut self.seen,
                );
                let flags = self.seen.flush();
                let output = self.push(
                    "project.out",
                    project_out_words(Kind::of(self.frame), projected).collect(),
                    key(input),
                );
                self.flag("project.out", output, flags);
                for (flag, case) in projected.into_iter().zip(project_cases(self.frame)) {
                    self.seen.coverage.count_if(flag != 0, "project", case);
                }
                let [
                    near,
                    outside,
                    transparent,
                    forward,
                    exponent,
                    _,
                    inverse,
                    inverse_exponent,
                    a,
                    b,
                    x,
                    y,
                ] = projected;
                if [near, outside, transparent] != [0; PROJECT_FLAGS] {
                    self.flag("project.out", output, flag::CUT_OFF);
                    continue;
                }
                let [a, b] = self.at_limits([a, b]);
                let point: [i64; POINT] =
                    [forward, exponent, inverse, inverse_exponent, a, b, x, y];
                // Records of both units have the flags of both.
                let later = self.set_up([own, &point].concat(), output, flags);
                self.flag("project.out", output, later);
            }
            first = self.tag("project.in", &kind, first);
            first_disc = self.tag("ellipse.in", &kind, first_disc);
        }
    }

    /// Cases of `colour`: corners and random words; also positions near the eye, and at it.
    fn colour(&mut self) {
        if Kind::of(self.frame).harmonics == 0 {
            return;
        }
        let mut first = 0;
        let formats = self.formats("colour.in");
        let mut kinds = self.words(&formats);
        let (position, eye) = (
            self.machine.machine.splat.position.format,
            self.machine.machine.project.eye.format,
        );
        let mut near = kinds
            .last()
            .map_or_else(Vec::new, |(_, random)| random.clone());
        let shift = position.frac_bits - eye.frac_bits;
        for (words, way) in near.iter_mut().zip(0..) {
            for (word, from) in words.iter_mut().zip(self.frame.view.eye) {
                let at = if shift < 0 {
                    from >> -shift
                } else {
                    from << shift
                };
                // The first is at the eye, the next are farther and farther away.
                let by = if way == 0 {
                    0
                } else {
                    *word >> (position.width() - 1 - way % position.width())
                };
                *word = (at + by).clamp(position.min(), position.max());
            }
        }
        kinds.push(("near the eye".into(), near));
        for (kind, records) in kinds {
            for words in records {
                let words = self.held("colour.in", words);
                let input = self.push("colour.in", words.clone(), key(UNKNOWN));
                let made = unit_replay::colour(self.machine, self.frame, &words, &mut self.seen);
                let flags = self.seen.flush();
                let output = Key {
                    flags,
                    ..key(input)
                };
                if let Some(rgb) = made {
                    self.push("colour.out", rgb.to_vec(), output);
                }
            }
            first = self.tag("colour.in", &kind, first);
        }
    }

    /// One case of `ellipse`; returns the flags of its words.
    fn set_up(&mut self, words: Vec<i64>, parent: usize, before: u8) -> u8 {
        let words = self.held("ellipse.in", words);
        let input = self.push("ellipse.in", words.clone(), key(parent));
        let size_px = [self.frame.width, self.frame.height];
        let (machine, frame, coverage) = (self.machine, self.frame, &mut self.seen);
        let made = match &frame.ellipsoids {
            None => words
                .try_into()
                .ok()
                .map(|words| unit_replay::ellipse(machine, &frame.view, size_px, words, coverage)),
            Some(_) => words
                .try_into()
                .ok()
                .and_then(|words| unit_replay::ellipsoid(machine, frame, words, coverage)),
        };
        let flags = self.seen.flush();
        let Some(made) = made else { return flags };
        for (flag, case) in made.into_iter().zip(["backface", "faint", "outside"]) {
            self.seen.coverage.count_if(flag != 0, "ellipse", case);
        }
        let culled = if made[..3] == [0; 3] {
            0
        } else {
            flag::CUT_OFF
        };
        self.push(
            "ellipse.out",
            made.to_vec(),
            Key {
                flags: before | flags | culled,
                ..key(input)
            },
        );
        flags
    }

    /// Positions on both sides of the edges of the view, one LSB apart.
    fn edges_of_view(&mut self, seen: &[[i64; 3]], formats: &[Format]) -> Vec<Vec<i64>> {
        let (machine, frame) = (self.machine, self.frame);
        let is_seen = |place: [i64; 3]| is_seen(machine, frame, place);
        let mut edges = Vec::new();
        for _ in 0..64 {
            let inside = seen[self.random.below(seen.len() as i64) as usize];
            let axis = self.random.below(3) as usize;
            let at = |along: i64| {
                std::array::from_fn(|other| if other == axis { along } else { inside[other] })
            };
            for end in [formats[axis].min(), formats[axis].max()] {
                if !is_seen(inside) || is_seen(at(end)) {
                    continue;
                }
                let (mut near, mut far) = (inside[axis], end);
                while (far - near).abs() > 1 {
                    let middle = (near + far).div_euclid(2);
                    *(if is_seen(at(middle)) {
                        &mut near
                    } else {
                        &mut far
                    }) = middle;
                }
                edges.extend(
                    (-3..=3)
                        .map(|by| at((near + by).clamp(formats[axis].min(), formats[axis].max()))),
                );
            }
        }
        let random = &mut self.random;
        let with_disc = |place: [i64; 3]| {
            place
                .into_iter()
                .chain(formats[3..].iter().map(|format| random.word(*format)))
                .collect()
        };
        edges.into_iter().map(with_disc).collect()
    }

    /// Positions in view, from a grid of all positions; all of them if none is in view.
    fn near_eye(&self) -> Vec<[i64; 3]> {
        let format = self.machine.machine.splat.position.format;
        let step = (format.max() / 12).max(1);
        let line: Vec<i64> = (-12..=12)
            .map(|i| (i * step).clamp(format.min(), format.max()))
            .collect();
        let all = line.iter().flat_map(|&x| {
            line.iter()
                .flat_map(move |&y| [x, y].into_iter().map(move |_| [x, y]))
        });
        let grid: Vec<[i64; 3]> = all
            .flat_map(|[x, y]| line.iter().map(move |&z| [x, y, z]))
            .collect();
        let mut seen: Vec<[i64; 3]> = grid
            .iter()
            .copied()
            .filter(|place| is_seen(self.machine, self.frame, *place))
            .collect();
        seen.dedup();
        if seen.is_empty() { grid } else { seen }
    }

    fn raster(&mut self) {
        let formats = self.formats("raster.in");
        let mut first = 0;
        for (kind, records) in self.words(&formats[1..10]) {
            for words in records {
                let [left, top] = [self.frame.width, self.frame.height]
                    .map(|size| self.random.below(size.into()));
                let side = if self.random.one_in(8) { 40 } else { 9 };
                let [right, bottom] =
                    [(left, self.frame.width), (top, self.frame.height)].map(|(first, size)| {
                        (first + self.random.below(side)).min(i64::from(size) - 1)
                    });
                let mut input = [0; 13];
                input[..9].copy_from_slice(&words);
                input[9..].copy_from_slice(&[left, right, top, bottom]);
                if self.random.one_in(2) {
                    self.put_in_box(&mut input);
                }
                for (word, format) in input.iter_mut().zip(&formats[1..]) {
                    *word = format.representable(*word);
                }
                let number = self
                    .out
                    .made
                    .iter()
                    .find(|made| made.name == "raster.in")
                    .map_or(0, |made| made.records.len());
                let parent = self.push(
                    "raster.in",
                    [&[number as i64], &input[..]].concat(),
                    key(UNKNOWN),
                );
                let fragments = unit_replay::raster(
                    self.machine,
                    &self.frame.view,
                    [self.frame.width, self.frame.height],
                    input,
                    &mut self.seen,
                );
                let flags = self.seen.flush();
                self.flag("raster.in", parent, flags);
                self.cover_raster(&input, &fragments);
                for [x, y, radial, depth] in fragments {
                    self.push(
                        "raster.out",
                        vec![number as i64, x, y, radial, depth],
                        pixel_key([x, y], parent),
                    );
                }
            }
            first = self.tag("raster.in", &kind, first);
        }
    }

    /// Moves the centre of a footprint into its box, as for most splats.
    fn put_in_box(&mut self, input: &mut [i64; 13]) {
        let format = self.machine.machine.project.pixel.format;
        for (axis, size) in [self.frame.width, self.frame.height]
            .into_iter()
            .enumerate()
        {
            let [first, last] = [input[9 + 2 * axis], input[10 + 2 * axis]];
            // In half pixels from the centre of the picture, then anywhere in the pixel.
            let halves = 2 * (first + self.random.below(last - first + 1)) + 1 - i64::from(size);
            let one = format.one();
            let word = moved(halves, format.frac_bits - 1) + self.random.below(one) - one / 2;
            input[axis] = word.clamp(format.min(), format.max());
        }
    }

    fn cover_raster(&mut self, input: &[i64; 13], fragments: &[[i64; 4]]) {
        let m = &self.machine.machine;
        let depth_f = ports::exact_depth(m).frac_bits;
        let [depth, range] = [
            (input[5], m.project.depth),
            (input[8], m.ellipse.depth_range),
        ]
        .map(|(word, of)| moved(word, depth_f - of.format.frac_bits));
        let cutoff = moved(
            self.frame.view.cutoff,
            m.raster.radial.format.frac_bits - m.raster.cutoff.format.frac_bits,
        );
        let pixels = (input[10] - input[9] + 1) * (input[12] - input[11] + 1);
        let meet = &mut self.seen.coverage;
        meet.count(
            "raster",
            if fragments.is_empty() {
                "box keeps nothing"
            } else {
                "box keeps something"
            },
        );
        if fragments.len() as i64 == pixels {
            meet.count("raster", "box keeps everything");
        }
        for [_, _, radial, z] in fragments {
            meet.count_if(*radial == 0, "raster", "radial 0, or below it");
            meet.count_if(
                *radial == cutoff - 1,
                "raster",
                "radial one below the cutoff",
            );
            meet.count_if(
                *z == depth - range,
                "raster",
                "depth at the near end of its clamp",
            );
            meet.count_if(
                *z == depth + range,
                "raster",
                "depth at the far end of its clamp",
            );
        }
    }

    fn gauss(&mut self) {
        let m = &self.machine.machine;
        let (radial, amplitude) = (m.raster.radial.format, m.ellipse.amplitude.format);
        let index = m.gauss.radial_index.format;
        let places = radial.frac_bits - index.frac_bits;
        let least = least_weight(self.frame);
        // Both ends and the middle of every step of the table, and their neighbours; a subset if
        // the table is large.
        let steps = 1i64 << m.gauss.table.index_bits.min(9);
        let step = ((index.max() + 1) / steps).max(1);
        let mut at_steps = Vec::new();
        for place in (0..steps).flat_map(|i| [i * step, i * step + step / 2]) {
            let word = if places >= 0 {
                place << places
            } else {
                place >> -places
            };
            at_steps.extend([-1, 0, 1].map(|by| [word + by, self.random.word(amplitude)]));
        }
        let half = if places > 0 { 1 << (places - 1) } else { 0 };
        let ties = (0..256)
            .map(|_| {
                [
                    (self.random.below(index.max() + 1) << places.max(0)) + half,
                    self.random.word(amplitude),
                ]
            })
            .collect();
        let ends = corners(radial)
            .into_iter()
            .flat_map(|r| corners(amplitude).into_iter().map(move |a| [r, a]))
            .collect();
        let anywhere = (0..self.cases)
            .map(|_| [self.random.word(radial), self.random.word(amplitude)])
            .collect();
        let mut first = 0;
        let kinds = [
            ("table steps", at_steps),
            ("ties", ties),
            ("corners", ends),
            ("random", anywhere),
        ];
        for (kind, records) in kinds
            .into_iter()
            .chain((least > 1).then(|| ("least weight", self.near_least())))
        {
            for [radial_word, amplitude] in records {
                let format = self.machine.machine.ellipse.amplitude.format;
                let amplitude = format.representable(amplitude);
                let words = [radial_word.clamp(0, radial.max()), amplitude];
                let parent = self.push("gauss.in", words.to_vec(), key(UNKNOWN));
                let weight = unit_replay::gauss(self.machine, words, &mut self.seen);
                self.seen.coverage.count(
                    "gauss",
                    if weight == 0 {
                        "weight 0"
                    } else {
                        "weight above 0"
                    },
                );
                for (by, name) in [
                    (-1, "weight one below the least"),
                    (0, "weight at the least"),
                ] {
                    if least > 1 {
                        self.seen
                            .coverage
                            .count_if(weight == least + by, "gauss", name);
                    }
                }
                let cut_off = if weight < least { flag::CUT_OFF } else { 0 };
                let flags = self.seen.flush() | cut_off;
                self.push(
                    "gauss.out",
                    vec![weight],
                    Key {
                        flags,
                        ..key(parent)
                    },
                );
            }
            first = self.tag("gauss.in", kind, first);
        }
    }

    /// Contributions at, one LSB within and one LSB beyond ε of the fragments that their pixel
    /// holds.
    fn fragments(&mut self) {
        let m = &self.machine.machine;
        let formats = self.formats("fragment.in");
        let depth = m.fragment.depth.format;
        let places = ports::exact_depth(m).frac_bits - depth.frac_bits;
        let sides =
            [self.frame.width, self.frame.height].map(|size| i64::from(size).min(TILE_PX as i64));
        let threshold = self.frame.z_threshold;
        let mut unit = Fragments::new(self.machine, self.frame);
        let mut at = [0, 0];
        self.fill_up(&mut unit, &formats);
        for _ in 0..self.cases + CONTRIBUTIONS {
            if !self.random.one_in(3) {
                at = sides.map(|side| self.random.below(side));
            }
            let pixel = at[1] as usize * TILE_PX + at[0] as usize;
            let held = unit.held(pixel);
            let z = self.depth(&held, threshold);
            self.cover_match(&held, z, threshold);
            let mut words: Vec<i64> = formats
                .iter()
                .map(|format| self.random.word(*format))
                .collect();
            words[..2].copy_from_slice(&at);
            words[2] = words[2].max(1);
            let below = if places > 0 {
                self.random.below(1 << places) - (1 << (places - 1))
            } else {
                0
            };
            let exact = if places >= 0 {
                (z << places) + below
            } else {
                z >> -places
            };
            if !self.random.one_in(16) {
                words[3] = exact.clamp(formats[3].min(), formats[3].max());
            }
            // Half of all surfaces are opaque and have a large weight, so that some fragments are
            // hidden.
            if self.random.one_in(2) {
                words[2] = formats[2].max();
                words[7] = m.splat.opacity.format.one();
            }
            if self.random.one_in(16) {
                self.up_to_threshold(&held, &mut words, places);
            }
            words[11] = self
                .random
                .below(self.frame.lighting.materials.len() as i64);
            self.contribution(&mut unit, pixel, &held, words);
        }
        self.tag("fragment.in", "thresholds and random", 0);
        for y in 0..sides[1] {
            for x in 0..sides[0] {
                self.end_of_pixel(&unit, [x, y]);
            }
        }
    }

    /// The greatest contributions at one place: as many as its sums can hold, and two more.
    fn fill_up(&mut self, unit: &mut Fragments, formats: &[Format]) {
        let f = &self.machine.machine.fragment;
        let exact = formats[3].max() / 2;
        let by = formats[2].frac_bits - f.weight_sum.format.frac_bits;
        let held = if by >= 0 {
            formats[2].max() >> by
        } else {
            formats[2].max() << -by
        };
        let count = (f.weight_sum.format.max() / held.max(1) + 2).min(4096);
        for (at, normal) in [
            ([0, 0], [5, 6, 7].map(|sum| formats[sum + 3].max())),
            ([1, 0], [5, 6, 7].map(|sum| formats[sum + 3].min())),
        ] {
            let mut words = vec![at[0], at[1], formats[2].max(), exact];
            words.extend(formats[4..8].iter().map(|format| format.max()));
            words.extend(normal);
            words.push(0);
            for _ in 0..count {
                let held = unit.held(at[1] as usize * TILE_PX + at[0] as usize);
                self.contribution(
                    unit,
                    at[1] as usize * TILE_PX + at[0] as usize,
                    &held,
                    words.clone(),
                );
            }
        }
    }

    /// The weight that brings an opaque fragment exactly to τ, or one LSB from it.
    fn up_to_threshold(&mut self, held: &[Slot], words: &mut [i64], places: i32) {
        let m = &self.machine.machine;
        let threshold = self.frame.coverage_threshold;
        let Some(slot) = held
            .iter()
            .find(|slot| !slot.shaded && slot.sums[0] < threshold)
        else {
            return;
        };
        let by = m.gauss.weight.format.frac_bits - m.fragment.weight_sum.format.frac_bits;
        let lacks = threshold - slot.sums[0] + self.random.below(3) - 1;
        let weight = if by >= 0 { lacks << by } else { lacks >> -by };
        if places >= 0 && (1..=m.gauss.weight.format.max()).contains(&weight) {
            (words[2], words[3], words[7]) =
                (weight, slot.depth << places, m.splat.opacity.format.one());
        }
    }

    fn contribution(&mut self, unit: &mut Fragments, pixel: usize, held: &[Slot], words: Vec<i64>) {
        let words = self.held("fragment.in", words);
        let at = [words[0], words[1]];
        let input = self.push("fragment.in", words.clone(), pixel_key(at, UNKNOWN));
        let mut requests: Vec<(Slot, Premultiplied)> = Vec::new();
        let (random, machine) = (&mut self.random, self.machine);
        let decision = unit.take(
            words.try_into().unwrap_or_default(),
            |slot| {
                let answer = answer(random, machine);
                requests.push((*slot, answer));
                answer
            },
            &mut self.seen,
        );
        let flags = self.seen.flush();
        for (slot, answer) in requests {
            let place = if self.requests_have_pixel() {
                &at[..]
            } else {
                &[]
            };
            let request = self.push(
                "fragment.request",
                [place, &slot.sums[..], &[slot.material.into()]].concat(),
                pixel_key(at, input),
            );
            let [r, g, b] = answer.colour;
            self.push(
                "fragment.answer",
                vec![r, g, b, answer.opacity],
                pixel_key(at, request),
            );
        }
        let [outcome, slot, _] = outcome(decision, 0);
        let full = held.len() == self.machine.machine.fragment.layers as usize;
        let shaded = held.iter().filter(|slot| slot.shaded).count();
        let meet = &mut self.seen.coverage;
        meet.count(
            "fragment",
            &format!(
                "{}, slot {slot}",
                outcomes(Kind::of(self.frame))[usize::from(outcome)]
            ),
        );
        if full {
            meet.count("fragment", &format!("full, {shaded} of them shaded"));
        }
        if let Decision::Merged(..) = decision {
            let same = unit.held(pixel).iter().filter(|slot| slot.shaded).count();
            meet.count("fragment", &format!("merge leaves {same} shaded"));
        }
        let flags = flags | flag::of_decision(decision);
        let key = Key {
            slot: slot.into(),
            flags,
            ..pixel_key(at, input)
        };
        self.push(
            "fragment.out",
            vec![at[0], at[1], outcome.into(), slot.into()],
            key,
        );
    }

    /// A depth at the reach of a held fragment or one LSB from it, in the middle of two, or
    /// anywhere.
    fn depth(&mut self, held: &[Slot], threshold: i64) -> i64 {
        let format = self.machine.machine.fragment.depth.format;
        let random = &mut self.random;
        if held.is_empty() || random.one_in(4) {
            // At most some tens of ε apart; otherwise two contributions would never merge.
            let middle = format.max() / 2;
            let spread = (threshold * 24).max(4).min(format.max());
            return if random.one_in(8) {
                random.word(format)
            } else {
                (middle - spread / 2 + random.below(spread)).clamp(0, format.max())
            };
        }
        let slot = held[random.below(held.len() as i64) as usize].depth;
        let other = held[random.below(held.len() as i64) as usize].depth;
        let reach = threshold + random.below(3) - 1;
        let z = match random.below(4) {
            0 => slot + reach,
            1 => slot - reach,
            2 => (slot + other) / 2 + random.below(2),
            _ => slot,
        };
        z.clamp(format.min(), format.max())
    }

    fn cover_match(&mut self, held: &[Slot], z: i64, threshold: i64) {
        let mut distances: Vec<i64> = held
            .iter()
            .filter(|slot| !slot.shaded)
            .map(|slot| (slot.depth - z).abs())
            .collect();
        let meet = &mut self.seen.coverage;
        for distance in &distances {
            for (by, name) in [
                (-1, "depth one within ε"),
                (0, "depth at ε"),
                (1, "depth one beyond ε"),
            ] {
                meet.count_if(*distance == threshold + by, "fragment", name);
            }
        }
        distances.retain(|distance| *distance < threshold);
        distances.sort_unstable();
        meet.count_if(distances.len() > 1, "fragment", "several within ε");
        meet.count_if(
            distances.len() > 1 && distances[0] == distances[1],
            "fragment",
            "several within ε, equally near",
        );
        meet.count_if(
            held.iter()
                .any(|slot| slot.shaded && (slot.depth - z).abs() < threshold),
            "fragment",
            "a shaded one within ε",
        );
        meet.count_if(
            held.iter().any(|slot| slot.depth == z),
            "fragment",
            "equal depths",
        );
    }

    fn end_of_pixel(&mut self, unit: &Fragments, at: [i64; 2]) {
        let slots = unit.held(at[1] as usize * TILE_PX + at[0] as usize);
        let mut order: Vec<usize> = (0..slots.len()).collect();
        order.sort_by_key(|&slot| slots[slot].depth);
        for number in order {
            let slot = &slots[number];
            let mut words = vec![
                at[0],
                at[1],
                number as i64,
                slot.shaded.into(),
                slot.depth,
                slot.material.into(),
            ];
            words.extend(slot.sums);
            let lit = if slot.shaded {
                unit.lit(slot, &mut self.seen)
            } else {
                Premultiplied::default()
            };
            // Records of held fragments have no flags, as in a scene's trace.
            self.seen.flush();
            words.extend(lit.colour);
            words.push(lit.opacity);
            self.push(
                "fragment.held",
                words,
                Key {
                    slot: number as u32,
                    ..pixel_key(at, UNKNOWN)
                },
            );
        }
    }

    fn shade(&mut self) {
        let by_pixel = self.requests_have_pixel();
        let formats = self
            .formats("shade.in")
            .split_off(if by_pixel { 2 } else { 0 });
        let threshold = self.frame.coverage_threshold;
        let mut kinds = self.words(&formats[..8]);
        let mut at_threshold = kinds.remove(0).1;
        for (i, words) in (0..).zip(&mut at_threshold) {
            let powers = 1i64 << self.random.below(formats[0].magnitude_bits().into());
            let weights = [
                threshold - 1,
                threshold,
                threshold + 1,
                powers,
                powers - 1,
                powers + 1,
                words[0],
            ];
            words[0] = weights[i % weights.len()].clamp(0, formats[0].max());
        }
        kinds.push(("thresholds and powers of two".into(), at_threshold));
        // Consistent sums: no colour is brighter than its weight, and normals are no longer.
        let mut likely = self.words(&formats[..8]).pop().unwrap_or_default().1;
        for words in &mut likely {
            for field in 1..5 {
                let by = formats[field].frac_bits - formats[0].frac_bits;
                let limit = if by >= 0 {
                    words[0] << by
                } else {
                    words[0] >> -by
                };
                words[field] =
                    words[field].rem_euclid(limit.clamp(0, (formats[field].max() - 1).max(0)) + 1);
            }
        }
        kinds.push(("likely sums".into(), likely));
        let mut first = 0;
        for (kind, records) in kinds {
            for words in records {
                let mut words: Vec<i64> = words
                    .iter()
                    .zip(&formats)
                    .map(|(word, format)| format.representable(*word))
                    .collect();
                let material = self
                    .random
                    .below(self.frame.lighting.materials.len() as i64);
                words.push(material);
                let size = [self.frame.width, self.frame.height].map(i64::from);
                let pixel = if by_pixel {
                    size.map(|size| self.random.below(size))
                } else {
                    [0; 2]
                };
                let place = if by_pixel { &pixel[..] } else { &[] };
                let parent = self.push("shade.in", [place, &words].concat(), key(UNKNOWN));
                let input = shade::Input {
                    weight: words[0],
                    colour: [words[1], words[2], words[3]],
                    opacity: words[4],
                    normal: [words[5], words[6], words[7]],
                    material: material as u32,
                    pixel,
                };
                let output = unit_replay::shade(self.machine, self.frame, &input, &mut self.seen);
                let weight = match words[0] {
                    0 => "weight 0",
                    weight if weight < threshold => "weight below τ",
                    weight if weight == threshold => "weight at τ",
                    _ => "weight above τ",
                };
                self.seen.coverage.count("shade", weight);
                self.seen
                    .coverage
                    .count_if(words[5..8] == [0, 0, 0], "shade", "normals cancel");
                let [r, g, b] = output.colour;
                let flags = self.seen.flush();
                self.push(
                    "shade.out",
                    vec![r, g, b, output.opacity],
                    Key {
                        flags,
                        ..key(parent)
                    },
                );
            }
            first = self.tag("shade.in", &kind, first);
        }
    }

    fn resolve(&mut self) {
        let layers_at_most = i64::from(self.machine.machine.fragment.layers);
        let (width, height) = (i64::from(self.frame.width), i64::from(self.frame.height));
        for case in 0..self.cases as i64 {
            let at = [case % width, case / width % height];
            let count = self.random.below(layers_at_most + 1);
            let layers: Vec<Layer> = (0..count)
                .map(|_| {
                    let Premultiplied { colour, opacity } = answer(&mut self.random, self.machine);
                    // Units do not make more than 1, but the word can hold it.
                    let opacity = if self.random.one_in(8) {
                        self.random
                            .word(self.machine.machine.shade.premultiplied.format)
                    } else {
                        opacity
                    };
                    Layer {
                        colour,
                        opacity,
                        ..Layer::default()
                    }
                })
                .collect();
            let mut first = None;
            for (i, layer) in layers.iter().enumerate() {
                let [r, g, b] = layer.colour;
                let words = vec![
                    at[0],
                    at[1],
                    i64::from(i + 1 == layers.len()),
                    0,
                    r,
                    g,
                    b,
                    layer.opacity,
                ];
                let record = self.push("resolve.in", words, pixel_key(at, UNKNOWN));
                first = first.or(Some(record));
            }
            if layers.is_empty() {
                first = Some(self.push(
                    "resolve.in",
                    vec![at[0], at[1], 1, 1, 0, 0, 0, 0],
                    pixel_key(at, UNKNOWN),
                ));
            }
            let word = unit_replay::resolve(self.machine, self.frame, &layers, &mut self.seen);
            self.seen
                .coverage
                .count("resolve", &format!("{count} layers"));
            let flags = self.seen.flush();
            self.push(
                "resolve.out",
                [&at[..], &word[..]].concat(),
                Key {
                    flags,
                    ..pixel_key(at, first.unwrap_or(UNKNOWN))
                },
            );
        }
        self.tag("resolve.in", "random layers", 0);
    }
}

/// Light of a fragment: opaque, at the opacity limit and one LSB from it, transparent, a power of
/// two from 1 (two of them make ties), or anything; colours are at most 1.
fn answer(random: &mut Random, machine: &Elaborated) -> Premultiplied {
    let m = &machine.machine;
    let (format, limit) = (m.shade.premultiplied.format, m.fragment.opaque_permille);
    let at_limit = format.one() * i64::from(limit) / 1000;
    let opacity = match random.below(8) {
        0 => format.one(),
        1 => at_limit + random.below(3) - 1,
        2 => 0,
        3 | 4 => format.one() - (1 << random.below(i64::from(format.frac_bits) + 1)),
        _ => random.below(format.one() + 1),
    };
    let colour = [(); 3].map(|()| random.word(format).min(format.one()));
    Premultiplied {
        colour: colour.map(|channel| format.representable(channel)),
        opacity: format.representable(opacity.clamp(0, format.one())),
    }
}
