//! Draws a scene once on a machine, on one thread, without a probe, or with ranges measured and
//! work recorded: a program for counting instructions. Arguments: scene, machine, `plain` or
//! `measured`, pixels per side. `instructions.sh` counts a few cases and prints a table.
//!
//! ```sh
//! cargo build --release --example instructions
//! count() {
//!   valgrind --tool=callgrind --callgrind-out-file=/tmp/$1.out --collect-atstart=no "${@:2}" \
//!     target/release/examples/instructions ../shared/data/scenes/dragon.json reference $probe
//! }
//! probe=plain   # or: measured
//! count setup --toggle-collect="instructions::setup*"
//! count fill --toggle-collect="instructions::fill*"
//! count fragments --toggle-collect="instructions::fill*" --toggle-collect="*fill::bins*" --toggle-collect="*::shade_for_merge*" \
//!   --toggle-collect="*FillTile*::resolve*"
//! callgrind_annotate /tmp/fill.out   # the same by function and file
//! ```
//! "Collected" of the first run, divided by the number of splats, is instructions per splat in
//! setup. That of the second run, divided by the printed number of fragments, is instructions per
//! fragment after setup. The third run leaves out binning, the shading of fragments that merge, and
//! resolving: it counts only raster, gauss and fragment.

use rtl_model::machine::Machine;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::{self, Drawing, Setup};
use rtl_model::probe::Composite;
use splatsim::error::{Error, Result};
use splatsim::hardware::quantise::{Quantised, quantise};
use splatsim::scene::{Overrides, Scene};

#[inline(never)]
fn setup(machine: &Elaborated, quantised: &Quantised, probe: &mut Option<Composite>) -> Setup {
    match probe {
        None => pipeline::set_up_unobserved(machine, &quantised.frame),
        Some(probe) => pipeline::set_up_measured(machine, &quantised.frame, probe),
    }
}

#[inline(never)]
fn fill(
    machine: &Elaborated,
    quantised: &Quantised,
    setup: &Setup,
    probe: &mut Option<Composite>,
) -> Drawing {
    match probe {
        None => pipeline::fill_unobserved(machine, &quantised.frame, setup),
        Some(probe) => pipeline::fill_measured(machine, &quantised.frame, setup, probe),
    }
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "glass-spheres".into());
    let name = arguments.next().unwrap_or_else(|| "reference".into());
    let measured = arguments.next().as_deref() == Some("measured");
    let side = arguments.next().map(|side| {
        side.parse::<usize>()
            .map_err(|_| Error::input(format!("{side} is no number of pixels")))
    });
    let size = side.transpose()?.map(|side| (side, side));
    let scene = Scene::load(&scene, &Overrides { size })?;
    let machine = Machine::named(&name).ok_or_else(|| {
        Error::input(format!(
            "no machine {name}; there are {}",
            Machine::NAMES.join(", ")
        ))
    })?;
    let elaborated = splatsim::hardware::fixed::elaborate(&machine)?;
    let quantised = quantise(&scene, &machine)?;
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|e| Error::job(e.to_string()))?;
    let mut probe = measured.then(|| Composite::new(&elaborated.signals));
    let drawing = one_thread.install(|| {
        let setup = setup(&elaborated, &quantised, &mut probe);
        fill(&elaborated, &quantised, &setup, &mut probe)
    });
    println!(
        "{} on {name}: {} splats, {} fragments",
        scene.name,
        scene.splats.len(),
        drawing.outcomes.total()
    );
    Ok(())
}
