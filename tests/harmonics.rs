//! Do the bytes, cycles, area and energy of spherical harmonics follow their degree?

use crate::handmade::Rng;
use crate::traced::machine;
use rtl_model::elaboration::Operator;
use rtl_model::machine::timing::Colour;
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{self, Cycles, Detail, Requester};
use rtl_model::work::Work;
use rtl_model::{Elaborated, Machine};
use serde_json::{Value, json};
use splatsim::accuracy::lockstep;
use splatsim::accuracy::metrics;
use splatsim::accuracy::partial::{ChosenWords, MixedDrawing, words};
use splatsim::hardware::fixed;
use splatsim::hardware::machines;
use splatsim::hardware::quantise::quantise;
use splatsim::output::picture::Picture;
use splatsim::performance::cost::{Cost, CostReport, DEFAULT};
use splatsim::scene::digest::digest_of;
use splatsim::scene::{Overrides, Scene};

/// `count` Gaussians with harmonics of a degree, whose coefficients are 0 except the constant ones:
/// the same picture for any degree.
fn scene(count: usize, degree: usize) -> Scene {
    scene_with(count, degree, 0.0, &json!({}))
}

/// The same with other coefficients up to `most`, and further fields of the scene.
fn scene_with(count: usize, degree: usize, most: f64, fields: &Value) -> Scene {
    let mut rng = Rng(7);
    let rest = 3 * ((degree + 1) * (degree + 1) - 1);
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n");
    let names =
        "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"
            .split(' ')
            .map(str::to_owned);
    names
        .chain((0..rest).map(|i| format!("f_rest_{i}")))
        .for_each(|name| text += &format!("property float {name}\n"));
    text += "end_header\n";
    for number in 0..count {
        let place = [(); 3].map(|()| rng.within(1.0));
        let colour = [(); 3].map(|()| rng.within(1.0));
        let own = [
            place.as_slice(),
            &colour,
            &[2.0],
            &[-3.5; 3],
            &[1.0, 0.0, 0.0, 0.0],
            &(0..rest)
                .map(|nth| most * (12.9898 * (nth + 17 * number) as f64).sin())
                .collect::<Vec<f64>>(),
        ]
        .concat();
        text += &own
            .iter()
            .map(|number| format!("{number} "))
            .collect::<String>();
        text += "\n";
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("gaussians.ply"), text).unwrap();
    let file = folder.path().join("scene.json");
    let image = json!({"width": 64, "height": 48});
    std::fs::write(&file, {
        let mut text = json!({"splats": {"file": "gaussians.ply"}, "image": image});
        let own = fields.as_object().unwrap().clone();
        text.as_object_mut().unwrap().extend(own);
        text.to_string()
    })
    .unwrap();
    Scene::load(file, &Overrides::default()).unwrap()
}

/// Costs of a frame.
struct FrameCosts {
    machine: Elaborated,
    work: Work,
    cycles: Cycles,
    words: Vec<[u32; 4]>,
    notes: Vec<String>,
}

fn frame(scene: &Scene, machine: &Machine) -> FrameCosts {
    let elaborated = fixed::elaborate(machine).unwrap();
    let quantised = quantise(scene, machine).unwrap();
    let (drawing, _, work) = draw_measured(&elaborated, &quantised.frame);
    let cycles = timing::replay(&elaborated.timing, &work, Detail::Log);
    FrameCosts {
        machine: elaborated,
        work,
        cycles,
        words: drawing.frame,
        notes: quantised.notes,
    }
}

impl FrameCosts {
    fn bytes(&self) -> u64 {
        self.cycles.memory.bytes[Requester::Splats as usize][0]
    }

    fn colour(&self) -> Option<&timing::UnitCycles> {
        self.cycles.units.iter().find(|unit| unit.name == "colour")
    }
}

