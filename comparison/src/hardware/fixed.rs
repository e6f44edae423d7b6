//! Fixed: draws a scene on the machine and converts the frame back to real numbers.

use crate::error::{Error, Result};
use crate::golden;
use crate::hardware::quantise::{ListsBefore, Quantised, quantise_after};
use crate::output::picture::Picture;
use crate::output::text::listed;
use crate::scene::Scene;
use rtl_model::machine::{self, Machine};
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::Ranges;
use rtl_model::work::Work;
use rtl_model::{Drawing, pipeline};
use std::sync::Arc;

/// Elaborates a machine.
///
/// # Errors
/// [`Error::Input`] with every elaboration error, in one sentence.
pub fn elaborate(machine: &Machine) -> Result<Elaborated> {
    machine.elaborate().map_err(|errors| {
        Error::input(format!(
            "machine {} cannot be built: {}",
            machine.name,
            listed(&errors)
        ))
    })
}

/// What a machine that keeps lists has in memory before a frame of a sequence; none on other
/// machines and before a first frame. All frames before this one are set up.
///
/// # Errors
/// As [`quantise`](super::quantise::quantise).
pub fn lists_before(scene: &Scene, machine: &Machine) -> Result<ListsBefore> {
    if machine.keeps_lists().is_none() || !scene.is_sorted() || scene.cameras_before().is_empty() {
        return Ok(None);
    }
    let elaborated = elaborate(machine)?;
    let mut before = Ok(None);
    scene.each_before(|earlier| {
        if let Ok(lists) = &before {
            let lists = lists.clone();
            before = quantise_after(earlier, machine, lists)
                .map(|quantised| lists_after(&elaborated, &quantised));
        }
    });
    before
}

/// What a machine that keeps lists has in memory after a frame; none on other machines.
pub fn lists_after(machine: &Elaborated, quantised: &Quantised) -> ListsBefore {
    machine.machine.keeps_lists()?;
    let setup = pipeline::set_up_unobserved(machine, &quantised.frame);
    setup.kept_lists(&quantised.frame).map(Arc::new)
}

/// Draws without a probe.
pub fn draw(machine: &Elaborated, quantised: &Quantised) -> Drawing {
    pipeline::draw_unobserved(machine, &quantised.frame)
}

/// Draws some tiles of 16×16 pixels without a probe: those for which `tiles`, by rows, is true. The
/// others keep the background.
pub fn draw_tiles(machine: &Elaborated, quantised: &Quantised, tiles: &[bool]) -> Drawing {
    pipeline::draw_tiles(machine, &quantised.frame, tiles)
}

/// Draws once, measures the range of every signal and records the work.
pub fn draw_measured(machine: &Elaborated, quantised: &Quantised) -> (Drawing, Ranges, Work) {
    let (drawing, ranges, mut work) = pipeline::draw_measured(machine, &quantised.frame);
    quantised
        .walk
        .iter()
        .for_each(|walk| walk.record(&mut work));
    (drawing, ranges, work)
}

/// The machine's frame as a picture.
pub fn picture(machine: &Elaborated, drawing: &Drawing) -> Picture {
    let format = machine.machine.resolve.frame.format;
    Picture {
        width: drawing.width as usize,
        height: drawing.height as usize,
        rgba: drawing
            .frame
            .iter()
            .map(|word| word.map(|channel| format.value(i64::from(channel))))
            .collect(),
        covered: drawing.covered.clone(),
    }
}

/// The machine's fragment rules, for the golden renderer.
pub fn rules(machine: &Machine) -> golden::Rules {
    let fragment = &machine.fragment;
    golden::Rules {
        layers: fragment.layers as usize,
        merge: match fragment.merge {
            machine::Merge::NearestPair => golden::Merge::NearestPair,
            machine::Merge::FarthestPair => golden::Merge::FarthestPair,
            machine::Merge::Replace => golden::Merge::Replace,
            machine::Merge::Window => golden::Merge::Window,
        },
        group: match fragment.group {
            machine::Group::First => golden::Group::First,
            machine::Group::Interval => golden::Group::Interval,
            machine::Group::Window => golden::Group::Window,
        },
        window: fragment
            .window
            .as_ref()
            .map_or_else(golden::WindowOptions::default, |window| {
                golden::WindowOptions {
                    join: f64::from(window.join_permille) / 1000.0,
                    late: window.late,
                    inside: window.inside,
                }
            }),
        sums_gaussians: machine.sums_gaussians(),
        weights_fall_with_depth: machine.depth_weight().is_some(),
        reflection: machine.reflect.as_ref().map(|reflect| golden::Reflection {
            index_bits: reflect.index_bits.clamp(1, 8),
            by_ray: reflect.sight == machine::Sight::Ray,
        }),
        lists: machine.keeps_lists().map(|kept| golden::KeptLists {
            tile_px: kept.tile_px.next_multiple_of(16).max(16) as usize,
            chunk: kept.chunk.max(2) as usize,
            farthest_first: fragment.composite().is_some(),
        }),
        blocks: machine.contribution.map(|test| golden::BlockTest {
            side_px: test.block_px,
            diagonal: test.leaders == machine::Leaders::Diagonal,
            by_opacity: (machine.ellipse.ellipsoid).is_some_and(|words| words.reach_bits.is_some()),
        }),
        evict_hidden: fragment.evict_hidden,
        turn_normals: fragment.turn_normals,
        opaque: f64::from(fragment.opaque_permille) / 1000.0,
        fragment_depth: match fragment.fragment_depth {
            machine::FragmentDepth::First => golden::FragmentDepth::First,
            machine::FragmentDepth::Nearest => golden::FragmentDepth::Nearest,
        },
    }
}
