//! Reflection: does a mirror show its environment, is a finer map more accurate, does the machine
//! stay within its bound, and is a broken environment picture refused?

use crate::handmade::{self, Rng, thinned};
use crate::program::PROGRAM;
use assert_cmd::Command;
use glam::DVec3;
use rtl_model::Machine;
use rtl_model::machine::timing::Environment;
use rtl_model::machine::{FunctionUnit, Sight};
use rtl_model::num::{Format, Overflow, Rounding, Word};
use rtl_model::timing::{self, Cycles, Detail, Requester};
use serde_json::{Value, json};
use splatsim::accuracy::partial::{ChosenWords, MixedDrawing};
use splatsim::accuracy::{Lockstep, lockstep, metrics};
use splatsim::golden::{self, Reflection, Rules};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::picture::Picture;
use splatsim::performance::cost::{Cost, Prices};
use splatsim::run::explain;
use splatsim::scene::{Overrides, Scene};
use std::path::Path;

/// The machine of the book's chapter.
fn mirror(sight: Sight) -> Machine {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/reflection/mirror.json"
    );
    let mut machine = machines::load(path, &[]).unwrap();
    machine.reflect.as_mut().unwrap().sight = sight;
    machine
}

/// The book's spheres, reduced to every n-th splat.
fn spheres(size: (usize, usize)) -> Scene {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/reflection/spheres.json"
    );
    thinned(
        Scene::load(path, &Overrides { size: Some(size) }).unwrap(),
        2000,
    )
}

fn drawn(scene: &Scene, machine: &Machine) -> Picture {
    let elaborated = fixed::elaborate(machine).unwrap();
    fixed::picture(
        &elaborated,
        &fixed::draw(&elaborated, &quantise::quantise(scene, machine).unwrap()),
    )
}

fn in_lockstep(scene: &Scene, machine: &Machine) -> Lockstep {
    lockstep(
        scene,
        &fixed::elaborate(machine).unwrap(),
        &quantise::quantise(scene, machine).unwrap(),
    )
}

/// Decibels; 200 for equal pictures.
fn psnr(a: &Picture, b: &Picture) -> f64 {
    metrics(a, b).psnr_db.unwrap_or(200.0)
}

/// Light of a smooth sky, by direction.
fn smooth(direction: DVec3) -> [f64; 3] {
    let d = direction.normalize();
    [
        0.5 + 0.4 * d.x,
        0.5 + 0.3 * d.y - 0.1 * d.z,
        0.4 + 0.3 * (d.x * d.y),
    ]
}

/// A Radiance or EXR picture of it, latitude-longitude by its definition: up is y, the middle
/// column looks along −z, and +x is to the right of it.
fn write_smooth(path: &Path, height: u32) {
    let picture = image::Rgb32FImage::from_fn(2 * height, height, |column, row| {
        let turn = (f64::from(column) + 0.5) / f64::from(height) * std::f64::consts::PI;
        let down = (f64::from(row) + 0.5) / f64::from(height) * std::f64::consts::PI;
        // A turn of 0 is the left edge, behind the eye: +z.
        let direction = DVec3::new(
            -down.sin() * turn.sin(),
            down.cos(),
            down.sin() * turn.cos(),
        );
        image::Rgb(smooth(direction).map(|light| light as f32))
    });
    image::DynamicImage::from(picture).save(path).unwrap();
}

/// A scene file, with a picture of a smooth sky: mirrors with different tilts, seen from the origin
/// along −z.
fn tilted(folder: &Path, picture: &str, reflect: f64, tint: [f64; 3]) -> Scene {
    let path = folder.join("tilted.json");
    let normals = [
        [0.0, 0.0, 1.0],
        [0.3, 0.1, 1.0],
        [-0.5, 0.4, 1.0],
        [0.2, -0.8, 1.0],
    ];
    let splats: Vec<Value> = normals
        .iter()
        .enumerate()
        .map(|(nth, normal)| {
            let position = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]][nth];
            json!({"position": [position[0], position[1], -2.0], "normal": normal, "radius": 0.12, "rgb": [0.2, 0.4, 0.6]})
        })
        .collect();
    let scene = json!({
        "splats": splats, "camera": {"eye": [0, 0, 0], "target": [0, 0, -1]}, "image": {"width": 32, "height": 32}, "kernel": {"low_pass": 0},
        "surface": {"z_threshold": 0.5, "coverage_threshold": 1e-3}, "environment": {"file": picture},
        "materials": [{"unlit": true, "reflect": reflect, "tint": tint}],
    });
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(&path, &Overrides::default()).unwrap()
}