#[test]
fn records_are_as_long_as_their_harmonics() {
    let gaussian = machine("gaussian", &["timing.memory.burst_bytes=64"]);
    let frames: Vec<FrameCosts> = (0..4)
        .map(|degree| frame(&scene(300, degree), &gaussian))
        .collect();
    let burst = 64;
    let record = |degree: usize| -> u64 {
        let words = &gaussian.splat;
        let width = |word: rtl_model::num::Word| word.format.width() as u64;
        let axes = gaussian.ellipse.ellipsoid.unwrap();
        let [rgb, coefficients] = [3 * width(words.rgb), 3 * 18 * (degree as u64 + 1).pow(2)];
        let colour = if degree == 0 { rgb } else { coefficients };
        let rest = 3 * width(words.position)
            + 3 * width(words.normal)
            + width(words.radius)
            + width(words.opacity)
            + 8;
        (rest + colour + 4 * width(axes.quaternion) + 3 * width(axes.scale)).div_ceil(8)
    };
    // As in the book.
    assert_eq!([0, 1, 2, 3].map(record), [55, 75, 109, 156]);
    for (degree, frame) in frames.iter().enumerate() {
        assert_eq!(
            u64::from(frame.machine.timing.record_bytes(false, degree as u8)),
            record(degree),
            "{degree}"
        );
        assert_eq!(
            frame.bytes(),
            (300 * record(degree)).div_ceil(burst) * burst,
            "{degree}"
        );
        assert!(
            frame.words == frames[0].words,
            "a picture has changed with the degree"
        );
        assert_eq!(frame.work.harmonics, degree as u8);
    }
    assert!(
        frames
            .windows(2)
            .all(|two| two[0].cycles.total < two[1].cycles.total)
    );
}

#[test]
fn colours_are_worked_out_of_the_splats_that_are_drawn() {
    let gaussian = machine("gaussian", &[]);
    for organisation in ["binned", "immediate"] {
        // In any order.
        let machine = match organisation {
            "binned" => gaussian.clone(),
            _ => Machine {
                sort: None,
                timing: rtl_model::machine::timing::Timing {
                    organisation: rtl_model::machine::timing::Organisation::Immediate,
                    ..gaussian.timing
                },
                ..gaussian.clone()
            },
        };
        let of = |degree: usize| {
            let mut scene = scene(200, degree);
            scene.ellipsoids.as_mut().unwrap().sorted = organisation == "binned";
            frame(&scene, &machine)
        };
        assert!(
            of(0).colour().is_none(),
            "colours that are there are worked out"
        );
        for (degree, products) in [(1, 18_u32), (2, 39), (3, 67)] {
            let frame = of(degree);
            let colour = frame.colour().unwrap();
            let drawn = frame.work.footprints.len() as u64;
            let interval = u64::from(products.div_ceil(16));
            assert_eq!(
                [colour.items, colour.account.busy],
                [drawn, drawn * interval],
                "{organisation}, degree {degree}"
            );
            assert!(drawn > 100);
            let sum = colour.account.busy
                + colour.account.starved
                + colour.account.blocked
                + colour.account.memory;
            assert_eq!(sum, frame.cycles.total);
        }
    }
}

#[test]
fn fewer_multipliers_take_longer_and_less_area() {
    let scene = scene(400, 3);
    let of = |multipliers: u32| {
        let machine = machine(
            "gaussian",
            &[
                &format!("timing.colour.multipliers={multipliers}"),
                "timing.memory.ideal=true",
            ],
        );
        let frame = frame(&scene, &machine);
        let cost = Cost::new(&frame.machine, &DEFAULT);
        let unit = cost
            .units
            .iter()
            .find(|unit| unit.name == "colour")
            .unwrap()
            .bits;
        (frame.cycles.total, cost.area, unit.multiplier)
    };
    let [one, some, all] = [1, 16, 1000].map(of);
    assert!(
        one.0 > some.0 && some.0 >= all.0,
        "{one:?} {some:?} {all:?}"
    );
    assert!(one.1 < some.1 && some.1 < all.1);
    // The widest products: six of degree 3 by sums of monomials, and those of coefficients by such
    // sums, have more than 18 × 18 bits.
    let mut products: Vec<u64> = (fixed::elaborate(&machine("gaussian", &[])).unwrap().parts)
        .iter()
        .filter(|part| part.unit == "colour")
        .flat_map(|part| match part.operator {
            Operator::Multiplier([a, b]) => vec![(a * b) as u64; part.copies as usize],
            _ => Vec::new(),
        })
        .collect();
    products.sort_unstable_by(|a, b| b.cmp(a));
    assert!(products.len() == 67 && products[66] >= 18 * 18);
    assert_eq!(
        [one.2, some.2, all.2],
        [1, 16, 67].map(|count| products[..count].iter().sum::<u64>())
    );
}

