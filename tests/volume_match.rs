//! Does `golden` draw volumes by the formulas of EWA §6.2 and §7.1? The oracle sums every voxel at
//! every pixel, in f64.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use splatsim::golden::{Rules, ideal, render};
use splatsim::scene::{Overrides, Scene};

/// Channels agree to this unless a threshold decides.
const TOLERANCE: f64 = 1e-9;
/// Pixels at which a threshold may have decided differently.
const HANDFUL: usize = 4;

// ---- volumes ----

/// Samples on a grid along the world's axes, x fastest.
struct Volume {
    size: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    values: Vec<f64>,
}

impl Volume {
    fn at(&self, [x, y, z]: [usize; 3]) -> f64 {
        self.values[(z * self.size[1] + y) * self.size[0] + x]
    }

    fn places(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [nx, ny, nz] = self.size;
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }

    fn position(&self, place: [usize; 3]) -> DVec3 {
        DVec3::from_array(
            [0, 1, 2].map(|axis| self.origin[axis] + self.spacing[axis] * place[axis] as f64),
        )
    }

    fn middle(&self) -> DVec3 {
        (self.position([0; 3]) + self.position(self.size.map(|n| n - 1))) / 2.0
    }

    /// Central differences; at the border one-sided ones.
    fn gradient(&self, place: [usize; 3]) -> DVec3 {
        let along = |axis: usize| {
            let (mut before, mut after) = (place, place);
            before[axis] = place[axis].saturating_sub(1);
            after[axis] = (place[axis] + 1).min(self.size[axis] - 1);
            (self.at(after) - self.at(before))
                / ((after[axis] - before[axis]) as f64 * self.spacing[axis])
        };
        DVec3::new(along(0), along(1), along(2))
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014), in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Noisy waves in [0, 1], with the precision of the file.
fn noisy() -> Volume {
    let mut state = 5;
    let mut volume = Volume {
        size: [12, 10, 9],
        spacing: [1.0, 0.5, 4.0],
        origin: [-3.0, 2.0, -11.0],
        values: Vec::new(),
    };
    let value = |[x, y, z]: [usize; 3]| {
        let waves = (0.7 * x as f64).sin() * (0.9 * y as f64 + 1.0).cos() + (0.8 * z as f64).sin();
        f64::from((0.35 + 0.2 * waves + 0.25 * random(&mut state)).clamp(0.0, 1.0) as f32)
    };
    let values = volume.places().map(value).collect();
    volume.values = values;
    volume
}

/// The built-in field with this name: shells of radius 0.2 n and value 1.25 − n/4, with one eighth
/// cut away, over [−1, 1]³.
fn nested_shells(samples: usize) -> Volume {
    let step = 2.0 / (samples - 1) as f64;
    let mut volume = Volume {
        size: [samples; 3],
        spacing: [step; 3],
        origin: [-1.0; 3],
        values: Vec::new(),
    };
    let value = |place: [usize; 3]| {
        let p = DVec3::from_array(place.map(|i| i as f64 * step - 1.0));
        if p.min_element() > 0.0 {
            return 0.0;
        }
        let shell = |n: i32| {
            (1.25 - 0.25 * f64::from(n))
                * (-0.5 * ((p.length() - 0.2 * f64::from(n)) / 0.025).powi(2)).exp()
        };
        f64::from((1..=4).map(shell).fold(0.0, f64::max) as f32)
    };
    let values = volume.places().map(value).collect();
    volume.values = values;
    volume
}

// ---- appearance ----

/// All fields of a scene file about the appearance of a volume.
#[derive(Clone)]
struct Look {
    /// Value, colour, opacity of a layer one step thick.
    transfer: Vec<(f64, [f64; 3], f64)>,
    /// Magnitude, factor; may be empty.
    gradient: Vec<(f64, f64)>,
    /// Ambient, diffuse, specular, shininess; none if unlit.
    material: Option<[f64; 4]>,
    /// Directions and colours.
    lights: Vec<([f64; 3], [f64; 3])>,
    eye: DVec3,
    target: DVec3,
    near: f64,
    linear: bool,
    back_to_front: bool,
    stop: f64,
}

const WIDTH: usize = 90;
const HEIGHT: usize = 70;
const FOV_Y_DEGREES: f64 = 40.0;
const BACKGROUND: [f64; 4] = [0.3, 0.6, 0.9, 0.8];
const KERNEL_STEPS: f64 = 0.7;
const CUTOFF: f64 = 4.0;
const LOW_PASS: f64 = 1.0;
/// In half pictures: a voxel beyond this is culled, and its Jacobian is that of the limit.
const GUARD: f64 = 1.5;
const JACOBIAN: f64 = 1.3;
const UP: DVec3 = DVec3::new(0.1, 1.0, 0.2);

impl Look {
    fn unlit(eye: DVec3, target: DVec3) -> Look {
        Look {
            transfer: vec![
                (0.25, [0.1, 0.2, 0.9], 0.0),
                (0.5, [0.9, 0.4, 0.1], 0.1),
                (0.9, [0.2, 1.0, 0.3], 0.6),
            ],
            gradient: Vec::new(),
            material: None,
            lights: Vec::new(),
            eye,
            target,
            near: 0.5,
            linear: false,
            back_to_front: false,
            stop: 0.0,
        }
    }