/// The expected colour of each pixel: the splat's normal, the pixel's ray, the sky's formula.
#[test]
fn ideal_shows_the_reflection_by_its_normal() {
    let folder = tempfile::tempdir().unwrap();
    for picture in ["sky.hdr", "sky.exr"] {
        write_smooth(&folder.path().join(picture), 256);
        let (reflect, tint) = (0.75, [1.0, 0.5, 0.25]);
        let scene = tilted(folder.path(), picture, reflect, tint);
        let picture = golden::ideal(&scene).picture;
        let focal = 16.0 / (22.5f64).to_radians().tan();
        let mut seen = 0;
        for (at, rgba) in picture
            .rgba
            .iter()
            .enumerate()
            .filter(|(at, _)| picture.covered[*at])
        {
            let [x, y] = [at % 32, at / 32].map(|place| place as f64 + 0.5 - 16.0);
            // Pictures have y down, and the camera looks along −z.
            let ray = DVec3::new(x / focal, -y / focal, -1.0);
            let splat = scene.splats.iter().min_by(|a, b| {
                let off = |p: DVec3| (p / -p.z - ray).length();
                off(a.position).total_cmp(&off(b.position))
            });
            let normal = splat.unwrap().normal;
            let light = smooth(ray - 2.0 * ray.dot(normal) * normal);
            for i in 0..3 {
                let expected =
                    rgba[3] * ((1.0 - reflect) * [0.2, 0.4, 0.6][i] + reflect * tint[i] * light[i]);
                assert!(
                    (rgba[i] - expected).abs() < 0.01,
                    "{x} {y}: {rgba:?} for {expected} in channel {i}"
                );
            }
            seen += 1;
        }
        assert!(seen > 40, "{seen} pixels");
    }
}

#[test]
fn a_finer_map_comes_nearer_to_the_surroundings() {
    let scene = spheres((64, 64));
    let ideal = golden::render(&scene, &Rules::default()).picture;
    let error = |index_bits: u32, by_ray: bool| {
        let rules = Rules {
            reflection: Some(Reflection { index_bits, by_ray }),
            ..Rules::default()
        };
        psnr(&golden::render(&scene, &rules).picture, &ideal)
    };
    let by_bits = [2, 4, 6].map(|bits| error(bits, true));
    assert!(
        by_bits[0] + 3.0 < by_bits[1] && by_bits[1] + 3.0 < by_bits[2] && by_bits[2] > 40.0,
        "{by_bits:?} dB"
    );
    assert!(
        error(6, false) + 6.0 < by_bits[2],
        "{} dB along the axis, {} along rays",
        error(6, false),
        by_bits[2]
    );
}

#[test]
fn no_pixel_exceeds_its_bound() {
    let scene = spheres((48, 40));
    for sight in [Sight::Ray, Sight::Axis] {
        let Lockstep {
            violations,
            flips,
            bound,
            ..
        } = in_lockstep(&scene, &mirror(sight));
        assert_eq!((violations, flips.unexplained), (0, 0), "{sight:?}");
        assert!(
            bound.iter().any(|bound| *bound > 0.0 && *bound < 0.1),
            "{sight:?}: nothing is known"
        );
    }
}

/// Words, down to those that hold little more than 1.
fn random(rng: &mut Rng) -> Machine {
    let mut machine = mirror(if rng.roll() < 0.5 {
        Sight::Ray
    } else {
        Sight::Axis
    });
    let mut roll = |most: f64| (rng.roll() * most) as i32;
    let mut word = |signed: bool| Word {
        format: Format::fixed_point(
            signed,
            if signed { 2 + roll(2.0) } else { 1 + roll(2.0) },
            roll(13.0),
        ),
        round: [Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven][roll(3.0) as usize],
        overflow: Overflow::Saturate,
    };
    let m = machine.reflect.as_mut().unwrap();
    for signed in m.slope.iter_mut().chain([&mut m.facing, &mut m.direction]) {
        *signed = word(true);
    }
    for unsigned in [
        &mut m.coordinate,
        &mut m.fraction,
        &mut m.light,
        &mut m.reflectance,
    ] {
        *unsigned = word(false);
    }
    m.index_bits = 1 + roll(6.0) as u32;
    let bits = 4 + roll(14.0) as u32;
    m.reciprocal = FunctionUnit {
        table_bits: 1 + roll(f64::from(bits.min(8))) as u32,
        newton_steps: roll(3.0) as u32,
        bits,
    };
    machine
}

