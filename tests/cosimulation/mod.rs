//! Co-simulation: runs the RTL implementations on two simulators, driven by traces.

#![allow(dead_code, reason = "each test file uses its own part")]

use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Arc, LazyLock, Mutex, OnceLock};
use tempfile::TempDir;

/// A simulator of SystemVerilog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simulator {
    Icarus,
    Verilator,
}

/// An RTL implementation that the bench can drive.
#[derive(Clone, Copy, Debug)]
pub struct Unit {
    pub name: &'static str,
    /// The unit whose streams it uses.
    pub stream: &'static str,
    /// Ports that the bench must connect.
    pub macros: &'static [&'static str],
    /// Parameters other than the picture's sides.
    pub parameters: &'static [&'static str],
}

const FRAME: &str = "HAS_FRAME";
const LIGHTING: &str = "HAS_LIGHTING";
const DRAIN: &str = "HAS_DRAIN";
/// For the assertions inside the RTL implementations.
const FRAGMENT: &str = "HAS_FRAGMENT";
const SHEETS: &str = "HAS_SHEETS";
const WINDOWS: &str = "HAS_WINDOWS";
const RESOLVE: &str = "HAS_RESOLVE";

const fn of_itself(name: &'static str, macros: &'static [&'static str]) -> Unit {
    Unit {
        name,
        stream: name,
        macros,
        parameters: &[],
    }
}

/// All units, in the order of the diagram.
pub const UNITS: [Unit; 7] = [
    of_itself("project", &[FRAME]),
    of_itself("ellipse", &[FRAME]),
    of_itself("raster", &[FRAME, "HAS_CORNER"]),
    of_itself("gauss", &["HAS_LEAST"]),
    of_itself("fragment", &[FRAME, DRAIN, FRAGMENT]),
    of_itself("shade", &[FRAME, LIGHTING]),
    of_itself("resolve", &[FRAME, RESOLVE]),
];

/// Replacements of units in a frame of ellipsoids.
pub const OF_ELLIPSOIDS: [Unit; 2] = [
    Unit {
        stream: "ellipse",
        ..of_itself("ellipsoid", &[FRAME])
    },
    Unit {
        stream: "fragment",
        ..of_itself("sheets", &[FRAME, DRAIN, SHEETS])
    },
];

/// Replacements of fragment if fragments are grouped by intervals or windows.
pub const OF_WINDOWS: Unit = Unit {
    stream: "fragment",
    ..of_itself("windows", &[FRAME, DRAIN, WINDOWS])
};

/// The unit that only frames with harmonics have.
pub const OF_HARMONICS: Unit = of_itself("colour", &[FRAME]);

/// All units wired together.
pub const PIPELINE: Unit = wired("pipeline", &[FRAME, LIGHTING, DRAIN, FRAGMENT, RESOLVE]);

/// The same for a binned machine: lists, followed by two tile engines, one, or three.
pub const PIPELINE_OF_TILES: Unit = wired(
    "pipeline_tiles",
    &[FRAME, LIGHTING, DRAIN, FRAGMENT, RESOLVE],
);
pub const OF_ONE_ENGINE: Unit = Unit {
    parameters: &[".ENGINES(1)"],
    ..PIPELINE_OF_TILES
};
pub const OF_THREE_ENGINES: Unit = Unit {
    parameters: &[".ENGINES(3)"],
    ..PIPELINE_OF_TILES
};

/// The same for ellipsoids, whose fragments are grouped by depth, or by sheets.
pub const PIPELINES_OF_ELLIPSOIDS: [Unit; 2] = [
    wired(
        "pipeline_ellipsoids",
        &[FRAME, LIGHTING, DRAIN, FRAGMENT, RESOLVE],
    ),
    wired(
        "pipeline_sheets",
        &[FRAME, LIGHTING, DRAIN, SHEETS, RESOLVE],
    ),
];

const fn wired(name: &'static str, macros: &'static [&'static str]) -> Unit {
    Unit {
        stream: "pipeline",
        ..of_itself(name, macros)
    }
}

/// The folder of the RTL implementations.
pub fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("rtl_model/rtl")
}

/// Whether these programs are installed. If not, prints what is skipped, or fails in CI.
pub fn have(programs: &[&str], what: &str) -> bool {
    let is_missing = |program: &&&str| {
        Command::new(program).arg("--version").output().is_err()
            && Command::new(program).arg("-V").output().is_err()
    };
    let missing: Vec<&str> = programs.iter().filter(is_missing).copied().collect();
    if missing.is_empty() {
        return true;
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs {}",
        missing.join(", ")
    );
    println!("skipped: {what}, for want of {}", missing.join(", "));
    false
}

/// Runs a command, which must succeed.
pub fn run(command: &mut Command) -> Output {
    let output = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let told = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    assert!(output.status.success(), "{command:?} failed:\n{told}");
    output
}

/// An RTL implementation, compiled for one machine.
pub struct Device {
    program: Vec<PathBuf>,
    trace: PathBuf,
    unit: Unit,
    /// Cycles without a transfer after which the bench gives up.
    patience: u32,
    kept: TempDir,
}

/// Outputs of a device.
pub struct Given {
    /// The last line that the bench printed.
    pub last: String,
    /// Records of the unit's output.
    pub out: PathBuf,
    /// Cycles in which each record was taken in and given out, line by line.
    pub times: PathBuf,
    /// Requests from `fragment` to shade.
    pub requests: PathBuf,
    /// Final contents of `fragment`.
    pub held: PathBuf,
}

impl Given {
    /// Splits the outputs of `frames` consecutive frames of the same length; none if they cannot be
    /// split evenly.
    pub fn frames(self, frames: usize, folder: &Path) -> Option<Vec<Given>> {
        let files = [&self.out, &self.requests, &self.held];
        let texts = files.map(|file| std::fs::read_to_string(file).unwrap_or_default());
        let of = |frame: usize| {
            let part = |text: &String, file: &Path| {
                let lines: Vec<&str> = text.lines().collect();
                let each = lines
                    .len()
                    .is_multiple_of(frames)
                    .then_some(lines.len() / frames)?;
                let path = folder.join(format!("{frame}-{}", file.file_name().unwrap().display()));
                std::fs::write(
                    &path,
                    lines[frame * each..][..each]
                        .iter()
                        .map(|line| format!("{line}\n"))
                        .collect::<String>(),
                )
                .unwrap();
                Some(path)
            };
            let [out, requests, held] = [0, 1, 2].map(|i| part(&texts[i], files[i]));
            Some(Given {
                last: self.last.clone(),
                out: out?,
                times: self.times.clone(),
                requests: requests?,
                held: held?,
            })
        };
        (0..frames).map(of).collect()
    }
}

/// The program compiled from these files and those of `sources`. It is kept under the digest of all
/// of them, so that a unit is compiled once per machine for all tests and runs. With other sources,
/// as mutants have, it is in `folder` and is not kept.
fn compiled(
    simulator: Simulator,
    sources: &Path,
    defines: &[String],
    files: &[PathBuf],
    folder: &Path,
) -> PathBuf {
    if sources != self::sources() {
        return compile(simulator, sources, defines, files, folder);
    }
    type Programs = Mutex<HashMap<PathBuf, Arc<OnceLock<()>>>>;
    static PROGRAMS: LazyLock<Programs> = LazyLock::new(Programs::default);
    let program = shelf().join(digest(simulator, sources, defines, files));
    let once = PROGRAMS
        .lock()
        .unwrap()
        .entry(program.clone())
        .or_default()
        .clone();
    once.get_or_init(|| {
        if !program.exists() {
            // Another process may do the same: each moves a complete program into place.
            let folder = tempfile::tempdir_in(shelf()).unwrap();
            std::fs::rename(
                compile(simulator, sources, defines, files, folder.path()),
                &program,
            )
            .unwrap();
        }
    });
    program
}

/// The folder of kept programs.
fn shelf() -> PathBuf {
    let shelf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("devices");
    std::fs::create_dir_all(&shelf).unwrap();
    shelf
}

/// A digest of all inputs of a program: the simulator, the RTL implementations and the bench, the
/// machine's package, and the macros.
fn digest(simulator: Simulator, sources: &Path, defines: &[String], files: &[PathBuf]) -> String {
    static VERSIONS: LazyLock<[Vec<u8>; 2]> =
        LazyLock::new(|| [["iverilog", "-V"], ["verilator", "--version"]].map(version));
    let mut all: Vec<PathBuf> = [sources, &sources.join("bench")]
        .into_iter()
        .flat_map(files_in)
        .chain(files.iter().cloned())
        .collect();
    // By name, because each trace has another folder.
    all.sort_by_key(|file| file.file_name().map(OsStr::to_owned));
    all.dedup();
    let mut digest = Sha256::new();
    digest.update(&VERSIONS[usize::from(simulator == Simulator::Verilator)]);
    digest.update(VERILATOR.concat());
    digest.update(compiler().concat());
    digest.update(defines.join("\n"));
    for file in all {
        let text = std::fs::read(&file).unwrap();
        digest.update(format!(
            "\n{} {}\n",
            file.file_name().unwrap().display(),
            text.len()
        ));
        digest.update(text);
    }
    format!("{simulator:?}-{:x}", digest.finalize())
}

fn version([program, option]: [&str; 2]) -> Vec<u8> {
    Command::new(program)
        .arg(option)
        .output()
        .map(|output| output.stdout)
        .unwrap_or_default()
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .collect()
}

/// Verilator's options for every unit. Its output is compiled as one file, because many files would
/// each read the same headers.
const VERILATOR: [&str; 13] = [
    "--binary",
    "--timing",
    "--assert",
    "-O3",
    "-j",
    "2",
    "-Wno-fatal",
    "--top-module",
    "bench",
    "-MAKEFLAGS",
    "OPT_FAST=-O2",
    "-MAKEFLAGS",
    "VM_PARALLEL_BUILDS=0",
];

/// clang, if it is installed: it compiles Verilator's output in half the time of g++, and the
/// programs are equally fast.
fn compiler() -> &'static [&'static str] {
    const CLANG: [&str; 6] = [
        "-MAKEFLAGS",
        "CXX=clang++",
        "-MAKEFLAGS",
        "LINK=clang++",
        "-MAKEFLAGS",
        "CFG_CXXFLAGS_COROUTINES=-std=gnu++20",
    ];
    static IS_HERE: LazyLock<bool> =
        LazyLock::new(|| Command::new("clang++").arg("--version").output().is_ok());
    if *IS_HERE { &CLANG } else { &[] }
}

