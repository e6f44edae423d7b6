//! Prints the difference of each merge rule's picture from `ideal`, and its merges: the tables of
//! docs/book/merging.md and, with --pan, of docs/book/merging-window.md.
//!
//! ```sh
//! cargo run --release --example merge_rules -- [--pan] [SCENE]...
//! ```
//! Without a scene: the check scene, in surface order and in random order. A scene may also be one
//! of the generated `random-shells` and `lone-splats`. `translucent:SCENE` is a scene whose splats
//! have half the opacity and are in random order.
//!
//! With `--pan` the camera turns by a sixteenth of a pixel per frame, and the program prints the
//! share of pixels that jump where `ideal` is still.
//!
//! The figures of a random order depend on the shuffle: at eight layers, 20 shuffles give 42.75 to
//! 44.37 dB. The seed in `tests/programs/glass-spheres-random.json` was chosen so that the rows
//! agree with the published ones, which used another generator.

use glam::{DQuat, DVec3};
use splatsim::accuracy::metrics;
use splatsim::error::Result;
use splatsim::golden::{Group, Merge, Rendering, Rules, ideal, render};
use splatsim::scene::{Overrides, Scene, Splat};
use std::f64::consts::PI;

const SCENES: [&str; 2] = [
    "glass-spheres",
    concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/programs/glass-spheres-random.json"
    ),
];
const LAYERS: [usize; 5] = [2, 3, 4, 6, 8];

/// A column: its name, and the rules with a number of layers.
type Column = (&'static str, fn(usize) -> Rules);

const RULES: [Column; 5] = [
    ("nearest-pair", |layers| Rules {
        layers,
        merge: Merge::NearestPair,
        evict_hidden: false,
        ..Rules::default()
    }),
    ("farthest-pair", |layers| Rules {
        layers,
        evict_hidden: false,
        ..Rules::default()
    }),
    ("farthest-pair + evict-hidden", |layers| Rules {
        layers,
        ..Rules::default()
    }),
    ("interval", |layers| Rules {
        group: Group::Interval,
        ..window(layers)
    }),
    ("window", window),
];

fn window(layers: usize) -> Rules {
    Rules {
        layers,
        group: Group::Window,
        merge: Merge::Window,
        ..Rules::default()
    }
}

/// Names of the columns.
pub fn names() -> impl Iterator<Item = &'static str> {
    RULES.into_iter().map(|(name, _)| name)
}

/// One row: dB against `ideal`, merges in thousands, truncated, and sums in thousands if there are
/// any.
pub fn cells(scene: &Scene, ideal: &Rendering, layers: usize) -> Vec<String> {
    let cell = |(_, rules): Column| {
        let golden = render(scene, &rules(layers));
        let db = metrics(&golden.picture, &ideal.picture)
            .psnr_db
            .map_or("equal".into(), |db| format!("{db:.1}"));
        let [merged, summed] =
            [golden.outcomes.merged, golden.outcomes.summed].map(|count| count / 1000);
        if golden.outcomes.summed > 0 {
            format!("{db} ({merged} + {summed})")
        } else {
            format!("{db} ({merged})")
        }
    };
    RULES.map(cell).to_vec()
}

// ---- Scenes ----

/// A scene by its name.
///
/// # Errors
/// Those of loading a scene.
pub fn scene(name: &str) -> Result<Scene> {
    if let Some(opaque) = name.strip_prefix("translucent:") {
        let mut scene = scene(opaque)?;
        scene
            .splats
            .iter_mut()
            .for_each(|splat| splat.opacity *= 0.5);
        shuffle(&mut scene.splats);
        return Ok(scene);
    }
    match name {
        "random-shells" => made(random_shells(), 0.06, 0.4),
        "lone-splats" => made(lone_splats(), 0.01, 0.15),
        _ => Scene::load(name, &Overrides::default()),
    }
}

/// Splats with the light and the materials of the check scene, 256×256.
fn made(splats: Vec<Splat>, z_threshold: f64, coverage_threshold: f64) -> Result<Scene> {
    let mut scene = Scene::load(
        "glass-spheres",
        &Overrides {
            size: Some((256, 256)),
        },
    )?;
    scene.surface.z_threshold = z_threshold;
    scene.surface.coverage_threshold = coverage_threshold;
    scene.camera.target = DVec3::ZERO;
    scene.camera.fov_y_degrees = 40.0;
    Ok(Scene { splats, ..scene })
}

