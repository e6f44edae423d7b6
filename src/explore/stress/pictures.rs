//! Pictures: draws the catalogue as a grid of charts, and as a gallery.

use super::{
    CASES, Case, CaseReport, Catalogue, Exhibit, Failure, MachineReport, Point, PointFindings,
    SHARE_FAILS, short, surface_names,
};
use crate::error::Result;
use crate::output::chart::{Axis, Chart, Mark, Panel, PictureTile, Series, TextLines, write_png};
use crate::output::picture::Picture;
use rtl_model::Machine;
use std::path::Path;

/// Columns of the chart's grid and size of a cell.
const CHART_COLUMNS: usize = 4;
const CHART_CELL_PX: [u32; 2] = [470, 320];
/// The gallery: two exhibits per row.
const GALLERY_COLUMNS: usize = 2;
const GALLERY_CELL_PX: [u32; 2] = [152, 170];
/// Characters per line in a cell of the gallery.
const GALLERY_CHARS: usize = 22;
/// Lower limit of drawn errors; smaller ones are not visible in a picture.
const FLOOR: f64 = 1e-6;
/// Position of bounds above 1.
const CEILING: f64 = 2.0;
/// Gain of error pictures.
const ENLARGED: f64 = 16.0;
/// Colour indices: the method, and machines in their order.
const METHOD: usize = 6;
const MACHINES: [usize; 6] = [0, 2, 1, 5, 3, 4];

fn colour(machine: usize) -> usize {
    MACHINES[machine % MACHINES.len()]
}

/// Position of a value: 0 is one decade below the least other value of a logarithmic axis.
fn place(case: &Case, value: f64) -> f64 {
    if !case.log || value > 0.0 {
        return value;
    }
    case.values
        .iter()
        .copied()
        .filter(|value| *value > 0.0)
        .fold(f64::INFINITY, f64::min)
        / 10.0
}

/// One panel per case, and one that explains them.
pub fn write_chart(catalogue: &Catalogue, path: &Path) -> Result<()> {
    let key = key();
    let panels: Vec<Panel> = catalogue.cases.iter().map(panel).collect();
    let drawings: Vec<&dyn Chart> = std::iter::once(&key as &dyn Chart)
        .chain(panels.iter().map(|panel| panel as &dyn Chart))
        .collect();
    write_png(&drawings, CHART_COLUMNS, CHART_CELL_PX, path)
}

fn key() -> TextLines {
    let mut lines = vec![
        (
            Some((Mark::Line, METHOD)),
            "golden − ideal: the method's error".to_owned(),
        ),
        (
            Some((Mark::Dashed, METHOD)),
            "that of window, which has another rule".to_owned(),
        ),
    ];
    let names = surface_names().chain(["the case's own variant of reference"]);
    lines.extend(names.enumerate().map(|(i, name)| {
        (
            Some((Mark::Line, colour(i))),
            format!("fixed − led on {name}"),
        )
    }));
    lines.push((
        None,
        "(of ellipsoids: volume or gaussian as reference,".into(),
    ));
    lines.push((None, "its variant as lean)".into()));
    let rest = [
        (
            Some((Mark::Dashed, colour(0))),
            "its bound; at the top if above 1",
        ),
        (
            Some((Mark::Dots, colour(0))),
            "fixed − golden: with flipped decisions",
        ),
        (
            None,
            "all: the greatest of a picture, linear light in [0, 1];",
        ),
        (None, "values below 1e-6 are drawn at 1e-6"),
        (None, "upright: first value at which the method fails"),
        (
            None,
            "(over 8/255), or a machine's arithmetic: by its error, by",
        ),
        (
            None,
            "its bound (over 1 on more than 1 % of the pixels), or",
        ),
        (None, "by refusing the scene"),
    ];
    lines.extend(
        rest.into_iter()
            .map(|(sample, line)| (sample, line.to_owned())),
    );
    TextLines {
        title: "How to read this".into(),
        lines,
    }
}

