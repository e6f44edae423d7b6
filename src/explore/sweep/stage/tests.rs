//! Tests: points drawn together equal those drawn separately; pictures with NaN give an error.

use super::*;

/// A plan on few splats, in its own folder.
struct Planned {
    points: Points,
    _folder: tempfile::TempDir,
}

impl Planned {
    fn new(scene: &str, rest: Value) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let splats = json!({"splats": {"builtin": scene, "count": 800}});
        std::fs::write(folder.path().join("scene.json"), splats.to_string()).unwrap();
        let mut plan = json!({"scenes": ["scene.json"], "size": [24, 16], "machine": "tiny"});
        plan.as_object_mut()
            .unwrap()
            .extend(rest.as_object().unwrap().clone());
        let points = Points::from_text(&plan.to_string(), "plan", folder.path()).unwrap();
        Planned {
            points,
            _folder: folder,
        }
    }

    fn stage(&self) -> Stage {
        Stage::new(
            &self.points,
            &Prices::default(),
            0,
            self.points.scene(0).unwrap(),
        )
    }
}

/// Rows of a stage, without host times.
fn rows(stage: &Stage, numbers: &[u64]) -> Vec<(u64, Row)> {
    let columns = stage.columns();
    let mut rows = Vec::new();
    let push = |number, row: Row| {
        let cells = row
            .into_iter()
            .zip(&columns)
            .filter(|(_, (name, _))| !name.starts_with("host_"));
        rows.push((number, cells.map(|(cell, _)| cell).collect()));
        Ok(())
    };
    stage.draw(numbers, push).unwrap();
    rows
}

#[test]
fn points_drawn_together_equal_those_drawn_separately() {
    let words = [
        "shade.light",
        "gauss.weight",
        "resolve.frame",
        "ellipse.conic",
        "fragment.normal_sum",
        "splat.rgb",
    ];
    let words = words.map(|word| json!({"field": word, "add_frac_bits": [-2, -1, 0]}));
    let others = [
        json!({"field": "timing.raster.fifo", "values": [1, 5]}),
        json!({"field": "fragment.layers", "values": [1, 2]}),
        json!({"field": "project.camera", "values": ["U2F8"]}),
    ];
    let axes: Vec<Value> = words.into_iter().chain(others).collect();
    // These six of one frame are replayed in one batch.
    let batched = [
        json!({"field": "timing.organisation", "values": ["binned"]}),
        json!({"field": "timing.raster.fifo", "values": [1, 5, 9]}),
        json!({"field": "timing.shade.latency", "values": [4, 40]}),
        json!({"field": "gauss.weight", "values": ["U0F4", "U0F8"]}),
    ];
    let mut misfits = 0;
    for (scene, order, axes) in [
        ("torus-knot", "one-at-a-time", &axes[..]),
        ("terrain", "sample", &axes[..8]),
        ("glass-spheres", "sample", &axes[..]),
        ("torus-knot", "grid", &batched[..]),
    ] {
        let mut rest = json!({"order": order, "axes": axes});
        if order == "sample" {
            rest["points"] = json!(12);
        }
        let planned = Planned::new(scene, rest);
        let numbers: Vec<u64> = (0..planned.points.count()).collect();
        let misfit = planned
            .stage()
            .columns()
            .iter()
            .position(|(name, _)| name == columns::MISFIT)
            .unwrap();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(3)
            .build()
            .unwrap();
        let together = pool.install(|| rows(&planned.stage(), &numbers));
        assert_eq!(together.len(), numbers.len());
        for (number, row) in together {
            let alone = rows(&planned.stage(), &[number]);
            assert_eq!(alone, [(number, row)], "{scene}");
            misfits += usize::from(!alone[0].1[misfit].is_null());
        }
    }
    assert!(misfits > 2);
}

/// A sweep that is killed while it replays many machines keeps the rows that are finished.
#[test]
fn rows_of_one_frame_come_before_all_of_it_is_replayed() {
    let [first, most] = REPLAYED_TOGETHER;
    let fifos: Vec<u64> = (1..=3 * most as u64).collect();
    let planned = Planned::new(
        "torus-knot",
        json!({"axes": [{"field": "timing.raster.fifo", "values": fifos}]}),
    );
    let stage = planned.stage();
    let numbers: Vec<u64> = (0..planned.points.count()).collect();
    let last_replayed = || {
        stage
            .replays
            .0
            .lock()
            .unwrap()
            .last()
            .unwrap()
            .timing
            .clone()
    };
    let mut seen = Vec::new();
    let push = |number, _| {
        seen.push((number, last_replayed()));
        Ok(())
    };
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    };
    pool(1).install(|| stage.draw(&numbers, push)).unwrap();
    assert_eq!(
        seen.iter().map(|(number, _)| *number).collect::<Vec<_>>(),
        numbers
    );
    let together: Vec<usize> = seen
        .chunk_by(|a, b| a.1.same_cycles_as(&b.1))
        .map(<[_]>::len)
        .collect();
    assert!(
        together[0] == first && together.len() > 3 && together.iter().all(|rows| *rows <= most),
        "{together:?}"
    );
    // With more threads other rows are written together.
    assert_eq!(
        pool(1).install(|| rows(&planned.stage(), &numbers)),
        pool(2).install(|| rows(&planned.stage(), &numbers))
    );
}

