//! Do ticks and replay agree in every number, on any machine and any work?

use crate::frames::Dice;
use crate::scene::Scene;
use crate::ticks::{Ticked, draw};
use crate::{machines, scene};
use rtl_model::machine::timing::Elaborated;
use rtl_model::timing::{Cycles, replay_logged};
use rtl_model::work::Work;

/// The first number in which they differ.
fn difference(ticked: &Ticked, replayed: &Cycles) -> Option<String> {
    for unit in &ticked.units {
        let mut sides: Vec<_> = replayed.units.iter().filter(|other| other.name == unit.name).collect();
        sides.sort_by_key(|side| side.index);
        if sides.len() != unit.sides.len() {
            return Some(format!("{} has {} sides, replayed {}", unit.name, unit.sides.len(), sides.len()));
        }
        if unit.log != sides[0].log {
            let at = unit.log.iter().zip(&sides[0].log).take_while(|(ticked, replayed)| ticked == replayed).count();
            let [ticked, replayed] = [&unit.log, &sides[0].log].map(|log| (log.len(), log.get(at)));
            return Some(format!("{} takes item {at} (of so many, in cycle): ticked {ticked:?}, replayed {replayed:?}", unit.name));
        }
        for (place, (ticked, replayed)) in unit.sides.iter().zip(sides).enumerate() {
            let [ticked, replayed] = [(ticked.items, ticked.account), (replayed.items, replayed.account)];
            if ticked != replayed {
                return Some(format!("{} {place}: ticked {ticked:?}, replayed {replayed:?}", unit.name));
            }
        }
    }
    (ticked.total != replayed.total || ticked.lookups != replayed.lookups)
        .then(|| format!("ticked {} {:?}, replayed {} {:?}", ticked.total, ticked.lookups, replayed.total, replayed.lookups))
}

fn compare(timing: &Elaborated, scene: &Scene, work: &Work) -> Result<Ticked, String> {
    let ticked = draw(timing, scene);
    match difference(&ticked, &replay_logged(timing, work)) {
        Some(difference) => Err(difference),
        None => Ok(ticked),
    }
}

#[test]
fn a_frame_ticks_as_it_is_replayed() {
    let sizes = [([3, 3], 1, 500), ([4, 4], 3, 1000), ([8, 8], 6, 1000), ([20, 20], 12, 1000), ([60, 50], 40, 1500)];
    let mut cycles = 0;
    for (size, splats, cases) in sizes {
        for seed in 0..cases {
            let mut dice = Dice(seed);
            let timing = machines::elaborate(machines::random(&mut dice));
            let mut scene = scene::random(&mut dice, size, splats);
            scene.clear_untouched();
            match compare(&timing, &scene, &scene.record()) {
                Ok(ticked) => cycles += ticked.total,
                Err(difference) => panic!("{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}", timing.timing),
            }
        }
    }
    assert!(cycles > 100_000, "{cycles}");
}
