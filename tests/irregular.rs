//! Irregular volumes: is an evenly spaced grid the volume that it is, do curvilinear kernels have the variance of their cells, does the
//! machine draw both, and is a broken file told of?

use assert_cmd::Command;
use glam::DVec3;
use rtl_model::Machine;
use serde_json::{Value, json};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::golden::{self, Rules};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};

const SIZE: [usize; 3] = [9, 8, 7];
const COUNT: usize = SIZE[0] * SIZE[1] * SIZE[2];

fn index(i: usize) -> [usize; 3] {
    [i % SIZE[0], i / SIZE[0] % SIZE[1], i / SIZE[0] / SIZE[1]]
}

/// Waves in [0, 1], one sample in seven below what is seen.
fn value(i: usize) -> f32 {
    let [x, y, z] = index(i).map(|at| at as f64);
    if i.is_multiple_of(7) { 0.0 } else { (0.5 + 0.5 * (0.9 * x + 0.4 * (y * z).sin()).sin()) as f32 }
}

fn text(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|number| format!("{number:?}")).collect::<Vec<_>>().join(" ")
}

fn array(kind: &str, name: &str, components: usize, numbers: impl IntoIterator<Item = f64>) -> String {
    let numbers = text(numbers);
    format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">{numbers}</DataArray>")
}

fn vtk(set: &str, whole: &str, piece: &str, inside: &str) -> String {
    format!("<VTKFile type=\"{set}\"><{set} {whole}><Piece {piece}>{inside}</Piece></{set}></VTKFile>")
}

fn samples() -> String {
    array("Float32", "waves", 1, (0..COUNT).map(|i| f64::from(value(i))))
}

fn extent() -> String {
    let [x, y, z] = SIZE.map(|size| size - 1);
    format!("WholeExtent=\"0 {x} 0 {y} 0 {z}\"")
}

fn vts(point: impl Fn(usize) -> DVec3) -> String {
    let points = array("Float64", "points", 3, (0..COUNT).flat_map(|i| point(i).to_array()));
    vtk("StructuredGrid", &extent(), "", &format!("<PointData>{}</PointData><Points>{points}</Points>", samples()))
}

/// A scene file's text, of a source and the rest as `look` says.
fn scene(source: Value, look: &Value) -> Value {
    let mut scene = look.clone();
    scene["splats"] = source;
    scene
}

fn transfer() -> Value {
    json!([{"value": 0.1, "rgb": [0.1, 0.2, 0.9], "opacity": 0}, {"value": 0.5, "rgb": [0.9, 0.4, 0.1], "opacity": 0.1},
        {"value": 1, "rgb": [0.2, 1, 0.3], "opacity": 0.5}])
}

/// Loads a scene of these files.
fn loaded(files: &[(&str, &[u8])], scene: &Value) -> splatsim::error::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).unwrap());
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(&path, &Overrides::default())
}

fn golden(scene: &Scene) -> Picture {
    golden::render(scene, &Rules::default()).picture
}

