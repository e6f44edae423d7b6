//! RTL: writes the units that are graphs as SystemVerilog, for one machine and one scene.

use super::{TraceWriter, headers};
use crate::error::Result;
use crate::hardware::fixed;
use crate::hardware::quantise::quantise;
use crate::input;
use crate::output::files;
use crate::output::text::{aligned, plain_table, thousands};
use crate::scene::{Overrides, Scene};
use rtl_model::Machine;
use rtl_model::pipeline::rtl::{self, Listing};
use std::path::Path;

/// A small scene of the kind that a machine is made for.
///
/// # Errors
/// [`crate::error::Error::Input`] as [`Scene::load`].
pub fn usual_scene(machine: &Machine) -> Result<Scene> {
    let text = match (&machine.ellipse.ellipsoid, &machine.sort) {
        (None, _) => r#"{"splats": {"builtin": "torus-knot", "count": 1000}}"#.to_owned(),
        (Some(_), None) => r#"{"splats": {"volume": {"builtin": "nested-shells", "samples": 12},
            "transfer": [{"value": 0, "rgb": [0, 0, 0], "opacity": 0}, {"value": 1, "rgb": [1, 1, 1], "opacity": 0.5}]}}"#
            .to_owned(),
        (Some(_), Some(_)) => format!(
            r#"{{"splats": {{"gaussians": "bouquet", "count": 1000, "degree": {}}}}}"#,
            machine.colour.map_or(0, |colour| colour.degree)
        ),
    };
    Scene::from_text(&text, "scene", Path::new("."), &Overrides::default(), 0)
}

const PACKAGE: &str = "machine_pkg.sv";

/// Removes units that were written for another machine or scene.
fn remove_others(folder: &Path, is_written: impl Fn(&str) -> bool) -> Result<()> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for name in names.filter_map(|entry| entry.file_name().into_string().ok()) {
        let path = folder.join(&name);
        let is_unit = name.ends_with(".sv")
            && !is_written(&name)
            && input::read_text(&path).is_ok_and(|text| {
                let head = text.lines().next().unwrap_or_default();
                head.contains("Written by splatsim") && head.contains("for the machine")
            });
        if is_unit {
            files::remove_if_there(&path)?;
        }
    }
    Ok(())
}

/// Writes the units, the package `machine_pkg`, the modules that they use, and the tables; returns
/// a table of the files.
///
/// # Errors
/// [`crate::error::Error::Input`] if the machine is not possible or cannot draw the scene,
/// [`crate::error::Error::Job`] if a file cannot be written.
pub fn write(scene: &Scene, machine: &Machine, folder: &Path) -> Result<String> {
    let elaborated = fixed::elaborate(machine)?;
    let frame = quantise(scene, machine)?.frame;
    let _open = files::Folder::open(folder)?;
    let writer = TraceWriter {
        folder,
        machine: &elaborated,
        frame: &frame,
    };
    let roms = writer.roms()?;
    let package = Listing {
        name: PACKAGE.into(),
        text: headers::package(&elaborated, &frame),
    };
    let (units, library) = (rtl::files(&elaborated, &frame), rtl::library());
    let written = |name: &str| {
        let mut all = units.iter().chain(&library);
        name == PACKAGE || all.any(|listing| listing.name == name)
    };
    remove_others(folder, written)?;
    let mut table = plain_table(&["file", "lines", ""]);
    let lists = [
        (vec![package], "formats and records"),
        (units, "of this machine"),
        (library, "used by units"),
    ];
    for (list, meaning) in &lists {
        for Listing { name, text } in list {
            writer.text(name, text)?;
            let lines = thousands(text.lines().count() as u64);
            table.add_row([name.clone(), lines, (*meaning).to_owned()]);
        }
    }
    let rows = roms
        .iter()
        .filter_map(|rom| Some((rom["file"].as_str()?, rom["records"].as_u64()?)));
    for (file, records) in rows {
        table.add_row([file.to_owned(), thousands(records), "table".to_owned()]);
    }
    Ok(aligned(table).trim_fmt())
}
