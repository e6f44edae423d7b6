//! Explain: tells one pixel's whole story, the machine beside golden.

use super::arguments::{Common, Pair};
use crate::error::Result;
use crate::run::explain::explain;
use clap::Args;
use std::ffi::OsString;

#[derive(Args, Debug)]
pub(super) struct Typed {
    /// A .json scene, .ply cloud or built-in name
    scene: OsString,
    /// The pixel; 0,0 is top left
    #[arg(long, value_name = "X,Y")]
    pixel: Pair<','>,
    #[command(flatten)]
    pub common: Common,
}

impl Typed {
    pub fn run(self) -> Result<String> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let Pair(x, y) = self.pixel;
        explain(&scene, &machine, [x, y])
    }
}