    fn lit(eye: DVec3, target: DVec3) -> Look {
        Look {
            gradient: vec![(0.02, 0.0), (0.2, 0.7), (0.5, 1.0)],
            material: Some([0.2, 0.7, 0.4, 9.0]),
            lights: vec![
                ([3.0, 4.0, 1.0], [0.9, 0.8, 0.7]),
                ([-1.0, 0.5, -2.0], [0.3, 0.4, 0.9]),
            ],
            ..Look::unlit(eye, target)
        }
    }

    fn scene(&self, volume: Value) -> Value {
        let transfer = self
            .transfer
            .iter()
            .map(|(value, rgb, opacity)| json!({"value": value, "rgb": rgb, "opacity": opacity}));
        let gradient = self
            .gradient
            .iter()
            .map(|(magnitude, factor)| json!({"magnitude": magnitude, "factor": factor}));
        let lights = self
            .lights
            .iter()
            .map(|(direction, rgb)| json!({"direction": direction, "rgb": rgb}));
        let material = match self.material {
            Some([ambient, diffuse, specular, shininess]) => {
                json!({"ambient": ambient, "diffuse": diffuse, "specular": specular, "shininess": shininess})
            }
            None => json!({"unlit": true}),
        };
        json!({
            "splats": {
                "volume": volume,
                "transfer": transfer.collect::<Vec<_>>(),
                "gradient": gradient.collect::<Vec<_>>(),
            },
            "camera": camera(self.eye, self.target, self.near),
            "image": {"width": WIDTH, "height": HEIGHT, "background": BACKGROUND},
            "sheets": {
                "order": if self.back_to_front { "back-to-front" } else { "front-to-back" },
                "opacity": if self.linear { "linear" } else { "exponential" },
                "stop": self.stop,
            },
            "lights": lights.collect::<Vec<_>>(),
            "materials": [material],
        })
    }

    /// Rows are right, down and forward.
    fn rotation(&self) -> DMat3 {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(UP).normalize();
        DMat3::from_cols(right, forward.cross(right), forward).transpose()
    }

    fn classified(&self, value: f64) -> (DVec3, f64) {
        let columns = [0, 1, 2, 3].map(|column| {
            // The optical depth of a layer of this opacity is −ln(1 − α); truncated kernels have 1
            // − e^(−c/2) of it.
            let depth = |opacity: f64| -(1.0 - opacity).ln() / (1.0 - (-CUTOFF / 2.0).exp());
            let of = |&(value, rgb, opacity): &(f64, [f64; 3], f64)| {
                (value, [rgb[0], rgb[1], rgb[2], depth(opacity)][column])
            };
            between(&self.transfer.iter().map(of).collect::<Vec<_>>(), value)
        });
        (DVec3::new(columns[0], columns[1], columns[2]), columns[3])
    }