/// A grid has machines with different stamps in turn; they are still replayed in whole batches.
#[test]
fn points_that_can_be_replayed_as_a_batch_follow_each_other() {
    let planned = Planned::new(
        "torus-knot",
        json!({"axes": [
            {"field": "timing.raster.fifo", "range": [1, 20, 1]},
            {"field": "timing.raster.lanes", "values": [[1, 1], [2, 2], [4, 1]]},
        ]}),
    );
    let stage = planned.stage();
    let numbers: Vec<u64> = (0..planned.points.count()).collect();
    let groups = stage.groups(&numbers).unwrap();
    let [group] = &groups[..] else {
        panic!("{} frames", groups.len());
    };
    let mut all: Vec<u64> = group.iter().map(|point| point.number).collect();
    all.sort_unstable();
    assert_eq!(all, numbers);
    for most in MOST_OF_A_BATCH..=group.len() {
        let (mut rest, mut lengths) = (&group[..], Vec::new());
        while !rest.is_empty() {
            let (now, later) = rest.split_at(whole_batches(rest, most));
            assert!(now.len() <= most, "{} of {most}", now.len());
            for batch in now.chunk_by(|a, b| a.order == b.order) {
                let full = batch.len() / MOST_OF_A_BATCH;
                lengths.extend(std::iter::repeat_n(MOST_OF_A_BATCH, full));
                lengths.extend(Some(batch.len() % MOST_OF_A_BATCH).filter(|left| *left > 0));
            }
            rest = later;
        }
        // 20 machines of each of three orders.
        assert_eq!(lengths, [8, 8, 4].repeat(3), "at most {most}");
    }
}

#[test]
fn work_that_was_replayed_is_not_replayed_again_on_the_same_microarchitecture() {
    let planned = Planned::new(
        "torus-knot",
        json!({"axes": [{"field": "gauss.weight", "values": ["U0F8"]}]}),
    );
    let stage = planned.stage();
    let found = |settings: &[&str]| {
        let settings: Vec<String> = settings
            .iter()
            .map(|setting| (*setting).to_owned())
            .collect();
        let machine = machines::load("tiny", &settings).unwrap();
        let drawn = stage
            .drawn(&machine, &stage.golden_of(&machine).unwrap())
            .unwrap();
        assert!(
            drawn
                .on(&[&machine], &stage.prices, &stage.replays)
                .iter()
                .all(|found| found.is_ok())
        );
        stage.replays.0.lock().unwrap().len()
    };
    assert_eq!(found(&[]), 1);
    assert_eq!(found(&["shade.light=I2F9"]), 1);
    assert_eq!(found(&["gauss.weight=U0F2"]), 2);
    assert_eq!(found(&["timing.raster.fifo=9"]), 3);
    for fifo in 10..20 {
        assert_eq!(found(&[&format!("timing.raster.fifo={fifo}")]), 4);
    }
    // The first is still kept, and is not repeated.
    let first = Arc::clone(&stage.replays.0.lock().unwrap()[0]);
    assert_eq!(found(&[]), 4);
    assert!(Arc::ptr_eq(&first, &stage.replays.0.lock().unwrap()[0]));
}

#[test]
fn a_picture_with_nan_makes_a_row_without_numbers() {
    let planned = Planned::new(
        "torus-knot",
        json!({"axes": [{"field": "gauss.weight", "values": ["U0F8"]}]}),
    );
    let base = &planned.points.base;
    let drawn = |spoil: &dyn Fn(&mut Stage)| {
        let mut stage = planned.stage();
        spoil(&mut stage);
        stage
            .drawn(base, &stage.golden_of(base).unwrap())
            .map(|_| ())
    };
    let spoilt = |stage: &mut Stage, wrong: f64| {
        let rules = fixed::rules(base);
        let mut picture = stage.golden(&rules).picture.clone();
        picture.rgba[9][2] = wrong;
        stage.goldens = Kept::new(1);
        stage.goldens.get(&rules, || GoldenPicture {
            picture,
            film: Vec::new(),
            psnr_db: None,
            seconds: 0.0,
        });
    };
    assert_eq!(drawn(&|_| ()), Ok(()));
    for wrong in [f64::NAN, f64::INFINITY] {
        let told = "1 pixels have no finite number, and cannot be compared".to_owned();
        assert_eq!(drawn(&|stage| spoilt(stage, wrong)), Err(told.clone()));
        assert_eq!(drawn(&|stage| stage.ideal.rgba[9][2] = wrong), Err(told));
    }
}
