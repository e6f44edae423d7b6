//! Does every file respect the layers (docs/book/invariants.md)? Rules over the source text without
//! comments, contents of strings and unit tests.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Sources by path from the project's folder, with forward slashes; comments, contents of strings
/// and unit tests are blanked out.
type Sources = BTreeMap<String, String>;

fn sources(folders: &[&str]) -> Sources {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    folders
        .iter()
        .for_each(|folder| walk(&root.join(folder), &mut files));
    let path = |file: &Path| {
        file.strip_prefix(root)
            .unwrap()
            .to_str()
            .unwrap()
            .replace('\\', "/")
    };
    files
        .iter()
        .map(|file| {
            (
                path(file),
                without_tests(&code(&std::fs::read_to_string(file).unwrap())),
            )
        })
        .collect()
}

fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for path in entries.map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            walk(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs")
            && path.file_name().is_some_and(|name| name != "tests.rs")
        {
            files.push(path);
        }
    }
}

// --- Reading Rust just well enough ---

/// The text with comments and the contents of strings and characters replaced by spaces; line
/// numbers are unchanged.
fn code(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::new();
    let mut at = 0;
    while at < chars.len() {
        let end = blank_until(&chars, at);
        if end == at {
            out.push(chars[at]);
            at += 1;
        } else {
            out.extend(
                chars[at..end]
                    .iter()
                    .map(|c| if *c == '\n' { '\n' } else { ' ' }),
            );
            at = end;
        }
    }
    out
}

/// The end of the comment, string or character that begins here; `at` itself if none begins.
fn blank_until(chars: &[char], at: usize) -> usize {
    let rest = &chars[at..];
    let starts = |text: &str| {
        text.chars()
            .enumerate()
            .all(|(i, c)| rest.get(i) == Some(&c))
    };
    let inside_word = at > 0 && is_word(chars[at - 1]);
    if starts("//") {
        return at + rest.iter().position(|c| *c == '\n').unwrap_or(rest.len());
    }
    if starts("/*") {
        return at + comment_length(rest);
    }
    if rest[0] == 'r' && !inside_word {
        let hashes = rest[1..].iter().take_while(|c| **c == '#').count();
        if rest.get(1 + hashes) == Some(&'"') {
            let close: Vec<char> = std::iter::once('"')
                .chain(std::iter::repeat_n('#', hashes))
                .collect();
            let body = &rest[2 + hashes..];
            return at
                + 2
                + hashes
                + body
                    .windows(close.len())
                    .position(|w| w == close)
                    .map_or(body.len(), |p| p + close.len());
        }
    }
    if rest[0] == '"' {
        return at + quoted_length(rest, '"');
    }
    // A character, not a lifetime.
    if rest[0] == '\'' && (rest.get(1) == Some(&'\\') || rest.get(2) == Some(&'\'')) {
        return at + quoted_length(rest, '\'');
    }
    at
}

fn comment_length(rest: &[char]) -> usize {
    let (mut depth, mut i) = (0, 0);
    while i + 1 < rest.len() {
        match (rest[i], rest[i + 1]) {
            ('/', '*') => (depth, i) = (depth + 1, i + 2),
            ('*', '/') => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            return i;
        }
    }
    rest.len()
}

fn quoted_length(rest: &[char], quote: char) -> usize {
    let mut i = 1;
    while i < rest.len() {
        match rest[i] {
            '\\' => i += 2,
            c if c == quote => return i + 1,
            _ => i += 1,
        }
    }
    rest.len()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The code without items that are compiled only for tests.
fn without_tests(code: &str) -> String {
    without_items(code, "#[cfg(test)]")
}

/// The code without every item that begins with `head`, up to its `;` or its closing brace.
fn without_items(code: &str, head: &str) -> String {
    let mut out = String::new();
    let mut rest = code;
    while let Some(start) = rest.find(head) {
        out.push_str(&rest[..start]);
        let item = &rest[start + head.len()..];
        rest = &item[item_length(item)..];
    }
    out + rest
}

fn item_length(item: &str) -> usize {
    let mut depth = 0;
    for (i, c) in item.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return i + 1,
            '}' => depth -= 1,
            ';' if depth == 0 => return i + 1,
            _ => {}
        }
    }
    item.len()
}

