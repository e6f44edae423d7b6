//! Program: the splatsim that tests run as a command. It is the one that cargo built with the
//! tests, or the one that `SPLATSIM_PROGRAM` names: in some CI runs, the release build, which users
//! run.

use assert_cmd::Command;
use std::path::Path;
use std::process::Output;
use std::sync::LazyLock;
use std::time::Duration;

/// Its path.
pub static PROGRAM: LazyLock<String> = LazyLock::new(|| {
    std::env::var("SPLATSIM_PROGRAM").unwrap_or_else(|_| env!("CARGO_BIN_EXE_splatsim").to_owned())
});

/// Runs it, for at most a minute.
pub fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .timeout(Duration::from_secs(60))
        .output()
        .unwrap()
}

/// The standard output of a successful run.
pub fn says(arguments: &[&str]) -> String {
    let output = splatsim(arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// Writes an input file, creates missing folders, and returns its path.
pub fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn the_program_that_is_run_is_there_and_of_this_version() {
    let output = std::process::Command::new(&*PROGRAM)
        .arg("--version")
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(output.stdout).unwrap(),
        format!("splatsim {}\n", env!("CARGO_PKG_VERSION"))
    );
}
