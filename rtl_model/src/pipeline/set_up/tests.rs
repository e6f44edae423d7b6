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
        4..9 => (least + (seed / 16 % (most - least + 1) as u64) as i64) / (1 << (seed / 7 % 20)),
        _ => least + (seed / 16 % (most - least + 1) as u64) as i64,
    }
}

/// What both units make of each splat, as far as it counts: why it is culled, or all.
type Results = ([i64; project::OUTPUTS], [i64; ellipse::OUTPUTS]);

fn as_far_as_it_counts((point, disc): Results) -> Vec<i64> {
    let reasons = [point[11], point[12], disc[14], disc[15], disc[16]];
    match reasons.iter().position(|reason| *reason != 0) {
        Some(reason) => vec![reason as i64],
        None => point.into_iter().chain(disc).collect(),
    }
}

/// By the graphs.
fn by_graphs<P: Probe>(stages: &mut Stages, splats: &[Splat], probe: &mut P) -> Vec<Vec<i64>> {
    stages.set_up(splats, 0, None, probe, &mut Block::of(splats.len()));
    let ((project, point), (program, footprint)) = (&stages.project, &stages.footprint);
    let of_splat = |item: usize| {
        let (row, lane) = (item / LANES, item % LANES);
        let of_point = std::array::from_fn(|output| point.row(project, output, row)[lane].into());
        as_far_as_it_counts((of_point, std::array::from_fn(|output| footprint.row(program, output, row)[lane].into())))
    };
    (0..splats.len()).map(of_splat).collect()
}

/// By the host's kernel, each splat in the first lane once.
struct ByKernel<'a, 'p, P>(&'a Elaborated, &'a Frame, &'p mut P);

impl<P: Probe> Kernel for ByKernel<'_, '_, P> {
    type Output = Vec<Vec<i64>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let ByKernel(machine, frame, probe) = self;
        let mut all = Vec::new();
        for given in frame.splats.chunks(LANES) {
            let mut eight = [Splat::default(); LANES];
            eight[..given.len()].copy_from_slice(given);
            let size_px = [frame.width, frame.height];
            machine.discs.set_up::<L::Words, P>(&frame.view, size_px, &eight, &mut Tap::new(&mut *probe).first(given.len()));
            for lane in 0..given.len() {
                eight.rotate_left(lane);
                let (point, disc) = machine.discs.set_up::<L::Words, NoProbe>(&frame.view, size_px, &eight, &mut Tap::new(&mut NoProbe));
                all.push(as_far_as_it_counts((of_point(&point), of_disc(&disc))));
                eight.rotate_right(lane);
            }
        }
        all
    }
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
            near: natural(p.depth) / 256,
            guard: [natural(p.slope), natural(p.slope)],
            focal: natural(p.focal),
            inverse_focal: scaled(natural(m.inverse_focal)),
            centre: [natural(p.pixel) / 16, natural(p.pixel) / 16],
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
        let mut stages = Stages::new(&machine, &frame);
        let mut seen = [Ranges::new(machine.signals.len()), Ranges::new(machine.signals.len())];
        let expected = by_graphs(&mut stages, &frame.splats, &mut seen[0]);
        prop_assert_eq!(&plainly(ByKernel(&machine, &frame, &mut seen[1])), &expected);
        prop_assert_eq!(format!("{:?}", seen[1]), format!("{:?}", seen[0]));
        // With vector instructions; the graphs in rows that were used before.
        prop_assert_eq!(&run::<NoProbe, _>(ByKernel(&machine, &frame, &mut NoProbe)), &expected);
        prop_assert_eq!(&by_graphs(&mut stages, &frame.splats, &mut NoProbe), &expected);
    }
}
