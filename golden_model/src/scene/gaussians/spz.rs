//! Spz: reads Gaussians from Niantic's `.spz` files. Versions 1 to 3: gzip, with a header of 16
//! bytes and one table after another. Version 4: a header of 32 bytes, then the sizes of the
//! tables, then the tables, each packed by Zstandard.
//! ```text
//! magic `NGSP`: u32   version: u32   Gaussians: u32   degree: u8   fractional bits: u8   flags: u8   reserved: u8
//! positions    3 × 24 bits, fixed point (version 1: 3 × f16)
//! opacities    u8 of 255
//! colours      3 × u8: the constant coefficients in ±0.5/0.15
//! scales       3 × u8: logarithms, 16 steps for 1, from −10
//! rotations    from version 3 on: 4 bytes, the three smallest of x y z w; before: 3 bytes, x y z in ±1
//! harmonics    3 × u8 for each other coefficient, 128 is 0, 128 steps for 1
//!
//! version 4    the header's last byte is the number of tables, then where their sizes begin: u32   reserved: 12 bytes
//! sizes        bytes packed: u64   bytes unpacked: u64   of each table; a table without bytes is left out
//! ```
//! All numbers are little-endian. Uncompressed files are read too. Axes are right, up, back; in
//! files of training programs they are right, down, forward. Everything is rotated by half a turn
//! about x, so that a scene looks the same from both.

use super::{Gaussian, Gaussians, Intake, Parsed, coefficients, exp, part};
use flate2::read::GzDecoder;
use glam::{DQuat, DVec3};
use ruzstd::decoding::StreamingDecoder;
use std::f64::consts::FRAC_1_SQRT_2;
use std::io::Read;

const ANTIALIASED: u8 = 1;
/// Version 4: there is data between the header and the sizes of the tables.
const EXTENDED: u8 = 2;
/// The version whose tables are packed separately.
const STREAMED: u32 = 4;
/// Bytes of that version's header, and of the two sizes of a table.
const HEADER_OF_TABLES: usize = 32;
const SIZES: usize = 16;

/// Files that expand by more than this, and past [`LONGEST`], are considered malicious: positions
/// and rotations of a trained scene hardly compress and are at least a fifth of its bytes. The
/// limit of gzip itself is 1032.
const MOST_COMPRESSED: u64 = 100;

/// Bytes that are accepted for a file of any size.
const LONGEST: u64 = 1 << 26;

/// Fields of a header; they determine the row length of each table.
struct SpzHeader {
    version: u32,
    count: u64,
    degree: usize,
    fractional_bits: u8,
    flags: u8,
}

pub(in crate::scene) fn parse(bytes: &[u8]) -> Parsed<Gaussians> {
    let is_gzip = bytes.starts_with(&[0x1f, 0x8b]);
    let most = LONGEST.max(MOST_COMPRESSED.saturating_mul(bytes.len() as u64));
    if is_gzip {
        return unpack(GzDecoder::new(bytes), most);
    }
    if bytes.starts_with(&[b"NGSP".as_slice(), &STREAMED.to_le_bytes()].concat()) {
        unpack_tables(bytes, most)
    } else {
        unpack(bytes, most)
    }
}

/// Reads unpacked data; refuses more bytes than `most`.
fn unpack(mut stream: impl Read, most: u64) -> Parsed<Gaussians> {
    let header = SpzHeader::read(&mut stream)?;
    let length = header.length(most)?;
    // Grows with the data, not with the header's numbers.
    let mut body = Vec::new();
    stream
        .by_ref()
        .take(length)
        .read_to_end(&mut body)
        .map_err(damaged)?;
    if (body.len() as u64) < length {
        return Err(format!(
            "ends after {} of the {length} bytes that its {} Gaussians take",
            body.len(),
            header.count
        ));
    }
    let surplus = std::io::copy(&mut stream, &mut std::io::sink()).map_err(damaged)?;
    let count = header.count as usize;
    let mut rest = body.as_slice();
    let tables = header.row_bytes().map(|row| {
        let (table, after) = rest.split_at(count * row);
        rest = after;
        table
    });
    gaussians(&header, tables, surplus)
}

