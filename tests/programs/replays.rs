//! Records a frame once and replays it again and again: for timing the replay.
//!
//! ```sh
//! cargo run --release --example replays -- ../shared/data/scenes/dragon.json
//! ```
//! Prints, for each organisation, for memory as described and ideal, told with histograms or without: rows of boxes replayed in a second
//! by one thread, in the fastest of ten replays.

use rtl_model::machine::Machine;
use rtl_model::machine::timing::Organisation;
use rtl_model::timing::{Detail, replay};
use splatsim::error::{Error, Result};
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::time::Instant;

const TIMES: usize = 10;

fn main() -> Result<()> {
    let scene = std::env::args().nth(1).unwrap_or_else(|| "glass-spheres".into());
    let scene = Scene::load(&scene, &Overrides::default())?;
    let machine = Machine::named("reference").ok_or_else(|| Error::job("no machine called reference"))?;
    let (_, _, work) =
        splatsim::hardware::fixed::draw_measured(&splatsim::hardware::fixed::elaborate(&machine)?, &quantise(&scene, &machine)?);
    println!("{}: {} rows in {} MB", scene.name, work.rows(), work.bytes() / 1_000_000);
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        for (ideal, memory) in [(false, "as described"), (true, "ideal")] {
            for (detail, told) in [(Detail::Histograms, "all of it"), (Detail::Accounts, "accounts")] {
                let mut machine = machine.clone();
                machine.timing.organisation = organisation;
                machine.timing.memory.ideal = ideal;
                let elaborated = splatsim::hardware::fixed::elaborate(&machine)?;
                let mut best = f64::INFINITY;
                let mut total = 0;
                for _ in 0..TIMES {
                    let start = Instant::now();
                    total = replay(&elaborated.timing, &work, detail).total;
                    best = best.min(start.elapsed().as_secs_f64());
                }
                let organisation = format!("{organisation:?}").to_lowercase();
                println!(
                    "{organisation:9}  memory {memory:12}  {told:9}  {total:10} cycles  {:5.1} M rows/s",
                    work.rows() as f64 / best / 1e6
                );
            }
        }
    }
    Ok(())
}
