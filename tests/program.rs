//! Program: which splatsim is run as a command. The one that cargo built with the tests; or the one that `SPLATSIM_PROGRAM` names, as some runs of
//! CI do: the release build, which users run.

use std::sync::LazyLock;

/// Its path.
pub static PROGRAM: LazyLock<String> =
    LazyLock::new(|| std::env::var("SPLATSIM_PROGRAM").unwrap_or_else(|_| env!("CARGO_BIN_EXE_splatsim").to_owned()));

#[test]
fn the_program_that_is_run_is_there_and_of_this_version() {
    let output = std::process::Command::new(&*PROGRAM).arg("--version").output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), format!("splatsim {}\n", env!("CARGO_PKG_VERSION")));
}
