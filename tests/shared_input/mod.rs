//! Shared input: finds the scans and files that tests read and that are too large to commit.

use std::path::{Path, PathBuf};

/// A file or folder of the input data; none if it is absent, which is a failure in CI. The data is
/// in `SPLATSIM_DATA`, else in `../shared/data`, relative to the root of the repository, whichever
/// package the test belongs to.
pub fn find(name: &str) -> Option<PathBuf> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .find(|folder| folder.join("Cargo.lock").is_file())
        .expect("the manifest is in a repository with a Cargo.lock");
    let data = std::env::var_os("SPLATSIM_DATA").unwrap_or("../shared/data".into());
    let path = repository.join(data).join(name);
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
