//! Claims: the stated figures of a search, each with the camera that decides it, so that `run` can
//! reproduce it.
//!
//! ```text
//! cameras that decided ─► cameras.json, one file per scene and size ─► run SCENE --cameras cameras.json --frame N ─► the same figure
//! ```
//! Frame 0 of each file is the scene's own camera, because default lights follow it.
//!
//! Law (tests/search.rs): `each_claimed_figure_is_shown_again_by_the_command_that_is_printed`.

use super::Domain;
use crate::error::Result;
use crate::output::files::write_beside;
use crate::scene::Camera;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// A stated figure.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Claim {
    /// The figure with its unit.
    pub figure: String,
    /// View that decides it.
    pub view: String,
    /// Scene and size, in the order of the command line.
    pub scene: usize,
    /// File of cameras in the folder of the search.
    pub cameras: String,
    /// The camera's frame in that file.
    pub frame: usize,
}

/// A view and its camera.
pub(super) struct Decided<'a> {
    pub name: &'a str,
    /// Index of the domain.
    pub of: usize,
    pub camera: &'a Camera,
}

/// Name of the camera file of a domain.
fn file(of: usize, domains: usize) -> String {
    if domains == 1 {
        "cameras.json".into()
    } else {
        format!("cameras-{}.json", of + 1)
    }
}

/// Index of the domain whose view has this name.
pub(super) fn domain_of(domains: &[Domain], name: &str) -> usize {
    let is_of = |domain: &Domain| {
        name.strip_prefix(&domain.label)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(" from "))
    };
    domains.iter().position(is_of).unwrap_or(0)
}

/// Claims for some deciding views: a figure and the index of its view.
pub(super) fn claims(
    domains: &[Domain],
    decided: &[Decided<'_>],
    figures: Vec<(String, usize)>,
) -> Vec<Claim> {
    let claim = |(figure, nth): (String, usize)| {
        let Decided { name, of, .. } = decided[nth];
        let frame = 1 + decided[..nth].iter().filter(|other| other.of == of).count();
        Claim {
            figure,
            view: name.to_owned(),
            scene: of,
            cameras: file(of, domains.len()),
            frame,
        }
    };
    figures.into_iter().map(claim).collect()
}

/// Writes the cameras of every domain, its own first.
///
/// # Errors
/// [`crate::error::Error::Job`] if a file cannot be written.
pub(super) fn write_cameras(
    folder: &Path,
    domains: &[Domain],
    decided: &[Decided<'_>],
) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for (of, domain) in domains.iter().enumerate() {
        let own = json!({"name": domain.label, "camera": domain.scene().camera});
        let others = decided
            .iter()
            .filter(|decided| decided.of == of)
            .map(|decided| json!({"name": decided.name, "camera": decided.camera}));
        let all: Vec<_> = std::iter::once(own).chain(others).collect();
        let path = folder.join(file(of, domains.len()));
        let value = json!({"splatsim_cameras": all});
        write_beside(&path, |file| {
            serde_json::to_writer_pretty(file, &value).map_err(|e| e.to_string())
        })?;
        files.push(path);
    }
    Ok(files)
}
