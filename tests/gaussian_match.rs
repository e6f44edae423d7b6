//! Does `golden` draw trained Gaussians as the training program does? The oracle follows Kerbl et
//! al. 2023 and gsplat, in f64.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use splatsim::golden::{Rules, render};
use splatsim::scene::{Overrides, Scene};

use crate::shared_input;

/// Channels agree to this. They may differ more only if a threshold (1/255, 1e-4, r = 2·ln 255) is
/// met within rounding. Measured: 1e-13.
const TOLERANCE: f64 = 1e-9;
/// Number of pixels at which thresholds may decide differently.
const HANDFUL: usize = 8;

// ---- reading ----

/// One row of a file, with the trained values.
struct Gaussian {
    position: DVec3,
    /// w x y z, of any length.
    quaternion: [f64; 4],
    log_scale: DVec3,
    logit: f64,
    /// By channel: all coefficients, the constant one first.
    harmonics: [Vec<f64>; 3],
}

/// A binary little-endian PLY that has only float properties.
fn read_gaussians(path: &Path) -> Vec<Gaussian> {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let body = bytes
        .windows(end.len())
        .position(|window| window == end)
        .unwrap()
        + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    let names: Vec<&str> = header
        .lines()
        .filter_map(|line| line.strip_prefix("property float "))
        .collect();
    assert_eq!(
        names.len(),
        header.matches("property").count(),
        "only floats are known here"
    );
    let floats: Vec<f64> = bytes[body..]
        .as_chunks::<4>()
        .0
        .iter()
        .map(|four| f32::from_le_bytes(*four).into())
        .collect();
    let rest = names
        .iter()
        .filter(|name| name.starts_with("f_rest_"))
        .count()
        / 3;
    let column = |name: String| names.iter().position(|&own| own == name).unwrap();
    let row = |row: &[f64]| {
        let of = |name: &str| row[column(name.into())];
        let channel = |c: usize| {
            let constant = row[column(format!("f_dc_{c}"))];
            let others = (0..rest).map(|i| row[column(format!("f_rest_{}", c * rest + i))]);
            std::iter::once(constant).chain(others).collect()
        };
        Gaussian {
            position: DVec3::new(of("x"), of("y"), of("z")),
            quaternion: [of("rot_0"), of("rot_1"), of("rot_2"), of("rot_3")],
            log_scale: DVec3::new(of("scale_0"), of("scale_1"), of("scale_2")),
            logit: of("opacity"),
            harmonics: [channel(0), channel(1), channel(2)],
        }
    };
    floats.chunks_exact(names.len()).map(row).collect()
}

// ---- colour ----

/// Real spherical harmonics of all degrees up to this one, with the Condon-Shortley phase, from the
/// recurrences of Legendre functions.
fn basis(degree: usize, direction: DVec3) -> Vec<f64> {
    let (cosine, sine) = (direction.z, direction.x.hypot(direction.y));
    let azimuth = direction.y.atan2(direction.x);
    let mut all = Vec::new();
    for l in 0..=degree {
        for m in -(l as i32)..=l as i32 {
            let order = m.unsigned_abs() as usize;
            let ratio: f64 = (l - order + 1..=l + order).map(|i| i as f64).product();
            let norm = ((2 * l + 1) as f64 / (4.0 * PI) / ratio).sqrt();
            let turn = f64::from(m.abs()) * azimuth;
            let around = match m {
                0 => 1.0,
                1.. => 2.0_f64.sqrt() * turn.cos(),
                _ => 2.0_f64.sqrt() * turn.sin(),
            };
            all.push(norm * legendre(l, order, cosine, sine) * around);
        }
    }
    all
}

/// The associated Legendre function P of degree `l` and order `m`, `(−1)^m` included.
fn legendre(l: usize, m: usize, cosine: f64, sine: f64) -> f64 {
    let start: f64 = (0..m).map(|i| -((2 * i + 1) as f64) * sine).product();
    let (mut before, mut this) = (0.0, start);
    for n in m + 1..=l {
        let next =
            ((2 * n - 1) as f64 * cosine * this - (n + m - 1) as f64 * before) / (n - m) as f64;
        (before, this) = (this, next);
    }
    this
}