/// With all words in their formats, mixed precision equals the machine.
#[test]
fn random_mirrors_keep_within_their_bounds_and_are_known_word_by_word() {
    let scene = spheres((28, 24));
    let rng = &mut Rng(7);
    for nth in 0..12 {
        let machine = random(rng);
        let words = serde_json::to_string(&machine.reflect).unwrap();
        let elaborated = machine
            .elaborate()
            .unwrap_or_else(|errors| panic!("{words}: {errors:?}"));
        let quantised = quantise::quantise(&scene, &machine).unwrap();
        let Lockstep {
            violations, flips, ..
        } = lockstep(&scene, &elaborated, &quantised);
        assert_eq!(
            (violations, flips.unexplained),
            (0, 0),
            "machine {nth}: {words}"
        );
        let stage = MixedDrawing::new(&scene, &elaborated, &quantised);
        let choice = ChosenWords::new(&elaborated, |_| true);
        let all = stage.fill(&choice, &stage.set_up(&choice));
        let fixed = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
        let different = all
            .rgba
            .iter()
            .zip(&fixed.rgba)
            .filter(|(all, fixed)| all != fixed)
            .count();
        assert_eq!(different, 0, "machine {nth}: {words}");
        let none = ChosenWords::new(&elaborated, |_| false);
        let golden = golden::render(&scene, &fixed::rules(&machine)).picture;
        let psnr = psnr(&stage.fill(&none, &stage.set_up(&none)), &golden);
        assert!(
            psnr > 100.0,
            "machine {nth} without words is {psnr} dB from golden: {words}"
        );
    }
}

/// A machine that can mirror draws scenes without mirrors unchanged, and one that cannot refuses
/// scenes with mirrors.
#[test]
fn nothing_changes_where_nothing_is_mirrored() {
    let plain = handmade::confetti(200, 3);
    let without = Machine {
        reflect: None,
        ..mirror(Sight::Ray)
    };
    assert_eq!(drawn(&plain, &without), drawn(&plain, &mirror(Sight::Ray)));
    let scene = spheres((16, 16));
    let refused = quantise::quantise(&scene, &without)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("has no `reflect`"), "{refused}");
    // Splats of a material that does not mirror, among others that do.
    let with = drawn(&scene, &mirror(Sight::Axis));
    let dull = drawn(
        &Scene {
            environment: None,
            ..scene.clone()
        },
        &without,
    );
    let same = with
        .rgba
        .iter()
        .zip(&dull.rgba)
        .filter(|(a, b)| a == b)
        .count();
    assert!(
        same > 64 && same < 256,
        "{same} pixels are as without surroundings"
    );
}

#[test]
fn a_mirror_costs_area_and_cycles() {
    let cost =
        |machine: &Machine| Cost::new(&fixed::elaborate(machine).unwrap(), &Prices::default());
    let of = |machine: &Machine| {
        cost(machine)
            .units
            .into_iter()
            .find(|unit| unit.name == "reflect")
    };
    let without = Machine {
        reflect: None,
        ..mirror(Sight::Ray)
    };
    assert!(of(&without).is_none());
    let [ray, axis] = [Sight::Ray, Sight::Axis].map(|sight| of(&mirror(sight)).unwrap());
    // 64 × 64 texels of three words of 11 bits, and the 256 initial approximations of the
    // reciprocal.
    assert_eq!(ray.bits.rom, 64 * 64 * 3 * 11 + 256 * 16);
    assert!(ray.bits.multiplier > axis.bits.multiplier && ray.area > axis.area);
    let latency = |machine: &Machine| fixed::elaborate(machine).unwrap().timing.shade.latency;
    assert!(
        latency(&mirror(Sight::Ray)) >= latency(&mirror(Sight::Axis))
            && latency(&mirror(Sight::Axis)) > latency(&without)
    );
    // Everything else costs the same.
    let rest = |machine: &Machine| {
        cost(machine)
            .units
            .into_iter()
            .filter(|unit| !["reflect", "shade"].contains(&unit.name))
            .collect::<Vec<_>>()
    };
    assert_eq!(rest(&mirror(Sight::Ray)), rest(&without));
    let mut cache_alone = without;
    cache_alone.timing.environment = Some(Environment::default());
    assert!(cache_alone.elaborate().unwrap_err()[0].contains("no `reflect` that uses one"));
}

