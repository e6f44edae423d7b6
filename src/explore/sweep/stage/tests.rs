//! What cannot be compared is said to be so.

use super::*;
use std::path::Path;

fn points() -> Points {
    let plan =
        json!({"scenes": ["torus-knot"], "size": [16, 16], "machine": "tiny", "axes": [{"field": "gauss.weight", "values": ["U0F8"]}]});
    Points::from_text(&plan.to_string(), "plan", Path::new("")).unwrap()
}

#[test]
fn a_picture_with_what_is_no_number_makes_a_row_without_numbers() {
    let points = points();
    let drawn = |spoil: &dyn Fn(&mut Stage)| {
        let mut stage = Stage::new(&points, &Prices::default(), 0, points.scene(0).unwrap());
        spoil(&mut stage);
        stage.drawn(&points.base).map(|_| ())
    };
    let spoilt = |stage: &mut Stage, wrong: f64| {
        let rules = fixed::rules(&stage.points.base);
        let mut picture = stage.golden(&rules).picture.clone();
        picture.rgba[9][2] = wrong;
        stage.goldens = Kept::new(1);
        stage.goldens.get(&rules, || Golden { picture, film: Vec::new(), psnr_db: None, seconds: 0.0 });
    };
    assert_eq!(drawn(&|_| ()), Ok(()));
    for wrong in [f64::NAN, f64::INFINITY] {
        let told = "1 pixels have no finite number, and cannot be compared".to_owned();
        assert_eq!(drawn(&|stage| spoilt(stage, wrong)), Err(told.clone()));
        assert_eq!(drawn(&|stage| stage.ideal.rgba[9][2] = wrong), Err(told));
    }
}