fn colour(gaussian: &Gaussian, eye: DVec3) -> DVec3 {
    let coefficients = gaussian.harmonics[0].len();
    let basis = basis(
        coefficients.isqrt() - 1,
        (gaussian.position - eye).normalize(),
    );
    assert_eq!(basis.len(), coefficients);
    let channel = |c: usize| -> f64 {
        basis
            .iter()
            .zip(&gaussian.harmonics[c])
            .map(|(b, f)| b * f)
            .sum()
    };
    (DVec3::new(channel(0), channel(1), channel(2)) + 0.5).max(DVec3::ZERO)
}

// ---- drawing ----

#[derive(Clone, Copy)]
struct View {
    eye: DVec3,
    target: DVec3,
    up: DVec3,
    fov_y_degrees: f64,
    near: f64,
    width: usize,
    height: usize,
    background: [f64; 4],
    /// Gaussians whose centres are farther to the side than this, in half pictures, are not drawn.
    /// None if the file does not specify it; then the oracle draws all Gaussians, like its models.
    guard: Option<f64>,
    /// Focal lengths and principal point, pixels; none if they follow from the angle of view.
    lens: Option<[[f64; 2]; 2]>,
    /// Whether opacity is reduced where the low-pass filter widens a Gaussian.
    compensated: bool,
}

impl View {
    /// Rows are right, down and forward.
    fn rotation(&self) -> DMat3 {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        DMat3::from_cols(right, forward.cross(right), forward).transpose()
    }

    fn half(&self) -> (f64, f64) {
        (self.width as f64 / 2.0, self.height as f64 / 2.0)
    }

    /// Focal lengths and principal point.
    fn lens(&self) -> [[f64; 2]; 2] {
        let focal = self.half().1 / (self.fov_y_degrees.to_radians() / 2.0).tan();
        self.lens
            .unwrap_or([[focal; 2], [self.half().0, self.half().1]])
    }

    fn scene(&self, file: &Path) -> Value {
        let mut kernel = self
            .guard
            .map_or(json!({}), |guard| json!({"guard": guard}));
        if self.compensated {
            kernel["compensate_opacity"] = json!(true);
        }
        let mut scene = json!({
            "splats": {"file": file},
            "kernel": kernel,
            "camera": {
                "eye": self.eye.to_array(),
                "target": self.target.to_array(),
                "up": self.up.to_array(),
                "near": self.near,
            },
            "image": {"width": self.width, "height": self.height, "background": self.background},
        });
        match self.lens {
            Some([focal, centre]) => {
                (scene["camera"]["focal_px"], scene["camera"]["centre_px"]) =
                    (json!(focal), json!(centre))
            }
            None => scene["camera"]["fov_y_degrees"] = json!(self.fov_y_degrees),
        }
        scene
    }
}

/// A projected Gaussian.
struct Ellipse {
    depth: f64,
    centre: (f64, f64),
    /// Pixels to each side that it can reach.
    reach: f64,
    /// xx, xy, yy of the inverse covariance.
    conic: [f64; 3],
    opacity: f64,
    rgb: DVec3,
}

fn world_covariance(gaussian: &Gaussian) -> DMat3 {
    let length = gaussian
        .quaternion
        .iter()
        .map(|q| q * q)
        .sum::<f64>()
        .sqrt();
    let [w, x, y, z] = gaussian.quaternion.map(|q| q / length);
    let rotation = DMat3::from_cols(
        DVec3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ),
        DVec3::new(
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ),
        DVec3::new(
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ),
    );
    let scales = DVec3::from_array(gaussian.log_scale.to_array().map(f64::exp));
    rotation * DMat3::from_diagonal(scales * scales) * rotation.transpose()
}