/// Verilator, with ccache if it is installed: most of the code compiled for a unit is Verilator's
/// library, which is the same for each unit.
pub fn verilator() -> Command {
    let mut verilator = Command::new("verilator");
    if Command::new("ccache").arg("--version").output().is_ok() {
        verilator.env("OBJCACHE", "ccache");
    }
    verilator
}

fn compile(
    simulator: Simulator,
    sources: &Path,
    defines: &[String],
    files: &[PathBuf],
    folder: &Path,
) -> PathBuf {
    let program = folder.join("device");
    match simulator {
        Simulator::Icarus => {
            run(Command::new("iverilog")
                .args(["-g2012", "-s", "bench", "-o"])
                .arg(&program)
                .args(defines)
                .arg("-y")
                .arg(sources)
                .args(["-Y", ".sv"])
                .args(files));
            program
        }
        Simulator::Verilator => {
            run(verilator()
                .args(VERILATOR)
                .args(compiler())
                .arg("--Mdir")
                .arg(&program)
                .args(defines)
                .arg("-y")
                .arg(sources)
                .args(files));
            program.join("Vbench")
        }
    }
}

impl Device {
    /// Compiles a unit, its files taken from `sources`, with the package of a trace's folder, for a
    /// picture with `side` pixels per side.
    pub fn new(
        simulator: Simulator,
        sources: &Path,
        trace: &Path,
        unit: Unit,
        side: u32,
    ) -> Device {
        Device::with(simulator, sources, trace, unit, side, None)
    }