/// From memory the bits are the same as from a table. The area of a cache replaces that of the
/// table, its look-ups add to the latency and its lines to the traffic; a table is loaded before
/// the frame.
#[test]
fn a_map_in_memory_draws_the_same_picture_and_its_reads_are_counted() {
    let scene = spheres((48, 48));
    let on_chip = mirror(Sight::Ray);
    let behind = |lines: u32| {
        let mut machine = on_chip.clone();
        machine.timing.environment = Some(Environment {
            lines,
            ..Environment::default()
        });
        machine
    };
    let drawn = |machine: &Machine| {
        let elaborated = fixed::elaborate(machine).unwrap();
        let (drawing, _, work) =
            fixed::draw_measured(&elaborated, &quantise::quantise(&scene, machine).unwrap());
        let cycles = timing::replay(&elaborated.timing, &work, Detail::Accounts);
        let bytes = cycles.memory.bytes[Requester::Environment as usize];
        (
            fixed::picture(&elaborated, &drawing).rgba,
            cycles,
            bytes,
            elaborated,
        )
    };
    let (table, loaded, all, elaborated) = drawn(&on_chip);
    let (small, few, of_few, _) = drawn(&behind(4));
    let (large, many, of_many, cached) = drawn(&behind(64));
    assert!(table == small && table == large);
    // 64 × 64 texels of five bytes, in bursts of 64.
    assert_eq!(all, [64 * 64 * 5, 0]);
    assert_eq!(loaded.texels, [0; 2]);
    // Lines of 16 texels occupy two bursts each, or 1.25.
    let read = |[lookups, hits]: [u64; 2]| lookups - hits;
    assert!(
        read(few.texels) > read(many.texels)
            && read(many.texels) > 0
            && few.texels[0] == many.texels[0]
    );
    assert!(
        (read(many.texels) * 128..=read(many.texels) * 192).contains(&of_many[0])
            && of_few[0] > of_many[0]
            && of_many[1] == 0
    );
    let waited = |cycles: &Cycles| {
        cycles
            .units
            .iter()
            .filter(|unit| unit.name == "shade")
            .map(|unit| unit.account.memory)
            .sum::<u64>()
    };
    assert!(waited(&few) > waited(&many) && waited(&many) > 0 && waited(&loaded) == 0);
    assert!(few.total > many.total);
    // Only the table of the reciprocal is left; the cache is storage, and its lines need a look-up
    // of tags.
    let rom = |elaborated: &rtl_model::Elaborated| {
        let cost = Cost::new(elaborated, &Prices::default());
        (
            cost.units
                .iter()
                .find(|unit| unit.name == "reflect")
                .unwrap()
                .bits
                .rom,
            cost.memory_bits,
        )
    };
    assert_eq!(rom(&cached).0, 256 * 16);
    assert_eq!(rom(&cached).1 - rom(&elaborated).1, 64 * (16 * 5 * 8 + 32));
    assert!(cached.timing.paths.shade.cycles > elaborated.timing.paths.shade.cycles);
    // Without an environment nothing is read.
    let plain = Scene {
        environment: None,
        ..scene.clone()
    };
    let work = fixed::draw_measured(&cached, &quantise::quantise(&plain, &behind(64)).unwrap()).2;
    assert_eq!(
        timing::replay(&cached.timing, &work, Detail::Accounts)
            .memory
            .bytes[Requester::Environment as usize],
        [0; 2]
    );
}

