//! Do boxes that follow the opacity leave the picture unchanged, and do machine and `golden` agree
//! on which splats are too faint to be drawn?

use crate::handmade::Rng;
use crate::shared_input;
use crate::tier::{self, Tier};
use crate::traced::machine;
use rtl_model::Machine;
use rtl_model::frame::{Frame, Kernel};
use rtl_model::pipeline::{Elaborated, draw_measured, draw_unobserved, unit_replay};
use rtl_model::probe::NoProbe;
use rtl_model::timing::{self, Detail};
use rtl_model::work::{CullReason, Event, Footprint, TILE_PX, Work};
use serde_json::{Value, json};
use splatsim::accuracy::{distance, lockstep};
use splatsim::golden;
use splatsim::hardware::fixed;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::collections::HashMap;
use std::path::PathBuf;

/// A scene from its text, together with a file of Gaussians.
fn scene(text: &Value, gaussians: Option<&str>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    if let Some(ply) = gaussians {
        std::fs::write(folder.path().join("gaussians.ply"), ply).unwrap();
    }
    let file = folder.path().join("scene.json");
    std::fs::write(&file, text.to_string()).unwrap();
    Scene::load(file, &Overrides::default()).unwrap()
}

/// Logarithms of standard deviations from a tenth of a pixel to the picture's size.
const ANY: [f64; 2] = [-6.5, -0.5];

/// Random Gaussians: balls, plates and needles, of any opacity, most of them faint.
fn random(count: usize, seed: u64, log_scale: [f64; 2]) -> Scene {
    let mut rng = Rng(seed);
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n");
    let names =
        "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    names
        .split(' ')
        .for_each(|name| text += &format!("property float {name}\n"));
    text += "end_header\n";
    for _ in 0..count {
        let row: Vec<f64> = [(); 3]
            .map(|()| rng.within(1.2))
            .into_iter()
            .chain([(); 3].map(|()| rng.within(1.5)))
            .chain([4.0 * rng.roll().powi(2) * if rng.roll() < 0.3 { 1.0 } else { -2.0 }])
            .chain([(); 3].map(|()| log_scale[0] + (log_scale[1] - log_scale[0]) * rng.roll()))
            .chain([(); 4].map(|()| rng.within(1.0)))
            .collect();
        text += &row
            .iter()
            .map(|number| format!("{number} "))
            .collect::<String>();
        text += "\n";
    }
    let camera = json!({"eye": [0, 0, -3], "target": [0, 0, 0], "up": [0, -1, 0]});
    scene(
        &json!({"splats": {"file": "gaussians.ply"}, "camera": camera, "image": {"width": 160, "height": 120}}),
        Some(&text),
    )
}

fn bouquet(count: u32, side: u32) -> Scene {
    scene(
        &json!({"splats": {"gaussians": "bouquet", "count": count}, "image": {"width": side, "height": side}}),
        None,
    )
}

/// The frame with every splat set up and every box limited by the frame's cutoff.
fn wide(frame: &Frame) -> Frame {
    let mut wide = frame.clone();
    let ellipsoids = wide.ellipsoids.as_mut().unwrap();
    ellipsoids.kernel = Kernel {
        least_opacity: 0,
        reach: Vec::new(),
        ..ellipsoids.kernel.clone()
    };
    wide
}

/// Entries of the tiles' lists, and cycles.
fn costs(machine: &Elaborated, work: &Work) -> [u64; 2] {
    let entries = work
        .bins(machine.timing.timing.tile.side_px as usize)
        .entries() as u64;
    [
        entries,
        timing::replay(&machine.timing, work, Detail::Accounts).total,
    ]
}

/// Three Gaussians.
const TINY: &str = "splats3d/train_3points.ply";

fn shipped() -> Vec<(&'static str, Scene)> {
    let mut scenes = vec![
        ("bouquet", bouquet(16_000, 256)),
        ("random", random(3000, 1, ANY)),
        ("random again", random(1500, 2, ANY)),
    ];
    for name in ["splats3d/guitar_expanded.ply", TINY] {
        if let Some(file) = shared_input::find(name) {
            let file: PathBuf = std::fs::canonicalize(file).unwrap();
            scenes.push((
                name,
                scene(
                    &json!({"splats": {"file": file}, "image": {"width": 320, "height": 240}}),
                    None,
                ),
            ));
        }
    }
    scenes
}

/// Splat and pixel of every contribution with at least the minimum weight.
fn counted(work: &Work) -> Vec<(u32, [u16; 2])> {
    let bins = work.bins(TILE_PX);
    let mut all = Vec::new();
    for tile in &work.tiles {
        let mut reader = tile.reader();
        let [left, top] = tile.corner;
        let number = usize::from(top) / TILE_PX * bins.columns + usize::from(left) / TILE_PX;
        for footprint in bins
            .of(number)
            .iter()
            .map(|nth| &work.footprints[*nth as usize])
        {
            let first = footprint.rows[0].max(top);
            let rows = first..=footprint.rows[1].min(top + TILE_PX as u16 - 1);
            let (kept, events) = reader.splat(rows.len());
            for (row, kept) in kept.iter().enumerate() {
                let is_faint =
                    |column: &usize| events.contains(&((16 * row + column) as u8, Event::Faint));
                let columns =
                    (0..TILE_PX).filter(|column| kept >> column & 1 == 1 && !is_faint(column));
                all.extend(
                    columns.map(|column| {
                        (footprint.splat, [left + column as u16, first + row as u16])
                    }),
                );
            }
        }
    }
    all
}