/// Words and single punctuation characters.
fn tokens(code: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = code.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = if is_word(first) {
            rest.find(|c| !is_word(c)).unwrap_or(rest.len())
        } else {
            first.len_utf8()
        };
        tokens.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    tokens
}

fn names(code: &str, word: &str) -> bool {
    tokens(code).contains(&word)
}

/// The names after every `root::`, one level deep, also inside `root::{…}`.
fn steps_from<'a>(code: &'a str, root: &str) -> BTreeSet<&'a str> {
    let tokens = tokens(code);
    let mut steps = BTreeSet::new();
    for (i, _) in tokens
        .windows(3)
        .enumerate()
        .filter(|(_, w)| *w == [root, ":", ":"])
    {
        match tokens.get(i + 3) {
            Some(&"{") => steps.extend(group(&tokens[i + 4..])),
            Some(step) => _ = steps.insert(step),
            None => {}
        }
    }
    steps
}

/// First words of the entries of a `{a::b, c::{d, e}}`, after its opening brace.
fn group<'a>(tokens: &[&'a str]) -> Vec<&'a str> {
    let (mut depth, mut is_first, mut found) = (0, true, Vec::new());
    for token in tokens {
        match *token {
            "{" => depth += 1,
            "}" if depth == 0 => break,
            "}" => depth -= 1,
            "," if depth == 0 => is_first = true,
            word if is_first => {
                found.push(word);
                is_first = false;
            }
            _ => {}
        }
    }
    found
}

// --- The rules: each returns the faults of one file ---

/// Types and functions of real numbers, and numbers with a point.
fn floats(code: &str) -> Vec<String> {
    let words = ["f32", "f64"]
        .into_iter()
        .filter(|word| names(code, word))
        .map(String::from);
    words.chain(float_literals(code)).collect()
}

fn float_literals(code: &str) -> Vec<String> {
    let bytes = code.as_bytes();
    let is_digit = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_digit);
    let starts = |i: usize| {
        is_digit(i)
            && (i == 0
                || !is_word(bytes[i - 1] as char)
                    && (bytes[i - 1] != b'.' || bytes[..i].ends_with(b"..")))
    };
    let mut found = Vec::new();
    for start in (0..bytes.len()).filter(|i| starts(*i)) {
        let end = (start..bytes.len())
            .find(|i| !is_digit(*i) && bytes[*i] != b'_')
            .unwrap_or(bytes.len());
        let is_hex = code[start..].starts_with("0x");
        let has_exponent = !is_hex && matches!(bytes.get(end), Some(b'e' | b'E'));
        let has_point = bytes.get(end) == Some(&b'.') && is_digit(end + 1);
        if has_point
            || has_exponent
            || code[end..].starts_with("f32")
            || code[end..].starts_with("f64")
        {
            found.push(
                code[start..]
                    .chars()
                    .take_while(|c| is_word(*c) || *c == '.')
                    .collect(),
            );
        }
    }
    found
}

/// Facilities that the machine does not use: files, clocks, output, random hash order, environment.
fn surroundings(code: &str) -> Vec<String> {
    let words = [
        "println",
        "print",
        "eprintln",
        "eprint",
        "dbg",
        "Instant",
        "SystemTime",
        "HashMap",
        "HashSet",
        "File",
        "stdout",
        "stderr",
        "stdin",
    ];
    let roots = ["fs", "io", "env", "net", "time", "process", "path"];
    let used = steps_from(code, "std");
    let words = words.into_iter().filter(|word| names(code, word));
    words
        .chain(roots.into_iter().filter(|root| used.contains(root)))
        .map(String::from)
        .collect()
}

