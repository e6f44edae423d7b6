//! Do traces contain the records of the machine's ports, and can a unit be driven by its inputs
//! alone?

use crate::cosimulation::{have, run};
use crate::traced::{
    Traced, bouquet, cloud, files, harmonics, isosurface, machine, shells, traced,
};
use proptest::prelude::*;
use rtl_model::pipeline::ports::{Kind, project_out_words};
use rtl_model::pipeline::unit_replay;
use rtl_model::probe::NoProbe;
use rtl_model::units::fragment::{Decision, Premultiplied, Side, Slot, TILE_PX};
use rtl_model::units::resolve::Layer;
use rtl_model::units::shade;
use serde_json::json;
use sha2::{Digest, Sha256};
use splatsim::cosim::trace::Window;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

const SPLAT: usize = 0;
const PARENT: usize = 4;

/// Both row modes, all merge rules, one layer and many.
fn machines() -> Vec<rtl_model::Machine> {
    vec![
        machine("tiny", &[]),
        machine(
            "lean",
            &["raster.rows=seeded", "fragment.merge=nearest-pair"],
        ),
        machine(
            "reference",
            &["fragment.layers=1", "fragment.merge=replace"],
        ),
        machine(
            "reference",
            &[
                "fragment.layers=2",
                "fragment.evict_hidden=true",
                "fragment.fragment_depth=nearest",
            ],
        ),
    ]
}

/// Scenes of ellipsoids and their machines: sheets in either order, with and without early
/// termination and a table; one sheet each; and no sheets.
fn media() -> Vec<(String, rtl_model::Machine)> {
    let small = [
        "fragment.sheets.table.index_bits=4",
        "fragment.sheets.table.interpolation=nearest",
        "splat.rgb=U2F8",
    ];
    vec![
        (
            shells(14, 24, &json!({"stop": 0.6})),
            machine("volume", &[]),
        ),
        (
            shells(
                12,
                24,
                &json!({"order": "back-to-front", "opacity": "linear", "least_weight": 0.02}),
            ),
            machine("volume", &small),
        ),
        (
            shells(12, 24, &json!({"stop": 0.6, "keep_last": false})),
            machine("gaussian", &[]),
        ),
        (
            bouquet(500, 24, &json!({"stop": 0.2})),
            machine("gaussian", &[]),
        ),
        (
            harmonics(300, 24, 2),
            machine("gaussian", &["colour.basis=I2F5"]),
        ),
        (
            bouquet(
                300,
                24,
                &json!({"stop": 0.3, "keep_last": true, "most_weight": 0.4}),
            ),
            machine("gaussian", &["sort.key=U1F6"]),
        ),
        (
            isosurface(14, 24),
            machine(
                "volume",
                &["fragment.layers=2", "fragment.evict_hidden=false"],
            ),
        ),
    ]
}

fn array<const N: usize>(words: &[i64]) -> [i64; N] {
    words.try_into().unwrap()
}

/// The traced frame, for the constants.
fn frame(text: &str, machine: &rtl_model::Machine) -> rtl_model::Frame {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, text).unwrap();
    quantise(
        &Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap(),
        machine,
    )
    .unwrap()
    .frame
}

/// Words without a meaning are 0.
fn masked(trace: &Traced, stream: &str, mut words: Vec<i64>) -> Vec<i64> {
    let fields = trace.stream(stream)["fields"].as_array().unwrap();
    for (i, field) in fields.iter().enumerate() {
        let flags = field["zero_where"].as_array().into_iter().flatten();
        if flags
            .map(|flag| trace.field(stream, flag.as_str().unwrap()))
            .any(|flag| words[flag] != 0)
        {
            words[i] = 0;
        }
    }
    words
}

fn replay(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    let unwatched = &mut NoProbe;
    let size_px = [frame.width, frame.height];
    for (input, output) in trace
        .records("project.in")
        .iter()
        .zip(trace.records("project.out"))
    {
        let made = unit_replay::project(
            elaborated,
            frame,
            array(&input[..3]),
            input.get(3).copied().unwrap_or_default(),
            unwatched,
        );
        assert_eq!(
            masked(
                trace,
                "project.out",
                project_out_words(Kind::of(frame), made).collect()
            ),
            output
        );
    }
    for (input, output) in trace
        .records("ellipse.in")
        .iter()
        .zip(trace.records("ellipse.out"))
    {
        let made = match frame.ellipsoids {
            Some(_) => unit_replay::ellipsoid(elaborated, frame, array(input), unwatched).unwrap(),
            None => unit_replay::ellipse(elaborated, &frame.view, size_px, array(input), unwatched),
        };
        assert_eq!(masked(trace, "ellipse.out", made.to_vec()), output);
    }
    if Kind::of(frame).harmonics > 0 {
        let inputs = trace.records("colour.in");
        assert!(!inputs.is_empty());
        for (input, output) in inputs.iter().zip(trace.records("colour.out")) {
            let made = unit_replay::colour(elaborated, frame, input, unwatched).unwrap();
            assert_eq!(made.to_vec(), output);
        }
    }
    let mut fragments = trace.records("raster.out").into_iter();
    for input in trace.records("raster.in") {
        for made in unit_replay::raster(
            elaborated,
            &frame.view,
            size_px,
            array(&input[1..]),
            unwatched,
        ) {
            assert_eq!(fragments.next(), Some([&input[..1], &made].concat()));
        }
    }
    assert_eq!(
        fragments.next(),
        None,
        "raster.out has records that raster.in does not make"
    );
    for (input, output) in trace
        .records("gauss.in")
        .iter()
        .zip(trace.records("gauss.out"))
    {
        assert_eq!(
            vec![unit_replay::gauss(elaborated, array(input), unwatched)],
            output
        );
    }
    replay_fragments(trace, elaborated, frame);
    replay_shade(trace, elaborated, frame);
    replay_resolve(trace, elaborated, frame);
}

fn replay_shade(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    let unwatched = &mut NoProbe;
    for (input, output) in trace
        .records("shade.in")
        .iter()
        .zip(trace.records("shade.out"))
    {
        // The pixel precedes the sums, if it is requested.
        let (place, sums) = input.split_at(input.len() - 9);
        let words = shade::Input {
            weight: sums[0],
            colour: array(&sums[1..4]),
            opacity: sums[4],
            normal: array(&sums[5..8]),
            material: sums[8] as u32,
            pixel: if place.is_empty() {
                [0; 2]
            } else {
                array(place)
            },
        };
        let made = unit_replay::shade(elaborated, frame, &words, unwatched);
        assert_eq!([&made.colour[..], &[made.opacity]].concat(), output);
    }
}

/// Splats that are shaded before they are drawn: shade is requested with the splat and its normal,
/// and contributions have the returned colour in these fields.
fn replay_emission(trace: &Traced, elaborated: &rtl_model::Elaborated, light: &str) {
    let unwatched = &mut NoProbe;
    let (splats, set_up) = (trace.records("pipeline.in"), trace.records("ellipse.out"));
    let [red, material] = ["red", "material"].map(|name| trace.field("pipeline.in", name));
    let (requests, answers) = (
        trace.records("ellipse.request"),
        trace.records("ellipse.answer"),
    );
    let mut colours = BTreeMap::new();
    for ((key, request), answer) in trace
        .keys("ellipse.request")
        .iter()
        .zip(&requests)
        .zip(&answers)
    {
        let (splat, normal) = (
            &splats[key[SPLAT] as usize],
            array(&set_up[key[PARENT] as usize][3..6]),
        );
        let made = unit_replay::emission(
            elaborated,
            array(&splat[red..red + 3]),
            normal,
            splat[material] as u32,
            unwatched,
        );
        let made = [
            &[made.weight][..],
            &made.colour,
            &[made.opacity],
            &made.normal,
            &[made.material.into()],
        ]
        .concat();
        assert_eq!(&made, request);
        colours.insert(
            key[SPLAT],
            unit_replay::emitted_colour(elaborated, array(&answer[..3]), unwatched),
        );
    }
    // The requests of fragment follow for windows; voxels have none.
    let asked = |of_setup: Vec<Vec<i64>>, stream: &str| {
        let has = trace.manifest["streams"]
            .as_array()
            .unwrap()
            .iter()
            .any(|other| other["name"] == stream);
        [
            of_setup,
            if has {
                trace.records(stream)
            } else {
                Vec::new()
            },
        ]
        .concat()
    };
    assert_eq!(
        asked(requests, "fragment.request"),
        trace.records("shade.in")
    );
    assert_eq!(
        asked(answers, "fragment.answer"),
        trace.records("shade.out")
    );
    assert_eq!(colours.len(), trace.lines("raster.in").len());
    let red = trace.field("fragment.in", light);
    for (key, record) in trace
        .keys("fragment.in")
        .iter()
        .zip(trace.records("fragment.in"))
    {
        assert_eq!(record[red..red + 3], colours[&key[SPLAT]]);
    }
}

