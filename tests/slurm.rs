//! Is a sweep by Slurm in shards, one of which is killed and requeued, equal to that of one
//! process?

use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use std::process::Command;

fn is_there(program: &str) -> bool {
    let found = Command::new("sh")
        .args(["-c", &format!("command -v {program}")])
        .output();
    found.is_ok_and(|output| output.status.success())
}

#[test]
fn an_array_of_slurm_draws_the_rows_of_one_process() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let is_root = Command::new("id")
        .arg("-u")
        .output()
        .is_ok_and(|output| output.stdout == b"0\n");
    if !is_root || !["slurmctld", "slurmd", "munged"].into_iter().all(is_there) {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI needs Debian's slurm-wlm and munge, and root"
        );
        println!("skipped: an array of Slurm, which needs root, slurm-wlm and munge");
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/programs/slurm.sh");
    let output = Command::new("bash")
        .args([script, &PROGRAM])
        .output()
        .unwrap();
    let told = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    assert!(output.status.success(), "{told}");
    for said in [
        "task 2: killed after",
        "16 rows of the array are those of one process",
        "16 points: 0 drawn now, 16 known before",
    ] {
        assert!(told.contains(said), "{told}");
    }
}
