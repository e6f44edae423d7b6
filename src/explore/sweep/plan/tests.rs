use super::*;
use serde_json::json;

fn points(plan: Value) -> Result<Points> {
    validate::check(&plan, &schema()).map_err(|violation| Error::input(violation.to_string()))?;
    Points::new(serde_json::from_value(plan).unwrap(), PathBuf::new())
}

fn refused(plan: Value) -> String {
    match points(plan) {
        Err(Error::Input(sentence)) => sentence,
        other => panic!("{other:?}"),
    }
}

fn changes(points: &Points) -> Vec<String> {
    let text = |(field, value): &MachineChange| format!("{field}={value}");
    (0..points.count())
        .map(|number| {
            points
                .point(number)
                .1
                .iter()
                .map(text)
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect()
}

#[test]
fn a_grid_has_every_value_with_every_other() {
    let points = points(json!({"scenes": ["terrain", "checkerboard"], "axes": [
        {"field": "fragment.layers", "values": [1, 2]},
        {"field": "timing.raster.fifo", "range": [4, 12, 4]}]}))
    .unwrap();
    let on_a_scene = ["1 4", "1 8", "1 12", "2 4", "2 8", "2 12"].map(|pair| {
        let (layers, fifo) = pair.split_once(' ').unwrap();
        format!("fragment.layers={layers} timing.raster.fifo={fifo}")
    });
    assert_eq!(changes(&points), [on_a_scene.clone(), on_a_scene].concat());
    assert_eq!(
        [0, 5, 6, 11].map(|number| points.point(number).0),
        [0, 0, 1, 1]
    );
}

#[test]
fn one_at_a_time_changes_one_field_of_the_base() {
    let plan = json!({"scenes": ["terrain"], "order": "one-at-a-time", "axes": [
        {"field": "fragment.layers", "values": [1, 2]}, {"field": "gauss.weight", "add_frac_bits": [-2]}]});
    assert_eq!(
        changes(&points(plan).unwrap()),
        [
            "",
            "fragment.layers=1",
            "fragment.layers=2",
            "gauss.weight=\"U-2F18\""
        ]
    );
    let all = points(json!({"scenes": ["terrain"], "order": "one-at-a-time", "axes": [{"field": "*", "add_frac_bits": [-1]}]})).unwrap();
    let words = machines::words(&all.base);
    assert_eq!(all.count(), 1 + words.len() as u64);
    assert!(
        words.len() > 50
            && changes(&all)
                .iter()
                .skip(1)
                .zip(&words)
                .all(|(change, (field, _))| change.starts_with(&format!("{field}=")))
    );
}

#[test]
fn a_sample_takes_every_value_equally_often() {
    let plan = |seed: u64| {
        points(json!({"scenes": ["terrain"], "order": "sample", "points": 60, "seed": seed, "axes": [
            {"field": "fragment.layers", "values": [1, 2, 3]}, {"field": "timing.raster.fifo", "range": [1, 20, 1]}]}))
        .unwrap()
    };
    let one = changes(&plan(1));
    for (value, often) in [("fragment.layers=2", 20), ("timing.raster.fifo=7", 3)] {
        assert_eq!(
            one.iter()
                .filter(|change| change.split(' ').any(|part| part == value))
                .count(),
            often,
            "{value}"
        );
    }
    assert_eq!(one, changes(&plan(1)));
    assert_ne!(one, changes(&plan(2)));
    // All pairs can occur: the axes are shuffled differently.
    let pairs: std::collections::BTreeSet<&String> = one.iter().collect();
    assert!(pairs.len() > 30, "{}", pairs.len());
}

#[test]
fn all_numbers_are_shuffled_to_all_places() {
    for count in [1, 2, 3, 7, 64, 1000] {
        let mut places: Vec<u64> = (0..count)
            .map(|number| shuffled(number, count, 5))
            .collect();
        places.sort_unstable();
        assert_eq!(places, (0..count).collect::<Vec<_>>());
    }
}

#[test]
fn a_plan_that_cannot_be_is_refused_in_a_sentence() {
    let plan = |axes: Value| json!({"scenes": ["terrain"], "axes": axes});
    let axis = |axis: Value| refused(plan(json!([axis])));
    assert!(
        axis(json!({"field": "gauss.wait", "values": [1]})).contains("the nearest is `weight`")
    );
    assert!(
        axis(json!({"field": "gauss.weight", "values": ["U99F3"]})).contains("axes: gauss.weight")
    );
    assert_eq!(
        axis(json!({"field": "gauss.weight", "values": []})),
        "axes[0]: gauss.weight has no values"
    );
    let one_of_three = "axes[0]: gauss.weight needs one of values, range and bits to add";
    assert_eq!(axis(json!({"field": "gauss.weight"})), one_of_three);
    assert_eq!(
        axis(json!({"field": "gauss.weight", "values": ["U0F8"], "add_frac_bits": [1]})),
        one_of_three
    );
    assert_eq!(
        axis(json!({"field": "gauss.weight", "range": [1, 2, 1], "add_int_bits": [1]})),
        one_of_three
    );
    for range in [[1, 4, 0], [4, 1, 1], [1, 4, -1]] {
        assert_eq!(
            axis(json!({"field": "fragment.layers", "range": range})),
            "axes[0]: fragment.layers has no values"
        );
    }
    assert!(
        axis(json!({"field": "fragment.layers", "range": [i64::MIN, i64::MAX, 1]}))
            .contains("10000 is the most")
    );
    assert!(
        axis(json!({"field": "fragment.layers", "add_frac_bits": [1]})).contains("is not a word")
    );
    assert!(axis(json!({"field": "*", "add_frac_bits": [1]})).contains("one-at-a-time"));
    assert!(
        axis(json!({"field": "exact", "values": [["rasta"]]}))
            .contains("\"rasta\" is neither a unit nor a word; units are splat, ")
    );
    assert!(axis(json!({"field": "exact", "values": ["raster"]})).contains("is not a list"));
    let twice = json!([{"field": "fragment.layers", "values": [1]}, {"field": "fragment.layers", "values": [2]}]);
    assert_eq!(refused(plan(twice)), "axes has fragment.layers twice");
    assert!(refused(json!({"scenes": [], "axes": []})).contains("scenes is empty"));
    assert!(
        refused(json!({"scenes": ["terrain"], "axes": [], "order": "sample"})).contains("points")
    );
    assert!(refused(json!({"scenes": ["terrain"], "axes": [], "points": 3})).contains("sample"));
    assert!(refused(json!({"scene": ["terrain"], "axes": []})).contains("scenes"));
}

#[test]
fn bits_are_added_on_either_side_and_a_rounding_stays() {
    let axes = json!([{"field": "raster.radial", "add_frac_bits": [-1, 0], "add_int_bits": [-2]}]);
    let all = points(json!({"scenes": ["terrain"], "axes": axes})).unwrap();
    let base = all.base.raster.radial;
    let words: Vec<_> = (0..all.count())
        .map(|number| {
            machines::with(&all.base, &all.point(number).1, "")
                .unwrap()
                .raster
                .radial
        })
        .inspect(|word| assert_eq!((word.round, word.overflow), (base.round, base.overflow)))
        .map(|word| {
            (
                word.format.int_bits - base.format.int_bits,
                word.format.frac_bits - base.format.frac_bits,
            )
        })
        .collect();
    assert_eq!(words, [(0, -1), (0, 0), (-2, 0)]);
    assert_ne!(
        base.overflow, all.base.raster.first.overflow,
        "a word that wraps is needed here"
    );
}

#[test]
fn the_ready_plans_can_be_carried_out() {
    let [precision, in_lockstep, curves, architecture, layers, clock] =
        READY.map(|(name, _)| Points::load(name).unwrap().count());
    assert!(
        (150..250).contains(&precision) && in_lockstep == precision,
        "{precision}"
    );
    assert_eq!((curves, architecture, layers, clock), (45, 200, 12, 72));
}
