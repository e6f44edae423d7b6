//! STL: reads triangles without materials, from the binary form (80 bytes, a count, 50 bytes per
//! triangle) or from text with keywords in either case. Normals in the file are ignored: many
//! programs write 0, and the corners determine them.

use super::{Contents, GREY, Parsed, Raw};
use crate::output::text::clipped;
use glam::DVec3;

/// Bytes before the first triangle, and per triangle.
const HEAD: usize = 84;
const ROW: usize = 50;
/// Prefix that some editors write before text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads the bytes of an STL file. The error is the second half of a sentence that begins with the
/// file's name.
pub(super) fn read(bytes: &[u8]) -> Parsed<Contents> {
    let promised = bytes
        .get(80..HEAD)
        .map(|count| u32::from_le_bytes(count.try_into().expect("four bytes")) as usize);
    let is_text = bytes
        .strip_prefix(BYTE_ORDER_MARK)
        .unwrap_or(bytes)
        .trim_ascii_start()
        .get(..5)
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // Binary files may begin with `solid` too; their length decides.
    let fits = promised.is_some_and(|count| bytes.len() == HEAD + ROW * count);
    match promised {
        _ if is_text && !fits => text(bytes),
        Some(count) => binary(&bytes[HEAD..], count),
        None => Err("is not an STL file: it has neither the word `solid` nor the 84 bytes that a binary one begins with".into()),
    }
}

fn raw(corners: [DVec3; 3]) -> Raw {
    Raw {
        corners,
        normals: None,
        uv: None,
        rgba: [GREY; 3],
        material: 0,
        flat: false,
    }
}

fn binary(rows: &[u8], promised: usize) -> Parsed<Contents> {
    let held = rows.len() / ROW;
    if held < promised {
        return Err(format!(
            "promises {promised} triangles, and has room for {held}"
        ));
    }
    let mut contents = Contents::default();
    contents.reserve(promised)?;
    let number = |row: &[u8], i: usize| {
        f32::from_le_bytes(row[12 + 4 * i..16 + 4 * i].try_into().expect("four bytes")) as f64
    };
    let corner = |row: &[u8], i: usize| {
        DVec3::from_array([3 * i, 3 * i + 1, 3 * i + 2].map(|i| number(row, i)))
    };
    contents.triangles = rows
        .chunks_exact(ROW)
        .take(promised)
        .map(|row| raw([0, 1, 2].map(|i| corner(row, i))))
        .collect();
    Ok(contents)
}

fn text(bytes: &[u8]) -> Parsed<Contents> {
    let mut contents = Contents::default();
    let mut corners = Vec::new();
    // Old Macs use only the other of the two bytes as a line end.
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    for (number, line) in bytes.split(|&byte| byte == end).enumerate() {
        // Keywords may be in either case.
        let line = String::from_utf8_lossy(line).to_lowercase();
        let words: Vec<&str> = line.split_ascii_whitespace().take(5).collect();
        let at = |sentence: String| format!("line {}: {sentence}", number + 1);
        match words.as_slice() {
            ["vertex", x, y, z] => corners.push(vertex([x, y, z]).map_err(at)?),
            ["vertex", ..] => return Err(at("a vertex needs three numbers".into())),
            ["endloop", ..] => {
                let three = <[DVec3; 3]>::try_from(corners.as_slice());
                contents.triangles.push(raw(three.map_err(|_| {
                    at(format!(
                        "a loop of {} vertices is not a triangle",
                        corners.len()
                    ))
                })?));
                corners.clear();
            }
            _ => {}
        }
    }
    if corners.is_empty() {
        Ok(contents)
    } else {
        Err("ends inside a loop: there is no line `endloop`".into())
    }
}

fn vertex(words: [&str; 3]) -> Parsed<DVec3> {
    let mut numbers = [0.0; 3];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word
            .parse()
            .map_err(|_| format!("`{}` is not a number", clipped(word)))?;
    }
    Ok(DVec3::from_array(numbers))
}
