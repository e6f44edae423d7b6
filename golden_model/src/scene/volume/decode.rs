//! Decode: converts the bytes of a file to `f32` samples, finite or NaN, and the words of a header
//! to numbers.

pub(super) use crate::scene::ply::clip;
use flate2::bufread::{GzDecoder, ZlibDecoder};
use std::io::{self, Read};
use std::path::Path;
use std::str::FromStr;

pub(super) type Parsed<T> = Result<T, String>;

/// Type of a sample in a file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SampleType {
    /// 8-bit unsigned integer.
    U8,
    /// 8-bit signed integer.
    I8,
    /// 16-bit unsigned integer.
    U16,
    /// 16-bit signed integer.
    I16,
    /// 32-bit unsigned integer.
    U32,
    /// 32-bit signed integer.
    I32,
    /// 64-bit unsigned integer; not for plain samples.
    #[serde(skip)]
    U64,
    /// 64-bit signed integer; not for plain samples.
    #[serde(skip)]
    I64,
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
}

impl SampleType {
    pub(super) fn bytes(self) -> usize {
        match self {
            SampleType::U8 | SampleType::I8 => 1,
            SampleType::U16 | SampleType::I16 => 2,
            SampleType::U32 | SampleType::I32 | SampleType::F32 => 4,
            SampleType::U64 | SampleType::I64 | SampleType::F64 => 8,
        }
    }
}

/// Order of the bytes of a number in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Lowest byte first.
    #[default]
    Little,
    /// Highest byte first.
    Big,
}

// ---- samples ----

/// Most samples of a volume: with their splats, more would not fit into the memory of supported
/// computers.
const MOST_SAMPLES: usize = 1 << 31;

/// Number of samples, and their encoding.
pub(super) struct SampleLayout {
    pub size: [usize; 3],
    sample_type: SampleType,
    order: ByteOrder,
    count: usize,
}

/// The samples of a layout as numbers of this float type.
macro_rules! decoded {
    ($layout:expr, $samples:expr, $real:ty) => {{
        let samples: &[u8] = $samples;
        macro_rules! decode {
            ($type:ty) => {{
                let (words, _) = samples.as_chunks::<{ size_of::<$type>() }>();
                match $layout.order {
                    ByteOrder::Little => words
                        .iter()
                        .map(|&word| <$type>::from_le_bytes(word) as $real)
                        .collect::<Vec<$real>>(),
                    ByteOrder::Big => words
                        .iter()
                        .map(|&word| <$type>::from_be_bytes(word) as $real)
                        .collect(),
                }
            }};
        }
        match $layout.sample_type {
            SampleType::U8 => decode!(u8),
            SampleType::I8 => decode!(i8),
            SampleType::U16 => decode!(u16),
            SampleType::I16 => decode!(i16),
            SampleType::U32 => decode!(u32),
            SampleType::I32 => decode!(i32),
            SampleType::U64 => decode!(u64),
            SampleType::I64 => decode!(i64),
            SampleType::F32 => decode!(f32),
            SampleType::F64 => decode!(f64),
        }
    }};
}

impl SampleLayout {
    /// Checks the size, which is in `field`.
    pub fn new(
        size: [usize; 3],
        sample_type: SampleType,
        order: ByteOrder,
        field: &str,
    ) -> Parsed<SampleLayout> {
        let written = || size.map(|n| n.to_string()).join(" × ");
        if size.contains(&0) {
            return Err(format!(
                "`{field}` is {}; there must be at least one sample along each axis",
                written()
            ));
        }
        let count = size[0]
            .checked_mul(size[1])
            .and_then(|n| n.checked_mul(size[2]))
            .filter(|n| *n <= MOST_SAMPLES);
        let count = count.ok_or_else(|| {
            format!(
                "`{field}` is {}; at most {MOST_SAMPLES} samples are read",
                written()
            )
        })?;
        Ok(SampleLayout {
            size,
            sample_type,
            order,
            count,
        })
    }