    /// The same, with the folder of its tables, relative to the trace's folder.
    pub fn with(
        simulator: Simulator,
        sources: &Path,
        trace: &Path,
        unit: Unit,
        side: u32,
        roms: Option<&str>,
    ) -> Device {
        let kept = tempfile::tempdir().unwrap();
        let bench = match unit.name {
            "fragment" | "windows" => "bench_fragment",
            "sheets" => "bench_sheets",
            name => name,
        };
        let upper = unit.stream.to_uppercase();
        let mut defines = vec![
            format!("-DDUT={bench}"),
            format!("-DIN_W=machine_pkg::{upper}_IN_W"),
            format!("-DOUT_W=machine_pkg::{upper}_OUT_W"),
        ];
        defines.extend(unit.macros.iter().map(|name| format!("-D{name}")));
        let mut parameters: Vec<String> = unit
            .parameters
            .iter()
            .map(|&parameter| parameter.into())
            .collect();
        if unit.macros.contains(&DRAIN) {
            parameters.push(format!(".WIDTH({side}),.HEIGHT({side})"));
        }
        if let Some(roms) = roms.filter(|_| unit.name != "fragment") {
            parameters.push(format!(".ROMS(\"{roms}\")"));
        }
        if !parameters.is_empty() {
            defines.push(format!("-DDUT_PARAMETERS={}", parameters.join(",")));
        }
        let mut files = vec![trace.join("machine_pkg.sv"), sources.join("bench/bench.sv")];
        if simulator == Simulator::Verilator {
            files.extend(
                ["handshake", "handshakes"]
                    .map(|name| sources.join("bench").join(name).with_extension("sv")),
            );
        }
        if bench != unit.name {
            let starts = if unit.name == "windows" {
                &[][..]
            } else {
                &["bench_start"]
            };
            files.extend(
                starts
                    .iter()
                    .chain([&bench])
                    .map(|name| sources.join("bench").join(name).with_extension("sv")),
            );
        }
        let program = match simulator {
            Simulator::Icarus => vec![
                "vvp".into(),
                compiled(simulator, sources, &defines, &files, kept.path()),
            ],
            Simulator::Verilator => {
                vec![compiled(simulator, sources, &defines, &files, kept.path())]
            }
        };
        // With all units wired together there is no output while the splats in flight are drawn,
        // each of which may be as large as the picture. With windows, the layers of each pixel are
        // shaded at the end, after the last input.
        let is_long = unit.stream == "pipeline" || unit.name == "windows";
        let patience = if is_long {
            20_000 + 512 * side * side
        } else {
            20_000
        };
        Device {
            program,
            trace: trace.to_owned(),
            unit,
            patience,
            kept,
        }
    }

