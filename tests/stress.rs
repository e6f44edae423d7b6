//! Does the stress catalogue hold? Every case reaches the limit that it names, and every failure
//! there is reported.

use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use std::any::Any;
use std::collections::BTreeSet;
use std::sync::OnceLock;

use assert_cmd::Command;
use glam::{DMat2, DVec2, DVec3};
use rtl_model::probe::Observer;
use rtl_model::units::fragment::{Contribution, Decision};
use rtl_model::{Machine, pipeline};
use splatsim::explore::stress;
use splatsim::explore::stress::{
    CASES, Case, Catalogue, FOCAL_PX, Failure, MachineReport, PointFindings,
};
use splatsim::golden;
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::scene::{Scene, Splat};

/// Whether the catalogue is run, which takes a minute and a half.
fn has_turn() -> bool {
    tier::runs(Tier::Ci)
}

fn catalogue() -> &'static Catalogue {
    static ONCE: OnceLock<Catalogue> = OnceLock::new();
    ONCE.get_or_init(|| stress::run(&CASES.iter().collect::<Vec<_>>(), &[]).unwrap())
}

fn case(name: &str) -> &'static Case {
    stress::find(name).unwrap()
}

/// The scene at the case's last value, and that value.
fn worst(name: &str) -> (Scene, f64) {
    let case = case(name);
    let value = case.values[case.values.len() - 1];
    ((case.scene)(value), value)
}

fn report(name: &str, machine: &str) -> &'static MachineReport {
    let case = catalogue()
        .cases
        .iter()
        .find(|case| case.name == name)
        .unwrap();
    case.machines
        .iter()
        .find(|report| report.machine == machine)
        .unwrap()
}

fn found(name: &str, machine: &str, value: f64) -> &'static PointFindings {
    report(name, machine)
        .points
        .iter()
        .find(|point| point.value == value)
        .unwrap()
        .found()
        .unwrap()
}

/// The named machines that draw a case.
fn named(case: &Case) -> Vec<&'static str> {
    let scene = (case.scene)(case.values[0]);
    if scene.ellipsoids.is_some() {
        vec![machines::usual(&scene)]
    } else {
        vec!["reference", "lean", "tiny", "window"]
    }
}

/// Every forbidden behaviour of a machine, one line each.
fn faults(of: impl Fn(&PointFindings) -> u64) -> Vec<String> {
    let mut faults = Vec::new();
    for case in &catalogue().cases {
        for machine in &case.machines {
            for point in &machine.points {
                let count = point.found().map_or(0, &of);
                if count > 0 {
                    faults.push(format!(
                        "{} at {} on {}: {count}",
                        case.name, point.value, machine.machine
                    ));
                }
            }
        }
    }
    faults
}

// ---- Properties of all cases ----

#[test]
fn no_pixel_exceeds_its_bound() {
    if !has_turn() {
        return;
    }
    assert_eq!(faults(|found| found.lockstep.violations), [""; 0]);
}

#[test]
fn every_flip_is_explained() {
    if !has_turn() {
        return;
    }
    assert_eq!(faults(|found| found.lockstep.flips.unexplained), [""; 0]);
    assert!(
        faults(|found| found.lockstep.flips.total()).len() > 100,
        "hardly any decision flips: the catalogue asks too little"
    );
}

#[test]
fn no_failure_is_silent() {
    if !has_turn() {
        return;
    }
    assert_eq!(faults(|found| found.beyond.silent), [""; 0]);
    assert!(
        faults(|found| found.beyond.pixels).len() > 100,
        "hardly anything fails: the catalogue asks too little"
    );
    assert!(catalogue().check().is_ok() && catalogue().faults() == 0);
}

#[test]
fn every_case_is_drawn_by_every_named_machine_or_refused_in_a_sentence() {
    if !has_turn() {
        return;
    }
    assert!(CASES.len() >= 24 && catalogue().cases.len() == CASES.len());
    for (case, report) in CASES.iter().zip(&catalogue().cases) {
        let names: Vec<&str> = report
            .machines
            .iter()
            .map(|machine| machine.machine.as_str())
            .collect();
        assert_eq!(names[..named(case).len()], named(case), "{}", case.name);
        assert_eq!(
            names.len(),
            named(case).len() + usize::from(case.variant.is_some()),
            "{}",
            case.name
        );
        for machine in &report.machines {
            assert_eq!(
                machine
                    .points
                    .iter()
                    .map(|point| point.value)
                    .collect::<Vec<_>>(),
                case.values,
                "{}",
                case.name
            );
            // Only a cutoff beyond the table and a voxel that is too large for every word are
            // refused.
            let refused = machine
                .points
                .iter()
                .filter(|point| point.found().is_none());
            let may = |value: f64| {
                case.name == "rim" && value > 4.0 || case.name == "extinction" && value > 7.0
            };
            assert!(
                refused.clone().all(|point| may(point.value)),
                "{} on {}",
                case.name,
                machine.machine
            );
        }
    }
}