fn project(gaussian: &Gaussian, view: &View) -> Option<Ellipse> {
    let (rotation, [[fx, fy], [cx, cy]]) = (view.rotation(), view.lens());
    // Half a picture is measured on the farther side of the principal point.
    let (half_x, half_y) = (
        cx.max(view.width as f64 - cx),
        cy.max(view.height as f64 - cy),
    );
    let t = rotation * (gaussian.position - view.eye);
    if t.z <= view.near {
        return None;
    }
    let halves = (fx * t.x.abs() / half_x).max(fy * t.y.abs() / half_y) / t.z;
    if view.guard.is_some_and(|guard| halves > guard) {
        return None;
    }
    let most = |half: f64, focal: f64| 1.3 * half / focal;
    let a = (t.x / t.z).clamp(-most(half_x, fx), most(half_x, fx));
    let b = (t.y / t.z).clamp(-most(half_y, fy), most(half_y, fy));
    let across = DVec3::new(fx / t.z, 0.0, -fx * a / t.z);
    let along = DVec3::new(0.0, fy / t.z, -fy * b / t.z);
    let covariance = rotation * world_covariance(gaussian) * rotation.transpose();
    let xx = across.dot(covariance * across) + 0.3;
    let xy = across.dot(covariance * along);
    let yy = along.dot(covariance * along) + 0.3;
    let determinant = xx * yy - xy * xy;
    let unfiltered = (xx - 0.3) * (yy - 0.3) - xy * xy;
    let compensation = if view.compensated {
        (unfiltered.max(0.0) / determinant).sqrt()
    } else {
        1.0
    };
    let middle = (xx + yy) / 2.0;
    let longest = middle + (middle * middle - determinant).max(0.0).sqrt();
    Some(Ellipse {
        depth: t.z,
        centre: (fx * t.x / t.z + cx, fy * t.y / t.z + cy),
        reach: (2.0 * 255f64.ln() * longest).sqrt() + 1.0,
        conic: [yy / determinant, -xy / determinant, xx / determinant],
        opacity: compensation / (1.0 + (-gaussian.logit).exp()),
        rgb: colour(gaussian, view.eye),
    })
}

/// Depth from which weights that fall with depth are 0.
const DISTANCE: f64 = 4.5;

/// Premultiplied, over the background, row 0 on top.
fn draw(gaussians: &[Gaussian], view: &View, rules: &Rules) -> Vec<[f64; 4]> {
    let mut ellipses: Vec<Ellipse> = gaussians
        .iter()
        .filter_map(|gaussian| project(gaussian, view))
        .collect();
    ellipses.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    if rules.weights_fall_with_depth {
        ellipses.retain(|ellipse| ellipse.depth < DISTANCE);
        for ellipse in &mut ellipses {
            ellipse.opacity *= (DISTANCE - ellipse.depth) / DISTANCE;
        }
    }
    let mut pixels = vec![
        Pixel {
            light: DVec3::ZERO,
            passes: 1.0,
            done: false,
            weights: rules.sums_gaussians.then_some(0.0)
        };
        view.width * view.height
    ];
    let pixels_within = |centre: f64, reach: f64, end: usize| {
        let clipped = |place: f64| place.clamp(0.0, end as f64) as usize;
        clipped((centre - reach).floor())..clipped((centre + reach).ceil())
    };
    for ellipse in &ellipses {
        for y in pixels_within(ellipse.centre.1, ellipse.reach, view.height) {
            for x in pixels_within(ellipse.centre.0, ellipse.reach, view.width) {
                pixels[y * view.width + x].take(ellipse, (x as f64 + 0.5, y as f64 + 0.5));
            }
        }
    }
    let [r, g, b, alpha] = view.background;
    let behind = DVec3::new(r, g, b) * alpha;
    let finished = |pixel: &Pixel| {
        // Of a weighted sum, the background is one more term, with weight 1.
        let passes = pixel
            .weights
            .map_or(pixel.passes, |weights| 1.0 / (1.0 + weights));
        let light = pixel.light * pixel.weights.map_or(1.0, |_| passes);
        let rgb = light + behind * passes;
        [rgb.x, rgb.y, rgb.z, 1.0 - passes + alpha * passes]
    };
    pixels.iter().map(finished).collect()
}

#[derive(Clone)]
struct Pixel {
    light: DVec3,
    passes: f64,
    done: bool,
    /// Sum of weights, where Gaussians are summed instead of blended.
    weights: Option<f64>,
}

impl Pixel {
    fn take(&mut self, ellipse: &Ellipse, (x, y): (f64, f64)) {
        let (dx, dy) = (x - ellipse.centre.0, y - ellipse.centre.1);
        let [xx, xy, yy] = ellipse.conic;
        let radial = xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy;
        if self.done || radial >= 2.0 * 255f64.ln() {
            return;
        }
        let alpha = ellipse.opacity * (-radial / 2.0).exp();
        if alpha < 1.0 / 255.0 {
            return;
        }
        if let Some(weights) = &mut self.weights {
            *weights += alpha;
            self.light += ellipse.rgb * alpha;
            return;
        }
        let alpha = alpha.min(0.99);
        let after = self.passes * (1.0 - alpha);
        if after < 1e-4 {
            self.done = true;
            return;
        }
        self.light += ellipse.rgb * alpha * self.passes;
        self.passes = after;
    }
}

