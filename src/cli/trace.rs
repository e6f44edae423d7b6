//! Trace: writes the records on the wires between units, to verify RTL.

use super::arguments::{CommonArgs, Corners, NumberRange};
use crate::cosim::trace;
use crate::cosim::trace::{Origin, Window};
use crate::error::Result;
use crate::output::text::{one_line, wrapped};
use crate::scene::Scene;
use clap::Args;
use rtl_model::Machine;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(super) struct TraceArgs {
    /// Scene, point cloud, volume or built-in name
    scene: OsString,
    /// Trace only the ports of these units
    #[arg(long, value_name = "UNIT,…", value_delimiter = ',')]
    units: Vec<String>,
    /// Trace only splats A to B − 1
    #[arg(long, value_name = "A..B")]
    splats: Option<NumberRange>,
    /// Trace only these pixels, X1 and Y1 included
    #[arg(long, value_name = "X0,Y0,X1,Y1")]
    pixels: Option<Corners>,
    /// Trace only one in N splats and pixels
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    sample: Option<u32>,
    /// Trace corner cases and N random cases per unit
    #[arg(long, value_name = "N", conflicts_with_all = ["splats", "pixels", "sample"])]
    stimulus: Option<u32>,
    /// Also write waves of these cycles: VCD, FST
    #[arg(long, value_name = "A..B", conflicts_with = "stimulus")]
    waves: Option<NumberRange>,
    /// Set the seed of random choices
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    pub common: CommonArgs,
    /// Write the trace into DIR
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not print the table
    #[arg(long)]
    quiet: bool,
}

/// Checked arguments.
pub(super) struct TraceJob {
    scene: Scene,
    text: Option<String>,
    /// Absolute path of the scene file, or the built-in name.
    source: Option<String>,
    frame: usize,
    machine: Machine,
    window: Window,
    out: PathBuf,
    quiet: bool,
}

impl TraceArgs {
    pub fn check(self) -> Result<TraceJob> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let window = Window {
            units: self.units,
            splats: self.splats.map(|NumberRange(splats)| splats),
            pixels: self.pixels.map(|Corners(pixels)| pixels),
            sample: self.sample,
            stimulus: self.stimulus,
            waves: self.waves.map(|NumberRange(cycles)| cycles.map(u64::from)),
            seed: self.seed,
        };
        let frame = self.common.frame.unwrap_or(0);
        let path = Path::new(&self.scene);
        // Absolute: records may be compared in another working directory.
        let source = if path.exists() {
            std::path::absolute(path).ok()
        } else {
            Some(path.to_owned())
        };
        let source = source.and_then(|source| source.to_str().map(str::to_owned));
        Ok(TraceJob {
            text: Scene::text(&self.scene),
            source,
            frame,
            scene,
            machine,
            window,
            out: self.out,
            quiet: self.quiet,
        })
    }
}

impl TraceJob {
    pub fn run(self) -> Result<String> {
        let origin = Origin {
            text: self.text.as_deref(),
            source: self.source.as_deref(),
            frame: self.frame,
        };
        let written = trace::trace(&self.scene, origin, &self.machine, &self.window, &self.out)?;
        let folder = one_line(&self.out.to_string_lossy());
        let end = wrapped(&format!(
            "written to {folder}; its README.md describes each file"
        ));
        Ok(if self.quiet {
            String::new()
        } else {
            format!("{}\n\n{end}", written.table())
        })
    }
}
