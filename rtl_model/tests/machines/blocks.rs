//! Is the picture of kept blocks unchanged by a contribution test, and do masks have its results?

use crate::frames::{Rng, ellipsoids};
use crate::mutation::with_format;
use crate::tier;
use rtl_model::Machine;
use rtl_model::frame::{Each, Frame, Sheets};
use rtl_model::machine::{Contribution, Leaders};
use rtl_model::num::{Format, Rounding, Word};
use rtl_model::pipeline::{draw_measured, draw_unobserved, draw_with_decisions};
use rtl_model::probe::Observer;
use rtl_model::records::{Contribution as Fragment, Decision};
use rtl_model::timing::Lists;
use std::any::Any;
use std::collections::BTreeMap;

/// Fragments by splat and pixel: radial index, weight and depth.
type Fragments = BTreeMap<(u32, [u32; 2]), [i64; 3]>;

#[derive(Default)]
struct Seen(Fragments);

impl Observer<'static> for Seen {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(Seen::default())
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        Box::new(self.0)
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        self.0.extend(*seen.downcast::<Fragments>().unwrap());
    }

    fn contribution(&mut self, x: u32, y: u32, fragment: &Fragment, _: Decision) {
        let words = [fragment.radial_index, fragment.weight, fragment.depth];
        self.0.insert((fragment.splat, [x, y]), words);
    }
}

fn fragments(machine: &Machine, frame: &Frame) -> Fragments {
    let mut seen = Seen::default();
    draw_with_decisions(&machine.elaborate().unwrap(), frame, &mut seen);
    seen.0
}

/// Words with few bits or many, in fixed point or not, at random.
fn contribution(rng: &mut Rng) -> Contribution {
    let is_wide = rng.below(2) == 0;
    let mut word = |formats: [&str; 4]| {
        let round =
            [Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven][rng.below(3) as usize];
        let format: Format = formats[if is_wide { 0 } else { rng.below(4) as usize }]
            .parse()
            .unwrap();
        Word::new(format).rounded(round)
    };
    let words = [
        word(["I15F12", "I15F12S11", "I3F0", "I15F12"]),
        word(["U20F6", "U20F6S4", "U3F0", "U20F6"]),
        word(["I21F6", "I21F6S3", "I2F1", "I21F6"]),
        word(["U3F20", "U2F20S4", "U1F1", "U3F20"]),
        word(["I4F20", "I3F20S3", "I1F1", "I4F20"]),
        word(["U20F10", "U6F14S4", "U4F0", "U20F10"]),
    ];
    let [offset, square, product, conic, conic_cross, radial] = words;
    Contribution {
        block_px: [4, 8][rng.below(2) as usize],
        leaders: [Leaders::Corners, Leaders::Diagonal][rng.below(2) as usize],
        offset,
        square,
        product,
        conic,
        conic_cross,
        radial,
    }
}

/// Gaussians of all sizes.
fn machine_and_frame(seed: u64) -> (Machine, Frame) {
    let machine = Machine::named(["gaussian", "fp16"][seed as usize % 2]).unwrap();
    let wildness = [500, 30][seed as usize / 2 % 2];
    let mut frame = ellipsoids(&machine, seed, wildness);
    (frame.width, frame.height) = (150, 110);
    let most = machine.splat.radius.format.max() as i32;
    for (nth, splat) in frame.splats.iter_mut().enumerate() {
        let radius = i64::from(splat.radius);
        let radius = match nth % 3 {
            0 => (radius * 4).clamp(i64::from(most) / 64, i64::from(most)),
            1 => radius / 32,
            _ => radius,
        };
        splat.radius = machine.splat.radius.format.representable(radius) as i32;
    }
    frame.sheets.get_or_insert_with(Sheets::default).each = Each::Splat;
    (machine, frame)
}

/// The words of each fragment are those without the test. In a block, a splat keeps all of its
/// fragments or none, as the bit of its mask is. Masks are those of tiles of any size.
#[test]
fn kept_pixels_are_unchanged() {
    let (mut kept, mut lost) = (0, 0);
    for seed in 0..tier::of([24, 24], 120) as u64 {
        let (machine, frame) = machine_and_frame(seed);
        let contribution = contribution(&mut Rng(seed ^ 0xb10c));
        let tested = Machine {
            contribution: Some(contribution),
            ..machine.clone()
        };
        let (all, own) = (fragments(&machine, &frame), fragments(&tested, &frame));
        let block = |at: [u32; 2]| at.map(|at| at / contribution.block_px);
        let mut blocks: BTreeMap<(u32, [u32; 2]), bool> = BTreeMap::new();
        for ((splat, at), words) in &all {
            let is_kept = own.get(&(*splat, *at));
            assert!(
                is_kept.is_none_or(|own| own == words),
                "seed {seed}: {splat} at {at:?}"
            );
            let of_block = blocks
                .entry((*splat, block(*at)))
                .or_insert(is_kept.is_some());
            assert_eq!(
                *of_block,
                is_kept.is_some(),
                "seed {seed}: {splat} at {at:?}"
            );
        }
        assert!(own.keys().all(|key| all.contains_key(key)), "seed {seed}");
        kept += blocks.values().filter(|is_kept| **is_kept).count();
        lost += blocks.values().filter(|is_kept| !**is_kept).count();

        let built = tested.elaborate().unwrap();
        let (drawing, _, work) = draw_measured(&built, &frame);
        assert!(drawing == draw_unobserved(&built, &frame), "seed {seed}");
        for side_px in [8, 16, 32] {
            let mut other = tested.clone();
            other.timing.tile.side_px = side_px;
            let lists = Lists::new(&other.elaborate().unwrap().timing, &work);
            let across = side_px / contribution.block_px;
            let mut masked = BTreeMap::new();
            for tile in 0..lists.tiles() {
                for (place, nth) in lists.of(tile).iter().enumerate() {
                    let at = [tile % lists.columns, tile / lists.columns];
                    masked.insert((*nth, at.map(|at| at as u32)), lists.mask(tile, place));
                }
            }
            for ((splat, at), is_kept) in &blocks {
                let nth = (work.footprints.iter())
                    .position(|footprint| footprint.splat == *splat)
                    .unwrap();
                let mask = masked[&(nth as u32, at.map(|at| at / across))];
                let [x, y] = at.map(|at| at % across);
                let is_set = mask >> (y * across + x) & 1 == 1;
                assert_eq!(is_set, *is_kept, "seed {seed}: {splat} in block {at:?}");
            }
        }
    }
    assert!(
        kept > 2000 && lost > 60,
        "{kept} blocks are kept, {lost} lost"
    );
}

/// Where r never reaches the cutoff, every block is kept, and the picture is the same.
#[test]
fn a_test_that_keeps_every_block_changes_no_picture() {
    for seed in 0..8 {
        let (machine, frame) = machine_and_frame(seed);
        let mut tested = Machine {
            contribution: Some(contribution(&mut Rng(seed))),
            ..machine.clone()
        };
        tested = with_format(&tested, "contribution.radial", Format::unsigned(0, 3));
        let mut frame = frame;
        // Every leader is compared with the cutoff of the frame.
        frame.ellipsoids.as_mut().unwrap().kernel.reach.clear();
        frame.view.cutoff = frame
            .view
            .cutoff
            .max(machine.raster.cutoff.format.one() * 2);
        let [plain, tested] = [&machine, &tested]
            .map(|machine| draw_unobserved(&machine.elaborate().unwrap(), &frame).frame);
        assert!(plain == tested, "seed {seed}");
    }
}
