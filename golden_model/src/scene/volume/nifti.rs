//! Nifti: reads a volume from a single NIfTI-1 file, gzipped or not, in either byte order
//! (nifti.nimh.nih.gov, `nifti1.h`).
//!
//! Axes are those of the sform if it is set, else of the qform. If one is invalid the next is used;
//! the last is the bare `pixdim`, which has no orientation. A note reports what was left out. Units
//! are not converted. Samples are scaled by `scl_slope` and `scl_inter`.

use super::decode::{
    Parsed, SampleLayout, check_grid, diagonal, dot, is_gzip, pass_over, positive, take, unpacker,
};
use super::world::unoriented;
use super::{ByteOrder, SampleType, Volume};
use std::io::Read;

const HEADER_BYTES: usize = 348;

/// Least offset of samples: after the header and four bytes for extensions.
const FIRST_OFFSET: f32 = 352.0;

/// Offsets below this are exact in f32.
const LAST_OFFSET: f32 = 16_777_216.0;

const TYPES: [(SampleType, i16); 10] = [
    (SampleType::U8, 2),
    (SampleType::I16, 4),
    (SampleType::I32, 8),
    (SampleType::F32, 16),
    (SampleType::F64, 64),
    (SampleType::I8, 256),
    (SampleType::U16, 512),
    (SampleType::U32, 768),
    (SampleType::I64, 1024),
    (SampleType::U64, 1280),
];

/// Axes and origin.
type Grid = ([[f64; 3]; 3], [f64; 3]);

pub(in crate::scene) fn read(bytes: &[u8]) -> Parsed<Volume> {
    let mut source: Box<dyn Read> = if is_gzip(bytes) {
        unpacker(bytes)
    } else {
        Box::new(bytes)
    };
    let header = Header::new(take(&mut source, HEADER_BYTES)?)?;
    let layout = header.layout()?;
    let ((axes, origin), notes) = header.grid()?;
    let offset = header.offset()?;
    let skip = offset - HEADER_BYTES as u64;
    if pass_over(&mut source, skip)? < skip {
        return Err(format!(
            "`vox_offset` is {offset}, but the file ends before"
        ));
    }
    let values = layout.values(&take(&mut source, layout.bytes())?)?;
    Ok(Volume {
        size: layout.size,
        axes,
        origin,
        values: header.scaled(values, &layout)?,
        notes,
    })
}

struct Header {
    bytes: [u8; HEADER_BYTES],
    order: ByteOrder,
}

