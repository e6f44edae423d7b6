use super::*;
use crate::frame::{Aspect, Scaled, View};
use crate::machine::Machine;
use crate::num::Word;
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

/// A word of a format: its ends, 0 and 1 too.
fn word(of: Word, seed: u64) -> i64 {
    let (least, most) = (of.format.min(), of.format.max());
    match seed % 16 {
        0 => least,
        1 => most,
        2 => 0,
        3 => of.format.one().min(most),
        // Small ones, as splats near the middle have them.
        4..9 => (least + (seed / 16 % (most - least + 1) as u64) as i64) >> (seed / 7 % 20),
        _ => least + (seed / 16 % (most - least + 1) as u64) as i64,
    }
}

/// What both units make of each splat, as far as it counts: why it is culled, or all.
fn made<P: Probe>(stages: &mut Stages, splats: &[Splat], probe: &mut P) -> Vec<Vec<i32>> {
    stages.set_up(splats, 0, None, probe, &mut Block::of(splats.len()));
    let ((project, point), (program, footprint)) = (&stages.project, &stages.footprint);
    let of_splat = |item: usize| {
        let (row, lane) = (item / LANES, item % LANES);
        let of_point = (0..project::OUTPUTS).map(|output| point.row(project, output, row)[lane]);
        let of_disc = (0..ellipse::OUTPUTS).map(|output| footprint.row(program, output, row)[lane]);
        let (of_point, of_disc): (Vec<i32>, Vec<i32>) = (of_point.collect(), of_disc.collect());
        let reasons = [of_point[11], of_point[12], of_disc[14], of_disc[15], of_disc[16]];
        match reasons.iter().position(|reason| *reason != 0) {
            Some(reason) => vec![reason as i32],
            None => of_point.into_iter().chain(of_disc).collect(),
        }
    };
    (0..splats.len()).map(of_splat).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn discs_are_set_up_as_their_graphs_say(
        name in prop::sample::select(Machine::NAMES.to_vec()),
        seeds in prop::collection::vec(prop::array::uniform7(any::<u64>()), 1..=BATCH),
        registers in prop::array::uniform32(any::<u64>()),
        has_aspect: bool, cull_backfaces: bool,
    ) {
        let machine = Machine::named(name).unwrap().elaborate().unwrap();
        let (p, m, s) = (machine.machine.project, machine.machine.ellipse, machine.machine.splat);
        let mut seed = registers.into_iter();
        let mut register = |of: Word| word(of, seed.next().unwrap_or(0));
        let rotation = [[(); 3]; 3].map(|row| row.map(|()| register(p.rotation)));
        let eye = [(); 3].map(|()| register(p.eye));
        let mut natural = |of: Word| register(of).max(1);
        let scaled = |mantissa: i64| Scaled { mantissa, places: 9 };
        let view = View {
            rotation,
            eye,
            near: natural(p.depth) >> 8,
            guard: [natural(p.slope), natural(p.slope)],
            focal: natural(p.focal),
            inverse_focal: scaled(natural(m.inverse_focal)),
            centre: [natural(p.pixel) >> 4, natural(p.pixel) >> 4],
            low_pass: natural(m.low_pass),
            cutoff: natural(machine.machine.raster.cutoff),
            root_cutoff: natural(m.root_cutoff),
            aspect: m.aspect.filter(|_| has_aspect).map(|aspect| Aspect {
                focal: [natural(p.focal), natural(p.focal)],
                squares: [natural(aspect), natural(aspect), natural(aspect)],
                inverse_focal: [scaled(natural(m.inverse_focal)), scaled(natural(m.inverse_focal))],
            }),
            cull_backfaces,
        };
        let splats: Vec<Splat> = seeds.iter().map(|seeds| {
            let [x, y, z, n, o, r, radius] = *seeds;
            Splat {
                position: [x, y, z].map(|seed| word(s.position, seed) as i32),
                normal: [n, o, r].map(|seed| word(s.normal, seed) as i32),
                radius: word(s.radius, radius) as i32,
                ..Splat::default()
            }
        }).collect();
        let frame = Frame { width: 640, height: 480, view, splats, ..Frame::default() };
        let (mut kernel, mut graphs) = (Stages::new(&machine, &frame), Stages::new(&machine, &frame));
        graphs.discs = None;
        let mut seen = [Ranges::new(machine.signals.len()), Ranges::new(machine.signals.len())];
        let expected = made(&mut graphs, &frame.splats, &mut seen[0]);
        prop_assert_eq!(&made(&mut kernel, &frame.splats, &mut seen[1]), &expected);
        prop_assert_eq!(format!("{:?}", seen[1]), format!("{:?}", seen[0]));
        // With vector instructions, in rows that were used before.
        prop_assert_eq!(&made(&mut kernel, &frame.splats, &mut NoProbe), &expected);
        prop_assert_eq!(&made(&mut graphs, &frame.splats, &mut NoProbe), &expected);
    }
}
