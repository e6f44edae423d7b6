//! Does the machine keep the laws of splatting (docs/book/algorithm.md §3 to §6,
//! docs/book/algorithm-resolve.md §7) within a few ulp?

use crate::tier::{self, Tier};
use std::any::Any;
use std::f64::consts::TAU;

use crate::handmade::{Rng, confetti, scene, splat};
use glam::{DMat2, DMat3, DVec2, DVec3};
use rtl_model::machine::Machine;
use rtl_model::num::{Fit, Word};
use rtl_model::pipeline;
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::Observer;
use rtl_model::{Drawing, Frame};
use splatsim::hardware::fixed;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Scene, Splat};

fn machines() -> impl Iterator<Item = Elaborated> {
    Machine::NAMES.into_iter().map(named)
}

fn named(name: &str) -> Elaborated {
    fixed::elaborate(&Machine::named(name).unwrap()).unwrap()
}

fn words(scene: &Scene, machine: &Elaborated) -> Frame {
    quantise(scene, &machine.machine).unwrap().frame
}

fn draw(scene: &Scene, machine: &Elaborated) -> Drawing {
    pipeline::draw_unobserved(machine, &words(scene, machine))
}

// --- Setup ---

/// Records every word of every signal.
struct Words(Vec<(usize, i64)>);

impl Observer<'static> for Words {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(Words(Vec::new()))
    }
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }
    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        self.0.extend(seen.downcast::<Words>().unwrap().0);
    }
    fn word(&mut self, fit: &Fit, _exact: i64, _more: i64, word: i64) {
        self.0.push((fit.signal, word));
    }
}

fn value(word: Word, bits: i64) -> f64 {
    bits as f64 / f64::from(word.format.frac_bits).exp2()
}

fn last_place(word: Word) -> f64 {
    value(word, 1)
}

/// Results of setup for one splat, of the machine or of the formulas.
#[derive(Debug)]
struct Ellipse {
    pixel: DVec2,
    depth: f64,
    /// Q00, Q01, Q11.
    conic: [f64; 3],
    amplitude: f64,
    /// First and last column, first and last row, before they are clipped to the picture.
    sides: [f64; 4],
}

/// The machine's setup of the only splat of a frame; none if it is culled.
fn machine_sets_up(machine: &Elaborated, frame: &Frame) -> Option<Ellipse> {
    let mut heard = Words(Vec::new());
    let setup = pipeline::set_up_observed(machine, frame, &mut heard);
    let of = |unit: &str, name: &str| -> Vec<f64> {
        let (signal, word) = machine
            .signals
            .iter()
            .enumerate()
            .find(|(_, s)| s.unit == unit && s.name == name)
            .map(|(i, s)| (i, s.word))
            .unwrap();
        heard
            .0
            .iter()
            .filter(|(heard, _)| *heard == signal)
            .map(|(_, bits)| value(word, *bits))
            .collect()
    };
    if setup.splats() == 0 {
        return None;
    }
    let (pixel, conic, sides) = (
        of("project", "pixel"),
        of("ellipse", "conic"),
        of("ellipse", "edge"),
    );
    Some(Ellipse {
        pixel: DVec2::new(pixel[0], pixel[1]),
        depth: of("project", "depth")[0],
        conic: [conic[0], of("ellipse", "conic_cross")[0], conic[1]],
        amplitude: of("ellipse", "amplitude")[0],
        sides: std::array::from_fn(|side| sides[side]),
    })
}

