//! Draws a generated curvilinear volume: three vortices twist through a bent pipe, whose grid
//! follows the bend and is finest at the wall.
//!
//! ```sh
//! cargo run --release --example curvilinear -- [FOLDER]
//! ```
//! Writes the field on its grid (`vortices.vts`), as points (`vortices.vtu`) and on an even grid
//! with as many samples (`even.vtr`), a scene for each, and `curvilinear.png`. Prints the
//! difference of each from a grid that is twice as fine in all directions.

use base64::Engine;
use glam::DVec3;
use serde_json::json;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, render};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Samples from the axis to the wall, around, and along the pipe.
const SIZE: [usize; 3] = [22, 56, 80];
/// Radius of the bend; the pipe's own is 1.
const BEND: f64 = 2.0;
/// Angle of the bend.
const TURN: f64 = 0.8 * PI;
/// Minimum distance of a sample from the pipe's axis.
const CORE: f64 = 0.08;
/// Side of a picture, pixels.
const SIDE: usize = 224;

/// Density at a position: vortices, and a layer at the wall.
fn density(place: DVec3) -> f64 {
    let along = place.z.atan2(place.x);
    let (out, up) = (place.x.hypot(place.z) - BEND, place.y);
    let radius = out.hypot(up);
    if radius > 1.0 + 1e-9 || !(0.0..=TURN).contains(&along) {
        return 0.0;
    }
    let vortex = |n: f64| {
        let turn = TAU * n / 3.0 + 3.0 * along;
        let away = (out - 0.5 * turn.cos()).hypot(up - 0.5 * turn.sin());
        (-0.5 * (away / 0.09).powi(2)).exp()
    };
    let wall = 0.3 * (-(1.0 - radius) / 0.05).exp();
    (vortex(0.0) + vortex(1.0) + vortex(2.0)).max(wall)
}

/// Positions of a grid `finer` times as fine, x fastest.
fn pipe(finer: usize) -> ([usize; 3], Vec<DVec3>) {
    let size = SIZE.map(|size| size * finer);
    let part = |i: usize, of: usize| i as f64 / (of - 1) as f64;
    let place = |i: usize, j: usize, k: usize| {
        let radius = 1.0 - (1.0 - CORE) * (1.0 - part(i, size[0])).powf(1.5);
        let (around, along) = (TAU * j as f64 / size[1] as f64, TURN * part(k, size[2]));
        let from_axis = BEND + radius * around.cos();
        DVec3::new(
            from_axis * along.cos(),
            radius * around.sin(),
            from_axis * along.sin(),
        )
    };
    let places = (0..size[2])
        .flat_map(|k| (0..size[1]).flat_map(move |j| (0..size[0]).map(move |i| place(i, j, k))));
    (size, places.collect())
}

/// Coordinates of an even grid around the pipe, with about as many samples as the pipe's grid.
fn even() -> [Vec<f64>; 3] {
    let (low, high) = ([-2.75, -1.0, 0.0], [3.0, 1.0, 3.0]);
    let volume: f64 = (0..3).map(|axis| high[axis] - low[axis]).product();
    let step = (volume / SIZE.iter().product::<usize>() as f64).cbrt();
    [0, 1, 2].map(|axis| {
        (0..=((high[axis] - low[axis]) / step) as usize)
            .map(|i| low[axis] + i as f64 * step)
            .collect()
    })
}

/// An array of 32-bit floats, as base64 after its length.
fn array(name: &str, components: usize, numbers: impl Iterator<Item = f64>) -> String {
    let bytes: Vec<u8> = numbers
        .flat_map(|number| (number as f32).to_le_bytes())
        .collect();
    let whole = [&(bytes.len() as u32).to_le_bytes()[..], &bytes].concat();
    let text = base64::engine::general_purpose::STANDARD.encode(whole);
    format!(
        "<DataArray type=\"Float32\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{text}</DataArray>\n"
    )
}

/// A file of one data set: its samples between a head and a tail.
fn vtk(set: &str, whole: &str, piece: &str, places: &[DVec3], around: &str) -> String {
    let samples = array("density", 1, places.iter().map(|place| density(*place)));
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{set}\" version=\"0.1\" byte_order=\"LittleEndian\">\n<{set} {whole}>\n<Piece {piece}>\n\
         <PointData Scalars=\"density\">\n{samples}</PointData>\n{around}</Piece>\n</{set}>\n</VTKFile>\n"
    )
}