/// Reads a file of version 4, whose tables are packed separately; refuses more bytes than `most`.
fn unpack_tables(bytes: &[u8], most: u64) -> Parsed<Gaussians> {
    let header = SpzHeader::read(&mut &bytes[..])?;
    header.length(most)?;
    let cut = || {
        format!(
            "has {} bytes, and its header and the sizes of its tables take more",
            bytes.len()
        )
    };
    let number = |at: usize| {
        bytes
            .get(at..)?
            .first_chunk()
            .map(|word| u64::from_le_bytes(*word))
    };
    let &[tables, s0, s1, s2, s3] = bytes
        .get(15..20)
        .and_then(<[u8]>::first_chunk)
        .ok_or_else(cut)?;
    let expected = header.row_bytes().map(|row| header.count * row as u64);
    let present = expected.iter().filter(|length| **length > 0).count();
    if usize::from(tables) != present {
        return Err(format!(
            "has {tables} tables; {} Gaussians of degree {} have {present}",
            header.count, header.degree
        ));
    }
    let sizes = u32::from_le_bytes([s0, s1, s2, s3]) as usize;
    let mut next = sizes
        .checked_add(SIZES * present)
        .filter(|end| sizes >= HEADER_OF_TABLES && *end <= bytes.len())
        .ok_or_else(cut)?;
    let mut unpacked = [const { Vec::new() }; 6];
    let mut row = sizes;
    for (table, &length) in unpacked
        .iter_mut()
        .zip(&expected)
        .filter(|(_, length)| **length > 0)
    {
        let (packed, promised) = number(row).zip(number(row + 8)).ok_or_else(cut)?;
        row += SIZES;
        if promised != length {
            return Err(format!(
                "has a table of {promised} bytes, and its {} Gaussians take {length}",
                header.count
            ));
        }
        let end = usize::try_from(packed)
            .ok()
            .and_then(|packed| next.checked_add(packed))
            .filter(|end| *end <= bytes.len());
        let end = end.ok_or_else(|| {
            format!(
                "has a table of {packed} packed bytes, and {} are left of the file",
                bytes.len() - next
            )
        })?;
        let bad = |e: String| format!("cannot be uncompressed, it is truncated or damaged: {e}");
        let decoder = StreamingDecoder::new(&bytes[next..end]).map_err(|e| bad(e.to_string()))?;
        // One byte more, to detect surplus data.
        decoder
            .take(length + 1)
            .read_to_end(table)
            .map_err(|e| bad(e.to_string()))?;
        if table.len() as u64 != length {
            return Err(bad(format!(
                "a table has {} bytes and should have {length}",
                table.len()
            )));
        }
        next = end;
    }
    gaussians(
        &header,
        unpacked.each_ref().map(Vec::as_slice),
        (bytes.len() - next) as u64,
    )
}

/// Gaussians from tables of the lengths in the header.
fn gaussians(header: &SpzHeader, tables: [&[u8]; 6], surplus: u64) -> Parsed<Gaussians> {
    let (count, row_bytes) = (header.count as usize, header.row_bytes());
    let mut notes = Vec::new();
    if header.version == STREAMED && header.flags & EXTENDED != 0 {
        notes.push("has extensions of its header, which are not read".to_owned());
    }
    if surplus > 0 {
        notes.push(format!(
            "has {surplus} bytes after its last Gaussian, which are not read"
        ));
    }
    let mut intake = Intake::new(header.degree, count, notes);
    for i in 0..count {
        let row = |table: usize| &tables[table][i * row_bytes[table]..][..row_bytes[table]];
        let raw = Gaussian {
            position: header.position(row(0)) * HALF_TURN,
            rotation: half_turned(rotation(row(4))),
            scale: exp(vector(row(3), |code| f64::from(code) / 16.0 - 10.0)),
            opacity: part(row(1)[0]),
        };
        let constant = vector(row(2), |code| (part(code) - 0.5) / 0.15)
            .to_array()
            .map(|c| c as f32);
        let others = row(5).as_chunks().0.iter().zip(HARMONICS_TURNED);
        let others = others.map(|(rgb, sign): (&[u8; 3], f32)| {
            rgb.map(|code| sign * (f32::from(code) / 128.0 - 1.0))
        });
        intake.push(raw, std::iter::once(constant).chain(others));
    }
    let compensated = header.flags & ANTIALIASED != 0;
    intake.finish().map(|gaussians| Gaussians {
        compensated,
        ..gaussians
    })
}

/// Half a turn about x.
const HALF_TURN: DVec3 = DVec3::new(1.0, -1.0, -1.0);

/// Signs of the harmonics, except the constant one, under half a turn about x: those odd in y and z
/// together change sign.
const HARMONICS_TURNED: [f32; 15] = [
    -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0,
];

/// The same rotation between rotated axes.
fn half_turned(of: DQuat) -> DQuat {
    DQuat::from_xyzw(of.x, -of.y, -of.z, of.w)
}

