//! What cannot be compared is said to be so.

use super::*;

fn points(folder: &Path) -> Points {
    let path = folder.join("plan.json");
    let plan =
        json!({"scenes": ["torus-knot"], "size": [16, 16], "machine": "tiny", "axes": [{"field": "gauss.weight", "values": ["U0F8"]}]});
    std::fs::write(&path, plan.to_string()).unwrap();
    Points::load(path.to_str().unwrap()).unwrap()
}

#[test]
fn a_picture_with_what_is_no_number_makes_a_row_without_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let points = points(folder.path());
    let options = Options { shard: None, most: 9, prices: Prices::default(), progress: false };
    let drawn = |spoil: &dyn Fn(&mut Stage)| {
        let mut stage = Stage::new(&points, (points.scene(0).unwrap(), Head { digest: String::new(), has_tree: false }), &options);
        stage.golden(&fixed::rules(&points.base));
        spoil(&mut stage);
        stage.drawn(&points.base).map(|_| ())
    };
    assert_eq!(drawn(&|_| ()), Ok(()));
    for wrong in [f64::NAN, f64::INFINITY] {
        let told = "1 pixels have no finite number, and cannot be compared".to_owned();
        assert_eq!(drawn(&|stage| stage.goldens[0].picture.rgba[9][2] = wrong), Err(told.clone()));
        assert_eq!(drawn(&|stage| stage.ideal.rgba[9][2] = wrong), Err(told));
    }
}
