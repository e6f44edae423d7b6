//! All tests of the bench in one binary, so that both cores are busy until the last test and only
//! one program is linked.
//!
//! A file `tests/QUESTION.rs` is a module here: `cargo test --test suite QUESTION::` runs only its
//! tests. Co-simulation is `tests/rtl.rs`.

mod area;
mod attribution;
mod bad_input;
mod book;
mod bounds;
mod browser;
mod channel;
mod chart;
mod cli;
mod compare;
mod contribution;
mod cosimulation;
mod diff;
mod dram;
mod edge_cases;
mod filters;
mod fixed_laws;
mod fixed_match;
mod foreign_files;
mod gaussian_match;
mod golden_laws;
mod golden_match;
mod golden_window;
mod handmade;
mod harmonics;
mod hostile;
mod incremental;
mod irregular;
mod layering;
mod live;
#[path = "programs/merge_rules.rs"]
#[allow(dead_code, reason = "its `main` prints what is compared here")]
mod merge_rules;
mod meshes;
mod mixed;
#[path = "../rtl_model/tests/machines/mutation.rs"]
#[expect(dead_code, reason = "the machine's own tests use the rest")]
mod mutation;
mod old_names;
mod parcel;
mod paths;
mod photographs;
mod pinned;
mod program;
mod proofs;
mod quantise_laws;
mod ranges;
mod reach;
mod readme;
mod recording;
#[path = "programs/reference.rs"]
#[allow(dead_code, reason = "its `main` writes what is compared here")]
mod reference;
mod reflection;
mod regressions_inputs;
mod regressions_promises;
mod sampling;
mod search;
mod shared_input;
mod sheets;
mod slurm;
mod stress;
mod sweep;
mod tier;
mod trace;
mod traced;
mod tree;
mod view;
mod volume_match;
mod wild_scenes;
mod windows;
mod worlds;

#[test]
fn no_question_is_forgotten() {
    let roots = concat!(include_str!("suite.rs"), include_str!("rtl.rs"));
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests")).unwrap();
    let names = folder
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    let names: Vec<String> = names
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert!(names.len() > 20, "{names:?}");
    let forgotten = |name: &&String| {
        !["suite", "rtl"].contains(&name.as_str()) && !roots.contains(&format!("\nmod {name};\n"))
    };
    assert_eq!(
        names.iter().filter(forgotten).collect::<Vec<_>>(),
        [""; 0],
        "no binary has them"
    );
}