    /// Bytes of the samples, at most 2³⁴.
    pub fn bytes(&self) -> usize {
        self.count.saturating_mul(self.sample_type.bytes())
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Peak bytes per packed sample while it is read: unpacked into growing memory, decoded, and
    /// reordered.
    pub fn unpacked_bytes(&self) -> u64 {
        2 * self.sample_type.bytes() as u64 + 16
    }

    /// Decodes the first samples of `bytes`; trailing bytes are ignored.
    pub fn values(&self, bytes: &[u8]) -> Parsed<Vec<f32>> {
        self.known(decoded!(self, self.samples(bytes)?, f32))
    }

    /// [`SampleLayout::values`] in the file's precision: for positions.
    pub fn reals(&self, bytes: &[u8]) -> Parsed<Vec<f64>> {
        self.finite(decoded!(self, self.samples(bytes)?, f64))
    }

    /// The bytes of the samples.
    fn samples<'a>(&self, bytes: &'a [u8]) -> Parsed<&'a [u8]> {
        bytes.get(..self.bytes()).ok_or_else(|| {
            let [x, y, z] = self.size;
            let (each, all) = (self.sample_type.bytes(), self.bytes());
            format!("there are {} bytes of samples, but {x} × {y} × {z} samples of {each} bytes take {all}", bytes.len())
        })
    }

    /// Reads the first samples of a text of numbers separated by white space; the rest is ignored.
    pub fn text_values(&self, text: &[u8]) -> Parsed<Vec<f32>> {
        self.known(
            self.text_reals(text)?
                .into_iter()
                .map(|n| n as f32)
                .collect(),
        )
    }

    /// Refuses a text of more numbers than samples.
    pub fn ends(&self, text: &[u8]) -> Parsed<()> {
        match text
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty())
            .nth(self.count)
        {
            None => Ok(()),
            Some(_) => {
                let [x, y, z] = self.size;
                Err(format!(
                    "there are more numbers than the {} of {x} × {y} × {z} samples",
                    self.count
                ))
            }
        }
    }

    /// [`SampleLayout::text_values`] in f64 precision; values need not be finite.
    pub fn text_reals(&self, text: &[u8]) -> Parsed<Vec<f64>> {
        let words = text
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty())
            .take(self.count);
        let number = |(i, word): (usize, &[u8])| {
            let number = str::from_utf8(word)
                .ok()
                .and_then(|word| word.parse::<f64>().ok());
            number.ok_or_else(|| {
                format!(
                    "sample {}: `{}` is not a number",
                    self.place(i),
                    clip(&String::from_utf8_lossy(word))
                )
            })
        };
        let values: Vec<f64> = words.enumerate().map(number).collect::<Parsed<_>>()?;
        if values.len() < self.count {
            let [x, y, z] = self.size;
            return Err(format!(
                "there are {} numbers, but {x} × {y} × {z} samples are {}",
                values.len(),
                self.count
            ));
        }
        Ok(values)
    }

    /// Returns the places if all are finite.
    pub fn finite(&self, places: Vec<f64>) -> Parsed<Vec<f64>> {
        match places.iter().position(|place| !place.is_finite()) {
            None => Ok(places),
            Some(i) => Err(format!(
                "sample {} is {}; all samples must be finite 64-bit floats",
                self.place(i),
                places[i]
            )),
        }
    }

    /// Returns the values if none is infinite; NaN stands for a missing sample.
    pub fn known(&self, values: Vec<f32>) -> Parsed<Vec<f32>> {
        match values.iter().position(|value| value.is_infinite()) {
            None => Ok(values),
            Some(i) => Err(format!(
                "sample {} is {}; all samples must be finite 32-bit floats, or NaN where there is none",
                self.place(i),
                values[i]
            )),
        }
    }

    /// Index of a sample for messages: (x, y, z) from zero.
    fn place(&self, i: usize) -> String {
        let [x, y, _] = self.size;
        format!("({}, {}, {})", i % x, i / x % y, i / x / y)
    }
}

// ---- packed bytes ----

/// The members of a gzip file in sequence; trailing bytes are ignored.
struct Members<'a>(GzDecoder<&'a [u8]>);

impl Read for Members<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let length = self.0.read(buffer)?;
            let rest = *self.0.get_ref();
            if length > 0 || buffer.is_empty() || !is_gzip(rest) {
                return Ok(length);
            }
            self.0 = GzDecoder::new(rest);
        }
    }
}

pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Unpacks gzip or zlib data as it is read.
pub(super) fn unpacker<'a>(packed: &'a [u8]) -> Box<dyn Read + 'a> {
    if is_gzip(packed) {
        Box::new(Members(GzDecoder::new(packed)))
    } else {
        Box::new(ZlibDecoder::new(packed))
    }
}

/// Skips the next bytes, or as many as there are, and returns their number.
pub(super) fn pass_over(source: &mut dyn Read, most: u64) -> Parsed<u64> {
    io::copy(&mut source.take(most), &mut io::sink()).map_err(broken)
}

/// The next bytes, or as many as there are.
pub(super) fn take(source: &mut dyn Read, most: usize) -> Parsed<Vec<u8>> {
    let mut bytes = Vec::new();
    source
        .take(most as u64)
        .read_to_end(&mut bytes)
        .map_err(broken)?;
    Ok(bytes)
}

/// All remaining bytes, which must not be more than `most`.
pub(super) fn take_all(source: &mut dyn Read, most: usize) -> Parsed<Vec<u8>> {
    let bytes = take(source, most.saturating_add(1))?;
    if bytes.len() > most {
        return Err(format!(
            "the compressed samples unpack to more than the {most} bytes that size and type require"
        ));
    }
    Ok(bytes)
}

fn broken(error: io::Error) -> String {
    format!("the compressed data is broken or ends early ({error})")
}

// ---- files ----

/// All bytes of a file.
pub(super) fn read_file(path: &Path) -> Parsed<Vec<u8>> {
    crate::input::read(path).map_err(|e| format!("cannot be read ({e})"))
}

