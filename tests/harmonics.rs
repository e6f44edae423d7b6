//! Do the bytes, cycles, area and energy of spherical harmonics follow their degree?

use crate::handmade::Rng;
use crate::traced::machine;
use rtl_model::elaboration::Operator;
use rtl_model::machine::timing::Colour;
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{self, Cycles, Detail, Requester};
use rtl_model::work::Work;
use rtl_model::{Elaborated, Machine};
use serde_json::json;
use splatsim::hardware::fixed;
use splatsim::hardware::machines;
use splatsim::hardware::quantise::quantise;
use splatsim::performance::cost::{Cost, CostReport, DEFAULT};
use splatsim::scene::digest::digest_of;
use splatsim::scene::{Overrides, Scene};

/// `count` Gaussians with harmonics of a degree, whose coefficients are 0 except the constant ones:
/// the same picture for any degree.
fn scene(count: usize, degree: usize) -> Scene {
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
    for _ in 0..count {
        let place = [(); 3].map(|()| rng.within(1.0));
        let colour = [(); 3].map(|()| rng.within(1.0));
        let own = [
            place.as_slice(),
            &colour,
            &[2.0],
            &[-3.5; 3],
            &[1.0, 0.0, 0.0, 0.0],
            &vec![0.0; rest],
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
    std::fs::write(
        &file,
        json!({"splats": {"file": "gaussians.ply"}, "image": image}).to_string(),
    )
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
        let [rgb, coefficients] = [3 * width(words.rgb), 3 * 32 * (degree as u64 + 1).pow(2)];
        let colour = if degree == 0 { rgb } else { coefficients };
        let rest = 3 * width(words.position)
            + 3 * width(words.normal)
            + width(words.radius)
            + width(words.opacity)
            + 8;
        (rest + colour + 4 * width(axes.quaternion) + 3 * width(axes.scale)).div_ceil(8)
    };
    // 55 bytes, and about 236 bytes for degree 3.
    assert_eq!(record(0), 55);
    assert!((230..245).contains(&record(3)), "{}", record(3));
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
            assert!(
                frame
                    .notes
                    .iter()
                    .any(|note| note.contains(&format!("harmonics of degree {degree} in f64"))),
                "{:?}",
                frame.notes
            );
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
    assert_eq!(
        [one.2, some.2, all.2],
        [1, 16, 67].map(|count| count * 24 * 24)
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
    let [with, without] = [&gaussian, &without].map(|machine| frame(&scene(100, 2), machine));
    assert!(with.words == without.words);
    assert_eq!(
        (
            without.work.harmonics,
            without.colour().is_none(),
            without.notes.len()
        ),
        (0, true, with.notes.len() - 1)
    );
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