// ---- comparing ----

/// `golden`'s picture of the same file.
fn golden(file: &Path, view: &View, rules: &Rules) -> Vec<[f64; 4]> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let mut scene = view.scene(file);
    if rules.weights_fall_with_depth {
        scene["sheets"] = json!({"weight_distance": DISTANCE});
    }
    fs::write(&path, scene.to_string()).unwrap();
    let scene = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
    render(&scene, rules).picture.rgba
}

fn agree(what: &str, file: &Path, view: &View) {
    agree_by(&Rules::default(), what, file, view);
}

fn agree_by(rules: &Rules, what: &str, file: &Path, view: &View) {
    let file = fs::canonicalize(file).unwrap();
    let oracle = draw(&read_gaussians(&file), view, rules);
    let golden = golden(&file, view, rules);
    let seen = oracle.iter().filter(|&&pixel| pixel != oracle[0]).count();
    let apart = |(a, b): (&[f64; 4], &[f64; 4])| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    };
    let differences: Vec<f64> = oracle.iter().zip(&golden).map(apart).collect();
    let (worst, most) = differences
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .unwrap();
    let differ = differences
        .iter()
        .filter(|&&difference| difference.is_nan() || difference > TOLERANCE)
        .count();
    let (x, y) = (worst % view.width, worst / view.width);
    println!(
        "{what}: {differ} pixels differ, by {most:.3e} at most, at {x},{y}: {:?} here, {:?} there",
        oracle[worst], golden[worst]
    );
    assert_eq!(oracle.len(), golden.len());
    assert!(
        seen > 50,
        "{what}: hardly anything to compare, {seen} pixels"
    );
    assert!(differ <= HANDFUL, "{what}: {differ} pixels differ");
}

#[test]
fn a_trained_guitar_is_drawn_as_its_trainer_draws_it() {
    let Some(file) = shared_input::find("splats3d/guitar_expanded.ply") else {
        return;
    };
    let whole = View {
        eye: DVec3::new(1.5, -3.0, 6.5),
        target: DVec3::new(0.1, -2.1, 0.2),
        up: DVec3::NEG_Y,
        fov_y_degrees: 42.0,
        near: 0.2,
        width: 256,
        height: 256,
        background: [0.2, 0.5, 0.9, 0.75],
        guard: None,
        lens: None,
        compensated: false,
    };
    agree("whole", &file, &whole);
    // Much of the guitar is beside and behind the eye.
    let near = View {
        eye: DVec3::new(0.5, -0.9, 1.1),
        target: DVec3::new(0.2, -1.5, 0.2),
        up: DVec3::new(0.3, 1.0, 0.2),
        fov_y_degrees: 60.0,
        ..whole
    };
    agree("near", &file, &near);
}

#[test]
fn colours_of_the_third_degree_depend_on_the_eye_as_in_training() {
    let Some(file) = shared_input::find("splats3d/train_3points.ply") else {
        return;
    };
    for (i, gaussian) in read_gaussians(&file).iter().enumerate() {
        let way = [
            DVec3::new(0.1, 0.05, -0.08),
            DVec3::new(-0.02, 0.13, 0.03),
            DVec3::new(0.0, -0.1, 0.12),
        ][i];
        let view = View {
            eye: gaussian.position + way,
            target: gaussian.position,
            up: DVec3::new(0.1, -0.3, 0.8),
            fov_y_degrees: 50.0,
            near: 0.01,
            width: 160,
            height: 128,
            background: [0.0; 4],
            guard: None,
            lens: None,
            compensated: false,
        };
        agree(&format!("point {i}"), &file, &view);
    }
}

// ---- Gaussians at random ----

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    /// In [low, high).
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self, low: f64, high: f64) -> [f64; 3] {
        [(); 3].map(|()| self.within(low, high))
    }

    /// Logarithms of standard deviations: ordinary, huge and tiny ones, needles and flakes in turn.
    fn log_scale(&mut self, index: usize) -> [f64; 3] {
        let [long, thin] = [self.within(-2.0, 0.7), self.within(-14.0, -8.0)];
        match index % 5 {
            0 => self.point(-3.5, -1.5),
            1 => self.point(-0.5, 1.2),
            2 => self.point(-16.0, -9.0),
            3 => [thin, long, thin],
            _ => [long, long - 0.7, thin],
        }
    }
}