#[test]
fn no_weight_that_counts_lies_outside_of_its_box_and_less_is_listed() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let gaussian = machine("gaussian", &[]);
    let elaborated = fixed::elaborate(&gaussian).unwrap();
    for (name, scene) in shipped() {
        let frame = quantise(&scene, &gaussian).unwrap().frame;
        let [(near, _, own), (far, _, all)] =
            [&frame, &wide(&frame)].map(|frame| draw_measured(&elaborated, frame));
        let boxes: HashMap<u32, &Footprint> = own
            .footprints
            .iter()
            .map(|footprint| (footprint.splat, footprint))
            .collect();
        let lies_in = |[first, last]: [u16; 2], at: u16| (first..=last).contains(&at);
        let is_in = |(splat, [x, y]): &(u32, [u16; 2])| {
            boxes
                .get(splat)
                .is_some_and(|own| lies_in(own.columns, *x) && lies_in(own.rows, *y))
        };
        let contributions = counted(&all);
        assert!(
            contributions.iter().all(is_in),
            "{name}: a weight that counts lies outside of its box"
        );
        // Differencing begins at another pixel, so its LSBs differ, and a few contributions that
        // are just too small differ too.
        let distance = distance(
            &fixed::picture(&elaborated, &near),
            &fixed::picture(&elaborated, &far),
        );
        assert!(
            distance.psnr_db.is_none_or(|db| db > 75.0),
            "{name}: {distance:?}"
        );
        let [[entries, cycles], [all_entries, all_cycles]] =
            [&own, &all].map(|work| costs(&elaborated, work));
        println!(
            "{name}: {entries} of {all_entries} entries, {cycles} of {all_cycles} cycles, {:?} dB, {:?}, {} contributions",
            distance.psnr_db,
            near.culled,
            contributions.len()
        );
        assert!(entries <= all_entries && cycles <= all_cycles, "{name}");
        if name != TINY {
            assert!(
                entries * 100 < all_entries * 95 && contributions.len() > 100_000,
                "{name}: {entries} of {all_entries} entries"
            );
        }
    }
}

/// If the raster's words are exact, the result does not depend on the first pixel.
#[test]
fn no_picture_changes_by_a_bit_where_differencing_is_exact() {
    let exact = [
        "project.pixel=I12F5",
        "ellipse.conic=U3F17",
        "ellipse.conic_cross=I3F17",
        "raster.rows=seeded",
        "raster.offset=I12F5",
        "raster.gradient=I10F22",
        "raster.first=I12F22",
        "raster.second=I5F17",
        "raster.radial=I20F27",
    ];
    let machine = machine("gaussian", &exact);
    let elaborated = fixed::elaborate(&machine).unwrap();
    for (name, scene) in [
        ("bouquet", bouquet(3000, 128)),
        ("random", random(2000, 5, [-5.5, -2.5])),
        ("again", random(3000, 6, [-6.5, -3.5])),
    ] {
        let frame = quantise(&scene, &machine).unwrap().frame;
        let (near, far) = (
            draw_unobserved(&elaborated, &frame),
            draw_unobserved(&elaborated, &wide(&frame)),
        );
        assert!(
            near.frame == far.frame && near.covered == far.covered,
            "{name}: the picture has changed"
        );
        assert_eq!(near.outcomes, far.outcomes, "{name}");
    }
}