/// docs/book/algorithm.md §3, applied to the values of the words of a frame's only splat.
fn formulas_set_up(machine: &Machine, frame: &Frame) -> Ellipse {
    let (own, view) = (&frame.splats[0], &frame.view);
    let vector = |word: Word, bits: [i32; 3]| {
        DVec3::from_array(bits.map(|bits| value(word, i64::from(bits))))
    };
    let row = |row: usize| {
        DVec3::from_array(view.rotation[row].map(|bits| value(machine.project.rotation, bits)))
    };
    let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    let eye = DVec3::from_array(view.eye.map(|bits| value(machine.project.eye, bits)));
    let t = rotation * (vector(machine.splat.position, own.position) - eye);
    let n = rotation * vector(machine.splat.normal, own.normal);
    let focal = DVec2::from_array(
        view.focals()
            .map(|focal| value(machine.project.focal, focal)),
    );
    let (a, b) = (t.x / t.z, t.y / t.z);
    let k = focal * value(machine.splat.radius, i64::from(own.radius)) / t.z;
    // Pixels that are not square stretch first the disc like wide pixels, then the picture.
    let stretch = DMat2::from_diagonal(k);
    let g = DVec2::new(n.x - a * n.z, n.y - b * n.z);
    let disc = DMat2::from_cols_array(&[
        1.0 + a * a - g.x * g.x,
        a * b - g.x * g.y,
        a * b - g.x * g.y,
        1.0 + b * b - g.y * g.y,
    ]);
    let disc = stretch * disc * stretch;
    let low_pass = value(machine.ellipse.low_pass, view.low_pass);
    let variance = disc + DMat2::IDENTITY * low_pass;
    let facing = n.dot(DVec3::new(a, b, 1.0));
    // For unit normals this is det V; these normals have unit length within an ulp.
    let area = k.x * k.y * facing;
    let determinant =
        area * area + low_pass * (disc.col(0).x + disc.col(1).y) + low_pass * low_pass;
    let cutoff = value(machine.raster.cutoff, view.cutoff);
    let pixel = DVec2::new(a, b) * focal
        + DVec2::from_array(view.centre.map(|off| value(machine.project.pixel, off)));
    let extent = DVec2::new(
        (cutoff * variance.col(0).x).sqrt(),
        (cutoff * variance.col(1).y).sqrt(),
    );
    let middle = DVec2::new(f64::from(frame.width) - 1.0, f64::from(frame.height) - 1.0) / 2.0;
    let (first, last) = (pixel + middle - extent, pixel + middle + extent);
    Ellipse {
        pixel,
        depth: t.z,
        conic: [variance.col(1).y, -variance.col(0).y, variance.col(0).x].map(|v| v / determinant),
        amplitude: area.abs() / determinant.sqrt() / TAU,
        sides: [first.x, last.x, first.y, last.y],
    }
}

/// One splat of k pixels anywhere in the picture, with any tilt. Half of the pictures have another
/// lens: its axis is off the middle, and its pixels are not square if the machine supports this.
fn one_splat(rng: &mut Rng, k: f64, machine: &Machine) -> Scene {
    let z = (3.0 * rng.roll()).exp2();
    let position = [z * rng.within(0.5), z * rng.within(0.5), z];
    let own = Splat {
        normal: rng.direction(),
        ..splat(position, k * z / 500.0)
    };
    let mut scene = scene(512, 512, 500.0, vec![own]);
    if rng.roll() < 0.5 {
        // Near enough to the axis to stay in the picture.
        scene.splats[0].position *= DVec3::new(0.75, 0.75, 1.0);
        scene.camera.centre_px = Some([256.0 + rng.within(60.0), 256.0 + rng.within(60.0)]);
        let other = 500.0 * 0.5_f64.powf(rng.roll());
        let focal_px = if rng.roll() < 0.5 {
            [500.0, other]
        } else {
            [other, 500.0]
        };
        scene.camera.focal_px = machine.ellipse.aspect.map(|_| focal_px);
    }
    scene
}

/// Permitted error of each word of a splat's setup: its own ulps, and the effect of one ulp of the
/// tilt and of c_n. This effect is large for a large disc seen edge-on, whose det V is a small
/// difference.
struct Tolerance {
    pixel: f64,
    depth: f64,
    conic: [f64; 3],
    amplitude: f64,
}

fn tolerance(machine: &Machine, frame: &Frame, ideal: &Ellipse) -> Tolerance {
    let own = &machine.ellipse;
    // The larger of both.
    let focal = value(machine.project.focal, frame.view.focal);
    let turn = 2.0 * last_place(own.facing);
    let [xx, xy, yy] = ideal.conic;
    // det Q = 1/det V, and A = √(det V_r/det V)/2π.
    let root = (xx * yy - xy * xy).sqrt();
    let k = focal * value(machine.splat.radius, i64::from(frame.splats[0].radius)) / ideal.depth;
    // V and k²·c_n are words relative to a power of four near k².
    let unit = (4.0 * k * k).max(1.0);
    let grain = unit * last_place(own.variance) * root * root;
    let (moved, area) = (
        (k * k * turn + unit * last_place(own.area)) * root,
        TAU * ideal.amplitude,
    );
    let relative =
        2.0 * area * moved + moved * moved + 2.0 * grain + 8.0 * last_place(own.size_squared);
    Tolerance {
        pixel: last_place(machine.project.pixel)
            + focal
                * (last_place(machine.project.slope) + 2.0 * last_place(machine.project.camera)),
        depth: 4.0 * last_place(machine.project.camera) * ideal.depth.log2().ceil().exp2(),
        conic: ideal
            .conic
            .map(|q| 2.0 * last_place(own.conic) + 2.0 * grain + q.abs() * relative),
        amplitude: 2.0 * last_place(own.amplitude) + (moved + area * relative) / TAU,
    }
}

