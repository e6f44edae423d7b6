//! PLY: makes triangles of a PLY file's faces; vertices, colours and encodings are those of clouds ([`crate::scene::ply`]).

use super::{Contents, Parsed, Raw};
use crate::scene::ply;

/// Reads the bytes of a PLY file; the error is the second half of a sentence that begins with the file's name.
pub(super) fn read(bytes: &[u8]) -> Parsed<Contents> {
    let ply::Faced { vertices, uv, has_normals, triangles, refused, notes } = ply::parse_faced(bytes)?;
    if refused > 0 {
        return Err(format!("{refused} of {} triangles name vertices that do not exist", refused + triangles.len()));
    }
    let mut contents = Contents { notes, ..Contents::default() };
    contents.reserve(triangles.len())?;
    contents.triangles.reserve_exact(triangles.len());
    for corners in triangles {
        let vertex = corners.map(|corner| &vertices[corner as usize]);
        contents.triangles.push(Raw {
            corners: vertex.map(|v| v.position),
            normals: has_normals.then(|| vertex.map(|v| v.normal)),
            uv: uv.as_ref().map(|uv| corners.map(|corner| uv[corner as usize])),
            rgba: vertex.map(|v| [v.rgb[0] as f32, v.rgb[1] as f32, v.rgb[2] as f32, v.opacity as f32]),
            material: 0,
            flat: false,
        });
    }
    Ok(contents)
}
