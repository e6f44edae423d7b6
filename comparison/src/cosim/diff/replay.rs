//! Replay: composes the command that produces a record of a trace again.

use super::{SPLAT, X, Y, part};
use crate::output::text::quoted_for_shell;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// Units whose records depend on all splats of a pixel.
const OF_PIXELS: [&str; 3] = ["fragment", "shade", "resolve"];

/// A command that traces the unit's record with this key again, and as few others as possible.
pub fn command(folder: &Path, manifest: &Value, unit: &str, key: &[i64]) -> String {
    let (scene, window) = (&manifest["scene"], &manifest["window"]);
    let path = |file: &str| quoted_for_shell(&folder.join(file).to_string_lossy());
    let name = match (scene["complete"].as_bool(), scene["source"].as_str()) {
        (Some(true), _) => path("scene.json"),
        (_, Some(source)) => quoted_for_shell(source),
        _ => quoted_for_shell(scene["name"].as_str().unwrap_or_default()),
    };
    let mut command = format!(
        "splatsim trace {name} --size {}x{} --machine {}",
        scene["width"],
        scene["height"],
        path("machine.json")
    );
    if let (Some(frame), None | Some(false)) = (
        scene["frame"].as_u64().filter(|frame| *frame > 0),
        scene["complete"].as_bool(),
    ) {
        let _ = write!(command, " --frame {frame}");
    }
    if let Some(cases) = window["stimulus"].as_u64() {
        // Random cases depend on the units and on their order.
        let units: Vec<&str> = window["units"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        return command
            + &format!(
                " --units {} --stimulus {cases} --seed {} --out replay",
                units.join(","),
                window["seed"]
            );
    }
    let _ = write!(command, " --units {unit}");
    let (splat, pixel) = (part(key, SPLAT), part(key, X).zip(part(key, Y)));
    let whole = [0, scene["splats"].as_u64().unwrap_or(0)];
    let splats = [0, 1].map(|end: usize| window["splats"][end].as_u64().unwrap_or(whole[end]));
    // A part of a frame has no records of the whole pipeline.
    if unit != "pipeline" {
        match splat {
            // The output of sort for one splat depends on the others.
            Some(splat) if !OF_PIXELS.contains(&unit) && unit != "sort" => {
                let _ = write!(command, " --splats {splat}..{}", splat + 1);
            }
            _ if splats != whole => {
                let _ = write!(command, " --splats {}..{}", splats[0], splats[1]);
            }
            _ => {}
        }
        if let (Some((x, y)), true) = (pixel, unit != "raster") {
            let _ = write!(command, " --pixels {x},{y},{x},{y}");
        }
    }
    command + " --out replay"
}