/// At its harmless end a case draws correctly on `reference`; otherwise its parameter is not the
/// cause of the failure.
#[test]
fn no_case_fails_on_the_reference_machine_at_its_harmless_end() {
    if !has_turn() {
        return;
    }
    for case in &CASES {
        let found = found(case.name, named(case)[0], case.values[0]);
        assert!(
            found.lockstep.max_error < 1e-3 && found.lockstep.share_over_1 == 0.0,
            "{}: {found:?}",
            case.name
        );
        assert!(found.covered_pixels > 0, "{} shows nothing", case.name);
    }
}

#[test]
fn the_reference_machine_is_never_worse_off_than_the_lean_one_nor_that_than_the_tiny_one() {
    if !has_turn() {
        return;
    }
    let fails_at = |case: &Case, machine: &str| {
        let report = report(case.name, machine);
        report
            .points
            .iter()
            .position(|point| point.failure().is_some())
            .unwrap_or(usize::MAX)
    };
    for case in CASES.iter().filter(|case| named(case).len() > 1) {
        let [reference, lean, tiny] = Machine::NAMES.map(|machine| fails_at(case, machine));
        assert!(
            reference >= lean && lean >= tiny,
            "{}: {reference} {lean} {tiny}",
            case.name
        );
    }
}

// ---- Each case reaches its limit ----

/// Variance of a splat's footprint on the screen, computed from two projected tangents, unlike in
/// the renderers.
fn variance(scene: &Scene, splat: &Splat) -> DMat2 {
    let (u, v) = splat.normal.any_orthonormal_pair();
    let p = splat.position;
    let tangent = |t: DVec3| {
        let t = t * splat.radius * FOCAL_PX / p.z;
        DVec2::new(t.x - p.x / p.z * t.z, t.y - p.y / p.z * t.z)
    };
    let outer = |t: DVec2| DMat2::from_cols(t * t.x, t * t.y);
    outer(tangent(u)) + outer(tangent(v)) + scene.kernel.low_pass * DMat2::IDENTITY
}