/// Names of its crate that a unit must not use: all except the layers below it, and their host
/// versions.
fn neighbours(code: &str) -> Vec<String> {
    let above = names(code, "super").then(|| "super".into());
    neighbours_over_the_reals(code)
        .into_iter()
        .chain(above)
        .chain(
            steps_from(code, "crate")
                .contains("real")
                .then(|| "crate::real".into()),
        )
        .collect()
}

/// The same for a unit's bound, which may also name its parent unit, and real numbers.
fn neighbours_over_the_reals(code: &str) -> Vec<String> {
    let allowed = [
        "graph",
        "kernels",
        "real",
        "functions",
        "elaboration",
        "machine",
        "probe",
        "frame",
        "records",
        "num",
    ];
    let steps = steps_from(code, "crate")
        .into_iter()
        .filter(|step| !allowed.contains(step))
        .map(|step| format!("crate::{step}"));
    let outside = ["units", "rayon", "pipeline", "host"]
        .into_iter()
        .filter(|word| names(code, word))
        .map(String::from);
    let above = steps_from(code, "super")
        .contains("super")
        .then(|| "super::super".into());
    steps.chain(outside).chain(above).collect()
}

/// Layers of one or several crates, top to bottom: each names only those below it.
struct Layers {
    folders: &'static [&'static str],
    layers: &'static [&'static str],
    /// Files outside the folders: those of the crates themselves, and the bottom layer that is a
    /// single file.
    files: &'static [&'static str],
}

const THE_MACHINE: Layers = Layers {
    folders: &[MACHINE],
    layers: &[
        "timing",
        "pipeline",
        "units",
        "graph",
        "kernels",
        "real",
        "functions",
        "elaboration",
        "machine",
        "probe",
        "work",
        "frame",
        "records",
        "num",
    ],
    files: &["lib"],
};

const THE_BENCH: Layers = Layers {
    folders: BENCH,
    layers: &[
        "cli",
        "view",
        "explore",
        "run",
        "performance",
        "cosim",
        "accuracy",
        "hardware",
        "golden",
        "sampling",
        "scene",
        "input",
        "output",
        "error",
    ],
    files: &["lib", "main", "error"],
};

impl Layers {
    /// The path of a file inside its crate.
    fn inside<'a>(&self, path: &'a str) -> &'a str {
        let inside = |folder: &&str| path.strip_prefix(*folder);
        self.folders.iter().find_map(inside).unwrap_or(path)
    }

    /// The modules on the path of a file: `src/golden/tiles.rs` is golden, tiles.
    fn modules<'a>(&self, path: &'a str) -> Vec<&'a str> {
        self.inside(path)
            .trim_end_matches(".rs")
            .split('/')
            .filter(|module| *module != "mod")
            .collect()
    }

    fn place(&self, layer: &str) -> Option<usize> {
        self.layers.iter().position(|known| *known == layer)
    }

    /// Names in a file that do not point down: names of its crate outside its own layer and the
    /// layers below, by `crate::` or by too many `super::`.
    fn upward(&self, path: &str, code: &str) -> Vec<String> {
        let modules = self.modules(path);
        let own = self.place(modules[0]).unwrap_or(self.layers.len());
        let steps = steps_from(code, "crate")
            .into_iter()
            .filter(|step| self.place(step).is_none_or(|step| step < own));
        let crossing = steps.map(|step| format!("crate::{step}"));
        let tokens = tokens(code);
        // `super` and two colons are three tokens.
        let climbs = |i: usize| {
            tokens[i..]
                .chunks(3)
                .take_while(|step| step[0] == "super")
                .count()
        };
        let out = (0..tokens.len()).any(|i| climbs(i) >= modules.len());
        crossing
            .chain(out.then(|| "super:: leaves its layer".into()))
            .collect()
    }

    /// Every file belongs to a layer, every layer has files, and all names point down.
    fn hold(&self) {
        let sources = sources(self.folders);
        let known: BTreeSet<&str> = sources.keys().map(|path| self.modules(path)[0]).collect();
        let said: BTreeSet<&str> = self.layers.iter().chain(self.files).copied().collect();
        assert_eq!(known, said, "a folder is no layer, or a layer no folder");
        let beside = |path: &str| !self.inside(path).contains('/');
        assert!(
            sources
                .keys()
                .filter(|path| beside(path))
                .all(|path| self.files.contains(&self.modules(path)[0])),
            "a file beside the layers"
        );
        check(
            &sources,
            |path| self.place(self.modules(path)[0]).is_some(),
            |path, code| self.upward(path, code),
        );
    }
}

