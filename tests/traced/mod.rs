//! Small traces, read only by means of the manifest.

#![allow(dead_code, reason = "each test file uses its own part")]

use rtl_model::Machine;
use serde_json::{Value, json};
use splatsim::cosim::trace::{Origin, Window, trace};
use splatsim::hardware::machines;
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a trace in it.
pub struct Traced {
    pub folder: PathBuf,
    pub manifest: Value,
    _kept: TempDir,
}

/// A cloud of discs of all sizes and directions, opaque and translucent, glossy and unlit, in a
/// picture with `side` pixels per side.
pub fn cloud(count: u32, side: u32) -> String {
    let mut state = 9u32;
    let mut next = |from: f64, to: f64| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        from + (to - from) * f64::from(state >> 8) / f64::from(1 << 24)
    };
    let splat = |i: u32| {
        let [position, normal, rgb] = [[-1.2, 1.2], [-1.0, 1.0], [0.0, 1.0]]
            .map(|[from, to]| [(); 3].map(|()| next(from, to)));
        let (radius, opacity) = (
            next(0.02, 0.2),
            if i.is_multiple_of(2) {
                1.0
            } else {
                next(0.1, 0.9)
            },
        );
        let material = i % 2;
        format!(
            r#"{{"position": {position:?}, "normal": {normal:?}, "radius": {radius}, "rgb": {rgb:?}, "opacity": {opacity}, "material": {material}}}"#
        )
    };
    let splats: Vec<String> = (0..count).map(splat).collect();
    format!(
        r#"{{"splats": [{}],
            "camera": {{"eye": [0.9, 0.6, 3.8], "target": [0, 0, 0], "up": [0.1, 1, 0], "fov_y_degrees": 45, "near": 0.1}},
            "image": {{"width": {side}, "height": {side}, "background": [0.2, 0.4, 0.6, 0.5]}},
            "surface": {{"z_threshold": 0.2, "cull_backfaces": true}},
            "materials": [{{"unlit": true}}, {{"ambient": 0.15, "diffuse": 0.8, "specular": 0.3, "shininess": 32}}],
            "lights": [{{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}}, {{"direction": [-1, 0.2, 0.3], "rgb": [0.4, 0.2, 0.1]}}]}}"#,
        splats.join(", ")
    )
}

/// Camera of ellipsoids: some of them are outside, and some partly outside the picture.
fn media(splats: &Value, side: u32, sheets: &Value) -> String {
    let scene = json!({
        "splats": splats,
        "camera": {"eye": [1.0, 0.8, 2.2], "target": [0.1, 0, 0], "fov_y_degrees": 30, "near": 2.2},
        "image": {"width": side, "height": side, "background": [0.2, 0.4, 0.6, 0.5]},
        "surface": {"z_threshold": 0.02},
        "sheets": sheets,
        "lights": [{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}, {"direction": [-1, 0.2, 0.3], "rgb": [0.4, 0.2, 0.1]}],
    });
    scene.to_string()
}

/// A volume with `samples` samples per side: voxels with common axes, shaded before they are drawn,
/// sheet by sheet.
pub fn shells(samples: u32, side: u32, sheets: &Value) -> String {
    let transfer = json!([
        {"value": 0.1, "rgb": [0.2, 0.4, 1], "opacity": 0}, {"value": 0.5, "rgb": [0.2, 0.9, 0.3], "opacity": 0.49929179534464957},
        {"value": 1, "rgb": [1, 0.2, 0.1], "opacity": 0.5407673088982273},
    ]);
    media(
        &json!({"volume": {"builtin": "nested-shells", "samples": samples}, "transfer": transfer}),
        side,
        sheets,
    )
}

/// Gaussians with individual axes, sorted.
pub fn bouquet(count: u32, side: u32, sheets: &Value) -> String {
    media(
        &json!({"gaussians": "bouquet", "count": count}),
        side,
        sheets,
    )
}

/// The same with colours that are harmonics of a degree.
pub fn harmonics(count: u32, side: u32, degree: u8) -> String {
    media(
        &json!({"gaussians": "bouquet", "count": count, "degree": degree}),
        side,
        &json!({}),
    )
}