fn damaged(error: std::io::Error) -> String {
    format!("cannot be uncompressed, it is truncated or damaged: {error}")
}

impl SpzHeader {
    fn read(stream: &mut impl Read) -> Parsed<SpzHeader> {
        let mut bytes = Vec::new();
        stream.take(16).read_to_end(&mut bytes).map_err(damaged)?;
        let &[
            b'N',
            b'G',
            b'S',
            b'P',
            v0,
            v1,
            v2,
            v3,
            n0,
            n1,
            n2,
            n3,
            degree,
            fractional_bits,
            flags,
            _,
        ] = bytes.as_slice()
        else {
            return Err("is not an .spz file: it does not begin with the 16 bytes of a header of `NGSP`, under gzip or bare".into());
        };
        let version = u32::from_le_bytes([v0, v1, v2, v3]);
        if !(1..=STREAMED).contains(&version) {
            return Err(format!(
                "is an .spz file of version {version}; versions 1 to {STREAMED} can be read"
            ));
        }
        if degree > 3 {
            return Err(format!(
                "has spherical harmonics of degree {degree}; degrees 0 to 3 can be read"
            ));
        }
        Ok(SpzHeader {
            version,
            count: u32::from_le_bytes([n0, n1, n2, n3]).into(),
            degree: degree.into(),
            fractional_bits,
            flags,
        })
    }

    /// Bytes of all tables.
    fn length(&self, most: u64) -> Parsed<u64> {
        let length = self.count * self.row_bytes().iter().sum::<usize>() as u64;
        if length > most {
            return Err(format!(
                "promises {} Gaussians, more than a file of its size can hold: they take {length} bytes, at most {most} are accepted",
                self.count
            ));
        }
        Ok(length)
    }

    /// Bytes per Gaussian: position, opacity, colour, scales, rotation, harmonics.
    fn row_bytes(&self) -> [usize; 6] {
        [
            if self.version == 1 { 6 } else { 9 },
            1,
            3,
            3,
            if self.version < 3 { 3 } else { 4 },
            3 * (coefficients(self.degree) - 1),
        ]
    }

    fn position(&self, row: &[u8]) -> DVec3 {
        let fixed = |low: u8, middle: u8, high: u8| {
            // Shifted to the high bits first, for sign extension.
            let code = i32::from_le_bytes([0, low, middle, high]) >> 8;
            libm::ldexp(code.into(), -i32::from(self.fractional_bits))
        };
        match *row {
            [a, b, c, d, e, f] => DVec3::new(half([a, b]), half([c, d]), half([e, f])),
            [a, b, c, d, e, f, g, h, i] => {
                DVec3::new(fixed(a, b, c), fixed(d, e, f), fixed(g, h, i))
            }
            _ => DVec3::NAN,
        }
    }
}

fn vector(row: &[u8], value: impl Fn(u8) -> f64) -> DVec3 {
    DVec3::new(value(row[0]), value(row[1]), value(row[2]))
}

/// A float of 16 bits: sign, 5 bits of exponent, 10 of fraction.
fn half(bytes: [u8; 2]) -> f64 {
    let word = u16::from_le_bytes(bytes);
    let (exponent, fraction) = (i32::from(word >> 10 & 31), f64::from(word & 1023));
    let magnitude = match exponent {
        0 => libm::ldexp(fraction, -24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => libm::ldexp(1024.0 + fraction, exponent - 25),
    };
    if word >> 15 == 1 {
        -magnitude
    } else {
        magnitude
    }
}

fn rotation(row: &[u8]) -> DQuat {
    let mut xyzw = [0.0; 4];
    let largest = match *row {
        [a, b, c, d] => {
            let mut word = u32::from_le_bytes([a, b, c, d]);
            let largest = (word >> 30) as usize;
            for i in (0..4).rev().filter(|&i| i != largest) {
                let magnitude = f64::from(word & 511) / 511.0 * FRAC_1_SQRT_2;
                xyzw[i] = if word & 512 == 0 {
                    magnitude
                } else {
                    -magnitude
                };
                word >>= 10;
            }
            largest
        }
        _ => {
            vector(row, |code| f64::from(code) / 127.5 - 1.0).write_to_slice(&mut xyzw);
            3
        }
    };
    xyzw[largest] = (1.0 - xyzw.iter().map(|c| c * c).sum::<f64>())
        .max(0.0)
        .sqrt();
    DQuat::from_array(xyzw)
}