fn farthest(a: &Picture, b: &Picture) -> f64 {
    a.rgba.as_flattened().iter().zip(b.rgba.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn check_drawn(picture: &Picture) {
    let covered = picture.covered.iter().filter(|covered| **covered).count();
    assert!(covered * 5 > picture.covered.len(), "{covered} pixels");
}

const SPACING: [f64; 3] = [0.3, 0.5, 0.7];
const ORIGIN: [f64; 3] = [-0.1, 0.2, 1.3];

fn place(i: usize) -> DVec3 {
    let at = index(i);
    DVec3::from_array([0, 1, 2].map(|axis| ORIGIN[axis] + SPACING[axis] * at[axis] as f64))
}

fn even_look() -> Value {
    json!({"camera": {"eye": [5, 6, 9], "target": [1.1, 2, 3.4], "fov_y_degrees": 30}, "image": {"width": 72, "height": 64},
        "lights": [{"direction": [1, 2, 0.5]}], "sheets": {"stop": 0}})
}

/// Samples as a volume, and as each kind of irregular field: a rectilinear grid has its slices, the others come sample by sample, so they
/// are compared in `ideal`, which blends every contribution by itself. Points are told the variances that a grid's spacing makes.
#[test]
fn an_even_grid_is_the_volume_that_it_is() {
    let values: Vec<u8> = (0..COUNT).flat_map(|i| value(i).to_le_bytes()).collect();
    let raw = json!({"file": "x.raw", "size": SIZE, "type": "f32", "spacing": SPACING, "origin": ORIGIN});
    let shown = |volume: Value| {
        let gradient = json!([{"magnitude": 0.1, "factor": 0.4}, {"magnitude": 2, "factor": 1}]);
        json!({"volume": volume, "transfer": transfer(), "gradient": gradient})
    };
    let even = loaded(&[("x.raw", &values)], &scene(shown(raw), &even_look())).unwrap();
    let axes = [0, 1, 2].map(|axis| array("Float64", "axis", 1, (0..SIZE[axis]).map(|i| ORIGIN[axis] + SPACING[axis] * i as f64)));
    let inside = format!("<PointData>{}</PointData><Coordinates>{}</Coordinates>", samples(), axes.concat());
    let vtr = vtk("RectilinearGrid", &extent(), "", &inside);
    let rectilinear = loaded(&[("x.vtr", vtr.as_bytes())], &scene(shown(json!("x.vtr")), &even_look())).unwrap();
    assert_eq!((rectilinear.splats.len(), machines::usual(&rectilinear)), (even.splats.len(), "volume"));
    let picture = golden(&even);
    check_drawn(&picture);
    let apart = farthest(&golden(&rectilinear), &picture);
    assert!(apart < 1e-12, "rectilinear: {apart:e}");
    let curvilinear = loaded(&[("x.vts", vts(place).as_bytes())], &scene(shown(json!("x.vts")), &even_look())).unwrap();
    assert_eq!(machines::usual(&curvilinear), "gaussian");
    let ideal = golden::ideal(&even).picture;
    let apart = farthest(&golden::ideal(&curvilinear).picture, &ideal);
    assert!(apart < 1e-12, "curvilinear: {apart:e}");
    // Points know their neighbours, but no grid: gradients at the border are others, so none is asked for.
    let plain = |volume: Value, more: Value| {
        let mut source = json!({"volume": volume, "transfer": transfer()});
        more.as_object().unwrap().iter().for_each(|(key, value)| source[key] = value.clone());
        let mut look = even_look();
        look["materials"] = json!([{"unlit": true}]);
        scene(source, &look)
    };
    let variance = array("Float64", "v", 3, (0..COUNT).flat_map(|_| SPACING.map(|step| (0.7 * step).powi(2))));
    let points = array("Float64", "points", 3, (0..COUNT).flat_map(|i| place(i).to_array()));
    let inside = format!("<PointData>{}{variance}</PointData><Points>{points}</Points>", samples());
    let vtp = vtk("PolyData", "", &format!("NumberOfPoints=\"{COUNT}\""), &inside);
    let scattered = loaded(&[("x.vtp", vtp.as_bytes())], &plain(json!("x.vtp"), json!({"variance": "v"}))).unwrap();
    let even = loaded(&[("x.vts", vts(place).as_bytes())], &plain(json!("x.vts"), json!({}))).unwrap();
    let apart = farthest(&golden(&scattered), &golden(&even));
    assert!(apart < 1e-12, "points: {apart:e}");
}

/// A piece of a twisted tube: cells get longer outwards and towards one end.
fn twisted(i: usize) -> DVec3 {
    let [x, y, z] = index(i).map(|at| at as f64);
    let (radius, turn) = (0.6 + 0.1 * x + 0.015 * x * x, 0.5 * y + 0.15 * z);
    DVec3::new(radius * turn.cos(), radius * turn.sin(), 0.2 * z + 0.03 * z * z)
}

fn twisted_look() -> Value {
    json!({"camera": {"eye": [3, 2.4, 5], "target": [0, 0.4, 1.1], "fov_y_degrees": 40}, "image": {"width": 64, "height": 56},
        "materials": [{"unlit": true}], "sheets": {"stop": 0}, "kernel": {"low_pass": 0.5}})
}

fn twisted_scene(more: &Value) -> Scene {
    let source = json!({"volume": "x.vts", "transfer": transfer(), "layer": 0.2});
    let mut scene = scene(source, &twisted_look());
    more.as_object().unwrap().iter().for_each(|(key, value)| scene[key] = value.clone());
    loaded(&[("x.vts", vts(twisted).as_bytes())], &scene).unwrap()
}

/// Every sample at every pixel, from the definitions: steps are differences of places, the footprint's variance is that of the kernel
/// times the derivative of the projection, taken as a difference too, and depth along a ray is the sample's volume times what that
/// derivative makes of area.
fn oracle() -> Vec<[f64; 3]> {
    let (eye, target, size) = (DVec3::new(3.0, 2.4, 5.0), DVec3::new(0.0, 0.4, 1.1), [64, 56]);
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let down = forward.cross(right);
    let focal = 28.0 / 20.0_f64.to_radians().tan();
    let pixel = |place: DVec3| {
        let way = place - eye;
        let depth = way.dot(forward);
        [32.0 + focal * way.dot(right) / depth, 28.0 + focal * way.dot(down) / depth]
    };
    let step = |i: usize, axis: usize| {
        let (stride, at) = ([1, SIZE[0], SIZE[0] * SIZE[1]][axis], index(i)[axis]);
        let (low, high) = (if at > 0 { i - stride } else { i }, if at + 1 < SIZE[axis] { i + stride } else { i });
        (twisted(high) - twisted(low)) * if high - low == stride { 1.0 } else { 0.5 }
    };
    let classified = |v: f64| {
        let depth = |opacity: f64| -(1.0 - opacity).ln() / (1.0 - (-2.0_f64).exp());
        let points = [(0.1, [0.1, 0.2, 0.9, depth(0.0)]), (0.5, [0.9, 0.4, 0.1, depth(0.1)]), (1.0, [0.2, 1.0, 0.3, depth(0.5)])];
        let (low, high) = if v < 0.5 { (points[0], points[1]) } else { (points[1], points[2]) };
        let part = ((v - low.0) / (high.0 - low.0)).max(0.0);
        [0, 1, 2, 3].map(|i| low.1[i] + part * (high.1[i] - low.1[i]))
    };
    let mut order: Vec<usize> = (0..COUNT).collect();
    order.sort_by(|a, b| (twisted(*a) - eye).dot(forward).total_cmp(&(twisted(*b) - eye).dot(forward)));
    let mut picture = vec![([0.0; 3], 1.0); size[0] * size[1]];
    for i in order {
        let [r, g, b, depth] = classified(f64::from(value(i)));
        let steps = [0, 1, 2].map(|axis| step(i, axis));
        let h = 1e-5;
        let slope = |axis: usize| {
            let along = |way: DVec3| (pixel(twisted(i) + way * h)[axis] - pixel(twisted(i) - way * h)[axis]) / (2.0 * h);
            DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
        };
        let slopes = [slope(0), slope(1)];
        let v = |a: usize, b: usize| {
            let spread: f64 = steps.iter().map(|step| 0.49 * step.dot(slopes[a]) * step.dot(slopes[b])).sum();
            spread + if a == b { 0.5 } else { 0.0 }
        };
        let determinant = v(0, 0) * v(1, 1) - v(0, 1) * v(0, 1);
        let volume = steps[0].cross(steps[1]).dot(steps[2]).abs();
        let peak = depth * volume / 0.2 * slopes[0].cross(slopes[1]).length() / (std::f64::consts::TAU * determinant.sqrt());
        let centre = pixel(twisted(i));
        for (at, (rgb, through)) in picture.iter_mut().enumerate() {
            let [dx, dy] = [at % size[0], at / size[0]].map(|p| p as f64 + 0.5);
            let [dx, dy] = [dx - centre[0], dy - centre[1]];
            let index = (v(1, 1) * dx * dx - 2.0 * v(0, 1) * dx * dy + v(0, 0) * dy * dy) / determinant;
            if index < 4.0 {
                let after = *through * (-peak * (-0.5 * index).exp()).exp();
                *rgb = [0, 1, 2].map(|c| rgb[c] + (*through - after) * [r, g, b][c]);
                *through = after;
            }
        }
    }
    picture.into_iter().map(|(rgb, _)| rgb).collect()
}

#[test]
fn a_curvilinear_kernel_has_the_variance_of_its_cell() {
    let picture = golden(&twisted_scene(&json!({})));
    check_drawn(&picture);
    let apart = picture.rgba.iter().zip(oracle()).map(|(drawn, rgb)| (0..3).map(|c| (drawn[c] - rgb[c]).abs()).fold(0.0, f64::max));
    // A pixel on a rim may fall to either side.
    let (far, most) = apart.fold((0, 0.0_f64), |(far, most), apart| if apart > 1e-3 { (far + 1, most) } else { (far, most.max(apart)) });
    assert!(far <= 2 && most < 1e-7, "{far} pixels, others {most:e}");
}

/// Points at random, of widths by their density.
fn cloud() -> Scene {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let points: Vec<DVec3> = (0..900).map(|_| DVec3::new(random(), random().powi(2), random())).collect();
    let values = array("Float32", "v", 1, points.iter().map(|p| 0.5 + 0.5 * (5.0 * p.x + 3.0 * p.y).sin()));
    let places = array("Float32", "p", 3, points.iter().flat_map(|p| p.to_array()));
    let inside = format!("<PointData>{values}</PointData><Points>{places}</Points><Cells/>");
    let vtu = vtk("UnstructuredGrid", "", "NumberOfPoints=\"900\"", &inside);
    let look = json!({"image": {"width": 96, "height": 80}, "lights": [{"direction": [1, 2, 3]}]});
    let source = json!({"volume": "x.vtu", "transfer": transfer()});
    loaded(&[("x.vtu", vtu.as_bytes())], &scene(source, &look)).unwrap()
}

#[test]
fn the_machine_draws_them_within_its_bounds() {
    let linear = json!({"sheets": {"opacity": "linear", "stop": 0.1}, "image": {"width": 96, "height": 80}});
    for (name, scene) in [("curvilinear", twisted_scene(&linear)), ("points", cloud())] {
        let machine = Machine::named(machines::usual(&scene)).unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let quantised = quantise::quantise(&scene, &machine).unwrap();
        let golden = golden::render(&scene, &fixed::rules(&machine));
        check_drawn(&golden.picture);
        let drawn = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
        let psnr = metrics(&drawn, &golden.picture).psnr_db.unwrap();
        assert!(psnr > 65.0, "{name}: {psnr}");
        let frame = lockstep(&scene, &elaborated, &quantised);
        assert_eq!((frame.violations, frame.flips.unexplained), (0, 0), "{name}: {:?}", frame.flips);
    }
}

#[test]
fn what_is_wrong_is_said_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, bytes: &[u8], scene: Option<Value>| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let input = scene.map_or(name.to_owned(), |scene| {
            std::fs::write(folder.path().join("s.json"), scene.to_string()).unwrap();
            "s.json".into()
        });
        let run = Command::new(env!("CARGO_BIN_EXE_splatsim")).current_dir(&folder).args(["run", &input, "--out", "out"]).output().unwrap();
        let told = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{name}: {told}");
        assert!(!folder.path().join("out").exists() && told.trim_end().lines().count() == 1 && told.len() < 500, "{name}: {told}");
        told
    };
    let sound = vts(twisted);
    for (broken, word) in [
        (sound.replace("0.0 ", "NaN "), "NaN"),
        (sound[..sound.len() / 2].to_owned(), "numbers"),
        (sound.replace("0 8 0 7", "0 80000 0 70000"), "at most"),
        ("<svg><path d=\"M0 0\"/></svg>".into(), "no <VTKFile>"),
        (sound.replace("StructuredGrid", "PolyData"), "only StructuredGrid"),
        (vts(|_| DVec3::ZERO), "shows nothing of the volume; samples that its transfer function shows have a cell of no volume"),
        (String::new(), "no <VTKFile>"),
    ] {
        let told = run("x.vts", broken.as_bytes(), None);
        assert!(told.contains(word), "{word} is not in: {told}");
    }
    let with = |more: Value| {
        let mut source = json!({"volume": "x.vts"});
        more.as_object().unwrap().iter().for_each(|(key, value)| source[key] = value.clone());
        run("x.vts", sound.as_bytes(), Some(scene(source, &json!({}))))
    };
    assert!(with(json!({"array": "wind"})).contains("no array `wind` in <PointData>; there is waves"));
    assert!(with(json!({"variance": "v"})).contains("`variance` is of points"));
    assert!(with(json!({"isovalue": 0.5})).contains("splats.isovalue is not read of VTR, VTS, VTU and VTP"));
    assert!(with(json!({"layer": 0})).contains("splats.layer is 0"));
    let back = scene(json!({"volume": "x.vts"}), &json!({"sheets": {"order": "back-to-front"}}));
    assert!(run("x.vts", sound.as_bytes(), Some(back)).contains("sorted by depth come front-to-back"));
    let named = scene(json!({"volume": {"builtin": "fuzzy-clouds"}, "array": "x"}), &json!({}));
    assert!(run("x.vts", sound.as_bytes(), Some(named)).contains("splats.array names an array of a file of VTK's"));
}