/// Uses of real numbers, except the declaration of their module.
fn reals(code: &str) -> Vec<String> {
    let tokens = tokens(code);
    let named = |i: &usize| tokens[*i] == "real" && (*i == 0 || tokens[i - 1] != "mod");
    (0..tokens.len())
        .filter(named)
        .map(|_| "names real".into())
        .collect()
}

/// Right shifts, which drop bits. (The formatter puts spaces around the operator, but not around
/// the brackets of generics.)
fn right_shifts(code: &str) -> Vec<String> {
    let by_sign = code.lines().filter(|line| {
        line.contains(" >> ") || line.contains(" >>= ") || line.trim_start().starts_with(">> ")
    });
    let by_name = code
        .lines()
        .filter(|line| tokens(line).iter().any(|word| word.ends_with("shr")));
    by_sign
        .chain(by_name)
        .map(|line| line.trim().to_owned())
        .collect()
}

/// Conversions of real numbers to words: naming the machine's memory and registers, or scaling by
/// powers of two outside the machine.
fn ways_to_bits(code: &str) -> Vec<String> {
    let steps = steps_from(code, "rtl_model");
    if steps.is_empty() {
        return Vec::new();
    }
    let memory = ["frame", "Frame"]
        .into_iter()
        .filter(|step| steps.contains(step))
        .map(|step| format!("rtl_model::{step}"));
    let scaling = ["exp2", "ldexp", "scalbn", "to_bits", "powi"]
        .into_iter()
        .filter(|word| names(code, word))
        .map(String::from);
    memory.chain(scaling).collect()
}

