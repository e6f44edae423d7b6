//! Records a frame once and replays it again and again: for timing the replay.
//!
//! ```sh
//! cargo run --release --example replays -- ../shared/data/scenes/dragon.json
//! ```
//! Prints, for each organisation and for memory as described and without limits, rows of boxes replayed in a second by one thread.

use rtl_model::machine::Machine;
use rtl_model::machine::timing::Organisation;
use rtl_model::timing::replay;
use splatsim::error::{Error, Result};
use splatsim::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::time::Instant;

fn main() -> Result<()> {
    let scene = std::env::args().nth(1).unwrap_or_else(|| "glass-spheres".into());
    let scene = Scene::load(&scene, &Overrides::default())?;
    let machine = Machine::named("reference").ok_or_else(|| Error::job("no machine called reference"))?;
    let (_, work) = splatsim::fixed::draw_recorded(&splatsim::fixed::elaborate(&machine)?, &quantise(&scene, &machine)?);
    println!("{}: {} rows in {} MB", scene.name, work.rows(), work.bytes() / 1_000_000);
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        for limited in [true, false] {
            let mut machine = machine.clone();
            machine.timing.organisation = organisation;
            if !limited {
                machine.timing.memory.bytes_per_cycle = 1 << 20;
                machine.timing.memory.outstanding = 1 << 16;
                machine.timing.cache.misses = 1 << 16;
            }
            let elaborated = splatsim::fixed::elaborate(&machine)?;
            let start = Instant::now();
            let cycles = replay(&elaborated.timing, &work);
            let seconds = start.elapsed().as_secs_f64();
            let memory = if limited { "with memory" } else { "without limits" };
            println!("{organisation:?} {memory}: {} cycles, {:.1} M rows/s", cycles.total, work.rows() as f64 / seconds / 1e6);
        }
    }
    Ok(())
}
