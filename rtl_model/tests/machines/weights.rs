//! Do weights of summed Gaussians fall with depth as defined, and only where a machine has their
//! words?

use crate::frames::{Rng, ellipsoids};
use crate::tier;
use rtl_model::frame::{Amplitude, Each, Frame, Orientation, Scaled};
use rtl_model::machine::{DepthWeight, SortKind};
use rtl_model::num::{Format, Rounding, Word};
use rtl_model::pipeline::{draw_unobserved, unit_replay};
use rtl_model::probe::NoProbe;
use rtl_model::records::{EllipseOut, EllipsoidIn};
use rtl_model::{Elaborated, Machine};

fn word(format: &str) -> Word {
    Word::new(format.parse().unwrap())
}

/// `weighted` with weights that fall with depth.
fn falling(words: DepthWeight) -> Machine {
    let mut machine = Machine::named("weighted").unwrap();
    machine.sort.as_mut().unwrap().depth_weight = Some(words);
    machine
}

/// One Gaussian in the middle of a frame whose weights are 0 from 1/(mantissa · 2^−places) on.
fn frame_of_one(machine: &Machine, inverse_distance: Scaled) -> Frame {
    let mut frame = ellipsoids(machine, 3, 1 << 40);
    let of = frame.ellipsoids.as_mut().unwrap();
    of.kernel.amplitude = Amplitude::Peak;
    of.kernel.inverse_distance = inverse_distance;
    of.kernel.reach.clear();
    of.own = vec![Orientation::default()];
    frame.view.cull_backfaces = false;
    frame
}

/// What `ellipse` makes of a ball at depth `forward` · 2^`exponent`, in words.
fn ball(
    elaborated: &Elaborated,
    frame: &Frame,
    (forward, exponent, opacity): (i64, i64, i64),
) -> EllipseOut {
    let m = &elaborated.machine;
    let words = m.ellipse.ellipsoid.unwrap();
    let one = |word: Word| word.format.one();
    let record = EllipsoidIn {
        normal_z: one(m.splat.normal),
        radius: one(m.splat.radius) / 8,
        quaternion_w: one(words.quaternion),
        scale_0: one(words.scale),
        scale_1: one(words.scale),
        scale_2: one(words.scale),
        opacity,
        forward,
        exponent,
        inverse_depth: m.project.reciprocal.format().one() / 2,
        ..EllipsoidIn::default()
    };
    let made = unit_replay::ellipsoid(elaborated, frame, record.into_words(), &mut NoProbe);
    EllipseOut::from_words(made.unwrap())
}

/// Worked out by hand, with 1/σ = ½ · 2^−1, so that σ is 4. Ties round up.
#[test]
fn a_weight_is_that_of_the_depth() {
    let mut machine = falling(DepthWeight {
        share: word("U1F4"),
        weight: word("U1F3"),
    });
    machine.splat.opacity = word("U1F8");
    machine.ellipse.amplitude = word("U1F8");
    let elaborated = machine.elaborate().unwrap();
    let frame = frame_of_one(
        &machine,
        Scaled {
            mantissa: 8,
            places: 1,
        },
    );
    let one = machine.project.camera.format.one();
    for (forward, exponent, opacity, amplitude) in [
        // t_z = 1.5: the share is 6/16, the weight 10/16 = 5/8; 200 · 5/8 = 125.
        (3 * one / 4, 1, 200, 125),
        // t_z = 1.625: the share is 6.5/16, so 7/16; the weight 9/16 = 4.5/8, so 5/8; 3 · 5/8 =
        // 1.875.
        (13 * one / 16, 1, 3, 2),
        // t_z = 3.75: the share is 15/16; the weight 1/16 = 0.5/8, so 1/8; 256 · 1/8 = 32.
        (15 * one / 16, 2, 256, 32),
        // t_z = 1/64: the share is 1/256, so 0; the weight is 1.
        (one / 2, -5, 77, 77),
        // t_z = 4 and 7: no weight is left.
        (one / 2, 3, 256, 0),
        (7 * one / 8, 3, 256, 0),
    ] {
        let made = ball(&elaborated, &frame, (forward, exponent, opacity));
        let case = format!("{forward} · 2^{exponent}, {opacity}");
        assert_eq!(made.faint, i64::from(amplitude == 0), "{case}");
        assert_eq!(made.amplitude, amplitude, "{case}");
    }
}