/// Applies a rule to the files that `applies` selects; there must be at least one.
fn check(
    sources: &Sources,
    applies: impl Fn(&str) -> bool,
    rule: impl Fn(&str, &str) -> Vec<String>,
) {
    let chosen: Vec<_> = sources.iter().filter(|(path, _)| applies(path)).collect();
    assert!(!chosen.is_empty(), "no file is looked at");
    let broken: Vec<String> = chosen
        .into_iter()
        .flat_map(|(path, code)| {
            rule(path, code)
                .into_iter()
                .map(move |what| format!("{path}: {what}"))
        })
        .collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

const MACHINE: &str = "rtl_model/src/";
/// The crates around the machine, from top to bottom.
const BENCH: &[&str] = &["src/", "comparison/src/", "golden_model/src/"];
const UNITS: &str = "rtl_model/src/units/";
const NUM: &str = "rtl_model/src/num/";
const FUNCTIONS: &str = "rtl_model/src/functions/";
const PIPELINE: &str = "rtl_model/src/pipeline/";

/// Whether a file of the machine computes with reals what another one computes with words.
fn is_over_the_reals(path: &str) -> bool {
    path.ends_with("/real.rs") || path.starts_with("rtl_model/src/real/")
}

// --- The invariants ---

#[test]
fn the_machine_has_no_floats() {
    check(
        &sources(&["rtl_model/src"]),
        |path| !is_over_the_reals(path),
        |_, code| floats(code),
    );
}

#[test]
fn the_machine_does_not_know_its_own_bounds() {
    let sources = sources(&[MACHINE]);
    assert!(sources.keys().any(|path| is_over_the_reals(path)));
    check(
        &sources,
        |path| !is_over_the_reals(path),
        |_, code| reals(code),
    );
}

#[test]
fn no_unit_uses_the_value_of_a_word() {
    let calls = |code: &str| tokens(code).windows(3).any(|w| w == [".", "value", "("]);
    check(
        &sources(&[MACHINE]),
        |path| !is_over_the_reals(path),
        |_, code| {
            calls(code)
                .then(|| "calls value()".into())
                .into_iter()
                .collect()
        },
    );
    assert!(calls("let x = format.value(word);") && !calls("let value = a.value;"));
}

#[test]
fn the_machine_has_no_files_clocks_prints_or_hash_order() {
    check(&sources(&[MACHINE]), |_| true, |_, code| surroundings(code));
}

#[test]
fn a_unit_names_no_other_unit() {
    let units = sources(&[UNITS]);
    assert!(units.len() >= 7, "{} units", units.len());
    // A part of a unit, in the unit's folder, may name its unit.
    let unit = |path: &str| {
        path.strip_prefix(UNITS)
            .and_then(|rest| rest.trim_start_matches('/').split_once('/'))
            .map(|(unit, _)| unit.to_owned())
    };
    let own = |path: &str, code: &str| {
        unit(path).map_or(code.to_owned(), |unit| {
            code.replace(&format!("crate::units::{unit}::"), "super::")
        })
    };
    let is_part = |path: &str| unit(path).is_some();
    check(
        &units,
        |path| !is_over_the_reals(path) && !is_part(path),
        |_, code| neighbours(code),
    );
    check(
        &units,
        |path| !is_over_the_reals(path) && is_part(path),
        |path, code| {
            neighbours(&own(path, code))
                .into_iter()
                .filter(|name| name != "super")
                .collect()
        },
    );
    check(&units, is_over_the_reals, |path, code| {
        neighbours_over_the_reals(&own(path, code))
    });
}

#[test]
fn imports_point_down_only() {
    THE_MACHINE.hold();
    THE_BENCH.hold();
}

/// The pipeline elaborates and connects them, describes their ports, and drives each separately. A
/// field may be called `units`.
#[test]
fn only_the_pipeline_names_several_units() {
    let rule = |_: &str, code: &str| {
        steps_from(code, "crate")
            .contains("units")
            .then(|| "names the units".into())
            .into_iter()
            .collect()
    };
    // Lists of tiles run one unit, whose result depends on timing.
    let is_exempt = |path: &str| {
        path.starts_with(PIPELINE)
            || path.starts_with(UNITS)
            || path.ends_with("timing/binned/lists.rs")
    };
    check(&sources(&[MACHINE]), |path| !is_exempt(path), rule);
}

/// Function and time meet only in recorded work: timing computes no values, and code that computes
/// values counts no cycles. Machines that differ only in these therefore take the same cycles
/// (`Microarchitecture::same_cycles_as`).
#[test]
fn timing_depends_on_no_path_and_on_no_kept_bit() {
    let asked = |code: &str| {
        ["paths", "pipelines", "storage"]
            .into_iter()
            .filter(|field| names(code, field))
            .map(String::from)
            .collect()
    };
    check(
        &sources(&[MACHINE]),
        |path| path.starts_with(&format!("{MACHINE}timing/")),
        |_, code| asked(code),
    );
    assert_eq!(asked("let bits = timing.storage.memory_bits;"), ["storage"]);
}

#[test]
fn timing_names_only_recorded_work_and_its_own_description() {
    let is_timing = |path: &str| {
        path.starts_with(&format!("{MACHINE}timing/"))
            || path.starts_with(&format!("{MACHINE}work/"))
    };
    let all = sources(&[MACHINE]);
    assert!(all.keys().filter(|path| is_timing(path)).count() >= 8);
    // In a batched replay, each machine is a lane of the host's vector registers. Which tiles have
    // an entry depends on their side, which is a field of timing: the unit `bin` is run there.
    let is_known = |path: &str, step: &str| match step {
        "elaboration" | "machine" | "work" | "timing" => true,
        "kernels" | "num" if path.ends_with("timing/binned/batched.rs") => true,
        _ => path.ends_with("timing/binned/lists.rs"),
    };
    let stranger = |path: &str, code: &str| -> Vec<String> {
        let steps = steps_from(code, "crate");
        steps
            .into_iter()
            .filter(|step| !is_known(path, step))
            .map(|step| format!("crate::{step}"))
            .collect()
    };
    check(&all, is_timing, stranger);
    let counts = |_: &str, code: &str| {
        steps_from(code, "crate")
            .contains("timing")
            .then(|| "crate::timing".into())
            .into_iter()
            .collect()
    };
    check(
        &all,
        |path| !is_timing(path) && !path.ends_with("/lib.rs"),
        counts,
    );
}

#[test]
fn bits_are_lost_in_num_and_functions_alone() {
    // Quantisation of eight sums at a time, and the range of one, which elaboration computes.
    let excused = [
        (">> (limits.right[lane]", "rtl_model/src/kernels/packed.rs"),
        ("] + (most >> right)", "rtl_model/src/kernels/packed.rs"),
        ("] + (least >> right)", "rtl_model/src/kernels/packed.rs"),
        // The vector form of `right`, which is a shift of num.
        ("(SIGN as u64 >> by)", "rtl_model/src/kernels/host.rs"),
        // The bytes of a word in sequence.
        (
            "i64::from_le_bytes(bytes) >> (32 * i)",
            "rtl_model/src/kernels/host.rs",
        ),
        // A limit computed by elaboration, rounded up, and a bit of a mask.
        (
            "(-opaque << opacity_places) >> m.opaque.format.frac_bits",
            "rtl_model/src/units/fragment.rs",
        ),
        ("bits >> place & 1 == 1", "rtl_model/src/kernels/queue.rs"),
    ];
    let sources = sources(&[MACHINE]);
    for (line, path) in excused {
        assert!(
            sources[path].contains(line),
            "{path} has no `{line}` left to excuse"
        );
    }
    let is_excused = |path: &str, line: &str| {
        excused
            .iter()
            .any(|(part, whose)| *whose == path && line.contains(part))
    };
    check(
        &sources,
        |path| !path.starts_with(NUM) && !path.starts_with(FUNCTIONS),
        |path, code| {
            right_shifts(code)
                .into_iter()
                .filter(|line| !is_excused(path, line))
                .collect()
        },
    );
}

#[test]
fn golden_does_not_know_the_machine() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden_model/Cargo.toml");
    let manifest = std::fs::read_to_string(manifest).unwrap();
    let (_, dependencies) = manifest.split_once("[dependencies]").unwrap();
    assert!(names(dependencies, "glam"));
    for above in ["rtl_model", "comparison", "splatsim"] {
        assert!(!names(dependencies, above), "it depends on {above}");
    }
}