/// All bytes of the file that `field` of a header in `folder` names.
pub(super) fn read_beside(folder: &Path, name: &str, field: &str) -> Parsed<Vec<u8>> {
    if name.is_empty() || Path::new(name).has_root() {
        return Err(format!(
            "`{field}` is `{}`; it must be a path relative to the folder of the header",
            clip(name)
        ));
    }
    read_file(&folder.join(name)).map_err(|e| format!("the data file `{}` {e}", clip(name)))
}

/// Adds the name of the second file, in which the error is.
pub(super) fn in_data_file(name: &str, sentence: String) -> String {
    format!("data file `{}`: {sentence}", clip(name))
}

// ---- headers ----

/// Removes and returns the next line, without its end; `None` at the end.
pub(super) fn next_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    if rest.is_empty() {
        return None;
    }
    let length = rest
        .iter()
        .position(|&byte| byte == b'\n')
        .unwrap_or(rest.len());
    let line = &rest[..length];
    *rest = rest.get(length + 1..).unwrap_or_default();
    Some(line.strip_suffix(b"\r").unwrap_or(line))
}

/// The relevant fields of a text header, with their values.
pub(super) struct Fields(Vec<(&'static str, String)>);

impl Fields {
    pub fn new() -> Self {
        Fields(Vec::new())
    }

    /// Adds a field, which must be new.
    pub fn add(&mut self, name: &'static str, value: String) -> Parsed<()> {
        if self.get(name).is_some() {
            return Err(format!("`{name}` is there twice"));
        }
        self.0.push((name, value));
        Ok(())
    }

    pub fn get(&self, name: &str) -> Option<&str> {
        self.0
            .iter()
            .find(|(field, _)| *field == name)
            .map(|(_, value)| value.as_str())
    }

    pub fn need(&self, name: &str) -> Parsed<&str> {
        self.get(name)
            .ok_or_else(|| format!("there is no `{name}` in the header"))
    }

    /// The first of the names that exists: a field may have several names.
    pub fn first_of(&self, names: &[&'static str]) -> Option<(&'static str, &str)> {
        names.iter().find_map(|name| Some((*name, self.get(name)?)))
    }
}

/// One number, from the text of `field`.
pub(super) fn number<T: FromStr>(text: &str, field: &str, kind: &str) -> Parsed<T> {
    text.trim()
        .parse()
        .map_err(|_| format!("`{field}` is `{}`; it must be {kind}", clip(text)))
}

/// Numbers with white space between them.
pub(super) fn numbers<T: FromStr>(text: &str, count: usize, field: &str) -> Parsed<Vec<T>> {
    let parsed: Option<Vec<T>> = text
        .split_ascii_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    parsed
        .filter(|numbers| numbers.len() == count)
        .ok_or_else(|| {
            let kind = if std::any::type_name::<T>() == "f64" {
                "numbers"
            } else {
                "whole numbers"
            };
            format!(
                "`{field}` is `{}`; it must be {count} {kind} with white space between them",
                clip(text)
            )
        })
}

/// Three numbers with white space between them.
pub(super) fn triple<T: FromStr + Copy>(text: &str, field: &str) -> Parsed<[T; 3]> {
    let numbers = numbers(text, 3, field)?;
    Ok([numbers[0], numbers[1], numbers[2]])
}

// ---- grid ----

/// Axes along x, y and z.
pub(super) fn diagonal([x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
    [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]
}

/// Refuses a negative spacing in formats with another way to mirror an axis.
pub(super) fn positive(spacing: [f64; 3], field: &str) -> Parsed<()> {
    match spacing
        .iter()
        .find(|step| !(**step > 0.0 && step.is_finite()))
    {
        None => Ok(()),
        Some(step) => Err(format!(
            "`{field}` has a step of {step}; each must be finite and above zero"
        )),
    }
}

/// Steps and positions beyond this (or below its inverse) are invalid; squares and products of
/// others are finite.
pub(super) const FARTHEST: f64 = 1e30;

pub(super) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Least volume of a cell, as a part of that of a box with the same edges: in thinner cells,
/// kernels would be discs.
const FLATTEST_CELL: f64 = 1e-6;

/// Checks that the axes have a valid length and span space. They may be sheared.
pub(super) fn check_grid(
    axes: &[[f64; 3]; 3],
    axes_field: &str,
    origin: &[f64; 3],
    origin_field: &str,
) -> Parsed<()> {
    let lengths = axes.each_ref().map(|axis| dot(axis, axis).sqrt());
    for length in lengths {
        if !(FARTHEST.recip()..=FARTHEST).contains(&length) {
            return Err(format!(
                "`{axes_field}` has a step of length {length}; each must be finite and not zero"
            ));
        }
    }
    let [a, b, c] = [0, 1, 2].map(|i| axes[i].map(|part| part / lengths[i]));
    let across =
        [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
    if dot(&across, &c).abs() < FLATTEST_CELL {
        return Err(format!(
            "the axes of `{axes_field}` lie in a plane; they must span space"
        ));
    }
    match origin.iter().find(|x| x.is_nan() || x.abs() > FARTHEST) {
        None => Ok(()),
        Some(x) => Err(format!(
            "`{origin_field}` holds {x}; a position must be finite"
        )),
    }
}
