//! Trained: reads the `cameras.json` that programs which train Gaussians write next to their
//! points: a list of cameras with `width`, `height`, `fx`, `fy`, `position` and `rotation`, camera
//! → world, x right, y down, z forward.

use super::{Intrinsics, Lens, Parsed, Pose, check_position, check_rotation, number, rows, side};
use glam::{DMat3, DVec3};
use serde_json::Value;

/// In the order of the list.
pub(super) fn poses(cameras: &[Value]) -> Parsed<Vec<Pose>> {
    let pose = |(i, camera): (usize, &Value)| {
        pose(camera).map_err(|sentence| format!("[{i}]: {sentence}"))
    };
    cameras.iter().enumerate().map(pose).collect()
}

fn pose(camera: &Value) -> Parsed<Pose> {
    let need = |name: &str| {
        number(camera, name)?.ok_or(format!(
            "has no {name}; a camera has width, height, fx, fy, position and rotation"
        ))
    };
    let size = [
        side(need("width")?, "width")?,
        side(need("height")?, "height")?,
    ];
    let focal = [need("fx")?, need("fy")?];
    // Names of the principal point, in programs that write it.
    let centre = [number(camera, "cx")?, number(camera, "cy")?];
    let lens = Lens::Known(Intrinsics::new(size, focal, centre)?);
    let position: Option<Vec<f64>> = camera["position"]
        .as_array()
        .and_then(|of| of.iter().map(Value::as_f64).collect());
    let position: [f64; 3] = position
        .and_then(|of| of.try_into().ok())
        .ok_or("position must be three numbers")?;
    let rows: Option<[[f64; 3]; 3]> =
        rows(&camera["rotation"]).and_then(|rows| rows.try_into().ok());
    let [x, y, z] = rows.ok_or("rotation must be three rows of three numbers")?;
    let axes = DMat3::from_cols(
        DVec3::from_array(x),
        DVec3::from_array(y),
        DVec3::from_array(z),
    )
    .transpose();
    check_rotation(&axes, "rotation")?;
    let eye = DVec3::from_array(position);
    check_position(eye)?;
    let picture = camera["img_name"].as_str().map(str::to_owned);
    Ok(Pose {
        picture,
        eye,
        forward: axes.z_axis,
        up: -axes.y_axis,
        lens,
    })
}