#[test]
fn only_quantise_turns_real_numbers_into_bits() {
    let sources = sources(BENCH);
    let door = "comparison/src/hardware/quantise.rs";
    assert!(
        !ways_to_bits(&sources[door]).is_empty(),
        "the rule no longer sees the one door"
    );
    // Lockstep and mixed precision read words that quantise made, together with their real values.
    // Traces write them, and live units take them as input.
    let reads = |path: &str| {
        path.starts_with("comparison/src/accuracy/lockstep")
            || path == "comparison/src/hardware/registers.rs"
    };
    let writes = |path: &str| {
        path.starts_with("comparison/src/cosim/trace") || path == "comparison/src/cosim/live.rs"
    };
    check(
        &sources,
        |path| path != door && !reads(path) && !writes(path),
        |_, code| ways_to_bits(code),
    );
    check(&sources, writes, |_, code| floats(code));
}

/// So that none of them reads an endless device, or blocks on a pipe that no process writes to.
#[test]
fn inputs_are_opened_in_one_place() {
    let opens = |code: &str| -> Vec<String> {
        let tokens = tokens(code);
        let called =
            |owner: &str, what: &str| tokens.windows(5).any(|w| w == [owner, ":", ":", what, "("]);
        let ways = [
            ("fs", "read"),
            ("fs", "read_to_string"),
            ("File", "open"),
            ("ImageReader", "open"),
            ("image", "open"),
        ];
        ways.into_iter()
            .filter(|(owner, what)| called(owner, what))
            .map(|(owner, what)| format!("{owner}::{what}"))
            .collect()
    };
    // Files that the program itself wrote, and the check whether a file may be overwritten.
    let of_results = [
        "golden_model/src/output/files.rs",
        "golden_model/src/output/video.rs",
        "src/performance/recording.rs",
        "src/view/export.rs",
        "src/view/folder.rs",
        "src/explore/sweep/table.rs",
        "src/run/compare/side.rs",
    ];
    let sources = sources(BENCH);
    assert!(
        of_results
            .iter()
            .all(|path| !opens(&sources[*path]).is_empty()),
        "a file is excused that opens none"
    );
    check(
        &sources,
        |path| !path.starts_with("golden_model/src/input/") && !of_results.contains(&path),
        |_, code| opens(code),
    );
}

