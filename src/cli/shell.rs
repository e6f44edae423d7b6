//! Shell: writes completions for shells, and man pages.

use crate::error::{Error, Result};
use crate::output::files::{Folder, write_beside};
use crate::output::text::one_line;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(super) struct CompletionsArgs {
    /// Shell: bash, elvish, fish, powershell or zsh
    #[arg(hide_possible_values = true)]
    shell: Shell,
}

#[derive(Args, Debug)]
pub(super) struct ManArgs {
    /// Write the pages into DIR
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl CompletionsArgs {
    pub fn run(self, mut command: Command) -> Result<String> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, "splatsim", &mut script);
        String::from_utf8(script).map_err(|e| Error::job(e.to_string()))
    }
}

impl ManArgs {
    pub fn run(self, command: Command) -> Result<String> {
        let mut command = command.disable_help_subcommand(true);
        command.build();
        let _open = Folder::open(&self.folder)?;
        let count = write(&command, &self.folder)?;
        Ok(format!(
            "{count} man pages written to {}",
            one_line(&self.folder.to_string_lossy())
        ))
    }
}

/// Writes the man page of a command and of each subcommand. Returns the number of pages.
fn write(command: &Command, folder: &Path) -> Result<usize> {
    let man = Man::new(command.clone());
    let mut page = Vec::new();
    man.render(&mut page)
        .map_err(|e| Error::job(e.to_string()))?;
    write_beside(&folder.join(man.get_filename()), |file| {
        file.write_all(&page).map_err(|e| e.to_string())
    })?;
    command
        .get_subcommands()
        .map(|below| write(below, folder))
        .try_fold(1, |count, below| Ok(count + below?))
}