    /// Drives it with these inputs, or with those of the trace, and expects `expect` records.
    pub fn drive(&self, inputs: Option<&[String]>, expect: usize, arguments: &[&str]) -> Given {
        let file = |name: &str| self.kept.path().join(name);
        let (out, times, requests, held) = (
            file("out.hex"),
            file("times"),
            file("requests.hex"),
            file("held.hex"),
        );
        let mut input = self.trace.join(format!("{}.in.hex", self.unit.stream));
        if let Some(inputs) = inputs {
            input = file("in.hex");
            std::fs::write(
                &input,
                inputs
                    .iter()
                    .map(|line| format!("{line}\n"))
                    .collect::<String>(),
            )
            .unwrap();
        }
        let mut command = Command::new(&self.program[0]);
        command.args(&self.program[1..]).current_dir(&self.trace);
        let mut given = |name: &str, path: &Path| {
            command.arg(format!("+{name}={}", path.display()));
        };
        given("in", &input);
        given("out", &out);
        given("times", &times);
        if ["fragment", "windows"].contains(&self.unit.name) {
            given("answers", &self.trace.join("fragment.answer.hex"));
            given("requests", &requests);
        }
        if self.unit.stream == "fragment" {
            given("held", &held);
            // A window of splats.
            let start = self.trace.join("fragment.start.hex");
            if start.exists() {
                given("start", &start);
            }
        }
        // Arguments that the caller gives come first, because the first one counts.
        command.args(arguments);
        command.args([
            format!("+expect={expect}"),
            "+quiet=200".into(),
            format!("+patience={}", self.patience),
        ]);
        let output = command
            .output()
            .unwrap_or_else(|e| panic!("{command:?}: {e}"));
        let text = [&output.stdout[..], &output.stderr[..]]
            .map(String::from_utf8_lossy)
            .concat();
        // A failed assertion ends the program.
        let failed = text.lines().find(|line| line.contains("Assertion failed"));
        assert!(
            output.status.success() || failed.is_some(),
            "{command:?} failed:\n{text}"
        );
        let last = failed
            .or(text.lines().rfind(|line| line.starts_with("bench:")))
            .unwrap_or_default()
            .to_owned();
        Given {
            last,
            out,
            times,
            requests,
            held,
        }
    }
}