#[test]
fn unsafe_code_is_only_for_vector_instructions_and_pointers_from_c() {
    let sources = sources(&[
        "rtl_model/src",
        "rtl_model/tests",
        "src",
        "comparison",
        "golden_model",
        "tests",
        "benches",
        "examples",
        "bindings",
    ]);
    assert!(names(&sources["rtl_model/src/kernels/host.rs"], "unsafe"));
    let rule = |_: &str, code: &str| {
        names(code, "unsafe")
            .then(|| "has unsafe code".into())
            .into_iter()
            .collect()
    };
    let may =
        |path: &str| path == "rtl_model/src/kernels/host.rs" || path.starts_with("bindings/c/src/");
    assert!(names(&sources["bindings/c/src/units.rs"], "unsafe"));
    check(&sources, |path| !may(path), rule);
}

// --- The rules can fail ---

#[test]
fn comments_and_strings_are_not_searched() {
    let text = "// f64\n/* f32 /* f64 */ f32 */ let a = \"f64 \\\" f64\"; let b = r#\"f64 \" f64\"#; let c = '\"'; let d: &'a str = \"f64\";\n";
    assert_eq!(floats(&code(text)), [""; 0]);
    assert_eq!(code(text).lines().count(), 2);
    assert!(names(&code(text), "str"));
    let tested = "fn a() {}\n#[cfg(test)]\nmod tests { fn b() { f64 } }\nfn c() {}\n#[cfg(test)]\nmod more;\nfn d() {}";
    assert_eq!(
        tokens(&without_tests(tested)).join(" "),
        "fn a ( ) { } fn c ( ) { } fn d ( ) { }"
    );
}

#[test]
fn floats_are_seen() {
    for text in [
        "let x: f64 = a;",
        "a as f32",
        "let x = 0.5;",
        "x * 1_000.25",
        "1e9",
        "2f64",
        "0..1.5",
    ] {
        assert!(!floats(text).is_empty(), "{text}");
    }
    for text in [
        "self.0.1", "0..5", "1.max(2)", "0x1e9", "f64_like", "a.0", "1 << 5", "[0; 4]",
    ] {
        assert!(floats(text).is_empty(), "{text}: {:?}", floats(text));
    }
}

#[test]
fn surroundings_are_seen() {
    for text in [
        "use std::fs;",
        "use std::{fmt, fs::File};",
        "println!()",
        "std::time::Duration",
        "HashMap::new()",
        "use std::{fmt, io};",
    ] {
        assert!(!surroundings(text).is_empty(), "{text}");
    }
    assert!(
        surroundings(
            "use std::fmt; use std::{array, ops::{Add, Mul}}; let time = 1; profs.println_count"
        )
        .is_empty()
    );
}

