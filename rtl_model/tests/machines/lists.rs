//! Which tiles have an entry of a splat?

use crate::frames::{ellipsoids, frame};
use crate::tier;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::frame::Frame;
use rtl_model::machine::timing::Organisation;
use rtl_model::machine::{Bin, BinTest, MaskMaker};
use rtl_model::pipeline::{Elaborated, draw_measured};
use rtl_model::timing::{Cycles, Detail, Lists, replay, replay_all};
use rtl_model::work::{TILE_PX, Work};
use std::collections::{BTreeMap, BTreeSet};

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

/// A machine, and a random frame with large thin splats.
fn machine_and_frame(seed: u64) -> (Machine, Frame) {
    let names = ["reference", "lean", "tiny", "gaussian", "volume", "window"];
    let machine = Machine::named(names[seed as usize % 6]).unwrap();
    let wildness = [500, 30][seed as usize / 6 % 2];
    let mut frame = match machine.ellipse.ellipsoid {
        Some(_) => ellipsoids(&machine, seed, wildness),
        None => frame(&machine, seed, wildness),
    };
    (frame.width, frame.height) = (150, 110);
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
    (machine, frame)
}

/// On random frames of discs and ellipsoids, in tiles of any size: every test gives the same
/// picture, no tile with a pixel of a splat is left out, and each test leaves out all that the
/// tests before it leave out. Several machines at a time take the cycles of one.
#[test]
fn tests_of_tiles_leave_out_no_pixel_of_a_frame() {
    let (mut entries, mut replayed) = ([0; 3], 0);
    for seed in 0..tier::of([12, 12], 120) as u64 {
        let (mut machine, frame) = machine_and_frame(seed);
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

/// The mask of a splat in each tile that lists it, by the splat's place and the tile.
fn masks(lists: &Lists) -> BTreeMap<(u32, usize), u64> {
    (0..lists.tiles())
        .flat_map(|tile| {
            (lists.of(tile).iter().enumerate())
                .map(move |(place, nth)| ((*nth, tile), lists.mask(tile, place)))
        })
        .collect()
}

/// Every pixel that a splat keeps, with the splat's place: column and row.
fn kept_pixels(work: &Work) -> Vec<(u32, [usize; 2])> {
    let boxes = work.bins(TILE_PX);
    let mut kept = Vec::new();
    for tile in &work.tiles {
        let [left, top] = tile.corner.map(usize::from);
        let mut reader = tile.reader();
        for nth in boxes.of(top / TILE_PX * boxes.columns + left / TILE_PX) {
            let [first, last] = work.footprints[*nth as usize].rows.map(usize::from);
            let (first, last) = (first.max(top), last.min(top + TILE_PX - 1));
            let (rows, _) = reader.splat(last + 1 - first);
            for (y, row) in (first..).zip(rows) {
                let columns = (0..TILE_PX).filter(|column| row >> column & 1 == 1);
                kept.extend(columns.map(|column| (*nth, [left + column, y])));
            }
        }
    }
    kept
}

/// On random frames of discs and ellipsoids, in tiles of any size: a machine with masks draws the
/// same picture from the same record, every kept pixel is in a set subtile, and with one lane the
/// same pixels reach `gauss` and `fragment`. Its cycles and bytes count the masks.
#[test]
fn masks_change_no_picture_and_lose_no_pixel() {
    let (mut unset, mut seeds, mut dropped, mut pixels) = (0, 0, 0, 0);
    for seed in 0..tier::of([4, 4], 120) as u64 {
        let (mut machine, mut frame) = machine_and_frame(seed);
        if machine.ellipse.ellipsoid.is_none() {
            let more = (1..8).map(|other| machine_and_frame(seed + 120 * other).1);
            frame.splats.extend(more.flat_map(|other| other.splats));
        }
        let subtile_px = [4, 8, 16][seed as usize % 3];
        let side = subtile_px as usize * [1, 3, 2, 4][seed as usize / 3 % 4];
        machine.timing.tile.side_px = side as u32;
        machine.timing.raster.lanes = [1, 1];
        let test = [BinTest::OrientedBox, BinTest::Ellipse][seed as usize / 2 % 2];
        let plain = with_test(&machine, test);
        let mask = |masks, mask_tests| {
            let mut masked = plain.clone();
            masked.bin = Some(Bin {
                test,
                subtile_px: Some(subtile_px),
                masks,
                mask_tests,
                ..Bin::default()
            });
            masked.elaborate().unwrap()
        };
        let plain = plain.elaborate().unwrap();
        let (drawing, _, work) = draw_measured(&plain, &frame);
        let kept = kept_pixels(&work);
        pixels += kept.len();
        let without = replay(&plain.timing, &work, Detail::Accounts);
        let cycles = |masked: &Elaborated| {
            let (own, _, own_work) = draw_measured(masked, &frame);
            assert!(own == drawing && own_work == work, "seed {seed}");
            let lists = Lists::new(&masked.timing, &work);
            let masks = masks(&lists);
            for (nth, [x, y]) in &kept {
                let tile = y / side * lists.columns + x / side;
                let [x, y] = [x, y].map(|at| at % side / subtile_px as usize);
                let bit = y * (side / subtile_px as usize) + x;
                let mask = masks.get(&(*nth, tile));
                assert!(
                    mask.is_some_and(|mask| mask >> bit & 1 == 1),
                    "seed {seed}: splat {nth} in tile {tile}, bit {bit} of {mask:x?}"
                );
            }
            replay(&masked.timing, &work, Detail::Accounts)
        };
        let in_bin = cycles(&mask(None, None));
        let in_list = cycles(&mask(Some(MaskMaker::List), Some(3)));
        let items = |cycles: &Cycles, name: &str| {
            let units = cycles.units.iter().filter(|unit| unit.name == name);
            units.map(|unit| unit.items).sum::<u64>()
        };
        for masked in [&in_bin, &in_list] {
            for name in ["gauss", "fragment", "resolve"] {
                let [own, other] = [masked, &without].map(|cycles| items(cycles, name));
                if !work.stops() {
                    assert_eq!(own, other, "seed {seed}: {name}");
                }
            }
            assert!(masked.stamps[0] <= without.stamps[0], "seed {seed}");
            let counts = masked.tile_tests.unwrap().masks.unwrap();
            assert!(counts.set <= counts.tested, "seed {seed}");
            unset += counts.tested - counts.set;
            seeds += counts.seeds;
            // Raster takes a cycle per stamp, per seed, and per entry without a set subtile.
            let raster = items(masked, "raster");
            let more = raster - masked.stamps[0] - counts.seeds;
            if !work.stops() {
                assert!(more <= items(masked, "list"), "seed {seed}");
            }
            dropped += more;
        }
        // Of the same lists, each entry with a mask of its own is longer; tests take cycles.
        let tests = [&in_bin, &in_list].map(|cycles| cycles.tile_tests.unwrap());
        assert!(tests[0].entries <= tests[1].entries, "seed {seed}");
        assert_eq!(tests[1].entries, without.tile_tests.unwrap().entries);
        let busy = |cycles: &Cycles| {
            let bin = cycles.units.iter().find(|unit| unit.name == "bin").unwrap();
            bin.account.busy
        };
        let tested = tests[0].masks.unwrap().tested;
        let tiles = tests[0].tiles;
        assert_eq!(
            busy(&in_bin),
            busy(&without) - tiles + tested,
            "seed {seed}"
        );
        assert_eq!(busy(&in_list), busy(&without), "seed {seed}");
        let list_cycles = tests[1].masks.unwrap().list_cycles;
        assert!(
            3 * list_cycles >= tests[1].masks.unwrap().tested,
            "seed {seed}"
        );
    }
    assert!(
        unset > 1000 && seeds > 500 && dropped > 0 && pixels > 10_000,
        "{unset} unset, {seeds} seeds, {dropped} dropped, {pixels} pixels"
    );
}

/// An entry has 4 bytes, its mask a byte per 8 subtiles, and in a sort its key.
#[test]
fn entries_hold_their_masks() {
    let machine = Machine::named("gaussian").unwrap();
    let built = |side_px: u32, subtile_px: Option<u32>, masks| {
        let mut machine = machine.clone();
        machine.timing.tile.side_px = side_px;
        machine.timing.memory.burst_bytes = 64;
        machine.bin = Some(Bin {
            test: BinTest::Ellipse,
            subtile_px,
            masks,
            ..Bin::default()
        });
        let timing = machine.elaborate().unwrap().timing;
        [timing.entry_bytes(), timing.sort.unwrap().entry_bytes]
    };
    let [plain, sorted] = built(16, None, None);
    assert_eq!(plain, 4);
    for (side_px, subtile_px, mask_bytes) in [
        (16, 16, 1),
        (16, 8, 1),
        (16, 4, 2),
        (12, 4, 2),
        (32, 4, 8),
        (64, 8, 8),
        (128, 16, 8),
        (48, 16, 2),
    ] {
        let bytes = [plain + mask_bytes, sorted + mask_bytes];
        assert_eq!(built(side_px, Some(subtile_px), None), bytes);
        let of_list = built(side_px, Some(subtile_px), Some(MaskMaker::List));
        assert_eq!(of_list, [plain, sorted]);
    }
}

/// Each error is one sentence.
#[test]
fn masks_that_cannot_be_are_refused() {
    type Change = fn(&mut Machine, &mut Bin);
    let changes: [(Change, &str); 9] = [
        (
            |_, bin| bin.test = BinTest::Box,
            "bin.subtile_px needs a test of subtiles, but bin.test is box",
        ),
        (
            |machine, _| machine.timing.organisation = Organisation::Immediate,
            "timing.organisation is immediate, but bin.test tests tiles",
        ),
        (
            |_, bin| bin.subtile_px = Some(5),
            "bin.subtile_px is 5: it can be 4, 8 or 16",
        ),
        (
            |_, bin| bin.subtile_px = Some(0),
            "bin.subtile_px is 0: it can be 4, 8 or 16",
        ),
        (
            |machine, bin| {
                (machine.timing.tile.side_px, bin.subtile_px) = (8, Some(16));
            },
            "bin.subtile_px is 16, but a tile of timing.tile.side_px 8 does not consist of whole subtiles",
        ),
        (
            |machine, _| machine.timing.tile.side_px = 20,
            "bin.subtile_px is 8, but a tile of timing.tile.side_px 20 does not consist of whole subtiles",
        ),
        (
            |machine, _| machine.timing.tile.side_px = 128,
            "bin.subtile_px is 8, but a tile of timing.tile.side_px 128 has 256 such subtiles: a mask has at most 64 bits",
        ),
        (
            |_, bin| bin.mask_tests = Some(65),
            "bin.mask_tests is 65: it can be 1 to 64",
        ),
        (
            |_, bin| (bin.subtile_px, bin.masks) = (None, Some(MaskMaker::List)),
            "bin.masks describes masks of subtiles, but bin.subtile_px is left out",
        ),
    ];
    let bin = Bin {
        test: BinTest::Ellipse,
        subtile_px: Some(8),
        masks: None,
        ..Bin::default()
    };
    let built = |change: Change| {
        let (mut machine, mut bin) = (Machine::named("gaussian").unwrap(), bin);
        machine.sort = None;
        change(&mut machine, &mut bin);
        machine.bin = Some(bin);
        machine
            .elaborate()
            .map(|_| ())
            .map_err(|errors| errors.join("\n"))
    };
    assert_eq!(built(|_, _| {}), Ok(()));
    for (change, sentence) in changes {
        let errors = built(change).unwrap_err();
        assert!(
            errors.starts_with(sentence) && errors.lines().count() == 1,
            "{errors}"
        );
    }
    let narrow = built(|machine, bin| {
        (machine.timing.memory.burst_bytes, bin.subtile_px) = (4, Some(8));
    });
    let sentence = "timing.memory.burst_bytes is 4: an entry of a tile's list with its mask has 5";
    assert_eq!(narrow.unwrap_err(), sentence);
}