fn replay_sort(trace: &Traced, elaborated: &rtl_model::Elaborated) {
    let (given, sorted) = (trace.records("sort.in"), trace.records("sort.out"));
    let depths: Vec<i64> = given.iter().map(|record| record[1]).collect();
    let made = unit_replay::sort(elaborated, &depths, &mut NoProbe).unwrap();
    let made: Vec<Vec<i64>> = made
        .into_iter()
        .map(|(nth, key)| vec![given[nth][0], key])
        .collect();
    assert_eq!(made, sorted);
    assert!(
        given
            .iter()
            .map(|record| record[0])
            .ne(sorted.iter().map(|record| record[0])),
        "in order before they are sorted"
    );
}

/// `fragment` if it groups by sheets.
fn replay_sheets(
    trace: &Traced,
    elaborated: &rtl_model::Elaborated,
    sheets: &rtl_model::frame::Sheets,
) {
    let side = TILE_PX as i64;
    let decisions = trace.records("fragment.out");
    let mut tiles = BTreeMap::new();
    for (input, told) in trace.records("fragment.in").into_iter().zip(decisions) {
        let tile = tiles
            .entry([input[0] / side, input[1] / side])
            .or_insert_with(|| unit_replay::Sheets::new(elaborated, sheets));
        let [outcome, slot] = match tile.take(array(&input), &mut NoProbe) {
            Decision::Accumulated(slot) => [0, slot.into()],
            Decision::Inserted(slot) => [1, slot.into()],
            Decision::Merged(front, _) => [2, front.into()],
            Decision::Dropped => [5, 0],
            other => panic!("{other:?} of a sheet"),
        };
        assert_eq!(vec![input[0], input[1], outcome, slot], told);
    }
    for record in trace.records("fragment.held") {
        let tile = &tiles[&[record[0] / side, record[1] / side]];
        let pixel = (record[1] % side * side + record[0] % side) as usize;
        let (held, lit) = (
            tile.held(pixel).unwrap(),
            tile.lit(pixel, &mut NoProbe).unwrap(),
        );
        let (sheet, open) = held.open.unwrap_or_default();
        let head = [
            record[0],
            record[1],
            held.stopped.into(),
            held.open.is_none().into(),
        ];
        let made = [
            &head[..],
            &held.composite[1..5],
            &[sheet.into()],
            &open[..4],
            &lit.colour,
            &[lit.opacity],
        ]
        .concat();
        assert_eq!(masked(trace, "fragment.held", made), record);
    }
}

fn replay_resolve(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    let (mut layers, mut pixels) = (Vec::new(), trace.records("resolve.out").into_iter());
    for record in trace.records("resolve.in") {
        let [x, y, last, empty, r, g, b, opacity] = array(&record);
        if empty == 0 {
            layers.push(Layer {
                colour: [r, g, b],
                opacity,
                ..Layer::default()
            });
        }
        if last == 1 {
            let word = unit_replay::resolve(elaborated, frame, &layers, &mut NoProbe);
            assert_eq!(pixels.next(), Some([&[x, y], &word[..]].concat()));
            layers.clear();
        }
    }
    assert_eq!(pixels.next(), None);
}

/// A stream's records of each pixel, with a position in them.
type ByPixel = BTreeMap<[i64; 2], std::vec::IntoIter<Vec<i64>>>;

fn by_pixel(trace: &Traced, stream: &str) -> ByPixel {
    let mut all: BTreeMap<[i64; 2], Vec<Vec<i64>>> = BTreeMap::new();
    trace
        .records(stream)
        .into_iter()
        .for_each(|record| all.entry([record[0], record[1]]).or_default().push(record));
    all.into_iter()
        .map(|(at, records)| (at, records.into_iter()))
        .collect()
}

/// `fragment` if it groups by intervals or windows.
fn replay_windows(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    let side = TILE_PX as i64;
    let mut asked = trace
        .records("fragment.request")
        .into_iter()
        .zip(trace.records("fragment.answer"));
    let mut answer = |slot: &Slot| {
        let (request, answer) = asked
            .next()
            .expect("a request that the trace does not have");
        assert_eq!(request, [&slot.sums[..], &[slot.material.into()]].concat());
        let [r, g, b, opacity] = array(&answer);
        Premultiplied {
            colour: [r, g, b],
            opacity,
        }
    };
    let deepest = i64::from(elaborated.machine.fragment.layers) - 1;
    let mut tiles = BTreeMap::new();
    for (input, told) in trace
        .records("fragment.in")
        .into_iter()
        .zip(trace.records("fragment.out"))
    {
        let tile = tiles.entry([input[0] / side, input[1] / side]);
        let tile = tile.or_insert_with(|| unit_replay::Windows::new(elaborated, frame).unwrap());
        let [outcome, slot, place] = match tile.take(array(&input), &mut answer, &mut NoProbe) {
            Decision::Accumulated(slot) => [0, slot.into(), 0],
            Decision::Inserted(slot) => [1, slot.into(), 0],
            Decision::Evicted(itself) => [3, itself.into(), 0],
            Decision::Late(slot, Side::Front) => [6, slot.into(), 0],
            Decision::Late(slot, Side::Back) => [7, slot.into(), 0],
            Decision::Inside(slot) => [8, slot.into(), 0],
            Decision::Summed(front, place) => [9, front.into(), place.into()],
            Decision::Closed(place, false) => [10, deepest, place.into()],
            Decision::Closed(place, true) => [11, deepest, place.into()],
            other => panic!("{other:?} of a window"),
        };
        assert_eq!(vec![input[0], input[1], outcome, slot, place], told);
    }
    let mut held = by_pixel(trace, "fragment.held");
    for (y, x) in
        (0..i64::from(frame.height)).flat_map(|y| (0..i64::from(frame.width)).map(move |x| (y, x)))
    {
        let Some(tile) = tiles.get_mut(&[x / side, y / side]) else {
            continue;
        };
        for layer in tile.layers(
            (y % side * side + x % side) as usize,
            &mut answer,
            &mut NoProbe,
        ) {
            let [r, g, b] = layer.colour;
            let made = vec![x, y, layer.slot as i64, layer.depth, r, g, b, layer.opacity];
            assert_eq!(held.get_mut(&[x, y]).and_then(Iterator::next), Some(made));
        }
    }
    assert!(
        held.into_values().all(|rest| rest.len() == 0),
        "layers of the trace that were not made"
    );
    assert_eq!(asked.count(), 0, "requests of the trace that were not made");
}

/// Additional fields of a contribution to windows: the colour of its splat, and a density that
/// increases with its opacity.
fn replay_densities(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    let mut densities = BTreeMap::new();
    for (record, key) in trace
        .records("fragment.in")
        .into_iter()
        .zip(trace.keys("fragment.in"))
    {
        let splat = &frame.splats[key[SPLAT] as usize];
        assert_eq!(
            record[4..8],
            [splat.rgb[0], splat.rgb[1], splat.rgb[2], splat.opacity].map(i64::from)
        );
        densities.insert(record[7], record[15]);
    }
    let one = elaborated
        .machine
        .fragment
        .window
        .unwrap()
        .density
        .format
        .one() as f64;
    let opaque = elaborated.machine.splat.opacity.format.one() as f64;
    for (opacity, density) in &densities {
        let exact = -2.0 * (-(*opacity as f64 / opaque).min(0.95)).ln_1p();
        assert!(
            (*density as f64 / one - exact).abs() < 0.02,
            "{density} of {opacity}: {exact} is exact"
        );
    }
    assert!(densities.len() > 20 && densities.values().is_sorted());
}

fn replay_fragments(trace: &Traced, elaborated: &rtl_model::Elaborated, frame: &rtl_model::Frame) {
    if let Some(sheets) = &frame.sheets {
        return replay_sheets(trace, elaborated, sheets);
    }
    if frame.window.is_some() {
        return replay_windows(trace, elaborated, frame);
    }
    let side = TILE_PX as i64;
    let (decisions, requests) = (
        trace.records("fragment.out"),
        trace.records("fragment.request"),
    );
    let answers = trace.records("fragment.answer");
    let asked_by: Vec<i64> = trace
        .keys("fragment.request")
        .iter()
        .map(|key| key[PARENT])
        .collect();
    let mut tiles = BTreeMap::new();
    for (i, input) in trace.records("fragment.in").into_iter().enumerate() {
        let tile = tiles
            .entry([input[0] / side, input[1] / side])
            .or_insert_with(|| unit_replay::Fragments::new(elaborated, frame));
        let mut next = asked_by.partition_point(|by| (*by as usize) < i);
        let answer = |slot: &Slot| {
            assert_eq!(
                asked_by[next] as usize, i,
                "a request that the trace does not have"
            );
            assert_eq!(
                requests[next],
                [&slot.sums[..], &[slot.material.into()]].concat()
            );
            let [r, g, b, opacity] = array(&answers[next]);
            next += 1;
            Premultiplied {
                colour: [r, g, b],
                opacity,
            }
        };
        let decision = tile.take(array(&input), answer, &mut NoProbe);
        assert!(
            asked_by.get(next).is_none_or(|by| *by as usize > i),
            "requests of the trace that were not made"
        );
        let told = match decision {
            Decision::Accumulated(slot) => [0, slot.into()],
            Decision::Inserted(slot) => [1, slot.into()],
            Decision::Merged(front, back) => {
                assert_eq!(back, front + 1);
                [2, front.into()]
            }
            Decision::Evicted(itself) => [3, itself.into()],
            Decision::Replaced => [4, 0],
            Decision::Dropped => [5, 0],
            other => panic!("{other:?} of a fragment"),
        };
        assert_eq!([&input[..2], &told[..]].concat(), decisions[i]);
    }
    for record in trace.records("fragment.held") {
        let tile = &tiles[&[record[0] / side, record[1] / side]];
        let slot =
            tile.held((record[1] % side * side + record[0] % side) as usize)[record[2] as usize];
        let lit = if slot.shaded {
            tile.lit(&slot, &mut NoProbe)
        } else {
            Premultiplied::default()
        };
        let head = [
            record[0],
            record[1],
            record[2],
            slot.shaded.into(),
            slot.depth,
            slot.material.into(),
        ];
        let made = [&head[..], &slot.sums, &lit.colour, &[lit.opacity]].concat();
        assert_eq!(masked(trace, "fragment.held", made), record);
    }
}

