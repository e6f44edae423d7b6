//! Explain: prints a pixel trace: each contribution to one pixel, in the machine and in golden.

use super::arguments::{CommonArgs, TwoNumbers, pretty};
use crate::error::Result;
use crate::run::explain::{explain, explained};
use clap::Args;
use std::ffi::OsString;

#[derive(Args, Debug)]
pub(super) struct ExplainArgs {
    /// Scene, point cloud, volume or built-in name
    scene: OsString,
    /// Explain this pixel; 0,0 is top left
    #[arg(long, value_name = "X,Y")]
    pixel: TwoNumbers<','>,
    #[command(flatten)]
    pub common: CommonArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl ExplainArgs {
    pub fn run(self) -> Result<String> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let TwoNumbers(x, y) = self.pixel;
        if self.json {
            pretty(&explained(&scene, &machine, [x, y])?)
        } else {
            explain(&scene, &machine, [x, y])
        }
    }
}