/// Long and short axis of a footprint, and the direction of the long one in degrees.
fn axes(variance: DMat2) -> (f64, f64, f64) {
    let (a, b, d) = (variance.x_axis.x, variance.x_axis.y, variance.y_axis.y);
    let (mean, half) = ((a + d) / 2.0, ((a - d) / 2.0).hypot(b));
    let direction = (2.0 * b).atan2(a - d).to_degrees() / 2.0;
    // Computing the small axis from the determinant of the exact square roots would also cancel;
    // this is accurate to 1e-7 here.
    (
        (mean + half).sqrt(),
        (mean - half).max(0.0).sqrt(),
        direction.rem_euclid(180.0),
    )
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

/// c_n, as a cosine between normal and ray.
fn facing(splat: &Splat) -> f64 {
    splat.normal.dot(splat.position.normalize()).abs()
}

#[test]
fn grazing_discs_are_seen_edge_on_in_the_end() {
    for degrees in [90.0, 10.0, 0.01] {
        let scene = (case("grazing").scene)(degrees);
        let sine = f64::to_radians(degrees).sin();
        assert!(
            scene
                .splats
                .iter()
                .all(|splat| close(facing(splat), sine, 1e-6)),
            "{degrees}"
        );
    }
    let (scene, degrees) = worst("grazing");
    assert!(degrees == 0.0 && scene.splats.iter().all(|splat| facing(splat) < 1e-15));
}

#[test]
fn needles_have_the_aspect_that_they_say_up_to_ten_thousand() {
    for aspect in [1.0, 10.0, 1000.0] {
        let scene = (case("needles").scene)(aspect);
        for splat in &scene.splats {
            let (long, short, _) = axes(variance(&scene, splat));
            assert!(
                close(long / short, aspect, 0.03),
                "{aspect}: {long} {short}"
            );
        }
    }
    assert_eq!(worst("needles").1, 1e4);
}

#[test]
fn the_turned_ellipse_is_the_same_one_in_every_direction() {
    for degrees in case("turned").values {
        let scene = (case("turned").scene)(*degrees);
        for splat in &scene.splats {
            let (long, short, direction) = axes(variance(&scene, splat));
            assert!(close(long / short, 8.0, 0.1), "{long} {short}");
            // Its normal leans in the direction of the short axis.
            let off = (direction - 90.0 - degrees + 90.0).rem_euclid(180.0) - 90.0;
            assert!(off.abs() < 5.0, "{degrees}: {direction}");
        }
    }
}

#[test]
fn without_a_low_pass_filter_the_conic_leaves_its_word() {
    if !has_turn() {
        return;
    }
    let (scene, low_pass) = worst("low-pass-off");
    assert!(low_pass == 0.0 && scene.kernel.low_pass == 0.0);
    assert!(
        scene
            .splats
            .iter()
            .any(|splat| variance(&scene, splat).inverse().y_axis.y > 4.0)
    );
    for machine in Machine::NAMES {
        let found = found("low-pass-off", machine, 0.0);
        assert!(
            found.saturated > 0 && found.overflowed.contains(&"ellipse.conic".to_owned()),
            "{machine}: {:?}",
            found.overflowed
        );
    }
}

#[test]
fn sub_pixel_splats_go_down_to_a_thousandth_of_a_pixel() {
    let (scene, radius_px) = worst("sub-pixel");
    let k = scene.splats[0].radius * FOCAL_PX / scene.splats[0].position.z;
    assert!(radius_px == 1e-3 && close(k, 1e-3, 1e-9));
    // The requested picture does not change.
    let [first, last] =
        [1.0, 1e-3].map(|value| golden::ideal(&(case("sub-pixel").scene)(value)).picture);
    assert!(
        last.rgba[24 * 48 + 24]
            .iter()
            .zip(first.rgba[24 * 48 + 24])
            .all(|(a, b)| (a - b).abs() < 0.25)
    );
}

#[test]
fn huge_splats_are_a_hundred_frames_wide() {
    let (scene, frames) = worst("huge");
    for splat in &scene.splats {
        let width = 2.0 * (scene.kernel.cutoff * variance(&scene, splat).x_axis.x).sqrt();
        assert!(
            frames == 100.0 && close(width, 100.0 * scene.image.width as f64, 1e-3),
            "{width}"
        );
    }
}

#[test]
fn a_machine_with_too_few_guard_bits_drifts_where_one_with_enough_does_not() {
    if !has_turn() {
        return;
    }
    let settings = case("guard-bits").variant.unwrap().settings;
    let machine = machines::load("reference", &settings(12.0)).unwrap();
    assert_eq!(
        [machine.raster.first, machine.raster.second].map(|word| word.format.frac_bits),
        [12, 12]
    );
    let error = |bits| found("guard-bits", "fewer bits", bits).lockstep.max_error;
    assert!(
        error(24.0) < 3e-4 && error(12.0) > 5.0 * error(24.0) && error(8.0) > 5.0 * error(12.0)
    );
}

/// Draws a case's scene on its variant.
fn on_variant(case: &Case, value: f64, watcher: &mut dyn Observer<'static>) {
    let machine = machines::load("reference", &(case.variant.unwrap().settings)(value)).unwrap();
    let elaborated = fixed::elaborate(&machine).unwrap();
    let quantised = quantise::quantise(&(case.scene)(value), &machine).unwrap();
    pipeline::draw_with_decisions(&elaborated, &quantised.frame, watcher);
}

#[test]
fn the_radial_index_wraps_and_comes_back_inside_the_footprint() {
    if !has_turn() {
        return;
    }
    for (machine, from, register) in [("6-bit r", 6.0, 32.0), ("lean", 12.0, 256.0)] {
        for point in report("wrap", machine)
            .points
            .iter()
            .filter(|point| point.value >= from)
        {
            // The exact value in a corner of the box, across the ellipse.
            let scene = (case("wrap").scene)(point.value);
            let variance = variance(&scene, &scene.splats[0]);
            let corner = DVec2::splat((scene.kernel.cutoff * variance.x_axis.x).sqrt().min(24.0));
            assert!(
                corner.dot(variance.inverse() * corner) > register,
                "{} on {machine}",
                point.value
            );
            let found = point.found().unwrap();
            assert!(
                found.wrapped > 0 && found.lockstep.flips.coverage > 0,
                "{} on {machine}: {found:?}",
                point.value
            );
            assert!(
                found.fixed_vs_golden.max_error > 0.5,
                "{} on {machine}: nothing shows",
                point.value
            );
        }
    }
    assert!(
        report("wrap", "reference")
            .points
            .iter()
            .all(|point| point.found().unwrap().wrapped == 0)
    );
}

/// Fragments whose r is 0 on the machine, by pixel.
#[derive(Default)]
struct AtZero(Vec<(u32, u32)>);

impl Observer<'static> for AtZero {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(AtZero::default())
    }
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }
    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        self.0.extend(seen.downcast::<AtZero>().unwrap().0);
    }
    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, _: Decision) {
        if contribution.radial_index == 0 {
            self.0.push((x, y));
        }
    }
}

#[test]
fn r_falls_below_zero_and_is_held_there() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let case = case("negative-r");
    let value = 2.0;
    let mut zero = AtZero::default();
    on_variant(case, value, &mut zero);
    let scene = (case.scene)(value);
    let centre = |splat: &Splat| {
        DVec2::new(splat.position.x, splat.position.y) / splat.position.z * FOCAL_PX
    };
    // In exact arithmetic there are values above the register's LSB.
    let below = zero.0.iter().filter(|(x, y)| {
        let at = DVec2::new(f64::from(*x) + 0.5 - 36.0, f64::from(*y) + 0.5 - 18.0);
        scene.splats.iter().all(|splat| {
            let d = at - centre(splat);
            d.dot(variance(&scene, splat).inverse() * d) > 1e-3
        })
    });
    let below = below.count();
    assert!(below > 10, "{below} of {} fragments at 0", zero.0.len());
}