#[test]
fn a_trace_replays_through_the_units() {
    let text = cloud(1500, 40);
    for machine in machines() {
        let trace = traced(&text, &machine, &Window::default());
        replay(
            &trace,
            &machine.elaborate().unwrap(),
            &frame(&text, &machine),
        );
        assert!(
            trace.lines("raster.out").len() > 3000,
            "a trace of next to nothing"
        );
    }
}

/// Machines that group by windows: the named one, one of intervals, and one with few bits.
fn windows() -> Vec<rtl_model::Machine> {
    let interval = ["fragment.group=interval", "fragment.layers=3"];
    let few_bits = [
        "fragment.depth=U1F12",
        "fragment.window.through=U1F5",
        "fragment.window.join_permille=400",
        "fragment.layers=2",
    ];
    vec![
        machine("window", &[]),
        machine("window", &interval),
        machine("window", &few_bits),
    ]
}

#[test]
fn a_trace_of_windows_replays_through_the_units() {
    let text = cloud(800, 32);
    for machine in windows() {
        let trace = traced(&text, &machine, &Window::default());
        let (elaborated, frame) = (machine.elaborate().unwrap(), frame(&text, &machine));
        replay(&trace, &elaborated, &frame);
        replay_emission(&trace, &elaborated, "light_r");
        replay_densities(&trace, &elaborated, &frame);
        let mut outcomes: Vec<i64> = trace
            .records("fragment.out")
            .iter()
            .map(|record| record[2])
            .collect();
        outcomes.sort_unstable();
        outcomes.dedup();
        let sums = machine.fragment.group == rtl_model::machine::Group::Window;
        // Nothing hides enough here; stimuli do.
        let expected: &[i64] = if sums {
            &[0, 1, 6, 7, 8, 9, 10]
        } else {
            &[0, 1, 6, 7, 8, 10]
        };
        assert_eq!(outcomes, expected);
    }
}

#[test]
fn made_up_cases_of_windows_replay_and_meet_all_that_can_become_of_them() {
    let text = cloud(10, 40);
    for machine in windows() {
        let trace = traced(
            &text,
            &machine,
            &Window {
                stimulus: Some(2000),
                ..Window::default()
            },
        );
        replay(
            &trace,
            &machine.elaborate().unwrap(),
            &frame(&text, &machine),
        );
        let coverage = std::fs::read_to_string(trace.path("coverage.csv")).unwrap();
        let met = |case: &str| {
            coverage.lines().any(|line| {
                line.starts_with(&format!("fragment,\"{case}")) && !line.ends_with(",0")
            })
        };
        let sums = machine.fragment.group == rtl_model::machine::Group::Window;
        let outcomes = [
            "accumulated",
            "inserted",
            "evicted",
            "late-front",
            "late-back",
            "inside",
            "closed-behind",
        ];
        assert!(outcomes.iter().all(|outcome| met(outcome)), "{coverage}");
        assert_eq!(met("summed"), sums);
        for case in [
            "an open slot would be as wide as ε",
            "an open slot would be one narrower",
            "depth at the nearest end of a closed slot",
        ] {
            assert!(met(case), "{case}: {coverage}");
        }
    }
}

