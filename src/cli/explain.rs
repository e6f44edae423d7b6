//! Explain: tells one pixel's whole story, the machine beside golden.

use super::arguments::{Common, Pair, pretty};
use crate::error::Result;
use crate::run::explain::{explain, explained};
use clap::Args;
use std::ffi::OsString;

#[derive(Args, Debug)]
pub(super) struct Typed {
    /// Scene, point cloud, volume or built-in name
    scene: OsString,
    /// Explain this pixel; 0,0 is top left
    #[arg(long, value_name = "X,Y")]
    pixel: Pair<','>,
    #[command(flatten)]
    pub common: Common,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Typed {
    pub fn run(self) -> Result<String> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let Pair(x, y) = self.pixel;
        if self.json {
            pretty(&explained(&scene, &machine, [x, y])?)
        } else {
            explain(&scene, &machine, [x, y])
        }
    }
}