#[test]
fn the_table_ends_a_hundred_millionth_beyond_a_fragment() {
    let (scene, short) = worst("table-end");
    let r = 16.0 * variance(&scene, &scene.splats[0]).inverse().x_axis.x;
    let table = Machine::named("reference")
        .unwrap()
        .gauss
        .radial_index
        .format;
    assert!(short == 1e-8 && scene.kernel.cutoff == 4.0 && table.int_bits == 2);
    assert!((4.0 - r - short).abs() < 1e-12, "{r}");
}

#[test]
fn at_the_rim_almost_nothing_is_divided_by_itself() {
    if !has_turn() {
        return;
    }
    let (scene, cutoff) = worst("rim");
    let least = (-cutoff / 2.0).exp() / std::f64::consts::TAU;
    assert!(least < 2e-7 && scene.surface.coverage_threshold == 1e-6);
    for machine in Machine::NAMES {
        let refused = report("rim", machine)
            .points
            .iter()
            .filter(|point| point.failure() == Some(Failure::Refused));
        assert_eq!(
            refused.count(),
            case("rim")
                .values
                .iter()
                .filter(|cutoff| **cutoff > 4.0)
                .count(),
            "{machine}"
        );
    }
    assert!(
        report("rim", "wide table")
            .points
            .iter()
            .all(|point| point.found().is_some())
    );
}

#[test]
fn the_offset_has_eight_bits_and_fewer() {
    if !has_turn() {
        return;
    }
    let width = |bits| {
        machines::load(
            "reference",
            &(case("8-bit-offset").variant.unwrap().settings)(bits),
        )
        .unwrap()
        .raster
        .offset
        .format
        .width()
    };
    assert_eq!([16.0, 8.0, 7.0].map(width), [16, 8, 7]);
    assert!(
        found("8-bit-offset", "fewer bits", 7.0).lockstep.max_error
            > 50.0 * found("8-bit-offset", "reference", 7.0).lockstep.max_error
    );
}

/// If setup does not turn normals, two nearly opposite normals give a random direction; if turned,
/// they are equal.
#[test]
fn normals_that_cancel_are_trouble_only_where_they_are_not_turned() {
    if !has_turn() {
        return;
    }
    assert_eq!(report("cancel", "reference").arithmetic_fails_at, None);
    let not_turned = report("cancel", "not turned");
    assert!(
        not_turned
            .arithmetic_fails_at
            .is_some_and(|degrees| degrees <= 1.0),
        "{:?}",
        not_turned.arithmetic_fails_at
    );
}

#[test]
fn a_hundred_thousand_contributions_meet_on_one_pixel() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let (scene, count) = worst("crowd");
    assert_eq!(
        golden::render(&scene, &golden::Rules::default())
            .outcomes
            .most_in_a_pixel,
        100_000
    );
    assert_eq!(count, 1e5);
    for machine in Machine::NAMES {
        let found = found("crowd", machine, 1e5);
        assert!(
            found.overflowed.contains(&"fragment.weight_sum".to_owned()) && found.saturated > 0,
            "{machine}: {:?}",
            found.overflowed
        );
    }
}

#[test]
fn the_near_plane_is_approached_to_a_millionth_from_both_sides() {
    if !has_turn() {
        return;
    }
    let scene = (case("near-plane").scene)(1e-6);
    let from_plane: Vec<f64> = scene
        .splats
        .iter()
        .map(|splat| splat.position.z - scene.camera.near)
        .filter(|d| d.abs() < 0.1)
        .collect();
    assert!(from_plane.iter().all(|d| close(d.abs(), 1e-6, 1e-6)));
    assert_eq!(
        [
            from_plane.iter().filter(|d| **d > 0.0).count(),
            from_plane.iter().filter(|d| **d < 0.0).count()
        ],
        [5, 5]
    );
    // Machines with a coarser LSB misjudge the side.
    assert!(
        found("near-plane", "tiny", 1e-6).lockstep.flips.cull > 0
            && found("near-plane", "reference", 1e-6).lockstep.flips.cull == 0
    );
}

#[test]
fn depths_reach_a_million_times_the_nearest() {
    let (scene, _) = worst("depth-range");
    let depths = scene.splats.iter().map(|splat| splat.position.z);
    let (near, far) = depths.fold((f64::INFINITY, 0.0_f64), |(near, far), z| {
        (near.min(z), far.max(z))
    });
    assert!(close(far / near, 1e6, 1e-9));
}

#[test]
fn a_far_origin_changes_nothing_and_a_stray_point_does() {
    let (scene, distance) = worst("far-origin");
    assert!(close(scene.camera.eye.length(), distance, 1e-9) && distance == 1e12);
    let machine = Machine::named("reference").unwrap();
    let exponent = |name, value| {
        quantise::quantise(&(case(name).scene)(value), &machine)
            .unwrap()
            .scale
            .exponent
    };
    assert_eq!(exponent("far-origin", 1e12), exponent("far-origin", 1.0));
    // A million is twenty bits, and the scene itself uses one or two of them.
    let places = exponent("stray-point", 1.0) - exponent("stray-point", 1e6);
    assert!((18..=20).contains(&places), "{places}");
}