/// There are no records of the pixels' contents before a window of splats, so the trace has no
/// streams that depend on them.
#[test]
fn a_window_of_splats_that_are_grouped_by_windows_ends_before_fragment() {
    let machine = machine("window", &[]);
    let whole = traced(&cloud(300, 24), &machine, &Window::default());
    let part = traced(
        &cloud(300, 24),
        &machine,
        &Window {
            splats: Some([100, 200]),
            ..Window::default()
        },
    );
    let names: Vec<&str> = part.manifest["streams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stream| stream["name"].as_str().unwrap())
        .collect();
    assert!(
        names.contains(&"gauss.out")
            && names.iter().all(|name| !["fragment", "shade", "resolve"]
                .iter()
                .any(|unit| name.starts_with(unit)))
    );
    let weights = whole
        .keys("gauss.out")
        .into_iter()
        .zip(whole.lines("gauss.out"));
    let weights: Vec<String> = weights
        .filter(|(key, _)| (100..200).contains(&key[SPLAT]))
        .map(|(_, line)| line)
        .collect();
    assert_eq!(part.lines("gauss.out"), weights);
}

#[test]
fn a_trace_of_ellipsoids_replays_through_the_units() {
    for (number, (text, machine)) in media().into_iter().enumerate() {
        let trace = traced(&text, &machine, &Window::default());
        let (elaborated, frame) = (machine.elaborate().unwrap(), frame(&text, &machine));
        replay(&trace, &elaborated, &frame);
        let ellipsoids = frame.ellipsoids.as_ref().unwrap();
        if ellipsoids.preshaded {
            replay_emission(&trace, &elaborated, "red");
        }
        if ellipsoids.sorted {
            replay_sort(&trace, &elaborated);
            let tags = |stream: &str| {
                trace
                    .records(stream)
                    .iter()
                    .map(|record| record[0])
                    .collect::<Vec<_>>()
            };
            assert_eq!(tags("raster.in"), tags("sort.out"));
        }
        // All outcomes of contributions occur, and not all splats are drawn.
        let outcomes: BTreeMap<i64, usize> =
            trace
                .records("fragment.out")
                .iter()
                .fold(BTreeMap::new(), |mut outcomes, record| {
                    *outcomes.entry(record[2]).or_default() += 1;
                    outcomes
                });
        println!("scene {number}: {outcomes:?}");
        let stops = frame
            .sheets
            .as_ref()
            .is_some_and(|sheets| sheets.stop > 0 && !sheets.back_to_front);
        let expected: &[i64] = match &frame.sheets {
            None => &[0, 1, 2],
            Some(sheets) if sheets.each == rtl_model::frame::Each::Splat => &[1, 2, 5],
            Some(_) if stops => &[0, 1, 2, 5],
            Some(_) => &[0, 1, 2],
        };
        assert_eq!(
            outcomes.keys().copied().collect::<Vec<_>>(),
            expected,
            "scene {number}"
        );
        assert!(
            outcomes.values().all(|count| *count > 20),
            "scene {number}: {outcomes:?}"
        );
        assert!(
            trace.lines("raster.in").len() < trace.lines("pipeline.in").len(),
            "scene {number}: nothing is culled"
        );
        // Weights below the minimum end in gauss.
        let weights: Vec<i64> = trace
            .records("gauss.out")
            .iter()
            .map(|record| record[0])
            .collect();
        let least = frame
            .sheets
            .as_ref()
            .map_or(1, |sheets| sheets.least_weight.max(1));
        assert_eq!(
            weights.iter().filter(|weight| **weight >= least).count(),
            trace.lines("fragment.in").len(),
            "scene {number}"
        );
        assert!(
            least == 1 || weights.iter().any(|weight| (1..least).contains(weight)),
            "scene {number}: none is below the least"
        );
    }
}

#[test]
fn made_up_cases_replay_through_the_units() {
    let text = cloud(10, 40);
    for machine in machines() {
        let trace = traced(
            &text,
            &machine,
            &Window {
                stimulus: Some(500),
                ..Window::default()
            },
        );
        replay(
            &trace,
            &machine.elaborate().unwrap(),
            &frame(&text, &machine),
        );
    }
}

#[test]
fn made_up_cases_of_ellipsoids_replay_through_the_units() {
    for (text, machine) in media() {
        let trace = traced(
            &text,
            &machine,
            &Window {
                stimulus: Some(500),
                ..Window::default()
            },
        );
        let (elaborated, frame) = (machine.elaborate().unwrap(), frame(&text, &machine));
        replay(&trace, &elaborated, &frame);
        if frame.ellipsoids.unwrap().sorted {
            replay_sort(&trace, &elaborated);
        }
    }
}

#[test]
fn made_up_cases_meet_changes_of_sheet_and_stops() {
    let scenes = media();
    let slopes = [
        "slope one within its limit",
        "slope at its limit",
        "slope one beyond its limit",
    ]
    .map(|case| ("ellipse", case));
    let stops = [
        "stops",
        "the least weight that stops",
        "one less than that",
        "stopped before",
        "lets through as much as it must",
    ];
    let weights = [
        "weight at the least",
        "weight at the most",
        "weight one above the most",
    ];
    let slices = [
        "the same sheet",
        "the sheet after",
        "the sheet before",
        "a sheet that differs in its first bit",
    ];
    let more = ["a sheet of more than 1 is blended"];
    let gauss = ["weight one below the least", "weight at the least"].map(|case| ("gauss", case));
    let of_fragment = |cases: &[&'static str]| {
        cases
            .iter()
            .map(|case| ("fragment", *case))
            .collect::<Vec<_>>()
    };
    let expected = [
        [
            &slopes[..],
            &of_fragment(&[&stops[..], &weights, &slices, &more].concat()),
        ]
        .concat(),
        [
            &slopes[..],
            &gauss,
            &of_fragment(&[&weights[..], &slices, &more].concat()),
        ]
        .concat(),
        [
            &slopes[..],
            &of_fragment(&[&stops[..], &weights, &slices, &more].concat()),
        ]
        .concat(),
        [
            &slopes[..],
            &gauss,
            &of_fragment(&[&stops[..], &weights].concat()),
        ]
        .concat(),
    ];
    for (number, (cases, (text, machine))) in expected.into_iter().zip(&scenes).enumerate() {
        let trace = traced(
            text,
            machine,
            &Window {
                stimulus: Some(4000),
                ..Window::default()
            },
        );
        let table = csv(&trace);
        for (unit, case) in cases {
            assert!(
                table.get(&(unit.to_owned(), case.to_owned())) > Some(&0),
                "scene {number}: {unit} {case}"
            );
        }
        let signals: &[(&str, &str)] = match number {
            0 => &[
                ("fragment.weight_sum", "high limit"),
                ("fragment.colour_sum", "high limit"),
                ("fragment.depth_index", "tie"),
                ("fragment.depth_index", "high limit"),
                ("fragment.ratio", "above half"),
                ("ellipse.ray", "above half"),
            ],
            3 => &[
                ("ellipse.stretch", "above half"),
                ("ellipse.scale", "high limit"),
                ("ellipse.face", "below half"),
                ("sort.key", "tie"),
            ],
            _ => &[],
        };
        for (signal, case) in signals {
            assert!(
                table.get(&((*signal).to_owned(), (*case).to_owned())) > Some(&0),
                "scene {number}: {signal} {case}"
            );
        }
    }
}

#[test]
fn made_up_cases_meet_thresholds_ties_and_limits() {
    let trace = traced(
        &cloud(10, 64),
        &machine("reference", &[]),
        &Window {
            stimulus: Some(4000),
            ..Window::default()
        },
    );
    let mut table = csv(&trace);
    for case in [
        "depth at ε",
        "depth one within ε",
        "depth one beyond ε",
        "several within ε, equally near",
        "equal depths",
    ] {
        assert!(
            table.remove(&("fragment".to_owned(), case.to_owned())) > Some(0),
            "{case}"
        );
    }
    for (signal, case) in [
        ("gauss.weight", "tie"),
        ("gauss.radial_index", "tie"),
        ("fragment.depth", "high limit"),
        ("fragment.weight_sum", "high limit"),
        ("fragment.normal_sum", "low limit"),
        ("project.camera", "above half"),
        ("ellipse.depth_slope", "low limit"),
        ("ellipse.depth_slope", "high limit"),
        ("resolve.transmittance", "tie"),
    ] {
        assert!(
            table.remove(&(signal.to_owned(), case.to_owned())) > Some(0),
            "{signal} {case}"
        );
    }
    // All thresholds of units are reached, except one word of r in half a million.
    let never: Vec<&(String, String)> = table
        .iter()
        .filter(|((place, _), met)| !place.contains('.') && **met == 0)
        .map(|(case, _)| case)
        .collect();
    let known = ["radial one below the cutoff"];
    assert!(
        never.iter().all(|(_, case)| known.contains(&case.as_str())),
        "never met: {never:?}"
    );
}

fn csv(trace: &Traced) -> BTreeMap<(String, String), u64> {
    let text = std::fs::read_to_string(trace.path("coverage.csv")).unwrap();
    let row = |line: &str| {
        let (place, rest) = line.split_once(',').unwrap();
        let (case, met) = rest.rsplit_once(',').unwrap();
        (
            (place.to_owned(), case.trim_matches('"').to_owned()),
            met.parse().unwrap(),
        )
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_manifest_is_true() {
    let trace = traced(&cloud(300, 24), &machine("lean", &[]), &Window::default());
    let digest = |file: &str| {
        Sha256::digest(std::fs::read(trace.path(file)).unwrap())
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect::<String>()
    };
    let all = ["constants", "roms", "streams"]
        .into_iter()
        .flat_map(|list| trace.manifest[list].as_array().unwrap());
    for stream in all {
        let file = stream["file"].as_str().unwrap();
        assert_eq!(stream["sha256"], digest(file), "{file}");
        let text = std::fs::read_to_string(trace.path(file)).unwrap();
        assert_eq!(stream["records"], text.lines().count(), "{file}");
        assert!(
            text.lines()
                .all(|line| line.len() as u64 == stream["digits"].as_u64().unwrap()),
            "{file}"
        );
        if let Some(keys) = stream.get("keys") {
            assert_eq!(keys["sha256"], digest(keys["file"].as_str().unwrap()));
            assert_eq!(
                trace.keys(stream["name"].as_str().unwrap()).len() as u64,
                stream["records"].as_u64().unwrap()
            );
        }
    }
    assert_eq!(trace.manifest["machine"]["sha256"], digest("machine.json"));
    assert_eq!(trace.manifest["scene"]["text"], cloud(300, 24));
    let readme = std::fs::read_to_string(trace.path("README.md")).unwrap();
    for stream in trace.manifest["streams"].as_array().unwrap() {
        assert!(readme.contains(&format!("### `{}`", stream["name"].as_str().unwrap())));
    }
}

/// The number of a name is the same in manifest, package, header and README.
#[test]
fn codes_have_names_everywhere() {
    let lean = machine("lean", &[]);
    let discs = traced(&cloud(30, 16), &lean, &Window::default());
    let voxels = traced(
        &shells(8, 16, &json!({})),
        &machine("volume", &[]),
        &Window::default(),
    );
    for (trace, frame) in [(&discs, None), (&voxels, Some("amplitude"))] {
        let enums = trace.manifest["enums"].as_object().unwrap();
        let names: BTreeSet<&str> = enums.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            ["outcome", "merge", "round", "overflow"]
                .into_iter()
                .chain(frame)
                .collect()
        );
        let [package, header, readme] = ["machine_pkg.sv", "records.h", "README.md"]
            .map(|file| std::fs::read_to_string(trace.path(file)).unwrap());
        for (name, codes) in enums {
            assert!(
                package.contains(&format!("}} {name}_t;"))
                    && header.contains(&format!("}} splatsim_{name};"))
            );
            for (code, number) in codes["codes"].as_object().unwrap() {
                let (constant, number) = (
                    format!("{name}_{code}").to_uppercase().replace('-', "_"),
                    number.to_string(),
                );
                let is_told = |line: &str| {
                    let told = line
                        .trim()
                        .trim_end_matches(',')
                        .strip_prefix(&format!("{constant} = "));
                    told.is_some_and(|told| {
                        told.rsplit_once("'d").map_or(told, |(_, number)| number) == number
                    })
                };
                assert!(package.lines().any(is_told), "{constant}");
                assert!(
                    header.contains(&format!("SPLATSIM_{constant} = {number}")),
                    "{constant}"
                );
                let of = codes["of"][0].as_str().unwrap();
                assert!(
                    readme.contains(&format!("| {code} | `{of}` | {number} |")),
                    "{constant}"
                );
            }
        }
        let outcome =
            &trace.stream("fragment.out")["fields"][trace.field("fragment.out", "outcome")];
        assert_eq!(outcome["enum"], "outcome");
        assert_eq!(
            enums["outcome"]["codes"],
            json!({"accumulated": 0, "inserted": 1, "merged": 2, "evicted": 3, "replaced": 4, "dropped": 5})
        );
    }
    // The names of rules in the description.
    let described = serde_json::to_value(&lean).unwrap();
    let rule = described["fragment"]["merge"].as_str().unwrap();
    assert_eq!(
        discs.manifest["enums"]["merge"]["codes"][rule],
        discs.manifest["numbers"]["FRAGMENT_MERGE"]
    );
    let round = discs.manifest["words"]["gauss.weight"]["round"]
        .as_str()
        .unwrap();
    assert!(discs.manifest["enums"]["round"]["codes"][round].is_number());
}

#[test]
fn a_record_names_its_parents() {
    let trace = traced(
        &cloud(600, 32),
        &machine("reference", &[]),
        &Window::default(),
    );
    for stream in trace.manifest["streams"].as_array().unwrap() {
        let (name, Some(parent)) = (stream["name"].as_str().unwrap(), stream["parent"].as_str())
        else {
            continue;
        };
        let (keys, parents) = (trace.keys(name), trace.keys(parent));
        let own = keys
            .iter()
            .filter(|key| key[PARENT] != 0xffff_ffff)
            .inspect(|key| {
                let parent = &parents[key[PARENT] as usize];
                assert!(
                    parent[SPLAT] == key[SPLAT]
                        || [parent[SPLAT], key[SPLAT]].contains(&0xffff_ffff),
                    "{name} {key:?} {parent:?}"
                );
                let place = [parent[1], parent[2]];
                assert!(
                    place == [key[1], key[2]] || place == [0xffff; 2],
                    "{name} {key:?} {parent:?}"
                );
            });
        let named = own.count();
        let nobody = name == "shade.in" || name == "resolve.in";
        assert!(
            named == keys.len() || nobody && named > 0,
            "{name}: {named} of {}",
            keys.len()
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn a_window_is_a_part_of_the_whole(first in 0u32..700, count in 1u32..500, corner in prop::array::uniform2(0u32..32), size in prop::array::uniform2(1u32..9)) {
        let (text, machine) = (cloud(1200, 40), machine("tiny", &[]));
        let whole = traced(&text, &machine, &Window::default());
        let rectangle = [corner[0], corner[1], corner[0] + size[0] - 1, corner[1] + size[1] - 1];
        let splats = [first, first + count];
        let part = traced(&text, &machine, &Window { splats: Some(splats), pixels: Some(rectangle), ..Window::default() });
        let inside = |key: &Vec<i64>, place: bool| {
            let splat = key[SPLAT] >= i64::from(splats[0]) && key[SPLAT] < i64::from(splats[1]);
            let [left, top, right, bottom] = rectangle.map(i64::from);
            splat && (!place || (left..=right).contains(&key[1]) && (top..=bottom).contains(&key[2]))
        };
        for stream in ["gauss.in", "gauss.out", "fragment.in", "fragment.out", "fragment.request", "fragment.answer"] {
            let expected: Vec<String> = whole.lines(stream).into_iter().zip(whole.keys(stream)).filter(|(_, key)| inside(key, true)).map(|(line, _)| line).collect();
            prop_assert_eq!(part.lines(stream), expected, "{}", stream);
        }
        // Splats of the window that touch the rectangle, with all of their fragments.
        let shown: Vec<i64> = part.keys("raster.in").iter().map(|key| key[SPLAT]).collect();
        for (stream, keys) in [("raster.in", whole.keys("raster.in")), ("raster.out", whole.keys("raster.out"))] {
            let expected: Vec<String> = whole.lines(stream).into_iter().zip(keys).filter(|(_, key)| shown.binary_search(&key[SPLAT]).is_ok()).map(|(line, _)| line).collect();
            prop_assert_eq!(part.lines(stream), expected, "{}", stream);
        }
        let met = whole.keys("gauss.in").into_iter().filter(|key| inside(key, true)).map(|key| key[SPLAT]);
        prop_assert!(met.into_iter().all(|splat| shown.binary_search(&splat).is_ok()));
    }
}

/// Is a trace's text complete enough to implement a unit? The program was written only from it and
/// the manifest.
#[test]
fn a_raster_in_python_gives_every_record() {
    if !have(&["python3"], "a raster in another language") {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let raster = |folder: &Path| {
        Command::new("python3")
            .arg(root.join("tests/programs/raster.py"))
            .arg(folder)
            .output()
            .unwrap()
    };
    let told = run(Command::new("python3")
        .arg(root.join("tests/programs/raster.py"))
        .arg(root.join("traces/knot")))
    .stdout;
    assert_eq!(String::from_utf8_lossy(&told), "615 records equal\n");
    let only = Window {
        units: vec!["raster".into()],
        ..Window::default()
    };
    for (name, rows) in [
        ("tiny", "differenced"),
        ("lean", "differenced"),
        ("reference", "seeded"),
        ("reference", "differenced"),
        ("tiny", "direct"),
        ("reference", "direct"),
    ] {
        let mut sets = vec![format!("raster.rows={rows}")];
        if (name, rows) == ("reference", "direct") {
            sets.push("raster.square=I16F12".into());
        }
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let machine = machine(name, &sets);
        for window in [
            only.clone(),
            Window {
                stimulus: Some(200),
                ..only.clone()
            },
        ] {
            let trace = traced(&cloud(60, 24), &machine, &window);
            let output = raster(&trace.folder);
            let told = [&output.stdout[..], &output.stderr]
                .map(String::from_utf8_lossy)
                .concat();
            println!("{name}, {rows}: {told}");
            assert!(output.status.success(), "{name}, {rows}: {told}");
            let records = told
                .split(' ')
                .next()
                .and_then(|number| number.parse().ok());
            assert!(records > Some(200), "{name}, {rows}: {told}");
        }
    }
    // One bit of one depth.
    let trace = traced(&cloud(60, 24), &machine("tiny", &[]), &only);
    let path = trace.path("raster.out.hex");
    let text = std::fs::read_to_string(&path).unwrap();
    let (all, last) = text.trim_end().split_at(text.trim_end().len() - 1);
    std::fs::write(
        &path,
        format!("{all}{:x}\n", u8::from_str_radix(last, 16).unwrap() ^ 1),
    )
    .unwrap();
    assert_eq!(raster(&trace.folder).status.code(), Some(1));
}

/// Does `cubed` have the bits of the renderer that it is named after? The program has its published
/// rules, from the record of a projected Gaussian to the pixel.
#[test]
fn cubed_in_python_gives_every_pixel() {
    if !have(&["python3"], "cubed in another language") {
        return;
    }
    // Records of 32 bytes: position, scales, colour, opacity, orientation.
    const COUNT: usize = 10_000;
    let mut random = 1u64;
    let mut part = |least: f32, most: f32| {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        least + (most - least) * (random >> 40) as f32 / (1 << 24) as f32
    };
    let mut bytes = Vec::with_capacity(32 * COUNT);
    for _ in 0..COUNT {
        let position = [part(-2.0, 2.0), part(-1.5, 1.5), part(-2.0, 2.0)];
        // From 1/60 to 1/6, some of them needles.
        let scales = [(); 3].map(|()| 10f32.powf(part(-2.6, -0.9)));
        let numbers = position.into_iter().chain(scales);
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([(); 8].map(|()| part(0.0, 256.0) as u8));
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("random.splat");
    std::fs::write(&file, bytes).unwrap();
    let scene = json!({
        "splats": {"file": file.to_str().unwrap()},
        // The greatest weight: no weight is limited.
        "sheets": {"most_weight": 127.0 / 128.0},
        "camera": {"eye": [0, 0, 6], "target": [0, 0, 0]},
        "image": {"width": 160, "height": 120},
    });
    let only = Window {
        units: ["pipeline", "sort", "raster", "resolve"]
            .map(String::from)
            .to_vec(),
        ..Window::default()
    };
    let trace = traced(&scene.to_string(), &machine("cubed", &[]), &only);
    let cubed = || {
        Command::new("python3")
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs/cubed.py"))
            .arg(&trace.folder)
            .output()
            .unwrap()
    };
    let output = cubed();
    let told = [&output.stdout[..], &output.stderr]
        .map(String::from_utf8_lossy)
        .concat();
    println!("{told}");
    assert!(output.status.success(), "{told}");
    let numbers: Vec<u32> = told
        .split(' ')
        .filter_map(|part| part.parse().ok())
        .collect();
    let [gaussians, blends, pixels] = numbers[..] else {
        panic!("{told}");
    };
    assert!(
        gaussians > 9_000 && blends > 200_000 && pixels == 19_200,
        "{told}"
    );
    // One bit of one pixel.
    let path = trace.path("resolve.out.hex");
    let text = std::fs::read_to_string(&path).unwrap();
    let (line, rest) = text.split_once('\n').unwrap();
    let red = &trace.stream("resolve.out")["fields"][trace.field("resolve.out", "red")];
    let wrong = u128::from_str_radix(line, 16).unwrap() ^ 1 << red["lsb"].as_u64().unwrap();
    std::fs::write(
        &path,
        format!("{wrong:0width$x}\n{rest}", width = line.len()),
    )
    .unwrap();
    assert_eq!(cubed().status.code(), Some(1));
}

#[test]
fn a_window_replays_alone() {
    let (text, machine) = (cloud(2400, 32), machine("tiny", &[]));
    let elaborated = machine.elaborate().unwrap();
    let frame = frame(&text, &machine);
    let middle = 1100;
    let before = traced(
        &text,
        &machine,
        &Window {
            splats: Some([0, middle]),
            ..Window::default()
        },
    );
    let after = traced(
        &text,
        &machine,
        &Window {
            splats: Some([middle, 2400]),
            ..Window::default()
        },
    );
    // The initial contents of the second part are the final contents of the first, slot by slot.
    let slots = |trace: &Traced, stream: &str| {
        let mut slots: Vec<Vec<i64>> = trace
            .records(stream)
            .into_iter()
            .map(|record| record[..6].to_vec())
            .collect();
        slots.sort_by_key(|slot| [slot[1], slot[0], slot[2]]);
        slots
    };
    assert_eq!(
        slots(&before, "fragment.held"),
        slots(&after, "fragment.start")
    );
    assert!(slots(&after, "fragment.start").len() > 100);
    // The whole frame's end is the second part's end.
    let whole = traced(&text, &machine, &Window::default());
    assert_eq!(whole.lines("fragment.held"), after.lines("fragment.held"));
    assert_eq!(whole.lines("resolve.out"), after.lines("resolve.out"));
    // The first half of each part drives the units.
    replay_resolve(&after, &elaborated, &frame);
    replay_fragments(&before, &elaborated, &frame);
}

#[test]
fn a_window_of_a_volume_replays_alone() {
    for (text, machine) in &media()[..3] {
        let (elaborated, frame) = (machine.elaborate().unwrap(), frame(text, machine));
        let (middle, end) = (frame.splats.len() as u32 / 2, frame.splats.len() as u32);
        let window = |splats| {
            traced(
                text,
                machine,
                &Window {
                    splats: Some(splats),
                    ..Window::default()
                },
            )
        };
        let [before, after, whole] = [
            window([0, middle]),
            window([middle, end]),
            traced(text, machine, &Window::default()),
        ];
        // Everything except the light, which is the final colour of the pixel.
        let state = |trace: &Traced, stream: &str| {
            trace
                .records(stream)
                .into_iter()
                .map(|record| record[..13].to_vec())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            state(&before, "fragment.held"),
            state(&after, "fragment.start")
        );
        let is_open = |record: &&Vec<i64>| record[3] == 0;
        assert!(
            state(&after, "fragment.start")
                .iter()
                .filter(is_open)
                .count()
                > 100
        );
        for stream in ["fragment.held", "resolve.out"] {
            assert_eq!(whole.lines(stream), after.lines(stream), "{stream}");
        }
        replay_resolve(&after, &elaborated, &frame);
        replay_shade(&after, &elaborated, &frame);
        replay_fragments(&before, &elaborated, &frame);
    }
}

#[test]
fn a_window_of_sorted_splats_has_all_of_some_pixels_or_the_way_of_some_splats() {
    let (text, machine) = &media()[3];
    let (elaborated, frame) = (machine.elaborate().unwrap(), frame(text, machine));
    let whole = traced(text, machine, &Window::default());
    let inside = |key: &Vec<i64>| (5..=12).contains(&key[1]) && (9..=20).contains(&key[2]);
    let pixels = traced(
        text,
        machine,
        &Window {
            pixels: Some([5, 9, 12, 20]),
            ..Window::default()
        },
    );
    replay(&pixels, &elaborated, &frame);
    for stream in [
        "gauss.in",
        "gauss.out",
        "fragment.in",
        "fragment.out",
        "fragment.held",
        "resolve.out",
    ] {
        let all = whole.lines(stream).into_iter().zip(whole.keys(stream));
        let part: Vec<String> = all
            .filter(|(_, key)| inside(key))
            .map(|(line, _)| line)
            .collect();
        assert_eq!(pixels.lines(stream), part, "{stream}");
        assert!(part.len() > 50, "{stream}");
    }
    let splats = traced(
        text,
        machine,
        &Window {
            splats: Some([100, 300]),
            ..Window::default()
        },
    );
    for stream in [
        "project.out",
        "ellipse.in",
        "ellipse.out",
        "raster.in",
        "raster.out",
        "gauss.out",
    ] {
        let all = whole.lines(stream).into_iter().zip(whole.keys(stream));
        let part: Vec<String> = all
            .filter(|(_, key)| (100..300).contains(&key[SPLAT]))
            .map(|(line, _)| line)
            .collect();
        assert_eq!(splats.lines(stream), part, "{stream}");
        assert!(part.len() > 50, "{stream}");
    }
    let units: Vec<&str> = splats.manifest["streams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stream| stream["unit"].as_str().unwrap())
        .collect();
    assert!(
        !["sort", "fragment", "shade", "resolve"]
            .iter()
            .any(|unit| units.contains(unit)),
        "{units:?}"
    );
}

#[test]
fn records_of_ellipsoids_name_their_parents() {
    for (text, machine) in media() {
        let trace = traced(&text, &machine, &Window::default());
        for stream in trace.manifest["streams"].as_array().unwrap() {
            let (name, Some(parent)) =
                (stream["name"].as_str().unwrap(), stream["parent"].as_str())
            else {
                continue;
            };
            let (keys, parents) = (trace.keys(name), trace.keys(parent));
            let named = keys
                .iter()
                .filter(|key| key[PARENT] != 0xffff_ffff)
                .inspect(|key| {
                    let parent = &parents[key[PARENT] as usize];
                    assert!(
                        parent[SPLAT] == key[SPLAT]
                            || [parent[SPLAT], key[SPLAT]].contains(&0xffff_ffff),
                        "{name} {key:?} {parent:?}"
                    );
                });
            let named = named.count();
            assert!(
                named == keys.len() || ["shade.in", "resolve.in"].contains(&name),
                "{name}: {named} of {}",
                keys.len()
            );
        }
    }
}

#[test]
fn a_sample_is_a_part_whose_parents_are_found() {
    let (text, machine) = (cloud(600, 32), machine("tiny", &[]));
    let whole = traced(&text, &machine, &Window::default());
    let sample = traced(
        &text,
        &machine,
        &Window {
            sample: Some(5),
            seed: 7,
            ..Window::default()
        },
    );
    for stream in [
        "project.out",
        "raster.out",
        "gauss.out",
        "fragment.out",
        "shade.out",
        "resolve.out",
    ] {
        let (all, some) = (whole.lines(stream), sample.lines(stream));
        assert!(
            some.len() * 2 < all.len() && some.len() * 20 > all.len(),
            "{stream}: {} of {}",
            some.len(),
            all.len()
        );
        let mut rest = all.iter();
        assert!(
            some.iter().all(|line| rest.any(|other| other == line)),
            "{stream} is no part, in order, of the whole"
        );
    }
    let (keys, parents) = (sample.keys("raster.out"), sample.keys("raster.in"));
    assert!(
        keys.iter()
            .all(|key| parents[key[PARENT] as usize][SPLAT] == key[SPLAT])
    );
}

#[test]
fn a_trace_is_the_same_on_any_number_of_threads() {
    let (text, machine) = (cloud(500, 24), machine("lean", &[]));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| files(&traced(&text, &machine, &Window::default()).folder))
    };
    assert!(on(1) == on(3));
}

#[test]
fn the_committed_trace_is_up_to_date() {
    let committed = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/knot");
    let text = std::fs::read_to_string(committed.join("scene.json")).unwrap();
    let today = traced(&text, &machine("tiny", &[]), &Window::default());
    let committed: BTreeMap<_, _> = files(&committed).into_iter().collect();
    let today: BTreeMap<_, _> = files(&today.folder).into_iter().collect();
    assert_eq!(
        committed.keys().collect::<Vec<_>>(),
        today.keys().collect::<Vec<_>>()
    );
    for (path, bytes) in today {
        // The folder of the scene is different.
        let told = |bytes: &[u8]| {
            String::from_utf8_lossy(bytes)
                .lines()
                .filter(|line| !line.contains("scene.json"))
                .collect::<Vec<_>>()
                .join("\n")
        };
        assert!(
            told(&bytes) == told(&committed[&path]),
            "{} is another: trace it anew as traces/README.md says",
            path.display()
        );
    }
}

/// The words of a wire over time, as a waveform viewer reads them.
fn wave(file: &std::path::Path, unit: &str, wire: &str) -> (Option<[i64; 2]>, Vec<(u64, String)>) {
    let mut waves = wellen::simple::read(file).unwrap();
    let variable = waves
        .hierarchy()
        .lookup_var(&["machine", unit], wire)
        .unwrap();
    let (signal, index) = (
        waves.hierarchy()[variable].signal_ref(),
        waves.hierarchy()[variable].index(),
    );
    waves.load_signals(&[signal]);
    let times = waves.time_table().to_vec();
    let signal = waves.get_signal(signal).unwrap();
    let changes = signal
        .iter_changes()
        .map(|(time, value)| (times[time as usize], value.to_string()));
    (
        index.map(|index| [index.msb(), index.lsb()]),
        changes.collect(),
    )
}

#[test]
fn waves_show_when_units_took_which_records() {
    let immediate = machine(
        "tiny",
        &["timing.organisation=immediate", "timing.raster.lanes=[1,1]"],
    );
    let trace = traced(
        &cloud(60, 16),
        &immediate,
        &Window {
            waves: Some([0, 4000]),
            ..Window::default()
        },
    );
    for file in ["waves.vcd", "waves.fst"] {
        let file = trace.path(file);
        for (unit, field) in [
            ("project", "position_x"),
            ("ellipse", "radius"),
            ("gauss", "amplitude"),
            ("fragment", "weight"),
        ] {
            let stream = format!("{unit}.in");
            let described = &trace.stream(&stream)["fields"][trace.field(&stream, field)];
            let (range, words) = wave(&file, unit, field);
            let [int_bits, frac_bits] =
                ["int_bits", "frac_bits"].map(|name| described[name].as_i64().unwrap());
            assert_eq!(range, Some([int_bits - 1, -frac_bits]), "{unit}.{field}");
            let (_, items) = wave(&file, unit, "item");
            let width = described["width"].as_u64().unwrap();
            let place = trace.field(&stream, field);
            let records = trace.records(&stream);
            assert!(items.len() > 20, "{unit}: {}", items.len());
            // Values before the first item are unknown.
            for (time, item) in items.into_iter().filter(|(_, item)| !item.contains('x')) {
                let record = &records[usize::from_str_radix(&item, 2).unwrap()];
                let seen = words
                    .iter()
                    .rev()
                    .find(|(changed, _)| *changed <= time)
                    .unwrap();
                let bits: String = (0..width)
                    .rev()
                    .map(|bit| {
                        if record[place] >> bit & 1 == 1 {
                            '1'
                        } else {
                            '0'
                        }
                    })
                    .collect();
                assert_eq!(seen.1, bits, "{unit}.{field} at {time}");
            }
        }
        // Taken in as many cycles as there are items.
        let (_, taken) = wave(&file, "project", "taken");
        let high: u64 = taken
            .windows(2)
            .filter(|pair| pair[0].1 == "1")
            .map(|pair| pair[1].0 - pair[0].0)
            .sum();
        assert_eq!(high, 60);
    }
}

/// The values of wires, by unit, lane and name.
type Wires = BTreeMap<(String, Option<u32>, String), Vec<(u64, String)>>;

fn wires(file: &Path) -> Wires {
    let mut waves = wellen::simple::read(file).unwrap();
    let hierarchy = waves.hierarchy();
    let variables: Vec<_> = hierarchy
        .all_vars()
        .map(|variable| {
            (
                hierarchy[variable].full_name(hierarchy),
                hierarchy[variable].signal_ref(),
            )
        })
        .collect();
    let signals: Vec<_> = variables.iter().map(|(_, signal)| *signal).collect();
    waves.load_signals(&signals);
    let times = waves.time_table().to_vec();
    let one = |(name, signal): (String, wellen::SignalRef)| {
        let steps: Vec<&str> = name.split('.').collect();
        let lane =
            (steps.len() == 4).then(|| steps[2].strip_prefix("lane").unwrap().parse().unwrap());
        let changes = waves
            .get_signal(signal)
            .unwrap()
            .iter_changes()
            .map(|(time, value)| (times[time as usize], value.to_string()));
        (
            (steps[1].to_owned(), lane, steps[steps.len() - 1].to_owned()),
            changes.collect(),
        )
    };
    variables.into_iter().map(one).collect()
}

/// Records on a unit's wires in these cycles, lane by lane, with one word per field in the stream's
/// order; unknown ones are left out.
fn shown(
    trace: &Traced,
    wires: &Wires,
    unit: &str,
    stream: &str,
    cycles: &[u64],
) -> Vec<Vec<String>> {
    let fields: Vec<&str> = trace.stream(stream)["fields"]
        .as_array()
        .unwrap()
        .iter()
        .map(|field| field["name"].as_str().unwrap())
        .collect();
    let lanes: std::collections::BTreeSet<Option<u32>> = wires
        .keys()
        .filter(|(of, _, name)| of == unit && name == fields[0])
        .map(|(_, lane, _)| *lane)
        .collect();
    assert!(!lanes.is_empty(), "{unit} has no words");
    let at = |lane: Option<u32>, field: &str, cycle: u64| {
        let changes = &wires[&(unit.to_owned(), lane, field.to_owned())];
        changes[..changes.partition_point(|(time, _)| *time <= cycle)]
            .last()
            .map_or("x", |(_, word)| word.as_str())
            .to_owned()
    };
    let records = cycles.iter().flat_map(|cycle| {
        lanes.iter().map(|lane| {
            fields
                .iter()
                .map(|field| at(*lane, field, *cycle))
                .collect::<Vec<_>>()
        })
    });
    records.filter(|record| !record[0].contains('x')).collect()
}

/// All records of a stream, as shown by wires.
fn all_records(trace: &Traced, stream: &str) -> Vec<Vec<String>> {
    let widths: Vec<u64> = trace.stream(stream)["fields"]
        .as_array()
        .unwrap()
        .iter()
        .map(|field| field["width"].as_u64().unwrap())
        .collect();
    let bits = |(word, width): (&i64, &u64)| {
        (0..*width)
            .rev()
            .map(|bit| if word >> bit & 1 == 1 { '1' } else { '0' })
            .collect::<String>()
    };
    trace
        .records(stream)
        .iter()
        .map(|record| record.iter().zip(&widths).map(bits).collect())
        .collect()
}

/// Cycles decide which of its entries and stamps a tile drops after its pixels have stopped: the
/// waves of those units show times, and no words.
#[test]
fn waves_of_pixels_that_stop_show_no_wrong_words() {
    let stopping = shells(10, 24, &json!({"stop": 0.9}));
    let machine = machine("volume", &["timing.organisation=binned"]);
    let trace = traced(
        &stopping,
        &machine,
        &Window {
            waves: Some([0, 400_000]),
            ..Window::default()
        },
    );
    let wires = wires(&trace.path("waves.fst"));
    let has_words =
        |unit: &str, name: &str| wires.keys().any(|(of, _, wire)| of == unit && wire == name);
    for (unit, stream) in [
        ("project", "project.in"),
        ("ellipse", "ellipse.in"),
        ("bin", "raster.in"),
    ] {
        let field = trace.stream(stream)["fields"][0]["name"]
            .as_str()
            .unwrap()
            .to_owned();
        assert!(has_words(unit, &field), "{unit}");
    }
    for (unit, stream) in [
        ("list", "raster.in"),
        ("raster", "raster.in"),
        ("gauss", "gauss.in"),
    ] {
        let field = trace.stream(stream)["fields"][0]["name"]
            .as_str()
            .unwrap()
            .to_owned();
        assert!(
            !has_words(unit, &field) && has_words(unit, "item"),
            "{unit}"
        );
    }
}

/// All records of every unit's stream are found in the waves, in each organisation, with and
/// without lanes; for a window, its records.
#[test]
fn waves_show_the_words_of_all_units() {
    let binned = machine(
        "tiny",
        &["timing.organisation=binned", "timing.raster.lanes=[4,2]"],
    );
    let two_buffers = machine(
        "tiny",
        &[
            "timing.organisation=binned",
            "timing.tile.buffers=2",
            "timing.raster.lanes=[3,1]",
        ],
    );
    let immediate = machine(
        "tiny",
        &["timing.organisation=immediate", "timing.raster.lanes=[2,2]"],
    );
    let volume = machine("volume", &[]);
    let gaussian = machine("gaussian", &[]);
    let never = json!({"stop": 0});
    let (discs, voxels, gaussians) = (
        cloud(60, 24),
        shells(10, 24, &never),
        bouquet(200, 24, &never),
    );
    let whole = || Window {
        waves: Some([0, 400_000]),
        ..Window::default()
    };
    let cases = [
        ("binned", &discs, &binned, whole()),
        ("two buffers", &discs, &two_buffers, whole()),
        ("immediate", &discs, &immediate, whole()),
        (
            "some splats",
            &discs,
            &binned,
            Window {
                splats: Some([20, 40]),
                ..whole()
            },
        ),
        (
            "some pixels",
            &discs,
            &immediate,
            Window {
                pixels: Some([3, 5, 17, 12]),
                ..whole()
            },
        ),
        (
            "one unit",
            &discs,
            &binned,
            Window {
                units: vec!["project".into()],
                ..whole()
            },
        ),
        ("voxels", &voxels, &volume, whole()),
        ("gaussians", &gaussians, &gaussian, whole()),
    ];
    for (case, scene, machine, window) in cases {
        let trace = traced(scene, machine, &window);
        let wires = wires(&trace.path("waves.fst"));
        let changes = |unit: &str, name: &str| {
            wires[&(unit.to_owned(), None, name.to_owned())]
                .iter()
                .map(|(time, _)| *time)
                .collect::<Vec<u64>>()
        };
        let is_there = |unit: &str| wires.keys().any(|(of, ..)| of == unit);
        let streams: Vec<&str> = trace.manifest["streams"]
            .as_array()
            .unwrap()
            .iter()
            .map(|stream| stream["name"].as_str().unwrap())
            .collect();
        let mut seen = 0;
        let units = [
            "fetch",
            "project",
            "ellipse",
            "bin",
            "list",
            "raster",
            "gauss",
            "cache",
            "fragment",
            "shade",
            "resolve-shade",
            "resolve",
        ];
        let of_units = |unit: &str| match unit {
            "fetch" => "pipeline.in".to_owned(),
            "bin" | "list" => "raster.in".to_owned(),
            "cache" => "fragment.in".to_owned(),
            "resolve-shade" => "shade.in".to_owned(),
            unit => format!("{unit}.in"),
        };
        for unit in units.into_iter().filter(|unit| is_there(unit)) {
            let stream = of_units(unit);
            if !streams.contains(&stream.as_str()) {
                continue;
            }
            let mut expected = all_records(&trace, &stream);
            if ["shade", "resolve-shade", "resolve"].contains(&unit) {
                // One record per cycle, some of them equal: which ones were found.
                let fields = trace.stream(&stream)["fields"].as_array().unwrap();
                let mut cycles: Vec<u64> = fields
                    .iter()
                    .flat_map(|field| changes(unit, field["name"].as_str().unwrap()))
                    .collect();
                cycles.sort_unstable();
                cycles.dedup();
                let mut found = shown(&trace, &wires, unit, &stream, &cycles);
                if unit == "shade" && is_there("resolve-shade") {
                    let times = |name: &str| changes("resolve-shade", name);
                    let mut later: Vec<u64> = fields
                        .iter()
                        .flat_map(|field| times(field["name"].as_str().unwrap()))
                        .collect();
                    later.sort_unstable();
                    found.extend(shown(&trace, &wires, "resolve-shade", &stream, &later));
                }
                if unit == "resolve-shade" {
                    expected.retain(|record| found.contains(record));
                }
                if unit == "resolve" {
                    // A tile without an entry is not written by an engine, and its pixels are
                    // empty.
                    let empty = trace.field(&stream, "empty");
                    expected.retain(|record| found.contains(record) || record[empty] == "0");
                }
                for records in [&mut found, &mut expected] {
                    records.sort();
                    records.dedup();
                }
                assert!(
                    found == expected,
                    "{case}: {unit}: {} of {}",
                    found.len(),
                    expected.len()
                );
                seen += usize::from(!found.is_empty());
                continue;
            }
            let items: Vec<u64> = wires[&(unit.to_owned(), None, "item".to_owned())]
                .iter()
                .filter(|(_, item)| !item.contains('x'))
                .map(|(time, _)| *time)
                .collect();
            let mut found = shown(&trace, &wires, unit, &stream, &items);
            found.sort();
            expected.sort();
            if ["list", "raster", "bin"].contains(&unit) {
                // A splat has several entries and stamps; a box outside the picture's pixels has
                // none.
                found.dedup();
                expected.dedup();
            }
            assert!(
                found == expected && !found.is_empty(),
                "{case}: {unit}: {} of {}",
                found.len(),
                expected.len()
            );
            seen += 1;
        }
        assert!(
            seen >= if case == "one unit" { 1 } else { 6 },
            "{case}: {seen} units"
        );
    }
}

/// Losses of words, as defined in README's *Keys*: bits of flags from the losses that the machine's
/// own arithmetic reports.
#[derive(Default)]
struct Losses(i64);

impl rtl_model::probe::Observer<'static> for Losses {
    fn fork(&self) -> Box<dyn rtl_model::probe::Observer<'static>> {
        Box::new(Losses::default())
    }
    fn hand_over(self: Box<Self>) -> Box<dyn std::any::Any + Send> {
        self
    }
    fn take_over(&mut self, _seen: Box<dyn std::any::Any + Send>) {}
    fn word(&mut self, fit: &rtl_model::num::Fit, exact: i64, more: i64, _word: i64) {
        let loss = fit.loss(exact, more);
        let [inexact, low, high, wrapped] = [
            loss.inexact,
            loss.saturated_low,
            loss.saturated_high,
            loss.wrapped,
        ]
        .map(i64::from);
        self.0 |= inexact | low << 1 | high << 2 | wrapped << 3;
    }
    fn wrapped(&mut self, _signal: usize) {
        self.0 |= 8;
    }
}

const FLAGS: usize = 5;

/// The flags of every record of these streams are those of its words; returns the number of records
/// with each flag.
fn flags_are_those_of_the_words(
    trace: &Traced,
    elaborated: &rtl_model::Elaborated,
    frame: &rtl_model::Frame,
) -> BTreeMap<(String, i64), usize> {
    let mut met = BTreeMap::new();
    let size_px = [frame.width, frame.height];
    let streams = [
        "gauss.out",
        "raster.in",
        "shade.out",
        "ellipse.in",
        "ellipse.out",
        "project.out",
        "fragment.out",
    ];
    let all: BTreeMap<&str, Vec<Vec<i64>>> = streams
        .into_iter()
        .map(|stream| (stream, trace.keys(stream)))
        .collect();
    let (weights, places, made) = (
        trace.records("gauss.out"),
        trace.records("project.in"),
        trace.records("ellipse.out"),
    );
    let mut check = |stream: &str, record: usize, wanted: i64| {
        let flags = all[stream][record][FLAGS];
        assert_eq!(flags, wanted, "{stream} record {record}");
        *met.entry((stream.to_owned(), flags)).or_insert(0) += 1;
    };
    let of = |run: &dyn Fn(&mut Losses)| {
        let mut losses = Losses::default();
        run(&mut losses);
        losses.0
    };
    let sampled = |stream: &str| {
        let records = trace.records(stream);
        let step = records.len() / 200 + 1;
        records.into_iter().enumerate().step_by(step)
    };
    for (record, input) in sampled("gauss.in") {
        let cut_off = if weights[record] == [0] { 16 } else { 0 };
        check(
            "gauss.out",
            record,
            cut_off | of(&|losses| _ = unit_replay::gauss(elaborated, array(&input), losses)),
        );
    }
    for (record, input) in sampled("raster.in") {
        // The flags of a box include those of all its tiles.
        check(
            "raster.in",
            record,
            of(&|losses| {
                _ = unit_replay::raster(
                    elaborated,
                    &frame.view,
                    size_px,
                    array(&input[1..]),
                    losses,
                )
            }),
        );
    }
    for (record, sums) in sampled("shade.in") {
        let input = shade::Input {
            weight: sums[0],
            colour: array(&sums[1..4]),
            opacity: sums[4],
            normal: array(&sums[5..8]),
            material: sums[8] as u32,
            pixel: [0; 2],
        };
        check(
            "shade.out",
            record,
            of(&|losses| _ = unit_replay::shade(elaborated, frame, &input, losses)),
        );
    }
    for (record, input) in sampled("ellipse.in") {
        let own = of(&|losses| {
            _ = unit_replay::ellipse(elaborated, &frame.view, size_px, array(&input), losses)
        });
        let projected = all["ellipse.in"][record][PARENT] as usize;
        let parent = all["project.out"][projected][PARENT] as usize;
        let place = &places[parent];
        let before = of(&|losses| {
            _ = unit_replay::project(elaborated, frame, array(&place[..3]), 0, losses)
        });
        let culled = if made[record][..3] == [0; 3] { 0 } else { 16 };
        check("ellipse.out", record, own | before | culled);
        check("project.out", projected, own | before);
    }
    for (record, output) in sampled("fragment.out") {
        let [merged, evicted] = [2, 3].map(|outcome| output[2] == outcome);
        assert_eq!(
            all["fragment.out"][record][FLAGS] >> 4,
            i64::from(merged) << 1 | i64::from(evicted) << 2
        );
    }
    met
}

#[test]
fn made_up_records_have_the_flags_that_a_scene_s_have() {
    let text = cloud(60, 24);
    let machine = machine("tiny", &[]);
    let (elaborated, frame) = (machine.elaborate().unwrap(), frame(&text, &machine));
    flags_are_those_of_the_words(
        &traced(&text, &machine, &Window::default()),
        &elaborated,
        &frame,
    );
    let made_up = traced(
        &text,
        &machine,
        &Window {
            stimulus: Some(100),
            ..Window::default()
        },
    );
    let met = flags_are_those_of_the_words(&made_up, &elaborated, &frame);
    for stream in ["gauss.out", "ellipse.out", "shade.out"] {
        let saturated = met
            .iter()
            .filter(|((of, flags), _)| of == stream && flags & 6 != 0)
            .map(|(_, count)| count)
            .sum::<usize>();
        assert!(saturated > 0, "{stream}: nothing saturates in {met:?}");
    }
    // As often as coverage.csv counts limits of the only word of the table's product.
    let coverage = std::fs::read_to_string(made_up.path("coverage.csv")).unwrap();
    let limits = |case: &str| -> usize {
        let row = coverage
            .lines()
            .find(|row| row.starts_with(&format!("gauss.weight,\"{case}\"")))
            .unwrap();
        row.rsplit(',').next().unwrap().parse().unwrap()
    };
    let high = made_up
        .keys("gauss.out")
        .iter()
        .filter(|key| key[FLAGS] & 4 != 0)
        .count();
    assert!(
        high >= limits("high limit"),
        "{high} {}",
        limits("high limit")
    );
}

#[test]
fn waves_behind_the_end_of_a_frame_come_with_a_sentence() {
    let text = cloud(20, 16);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, &text).unwrap();
    let scene = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
    let told = |cycles: [u64; 2]| {
        let window = Window {
            waves: Some(cycles),
            ..Window::default()
        };
        let origin = splatsim::cosim::trace::Origin::default();
        splatsim::cosim::trace::trace(
            &scene,
            origin,
            &machine("tiny", &[]),
            &window,
            &folder.path().join("trace"),
        )
        .unwrap()
        .table()
    };
    let behind = told([9_000_000, 9_000_100]);
    let last: u64 = behind
        .split_once("the last item of the frame is taken in cycle ")
        .map(|(_, rest)| rest.replace('\n', " "))
        .unwrap()
        .trim()
        .parse()
        .unwrap();
    assert!(
        behind.contains("--waves 9000000..9000100: no unit takes an item"),
        "{behind}"
    );
    // One cycle earlier there is something.
    assert!(
        !told([last, last + 1]).contains("no unit takes")
            && told([last + 1, last + 2]).contains("no unit takes")
    );
}
