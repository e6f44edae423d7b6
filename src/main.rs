//! The command line: see `cli.rs`.

use splatsim::cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("splatsim: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}
