//! Records a frame once and replays it many times, to measure the speed of the replay.
//!
//! ```sh
//! cargo run --release --example replays -- ../shared/data/scenes/dragon.json
//! ```
//! For each organisation, for modelled and for ideal memory, with histograms, with unit states or
//! only with a total, it prints the rows of boxes that one thread replays per second, in the
//! fastest of ten replays. Then it prints the same for eight machines with different FIFOs and
//! latencies, one by one and as a batched replay.

use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::Machine;
use rtl_model::machine::timing::Organisation;
use rtl_model::timing::{Detail, replay, replay_all};
use rtl_model::work::Work;
use splatsim::error::{Error, Result};
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::time::Instant;

const TIMES: usize = 10;

fn main() -> Result<()> {
    let scene = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "glass-spheres".into());
    let scene = Scene::load(&scene, &Overrides::default())?;
    let machine =
        Machine::named("reference").ok_or_else(|| Error::job("no machine called reference"))?;
    let (_, _, work) = splatsim::hardware::fixed::draw_measured(
        &splatsim::hardware::fixed::elaborate(&machine)?,
        &quantise(&scene, &machine)?,
    );
    println!(
        "{}: {} rows in {} MB",
        scene.name,
        work.rows(),
        work.bytes() / 1_000_000
    );
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        for (ideal, memory) in [(false, "as described"), (true, "ideal")] {
            for (detail, told) in [
                (Detail::Histograms, "all of it"),
                (Detail::Accounts, "accounts"),
                (Detail::Total, "total"),
            ] {
                let mut machine = machine.clone();
                machine.timing.organisation = organisation;
                machine.timing.memory.ideal = ideal;
                let elaborated = splatsim::hardware::fixed::elaborate(&machine)?;
                let (cycles, rows) =
                    fastest(&work, 1, || replay(&elaborated.timing, &work, detail).total);
                let organisation = format!("{organisation:?}").to_lowercase();
                println!(
                    "{organisation:9}  memory {memory:12}  {told:9}  {cycles:10} cycles  {rows:5.1} M rows/s"
                );
            }
        }
    }
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|error| Error::job(error.to_string()))?;
    one.install(|| eight(&machine, &work))
}

/// The result, and the millions of rows replayed per second.
fn fastest<T>(work: &Work, times: u64, mut of: impl FnMut() -> T) -> (T, f64) {
    let mut timed = || {
        let start = Instant::now();
        (of(), start.elapsed().as_secs_f64())
    };
    let (result, mut best) = timed();
    (1..TIMES).for_each(|_| best = best.min(timed().1));
    (result, (work.rows() * times) as f64 / best / 1e6)
}

/// Eight binned machines, one by one and as a batched replay.
fn eight(machine: &Machine, work: &Work) -> Result<()> {
    let mut machines = Vec::new();
    for (fifo, latency) in [4, 16, 64, 256]
        .into_iter()
        .flat_map(|fifo| [3, 10].map(|latency| (fifo, latency)))
    {
        let mut machine = machine.clone();
        machine.timing.organisation = Organisation::Binned;
        (machine.timing.raster.fifo, machine.timing.shade.latency) = (fifo, Some(latency));
        machines.push(splatsim::hardware::fixed::elaborate(&machine)?);
    }
    let timings: Vec<&Microarchitecture> = machines.iter().map(|machine| &machine.timing).collect();
    let (cycles, rows) = fastest(work, 8, || {
        timings
            .iter()
            .map(|timing| replay(timing, work, Detail::Accounts))
            .collect::<Vec<_>>()
    });
    println!("eight machines  one by one  {rows:5.1} M rows/s");
    let (again, rows) = fastest(work, 8, || replay_all(&timings, work, Detail::Accounts));
    println!("eight machines  abreast     {rows:5.1} M rows/s");
    if cycles == again {
        Ok(())
    } else {
        Err(Error::job("abreast they take other cycles than one by one"))
    }
}
