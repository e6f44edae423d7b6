//! Does the Python package behave as the command line? Runs its own tests, notebooks and type
//! checks on the library that cargo has just built.

#[path = "../../../tests/tier/mod.rs"]
#[allow(dead_code, reason = "others use the rest")]
mod tier;

use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

/// Python of `SPLATSIM_PYTHON`, else `python3`, and whether it has the test requirements: to import
/// them takes a second.
static PYTHON: LazyLock<(String, bool)> = LazyLock::new(|| {
    let python = std::env::var("SPLATSIM_PYTHON").unwrap_or_else(|_| "python3".into());
    let has = Command::new(&python)
        .args(["-c", "import numpy, pyarrow, pytest, mypy"])
        .output();
    (python, has.is_ok_and(|output| output.status.success()))
});

/// That Python, if it has the test requirements; fails in CI if it has not.
fn python() -> Option<&'static str> {
    let (python, has) = &*PYTHON;
    if *has {
        return Some(python);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs tests/requirements.txt in the Python of SPLATSIM_PYTHON"
    );
    println!("skipped: the Python package, whose tests {python} cannot run");
    None
}

fn run(command: &mut Command) {
    let output = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let output_text = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    println!("{output_text}");
    assert!(output.status.success(), "{command:?}: {output_text}");
}

/// Installs the package as a wheel would.
fn install(folder: &Path) {
    let package = folder.join("splatsim");
    std::fs::create_dir(&package).unwrap();
    for file in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("splatsim")).unwrap() {
        let path = file.unwrap().path();
        if path.is_file() && path.extension().is_none_or(|extension| extension != "so") {
            std::fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    let built = std::env::current_exe()
        .unwrap()
        .with_file_name("libsplatsim_native.so");
    std::fs::copy(built, package.join("_native.abi3.so")).unwrap();
}

/// Runs a module of Python on the installed package, in the tiers from `ci` on.
fn of_package(module: &str, arguments: &[&str]) {
    if !tier::runs(tier::Tier::Ci) {
        return;
    }
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    install(folder.path());
    run(Command::new(python)
        .args(["-m", module])
        .args(arguments)
        .current_dir(folder.path())
        .env("PYTHONPATH", folder.path())
        .env("PYTHONDONTWRITEBYTECODE", "1"));
}

/// A file of the package.
fn source(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    path.to_str().unwrap().to_owned()
}

/// Runs the tests of a file.
fn tests_of(file: &str) {
    let path = source(&format!("tests/{file}"));
    of_package(
        "pytest",
        &["-q", "--durations=5", "-p", "no:cacheprovider", &path],
    );
}

#[test]
fn the_types_of_the_package_are_right() {
    of_package("mypy", &["--config-file", &source("pyproject.toml")]);
}

#[test]
fn the_types_of_the_native_module_are_those_that_are_declared() {
    let settings = source("pyproject.toml");
    of_package(
        "mypy.stubtest",
        &["--mypy-config-file", &settings, "splatsim._native"],
    );
}

/// The tests in Python, each file as a test of its own, so that they run at the same time.
macro_rules! files {
    ($($name:ident: $file:literal;)*) => {
        $(
            #[test]
            fn $name() {
                tests_of($file);
            }
        )*

        #[test]
        fn every_file_of_tests_is_run() {
            let mut files: Vec<String> = std::fs::read_dir(source("tests"))
                .unwrap()
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .filter(|name| name.starts_with("test_"))
                .collect();
            files.sort_unstable();
            assert_eq!(files, [$($file),*]);
        }
    };
}

files! {
    a_sweep_on_a_cluster_has_the_rows_of_one_process: "test_cluster.py";
    a_simulation_in_cocotb_compares_with_the_model: "test_cocotb.py";
    the_package_behaves_as_the_command_line: "test_command_line.py";
    the_notebooks_run: "test_notebooks.py";
    the_package_does_what_its_documentation_says: "test_package.py";
}