#[test]
fn multipliers_and_energy_follow_the_degree() {
    let products = |degree: u32| -> u32 {
        let elaborated =
            fixed::elaborate(&machine("gaussian", &[&format!("colour.degree={degree}")])).unwrap();
        let colour = elaborated.parts.iter().filter(|part| part.unit == "colour");
        colour
            .filter(|part| matches!(part.operator, Operator::Multiplier(_)))
            .map(|part| part.copies)
            .sum()
    };
    assert_eq!([1, 2, 3].map(products), [18, 39, 67]);
    let gaussian = machine("gaussian", &[]);
    let energies: Vec<_> = (0..4)
        .map(|degree| frame(&scene(300, degree), &gaussian))
        .map(|frame| CostReport::new(&frame.machine, &frame.cycles, &DEFAULT).energy)
        .collect();
    assert!(energies.windows(2).all(|two| two[0].units < two[1].units
        && two[0].dram < two[1].dram
        && two[0].storage < two[1].storage));
    // With degree 0 the unit does nothing: a machine without it takes the same cycles.
    let without = Machine {
        colour: None,
        ..gaussian
    };
    let frame = frame(&scene(300, 0), &without);
    let energy = CostReport::new(&frame.machine, &frame.cycles, &DEFAULT).energy;
    assert!(
        (energy.units / energies[0].units - 1.0).abs() < 1e-9 && energy.dram == energies[0].dram
    );
    assert!(
        (energy.storage / energies[0].storage - 1.0).abs() < 1e-9,
        "{} {}",
        energy.storage,
        energies[0].storage
    );
}

#[test]
fn a_machine_without_the_unit_is_given_colours() {
    let gaussian = machine("gaussian", &[]);
    let without = Machine {
        colour: None,
        ..gaussian.clone()
    };
    let scene_of = |degree| scene_with(100, degree, 0.4, &json!({}));
    let [with, without] = [&gaussian, &without].map(|machine| frame(&scene_of(2), machine));
    // The unit's words differ from colours in f64 by its own errors only.
    let differences = with
        .words
        .iter()
        .flatten()
        .zip(without.words.iter().flatten());
    let most = differences.map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let one = 1 << gaussian.resolve.frame.format.frac_bits;
    assert!((1..one / 1000).contains(&most), "{most} of {one}");
    assert_eq!(
        (without.work.harmonics, without.colour().is_none()),
        (0, true)
    );
    assert_eq!(without.notes, with.notes);
    let colours_alone = frame(&scene(100, 0), &gaussian);
    assert_eq!(without.bytes(), colours_alone.bytes());
    // Files without the unit stay valid.
    let mut value = machines::value(&gaussian);
    value.as_object_mut().unwrap().remove("colour");
    value["ellipse"]["ellipsoid"]
        .as_object_mut()
        .unwrap()
        .remove("reach_bits");
    let old = machines::from_value(&value, "old").unwrap();
    assert_eq!((old.colour, old.timing.colour), (None, None));
    assert_eq!(fixed::elaborate(&old).unwrap().timing.splat_bytes, 55);
    // Omitted timing fields of the unit have their defaults.
    let changed = machine("gaussian", &["timing.colour.units=2"]);
    assert_eq!(
        changed.timing.colour,
        Some(Colour {
            units: 2,
            ..Colour::default()
        })
    );
}