#[test]
fn off_screen_centres_lie_outside_and_still_reach_in() {
    for (beyond, drawn) in [(0.4, 4), (0.4999, 4), (0.5001, 0)] {
        let scene = (case("off-screen").scene)(beyond);
        for splat in &scene.splats {
            let centre = DVec2::new(splat.position.x, splat.position.y)
                .abs()
                .max_element()
                / splat.position.z
                * FOCAL_PX;
            assert!(close(centre, 24.0 * (1.0 + beyond), 1e-9));
        }
        let culled = golden::render(&scene, &golden::Rules::default())
            .culled
            .outside;
        assert_eq!(culled, 4 - drawn, "{beyond}");
    }
}

#[test]
fn coincident_surfaces_lie_on_both_sides_of_epsilon() {
    if !has_turn() {
        return;
    }
    for gap in [0.9999, 1.0, 1.0001] {
        assert!(case("coincident").values.contains(&gap));
        let scene = (case("coincident").scene)(gap);
        let depths: Vec<f64> = scene.splats.iter().map(|splat| splat.position.z).collect();
        let (near, far) = depths.iter().fold((9.0_f64, 0.0_f64), |(near, far), z| {
            (near.min(*z), far.max(*z))
        });
        assert!(close((far - near) / scene.surface.z_threshold, gap, 1e-9));
    }
    // The side of ε depends on an ulp of the depth.
    let flips = |gap| found("coincident", "lean", gap).lockstep.flips.slot;
    assert!(
        flips(0.9999) + flips(1.0) + flips(1.0001) > 1000 && flips(0.5) == 0 && flips(2.0) == 0
    );
}

#[test]
fn a_small_epsilon_tears_a_sloped_surface_and_a_large_one_joins_two() {
    let surfaces = |name: &str, radii: f64| {
        golden::ideal(&(case(name).scene)(radii))
            .outcomes
            .most_surfaces_in_a_pixel
    };
    assert_eq!(surfaces("small-epsilon", 3.0), 2);
    // More surfaces in front of each other than the machines have slots.
    assert!(
        surfaces("small-epsilon", 0.01) > 8,
        "{}",
        surfaces("small-epsilon", 0.01)
    );
    assert_eq!(surfaces("large-epsilon", 16.0), 1);
}

#[test]
fn intersecting_surfaces_cross_at_the_angle_that_they_say() {
    let scene = (case("intersecting").scene)(30.0);
    let apart = scene
        .splats
        .iter()
        .map(|splat| splat.normal.dot(scene.splats[0].normal))
        .fold(1.0, f64::min);
    assert!(close(apart, 30_f64.to_radians().cos(), 1e-9));
}

#[test]
fn up_to_sixty_four_surfaces_lie_behind_a_pixel() {
    if !has_turn() {
        return;
    }
    let (scene, _) = worst("layers");
    assert_eq!(golden::ideal(&scene).outcomes.most_surfaces_in_a_pixel, 64);
    assert_eq!(report("layers", "reference").method_fails_at, Some(4.0));
}

#[test]
fn parallel_discs_have_no_depth_slope() {
    let (scene, _) = worst("parallel");
    assert!(scene.splats.iter().all(
        |splat| splat.normal == DVec3::NEG_Z && splat.position.z == scene.splats[0].position.z
    ));
    let (tilted, least) = ((case("parallel").scene)(1e-6), 1e-6_f64.to_radians());
    assert!(
        tilted
            .splats
            .iter()
            .all(|splat| close(splat.normal.y.abs(), least, 1e-6))
    );
}

#[test]
fn opacities_are_zero_one_and_less_than_a_step() {
    let step = Machine::named("reference")
        .unwrap()
        .splat
        .opacity
        .format
        .value(1);
    let values = case("opacity").values;
    assert!(
        values.contains(&0.0)
            && values.contains(&1.0)
            && values
                .iter()
                .any(|value| *value > 0.0 && *value < step / 2.0)
    );
}

#[test]
fn normals_cancel_to_nothing() {
    for (degrees, scene) in
        [10.0, 0.001, 0.0].map(|degrees: f64| (degrees, (case("cancel").scene)(degrees)))
    {
        for pair in scene.splats.chunks(2) {
            let left = (pair[0].normal + pair[1].normal).length();
            assert!(
                (left - 2.0 * (degrees.to_radians() / 2.0).sin()).abs() < 1e-12,
                "{degrees}: {left}"
            );
        }
    }
}

