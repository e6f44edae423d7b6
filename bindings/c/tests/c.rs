//! Does the C library behave as its header specifies: from C with gcc and clang, under
//! AddressSanitizer and valgrind, from C++ and from a testbench?

mod dpi;
#[path = "../../../tests/tier/mod.rs"]
#[allow(dead_code, reason = "each test file uses its own part")]
mod tier;
#[path = "../../../tests/traced/mod.rs"]
mod traced;

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Whether a program is installed. If not, prints what is skipped, or fails in CI.
fn is_installed(program: &str) -> bool {
    if Command::new(program).arg("-V").output().is_ok() {
        return true;
    }
    assert!(std::env::var_os("CI").is_none(), "CI needs {program}");
    println!("skipped: C with {program}, which is absent");
    false
}

fn run(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let printed = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    assert!(output.status.success(), "{command:?} failed:\n{printed}");
    printed
}

/// Folder of the libraries that cargo built with this test.
fn libraries() -> PathBuf {
    std::env::current_exe()
        .unwrap()
        .parent()
        .unwrap()
        .to_owned()
}

/// A few discs, lit, in a picture of a few pixels.
fn scene(folder: &Path) -> PathBuf {
    let splat = |i: u32| {
        let [x, y] = [i % 4, i / 4].map(|place| f64::from(place) * 0.3 - 0.5);
        let green = f64::from(i) / 12.0;
        format!(
            r#"{{"position": [{x}, {y}, {}], "normal": [0.1, 0.2, 1], "radius": 0.2, "rgb": [0.9, {green}, 0.3], "opacity": 0.7}}"#,
            x * y
        )
    };
    let splats: Vec<String> = (0..12).map(splat).collect();
    let text = format!(
        r#"{{"splats": [{}], "camera": {{"eye": [0.2, 0.1, 3], "target": [0, 0, 0], "fov_y_degrees": 40}},
            "image": {{"width": 12, "height": 8}}, "lights": [{{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}}]}}"#,
        splats.join(", ")
    );
    let path = folder.join("scene.json");
    std::fs::write(&path, text).unwrap();
    path
}

/// Compiles the example against the shared library, with additional options; returns the program.
fn compiled(compiler: &str, options: &[&str], folder: &Path) -> PathBuf {
    let program = folder.join(format!("units-{compiler}{}", options.concat()));
    run(Command::new(compiler)
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            "-g",
            "-o",
        ])
        .arg(&program)
        .args(options)
        .arg("-I")
        .arg(root().join("include"))
        .arg(root().join("examples/units.c"))
        .arg("-L")
        .arg(libraries())
        .arg("-lsplatsim_c"));
    program
}

fn check_success(output: &str) {
    assert!(
        output.lines().last().is_some_and(|line| line == "all well"),
        "{output}"
    );
    assert!(
        output.contains("gauss: ") && output.contains("the model's is"),
        "{output}"
    );
}

#[test]
fn the_example_runs_with_gcc_under_its_sanitizers_and_with_clang() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    let cases: [(&str, &[&str], &[&str]); 2] = [
        (
            "gcc",
            &["-fsanitize=address,undefined", "-fno-sanitize-recover"],
            &[],
        ),
        ("clang", &[], &["gauss", "resolve"]),
    ];
    for (compiler, options, units) in cases
        .into_iter()
        .filter(|(compiler, ..)| is_installed(compiler))
    {
        let program = compiled(compiler, options, folder.path());
        check_success(&run(Command::new(program)
            .arg(&scene)
            .args(units)
            .env("LD_LIBRARY_PATH", libraries())));
    }
}

#[test]
fn valgrind_finds_nothing_in_the_example() {
    if !is_installed("gcc") || !is_installed("valgrind") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = compiled("gcc", &[], folder.path());
    // Memory that threads of the pool keep until the end is not a leak.
    let output = run(Command::new("valgrind")
        .args([
            "--quiet",
            "--error-exitcode=9",
            "--leak-check=full",
            "--show-leak-kinds=definite",
            "--errors-for-leak-kinds=definite",
        ])
        .arg(program)
        .arg(scene(folder.path()))
        .args(["gauss", "raster", "resolve"])
        .env("LD_LIBRARY_PATH", libraries())
        .env("RAYON_NUM_THREADS", "2"));
    check_success(&output);
}

#[test]
fn the_example_runs_with_the_static_library() {
    if !is_installed("gcc") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("static");
    run(Command::new("gcc")
        .args(["-std=c99", "-o"])
        .arg(&program)
        .arg("-I")
        .arg(root().join("include"))
        .arg(root().join("examples/units.c"))
        .arg(libraries().join("libsplatsim_c.a"))
        .args(["-lpthread", "-ldl", "-lm"]));
    check_success(&run(Command::new(program)
        .arg(scene(folder.path()))
        .args(["gauss", "fragment"])));
}

#[test]
fn the_header_is_generated_by_cbindgen_and_compiles_as_cpp() {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).unwrap();
    let mut text = Vec::new();
    cbindgen::Builder::new()
        .with_crate(root())
        .with_config(config)
        .generate()
        .unwrap()
        .write(&mut text);
    let path = root().join("include/splatsim.h");
    let text = String::from_utf8(text).unwrap();
    if std::env::var_os("SPLATSIM_WRITE_HEADER").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let header = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        header == text,
        "include/splatsim.h does not match src/: SPLATSIM_WRITE_HEADER=1 cargo test -p splatsim-c writes it"
    );
    if is_installed("g++") {
        run(Command::new("g++")
            .args([
                "-fsyntax-only",
                "-Wall",
                "-Werror",
                "-pedantic",
                "-x",
                "c++",
            ])
            .arg(&path));
    }
}