fn panel(report: &CaseReport) -> Panel {
    // Every report belongs to a case of the table.
    let case = CASES
        .iter()
        .find(|case| case.name == report.name)
        .unwrap_or(&CASES[0]);
    let unit = if case.unit.is_empty() {
        String::new()
    } else {
        format!(", {}", case.unit)
    };
    let with_zero = if case.log && case.values.contains(&0.0) {
        " (0 at the left end)"
    } else {
        ""
    };
    let label = format!("{}{unit}{with_zero}", case.parameter);
    let mut series = Vec::new();
    let mut limits = Vec::new();
    for (i, machine) in report.machines.iter().enumerate() {
        let line = |mark, colour, of: &dyn Fn(&Point) -> Option<f64>| {
            let mut points: Vec<[f64; 2]> = machine
                .points
                .iter()
                .filter_map(|point| Some([place(case, point.value), of(point)?.max(FLOOR)]))
                .collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            Series {
                name: String::new(),
                points,
                mark,
                colour,
            }
        };
        // Machines with the same rules have the same error of method.
        if i == 0 || Machine::WINDOW_NAMES.contains(&machine.machine.as_str()) {
            series.push(line(
                if i == 0 { Mark::Line } else { Mark::Dashed },
                METHOD,
                &|point| Some(point.found()?.golden_vs_ideal.max_error),
            ));
            let whose = if i == 0 {
                "method".to_owned()
            } else {
                format!("{}'s method", machine.machine)
            };
            limits.extend(
                machine
                    .method_fails_at
                    .map(|value| (place(case, value), whose, METHOD)),
            );
        }
        series.push(line(Mark::Dots, colour(i), &|point| {
            Some(point.found()?.fixed_vs_golden.max_error)
        }));
        series.push(line(Mark::Dashed, colour(i), &|point| {
            Some(drawn_bound(point.found()?))
        }));
        series.push(line(Mark::Line, colour(i), &|point| {
            Some(point.found()?.lockstep.max_error)
        }));
        limits.extend(limit(case, machine, colour(i)));
    }
    let (x, y) = (
        if case.log {
            Axis::log(&label)
        } else {
            Axis::linear(&label)
        },
        Axis::log("error").within(FLOOR / 2.0, 1.2 * CEILING),
    );
    Panel {
        title: report.name.into(),
        x,
        y,
        series,
        limits: joined(limits),
        ..Panel::default()
    }
}

/// The bound if it is at most 1, else the top of the chart.
fn drawn_bound(found: &PointFindings) -> f64 {
    let bound = &found.lockstep;
    if bound.share_over_1 > SHARE_FAILS {
        CEILING
    } else {
        bound.max_bound.unwrap_or(0.0)
    }
}

fn limit(case: &Case, machine: &MachineReport, colour: usize) -> Option<(f64, String, usize)> {
    let how = match machine.arithmetic_fails_by? {
        Failure::Error => "error",
        Failure::Bound => "bound",
        Failure::Refused => "refuses",
    };
    Some((
        place(case, machine.arithmetic_fails_at?),
        format!("{}: {how}", machine.machine),
        colour,
    ))
}

/// Limits at the same value share a line and a label.
fn joined(limits: Vec<(f64, String, usize)>) -> Vec<(f64, String, usize)> {
    let mut joined: Vec<(f64, String, usize)> = Vec::new();
    for (at, word, colour) in limits {
        match joined.iter_mut().find(|(other, ..)| *other == at) {
            Some((_, words, _)) => *words += &format!("; {word}"),
            None => joined.push((at, word, colour)),
        }
    }
    joined
}

/// One row per exhibit: description, ideal, golden, fixed, error.
pub fn write_gallery(exhibits: &[Exhibit], path: &Path) -> Result<()> {
    let rows: Vec<(TextLines, [PictureTile; 4])> = exhibits
        .iter()
        .map(|exhibit| (words(exhibit), tiles(exhibit)))
        .collect();
    let mut drawings: Vec<&dyn Chart> = Vec::new();
    for (words, tiles) in &rows {
        drawings.push(words);
        drawings.extend(tiles.iter().map(|tile| tile as &dyn Chart));
    }
    write_png(
        &drawings,
        5 * GALLERY_COLUMNS.min(rows.len().max(1)),
        GALLERY_CELL_PX,
        path,
    )
}

fn words(exhibit: &Exhibit) -> TextLines {
    let case = exhibit.case;
    let value = format!("{} {} {}", case.parameter, short(exhibit.value), case.unit);
    TextLines {
        title: case.name.into(),
        lines: broken(value.trim())
            .into_iter()
            .map(|line| (None, line))
            .collect(),
    }
}

fn tiles(exhibit: &Exhibit) -> [PictureTile; 4] {
    let pictures = &exhibit.pictures;
    let error = error(&pictures.fixed, &pictures.golden);
    let tile = |caption: &str, picture: &Picture| PictureTile {
        caption: caption.into(),
        picture: picture.clone(),
    };
    [
        tile("ideal", &pictures.ideal),
        tile("golden", &pictures.golden),
        tile(&format!("fixed: {}", exhibit.machine), &pictures.fixed),
        tile(&format!("error × {ENLARGED}"), &error),
    ]
}

fn error(fixed: &Picture, golden: &Picture) -> Picture {
    let pixel = |(a, b): (&[f64; 4], &[f64; 4])| {
        [0, 1, 2, 3]
            .map(|i| (ENLARGED * (a[i].clamp(0.0, 1.0) - b[i].clamp(0.0, 1.0)).abs()).min(1.0))
    };
    Picture {
        rgba: fixed.rgba.iter().zip(&golden.rgba).map(pixel).collect(),
        ..fixed.clone()
    }
}

/// Breaks a text into lines that fit a cell of the gallery.
fn broken(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= GALLERY_CHARS => {
                *line += &format!(" {word}")
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