#[test]
fn the_last_merge_is_of_less_than_the_machine_can_hold() {
    let (scene, opacity) = worst("faint-merge");
    let tiny = Machine::named("tiny").unwrap();
    assert!(
        opacity < tiny.shade.premultiplied.format.value(1)
            && scene.splats.iter().all(|splat| splat.opacity == opacity)
    );
    assert!(
        golden::render(&scene, &golden::Rules::default())
            .outcomes
            .merged
            > 1000
    );
}

#[test]
fn spheres_lie_around_each_other_in_no_order() {
    let (scene, spheres) = worst("nested-shells");
    let radius = |splat: &Splat| {
        (1e6 * (splat.position - DVec3::new(0.0, 0.0, 2.0)).length()).round() as i64
    };
    let radii: BTreeSet<i64> = scene.splats.iter().map(radius).collect();
    assert_eq!(radii.len() as f64, spheres);
    let gaps = radii
        .iter()
        .zip(radii.iter().skip(1))
        .map(|(a, b)| (b - a) as f64 / 1e6);
    assert!(
        gaps.into_iter().all(|gap| gap > scene.surface.z_threshold),
        "{radii:?}"
    );
    assert!(
        scene
            .splats
            .windows(2)
            .filter(|pair| radius(&pair[0]) != radius(&pair[1]))
            .count()
            > scene.splats.len() / 2
    );
}

#[test]
fn a_noisy_scan_scatters_by_its_parameter() {
    for scatter in [0.01, 1.0, 8.0] {
        let (still, moved) = (
            (case("noisy-scan").scene)(0.0),
            (case("noisy-scan").scene)(scatter),
        );
        let off =
            |(a, b): (&Splat, &Splat)| (b.position.z - a.position.z) / still.surface.z_threshold;
        let off: Vec<f64> = still.splats.iter().zip(&moved.splats).map(off).collect();
        let (least, most) = off.iter().fold((0.0, 0.0), |(least, most), of| {
            (of.min(least), of.max(most))
        });
        assert!(
            close(most - least, scatter, 0.01) && close(most, scatter / 2.0, 0.02),
            "{scatter}: {least} {most}"
        );
    }
}

#[test]
fn lone_splats_are_as_many_on_a_pixel_as_they_say_and_no_two_one_surface() {
    for on_a_pixel in [4.0, 32.0] {
        let scene = (case("lone-splats").scene)(on_a_pixel);
        let outcomes = golden::render(
            &scene,
            &golden::Rules {
                layers: 64,
                ..golden::Rules::default()
            },
        )
        .outcomes;
        let contributions = (outcomes.inserted + outcomes.accumulated) as f64;
        let pixels = (scene.image.width * scene.image.height) as f64;
        assert!(
            close(contributions / pixels, on_a_pixel, 0.1),
            "{}",
            contributions / pixels
        );
        assert!(outcomes.accumulated as f64 / contributions < 0.1);
    }
}

#[test]
fn highlights_become_narrower_than_a_step_of_their_table() {
    let (_, shininess) = worst("highlight");
    let steps = f64::from(
        1 << Machine::named("reference")
            .unwrap()
            .shade
            .highlight_table
            .index_bits,
    );
    // Half of the highlight is gone one step before its end.
    assert!((1.0 - 1.0 / steps).powf(shininess) < 0.5);
}

// ---- Output files ----

#[test]
fn cases_of_ellipsoids_reach_their_limits() {
    if !has_turn() {
        return;
    }
    let thin = worst("thin-kernels").0.ellipsoids.unwrap();
    assert!(thin.orientations.iter().all(|of| close(
        of.scales.max_element() / of.scales.min_element(),
        1e6,
        1e-9
    )));
    let (beside, half_pictures) = worst("beside");
    assert!(
        beside
            .splats
            .iter()
            .any(|splat| splat.position.x / splat.position.z * FOCAL_PX >= half_pictures * 24.0)
    );
    let (equal, step) = worst("one-depth");
    assert!(
        step == 0.0
            && equal
                .splats
                .iter()
                .all(|splat| splat.position.z == equal.splats[0].position.z)
    );
    assert_eq!(
        found("one-depth", "gaussian", 0.0).lockstep.flips.total(),
        0
    );
    assert!(found("one-depth", "gaussian", 1e-6).lockstep.flips.order > 0);
    let (faint, count) = worst("faint-crowd");
    assert!(
        faint.splats.len() as f64 == count && faint.splats.iter().all(|splat| splat.opacity < 1e-3)
    );
    assert!(
        found("extinction", "volume", 10.0)
            .overflowed
            .iter()
            .any(|signal| signal.contains("depth_index"))
    );
    assert_eq!(worst("slices").0.splats.len(), 81_000);
    let flat = worst("flattened").0.ellipsoids.unwrap();
    assert!(flat.orientations.iter().all(|of| of.scales.z == 1e-9));
}