#[test]
fn a_degree_beyond_the_unit_is_refused() {
    let one = machine("gaussian", &["colour.degree=1"]);
    assert!(quantise(&scene(5, 1), &one).is_ok());
    let sentence = quantise(&scene(5, 3), &one).unwrap_err().to_string();
    assert!(
        sentence
            .contains("colour.degree is 1, but its splats have spherical harmonics of degree 3"),
        "{sentence}"
    );
    for (field, misfit) in [
        ("colour.degree=4", "colour.degree is 4: 1 to 3 can be built"),
        (
            "timing.colour.multipliers=0",
            "timing.colour.multipliers is 0",
        ),
    ] {
        let sentence = fixed::elaborate(&machine("gaussian", &[field]))
            .unwrap_err()
            .to_string();
        assert!(sentence.contains(misfit), "{sentence}");
    }
    assert_ne!(
        digest_of(&scene(5, 1)),
        digest_of(&scene(5, 2)),
        "a record of one would be taken for one of the other"
    );
}

/// A machine with the usual words, and one with coarse ones.
fn fine_and_coarse() -> [Machine; 2] {
    let coarse = [
        "colour.coefficient=I3F5",
        "colour.relative=I1F6",
        "colour.direction=I2F5",
        "colour.monomial=I2F4",
        "colour.basis=I3F4",
        r#"colour.root={"table_bits":4,"newton_steps":0,"bits":6}"#,
    ];
    [machine("gaussian", &[]), machine("gaussian", &coarse)]
}

/// The picture is golden's within the bound of every pixel, and the bound is of use.
#[test]
fn a_pixel_is_within_the_bound_of_its_colours() {
    // Also where the axes of the harmonics are turned in the world.
    let turned = json!({"splats": {"splats": {"file": "gaussians.ply"}, "place": {"axis": [1, -2, 0.5], "degrees": 130}}});
    for (fields, degrees) in [(json!({}), 1..4), (turned, 3..4)] {
        for degree in degrees {
            let scene = scene_with(300, degree, 0.4, &fields);
            for (nth, machine) in fine_and_coarse().iter().enumerate() {
                let elaborated = fixed::elaborate(machine).unwrap();
                let quantised = quantise(&scene, machine).unwrap();
                let done = lockstep(&scene, &elaborated, &quantised);
                assert_eq!(
                    (done.violations, done.flips.unexplained),
                    (0, 0),
                    "degree {degree}, machine {nth}"
                );
                let covered: Vec<(f64, f64)> = (done.bound.iter().copied().zip(done.error))
                    .filter(|(bound, _)| *bound > 0.0)
                    .collect();
                assert!(covered.len() > 500, "{}", covered.len());
                let mean = |of: fn(&(f64, f64)) -> f64| {
                    covered.iter().map(of).sum::<f64>() / covered.len() as f64
                };
                let [bound, error] = [mean(|both| both.0), mean(|both| both.1)];
                let [least, most] = [[0.0, 1e-4], [1e-3, 0.1]][nth];
                assert!(
                    (least..most).contains(&error) && bound < 100.0 * error,
                    "degree {degree}, machine {nth}: mean error {error}, mean bound {bound}"
                );
            }
        }
    }
}

/// The words of the unit have errors of their own, and all words together are the machine.
#[test]
fn words_of_the_unit_are_attributed() {
    let scene = scene_with(200, 3, 0.4, &json!({}));
    let [_, coarse] = fine_and_coarse();
    let elaborated = fixed::elaborate(&coarse).unwrap();
    let quantised = quantise(&scene, &coarse).unwrap();
    let drawing = MixedDrawing::new(&scene, &elaborated, &quantised);
    let draw = |chosen: &dyn Fn(&str) -> bool| {
        let words = ChosenWords::new(&elaborated, chosen);
        drawing.fill(&words, &drawing.set_up(&words))
    };
    let all = words(&elaborated);
    let fixed = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
    let none = draw(&|_| false);
    let psnr = |a: &Picture, b: &Picture| metrics(a, b).psnr_db;
    assert!(psnr(&draw(&|_| true), &fixed).is_none_or(|db| db > 90.0));
    for word in [
        "coefficient",
        "relative",
        "root",
        "direction",
        "monomial",
        "basis",
    ] {
        let name = format!("colour.{word}");
        assert!(all.contains(&name), "{all:?}");
        let db = psnr(&draw(&|other| other == name), &none).unwrap();
        assert!((20.0..70.0).contains(&db), "{name}: {db}");
    }
}
