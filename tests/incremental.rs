//! Do lists that are kept from frame to frame follow their specification, and do a first frame and a
//! still camera give the picture of a complete sort?

use rtl_model::Machine;
use rtl_model::machine::{Sort, SortKind};
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{self, Detail};
use rtl_model::work::{MergedList, MergedLists, Work};
use serde_json::{Value, json};
use splatsim::accuracy::partial::{ChosenWords, MixedDrawing};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::cosim::trace::{Origin, Window, trace};
use splatsim::golden;
use splatsim::hardware::quantise::{Quantised, quantise, quantise_after};
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cost::{Cost, Prices};
use splatsim::performance::recording::Recording;
use splatsim::scene::{Overrides, Scene, Sequence};
use std::collections::{BTreeMap, BTreeSet};

/// Gaussians seen by cameras around them, frame by frame.
fn frames(count: u32, size: [u32; 2], eyes: &[[f64; 3]]) -> Vec<Scene> {
    let camera = |eye: &[f64; 3]| json!({"eye": eye, "target": [0, 0.05, 0], "fov_y_degrees": 40});
    let cameras: Vec<Value> = eyes.iter().map(camera).collect();
    let scene = json!({
        "splats": {"gaussians": "bouquet", "count": count},
        "cameras": cameras,
        "image": {"width": size[0], "height": size[1]},
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    let mut sequence = Sequence::load(&path, &Overrides { size: None }, None).unwrap();
    let frame = |nth| sequence.frame(nth).unwrap().clone();
    (0..eyes.len()).map(frame).collect()
}

/// Eyes on an arc, which sees other Gaussians from frame to frame.
fn arc(count: usize, step: f64) -> Vec<[f64; 3]> {
    let eye = |nth: usize| {
        let angle = 0.2 + nth as f64 * step;
        [3.2 * angle.sin(), 1.0, 3.2 * angle.cos()]
    };
    (0..count).map(eye).collect()
}

fn incremental(name: &str, tile_px: u32, chunk: u32) -> Machine {
    let settings = [
        "sort.kind=incremental".to_owned(),
        format!("sort.incremental.tile_px={tile_px}"),
        format!("sort.incremental.chunk={chunk}"),
        format!("timing.tile.side_px={tile_px}"),
        format!("timing.sort.buffer_entries={chunk}"),
        format!("timing.sort.network={}", chunk.min(16)),
    ];
    machines::load(name, &settings).unwrap()
}

fn radix() -> Elaborated {
    fixed::elaborate(&machines::load("gaussian", &[]).unwrap()).unwrap()
}

/// Every frame in words, with the lists of the frame before.
fn sequence(scenes: &[Scene], machine: &Elaborated) -> Vec<Quantised> {
    let mut lists = None;
    let next = |scene: &Scene| {
        let quantised = quantise_after(scene, &machine.machine, lists.take()).unwrap();
        lists = fixed::lists_after(machine, &quantised);
        quantised
    };
    scenes.iter().map(next).collect()
}

fn picture(machine: &Elaborated, quantised: &Quantised) -> Vec<[u32; 4]> {
    fixed::draw(machine, quantised).frame
}

#[test]
fn a_first_frame_is_sorted_as_by_radix() {
    let scene = frames(1500, [90, 60], &arc(1, 0.0)).remove(0);
    let radix = radix();
    let expected = picture(&radix, &quantise(&scene, &radix.machine).unwrap());
    let exact = golden::render(&scene, &fixed::rules(&radix.machine)).picture;
    for (tile_px, chunk) in [(16, 4), (32, 8), (64, 256)] {
        let machine = fixed::elaborate(&incremental("gaussian", tile_px, chunk)).unwrap();
        let quantised = quantise(&scene, &machine.machine).unwrap();
        assert_eq!(picture(&machine, &quantised), expected);
        let golden = golden::render(&scene, &fixed::rules(&machine.machine)).picture;
        assert_eq!(golden, exact);
    }
}

#[test]
fn a_still_camera_keeps_the_picture_of_radix() {
    let scenes = frames(1500, [90, 60], &[arc(1, 0.0)[0]; 4]);
    let radix = radix();
    let expected = picture(&radix, &quantise(&scenes[0], &radix.machine).unwrap());
    let exact = golden::render(&scenes[0], &fixed::rules(&radix.machine)).picture;
    let machine = fixed::elaborate(&incremental("gaussian", 32, 8)).unwrap();
    for (scene, quantised) in scenes.iter().zip(sequence(&scenes, &machine)) {
        assert_eq!(picture(&machine, &quantised), expected);
        let golden = golden::render(scene, &fixed::rules(&machine.machine)).picture;
        assert_eq!(golden, exact);
    }
}

/// Lists by their specification: tile, column by column of pixels.
#[derive(Default)]
struct Oracle {
    frame: usize,
    /// Splats of each tile that a box touched in the frame before.
    touched: BTreeMap<(u32, u32), BTreeSet<u32>>,
    stored: BTreeMap<(u32, u32), Vec<(u32, u32)>>,
}

impl Oracle {
    /// The list of each tile, and the number of stored entries of it; then only drawn ones.
    fn next(&mut self, work: &Work, tile: u32, chunk: usize) -> BTreeMap<(u32, u32), Vec<u32>> {
        let mut touched: BTreeMap<(u32, u32), BTreeSet<u32>> = BTreeMap::new();
        let mut key = BTreeMap::new();
        for (footprint, word) in work.footprints.iter().zip(&work.keys) {
            key.insert(footprint.splat, *word);
            for x in footprint.columns[0]..=footprint.columns[1] {
                for y in footprint.rows[0]..=footprint.rows[1] {
                    let at = (u32::from(x) / tile, u32::from(y) / tile);
                    touched.entry(at).or_default().insert(footprint.splat);
                }
            }
        }
        let tiles: BTreeSet<(u32, u32)> =
            touched.keys().chain(self.stored.keys()).copied().collect();
        let mut lists = BTreeMap::new();
        for at in tiles {
            let mut stored = self.stored.remove(&at).unwrap_or_default();
            let before = stored.clone();
            let mut from = 0;
            while from < stored.len() {
                let own = if from == 0 && self.frame % 2 == 1 {
                    chunk / 2
                } else {
                    chunk
                };
                let to = (from + own).min(stored.len());
                stored[from..to].sort_by_key(|(splat, word)| (*word, *splat));
                from = to;
            }
            for (place, entry) in before.iter().enumerate() {
                let now = stored.iter().position(|other| other == entry).unwrap();
                assert!(now.abs_diff(place) < chunk);
            }
            let none = BTreeSet::new();
            let now = touched.get(&at).unwrap_or(&none);
            let was = self.touched.get(&at).unwrap_or(&none);
            let mut new: Vec<(u32, u32)> = now
                .difference(was)
                .map(|splat| (*splat, key[splat]))
                .collect();
            new.sort_by_key(|(splat, word)| (*word, *splat));
            let mut merged = Vec::new();
            while !stored.is_empty() || !new.is_empty() {
                let takes_new = match (stored.first(), new.first()) {
                    (Some((_, old)), Some((_, fresh))) => fresh < old,
                    (stored, _) => stored.is_none(),
                };
                merged.push(
                    if takes_new {
                        new.remove(0)
                    } else {
                        stored.remove(0)
                    }
                    .0,
                );
            }
            let kept = merged.iter().filter(|splat| now.contains(splat));
            self.stored
                .insert(at, kept.map(|splat| (*splat, key[splat])).collect());
            lists.insert(at, merged);
        }
        self.touched = touched;
        self.frame += 1;
        lists
    }
}

fn lists_of(lists: &MergedLists, width: u32) -> BTreeMap<(u32, u32), Vec<u32>> {
    let columns = width.div_ceil(lists.tile_px);
    let of =
        |(tile, list): (u32, &MergedList)| ((tile % columns, tile / columns), list.splats.clone());
    let lists = (0..).zip(&lists.tiles).map(of);
    lists.filter(|(_, list)| !list.is_empty()).collect()
}

#[test]
fn lists_follow_their_specification() {
    let (mut moved, mut departed, mut unsorted) = (0, 0, 0);
    for (seed, chunk) in [4usize, 8, 16, 64].into_iter().enumerate() {
        let tile = [16, 32, 64, 48][seed];
        let scenes = frames(
            700 + 300 * seed as u32,
            [100, 70],
            &arc(5, 0.15 + 0.1 * seed as f64),
        );
        let machine = fixed::elaborate(&incremental("gaussian", tile, chunk as u32)).unwrap();
        let mut oracle = Oracle::default();
        for (nth, (scene, quantised)) in scenes.iter().zip(sequence(&scenes, &machine)).enumerate()
        {
            // A frame alone begins with the same lists.
            assert_eq!(quantise(scene, &machine.machine).unwrap(), quantised);
            let (_, _, work) = fixed::draw_measured(&machine, &quantised);
            let expected = oracle.next(&work, tile, chunk);
            let lists = work.lists.as_ref().unwrap();
            let found = lists_of(lists, work.width);
            let filled: BTreeMap<_, _> = expected
                .into_iter()
                .filter(|(_, list)| !list.is_empty())
                .collect();
            assert_eq!(found, filled, "frame {nth}");
            // Small tiles have the order of the large one around them.
            let bins = work.bins(16);
            for at in 0..bins.tiles() {
                let [x, y] = [at % bins.columns, at / bins.columns].map(|at| at as u32 * 16);
                let own: Vec<u32> = bins
                    .of(at)
                    .iter()
                    .map(|nth| work.footprints[*nth as usize].splat)
                    .collect();
                let touches = |[first, last]: [u16; 2], from: u32| {
                    u32::from(first) < from + 16 && u32::from(last) >= from
                };
                let here = |splat: &&u32| {
                    work.footprints.iter().any(|footprint| {
                        footprint.splat == **splat
                            && touches(footprint.columns, x)
                            && touches(footprint.rows, y)
                    })
                };
                let whole = filled
                    .get(&(x / tile, y / tile))
                    .map_or(&[][..], Vec::as_slice);
                assert_eq!(own, whole.iter().filter(here).copied().collect::<Vec<_>>());
            }
            let by_key = |pair: &[u32]| {
                let key = |splat| work.drawn(splat).map(|nth| work.keys[nth as usize]);
                key(pair[0])
                    .zip(key(pair[1]))
                    .is_some_and(|(one, other)| one > other)
            };
            unsorted += filled
                .values()
                .flat_map(|list| list.windows(2))
                .filter(|pair| by_key(pair))
                .count();
            moved += usize::from(nth > 0);
            departed += filled
                .values()
                .flatten()
                .filter(|splat| work.drawn(**splat).is_none())
                .count();
        }
    }
    // Every case occurs.
    assert!(
        moved == 16 && departed > 0 && unsorted > 100,
        "{moved} {departed} {unsorted}"
    );
}

#[test]
fn a_chunk_longer_than_every_list_sorts_by_the_keys_of_the_frame_before() {
    let scenes = frames(900, [80, 60], &arc(4, 0.2));
    let machine = fixed::elaborate(&incremental("gaussian", 32, 65_536)).unwrap();
    let mut keys: BTreeMap<u32, u32> = BTreeMap::new();
    let mut compared = 0;
    for quantised in sequence(&scenes, &machine) {
        let (_, _, work) = fixed::draw_measured(&machine, &quantised);
        for list in &work.lists.as_ref().unwrap().tiles {
            let stored = list.splats.iter().zip(&list.new).filter(|(_, new)| !**new);
            let stored: Vec<u32> = stored.map(|(splat, _)| keys[splat]).collect();
            assert!(stored.is_sorted());
            compared += stored.len();
        }
        let footprints = work.footprints.iter().map(|footprint| footprint.splat);
        keys = footprints.zip(work.keys.iter().copied()).collect();
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn the_loss_is_the_methods_and_golden_has_it_too() {
    let scenes = frames(2000, [128, 96], &arc(4, 0.12));
    let machine = fixed::elaborate(&incremental("gaussian", 32, 8)).unwrap();
    let radix = radix();
    let mut memory = golden::ListMemory::default();
    for (nth, (scene, quantised)) in scenes.iter().zip(sequence(&scenes, &machine)).enumerate() {
        let fixed = fixed::picture(&machine, &fixed::draw(&machine, &quantised));
        let golden = golden::render(scene, &fixed::rules(&machine.machine)).picture;
        // Frame by frame, golden draws what it draws of one frame.
        let next = golden::render_next(scene, &fixed::rules(&machine.machine), &mut memory);
        assert_eq!(golden, next.picture, "frame {nth}");
        let exact = golden::render(scene, &fixed::rules(&radix.machine)).picture;
        let ideal = golden::ideal(scene).picture;
        let psnr = |one, other| metrics(one, other).psnr_db.unwrap_or(f64::INFINITY);
        // Lists of the machine and of golden can differ where keys are equal for the machine.
        let [arithmetic, loss] = [psnr(&fixed, &golden), psnr(&golden, &exact)];
        println!("frame {nth}: fixed − golden {arithmetic}, golden − sorted {loss}");
        assert!(arithmetic > 55.0, "frame {nth}: {arithmetic} dB");
        if nth == 0 {
            assert_eq!(golden, exact);
        } else {
            assert!(
                loss < arithmetic - 3.0,
                "frame {nth}: {loss} dB, {arithmetic} dB"
            );
            assert!(psnr(&golden, &ideal) < psnr(&exact, &ideal), "frame {nth}");
        }
        // Lockstep, the pixel trace and mixed precision follow the lists.
        let checked = lockstep(scene, &machine, &quantised);
        assert_eq!(
            (checked.violations, checked.flips.unexplained),
            (0, 0),
            "frame {nth}"
        );
        for pixel in (0..128 * 96).step_by(577) {
            let [x, y] = [pixel % 128, pixel / 128];
            let trace = golden::pixel_trace(scene, &fixed::rules(&machine.machine), x, y);
            assert_eq!(trace.rgba, golden.rgba[pixel]);
        }
        let drawing = MixedDrawing::new(scene, &machine, &quantised);
        let mixed = |chosen: bool| {
            let words = ChosenWords::new(&machine, |_| chosen);
            drawing.fill(&words, &drawing.set_up(&words))
        };
        let [none, all] = [mixed(false), mixed(true)];
        assert!(
            psnr(&none, &golden) > 100.0,
            "frame {nth}: {}",
            psnr(&none, &golden)
        );
        assert!(
            psnr(&all, &fixed) > 100.0,
            "frame {nth}: {}",
            psnr(&all, &fixed)
        );
    }
}

#[test]
fn threads_change_no_bit() {
    let scenes = frames(1200, [90, 60], &arc(3, 0.2));
    let machine = fixed::elaborate(&incremental("gaussian", 32, 8)).unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let last = sequence(&scenes, &machine).pop().unwrap();
            let (drawing, _, work) = fixed::draw_measured(&machine, &last);
            let golden = golden::render(&scenes[2], &fixed::rules(&machine.machine)).picture;
            (drawing, work, golden)
        })
    };
    assert!(with(1) == with(2));
}

/// The last frame of a path on a machine, in a recording.
fn recording(scenes: &[Scene], machine: &Elaborated) -> Recording {
    let last = sequence(scenes, machine).pop().unwrap();
    Recording {
        scene: "bouquet".into(),
        machine: machine.machine.clone(),
        work: fixed::draw_measured(machine, &last).2,
    }
}

#[test]
fn a_replay_of_a_recording_is_the_run() {
    let scenes = frames(1200, [90, 60], &arc(3, 0.2));
    let machine = fixed::elaborate(&incremental("gaussian", 32, 8)).unwrap();
    let recording = recording(&scenes, &machine);
    let own = timing::replay(&machine.timing, &recording.work, Detail::Total).total;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("work");
    recording.clone().write(&path).unwrap();
    let read = Recording::read(&path).unwrap();
    assert_eq!(read, recording);
    let replayed = read.replay(&[], false, Some(&Prices::default())).unwrap();
    assert_eq!(replayed.cycles.total, own);
    // Another machine would have another order.
    let refused = |setting: &str, why: &str| {
        let mut other = read.clone();
        let error = match other.set(setting) {
            Err(error) => error.to_string(),
            Ok(()) => other.replay(&[], false, None).unwrap_err().to_string(),
        };
        assert!(error.contains(why), "{error}");
    };
    refused("sort.kind=radix", "draw the frame again");
    refused("timing.tile.side_px=16", "both must be equal");
    refused("timing.sort.buffer_entries=16", "both must be equal");
    refused("sort.incremental.chunk=16", "only fields below `timing`");
    let radix = radix();
    let sorted = Recording {
        machine: radix.machine.clone(),
        work: fixed::draw_measured(&radix, &quantise(&scenes[0], &radix.machine).unwrap()).2,
        scene: "bouquet".into(),
    };
    let error = sorted.clone().set("sort.kind=incremental").unwrap_err();
    assert!(
        error.to_string().contains("draw the frame again"),
        "{error}"
    );
    // No damage to the lists is taken for a record.
    let damages: [fn(&mut MergedLists); 6] = [
        |lists| lists.chunk = 5,
        |lists| lists.tile_px = 24,
        |lists| drop(lists.tiles.pop()),
        |lists| {
            // A new entry is of a splat that is drawn.
            let list = lists
                .tiles
                .iter_mut()
                .find(|list| list.new.contains(&true))
                .unwrap();
            let at = list.new.iter().position(|new| *new).unwrap();
            list.splats.remove(at);
            list.new.remove(at);
        },
        |lists| list_of(lists).splats[0] = 5000,
        |lists| list_of(lists).splats[1] = list_of(lists).splats[0],
    ];
    for (nth, damage) in damages.into_iter().enumerate() {
        let mut other = recording.clone();
        damage(other.work.lists.as_mut().unwrap());
        assert!(other.work.check().is_err(), "damage {nth}");
    }
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
    let error = Recording::read(&path).unwrap_err().to_string();
    assert!(error.contains("damaged"), "{error}");
}

/// A list with at least two entries.
fn list_of(lists: &mut MergedLists) -> &mut MergedList {
    let mut lists = lists.tiles.iter_mut();
    lists.find(|list| list.splats.len() > 1).unwrap()
}

#[test]
fn kept_lists_are_never_free() {
    let scenes = frames(1200, [90, 60], &arc(3, 0.1));
    let kept = fixed::elaborate(&incremental("gaussian", 32, 256)).unwrap();
    let tile = Machine {
        sort: kept.machine.sort.map(|sort| Sort {
            kind: SortKind::Tile,
            incremental: None,
            ..sort
        }),
        ..kept.machine.clone()
    };
    let tile = fixed::elaborate(&tile).unwrap();
    let cost = |machine: &Elaborated| Cost::new(machine, &Prices::default());
    let [own, other] = [cost(&kept), cost(&tile)];
    assert!(own.area > other.area && own.memory_bits > other.memory_bits);
    // With the boxes of a splat and with a burst: exact.
    let burst = 8 * u64::from(kept.timing.timing.memory.burst_bytes);
    let entry = 8 * u64::from(kept.timing.sort.unwrap().entry_bytes);
    assert_eq!(own.memory_bits - other.memory_bits, 256 * entry + 4 * burst);
    // A first frame has no entry from before, and everything else costs.
    let of = |machine: &Elaborated, scenes: &[Scene]| {
        let work = recording(scenes, machine).work;
        let cycles = timing::replay(&machine.timing, &work, Detail::Accounts);
        let bytes = cycles.memory.bytes;
        (work, cycles, bytes)
    };
    let (work, first, [_, binning, sort, lists, ..]) = of(&kept, &scenes[..1]);
    // Each box is read and written. A record is at the place of its splat in the scene, and each
    // burst of records is written once.
    let burst = burst / 8;
    let boxes = (8 * work.cull_reasons.len() as u64).div_ceil(burst) * burst;
    let bytes = u64::from(kept.timing.prepared_bytes);
    let of_record = |nth: u64| nth * bytes / burst..((nth + 1) * bytes).div_ceil(burst);
    let drawn = work
        .footprints
        .iter()
        .map(|footprint| u64::from(footprint.splat));
    let records = drawn.flat_map(of_record).collect::<BTreeSet<u64>>().len() as u64 * burst;
    let dense = (work.footprints.len() as u64 * bytes).div_ceil(burst) * burst;
    let (_, sorted, [_, binned, tiles, read, ..]) = of(&tile, &scenes[..1]);
    assert_eq!((binning[0], binned[0]), (boxes, 0));
    assert_eq!(binning[1], binned[1] - dense + records + boxes);
    assert_eq!((sort, read[1]), (tiles, 0));
    // Records at the places of their splats in the scene have gaps.
    assert!(
        lists[0] >= read[0]
            && lists[1] > 0
            && first.memory.total_bytes() > sorted.memory.total_bytes()
    );
    // A later frame writes fewer entries, and pays for those that have departed.
    let (work, _, [_, next, ..]) = of(&kept, &scenes);
    assert!(next[1] < binning[1]);
    let bins = work.kept_bins().unwrap();
    assert!(bins.listed() < bins.entries());
}

/// Masks that `list` makes change neither the picture nor the lists: raster passes over subtiles
/// without a pixel, for which each engine has tests.
#[test]
fn masks_of_kept_lists_save_stamps_and_cost_tests() {
    let scenes = frames(1200, [90, 60], &arc(3, 0.1));
    let plain = incremental("gaussian", 32, 256);
    let masks = ["bin.test=ellipse", "bin.subtile_px=8", "bin.masks=list"];
    let masked = masks.iter().fold(plain.clone(), |machine, setting| {
        let mut value = machines::value(&machine);
        let (path, choice) = setting.split_once('=').unwrap();
        let choice = choice
            .parse::<u32>()
            .map_or(json!(choice), |number| json!(number));
        machines::lay(&mut value, path, choice);
        machines::from_value(&value, "masked").unwrap()
    });
    let [plain, masked] = [plain, masked].map(|machine| fixed::elaborate(&machine).unwrap());
    let of = |machine: &Elaborated| {
        let recording = recording(&scenes, machine);
        let work = recording.work;
        let replayed = timing::replay(&machine.timing, &work, Detail::Accounts);
        (work, replayed)
    };
    let ((one, without), (other, with)) = (of(&plain), of(&masked));
    assert_eq!((&one.lists, &one.tiles), (&other.lists, &other.tiles));
    let counts = with.tile_tests.unwrap().masks.unwrap();
    assert!(without.tile_tests.is_none_or(|tests| tests.masks.is_none()));
    assert!(
        0 < counts.set && counts.set < counts.tested && counts.list_cycles > 0,
        "{counts:?}"
    );
    assert_eq!(
        with.memory.bytes[1], without.memory.bytes[1],
        "bin tests no tile"
    );
    assert!(
        with.stamps[0] < without.stamps[0],
        "{:?}",
        [with.stamps, without.stamps]
    );
    let cost = |machine: &Elaborated| Cost::new(machine, &Prices::default());
    assert!(cost(&masked).area > cost(&plain).area);
}

#[test]
fn lists_that_cannot_be_kept_are_refused() {
    let refused = |settings: &[&str], why: &str| {
        let settings: Vec<String> = settings.iter().map(|setting| (*setting).into()).collect();
        let error = machines::load("gaussian", &settings)
            .and_then(|machine| fixed::elaborate(&machine).map(drop))
            .unwrap_err()
            .to_string();
        assert!(error.contains(why), "{error}");
    };
    let kind = "sort.kind=incremental";
    refused(
        &[kind, "timing.tile.side_px=32"],
        "timing.tile.side_px is 32",
    );
    refused(
        &[kind, "timing.sort.buffer_entries=64"],
        "timing.sort.buffer_entries is 64",
    );
    refused(
        &[kind, "sort.incremental.tile_px=24"],
        "must be a multiple of 16",
    );
    refused(
        &[kind, "sort.incremental.chunk=100"],
        "must be a power of two",
    );
    refused(&[kind, "bin.test=ellipse"], "bin.test must be box");
    refused(
        &[
            kind,
            "bin.test=ellipse",
            "bin.subtile_px=8",
            "bin.masks=bin",
        ],
        "masks of subtiles that list makes",
    );
    refused(&[kind, "timing.sort.bucket_bits=3"], "has no buckets");
    refused(&[kind, "sort.tile_bits=13"], "part of the key of radix");
    refused(&[kind, "timing.organisation=immediate"], "use binned");
    refused(&["sort.incremental.chunk=64"], "sort.kind is another");
    let scenes = frames(50, [40, 30], &arc(2, 0.1));
    let machine = incremental("gaussian", 16, 4);
    let folder = tempfile::tempdir().unwrap();
    let origin = |frame| Origin {
        frame,
        ..Origin::default()
    };
    let traced = |frame: usize, units: &[&str]| {
        let window = Window {
            units: units.iter().map(ToString::to_string).collect(),
            ..Window::default()
        };
        trace(
            &scenes[frame],
            origin(frame),
            &machine,
            &window,
            folder.path(),
        )
    };
    assert!(traced(0, &[]).is_ok());
    for units in [&[][..], &["project", "gauss"]] {
        let error = traced(1, units).unwrap_err().to_string();
        assert!(error.contains("depend on the frames before it"), "{error}");
    }
    // Setup does not depend on lists.
    assert!(traced(1, &["project", "ellipse"]).is_ok());
}