#[test]
fn nothing_written_depends_on_the_number_of_threads() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let cases = ["wrap", "rim", "coincident"].map(case);
    let written = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let catalogue = pool.install(|| stress::run(&cases, &[]).unwrap());
        let paths = pool.install(|| catalogue.write(folder.path()).unwrap());
        let files: Vec<Vec<u8>> = paths
            .iter()
            .map(|path| std::fs::read(path).unwrap())
            .collect();
        (catalogue.table(), files)
    };
    let one = written(1);
    assert!(one == written(3) && one.1.len() == 4 && one.1.iter().all(|file| !file.is_empty()));
}

#[test]
fn the_table_has_a_line_for_each_case_and_machine_and_fits_a_terminal() {
    if !has_turn() {
        return;
    }
    let table = catalogue().table();
    assert!(
        table.lines().all(|line| line.chars().count() <= 80),
        "{table}"
    );
    let rows: usize = CASES
        .iter()
        .map(|case| named(case).len() + usize::from(case.variant.is_some()))
        .sum();
    assert_eq!(
        table.lines().take_while(|line| !line.is_empty()).count(),
        1 + rows
    );
    assert!(
        table.ends_with(
            "0 pixels exceed their bound, 0 flips are unexplained, 0 failures\nare silent"
        ),
        "{table}"
    );
}

/// The cells of a line of a CSV file, in which a quote inside quotes is doubled.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            c => cells.last_mut().unwrap().push(c),
        }
    }
    cells
}

#[test]
fn the_files_hold_every_point() {
    if !has_turn() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    catalogue().write(folder.path()).unwrap();
    let text = std::fs::read_to_string(folder.path().join("stress.csv")).unwrap();
    let rows: Vec<Vec<String>> = text.lines().map(cells).collect();
    let points: usize = catalogue()
        .cases
        .iter()
        .flat_map(|case| &case.machines)
        .map(|machine| machine.points.len())
        .sum();
    assert_eq!(rows.len(), 1 + points);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let refused = rows
        .iter()
        .find(|row| row[..3] == ["rim", "lean", "28"])
        .unwrap();
    assert!(refused.last().unwrap().contains("gauss.radial_index") && refused[3].is_empty());
    let column = rows[0]
        .iter()
        .position(|name| name == "fixed_led_max")
        .unwrap();
    let drawn = rows
        .iter()
        .find(|row| row[..3] == ["needles", "lean", "30"])
        .unwrap();
    assert_eq!(
        drawn[column],
        found("needles", "lean", 30.0)
            .lockstep
            .max_error
            .to_string()
    );

    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("stress.json")).unwrap()).unwrap();
    let point = &json["cases"][1]["machines"][1]["points"][3];
    assert_eq!(
        (json["cases"][1]["name"].as_str(), point["value"].as_f64()),
        (Some("needles"), Some(30.0))
    );
    assert_eq!(
        point["drawn"]["lockstep"]["max_error"].as_f64(),
        Some(found("needles", "lean", 30.0).lockstep.max_error)
    );
    for name in ["stress.png", "gallery.png"] {
        let picture = image::open(folder.path().join(name)).unwrap().into_rgb8();
        assert!(picture.width() > 1000 && picture.height() > 1000, "{name}");
    }
}

#[test]
fn every_case_is_in_the_gallery() {
    if !has_turn() {
        return;
    }
    for case in &CASES {
        let report = catalogue()
            .cases
            .iter()
            .find(|report| report.name == case.name)
            .unwrap();
        let (value, machine) = case.telling;
        let points = report
            .machines
            .iter()
            .find(|report| report.machine == machine)
            .map(|report| &report.points);
        let shown = points.and_then(|points| points.iter().find(|point| point.value == value));
        assert!(
            shown.is_some_and(|point| point.found().is_some()),
            "{} has no {value} on {machine}",
            case.name
        );
    }
}

/// A row of the book's tables of failures: its case, and the cells that state where it fails.
type FailureRow = (String, Vec<String>);

fn expected_in_the_book() -> Vec<FailureRow> {
    let surfaces = told_behind("<!-- stress -->", 5);
    surfaces
        .into_iter()
        .chain(told_behind("<!-- stress of ellipsoids -->", 3))
        .collect()
}

fn told_behind(mark: &str, count: usize) -> Vec<FailureRow> {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/stress.md"))
        .unwrap();
    let table = text
        .split(mark)
        .nth(1)
        .expect("the book has the table")
        .trim_start();
    let rows = table
        .lines()
        .take_while(|line| line.starts_with('|'))
        .skip(2);
    let row = |line: &str| {
        let mut cells = line.split('|').skip(1).map(|cell| cell.trim().to_owned());
        let name = cells.next().unwrap_or_default();
        (
            name.split(',').next().unwrap_or_default().to_owned(),
            cells.take(count).collect(),
        )
    };
    rows.map(row).collect()
}

