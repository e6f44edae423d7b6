//! Draws several kinds of splats in one frame (EWA Fig. 16): a head and an engine, with bone as a
//! flattened isosurface and the rest as a volume; and a knot of discs inside shells.
//!
//! ```sh
//! cargo run --release --example mixed -- [FOLDER] [DATA]
//! ```
//! Prints a table and writes `mixed.png`, and a scene of each tile into the same folder. DATA is
//! the folder that contains `volumes` (default `../shared/data`); without it only the knot is
//! drawn. The first two columns are the parts alone, the last is both.

use serde_json::{Value, json};
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::render;
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};

/// Side of a picture, pixels.
const SIDE: usize = 200;

/// A volume's source with additional fields.
fn source(volume: &Value, more: Value) -> Value {
    let mut source = more;
    source["volume"] = volume.clone();
    source
}

/// A case: a name, two sources, and the rest of the scene.
fn subjects(data: &Path) -> Vec<(&'static str, [Value; 2], Value)> {
    let shells = json!({"builtin": "nested-shells", "samples": 72});
    let fog = json!([{"value": 0.1, "rgb": [0.2, 0.4, 1], "opacity": 0}, {"value": 0.25, "rgb": [0.2, 0.5, 1], "opacity": 0.08},
        {"value": 0.5, "rgb": [0.2, 0.9, 0.3], "opacity": 0.1}, {"value": 0.6, "rgb": [0.9, 0.9, 0.3], "opacity": 0}]);
    let knot = json!({"splats": {"builtin": "torus-knot", "count": 40000}, "place": {"scale": 0.11, "axis": [1, 0, 0], "degrees": 70}});
    let view = json!({"eye": [1.4, 1.2, 3.0], "target": [0, 0, 0], "fov_y_degrees": 36});
    let mut subjects = vec![(
        "knot",
        [source(&shells, json!({"transfer": fog})), knot],
        view,
    )];
    let find = |name: &str| data.join(name).canonicalize().ok();
    if let Some(file) = find("volumes/CThead_256x256x113_u16be.raw") {
        // Files of a scene are below its folder: the path goes up to the root, and down again.
        let file = format!("../../../../../../../../../..{}", file.display());
        let head = json!({"file": file, "size": [256, 256, 113], "type": "u16", "endian": "big", "spacing": [1, 1, 2]});
        let skin = json!([{"value": 300, "rgb": [0.95, 0.65, 0.5], "opacity": 0}, {"value": 600, "rgb": [0.95, 0.65, 0.5], "opacity": 0.035},
            {"value": 1000, "rgb": [0.95, 0.5, 0.4], "opacity": 0.03}, {"value": 1100, "rgb": [0.9, 0.5, 0.4], "opacity": 0}]);
        let bone = json!({"isovalue": 1300, "transfer": [{"value": 0, "rgb": [0.95, 0.93, 0.85], "opacity": 1}]});
        let view = json!({"eye": [-160, -420, 90], "target": [127, 127, 105], "up": [0, 0, -1], "fov_y_degrees": 26});
        subjects.push((
            "head",
            [
                source(&head, json!({"transfer": skin})),
                source(&head, bone),
            ],
            view,
        ));
    }
    if let Some(file) = find("volumes/engine_256x256x128_u8.nii") {
        let file = json!(file.to_string_lossy());
        let block = json!([{"value": 60, "rgb": [0.5, 0.65, 0.8], "opacity": 0}, {"value": 110, "rgb": [0.5, 0.65, 0.8], "opacity": 0.02},
            {"value": 160, "rgb": [0.5, 0.65, 0.8], "opacity": 0.03}, {"value": 190, "rgb": [0.5, 0.65, 0.8], "opacity": 0}]);
        let parts = json!({"isovalue": 215, "transfer": [{"value": 0, "rgb": [1, 0.7, 0.3], "opacity": 1}]});
        subjects.push((
            "engine",
            [
                source(&file, json!({"transfer": block})),
                source(&file, parts),
            ],
            json!({"fov_y_degrees": 30}),
        ));
    }
    subjects
}

fn written(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(|error| Error::Job(format!("{}: {error}", path.display())))
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "out".into()));
    let data = PathBuf::from(arguments.next().unwrap_or_else(|| "../shared/data".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    println!("| scene | splats | fixed − golden, dB | golden − ideal, dB |\n|---|---|---|---|");
    let mut tiles = Vec::new();
    for (name, [volume, surface], view) in subjects(&data) {
        for (told, splats) in [
            ("volume", volume.clone()),
            ("surface", surface.clone()),
            ("both", json!([volume, surface])),
        ] {
            let scene = json!({"splats": splats, "camera": view, "image": {"width": SIDE, "height": SIDE, "background": [0.03, 0.04, 0.07, 1]}});
            let path = folder.join(format!("{name}-{told}.json"));
            written(&path, &format!("{scene:#}\n"))?;
            let scene = Scene::load(&path, &Overrides::default())?;
            let machine = machines::load(machines::usual(&scene), &[])?;
            let elaborated = fixed::elaborate(&machine)?;
            let golden = render(&scene, &fixed::rules(&machine)).picture;
            let drawn = fixed::picture(
                &elaborated,
                &fixed::draw(&elaborated, &quantise::quantise(&scene, &machine)?),
            );
            let ideal = splatsim::golden::ideal(&scene).picture;
            let db = |a, b| {
                metrics(a, b)
                    .psnr_db
                    .map_or("equal".into(), |db| format!("{db:.1}"))
            };
            println!(
                "| {name}, {told} | {} | {} | {} |",
                scene.splats.len(),
                db(&drawn, &golden),
                db(&golden, &ideal)
            );
            tiles.push(PictureTile {
                caption: format!("{name}: {told}"),
                picture: drawn,
            });
        }
    }
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        3,
        [SIDE as u32 + 12, SIDE as u32 + 30],
        &folder.join("mixed.png"),
    )
}