    /// Blinn-Phong with the viewer at infinity, in camera space (docs/book/algorithm-resolve.md
    /// §7).
    fn shaded(&self, rgb: DVec3, gradient: DVec3) -> DVec3 {
        let Some([ambient, diffuse, specular, shininess]) = self.material else {
            return rgb;
        };
        let rotation = self.rotation();
        let normal = (rotation * gradient).normalize_or_zero();
        let normal = if normal.z > 0.0 { -normal } else { normal };
        let mut colour = rgb * ambient;
        for &(direction, light) in &self.lights {
            if normal == DVec3::ZERO {
                continue;
            }
            let towards = rotation * DVec3::from_array(direction).normalize();
            let half = (towards - DVec3::Z).normalize_or_zero();
            let light = DVec3::from_array(light);
            colour += rgb * light * diffuse * normal.dot(towards).max(0.0);
            colour += light * specular * normal.dot(half).max(0.0).powf(shininess);
        }
        colour.clamp(DVec3::ZERO, DVec3::ONE)
    }

    fn opacity(&self, depth: f64) -> f64 {
        if self.linear {
            depth.min(1.0)
        } else {
            1.0 - (-depth).exp()
        }
    }
}

fn camera(eye: DVec3, target: DVec3, near: f64) -> Value {
    json!({"eye": eye.to_array(), "target": target.to_array(), "up": UP.to_array(), "fov_y_degrees": FOV_Y_DEGREES, "near": near})
}

/// Linear between points, constant outside.
fn between(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points
        .iter()
        .position(|point| point.0 > x)
        .unwrap_or(points.len());
    match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
        (Some(only), None) | (None, Some(only)) => only.1,
        (None, None) => 1.0,
    }
}

// ---- the oracle ----

/// A projected voxel.
struct Footprint {
    centre: (f64, f64),
    /// xx, xy, yy of the inverse variance.
    conic: [f64; 3],
    /// Optical depth through the middle.
    peak: f64,
    rgb: DVec3,
    /// t_z.
    depth: f64,
    /// Distance of its slice from the eye, along the axis perpendicular to the slices.
    sheet: f64,
}

impl Footprint {
    /// Optical depth at a pixel's centre.
    fn at(&self, (x, y): (f64, f64)) -> Option<f64> {
        let (dx, dy) = (x - self.centre.0, y - self.centre.1);
        let [xx, xy, yy] = self.conic;
        let radial = xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy;
        (radial < CUTOFF).then(|| self.peak * (-radial / 2.0).exp())
    }
}

fn footprint(volume: &Volume, look: &Look, place: [usize; 3]) -> Option<Footprint> {
    let (rgb, layer) = look.classified(volume.at(place));
    let gradient = volume.gradient(place);
    let layer = layer * between(&look.gradient, gradient.length());
    if layer <= 0.0 {
        return None;
    }
    let rotation = look.rotation();
    let (half_x, half_y) = (WIDTH as f64 / 2.0, HEIGHT as f64 / 2.0);
    let focal = half_y / (FOV_Y_DEGREES.to_radians() / 2.0).tan();
    let position = volume.position(place);
    let t = rotation * (position - look.eye);
    let beside = |slope: f64, half: f64| slope.abs() > GUARD * half / focal;
    if t.z <= look.near || beside(t.x / t.z, half_x) || beside(t.y / t.z, half_y) {
        return None;
    }
    // The ray space of EWA (26): x/z and y/z, here in pixels, and the distance from the eye.
    let clamped =
        |slope: f64, half: f64| slope.clamp(-JACOBIAN * half / focal, JACOBIAN * half / focal);
    let u = DVec3::new(
        clamped(t.x / t.z, half_x) * t.z,
        clamped(t.y / t.z, half_y) * t.z,
        t.z,
    );
    let rows = [
        DVec3::new(1.0 / u.z, 0.0, -u.x / (u.z * u.z)) * focal,
        DVec3::new(0.0, 1.0 / u.z, -u.y / (u.z * u.z)) * focal,
        u / u.length(),
    ];
    let jacobian = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
    let deviations = DVec3::from_array(volume.spacing) * KERNEL_STEPS;
    let kernel = DMat3::from_diagonal(deviations * deviations);
    let variance = jacobian * rotation * kernel * rotation.transpose() * jacobian.transpose();
    let (xx, xy, yy) = (
        variance.x_axis.x + LOW_PASS,
        variance.x_axis.y,
        variance.y_axis.y + LOW_PASS,
    );
    let determinant = xx * yy - xy * xy;
    let [sx, sy, sz] = volume.spacing;
    let extinction = layer / sx.min(sy).min(sz);
    let forward = look.target - look.eye;
    let axis = forward.abs().max_position();
    Some(Footprint {
        centre: (focal * t.x / t.z + half_x, focal * t.y / t.z + half_y),
        conic: [yy / determinant, -xy / determinant, xx / determinant],
        peak: extinction * sx * sy * sz * jacobian.determinant().abs()
            / (2.0 * PI * determinant.sqrt()),
        rgb: look.shaded(rgb, gradient),
        depth: t.z,
        sheet: (position[axis] - look.eye[axis]).abs(),
    })
}

