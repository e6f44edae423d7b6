//! The check can fail: machines are checked against the bounds of a better one.

use super::*;
use crate::hardware::machines;
use crate::hardware::quantise::quantise;
use crate::scene::Overrides;

/// `reference` with these settings, checked against the bounds of `reference` without them.
fn checked_against_reference(settings: &[&str]) -> Lockstep {
    let mut scene = Scene::load(
        "glass-spheres",
        &Overrides {
            size: Some((96, 96)),
        },
    )
    .unwrap();
    scene.splats = scene.splats.into_iter().step_by(3).collect();
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    let [drawn, claimed] =
        [&settings[..], &[]].map(|settings| machines::load("reference", settings).unwrap());
    let quantised = quantise(&scene, &claimed).unwrap();
    assert_eq!(quantised, quantise(&scene, &drawn).unwrap());
    draw_against(
        &scene,
        &fixed::elaborate(&drawn).unwrap(),
        &fixed::elaborate(&claimed).unwrap(),
        &quantised,
        CheckedTiles::All,
    )
}

#[test]
fn a_machine_within_its_own_bounds_passes() {
    let honest = checked_against_reference(&[]);
    assert_eq!((honest.violations, honest.flips.unexplained), (0, 0));
}

#[test]
fn a_coarser_table_exceeds_the_bound() {
    assert!(
        checked_against_reference(&["gauss.table.index_bits=3", "gauss.falloff=U1F8"]).violations
            > 100
    );
}

#[test]
fn coarser_pixel_positions_cause_unexplained_flips() {
    let flips = checked_against_reference(&["project.pixel=I15F4"]).flips;
    assert!(
        flips.unexplained > 100 && flips.coverage > flips.unexplained / 2,
        "{flips:?}"
    );
}

#[test]
fn coarser_depths_cause_unexplained_flips() {
    let flips =
        checked_against_reference(&["raster.depth=I18F24", "ellipse.depth_slope=I3F8"]).flips;
    assert!(flips.unexplained > 10, "{flips:?}");
}

#[test]
fn a_nan_weight_may_overflow_every_word() {
    let limits = SumLimits::new(
        &machines::load("reference", &[]).unwrap(),
        Near::exact(0.999),
    );
    let attributes = &[Near::exact(0.5); ATTRIBUTES];
    // Only the sum of weights is large.
    let overflows = |weight: f64, error: f64| {
        let arrival = BoundedContribution {
            golden: Fragment {
                weight,
                alpha: 0.25,
                ..Fragment::default()
            },
            weight: Near {
                value: weight,
                error,
            },
            attributes,
            filled: limits.filled(attributes),
            depth_word: 0,
            depth: OnceCell::new(),
            find_depth: &|| Near::exact(1.0),
        };
        pixel::Bounds::new(&limits, &arrival).overflowed
    };
    assert!(!overflows(0.5, 0.0));
    for wrong in [f64::NAN, f64::INFINITY] {
        assert!(overflows(wrong, 0.0) && overflows(0.5, wrong), "{wrong}");
    }
}

#[test]
fn nan_violates_every_bound() {
    let (right, fixed) = (Near::within(0.5, 0.25), [0.5; 4]);
    assert!(!violates(fixed, [right; 4]));
    assert_eq!(worst_channels([0.5, 0.75, 0.5, 0.5], [right; 4])[0], 0.25);
    // An infinite bound claims nothing.
    assert!(!violates(
        fixed,
        [Near {
            value: 0.5,
            error: f64::INFINITY
        }; 4]
    ));
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for channel in 0..4 {
            let mut near = [right; 4];
            // `around` returns this for a missing bound.
            near[channel] = Near {
                value: wrong,
                error: f64::INFINITY,
            };
            assert!(violates(fixed, near), "{wrong}");
            assert_eq!(worst_channels(fixed, near), [f64::INFINITY; 2]);
        }
    }
    let mut near = [right; 4];
    near[2].error = f64::NAN;
    assert!(violates(fixed, near));
    assert_eq!(worst_channels(fixed, near)[1], f64::INFINITY);
    let mut frame = checked_against_reference(&[]);
    let fixed = frame.led.clone();
    frame.led.rgba[17][1] = f64::NAN;
    let summary = frame.summary(&fixed);
    assert_eq!(
        (
            summary.bound_violations,
            summary.not_finite,
            summary.psnr_db
        ),
        (1, 1, Some(0.0))
    );
}

/// The machine keeps blocks, or passes over them, by other leaders.
#[test]
fn another_test_of_blocks_causes_unexplained_flips() {
    let size = Some((48, 40));
    let mut scene = Scene::load("bouquet", &Overrides { size }).unwrap();
    scene.splats = scene.splats.into_iter().step_by(2).collect();
    let words = r#"{"block_px": 4, "leaders": "corners", "offset": "I15F10", "square": "U18F8", "product": "I18F8", "conic": "U2F20", "conic_cross": "I3F20", "radial": "U18F12"}"#;
    let tested = format!("contribution={words}");
    let built = |settings: &[&str]| {
        let settings: Vec<String> = [&tested[..]]
            .iter()
            .chain(settings)
            .map(|s| (*s).to_owned())
            .collect();
        fixed::elaborate(&machines::load("gaussian", &settings).unwrap()).unwrap()
    };
    let claimed = built(&[]);
    let quantised = quantise(&scene, &claimed.machine).unwrap();
    let flips = |drawn: &Elaborated| {
        draw_against(&scene, drawn, &claimed, &quantised, CheckedTiles::All).flips
    };
    assert_eq!(flips(&claimed).unexplained, 0);
    for setting in ["contribution.leaders=diagonal", "contribution.block_px=8"] {
        let flips = flips(&built(&[setting]));
        assert!(flips.unexplained > 20, "{setting}: {flips:?}");
    }
}
