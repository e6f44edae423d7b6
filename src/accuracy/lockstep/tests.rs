//! The check can fail: machines held to the bounds of a better one.

use super::*;
use crate::hardware::machines;
use crate::hardware::quantise::quantise;
use crate::scene::Overrides;

/// `reference` with these settings, held to the bounds of `reference` without them.
fn pretending(settings: &[&str]) -> Lockstep {
    let scene = Scene::load("glass-spheres", &Overrides { size: Some((96, 96)) }).unwrap();
    let settings: Vec<String> = settings.iter().map(|setting| (*setting).to_owned()).collect();
    let [drawn, claimed] = [&settings[..], &[]].map(|settings| machines::load("reference", settings).unwrap());
    let quantised = quantise(&scene, &claimed).unwrap();
    assert_eq!(quantised, quantise(&scene, &drawn).unwrap());
    held_to(&scene, &fixed::elaborate(&drawn).unwrap(), &fixed::elaborate(&claimed).unwrap(), &quantised)
}

#[test]
fn a_machine_that_is_what_it_says_is_not_caught() {
    let honest = pretending(&[]);
    assert_eq!((honest.violations, honest.flips.unexplained), (0, 0));
}

#[test]
fn a_coarser_table_exceeds_the_bound() {
    assert!(pretending(&["gauss.table.index_bits=3", "gauss.falloff=U1F8"]).violations > 100);
}

#[test]
fn coarser_pixel_positions_make_flips_that_nothing_explains() {
    let flips = pretending(&["project.pixel=I15F4"]).flips;
    assert!(flips.unexplained > 100 && flips.coverage > flips.unexplained / 2, "{flips:?}");
}

#[test]
fn coarser_depths_make_flips_that_nothing_explains() {
    let flips = pretending(&["raster.depth=I18F24", "ellipse.depth_slope=I3F8"]).flips;
    assert!(flips.unexplained > 10, "{flips:?}");
}