/// The optical depths along a pixel's ray, in this order, each with its colour times the depth.
fn blended(look: &Look, layers: impl Iterator<Item = (f64, DVec3)>) -> [f64; 4] {
    let (mut light, mut passes) = (DVec3::ZERO, 1.0);
    for (depth, coloured) in layers.filter(|layer| layer.0 > 0.0) {
        if passes < look.stop {
            break;
        }
        let opacity = look.opacity(depth);
        light += coloured / depth * opacity * passes;
        passes *= 1.0 - opacity;
    }
    let [r, g, b, alpha] = BACKGROUND;
    let rgb = light + DVec3::new(r, g, b) * alpha * passes;
    [rgb.x, rgb.y, rgb.z, 1.0 - passes + alpha * passes]
}

fn pixels() -> impl Iterator<Item = (f64, f64)> {
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x as f64 + 0.5, y as f64 + 0.5)))
}

/// Voxels of one slice are summed, slices are blended, the nearest first.
fn in_sheets(volume: &Volume, look: &Look) -> Vec<[f64; 4]> {
    let mut all: Vec<Footprint> = volume
        .places()
        .filter_map(|place| footprint(volume, look, place))
        .collect();
    all.sort_by(|a, b| a.sheet.total_cmp(&b.sheet));
    let sum = |sheet: &[Footprint], pixel: (f64, f64)| {
        let of = sheet
            .iter()
            .filter_map(|voxel| voxel.at(pixel).map(|depth| (depth, voxel.rgb * depth)));
        of.fold((0.0, DVec3::ZERO), |sum, one| {
            (sum.0 + one.0, sum.1 + one.1)
        })
    };
    let step = 1e-6 * volume.spacing.iter().copied().fold(f64::INFINITY, f64::min);
    let sheets: Vec<&[Footprint]> = all.chunk_by(|a, b| b.sheet - a.sheet < step).collect();
    pixels()
        .map(|pixel| blended(look, sheets.iter().map(|sheet| sum(sheet, pixel))))
        .collect()
}

/// Every voxel separately, the nearest first; without linear blending and early termination for any
/// rule of sheets.
fn one_by_one(volume: &Volume, look: &Look) -> Vec<[f64; 4]> {
    let look = &Look {
        linear: false,
        stop: 0.0,
        ..look.clone()
    };
    let mut all: Vec<Footprint> = volume
        .places()
        .filter_map(|place| footprint(volume, look, place))
        .collect();
    all.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let of = |pixel| {
        all.iter()
            .filter_map(move |voxel| voxel.at(pixel).map(|depth| (depth, voxel.rgb * depth)))
    };
    pixels().map(|pixel| blended(look, of(pixel))).collect()
}

// ---- comparing ----

fn load(folder: &Path, scene: &Value) -> Scene {
    let path = folder.join("scene.json");
    fs::write(&path, scene.to_string()).unwrap();
    Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap()
}

/// The scene of a volume, stored in a file of plain samples.
fn written(volume: &Volume, look: &Look) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> = volume
        .values
        .iter()
        .flat_map(|&value| (value as f32).to_le_bytes())
        .collect();
    fs::write(folder.path().join("samples.raw"), bytes).unwrap();
    let file = json!({
        "file": "samples.raw", "size": volume.size, "type": "f32", "endian": "little",
        "spacing": volume.spacing, "origin": volume.origin,
    });
    load(folder.path(), &look.scene(file))
}

fn drawn(scene: &Scene) -> Vec<[f64; 4]> {
    render(scene, &Rules::default()).picture.rgba
}

fn apart(a: &[[f64; 4]], b: &[[f64; 4]]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    let most = |(a, b): (&[f64; 4], &[f64; 4])| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    };
    a.iter().zip(b).map(most).collect()
}

