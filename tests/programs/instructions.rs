//! Draws a scene once on a machine, one thread, nobody watching, or ranges or work recorded: for counting instructions.
//!
//! ```sh
//! cargo build --release --example instructions
//! count() {
//!   valgrind --tool=callgrind --callgrind-out-file=/tmp/$1.out --collect-atstart=no "${@:2}" \
//!     target/release/examples/instructions ../shared/data/scenes/dragon.json reference $watcher
//! }
//! watcher=   # nobody, or: ranges, work
//! count setup --toggle-collect="instructions::setup*"
//! count fill --toggle-collect="instructions::fill*"
//! count fragments --toggle-collect="instructions::fill*" --toggle-collect="*fill::bins*" --toggle-collect="*::shade_for_merge*" \
//!   --toggle-collect="*FillTile*::resolve*"
//! callgrind_annotate /tmp/fill.out   # the same by function and file
//! ```
//! "Collected" of the first run over the splats printed is instructions a splat in setup; that of the second over the fragments
//! printed is instructions a fragment in all that follows. The third leaves out binning, the shading of fragments that merge, and
//! resolving: raster, gauss and fragment alone.

use rtl_model::machine::Machine;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::{self, Drawing, Setup};
use rtl_model::probe::Meters;
use rtl_model::work::Recorder;
use splatsim::error::{Error, Result};
use splatsim::hardware::quantise::{Quantised, quantise};
use splatsim::scene::{Overrides, Scene};

/// Who watches.
enum Watcher {
    Nobody,
    Ranges(Box<Meters>),
    Work(Box<Recorder>),
}

#[inline(never)]
fn setup(machine: &Elaborated, quantised: &Quantised, watcher: &mut Watcher) -> Setup {
    match watcher {
        Watcher::Nobody => pipeline::set_up_unobserved(machine, &quantised.frame),
        Watcher::Ranges(meters) => pipeline::set_up_metered(machine, &quantised.frame, meters),
        Watcher::Work(recorder) => pipeline::set_up_recorded(machine, &quantised.frame, recorder),
    }
}

#[inline(never)]
fn fill(machine: &Elaborated, quantised: &Quantised, setup: &Setup, watcher: &mut Watcher) -> Drawing {
    match watcher {
        Watcher::Nobody => pipeline::fill_unobserved(machine, &quantised.frame, setup),
        Watcher::Ranges(meters) => pipeline::fill_metered(machine, &quantised.frame, setup, meters),
        Watcher::Work(recorder) => pipeline::fill_recorded(machine, &quantised.frame, setup, recorder),
    }
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "glass-spheres".into());
    let name = arguments.next().unwrap_or_else(|| "reference".into());
    let scene = Scene::load(&scene, &Overrides::default())?;
    let machine =
        Machine::named(&name).ok_or_else(|| Error::input(format!("no machine {name}; there are {}", Machine::NAMES.join(", "))))?;
    let elaborated = splatsim::hardware::fixed::elaborate(&machine)?;
    let quantised = quantise(&scene, &machine)?;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| Error::job(e.to_string()))?;
    let mut watcher = match arguments.next().as_deref() {
        Some("ranges") => Watcher::Ranges(Box::new(Meters::new(&elaborated.signals))),
        Some("work") => Watcher::Work(Box::default()),
        _ => Watcher::Nobody,
    };
    let drawing = one_thread.install(|| {
        let setup = setup(&elaborated, &quantised, &mut watcher);
        fill(&elaborated, &quantised, &setup, &mut watcher)
    });
    println!("{} on {name}: {} splats, {} fragments", scene.name, scene.splats.len(), drawing.outcomes.total());
    Ok(())
}
