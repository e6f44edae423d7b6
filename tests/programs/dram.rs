//! Memory requests of built-in scenes with a memory preset, and the cycles of the model for them;
//! `dram.py` compares these with memory simulators.
//!
//! ```sh
//! cargo run --release --example dram -- FOLDER PRESET SCENE… [--set PATH=VALUE]…
//! ```
//! Writes `FOLDER/SCENE.trace`, in the format of DRAMsim3, for each scene, and prints a line of
//! JSON for each: cycles of the frame, and the cycles that memory needs for the same requests at
//! full speed, with 32 in flight per channel.

use rtl_model::timing::{Detail, replay, serve};
use serde_json::json;
use splatsim::error::{Error, Result};
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cycles::{Requests, Trace};
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::{Overrides, Scene};
use std::io::{BufWriter, Write};
use std::path::PathBuf;

/// Requests in flight per channel: the usual length of a controller's queue.
const QUEUE: u32 = 32;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |what: &str| {
        arguments
            .next()
            .ok_or_else(|| Error::input(format!("write {what}")))
    };
    let (folder, preset) = (
        PathBuf::from(next("FOLDER PRESET SCENE…")?),
        next("PRESET SCENE…")?,
    );
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let rest: Vec<String> = arguments.collect();
    let scenes = rest.iter().take_while(|argument| *argument != "--set");
    let mut settings = vec![format!("timing.memory.preset={preset}")];
    settings.extend(
        rest.iter()
            .filter(|argument| argument.contains('='))
            .cloned(),
    );
    let machine = fixed::elaborate(&machines::load("reference", &settings)?)?;
    let memory = machine.timing.timing.memory;
    for name in scenes {
        let scene = Scene::load(name, &Overrides::default())?;
        let work = Evaluation::on(&scene, &machine)?.observe().work;
        let cycles = replay(&machine.timing, &work, Detail::Log);
        let hits =
            cycles.memory.row_hits as f64 / cycles.memory.requests.iter().sum::<u64>() as f64;
        let requests = Requests::new(&machine.timing, cycles.requests);
        let path = folder.join(format!("{name}.trace"));
        let failed = |error: std::io::Error| Error::Job(format!("{}: {error}", path.display()));
        let mut file = BufWriter::new(std::fs::File::create(&path).map_err(failed)?);
        requests
            .write(Trace::Dramsim3, &mut file)
            .and_then(|()| file.flush())
            .map_err(failed)?;
        let untimed = serve(memory, requests.in_trace(), QUEUE * memory.channels());
        println!(
            "{}",
            json!({
                "scene": name, "preset": preset, "clock_hz": machine.timing.timing.clock_hz, "burst_bytes": memory.burst_bytes,
                "bytes": cycles.memory.total_bytes(), "frame_cycles": cycles.total, "memory_cycles": untimed, "row_hits": hits,
            })
        );
    }
    Ok(())
}