/// Panics if too many pixels differ.
fn agree(what: &str, oracle: &[[f64; 4]], there: &[[f64; 4]], may_differ: usize) {
    let differences = apart(oracle, there);
    let (worst, most) = differences
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .unwrap();
    let differ = differences
        .iter()
        .filter(|&&difference| difference.is_nan() || difference > TOLERANCE)
        .count();
    let seen = oracle
        .iter()
        .filter(|pixel| pixel[3] > BACKGROUND[3] + 0.01)
        .count();
    let (x, y) = (worst % WIDTH, worst / WIDTH);
    println!(
        "{what}: {differ} of {seen} pixels differ, by {most:.3e} at most, at {x},{y}: {:?} here, {:?} there",
        oracle[worst], there[worst]
    );
    assert!(
        seen > 300,
        "{what}: hardly anything to compare, {seen} pixels"
    );
    assert!(differ <= may_differ, "{what}: {differ} pixels differ");
}

/// Oblique eyes around a box, for which the slices are perpendicular to x, y and z, seen from
/// either side.
fn eyes(volume: &Volume) -> Vec<DVec3> {
    let middle = volume.middle();
    let far = (volume.position(volume.size.map(|n| n - 1)) - middle).length();
    let ways = [
        DVec3::new(1.0, 0.37, 0.61),
        DVec3::new(-1.0, -0.23, 0.45),
        DVec3::new(0.31, 1.0, -0.52),
        DVec3::new(0.27, -1.0, 0.66),
        DVec3::new(0.43, 0.29, 1.0),
        DVec3::new(-0.57, 0.33, -1.0),
    ];
    ways.map(|way| middle + way.normalize() * far * 2.6).into()
}

#[test]
fn a_volume_without_light_is_drawn_by_the_formulas() {
    let volume = noisy();
    for (i, eye) in eyes(&volume).into_iter().enumerate() {
        let look = Look::unlit(eye, volume.middle());
        let oracle = in_sheets(&volume, &look);
        agree(
            &format!("unlit {i}"),
            &oracle,
            &drawn(&written(&volume, &look)),
            0,
        );
        let turned = Look {
            back_to_front: true,
            ..look
        };
        agree(
            &format!("unlit {i}, back to front"),
            &oracle,
            &drawn(&written(&volume, &turned)),
            0,
        );
    }
}

#[test]
fn a_lit_volume_is_drawn_by_the_formulas() {
    let volume = noisy();
    for (i, eye) in eyes(&volume).into_iter().enumerate() {
        let look = Look {
            linear: i % 2 == 0,
            ..Look::lit(eye, volume.middle())
        };
        agree(
            &format!("lit {i}"),
            &in_sheets(&volume, &look),
            &drawn(&written(&volume, &look)),
            0,
        );
    }
}

#[test]
fn a_volume_around_the_eye_is_drawn_by_the_formulas() {
    let volume = noisy();
    let target = volume.middle();
    for (i, eye) in [
        DVec3::new(3.3, 3.9, -4.1),
        DVec3::new(-5.2, 4.4, 2.3),
        DVec3::new(2.9, 8.3, 6.2),
    ]
    .into_iter()
    .enumerate()
    {
        let look = Look {
            near: 2.0,
            ..Look::unlit(eye, target)
        };
        agree(
            &format!("around {i}"),
            &in_sheets(&volume, &look),
            &drawn(&written(&volume, &look)),
            0,
        );
    }
}

#[test]
fn a_pixel_that_lets_little_through_takes_no_more_sheets() {
    let volume = noisy();
    for (i, eye) in eyes(&volume).into_iter().enumerate() {
        let through = Look {
            linear: i % 2 == 1,
            ..Look::lit(eye, volume.middle())
        };
        let look = Look {
            stop: 0.4,
            ..through.clone()
        };
        let oracle = in_sheets(&volume, &look);
        let stopped = apart(&oracle, &in_sheets(&volume, &through))
            .into_iter()
            .filter(|&difference| difference > 1e-3)
            .count();
        println!("{stopped} pixels stop");
        assert!(stopped > 100);
        agree(
            &format!("stop {i}"),
            &oracle,
            &drawn(&written(&volume, &look)),
            HANDFUL,
        );
    }
}

