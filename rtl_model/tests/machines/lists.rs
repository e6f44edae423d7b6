//! Which tiles have an entry of a splat?

use crate::frames::{ellipsoids, frame};
use crate::tier;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::{Bin, BinTest};
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{Detail, Lists, replay, replay_all};
use rtl_model::work::{TILE_PX, Work};
use std::collections::BTreeSet;

const TESTS: [BinTest; 3] = [BinTest::Box, BinTest::OrientedBox, BinTest::Ellipse];

fn with_test(machine: &Machine, test: BinTest) -> Machine {
    let bin = Some(Bin {
        test,
        ..Bin::default()
    });
    Machine {
        bin,
        ..machine.clone()
    }
}

/// Splats and recorded tiles in which they keep a pixel.
fn kept(work: &Work) -> BTreeSet<(u32, [usize; 2])> {
    let boxes = work.bins(TILE_PX);
    let mut kept = BTreeSet::new();
    for tile in &work.tiles {
        let at = tile.corner.map(|at| usize::from(at) / TILE_PX);
        let mut reader = tile.reader();
        for nth in boxes.of(at[1] * boxes.columns + at[0]) {
            let [first, last] = work.footprints[*nth as usize].rows.map(usize::from);
            let rows = last.min(at[1] * TILE_PX + TILE_PX - 1) + 1 - first.max(at[1] * TILE_PX);
            let (rows, _) = reader.splat(rows);
            if rows.iter().any(|row| *row != 0) {
                kept.insert((*nth, at));
            }
        }
    }
    kept
}

/// On random frames of discs and ellipsoids, in tiles of any size: every test gives the same
/// picture, no tile with a pixel of a splat is left out, and each test leaves out all that the
/// tests before it leave out. Several machines at a time take the cycles of one.
#[test]
fn tests_of_tiles_leave_out_no_pixel_of_a_frame() {
    let (mut entries, mut replayed) = ([0; 3], 0);
    for seed in 0..tier::of([12, 12], 120) as u64 {
        let names = ["reference", "lean", "tiny", "gaussian", "volume", "window"];
        let mut machine = Machine::named(names[seed as usize % 6]).unwrap();
        let wildness = [500, 30][seed as usize / 6 % 2];
        let mut frame = match machine.ellipse.ellipsoid {
            Some(_) => ellipsoids(&machine, seed, wildness),
            None => frame(&machine, seed, wildness),
        };
        (frame.width, frame.height) = (150, 110);
        // Large thin splats.
        for (nth, splat) in frame
            .splats
            .iter_mut()
            .enumerate()
            .filter(|(nth, _)| nth % 3 > 0)
        {
            splat.radius = (splat.radius * 4).clamp(
                machine.splat.radius.format.max() as i32 / 16 * nth.min(4) as i32,
                machine.splat.radius.format.max() as i32,
            );
        }
        machine.timing.tile.side_px = 16 * (1 + seed as u32 / 2 % 3);
        let side = machine.timing.tile.side_px as usize / TILE_PX;
        let drawn = TESTS.map(|test| {
            let built = with_test(&machine, test).elaborate().unwrap();
            let (drawing, _, work) = draw_measured(&built, &frame);
            (built.timing, drawing, work)
        });
        let mut wider: Option<BTreeSet<(u32, usize)>> = None;
        for (nth, (timing, drawing, work)) in drawn.iter().enumerate() {
            assert!(*drawing == drawn[0].1, "seed {seed}: {:?}", TESTS[nth]);
            assert_eq!(
                work.tested.is_empty(),
                nth == 0 || work.footprints.is_empty()
            );
            let lists = Lists::new(timing, work);
            let listed: BTreeSet<(u32, usize)> = (0..lists.tiles())
                .flat_map(|tile| lists.of(tile).iter().map(move |nth| (*nth, tile)))
                .collect();
            for (splat, [x, y]) in kept(work) {
                let tile = y / side * lists.columns + x / side;
                assert!(
                    listed.contains(&(splat, tile)),
                    "seed {seed}: {splat} in {tile}"
                );
            }
            assert!(
                wider.is_none_or(|wider| listed.is_subset(&wider)),
                "seed {seed}"
            );
            entries[nth] += listed.len();
            wider = Some(listed);
        }
        // Eight machines that differ in a FIFO, on one record.
        let (timing, _, work) = &drawn[2];
        let machines: Vec<Microarchitecture> = (1..9)
            .map(|fifo| {
                let mut other = timing.clone();
                other.raster.fifo = fifo;
                other
            })
            .collect();
        let all = replay_all(&machines.iter().collect::<Vec<_>>(), work, Detail::Accounts);
        for (machine, cycles) in machines.iter().zip(all) {
            assert_eq!(
                replay(machine, work, Detail::Accounts),
                cycles,
                "seed {seed}"
            );
            replayed += cycles.total;
        }
    }
    let [boxes, turned, ellipses] = entries;
    assert!(
        ellipses < turned && 10 * turned < 9 * boxes && replayed > 0,
        "{entries:?} entries"
    );
}