fn extent(size: [usize; 3]) -> String {
    let [x, y, z] = size.map(|size| size - 1);
    format!("Extent=\"0 {x} 0 {y} 0 {z}\"")
}

fn points(places: &[DVec3]) -> String {
    format!(
        "<Points>\n{}</Points>\n",
        array(
            "points",
            3,
            places.iter().flat_map(|place| place.to_array())
        )
    )
}

fn curvilinear(finer: usize) -> String {
    let (size, places) = pipe(finer);
    let extent = extent(size);
    vtk(
        "StructuredGrid",
        &format!("Whole{extent}"),
        &extent,
        &places,
        &points(&places),
    )
}

fn scattered() -> String {
    let (_, places) = pipe(1);
    let cells = "<Cells>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\"></DataArray>\n\
                 <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\"></DataArray>\n\
                 <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\"></DataArray>\n</Cells>\n";
    let piece = format!("NumberOfPoints=\"{}\" NumberOfCells=\"0\"", places.len());
    vtk(
        "UnstructuredGrid",
        "",
        &piece,
        &places,
        &(points(&places) + cells),
    )
}

fn rectilinear() -> String {
    let [x, y, z] = &even();
    let places: Vec<DVec3> = z
        .iter()
        .flat_map(|z| {
            y.iter()
                .flat_map(move |y| x.iter().map(move |x| DVec3::new(*x, *y, *z)))
        })
        .collect();
    let axes = [x, y, z].map(|axis| array("axis", 1, axis.iter().copied()));
    let extent = extent([x.len(), y.len(), z.len()]);
    vtk(
        "RectilinearGrid",
        &format!("Whole{extent}"),
        &extent,
        &places,
        &format!("<Coordinates>\n{}</Coordinates>\n", axes.concat()),
    )
}

/// The scene of a file: the same layer on any grid.
fn scene(file: &str) -> String {
    let scene = json!({
        "splats": {
            "volume": file,
            "layer": 0.05,
            "transfer": [
                {"value": 0.04, "rgb": [0.25, 0.45, 0.9], "opacity": 0}, {"value": 0.3, "rgb": [0.25, 0.45, 0.9], "opacity": 0.05},
                {"value": 0.4, "rgb": [1, 0.5, 0.12], "opacity": 0.1}, {"value": 1, "rgb": [1, 0.75, 0.3], "opacity": 0.7},
            ],
        },
        "materials": [{"ambient": 0.45, "diffuse": 0.6, "specular": 0.1, "shininess": 20}],
        "lights": [{"direction": [0.3, 1, 0.6]}],
        "camera": {"eye": [0.4, 5.6, 6.4], "target": [0.2, -0.2, 1.2], "fov_y_degrees": 43},
        "image": {"width": SIDE, "height": SIDE, "background": [0.02, 0.03, 0.06, 1]},
    });
    let mut text = String::new();
    let _ = writeln!(text, "{scene:#}");
    text
}

fn written(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(|error| Error::Job(format!("{}: {error}", path.display())))
}

fn drawn(folder: &Path, name: &str, end: &str, file: &str) -> Result<(Picture, usize)> {
    written(&folder.join(format!("{name}.{end}")), file)?;
    let path = folder.join(format!("{name}-{end}.json"));
    written(&path, &scene(&format!("{name}.{end}")))?;
    let scene = Scene::load(&path, &Overrides::default())?;
    Ok((
        render(&scene, &Rules::default()).picture,
        scene.splats.len(),
    ))
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let (reference, _) = drawn(&folder, "finer", "vts", &curvilinear(2))?;
    println!("| | samples that are seen | dB against a grid twice as fine |\n|---|---|---|");
    let mut tiles = Vec::new();
    for (told, name, end, file) in [
        ("curvilinear grid", "vortices", "vts", curvilinear(1)),
        ("the same samples as points", "vortices", "vtu", scattered()),
        ("even grid, as many samples", "even", "vtr", rectilinear()),
    ] {
        let (picture, seen) = drawn(&folder, name, end, &file)?;
        let db = metrics(&picture, &reference)
            .psnr_db
            .map_or("equal".into(), |db| format!("{db:.1}"));
        println!("| {told} | {seen} | {db} |");
        tiles.push(PictureTile {
            caption: format!("{told}: {db} dB"),
            picture,
        });
    }
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        tiles.len(),
        [SIDE as u32 + 12, SIDE as u32 + 30],
        &folder.join("curvilinear.png"),
    )
}