#[test]
fn the_ideal_picture_of_a_volume_is_of_its_voxels_one_by_one() {
    let volume = noisy();
    for (i, eye) in eyes(&volume).into_iter().enumerate() {
        let look = Look {
            linear: i % 3 == 2,
            back_to_front: i % 2 == 1,
            ..Look::lit(eye, volume.middle())
        };
        agree(
            &format!("ideal {i}"),
            &one_by_one(&volume, &look),
            &ideal(&written(&volume, &look)).picture.rgba,
            0,
        );
    }
}

#[test]
fn nested_shells_are_drawn_by_the_formulas() {
    let volume = nested_shells(18);
    for (i, way) in [DVec3::new(2.1, 1.9, 3.4), DVec3::new(-1.3, -3.1, 1.7)]
        .into_iter()
        .enumerate()
    {
        let transfer = vec![
            (0.02, [0.9, 0.1, 0.1], 0.0),
            (0.5, [0.1, 0.8, 0.2], 0.03),
            (1.0, [0.9, 0.9, 1.0], 0.08),
        ];
        let look = Look {
            transfer,
            gradient: Vec::new(),
            ..Look::lit(way, DVec3::ZERO)
        };
        let folder = tempfile::tempdir().unwrap();
        let scene = load(
            folder.path(),
            &look.scene(json!({"builtin": "nested-shells", "samples": 18})),
        );
        agree(
            &format!("shells {i}"),
            &in_sheets(&volume, &look),
            &drawn(&scene),
            0,
        );
        agree(
            &format!("ideal shells {i}"),
            &one_by_one(&volume, &look),
            &ideal(&scene).picture.rgba,
            0,
        );
    }
}

// ---- flat kernels ----

/// The isosurface of a noisy volume, and the same splats as discs.
fn isosurface(folder: &Path, source: Value, eye: DVec3, target: DVec3) -> Scene {
    let scene = json!({
        "splats": source,
        "camera": camera(eye, target, 0.5),
        "image": {"width": WIDTH, "height": HEIGHT, "background": BACKGROUND},
        "surface": {"z_threshold": 0.5},
        "lights": [{"direction": [3, 4, 1], "rgb": [0.9, 0.8, 0.7]}],
        "materials": [{"ambient": 0.2, "diffuse": 0.7, "specular": 0.4, "shininess": 9}],
    });
    load(folder, &scene)
}

#[test]
fn ever_flatter_kernels_become_discs() {
    let (eye, target) = (DVec3::new(2.1, 1.9, 3.4), DVec3::ZERO);
    let folder = tempfile::tempdir().unwrap();
    let flattened = |flatten: f64| {
        let volume = json!({"builtin": "nested-shells", "samples": 24});
        isosurface(
            folder.path(),
            json!({"volume": volume, "isovalue": 0.3, "flatten": flatten}),
            eye,
            target,
        )
    };
    let disc = |splat: &splatsim::scene::Splat| {
        json!({
            "position": splat.position.to_array(), "normal": splat.normal.to_array(), "radius": splat.radius,
            "rgb": splat.rgb, "opacity": splat.opacity, "material": splat.material,
        })
    };
    let discs = Value::Array(flattened(10.0).splats.iter().map(disc).collect());
    let discs = isosurface(folder.path(), discs, eye, target);
    assert!(discs.ellipsoids.is_none());
    for is_ideal in [false, true] {
        let picture = |scene: &Scene| {
            if is_ideal {
                ideal(scene).picture.rgba
            } else {
                drawn(scene)
            }
        };
        let limit = picture(&discs);
        assert!(
            limit
                .iter()
                .filter(|pixel| pixel[3] > BACKGROUND[3] + 0.01)
                .count()
                > 300,
            "hardly anything to compare"
        );
        let differences = [10.0, 100.0, 1000.0, 1e6].map(|flatten| {
            let differences = apart(&picture(&flattened(flatten)), &limit);
            let mean = differences.iter().sum::<f64>() / differences.len() as f64;
            (mean, differences.into_iter().fold(0.0, f64::max))
        });
        println!("mean and greatest differences: {differences:?}");
        assert!(
            differences.is_sorted_by(|a, b| a.0 > b.0),
            "flatter kernels are no nearer to discs"
        );
        assert!(differences[3].1 < 1e-6);
    }
}
