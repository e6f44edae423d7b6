//! Does the page of `view` behave in a browser as docs/book/view.md describes? Chromium is driven
//! by Playwright's library for Python in `tests/programs/view.py`. Screenshots are kept in
//! `target/browser`.
//!
//! `SPLATSIM_BOOK_PICTURES=1 cargo test --test suite browser::` redraws the book's pictures.

use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python with Playwright: that of `.ci/run`, or the system's.
fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/playwright/bin/python");
    let has_it = |python: &PathBuf| {
        Command::new(python)
            .args(["-c", "import playwright"])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    let named = std::env::var_os("SPLATSIM_PLAYWRIGHT").map(PathBuf::from);
    named
        .into_iter()
        .chain([own, "python3".into()])
        .find(has_it)
}

#[test]
fn the_page_behaves_in_a_browser_as_the_book_describes() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let has_chromium = Command::new("chromium")
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success());
    let Some(python) = python().filter(|_| has_chromium) else {
        assert!(
            std::env::var_os("CI").is_none(),
            "chromium, or Playwright for Python, is not installed"
        );
        println!(
            "skipped: the page in a browser, for want of chromium or of Playwright for Python"
        );
        return;
    };
    let book = std::env::var_os("SPLATSIM_BOOK_PICTURES").map(|_| root.join("traces/view"));
    let screenshots = root.join("target/browser");
    let mut command = Command::new(python);
    command
        .arg(root.join("tests/programs/view.py"))
        .arg(&*PROGRAM)
        .arg(screenshots)
        .args(book);
    let output = command.output().unwrap();
    let (told, wrong) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    println!("{told}");
    assert!(output.status.success(), "{told}\n{wrong}");
}
