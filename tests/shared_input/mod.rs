//! Shared input: finds the scans and files that tests read and that are too large to commit.

use std::path::{Path, PathBuf};

/// A file or folder of the input data (`SPLATSIM_DATA`, else `../shared/data`); none if it is
/// absent, which is a failure in CI.
pub fn find(name: &str) -> Option<PathBuf> {
    let root = std::env::var("SPLATSIM_DATA").unwrap_or_else(|_| "../shared/data".into());
    let path = Path::new(&root).join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var("CI").is_err(),
        "{} is absent; set SPLATSIM_DATA",
        path.display()
    );
    println!("skipped: {} is absent", path.display());
    None
}