/// A mirror in the middle of the picture: its ray, the ray's direction, and the look-up, next to
/// golden's.
#[test]
fn explain_prints_the_look_up_of_a_mirror() {
    let scene = spheres((48, 48));
    for sight in [Sight::Ray, Sight::Axis] {
        let machine = mirror(sight);
        let told = (9..42)
            .step_by(9)
            .map(|x| explain::explained(&scene, &machine, [x, 22]).unwrap());
        let told: Vec<_> = told
            .filter_map(|told| Some((told.pixel, told.mirrors?)))
            .collect();
        let same: Vec<_> = told
            .iter()
            .filter(|(_, mirrors)| mirrors.fixed.len() == mirrors.golden.len())
            .collect();
        assert!(same.len() > 1, "{} of {}", same.len(), told.len());
        for (pixel, mirrors) in same {
            for (fixed, golden) in mirrors.fixed.iter().zip(&mirrors.golden) {
                // A decision that flipped moves a normal slightly.
                let near =
                    |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02);
                assert!(
                    near(&fixed.slopes, &golden.slopes) && near(&fixed.share, &golden.share),
                    "{pixel:?}: {fixed:?} {golden:?}"
                );
                assert_eq!(
                    fixed.slopes == [0.0; 2],
                    sight == Sight::Axis,
                    "{pixel:?}: {fixed:?}"
                );
                assert!(
                    near(&fixed.direction, &golden.direction),
                    "{pixel:?}: {fixed:?} {golden:?}"
                );
                assert!(
                    (0..2).all(|i| fixed.texel[i].abs_diff(golden.texel[i]) <= 1),
                    "{pixel:?}: {fixed:?} {golden:?}"
                );
            }
        }
        let text = explain::explain(&scene, &machine, told[0].0).unwrap();
        assert!(
            text.contains("Reflected light of layers") && text.contains("texel"),
            "{text}"
        );
    }
    let plain = Scene {
        environment: None,
        ..scene
    };
    assert!(
        !explain::explain(&plain, &mirror(Sight::Ray), [24, 24])
            .unwrap()
            .contains("Reflected light of layers")
    );
}

/// Slopes are required by a machine that looks up along rays, and by no other.
#[test]
fn along_the_axis_no_slope_is_required() {
    let scene = spheres((16, 16));
    let without = |sight| {
        let mut machine = mirror(sight);
        machine.reflect.as_mut().unwrap().slope = None;
        machine
    };
    assert_eq!(
        drawn(&scene, &without(Sight::Axis)),
        drawn(&scene, &mirror(Sight::Axis))
    );
    let errors = without(Sight::Ray).elaborate().unwrap_err();
    assert_eq!(
        errors,
        ["reflect.sight is `ray`, and it has no word reflect.slope: I2F14 would do"]
    );
}

#[test]
fn elaboration_errors_are_sentences() {
    for (change, part) in [
        (
            json!({"index_bits": 9}),
            "reflect.index_bits is 9: 1 to 8 can be built",
        ),
        (
            json!({"index_bits": 4_000_000_000u32}),
            "1 to 8 can be built",
        ),
        (json!({"direction": "U2F14"}), "reflect.direction"),
        (json!({"light": "I1F10"}), "reflect.light"),
        (json!({"fraction": "U0F8"}), "reflect.fraction"),
        (json!({"coordinate": "U1F40"}), "reflect.coordinate"),
        (
            json!({"environment": {"ways": 64}}),
            "timing.environment has 32 lines in sets of 64",
        ),
        (
            json!({"environment": {"lines": 3}}),
            "timing.environment.lines is 3",
        ),
        (
            json!({"environment": {"line_texels": [128, 1]}}),
            "timing.environment.line_texels[0] is 128: it must be a power of two up to 64",
        ),
        (
            json!({"environment": {"line_texels": [4, 0]}}),
            "timing.environment.line_texels[1] is 0",
        ),
    ] {
        let machine = mirror(Sight::Ray);
        let mut value = serde_json::to_value(&machine).unwrap();
        let of = if change.get("environment").is_some() {
            "timing"
        } else {
            "reflect"
        };
        value[of]
            .as_object_mut()
            .unwrap()
            .extend(change.as_object().unwrap().clone());
        let errors = serde_json::from_value::<Machine>(value)
            .unwrap()
            .elaborate()
            .unwrap_err();
        assert!(
            errors.iter().any(|error| error.contains(part)),
            "{change}: {errors:?}"
        );
    }
}