/// Machines with few bits of opacity, weight and radial index; every opacity is tested at every
/// radial index.
#[test]
fn the_table_holds_every_weight_that_counts() {
    let small = [
        "gauss.radial_index=U4F6",
        "gauss.weight=U1F9",
        "gauss.falloff=U1F10",
        "gauss.table.index_bits=6",
    ];
    for (opacity, bits, least) in [
        ("U1F8", 4, 1.0 / 255.0),
        ("U3F10", 7, 0.02),
        ("U1F9", 9, 0.3),
        ("U1F7", 1, 1.0 / 255.0),
    ] {
        let own = [
            format!("splat.opacity={opacity}"),
            format!("ellipse.ellipsoid.reach_bits={bits}"),
        ];
        let machine = machine(
            "gaussian",
            &[&small[..], &own.each_ref().map(String::as_str)].concat(),
        );
        let elaborated = fixed::elaborate(&machine).unwrap();
        let mut scene = bouquet(16, 32);
        scene.sheets.as_mut().unwrap().least_weight = least;
        let frame = quantise(&scene, &machine).unwrap().frame;
        let (kernel, least) = (
            &frame.ellipsoids.as_ref().unwrap().kernel,
            frame.sheets.as_ref().unwrap().least_weight.max(1),
        );
        assert_eq!(kernel.reach.len(), 1 << bits);
        assert!(
            kernel.reach.windows(2).all(|two| two[0] <= two[1])
                && kernel.reach.iter().all(|word| *word <= frame.view.cutoff)
        );
        let (opacity, radial, amplitude) = (
            machine.splat.opacity.format,
            machine.gauss.radial_index.format,
            machine.ellipse.amplitude.format,
        );
        let (mut shorter, mut drawn) = (0, 0);
        for word in 0..=opacity.one() {
            let held = elaborated.box_cutoff(&frame.view, kernel, word as i32);
            let (cutoff, is_shorter) = (
                machine.raster.cutoff.format.value(held),
                held < frame.view.cutoff,
            );
            let amplitude = word << (amplitude.frac_bits - opacity.frac_bits);
            let weight = |radial_index: i64| {
                let places = machine.raster.radial.format.frac_bits - radial.frac_bits;
                unit_replay::gauss(
                    &elaborated,
                    [radial_index << places, amplitude],
                    &mut NoProbe,
                )
            };
            let farthest = (0..=radial.max())
                .filter(|radial| weight(*radial) >= least)
                .max();
            let is_drawn = word >= kernel.least_opacity;
            assert_eq!(is_drawn, farthest.is_some(), "{word} of {opacity}");
            let within = |farthest: i64| radial.value(farthest) < cutoff || !is_shorter;
            assert!(
                !is_drawn || farthest.is_some_and(within),
                "{word} of {opacity}: {farthest:?}, cutoff {cutoff}"
            );
            shorter += u32::from(is_drawn && is_shorter);
            drawn += u32::from(is_drawn);
        }
        assert!(
            drawn > 0 && shorter > drawn / 8,
            "{shorter} of {drawn} boxes are shorter"
        );
    }
}

/// The reported case: a file in which every opacity is below 1/255.
#[test]
fn splats_too_faint_to_see_end_in_project() {
    let gaussian = machine("gaussian", &[]);
    let elaborated = fixed::elaborate(&gaussian).unwrap();
    let mut scene = random(400, 3, ANY);
    // Below, equal to and above the minimum.
    for (index, splat) in scene.splats.iter_mut().enumerate() {
        splat.opacity = [0.0, 0.5, 0.999, 1.001, 30.0][index % 5] / 255.0;
    }
    let quantised = quantise(&scene, &gaussian).unwrap();
    let (drawing, _, work) = draw_measured(&elaborated, &quantised.frame);
    let golden = golden::render(&scene, &golden::Rules::default());
    let [machine, exact] = [drawing.culled.transparent, golden.culled.transparent];
    assert_eq!((machine, drawing.culled.near), (exact, golden.culled.near));
    // A step of the table and its margin may reach into the picture where no weight does.
    assert!(
        drawing.culled.outside <= golden.culled.outside && golden.culled.outside < 40,
        "{:?}",
        golden.culled
    );
    assert!(
        (200..=240).contains(&machine),
        "{machine} of 400 are transparent"
    );
    for (index, cull_reason) in work.cull_reasons.iter().enumerate() {
        if ![CullReason::Near, CullReason::Outside].contains(cull_reason) {
            assert_eq!(
                *cull_reason == CullReason::Transparent,
                index % 5 < 3,
                "{index}"
            );
        }
    }
    let led = lockstep(&scene, &elaborated, &quantised);
    assert_eq!(
        (led.violations, led.flips.unexplained, led.flips.cull),
        (0, 0, 0)
    );

    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.opacity = 0.0039);
    let frame = quantise(&scene, &gaussian).unwrap().frame;
    let [[entries, _], [all_entries, _]] = [&frame, &wide(&frame)]
        .map(|frame| costs(&elaborated, &draw_measured(&elaborated, frame).2));
    assert!(
        entries == 0 && all_entries > 1000,
        "{entries} of {all_entries} entries"
    );
    // `ideal` draws all of them.
    assert_eq!(golden::ideal(&scene).culled.transparent, 0);
}

/// If no weight is too small, every splat is set up, and every box is limited by the frame's
/// cutoff.
#[test]
fn volumes_and_scenes_without_a_least_weight_are_as_they_were() {
    let gaussian: Machine = machine("gaussian", &[]);
    let volume = json!({"splats": {"volume": {"builtin": "nested-shells", "samples": 16}}, "sheets": {"least_weight": 0.02}});
    for scene in [
        scene(
            &json!({"splats": {"gaussians": "bouquet", "count": 200}, "sheets": {"least_weight": 0}}),
            None,
        ),
        scene(&volume, None),
    ] {
        let kernel = quantise(&scene, &gaussian)
            .unwrap()
            .frame
            .ellipsoids
            .unwrap()
            .kernel;
        assert!(kernel.reach.is_empty() && kernel.least_opacity == 0);
    }
    let without = machine("volume", &[]);
    assert_eq!(without.ellipse.ellipsoid.unwrap().reach_bits, None);
}
