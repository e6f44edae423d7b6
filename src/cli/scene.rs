//! Scene: prints the schemas of scene files and of plans.

use super::arguments::{pretty, readable};
use crate::error::Result;
use crate::explore::sweep::plan;
use crate::scene;
use clap::Subcommand;

#[derive(Subcommand, Debug)]
pub(super) enum SceneCommand {
    /// Print the JSON Schema of scene files
    Schema,
    /// Print the JSON Schema of plans for `sweep`
    PlanSchema,
}

impl SceneCommand {
    pub fn run(self) -> Result<String> {
        match self {
            SceneCommand::Schema => pretty(&readable(scene::schema())),
            SceneCommand::PlanSchema => pretty(&readable(plan::schema())),
        }
    }
}
