//! Do lists that are kept from frame to frame follow their specification, and do a first frame and a
//! still camera give the picture of a complete sort?

use rtl_model::Machine;
use rtl_model::frame::MergedLists;
use rtl_model::pipeline::Elaborated;
use rtl_model::work::Work;
use serde_json::{Value, json};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::golden;
use splatsim::hardware::quantise::{Quantised, quantise, quantise_after};
use splatsim::hardware::{fixed, machines};
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
    let of = |(tile, list): (u32, &rtl_model::frame::MergedList)| {
        ((tile % columns, tile / columns), list.splats.clone())
    };
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
fn fixed_is_as_near_to_golden_as_with_radix_and_the_loss_is_the_methods() {
    let scenes = frames(2000, [128, 96], &arc(4, 0.12));
    let machine = fixed::elaborate(&incremental("gaussian", 32, 16)).unwrap();
    let radix = radix();
    let mut loss = [f64::INFINITY; 2];
    for (nth, (scene, quantised)) in scenes.iter().zip(sequence(&scenes, &machine)).enumerate() {
        let fixed = fixed::picture(&machine, &fixed::draw(&machine, &quantised));
        let golden = golden::render(scene, &fixed::rules(&machine.machine)).picture;
        let sorted = quantise(scene, &radix.machine).unwrap();
        let sorted = fixed::picture(&radix, &fixed::draw(&radix, &sorted));
        let exact = golden::render(scene, &fixed::rules(&radix.machine)).picture;
        let ideal = golden::ideal(scene).picture;
        let psnr = |one, other| metrics(one, other).psnr_db.unwrap_or(f64::INFINITY);
        let [own, of_radix] = [psnr(&fixed, &golden), psnr(&sorted, &exact)];
        let [method, sorts] = [psnr(&golden, &ideal), psnr(&exact, &ideal)];
        loss = [loss[0].min(method), loss[1].min(sorts)];
        println!("frame {nth}: {own} {of_radix} {method} {sorts}");
        // Lockstep and the pixel trace follow the lists.
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
    }
    assert!(
        loss[0] < loss[1] - 3.0,
        "golden − ideal: {} dB, {} dB with radix",
        loss[0],
        loss[1]
    );
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