#[test]
fn broken_surroundings_end_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let grey = |width: u32, height: u32| {
        image::DynamicImage::from(image::Rgb32FImage::from_pixel(
            width,
            height,
            image::Rgb([0.5; 3]),
        ))
    };
    grey(4, 4).to_rgb8().save(file("square.png")).unwrap();
    grey(1, 1).to_rgb8().save(file("one.png")).unwrap();
    grey(8, 4).save(file("sound.exr")).unwrap();
    let mut lacking = image::Rgb32FImage::from_pixel(8, 4, image::Rgb([0.5; 3]));
    lacking.put_pixel(3, 2, image::Rgb([0.1, f32::NAN, 0.2]));
    image::DynamicImage::from(lacking)
        .save(file("nan.exr"))
        .unwrap();
    let mut dark = image::Rgb32FImage::from_pixel(8, 4, image::Rgb([0.5; 3]));
    dark.put_pixel(0, 0, image::Rgb([-1.0, 0.0, 0.0]));
    image::DynamicImage::from(dark)
        .save(file("dark.exr"))
        .unwrap();
    std::fs::write(file("noise.png"), b"no picture").unwrap();
    // A header that promises a hundred million texels in each direction, without any texels.
    std::fs::write(
        file("huge.hdr"),
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 50000000 +X 100000000\n",
    )
    .unwrap();
    std::fs::write(
        file("wide.hdr"),
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n",
    )
    .unwrap();
    let cut = std::fs::read(file("sound.exr")).unwrap();
    std::fs::write(file("cut.exr"), &cut[..cut.len() - 20]).unwrap();
    let splats = json!({"builtin": "torus-knot", "count": 100});
    for (environment, material, part) in [
        (
            json!({"file": "absent.hdr"}),
            json!({"reflect": 1}),
            "cannot be read",
        ),
        (
            json!({"file": "square.png"}),
            json!({"reflect": 1}),
            "4 × 4 texels",
        ),
        (
            json!({"file": "one.png"}),
            json!({"reflect": 1}),
            "1 × 1 texels",
        ),
        (
            json!({"file": "nan.exr"}),
            json!({"reflect": 1}),
            "row 2, column 3",
        ),
        (
            json!({"file": "dark.exr"}),
            json!({"reflect": 1}),
            "row 0, column 0",
        ),
        (
            json!({"file": "noise.png"}),
            json!({"reflect": 1}),
            "not a PNG, Radiance or EXR",
        ),
        (json!({"file": "huge.hdr"}), json!({"reflect": 1}), ""),
        (json!({"file": "wide.hdr"}), json!({"reflect": 1}), ""),
        (
            json!({"file": "cut.exr"}),
            json!({"reflect": 1}),
            "cannot be decoded",
        ),
        (
            json!({"file": "sound.exr", "scale": -1}),
            json!({"reflect": 1}),
            "scale",
        ),
        (
            json!({"builtin": "cellar"}),
            json!({"reflect": 1}),
            "environment",
        ),
        (
            json!({"builtin": "sky"}),
            json!({"reflect": 1.5}),
            "reflect",
        ),
        (
            json!({"builtin": "sky"}),
            json!({"reflect": 1, "tint": [2, 0, 0]}),
            "tint",
        ),
        (Value::Null, json!({"reflect": 0.5}), "no `environment`"),
    ] {
        let mut scene = json!({"splats": splats, "materials": [material]});
        if !environment.is_null() {
            scene["environment"] = environment.clone();
        }
        std::fs::write(file("scene.json"), scene.to_string()).unwrap();
        let error = Scene::load(file("scene.json"), &Overrides::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(part) && !error.contains('\n') && error.len() < 500,
            "{environment} {material}: {error}"
        );
    }
    std::fs::write(
        file("scene.json"),
        json!({"splats": splats, "materials": [{"reflect": 1}], "environment": {"file": "sound.exr"}}).to_string(),
    )
    .unwrap();
    Scene::load(file("scene.json"), &Overrides::default()).unwrap();
    // On a machine without mirrors: status 2, one sentence, and no output.
    let out = file("out");
    let output = Command::new(&*PROGRAM)
        .args(["run"])
        .arg(file("scene.json"))
        .args(["--size", "16x16", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert_eq!(
        output.status.code(),
        Some(2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(String::from_utf8_lossy(&output.stderr).contains("has no `reflect`") && !out.exists());
}
