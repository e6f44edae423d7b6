//! The command line: see `cli/mod.rs`.

use splatsim::cli;
use splatsim::output::files;
use std::process::ExitCode;

fn main() -> ExitCode {
    files::clean_up_on_signals();
    exit_with_1_on_failed_allocation();
    match cli::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            cli::complain(&error);
            ExitCode::from(error.exit_status())
        }
    }
}

/// Sets the exit status of a failed allocation to 1, as for a failed job. The allocation itself
/// prints a sentence and aborts.
fn exit_with_1_on_failed_allocation() {
    #[cfg(unix)]
    {
        let always = std::sync::Arc::new(true.into());
        // If it cannot be registered, the process ends by the signal.
        let _ = signal_hook::flag::register_conditional_shutdown(
            signal_hook::consts::SIGABRT,
            1,
            always,
        );
    }
}