/// The expected cells of a case. Surfaces: failures of the method and of two machines, then both of
/// `window`. Ellipsoids: method, the named machine, the variant.
fn failures(case: &str) -> Vec<String> {
    let value = |value: Option<f64>| {
        value.map_or("–".into(), |value| {
            if value < 1e4 {
                value.to_string()
            } else {
                format!("{value:e}")
            }
        })
    };
    let case = self::case(case);
    let machines = named(case);
    let method = |machine| value(report(case.name, machine).method_fails_at);
    let arithmetic = |machine| {
        let report = report(case.name, machine);
        let how = match report.arithmetic_fails_by {
            Some(Failure::Error) => " e",
            Some(Failure::Bound) => " b",
            Some(Failure::Refused) => " r",
            None => "",
        };
        value(report.arithmetic_fails_at) + how
    };
    if machines.len() > 1 {
        return vec![
            method("reference"),
            arithmetic("reference"),
            arithmetic("lean"),
            method("window"),
            arithmetic("window"),
        ];
    }
    vec![
        method(machines[0]),
        arithmetic(machines[0]),
        case.variant
            .map_or("–".into(), |variant| arithmetic(variant.name)),
    ]
}

#[test]
fn the_book_lists_every_failure() {
    if !has_turn() {
        return;
    }
    let told = expected_in_the_book();
    let wrong = told.iter().filter(|(name, cells)| *cells != failures(name));
    let wrong: Vec<String> = wrong
        .map(|(name, _)| format!("| {name} | {} |", failures(name).join(" | ")))
        .collect();
    // Every case in which a method, the best machine or the machine of windows fails has a row.
    let fails = |case: &&Case| {
        failures(case.name)
            .iter()
            .enumerate()
            .any(|(i, cell)| i != 2 && cell != "–")
    };
    let silent = CASES
        .iter()
        .filter(fails)
        .filter(|case| told.iter().all(|(name, _)| name != case.name));
    let silent: Vec<String> = silent
        .map(|case| format!("| {} | {} |", case.name, failures(case.name).join(" | ")))
        .collect();
    assert!(
        wrong.is_empty() && silent.is_empty(),
        "the book should have:\n{}\nand new:\n{}",
        wrong.join("\n"),
        silent.join("\n")
    );
}

/// The effect of wider words in the slow pan.
#[test]
fn a_slow_pan_flickers_less_the_wider_the_words_are() {
    if !has_turn() {
        return;
    }
    let jumps = |machine: &str| {
        let all = report("slow-pan", machine)
            .points
            .iter()
            .map(|point| point.found().unwrap().flicker);
        let (first, rest): (Vec<_>, Vec<_>) = all.partition(Option::is_none);
        assert_eq!(
            (first.len(), rest.len()),
            (1, case("slow-pan").values.len() - 1)
        );
        rest.into_iter()
            .flatten()
            .map(|flicker| flicker.fixed_vs_golden.jumps.unwrap())
            .sum::<f64>()
    };
    let [reference, lean, tiny] = Machine::NAMES.map(jumps);
    assert!(
        reference < lean && lean < tiny && tiny > 0.1,
        "{reference} {lean} {tiny}"
    );
    assert!(
        CASES
            .iter()
            .filter(|case| case.name != "slow-pan")
            .all(|case| found(case.name, named(case)[0], case.values[0])
                .flicker
                .is_none())
    );
}

// ---- The command ----

fn splatsim(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(PROGRAM.as_str())
        .arg("stress")
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn one_case_can_be_run_on_one_more_machine() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("coarse.json");
    std::fs::write(
        &machine,
        r#"{"base": "lean", "gauss": {"weight": "U-2F9"}}"#,
    )
    .unwrap();
    let out = folder.path().join("out");
    let arguments = [
        "--case",
        "off-screen",
        "--machine",
        machine.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--threads",
        "2",
    ];
    let (status, printed, complaint) = splatsim(&arguments);
    assert_eq!((status, complaint.as_str()), (0, ""));
    assert!(
        printed.contains("coarse") && !printed.contains("needles"),
        "{printed}"
    );
    for name in ["stress.json", "stress.csv", "stress.png", "gallery.png"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert_eq!(
        splatsim(&[&arguments[..2], &["--quiet"]].concat()),
        (0, String::new(), String::new())
    );
}

#[test]
fn bad_arguments_are_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let broken = folder.path().join("broken.json");
    std::fs::write(&broken, r#"{"base": "lean", "gauss": {"weight": "U9F40"}}"#).unwrap();
    for (arguments, says) in [
        (vec!["--case", "needels"], "the nearest is `needles`"),
        (
            vec!["--machine", "leen"],
            "no such file, and no named machine either",
        ),
        (vec!["--machine", broken.to_str().unwrap()], "gauss.weight"),
        (vec!["--out", file.to_str().unwrap()], "a folder is needed"),
        (vec!["--threads", "0"], "1..=1024"),
        (vec!["needles"], "unexpected argument"),
    ] {
        let (status, printed, complaint) = splatsim(&arguments);
        assert_eq!((status, printed.as_str()), (2, ""), "{arguments:?}");
        assert!(
            complaint.contains(says) && complaint.lines().count() == 1,
            "{arguments:?}: {complaint}"
        );
    }
}
