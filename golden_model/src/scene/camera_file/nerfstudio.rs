//! Nerfstudio: reads `transforms.json`, cameras of pictures, and `camera_path.json`, cameras of a
//! video; camera → world, x right, y up, z back.

use super::{Intrinsics, Lens, Parsed, Pose, check_position, check_rotation, number, rows, side};
use crate::output::text::clipped;
use glam::{DMat3, DVec3};
use serde_json::Value;

/// Parameters of distortion.
const DISTORTIONS: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];
const UNDISTORTED: &str =
    "a lens that distorts cannot be drawn; cameras of undistorted pictures can";

/// Cameras of pictures, in the order of the file.
pub(super) fn transforms(all: &Value, frames: &Value) -> Parsed<Vec<Pose>> {
    let frames = frames
        .as_array()
        .ok_or("has no list `frames`: it is not a transforms.json")?;
    let pose = |(i, frame): (usize, &Value)| {
        let whose = format!("frames[{i}]");
        let lens = Fields { all, frame }.lens();
        let pose =
            lens.and_then(|lens| looking(&frame["transform_matrix"], "transform_matrix", lens));
        let picture = frame["file_path"].as_str().map(str::to_owned);
        pose.map(|pose| Pose { picture, ..pose })
            .map_err(|sentence| format!("{whose}: {sentence}"))
    };
    frames.iter().enumerate().map(pose).collect()
}

/// Fields of a frame, which override those of the file.
struct Fields<'a> {
    all: &'a Value,
    frame: &'a Value,
}

impl Fields<'_> {
    fn get(&self, name: &str) -> Option<&Value> {
        self.frame.get(name).or(self.all.get(name))
    }

    fn number(&self, name: &str) -> Parsed<Option<f64>> {
        number(
            if self.frame.get(name).is_some() {
                self.frame
            } else {
                self.all
            },
            name,
        )
    }

    fn check_straight(&self) -> Parsed<()> {
        let model = self
            .get("camera_model")
            .map_or(Some("PINHOLE"), Value::as_str)
            .ok_or("camera_model is not a text")?;
        if !["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"].contains(&model) {
            return Err(format!(
                "camera_model is {}; only PINHOLE, SIMPLE_PINHOLE and OPENCV without distortion can be drawn",
                clipped(model)
            ));
        }
        for name in DISTORTIONS {
            if let Some(amount) = self.number(name)?.filter(|amount| *amount != 0.0) {
                return Err(format!("{name} is {amount}: {UNDISTORTED}"));
            }
        }
        if self
            .get("is_fisheye")
            .is_some_and(|is| *is != Value::Bool(false))
        {
            return Err(format!("is_fisheye is set: {UNDISTORTED}"));
        }
        let is_straight = |amounts: &Value| {
            amounts
                .as_array()
                .is_some_and(|amounts| amounts.iter().all(|amount| amount.as_f64() == Some(0.0)))
        };
        if self
            .get("distortion_params")
            .is_some_and(|amounts| !is_straight(amounts))
        {
            return Err(format!("distortion_params are not all 0: {UNDISTORTED}"));
        }
        Ok(())
    }

    fn lens(&self) -> Parsed<Lens> {
        self.check_straight()?;
        let side = |name: &str| {
            self.number(name)?
                .map(|pixels| side(pixels, name))
                .transpose()
        };
        let size = side("w")?
            .zip(side("h")?)
            .map(|(width, height)| [width, height]);
        let [fx, fy, cx, cy] = ["fl_x", "fl_y", "cx", "cy"].map(|name| self.number(name));
        let (fx, fy, centre) = (fx?, fy?, [cx?, cy?]);
        if let Some(focal) = fx
            .or(fy)
            .map(|focal| [fx.unwrap_or(focal), fy.unwrap_or(focal)])
        {
            let size =
                size.ok_or("has fl_x or fl_y without w and h: the picture's sides are needed")?;
            return Intrinsics::new(size, focal, centre).map(Lens::Known);
        }
        let angle = self
            .number("camera_angle_x")?
            .ok_or("has neither fl_x nor camera_angle_x")?;
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            return Err(format!(
                "camera_angle_x is {angle}; it must be between 0 and π"
            ));
        }
        let vertical = self.number("camera_angle_y")?;
        if vertical.is_some_and(|angle| !(angle > 0.0 && angle < std::f64::consts::PI)) {
            return Err("camera_angle_y must be between 0 and π".into());
        }
        let Some(size) = size else {
            // Without the sides, neither the centre nor the shape of a pixel is known.
            let name = [
                ("cx", centre[0]),
                ("cy", centre[1]),
                ("camera_angle_y", vertical),
            ]
            .into_iter()
            .find(|(_, value)| value.is_some());
            return name.map_or(Ok(Lens::HorizontalAngle(angle)), |(name, _)| {
                Err(format!("has {name} without w and h"))
            });
        };
        let focal = |side: u32, angle: f64| f64::from(side) / 2.0 / libm::tan(angle / 2.0);
        let fx = focal(size[0], angle);
        let fy = vertical.map_or(fx, |angle| focal(size[1], angle));
        Intrinsics::new(size, [fx, fy], centre).map(Lens::Known)
    }
}