/// Largest errors of setup over many splats, relative to the tolerance; for the box in pixels.
#[derive(Debug, Default)]
struct Worst {
    pixel: f64,
    depth: f64,
    conic: f64,
    amplitude: f64,
    lost_px: f64,
    spare_px: f64,
}

impl Worst {
    fn see(&mut self, own: &Ellipse, ideal: &Ellipse, tolerance: &Tolerance) {
        self.pixel = self
            .pixel
            .max((own.pixel - ideal.pixel).abs().max_element() / tolerance.pixel);
        self.depth = self
            .depth
            .max((own.depth - ideal.depth).abs() / tolerance.depth);
        for i in 0..3 {
            self.conic = self
                .conic
                .max((own.conic[i] - ideal.conic[i]).abs() / tolerance.conic[i]);
        }
        self.amplitude = self
            .amplitude
            .max((own.amplitude - ideal.amplitude).abs() / tolerance.amplitude);
        for (first, last) in [(0, 1), (2, 3)] {
            let outwards = [
                ideal.sides[first].ceil() - own.sides[first],
                own.sides[last] - ideal.sides[last].floor(),
            ];
            self.lost_px = outwards
                .into_iter()
                .fold(self.lost_px, |most, px| most.max(-px));
            self.spare_px = outwards.into_iter().fold(self.spare_px, f64::max);
        }
    }
}

fn worst_setup(machine: &Elaborated, [from, to]: [f64; 2]) -> Worst {
    let (mut rng, mut worst, mut drawn) = (Rng(7), Worst::default(), 0);
    for _ in 0..2000 {
        let k = from * (to / from).powf(rng.roll());
        let frame = words(&one_splat(&mut rng, k, &machine.machine), machine);
        let Some(own) = machine_sets_up(machine, &frame) else {
            continue;
        };
        let ideal = formulas_set_up(&machine.machine, &frame);
        worst.see(&own, &ideal, &tolerance(&machine.machine, &frame, &ideal));
        drawn += 1;
    }
    assert!(drawn > 1900, "{drawn} of 2000 splats were set up");
    worst
}