#[test]
fn neighbours_are_seen() {
    for text in [
        "use crate::units::gauss;",
        "use super::gauss;",
        "use crate::{num::Fit, pipeline};",
        "crate::kernels::host::vectorised()",
        "use crate::real::Near;",
        "use rayon::prelude::*;",
    ] {
        assert!(!neighbours(text).is_empty(), "{text}");
    }
    assert!(
        neighbours(
            "use crate::{num::{Fit, Lanes}, machine::Machine}; use crate::frame::View; use self::x;"
        )
        .is_empty()
    );
    for text in [
        "use super::super::gauss;",
        "use crate::units::gauss;",
        "use crate::pipeline;",
    ] {
        assert!(!neighbours_over_the_reals(text).is_empty(), "{text}");
    }
    assert!(
        neighbours_over_the_reals(
            "use super::{Shade, x}; use crate::{num::Fit, real::Real}; super::Sums"
        )
        .is_empty()
    );
}

#[test]
fn names_that_point_up_are_seen() {
    let up = |file: &str, code: &str| THE_MACHINE.upward(&format!("{MACHINE}{file}"), code);
    for (file, text) in [
        ("num/fit.rs", "use crate::probe::Tap;"),
        ("probe/mod.rs", "use crate::{num::Fit, units::shade};"),
        ("machine/named.rs", "crate::elaboration::Elaboration"),
        ("units/gauss.rs", "use crate::Machine;"),
        ("records/mod.rs", "use super::units;"),
        ("units/gauss.rs", "use super::super::pipeline;"),
    ] {
        assert!(!up(file, text).is_empty(), "{file}: {text}");
    }
    for (file, text) in [
        (
            "timing/stamps.rs",
            "use crate::{work::Work, elaboration::latency};",
        ),
        (
            "pipeline/fill.rs",
            "use super::Drawing; pub(crate) use crate::pipeline::Setup;",
        ),
        ("units/shade/real/tests.rs", "use super::super::Input;"),
    ] {
        assert!(
            up(file, text).is_empty(),
            "{file}: {text}: {:?}",
            up(file, text)
        );
    }
}

#[test]
fn reals_are_seen() {
    for text in [
        "use crate::real::Near;",
        "use crate::{num, real};",
        "super::real::floor_log2(x)",
        "real::Near",
    ] {
        assert!(!reals(text).is_empty(), "{text}");
    }
    assert!(reals("pub mod real; mod real; let realm = unreal;").is_empty());
}

#[test]
fn right_shifts_are_seen() {
    for text in [
        "let a = b >> 3;",
        "a >>= 1;",
        "    >> (c & 31)",
        "a.wrapping_shr(3)",
        "a.checked_shr(b)",
    ] {
        assert!(!right_shifts(text).is_empty(), "{text}");
    }
    assert!(
        right_shifts("let a: Vec<Vec<u8>> = b << 3; fn c() -> Option<Option<u8>> {}").is_empty()
    );
}

#[test]
fn ways_to_bits_are_seen() {
    for text in [
        "use rtl_model::Frame;",
        "use rtl_model::{Machine, frame::Splat};",
        "use rtl_model::Machine; fn f(x: f64) { x.exp2() }",
    ] {
        assert!(!ways_to_bits(text).is_empty(), "{text}");
    }
    assert!(
        ways_to_bits("use rtl_model::Machine; x.floor()").is_empty()
            && ways_to_bits("x.exp2()").is_empty()
    );
}

#[test]
#[should_panic(expected = "no file is looked at")]
fn a_rule_over_nothing_is_no_rule() {
    check(&Sources::new(), |_| true, |_, _| Vec::new());
}

#[test]
#[should_panic(expected = "a.rs: has a fault")]
fn a_broken_rule_names_the_file() {
    check(
        &Sources::from([("a.rs".into(), "x".into())]),
        |_| true,
        |_, _| vec!["has a fault".into()],
    );
}