/// Cameras of a video, as the viewer's editor writes them.
pub(super) fn path(all: &Value, path: &Value, notes: &mut Vec<String>) -> Parsed<Vec<Pose>> {
    let path = path
        .as_array()
        .ok_or("camera_path is not a list: it is not a camera_path.json")?;
    let kind = all
        .get("camera_type")
        .map_or(Some("perspective"), Value::as_str)
        .ok_or("camera_type is not a text")?;
    if kind != "perspective" {
        return Err(format!(
            "camera_type is {}; only perspective can be drawn",
            clipped(kind)
        ));
    }
    let need = |name: &str| {
        number(all, name)?.ok_or(format!(
            "has no {name}; a camera_path.json has render_width and render_height"
        ))
    };
    let size = [
        side(need("render_width")?, "render_width")?,
        side(need("render_height")?, "render_height")?,
    ];
    if all.get("crop").is_some_and(|crop| !crop.is_null()) {
        notes.push("`crop` is left out: all splats are drawn".into());
    }
    let pose = |(i, camera): (usize, &Value)| {
        let whose = format!("camera_path[{i}]");
        let pose = || {
            // The vertical angle as in three.js; `aspect` is that of the editor's window, not of
            // the video.
            let fov = number(camera, "fov")?.ok_or("has no fov")?;
            if !(fov > 0.0 && fov < 180.0) {
                return Err(format!(
                    "fov is {fov}; it must be between 0 and 180 degrees"
                ));
            }
            let focal = f64::from(size[1]) / 2.0 / libm::tan(fov.to_radians() / 2.0);
            let lens = Lens::Known(Intrinsics::new(size, [focal; 2], [None; 2])?);
            looking(&camera["camera_to_world"], "camera_to_world", lens)
        };
        pose().map_err(|sentence| format!("{whose}: {sentence}"))
    };
    path.iter().enumerate().map(pose).collect()
}

/// A camera from its matrix: rows of four numbers, the last row optional, or all numbers in one
/// list.
fn looking(matrix: &Value, field: &str, lens: Lens) -> Parsed<Pose> {
    let flat = || -> Option<Vec<[f64; 4]>> {
        let numbers: Vec<f64> = matrix
            .as_array()?
            .iter()
            .map(Value::as_f64)
            .collect::<Option<_>>()?;
        let (rows, []) = numbers.as_chunks::<4>() else {
            return None;
        };
        Some(rows.to_vec())
    };
    let rows = rows::<4>(matrix)
        .or_else(flat)
        .filter(|rows| [3, 4].contains(&rows.len()));
    let rows = rows.ok_or(format!(
        "{field} must be four rows of four numbers, of which the last may be left out"
    ))?;
    if rows
        .get(3)
        .is_some_and(|last| *last != [0.0, 0.0, 0.0, 1.0])
    {
        return Err(format!(
            "{field} is not a rotation and a position: its last row must be 0 0 0 1"
        ));
    }
    let column = |i: usize| DVec3::new(rows[0][i], rows[1][i], rows[2][i]);
    let axes = DMat3::from_cols(column(0), column(1), column(2));
    check_rotation(&axes, field)?;
    check_position(column(3))?;
    Ok(Pose {
        picture: None,
        eye: column(3),
        forward: -axes.z_axis,
        up: axes.y_axis,
        lens,
    })
}