/// A surface in a volume: flattened voxels with individual axes, grouped by depth.
pub fn isosurface(samples: u32, side: u32) -> String {
    media(
        &json!({"volume": {"builtin": "marschner-lobb", "samples": samples}, "isovalue": 0.5}),
        side,
        &json!({}),
    )
}

/// A machine by name, with changed fields.
pub fn machine(name: &str, settings: &[&str]) -> Machine {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    machines::load(name, &settings).unwrap()
}

/// Traces the scene that a text describes.
pub fn traced(text: &str, machine: &Machine, window: &Window) -> Traced {
    let kept = tempfile::tempdir().unwrap();
    let scene_file = kept.path().join("scene.json");
    std::fs::write(&scene_file, text).unwrap();
    let scene = Scene::load(scene_file.to_str().unwrap(), &Overrides::default()).unwrap();
    let folder = kept.path().join("trace");
    trace(
        &scene,
        Origin {
            text: Some(text),
            ..Origin::default()
        },
        machine,
        window,
        &folder,
    )
    .unwrap();
    let manifest =
        serde_json::from_str(&std::fs::read_to_string(folder.join("manifest.json")).unwrap())
            .unwrap();
    Traced {
        folder,
        manifest,
        _kept: kept,
    }
}

/// Bits of a hexadecimal line.
fn bits(line: &str) -> Vec<bool> {
    line.chars()
        .flat_map(|digit| {
            (0..4)
                .rev()
                .map(move |bit| digit.to_digit(16).unwrap() >> bit & 1 == 1)
        })
        .collect()
}

/// The word at a field's place, bit by bit.
fn word(bits: &[bool], field: &Value) -> i64 {
    let number = |name: &str| field[name].as_u64().unwrap() as usize;
    let (lsb, width) = (number("lsb"), number("width"));
    let field_bits = &bits[bits.len() - lsb - width..bits.len() - lsb];
    let natural = field_bits
        .iter()
        .fold(0i64, |word, bit| word << 1 | i64::from(*bit));
    if field["signed"] == true && field_bits[0] {
        natural - (1 << width)
    } else {
        natural
    }
}

impl Traced {
    /// The manifest's entry for a stream or constant.
    pub fn stream(&self, name: &str) -> &Value {
        let all = ["streams", "constants"]
            .into_iter()
            .flat_map(|list| self.manifest[list].as_array().unwrap());
        all.clone()
            .find(|stream| stream["name"] == name)
            .unwrap_or_else(|| panic!("no stream {name}"))
    }

    /// Its lines.
    pub fn lines(&self, name: &str) -> Vec<String> {
        let text = std::fs::read_to_string(
            self.folder
                .join(self.stream(name)["file"].as_str().unwrap()),
        )
        .unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Its records, each field a word.
    pub fn records(&self, name: &str) -> Vec<Vec<i64>> {
        let fields = self.stream(name)["fields"].as_array().unwrap();
        self.lines(name)
            .iter()
            .map(|line| bits(line))
            .map(|bits| fields.iter().map(|field| word(&bits, field)).collect())
            .collect()
    }

    /// The place of a field in a record.
    pub fn field(&self, name: &str, field: &str) -> usize {
        self.stream(name)["fields"]
            .as_array()
            .unwrap()
            .iter()
            .position(|other| other["name"] == field)
            .unwrap()
    }

    /// Its keys: splat, x, y, slot, parent, flags.
    pub fn keys(&self, name: &str) -> Vec<Vec<i64>> {
        let fields = self.manifest["keys"]["fields"]
            .as_array()
            .unwrap()
            .iter()
            .map(|field| {
                let mut field = field.clone();
                field["signed"] = false.into();
                field
            });
        let fields: Vec<Value> = fields.collect();
        let text = std::fs::read_to_string(
            self.folder
                .join(self.stream(name)["keys"]["file"].as_str().unwrap()),
        )
        .unwrap();
        text.lines()
            .map(bits)
            .map(|bits| fields.iter().map(|field| word(&bits, field)).collect())
            .collect()
    }

    /// Path of a file of the trace.
    pub fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }
}

/// All files of a folder, by name, with their contents.
pub fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.push((
                    path.strip_prefix(folder).unwrap().to_owned(),
                    std::fs::read(&path).unwrap(),
                ));
            }
        }
    }
    all.sort();
    all
}