/// Six glass spheres around each other, in random order.
fn random_shells() -> Vec<Splat> {
    const COLOURS: [[f64; 3]; 6] = [
        [0.9, 0.2, 0.1],
        [0.1, 0.8, 0.2],
        [0.2, 0.3, 0.9],
        [0.9, 0.8, 0.1],
        [0.8, 0.2, 0.8],
        [0.2, 0.8, 0.8],
    ];
    let shell = |(index, rgb): (usize, [f64; 3])| {
        let radius = 1.2 - 0.17 * index as f64;
        let count = (40_000.0 * radius * radius) as usize;
        (0..count).map(move |i| {
            let along = i as f64 + 0.5;
            let polar = libm::acos(1.0 - 2.0 * along / count as f64);
            let azimuth = PI * (1.0 + 5.0_f64.sqrt()) * along;
            let normal = DVec3::new(
                libm::sin(polar) * libm::cos(azimuth),
                libm::sin(polar) * libm::sin(azimuth),
                libm::cos(polar),
            );
            let spacing = radius * (4.0 * PI / count as f64).sqrt();
            Splat {
                position: normal * radius,
                normal,
                radius: spacing,
                rgb,
                opacity: 0.3,
                material: 1,
            }
        })
    };
    let mut splats: Vec<Splat> = COLOURS.into_iter().enumerate().flat_map(shell).collect();
    shuffle(&mut splats);
    splats
}

/// Translucent discs in a box, each a separate surface.
fn lone_splats() -> Vec<Splat> {
    let mut random = Random(5);
    let splat = |_| {
        let mut vector = || DVec3::new(random.next(), random.next(), random.next()) * 2.0 - 1.0;
        let (position, normal, tint) = (vector() * 1.1, vector(), vector());
        let rgb = (tint * 0.4 + 0.5).to_array();
        Splat {
            position,
            normal: normal.try_normalize().unwrap_or(DVec3::Z),
            radius: 0.06,
            rgb,
            opacity: 0.6,
            material: 1,
        }
    };
    (0..3000).map(splat).collect()
}

/// splitmix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below 1.
    fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn shuffle(splats: &mut [Splat]) {
    let mut random = Random(7);
    for last in (1..splats.len()).rev() {
        splats.swap(
            last,
            ((u128::from(random.bits()) * (last as u128 + 1)) >> 64) as usize,
        );
    }
}

// ---- A slow pan ----

/// Frames of a pan.
const FRAMES: usize = 12;
/// The camera turns by this fraction of a pixel per frame.
const STEP_PX: f64 = 1.0 / 16.0;
/// Golden − ideal jumps if it changes by more.
const JUMP: f64 = 4.0 / 255.0;
/// Ideal is still if it changes by less.
const STILL: f64 = 0.5 / 255.0;

/// For each rule: the share of the pixels, in percent, at which golden − ideal jumps from one frame
/// to the next while ideal is still.
pub fn jumps(scene: &Scene, layers: usize) -> Vec<f64> {
    let frames: Vec<Vec<Rendering>> = (0..FRAMES)
        .map(|frame| {
            let mut scene = scene.clone();
            let turn = STEP_PX * frame as f64 / scene.view().focal_px[0];
            let camera = &mut scene.camera;
            camera.target = camera.eye
                + DQuat::from_axis_angle(camera.up.normalize(), turn)
                    * (camera.target - camera.eye);
            let golden = RULES.map(|(_, rules)| render(&scene, &rules(layers)));
            [ideal(&scene)].into_iter().chain(golden).collect()
        })
        .collect();
    let share = |rule: usize| {
        let jumping = |pair: &[Vec<Rendering>]| {
            let pixel = |frame: usize, rule: usize, index: usize| {
                DVec3::from_slice(&pair[frame][rule].picture.rgba[index])
            };
            let jumps = |index: &usize| {
                let change = |rule: usize| pixel(1, rule, *index) - pixel(0, rule, *index);
                change(0).abs().max_element() < STILL
                    && (change(rule) - change(0)).abs().max_element() > JUMP
            };
            (0..pair[0][0].picture.rgba.len()).filter(jumps).count()
        };
        let all = frames[0][0].picture.rgba.len() * (FRAMES - 1);
        100.0 * frames.windows(2).map(jumping).sum::<usize>() as f64 / all as f64
    };
    (1..=RULES.len()).map(share).collect()
}

fn main() -> Result<()> {
    let (options, mut scenes): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|argument| argument == "--pan");
    let pans = !options.is_empty();
    if scenes.is_empty() {
        scenes = SCENES.map(String::from).to_vec();
    }
    println!(
        "| scene | l | {} |",
        names().collect::<Vec<_>>().join(" | ")
    );
    println!("|---|---|{}", "---|".repeat(RULES.len()));
    for name in scenes {
        let mut scene = scene(&name)?;
        let prefix = if name.starts_with("translucent:") {
            "translucent:"
        } else {
            ""
        };
        let called = if name.ends_with("-shells") || name.ends_with("-splats") {
            name.clone()
        } else {
            format!("{prefix}{}", scene.name)
        };
        if pans {
            (scene.image.width, scene.image.height) = (256, 256);
            for layers in [3, 4] {
                let cells: Vec<String> = jumps(&scene, layers)
                    .into_iter()
                    .map(|share| format!("{share:.3} %"))
                    .collect();
                println!("| {called} | {layers} | {} |", cells.join(" | "));
            }
            continue;
        }
        let ideal = ideal(&scene);
        for layers in LAYERS {
            println!(
                "| {called} | {layers} | {} |",
                cells(&scene, &ideal, layers).join(" | ")
            );
        }
    }
    Ok(())
}