/// 300 Gaussians about the origin, up to 4 from it along each axis. Every seventh is at the
/// position of the one before it, so that their depths are equal. The columns are not in the usual
/// order.
fn write_random(path: &Path, seed: u64, degree: usize) {
    let mut random = Random(seed);
    let rest = 3 * ((degree + 1) * (degree + 1) - 1);
    let mut names: Vec<String> = ["opacity", "rot_0", "rot_1", "rot_2", "rot_3", "x", "y", "z"]
        .map(String::from)
        .into();
    names.extend((0..rest).map(|i| format!("f_rest_{i}")));
    names.extend(
        [
            "scale_0", "scale_1", "scale_2", "f_dc_0", "f_dc_1", "f_dc_2",
        ]
        .map(String::from),
    );
    let properties: String = names
        .iter()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 300\n{properties}end_header\n"
    )
    .into_bytes();
    let mut position = [0.0; 3];
    for index in 0..300 {
        if index % 7 != 6 {
            position = random.point(-4.0, 4.0);
        }
        let mut row = vec![random.within(-5.0, 9.0)];
        row.extend((0..4).map(|_| random.within(-2.0, 2.0)));
        row.extend(position);
        row.extend((0..rest).map(|_| random.within(-0.4, 0.4)));
        row.extend(random.log_scale(index));
        row.extend(random.point(-2.5, 2.5));
        bytes.extend(row.iter().flat_map(|&value| (value as f32).to_le_bytes()));
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn needles_flakes_and_giants_are_drawn_as_gsplat_draws_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("random.ply");
    for degree in 0..=3 {
        write_random(&file, 7 + degree as u64, degree);
        let among = View {
            eye: DVec3::new(0.4, -0.7, 2.5),
            target: DVec3::new(-0.2, 0.1, -0.3),
            up: DVec3::new(0.2, -1.0, 0.1),
            fov_y_degrees: 55.0,
            near: 0.2,
            width: 256,
            height: 200,
            background: [0.9, 0.1, 0.3, 1.0],
            guard: Some(100.0),
            lens: None,
            compensated: false,
        };
        agree(&format!("among, degree {degree}"), &file, &among);
        let outside = View {
            eye: DVec3::new(9.0, 3.0, -8.0),
            width: 160,
            ..among
        };
        agree(
            &format!("guarded, degree {degree}"),
            &file,
            &View {
                guard: Some(8.0),
                ..among
            },
        );
        agree(&format!("outside, degree {degree}"), &file, &outside);
        let summed = Rules {
            sums_gaussians: true,
            ..Rules::default()
        };
        agree_by(&summed, &format!("summed, degree {degree}"), &file, &among);
        let falling = Rules {
            weights_fall_with_depth: true,
            ..summed
        };
        agree_by(
            &falling,
            &format!("falling, degree {degree}"),
            &file,
            &among,
        );
    }
}

#[test]
fn any_lens_and_compensated_opacities_are_drawn_as_gsplat_draws_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("random.ply");
    write_random(&file, 11, 1);
    let usual = View {
        eye: DVec3::new(0.4, -0.7, 6.5),
        target: DVec3::new(-0.2, 0.1, -0.3),
        up: DVec3::new(0.2, -1.0, 0.1),
        fov_y_degrees: 55.0,
        near: 0.2,
        width: 256,
        height: 200,
        background: [0.9, 0.1, 0.3, 1.0],
        guard: Some(100.0),
        lens: None,
        compensated: false,
    };
    let lens = |focal: [f64; 2], centre: [f64; 2]| View {
        lens: Some([focal, centre]),
        ..usual
    };
    agree("wide pixels", &file, &lens([180.0, 240.0], [128.0, 100.0]));
    agree("high pixels", &file, &lens([240.0, 150.0], [128.0, 100.0]));
    agree(
        "off the middle",
        &file,
        &lens([200.0, 200.0], [90.5, 130.25]),
    );
    agree(
        "a crop, whose axis is beside the picture",
        &file,
        &lens([210.0, 190.0], [-40.0, 250.0]),
    );
    agree(
        "compensated",
        &file,
        &View {
            compensated: true,
            ..usual
        },
    );
    agree(
        "compensated, any lens",
        &file,
        &View {
            compensated: true,
            ..lens([170.0, 240.0], [100.0, 120.0])
        },
    );
}