/// Footprints from a tenth of a pixel to a thousand, with any tilt. On `lean` only up to ten:
/// beyond that its low-pass word has few bits left for a large disc (ellipse.low_pass is relative
/// to 4^e too), and its twelve-bit root moves a box by pixels.
#[test]
fn setup_is_right_to_its_last_places() {
    let mut faults = Vec::new();
    for (name, decades) in [("reference", 4), ("lean", 2)] {
        let machine = named(name);
        for decade in 0..decades {
            let least = 0.1 * 10_f64.powi(decade);
            let worst = worst_setup(&machine, [least, 10.0 * least]);
            println!("{name}, k from {least}: {worst:.3?}");
            let tolerated = [worst.pixel, worst.depth, worst.conic, worst.amplitude]
                .into_iter()
                .all(|part| part <= 1.0);
            if !tolerated || worst.lost_px > 0.0 || worst.spare_px > 1.0 {
                faults.push(format!("{name}, k from {least}: {worst:?}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

// --- Drawing ---

#[test]
fn two_threads_draw_what_one_draws() {
    // More than the share of one thread, in setup and in drawing.
    let mut scene = confetti(20_000, 3);
    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.radius *= 0.1);
    (scene.image.width, scene.image.height) = (200, 120);
    let with = |threads: usize, machine: &Elaborated| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| draw(&scene, machine))
    };
    for machine in machines() {
        assert_eq!(with(1, &machine), with(2, &machine));
    }
}

#[test]
fn watching_changes_nothing() {
    let scene = confetti(3000, 4);
    for machine in machines() {
        let frame = words(&scene, &machine);
        let ((watched, ranges, _), unwatched) = (
            pipeline::draw_measured(&machine, &frame),
            pipeline::draw_unobserved(&machine, &frame),
        );
        assert_eq!(watched, unwatched);
        assert!(
            ranges
                .0
                .iter()
                .all(|range| range.words == 0 || range.has_words())
        );
        assert!(
            ranges.0.iter().map(|range| range.words).sum::<u64>() > watched.outcomes.total() / 10
        );
    }
}

#[test]
fn splats_that_share_no_pixel_come_in_any_order() {
    // Two groups, each with its own order, far enough apart on the screen.
    let heap = |side: f64, seed: u64| -> Vec<Splat> {
        let moved = |splat: &Splat| Splat {
            position: DVec3::new(side + splat.position.x * 0.1, splat.position.y, 2.0),
            radius: splat.radius * 0.1,
            ..*splat
        };
        confetti(60, seed).splats.iter().map(moved).collect()
    };
    let (left, right) = (heap(-0.7, 1), heap(0.7, 2));
    let drawn = |splats: Vec<Splat>, machine: &Elaborated| {
        draw(
            &Scene {
                splats,
                ..confetti(1, 1)
            },
            machine,
        )
    };
    for machine in machines() {
        let one_after_the_other = drawn([left.clone(), right.clone()].concat(), &machine);
        let the_other_first = drawn([right.clone(), left.clone()].concat(), &machine);
        let in_turn = drawn(
            left.iter()
                .zip(&right)
                .flat_map(|(a, b)| [*a, *b])
                .collect(),
            &machine,
        );
        assert_eq!(one_after_the_other, the_other_first);
        assert_eq!(one_after_the_other, in_turn);
        assert!(one_after_the_other.outcomes.accumulated > 100);
        let mut backwards = left.clone();
        backwards.reverse();
        assert_ne!(
            one_after_the_other,
            drawn([backwards, right.clone()].concat(), &machine),
            "order inside a heap matters"
        );
    }
}

#[test]
fn an_opaque_splat_hides_all_behind_it() {
    let front = Splat {
        rgb: [0.25, 0.5, 0.75],
        ..splat([0.0, 0.0, 0.5], 1.0)
    };
    let mut scene = confetti(200, 5);
    // Low enough that the weights of one splat cover.
    scene.surface.coverage_threshold = 0.03;
    scene.splats.push(front);
    for machine in machines() {
        let frame = words(&scene, &machine);
        let with = |splats: &[&[rtl_model::frame::Splat]]| {
            pipeline::draw_unobserved(
                &machine,
                &Frame {
                    splats: splats.concat(),
                    ..frame.clone()
                },
            )
            .frame
        };
        let (behind, front) = frame.splats.split_at(200);
        let alone = with(&[front]);
        assert_ne!(with(&[behind]), alone);
        for picture in [
            with(&[front, behind]),
            with(&[behind, front]),
            with(&[&behind[..100], front, &behind[100..]]),
        ] {
            // An eight-bit machine divides Σw·α by W, with an ulp less than 1.
            let off = picture
                .as_flattened()
                .iter()
                .zip(alone.as_flattened())
                .map(|(a, b)| a.abs_diff(*b))
                .max()
                .unwrap();
            assert!(
                off <= u32::from(machine.machine.name == "tiny"),
                "{}: {off} last places",
                machine.machine.name
            );
        }
    }
}

/// Σw over the picture, computed from alpha: the coverage threshold is 1, which no weight of one
/// splat reaches.
fn total_weight(mut scene: Scene, machine: &Elaborated) -> f64 {
    scene.surface.coverage_threshold = 1.0;
    let drawing = draw(&scene, machine);
    drawing
        .frame
        .iter()
        .map(|pixel| value(machine.machine.resolve.frame, i64::from(pixel[3])))
        .sum()
}

/// A splat of k = 40 pixels in the middle of 200×200, tilted by `tilt` towards the direction `turn`
/// in the image plane.
fn tilted(tilt: f64, turn: f64, cutoff: f64) -> Scene {
    let normal = DMat3::from_rotation_z(turn) * DVec3::new(tilt.sin(), 0.0, -tilt.cos());
    let mut scene = scene(
        200,
        200,
        200.0,
        vec![Splat {
            normal,
            ..splat([0.0, 0.0, 1.0], 0.2)
        }],
    );
    scene.kernel.cutoff = cutoff;
    scene
}

#[test]
fn a_footprint_deposits_the_weight_that_its_size_and_tilt_say_at_any_turn() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for (name, tolerance) in [("reference", 0.005), ("lean", 0.03)] {
        let machine = named(name);
        for cutoff in [1.0, 2.0, 4.0] {
            let mut worst: f64 = 0.0;
            for (tilt, turn) in (0..8).flat_map(|tilt| {
                (0..12).map(move |turn| (f64::from(tilt) * 0.18, f64::from(turn) * 0.55))
            }) {
                let weight = total_weight(tilted(tilt, turn, cutoff), &machine);
                let expected = 1600.0 * tilt.cos() * (1.0 - (-cutoff / 2.0).exp());
                worst = worst.max((weight / expected - 1.0).abs());
            }
            assert!(worst < tolerance, "{name} {cutoff}: {worst}");
        }
    }
}
