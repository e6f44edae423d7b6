//! Chart: draws charts of the results of a sweep or a search, and a page of them.

use super::arguments::written;
use crate::error::Result;
use crate::explore::sweep::charts;
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct ChartArgs {
    /// Folder of `sweep` or `search`; charts are written there
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Do not print progress or results
    #[arg(long)]
    quiet: bool,
}

impl ChartArgs {
    pub fn run(self) -> Result<String> {
        let charts = charts::write(&self.folder)?;
        let end = written(&self.folder, &charts.files);
        let text = [charts.summary(), &end]
            .into_iter()
            .filter(|text| !text.is_empty())
            .collect::<Vec<_>>()
            .join("\n\n");
        Ok(if self.quiet { String::new() } else { text })
    }
}
