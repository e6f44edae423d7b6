//! Are the pictures of the machine still the same, bit for bit? Small versions of the built-in
//! scenes.
//!
//! `tests/pinned/NAME.png` is the picture of `tiny`: a 16-bit PNG, sRGB-encoded for viewing, with a
//! different sample value for each frame word, so that no information is lost.
//! `tests/pinned/hashes.txt` has one hash of the frame words per finer machine.
//!
//! After an intended change of bits: run `SPLATSIM_BLESS=1 cargo test --test suite pinned::`, look
//! at the pictures, and commit them with the reason. A picture that differs is written next to the
//! test's other output; the failure names it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use image::{ImageBuffer, Rgba};
use rtl_model::{Drawing, Machine};
use splatsim::hardware::{fixed, quantise};
use splatsim::output::colour::srgb_encode;
use splatsim::scene::{Overrides, Scene};

/// Built-in scenes and their numbers of splats here. Some splats are several pixels wide, so that
/// every unit has work.
const SCENES: [(&str, usize); 4] = [
    ("glass-spheres", 6000),
    ("checkerboard", 3000),
    ("torus-knot", 2500),
    ("terrain", 4000),
];
const SIZE: (usize, usize) = (96, 72);
/// `resolve.frame` of `tiny` is U1F8.
const TINY_FRAME_FRACTION_BITS: i32 = 8;

fn pinned(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/pinned")
        .join(name)
}

fn blessing() -> bool {
    std::env::var_os("SPLATSIM_BLESS").is_some()
}

/// A built-in scene with its own view, but fewer splats.
fn small(name: &str, count: usize) -> Scene {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("golden_model/src/scene/builtin/{name}.json"));
    let mut scene: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(own).unwrap()).unwrap();
    scene["splats"]["count"] = count.into();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(path.to_str().unwrap(), &Overrides { size: Some(SIZE) }).unwrap()
}

fn draw(machine: &str, scene: &Scene) -> Drawing {
    let machine = Machine::named(machine).unwrap();
    let elaborated = fixed::elaborate(&machine).unwrap();
    fixed::draw(&elaborated, &quantise::quantise(scene, &machine).unwrap())
}

/// The PNG sample of a frame word: colours by the sRGB curve, alpha unchanged. Different words have
/// different samples.
fn sample(word: u32, is_alpha: bool) -> u16 {
    let value = f64::from(word) * f64::from(-TINY_FRAME_FRACTION_BITS).exp2();
    assert!(value <= 1.0, "frame word {word} is brighter than white");
    (65535.0 * if is_alpha { value } else { srgb_encode(value) }).round() as u16
}

type Image = ImageBuffer<Rgba<u16>, Vec<u16>>;

fn viewable(drawing: &Drawing) -> Image {
    Image::from_fn(drawing.width, drawing.height, |x, y| {
        let [r, g, b, a] = drawing.frame[(y * drawing.width + x) as usize];
        Rgba([
            sample(r, false),
            sample(g, false),
            sample(b, false),
            sample(a, true),
        ])
    })
}

/// A sentence about the pixels in which two pictures differ; none if they are equal.
fn difference(drawn: &Image, pinned: &Image) -> Option<String> {
    if drawn.dimensions() != pinned.dimensions() {
        return Some(format!(
            "is {:?} pixels, pinned are {:?}",
            drawn.dimensions(),
            pinned.dimensions()
        ));
    }
    let other = |((x, y, a), b): ((u32, u32, &Rgba<u16>), &Rgba<u16>)| (a != b).then_some((x, y));
    let differing: Vec<(u32, u32)> = drawn
        .enumerate_pixels()
        .zip(pinned.pixels())
        .filter_map(other)
        .collect();
    let (x, y) = *differing.first()?;
    let (a, b) = (drawn.get_pixel(x, y).0, pinned.get_pixel(x, y).0);
    Some(format!(
        "differs at {} pixels, first at ({x}, {y}): {a:?} was {b:?}",
        differing.len()
    ))
}

#[test]
fn tiny_draws_its_pinned_pictures() {
    let mut sentences = Vec::new();
    for (name, count) in SCENES {
        let drawn = viewable(&draw("tiny", &small(name, count)));
        let path = pinned(&format!("{name}.png"));
        if blessing() {
            drawn.save(&path).unwrap();
            continue;
        }
        let pinned = image::open(&path).unwrap().into_rgba16();
        if let Some(sentence) = difference(&drawn, &pinned) {
            let shown = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.png"));
            drawn.save(&shown).unwrap();
            sentences.push(format!("{name} {sentence}; see {}", shown.display()));
        }
    }
    assert!(sentences.is_empty(), "{}", sentences.join("\n"));
}

/// FNV-1a over the frame words, 64 bits.
fn hash(drawing: &Drawing) -> u64 {
    let bytes = drawing
        .frame
        .iter()
        .flatten()
        .flat_map(|word| word.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn the_finer_machines_draw_their_pinned_pictures() {
    let mut drawn = BTreeMap::new();
    for (name, count) in SCENES {
        let scene = small(name, count);
        for machine in ["reference", "lean"] {
            drawn.insert(
                format!("{machine} {name}"),
                format!("{:016x}", hash(&draw(machine, &scene))),
            );
        }
    }
    let text: String = drawn
        .iter()
        .map(|(name, hash)| format!("{name} {hash}\n"))
        .collect();
    let path = pinned("hashes.txt");
    if blessing() {
        std::fs::write(path, text).unwrap();
        return;
    }
    assert_eq!(text, std::fs::read_to_string(path).unwrap());
}

#[test]
fn every_frame_word_of_tiny_has_a_sample_of_its_own() {
    assert_eq!(
        Machine::named("tiny")
            .unwrap()
            .resolve
            .frame
            .format
            .to_string(),
        "U1F8"
    );
    for is_alpha in [false, true] {
        let samples: Vec<u16> = (0..=256).map(|word| sample(word, is_alpha)).collect();
        assert!(samples.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!((samples[0], samples[256]), (0, 65535));
    }
}

#[test]
fn one_changed_word_is_noticed() {
    let drawn = Image::from_pixel(3, 2, Rgba([1, 2, 3, 4]));
    let mut other = drawn.clone();
    assert_eq!(difference(&drawn, &other), None);
    other.put_pixel(2, 1, Rgba([1, 2, 3, 5]));
    assert_eq!(
        difference(&drawn, &other).unwrap(),
        "differs at 1 pixels, first at (2, 1): [1, 2, 3, 4] was [1, 2, 3, 5]"
    );
    assert!(difference(&drawn, &Image::new(2, 3)).is_some());
}
