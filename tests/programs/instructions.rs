//! Draws a scene once on a machine, one thread, nobody watching or ranges watched: for counting instructions.
//!
//! ```sh
//! cargo build --release --example instructions
//! count() {
//!   valgrind --tool=callgrind --callgrind-out-file=/tmp/$1.out --collect-atstart=no "${@:2}" \
//!     target/release/examples/instructions ../shared/data/scenes/dragon.json reference $watcher
//! }
//! watcher=   # nobody, or: ranges
//! count setup --toggle-collect="instructions::setup*"
//! count fill --toggle-collect="instructions::fill*"
//! count fragments --toggle-collect="instructions::fill*" --toggle-collect="*Bins::new*" --toggle-collect="*::shade_for_merge*" \
//!   --toggle-collect="*FillTile*::resolve*"
//! callgrind_annotate /tmp/fill.out   # the same by function and file
//! ```
//! "Collected" of the first run over the splats printed is instructions a splat in setup; that of the second over the fragments
//! printed is instructions a fragment in all that follows. The third leaves out binning, the shading of fragments that merge, and
//! resolving: raster, gauss and fragment alone.

use rtl_model::machine::{Elaborated, Machine};
use rtl_model::pipeline::{self, Drawing, Setup};
use rtl_model::probe::{Meters, Probe, Unwatched};
use splatsim::error::{Error, Result};
use splatsim::quantise::{Quantised, quantise};
use splatsim::scene::{Overrides, Scene};

#[inline(never)]
fn setup<P: Probe>(machine: &Elaborated, quantised: &Quantised, probe: &mut P) -> Setup {
    pipeline::set_up(machine, &quantised.frame, probe)
}

#[inline(never)]
fn fill<P: Probe>(machine: &Elaborated, quantised: &Quantised, setup: &Setup, probe: &mut P) -> Drawing {
    pipeline::fill(machine, &quantised.frame, setup, probe)
}

fn draw<P: Probe>(machine: &Elaborated, quantised: &Quantised, mut probe: P) -> Drawing {
    let setup = setup(machine, quantised, &mut probe);
    fill(machine, quantised, &setup, &mut probe)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "glass-spheres".into());
    let name = arguments.next().unwrap_or_else(|| "reference".into());
    let scene = Scene::load(&scene, &Overrides::default())?;
    let machine =
        Machine::named(&name).ok_or_else(|| Error::input(format!("no machine {name}; there are {}", Machine::NAMES.join(", "))))?;
    let elaborated = splatsim::fixed::elaborate(&machine)?;
    let quantised = quantise(&scene, &machine)?;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| Error::job(e.to_string()))?;
    let watched = arguments.next().is_some_and(|watcher| watcher == "ranges");
    let drawing = one_thread.install(|| match watched {
        true => draw(&elaborated, &quantised, Meters::new(&elaborated)),
        false => draw(&elaborated, &quantised, Unwatched),
    });
    println!("{} on {name}: {} splats, {} fragments", scene.name, scene.splats.len(), drawing.outcomes.total());
    Ok(())
}