impl Header {
    fn new(bytes: Vec<u8>) -> Parsed<Header> {
        let bytes: [u8; HEADER_BYTES] = bytes.try_into().map_err(|short: Vec<u8>| {
            format!(
                "ends inside its header, which has {HEADER_BYTES} bytes, not {}",
                short.len()
            )
        })?;
        let mut header = Header {
            bytes,
            order: ByteOrder::Little,
        };
        if header.i32(0) != HEADER_BYTES as i32 {
            header.order = ByteOrder::Big;
        }
        match (header.i32(0), &bytes[344..]) {
            (348, b"n+1\0") => Ok(header),
            (348, b"ni1\0") => Err(
                "is half of a pair of .hdr and .img; a NIfTI-1 volume must be a single file".into(),
            ),
            (348, _) => Err("is an Analyze file by its `magic`; NIfTI-1 (`n+1`) is read".into()),
            _ if i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) == 540
                || header.i32(0) == 540 =>
            {
                Err("is a NIfTI-2 file by its `sizeof_hdr`; NIfTI-1 is read".into())
            }
            _ => Err("is not a NIfTI-1 file: `sizeof_hdr` is not 348 in either byte order".into()),
        }
    }

    fn word<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut word: [u8; N] = std::array::from_fn(|i| self.bytes[at + i]);
        if self.order == ByteOrder::Big {
            word.reverse();
        }
        word
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.word(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.word(at))
    }

    fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.word(at))
    }

    /// Three floats in a row.
    fn triple(&self, at: usize) -> [f64; 3] {
        [0, 4, 8].map(|i| self.f32(at + i).into())
    }

    fn layout(&self) -> Parsed<SampleLayout> {
        let dim: [i16; 8] = std::array::from_fn(|i| self.i16(40 + 2 * i));
        if !(3..=7).contains(&dim[0]) {
            return Err(format!(
                "`dim[0]` is {}; a volume has 3 axes (up to 7, where the others are of length 1)",
                dim[0]
            ));
        }
        if let Some(i) = (4..=dim[0] as usize).find(|i| dim[*i] != 1) {
            return Err(format!(
                "`dim[{i}]` is {}; axes beyond the third must be of length 1",
                dim[i]
            ));
        }
        if let Some(i) = (1..=3).find(|i| dim[*i] < 1) {
            return Err(format!(
                "`dim[{i}]` is {}; there must be at least one sample along each axis",
                dim[i]
            ));
        }
        let code = self.i16(70);
        let sample_type = TYPES
            .iter()
            .find(|(_, known)| *known == code)
            .map(|(sample_type, _)| *sample_type);
        let known = || TYPES.map(|(_, code)| code.to_string()).join(", ");
        let sample_type = sample_type
            .ok_or_else(|| format!("`datatype` is {code}; {} (integers of 8 to 64 bits, 32-bit and 64-bit floats) are read", known()))?;
        SampleLayout::new(
            [1, 2, 3].map(|i| dim[i] as usize),
            sample_type,
            self.order,
            "dim",
        )
    }

    /// Offset of the samples.
    fn offset(&self) -> Parsed<u64> {
        let offset = self.f32(108);
        match offset {
            0.0 => Ok(FIRST_OFFSET as u64),
            FIRST_OFFSET..=LAST_OFFSET if offset.fract() == 0.0 => Ok(offset as u64),
            _ => Err(format!(
                "`vox_offset` is {offset}; it must be a whole number from {FIRST_OFFSET} to {LAST_OFFSET}"
            )),
        }
    }

    /// Axes and origin, and notes on what was left out.
    fn grid(&self) -> Parsed<(Grid, Vec<String>)> {
        let sound = |(axes, origin): &Grid| check_grid(axes, "", origin, "").is_ok();
        let (sform, qform) = (self.sform(), self.qform());
        let mut notes = Vec::new();
        if sform.is_some_and(|grid| !sound(&grid)) {
            notes.push("its sform is set, and its axes do not span space: it is left out".into());
        }
        if qform.is_some_and(|grid| !sound(&grid)) || (qform.is_none() && self.i16(252) > 0) {
            notes.push("its qform is set, and it has no sound grid: it is left out".into());
        }
        let grid = match (sform.filter(sound), qform.filter(sound)) {
            (Some(sform), Some(qform)) => {
                if self.differ(&sform, &qform) {
                    notes.push("its sform and its qform put samples at different places: the sform is drawn".into());
                }
                sform
            }
            (Some(grid), None) | (None, Some(grid)) => grid,
            (None, None) => {
                let pixdim = self.triple(80);
                positive(pixdim, "pixdim")?;
                let grid = (diagonal(pixdim), [0.0; 3]);
                check_grid(&grid.0, "pixdim", &grid.1, "")?;
                notes.push(unoriented("has neither sform nor qform"));
                grid
            }
        };
        Ok((grid, notes))
    }

    /// Whether the first or last corner of two grids differs by half a shortest step.
    fn differ(&self, one: &Grid, other: &Grid) -> bool {
        let last = [0, 1, 2].map(|i| f64::from(self.i16(42 + 2 * i)) - 1.0);
        let shortest = one
            .0
            .iter()
            .map(|axis| dot(axis, axis))
            .fold(f64::INFINITY, f64::min);
        let corners = (0..8).map(|corner| {
            [0, 1, 2].map(|axis| {
                if corner >> axis & 1 == 1 {
                    last[axis]
                } else {
                    0.0
                }
            })
        });
        let place = |(axes, origin): &Grid, at: [f64; 3]| {
            [0, 1, 2].map(|i| origin[i] + (0..3).map(|axis| axes[axis][i] * at[axis]).sum::<f64>())
        };
        corners.into_iter().any(|at| {
            let (here, there) = (place(one, at), place(other, at));
            let way = [0, 1, 2].map(|i| here[i] - there[i]);
            dot(&way, &way) > shortest / 4.0
        })
    }

    fn sform(&self) -> Option<Grid> {
        let column = |i: usize| [280, 296, 312].map(|row| f64::from(self.f32(row + 4 * i)));
        (self.i16(254) > 0).then(|| ([0, 1, 2].map(column), column(3)))
    }

    fn qform(&self) -> Option<Grid> {
        let [b, c, d] = self.triple(256);
        let squares = b * b + c * c + d * d;
        // Rotation by half a turn: rounding may make the sum of squares slightly more than 1.
        let by = if squares > 1.0 {
            squares.sqrt().recip()
        } else {
            1.0
        };
        let ([b, c, d], a) = (
            [b, c, d].map(|part| part * by),
            (1.0 - squares).max(0.0).sqrt(),
        );
        let directions = [
            [
                a * a + b * b - c * c - d * d,
                2.0 * (b * c + a * d),
                2.0 * (b * d - a * c),
            ],
            [
                2.0 * (b * c - a * d),
                a * a + c * c - b * b - d * d,
                2.0 * (c * d + a * b),
            ],
            [
                2.0 * (b * d + a * c),
                2.0 * (c * d - a * b),
                a * a + d * d - b * b - c * c,
            ],
        ];
        let [x, y, z] = self.triple(80);
        let steps = [x, y, if self.f32(76) < 0.0 { -z } else { z }];
        let set = self.i16(252) > 0 && positive([x, y, z], "pixdim").is_ok();
        set.then(|| {
            (
                [0, 1, 2].map(|i| directions[i].map(|component| component * steps[i])),
                self.triple(268),
            )
        })
    }

    /// Applies the scale of the header; a slope of zero means no scale.
    fn scaled(&self, mut values: Vec<f32>, layout: &SampleLayout) -> Parsed<Vec<f32>> {
        let (slope, inter) = (f64::from(self.f32(112)), f64::from(self.f32(116)));
        if slope == 0.0 || !slope.is_finite() {
            return Ok(values);
        }
        if !inter.is_finite() {
            return Err(format!("`scl_inter` is {inter}; it must be finite"));
        }
        for value in &mut values {
            *value = (f64::from(*value) * slope + inter) as f32;
        }
        layout.known(values)
    }
}
