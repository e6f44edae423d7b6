//! Scene: shows what a scene file, and a plan of scenes, may hold.

use super::arguments::pretty;
use crate::error::Result;
use crate::explore::sweep::plan;
use crate::scene;
use clap::Subcommand;

#[derive(Subcommand, Debug)]
pub(super) enum Typed {
    /// Print the JSON Schema of scene files
    Schema,
    /// Print the JSON Schema of plans for `sweep`
    PlanSchema,
}

impl Typed {
    pub fn run(self) -> Result<String> {
        match self {
            Typed::Schema => pretty(&scene::schema()),
            Typed::PlanSchema => pretty(&plan::schema()),
        }
    }
}