/// For any words, fixed point or not.
#[test]
fn no_opacity_is_raised_and_none_grows_with_depth() {
    let mut rng = Rng(41);
    let mut lowered = 0;
    for _ in 0..tier::of([8, 8], 400) {
        let mut any = |formats: [&str; 4]| {
            let round = [Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven]
                [rng.below(3) as usize];
            word(formats[rng.below(4) as usize]).rounded(round)
        };
        let words = DepthWeight {
            share: any(["U1F16", "U1F4", "U1F16S8", "U3F9"]),
            weight: any(["U1F16", "U1F3", "U1F16S5", "U2F11"]),
        };
        let mut machine = falling(words);
        machine.splat.opacity = any(["U1F8", "U3F20", "U1F12S6", "U2F10"]);
        let elaborated = machine.elaborate().unwrap();
        let sort = machine.sort.as_mut().unwrap();
        sort.depth_weight = None;
        let same = machine.elaborate().unwrap();
        let (share, opacity) = (words.share.format, machine.splat.opacity.format);
        let mantissa = (share.one() as f64 * rng.between(0.5, 1.0)) as i64;
        let places = rng.below(9) as i64 - 4;
        let frame = frame_of_one(
            &machine,
            Scaled {
                mantissa: share.representable(mantissa),
                places,
            },
        );
        for _ in 0..40 {
            let one = machine.project.camera.format.one();
            let [mut near, mut far] = [(); 2].map(|()| one / 2 + rng.below(one as u64 / 2) as i64);
            if near > far {
                (near, far) = (far, near);
            }
            let exponent = rng.below(9) as i64 - 4;
            let alpha = rng.below(opacity.one() as u64 + 1) as i64;
            let alpha = opacity.representable(alpha);
            let of = |elaborated, forward| ball(elaborated, &frame, (forward, exponent, alpha));
            let [without, nearer, farther] =
                [of(&same, near), of(&elaborated, near), of(&elaborated, far)]
                    .map(|made| made.amplitude);
            let case = format!("{words:?}, {alpha} of {opacity}, {near} and {far}");
            assert!(nearer <= without, "{case}: {nearer} and {without}");
            assert!(farther <= nearer, "{case}: {farther} and {nearer}");
            lowered += u64::from(nearer < without && farther < nearer);
        }
    }
    assert!(lowered > 50, "{lowered}");
}

/// Where σ is so large that every share rounds to 0, weights are 1: the drawing is that of
/// `weighted`, bit for bit. With a smaller σ it is another.
#[test]
fn a_far_distance_draws_the_picture_of_equal_weights() {
    let equal = Machine::named("weighted").unwrap().elaborate().unwrap();
    let machine = falling(DepthWeight::default());
    let elaborated = machine.elaborate().unwrap();
    let mut differ = 0;
    for seed in 0..tier::of([10, 5], 100) as u64 {
        let mut frame = ellipsoids(&machine, seed, [1000, 12, 500][seed as usize % 3]);
        let Some(sheets) = &mut frame.sheets else {
            continue;
        };
        (sheets.each, sheets.stop) = (Each::Slice, 0);
        sheets.numbers.clear();
        let near = draw_unobserved(&elaborated, &frame);
        frame
            .ellipsoids
            .as_mut()
            .unwrap()
            .kernel
            .inverse_distance
            .places = 100;
        let far = draw_unobserved(&elaborated, &frame);
        assert!(far == draw_unobserved(&equal, &frame), "seed {seed}");
        let of = frame.ellipsoids.as_ref().unwrap();
        let is_peak = [Amplitude::Peak, Amplitude::Compensated].contains(&of.kernel.amplitude);
        assert!(
            is_peak || near == far,
            "seed {seed}: only Gaussians have such weights"
        );
        differ += u64::from(near.frame != far.frame);
    }
    assert!(differ > 0, "{differ}");
}

/// Each error is one sentence; the suggested formats elaborate.
#[test]
fn weights_that_cannot_be_are_refused() {
    let refused = |change: fn(&mut Machine)| {
        let mut machine = falling(DepthWeight::default());
        assert!(machine.elaborate().is_ok());
        change(&mut machine);
        machine.elaborate().unwrap_err()
    };
    let told = refused(|machine| machine.sort.as_mut().unwrap().kind = SortKind::Tile);
    let sentence = "sort.depth_weight weights summed Gaussians, and sort.kind is another: leave it out, or let sort.kind be none";
    assert_eq!(told, [sentence]);
    let told = refused(|machine| machine.ellipse.ellipsoid = None);
    assert!(
        told.iter().any(|told| told
            .starts_with("sort.depth_weight weights Gaussians, but ellipse.ellipsoid is left out")),
        "{told:?}"
    );
    let told = refused(|machine| {
        let words = machine
            .sort
            .as_mut()
            .unwrap()
            .depth_weight
            .as_mut()
            .unwrap();
        words.share = Word::new(Format::unsigned(0, 12));
        words.weight = Word::new(Format::signed(2, 12));
    });
    assert_eq!(
        told,
        [
            "sort.depth_weight.share is U0F12 and must hold 1: U1F12 would fit",
            "sort.depth_weight.weight is I2F12, but its values are never negative: U2F12 would fit",
        ]
    );
}
