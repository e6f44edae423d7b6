//! Charts: draws the rows of a folder as pictures, and writes them on one page.
//!
//! ```text
//! points.jsonl, plan.json ─► [figures for which the rows have data] ─┬─► NAME.png, NAME.svg
//!                                                                    └─► charts.html, with the table
//! ```
//! A figure is drawn if its numbers vary, and left out otherwise. All except `host-speed` are the
//! same on every computer.
//!
//! Laws (tests/chart.rs): `the_front_of_a_folder_is_named`, `figures_are_of_what_varies`.

use super::columns::{self, ACCOUNTS, UNITS};
use super::page;
use super::table::{Row, Table};
use crate::error::{Error, Result};
use crate::explore::pareto;
use crate::hardware::machines;
use crate::input;
use crate::output::chart;
use crate::output::chart::{Axis, Bars, Chart, Mark, Panel, Series, Shape};
use crate::output::files::write_beside;
use crate::output::text::{aligned, plain, plain_table, thousands, wrapped};
use rtl_model::Machine;
use rtl_model::num::Format;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A drawing with its name and caption.
pub struct ChartFigure {
    /// Stem of its files.
    pub name: &'static str,
    /// Title on the page.
    pub title: String,
    /// Caption: how to read the figure.
    pub caption: String,
    charts: Vec<Box<dyn Chart>>,
    columns: usize,
    cell_px: [u32; 2],
}

/// Changes of some rows, each with the number of rows that have it.
struct Shared<'a> {
    counts: BTreeMap<(&'a str, &'a str), usize>,
    rows: usize,
}

impl Shared<'_> {
    /// Whether there are several rows, and all of them have the change.
    fn is_common(&self, change: (&str, &str)) -> bool {
        self.rows > 1 && self.counts.get(&change) == Some(&self.rows)
    }
}

/// Rows of a folder, and their base machine.
pub struct Rows {
    table: Table,
    base: Machine,
    /// The base machine's fields.
    fields: serde_json::Value,
    /// The base machine's words.
    words: BTreeMap<String, Format>,
    /// Of a search.
    search: Option<SearchTarget>,
}

/// Charts of a folder of rows.
pub struct Charts {
    /// Files that were written.
    pub files: Vec<PathBuf>,
    fronts: String,
}

/// Most labels per front.
const NAMES: usize = 10;
/// Most characters of such a label, of one in a table, of the count of omitted changes, of one in a
/// legend, and of a scene's name.
const LETTERS: usize = 44;
const TABLE_LETTERS: usize = 140;
const MORE_LETTERS: usize = 9;
const LEGEND_LETTERS: usize = 28;
const SCENE_LETTERS: usize = 36;
/// Least number of values for which a word has its own curve.
const CURVE: usize = 5;
/// Most bars of a field, and panels of a figure.
const MOST_BARS: usize = 40;
const MOST_PANELS: usize = 24;

/// Columns that accuracy is plotted against, with their labels.
const AREA: [&str; 2] = [columns::AREA, "area, thousand LUT equivalents"];
const SPEED: [&str; 2] = [columns::FRAMES_PER_SECOND, "frames/s of the machine"];

/// A measure of error.
struct Measure {
    column: &'static str,
    /// Label of an axis.
    label: &'static str,
    /// Title of a panel.
    title: &'static str,
    /// Part of a caption.
    caption: &'static str,
}

/// The total error first, then its components.
const MEASURES: [Measure; 3] = [
    Measure {
        column: columns::FIXED_VS_IDEAL_PSNR_DB,
        label: "fixed − ideal, dB",
        title: "the whole error",
        caption: "is the whole error, over all pixels: arithmetic and method",
    },
    Measure {
        column: columns::PSNR_DB,
        label: "fixed − golden, dB",
        title: "the error of arithmetic",
        caption: "is the error of the arithmetic, which depends on words",
    },
    METHOD,
];
const METHOD: Measure = Measure {
    column: columns::GOLDEN_VS_IDEAL_PSNR_DB,
    label: "golden − ideal, dB",
    title: "the error of method",
    caption: "is the error of the method, which depends on layers and rules",
};

/// Target and result of a search.
struct SearchTarget {
    psnr_db: Option<f64>,
    /// Column of the target.
    column: &'static str,
    /// Area, PSNR and greatest error, fixed − golden, of the result; None before the end of the
    /// search.
    found: [Option<f64>; 3],
}

impl SearchTarget {
    /// Reads the target and result in a folder.
    fn read(folder: &Path, target: &serde_json::Value) -> Self {
        let text = input::read_text(&folder.join("search.json")).unwrap_or_default();
        let search: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let last = search["path"].as_array().and_then(|path| path.last());
        let found =
            ["area", "psnr_db", "max_error"].map(|name| last.and_then(|last| last[name].as_f64()));
        let column = match (target["metric"].as_str(), target["against"].as_str()) {
            (Some("lockstep"), _) => columns::LOCKSTEP_PSNR_DB,
            (_, Some("ideal")) => columns::FIXED_VS_IDEAL_PSNR_DB,
            _ => columns::PSNR_DB,
        };
        SearchTarget {
            psnr_db: target["psnr_db"].as_f64(),
            column,
            found,
        }
    }
}

/// Draws all figures of a folder into it.
///
/// # Errors
/// [`Error::Input`] if it has no rows, none was drawn or they were changed, [`Error::Job`] if a file cannot be
/// written.
pub fn write(folder: &Path) -> Result<Charts> {
    let rows = Rows::read(folder)?;
    if !rows.table.has_drawn() {
        let only_samples = "of every machine only a sample of the tiles was drawn";
        let reason = rows.table.first_misfit().unwrap_or(only_samples);
        return Err(Error::input(format!(
            "{}: no row was drawn: {reason}",
            folder.display()
        )));
    }
    let figures = rows.figures();
    let mut files = Vec::new();
    let mut drawn = Vec::new();
    for figure in &figures {
        let charts: Vec<&dyn Chart> = figure.charts.iter().map(|chart| &**chart).collect();
        let [png, svg] =
            ["png", "svg"].map(|extension| folder.join(figure.name).with_extension(extension));
        chart::write_png(&charts, figure.columns, figure.cell_px, &png)?;
        let text = chart::svg(&charts, figure.columns, figure.cell_px)?;
        write_beside(&svg, |file| {
            file.write_all(text.as_bytes()).map_err(|e| e.to_string())
        })?;
        drawn.push((figure, text));
        files.extend([png, svg]);
    }
    let page = page::html(&rows.table, &rows.base.name, &drawn);
    let path = folder.join("charts.html");
    write_beside(&path, |file| {
        file.write_all(page.as_bytes()).map_err(|e| e.to_string())
    })?;
    files.push(path);
    Ok(Charts {
        files,
        fronts: rows.fronts(),
    })
}

impl Charts {
    /// The machines that no other one beats; at most 80 columns wide.
    pub fn summary(&self) -> &str {
        &self.fronts
    }
}

impl Rows {
    /// Reads a folder: the rows of machines that could be built, and `plan.json`.
    ///
    /// # Errors
    /// [`Error::Input`] if a file is missing or was changed.
    pub fn read(folder: &Path) -> Result<Self> {
        let table = Table::read(folder)?;
        let path = folder.join("plan.json");
        let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
        let text =
            input::read_text(&path).map_err(|e| input_error(format!("cannot be read: {e}")))?;
        let plan: serde_json::Value =
            serde_json::from_str(&text).map_err(|e| input_error(format!("not JSON: {e}")))?;
        let base = machines::from_value(
            plan.get("machine").unwrap_or(&serde_json::Value::Null),
            &format!("{}: machine", path.display()),
        )?;
        let words = machines::words(&base).into_iter().collect();
        let search = plan
            .get("search")
            .map(|target| SearchTarget::read(folder, target));
        Ok(Rows {
            table,
            fields: machines::value(&base),
            base,
            words,
            search,
        })
    }

    fn number(&self, row: &Row, name: &str) -> Option<f64> {
        self.table.number(row, name)
    }

    fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = Vec::new();
        for row in &self.table.rows {
            let scene = self.table.text(row, columns::SCENE);
            if !scenes.contains(&scene) {
                scenes.push(scene);
            }
        }
        scenes.truncate(MOST_PANELS);
        scenes
    }

    /// The rows of a scene whose machines could be built.
    fn of<'a>(&'a self, scene: &'a str) -> impl Iterator<Item = &'a Row> {
        let table = &self.table;
        table
            .rows
            .iter()
            .filter(move |row| table.text(row, columns::SCENE) == scene && table.is_drawn(row))
    }

    /// Changed fields and values of a row, without those equal to the base.
    fn changes<'a>(&self, row: &'a Row) -> Vec<(&'a str, &'a str)> {
        let at = self.table.at(columns::CHANGES);
        let text = at.and_then(|at| row[at].as_str()).unwrap_or_default();
        let is_change = |(field, value): &(&str, &str)| {
            if *field == "exact" {
                return *value != "[]";
            }
            let base = self.fields.pointer(&machines::pointer(field));
            base.is_none_or(|base| plain(base) != *value)
        };
        text.split(' ')
            .filter_map(|change| change.split_once('='))
            .filter(is_change)
            .collect()
    }

    /// Additional integer and fraction bits of a word by a change.
    fn more_bits(&self, field: &str, value: &str) -> Option<[i32; 2]> {
        let (base, format) = (self.words.get(field)?, value.parse::<Format>().ok()?);
        Some([
            format.int_bits - base.int_bits,
            format.frac_bits - base.frac_bits,
        ])
    }

    /// A change in short form: additional bits of a word, or the value of another field.
    fn change(&self, (field, value): (&str, &str)) -> String {
        let bits = |bits: i32, of: &str| {
            if bits == 0 {
                String::new()
            } else {
                format!(" {}{of}", signed(bits))
            }
        };
        match self.more_bits(field, value) {
            Some([int, frac]) if [int, frac] != [0, 0] => {
                format!("{field}{}{}", bits(int, " int"), bits(frac, ""))
            }
            _ => format!("{} {value}", short(field)),
        }
    }

    /// Number of these rows that have each change.
    fn shared<'a>(&self, rows: &[&'a Row]) -> Shared<'a> {
        let mut counts = BTreeMap::new();
        for change in rows.iter().flat_map(|row| self.changes(row)) {
            *counts.entry(change).or_default() += 1;
        }
        Shared {
            counts,
            rows: rows.len(),
        }
    }

    /// A machine's name: its changes without those that all rows share, the rarest first, in at
    /// most `letters` characters.
    fn name(&self, row: &Row, shared: &Shared, letters: usize) -> String {
        let changes = self.changes(row);
        let mut own: Vec<(&str, &str)> = changes
            .iter()
            .copied()
            .filter(|change| !shared.is_common(*change))
            .collect();
        own.sort_by_key(|change| shared.counts.get(change).copied().unwrap_or(0));
        match (&changes[..], &own[..]) {
            ([], _) => self.base.name.clone(),
            (_, []) => "no more".into(),
            _ => self.change_list(&own, letters),
        }
    }

    /// As many changes as fit in `letters` characters, at least one, and the number of the others.
    fn change_list(&self, changes: &[(&str, &str)], letters: usize) -> String {
        let mut change_list = String::new();
        for (nth, change) in changes.iter().enumerate() {
            let (change, left) = (self.change(*change), changes.len() - nth);
            let room = if left > 1 { MORE_LETTERS } else { 0 };
            if nth > 0 && change_list.chars().count() + change.chars().count() + 2 + room > letters
            {
                return format!("{change_list}, {left} more");
            }
            change_list = if nth == 0 {
                change
            } else {
                format!("{change_list}, {change}")
            };
        }
        change_list
    }

    fn figures(&self) -> Vec<ChartFigure> {
        let found = [
            self.accuracy(
                "accuracy-area",
                AREA,
                1.0,
                "What accuracy costs. Better is up and to the left.",
            ),
            self.accuracy(
                "accuracy-speed",
                SPEED,
                -1.0,
                "Accuracy against speed of the simulated machine. Better is up and to the right.",
            ),
            self.speed_area(),
            self.sensitivity(),
            self.curves(),
            self.flicker(),
            self.layers(),
            self.clock(),
            self.cycles(),
            self.host_speed(),
        ];
        found.into_iter().flatten().collect()
    }

    /// Two numbers of a row, as cost and worth.
    fn pair(&self, row: &Row, [x, y]: [&str; 2]) -> Option<[f64; 2]> {
        Some([self.number(row, x)?, self.number(row, y)?])
    }

    /// Points of a scene, and which of them are on the front.
    fn front<'a>(
        &'a self,
        scene: &'a str,
        names: [&str; 2],
        signs: [f64; 2],
    ) -> (Vec<(&'a Row, [f64; 2])>, Vec<usize>) {
        let points: Vec<(&Row, [f64; 2])> = self
            .of(scene)
            .filter_map(|row| Some((row, self.pair(row, names)?)))
            .collect();
        let costs: Vec<[f64; 2]> = points
            .iter()
            .map(|(_, [x, y])| [x * signs[0], y * signs[1]])
            .collect();
        let front = pareto::front(&costs);
        (points, front)
    }

    /// Accuracy against a cost: the total error, and its components next to it.
    fn accuracy(
        &self,
        name: &'static str,
        [x, x_label]: [&str; 2],
        sign: f64,
        caption: &str,
    ) -> Option<ChartFigure> {
        let all_scenes = self.scenes();
        let varies_in = |scene: &str, column: &str| {
            varies(
                self.of(scene)
                    .filter_map(|row| self.pair(row, [x, column]))
                    .map(|pair| pair[1]),
            )
        };
        let varies_by = |scene: &str, column: &str| {
            varies(
                self.of(scene)
                    .filter_map(|row| self.pair(row, [x, column]))
                    .map(|pair| pair[0]),
            )
        };
        let is_shown = |scene: &str, measure: &Measure| {
            varies_in(scene, measure.column) && varies_by(scene, measure.column)
        };
        let measures: Vec<&Measure> = MEASURES
            .iter()
            .filter(|measure| all_scenes.iter().any(|scene| is_shown(scene, measure)))
            .collect();
        let scenes = all_scenes
            .iter()
            .filter(|scene| measures.iter().any(|measure| is_shown(scene, measure)));
        let panel = |(scene, measure): (&str, &Measure)| {
            let mut panel = self.scatter(
                scene,
                [x, x_label, measure.column, measure.label],
                [sign, 1.0],
            );
            panel.title = format!("{}: {}", cut(scene), measure.title);
            let ends = |y: f64| {
                let (low, high) = extent(panel.series[0].points.iter().map(|point| point[0]));
                vec![[low, y], [high, y]]
            };
            let mut lines = Vec::new();
            if measure.column == columns::FIXED_VS_IDEAL_PSNR_DB
                && !measures.iter().any(|other| other.column == METHOD.column)
            {
                // One limit for all machines: words can hardly exceed it.
                let method = self
                    .of(scene)
                    .find_map(|row| self.number(row, METHOD.column));
                lines.extend(method.map(|db| (format!("golden − ideal, {db:.1} dB"), ends(db), 6)));
            }
            if let Some(SearchTarget {
                psnr_db: Some(db),
                column,
                ..
            }) = &self.search
                && *column == measure.column
            {
                lines.push((format!("target, {db} dB"), ends(*db), 4));
            }
            let line = |(name, points, colour)| Series {
                name,
                points,
                mark: Mark::Dashed,
                colour,
            };
            panel.series.extend(lines.into_iter().map(line));
            Box::new(panel) as Box<dyn Chart>
        };
        let charts: Vec<Box<dyn Chart>> = scenes
            .flat_map(|scene| measures.iter().map(|measure| (*scene, *measure)))
            .map(panel)
            .collect();
        let parts: Vec<String> = measures
            .iter()
            .map(|measure| format!("{}, {}", measure.label, measure.caption))
            .collect();
        let caption = format!(
            "{caption} Each dot is a machine; those with a ring are beaten by none, all others cost more, are worse, or both; names leave out what all with a ring have. {}.",
            parts.join("; ")
        );
        let title = format!(
            "Accuracy against {}",
            x_label.split(',').next().unwrap_or_default()
        );
        figure(name, title, &caption, charts, [760, 520]).map(|figure| ChartFigure {
            columns: measures.len(),
            ..figure
        })
    }

    fn speed_area(&self) -> Option<ChartFigure> {
        let [x, x_label] = AREA;
        let [y, y_label] = SPEED;
        let does_vary = |scene: &&&str| {
            let pairs: Vec<[f64; 2]> = self
                .of(scene)
                .filter_map(|row| self.pair(row, [x, y]))
                .collect();
            (0..2).all(|axis| varies(pairs.iter().map(|pair| pair[axis])))
        };
        let panel = |scene: &&str| {
            Box::new(self.scatter(scene, [x, x_label, y, y_label], [1.0, 1.0])) as Box<dyn Chart>
        };
        let charts: Vec<Box<dyn Chart>> =
            self.scenes().iter().filter(does_vary).map(panel).collect();
        let caption = "What speed costs. Better is up and to the left.";
        figure(
            "speed-area",
            "Frames/s of the machine against area".into(),
            caption,
            charts,
            [760, 520],
        )
    }

    /// Two figures of every machine on a scene, with the front; for a search also its start and
    /// result.
    fn scatter(&self, scene: &str, [x, x_label, y, y_label]: [&str; 4], signs: [f64; 2]) -> Panel {
        let (points, front) = self.front(scene, [x, y], signs);
        let unit = |name: &str| if name == columns::AREA { 1e-3 } else { 1.0 };
        let places: Vec<[f64; 2]> = points
            .iter()
            .map(|(_, place)| [place[0] * unit(x), place[1] * unit(y)])
            .collect();
        let ring = |i: &usize| places[*i];
        let named = spread(&front.iter().map(ring).collect::<Vec<_>>(), NAMES);
        let shared = self.shared(&front.iter().map(|i| points[*i].0).collect::<Vec<_>>());
        let mut notes: Vec<([f64; 2], String)> = named
            .iter()
            .map(|nth| {
                (
                    places[front[*nth]],
                    self.name(points[front[*nth]].0, &shared, LETTERS),
                )
            })
            .collect();
        // Equal machines share one label.
        notes.dedup_by(|a, b| a.0 == b.0);
        let base = points
            .iter()
            .position(|(row, _)| self.changes(row).is_empty());
        if let Some(base) =
            base.filter(|base| !notes.iter().any(|(other, _)| *other == places[*base]))
        {
            notes.push((places[base], self.base.name.clone()));
        }
        let series = |name: &str, points: Vec<[f64; 2]>, mark, colour| Series {
            name: name.into(),
            points,
            mark,
            colour,
        };
        let mut all = vec![
            series("machines", places.clone(), Mark::Dots, 0),
            series(
                &format!("none is better{}", self.all_with(&shared, LEGEND_LETTERS)),
                front.iter().map(ring).collect(),
                Mark::Rings,
                1,
            ),
        ];
        if let Some(search) = &self.search {
            let found = points
                .iter()
                .position(|(row, _)| self.is_found(row, search));
            all.extend(base.map(|base| series("start", vec![places[base]], Mark::Crosses, 2)));
            all.extend(found.map(|found| series("found", vec![places[found]], Mark::Triangles, 3)));
        }
        Panel {
            title: cut(scene),
            x: Axis::linear(x_label),
            y: Axis::linear(y_label),
            series: all,
            notes,
            ..Panel::default()
        }
    }

    /// The changes that all machines of a front share, as the end of a sentence.
    fn all_with(&self, shared: &Shared, letters: usize) -> String {
        let common: Vec<(&str, &str)> = shared
            .counts
            .keys()
            .copied()
            .filter(|change| shared.is_common(*change))
            .collect();
        if common.is_empty() {
            String::new()
        } else {
            format!("; all with {}", self.change_list(&common, letters))
        }
    }

    /// Whether a row is of the resulting machine of a search.
    fn is_found(&self, row: &Row, search: &SearchTarget) -> bool {
        let [area, psnr_db, max_error] = search.found;
        let names = [columns::AREA, columns::PSNR_DB, columns::MAX_ERROR];
        area.is_some() && names.map(|name| self.number(row, name)) == [area, psnr_db, max_error]
    }

    /// Rows of a scene that change only one word: field, additional bits, row; the base machine
    /// without field.
    fn one_word<'a>(&'a self, scene: &'a str) -> Vec<(&'a str, [i32; 2], &'a Row)> {
        let one = |row: &'a Row| {
            let changes = self.changes(row);
            match changes[..] {
                [] => Some(("", [0, 0], row)),
                [(field, value)] => Some((field, self.more_bits(field, value)?, row)),
                _ => None,
            }
        };
        self.of(scene).filter_map(one).collect()
    }

    /// Words with a few values: PSNR by bits.
    fn sensitivity(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        let mut height = 0;
        for scene in self.scenes() {
            let all = self.one_word(scene);
            let Some((_, _, base)) = all.iter().find(|(field, ..)| field.is_empty()) else {
                continue;
            };
            let mut by_word: BTreeMap<&str, BTreeMap<i32, &Row>> = BTreeMap::new();
            let mut steps: Vec<i32> = Vec::new();
            for (field, [int, frac], row) in all.iter().filter(|(field, ..)| !field.is_empty()) {
                if *int == 0 && *frac != 0 {
                    by_word.entry(field).or_default().insert(*frac, row);
                    steps.push(*frac);
                }
            }
            steps.sort_unstable();
            steps.dedup();
            if by_word.len() < CURVE || steps.len() > 6 {
                continue;
            }
            let db = |row: &Row, column: &str| self.number(row, column).unwrap_or(f64::NAN);
            let mut words: Vec<(&str, BTreeMap<i32, &Row>)> = by_word.into_iter().collect();
            let least = |rows: &BTreeMap<i32, &Row>| {
                rows.values()
                    .map(|row| db(row, columns::PSNR_DB))
                    .fold(f64::INFINITY, f64::min)
            };
            words.sort_by(|a, b| least(&a.1).total_cmp(&least(&b.1)));
            let legend: Vec<String> = steps
                .iter()
                .map(|bits| format!("{} bits", signed(*bits)))
                .chain(["as it is".to_owned()])
                .collect();
            let mut dots = |column: &str, title: &str| {
                let value = |rows: &BTreeMap<i32, &Row>, bits: &i32| {
                    rows.get(bits).map_or(f64::NAN, |row| db(row, column))
                };
                let row = |(word, rows): &(&str, BTreeMap<i32, &Row>)| {
                    let values: Vec<f64> = steps
                        .iter()
                        .map(|bits| value(rows, bits))
                        .chain([db(base, column)])
                        .collect();
                    ((*word).to_owned(), values)
                };
                let rows: Vec<(String, Vec<f64>)> = words.iter().map(row).collect();
                if rows
                    .iter()
                    .any(|(_, values)| values.iter().any(|value| value.is_finite()))
                {
                    let title = format!("{scene}: {title}");
                    charts.push(Box::new(Bars {
                        shape: Shape::Dots,
                        title,
                        axis: Axis::linear("dB"),
                        legend: legend.clone(),
                        rows,
                    }));
                }
            };
            dots(columns::PSNR_DB, "PSNR, fixed − golden");
            dots(columns::LOCKSTEP_PSNR_DB, "in lockstep, without flips");
            if let [coarse, fine, ..] = steps[..]
                && fine < 0
            {
                let slope = |column: &str, rows: &BTreeMap<i32, &Row>| {
                    let at = |bits: i32| rows.get(&bits).map_or(f64::NAN, |row| db(row, column));
                    (at(fine) - at(coarse)) / f64::from(fine - coarse)
                };
                let both = [columns::PSNR_DB, columns::LOCKSTEP_PSNR_DB];
                let row = |(word, rows): &(&str, BTreeMap<i32, &Row>)| {
                    let slopes: Vec<f64> = both
                        .iter()
                        .map(|column| slope(column, rows))
                        .filter(|slope| slope.is_finite())
                        .collect();
                    ((*word).to_owned(), slopes)
                };
                let rows: Vec<(String, Vec<f64>)> = words.iter().map(row).collect();
                let many = rows
                    .iter()
                    .map(|(_, slopes)| slopes.len())
                    .max()
                    .unwrap_or(0);
                let legend = ["with flips".to_owned(), "in lockstep".to_owned()][..many].to_vec();
                let title = format!(
                    "{scene}: dB per bit, from {} to {} bits",
                    signed(coarse),
                    signed(fine)
                );
                charts.push(Box::new(Bars {
                    shape: Shape::Bars,
                    title,
                    axis: Axis::linear("dB per bit"),
                    legend,
                    rows,
                }));
            }
            height = height.max(150 + 15 * words.len() as u32);
        }
        let caption = "PSNR by the fraction bits of one word, all others unchanged; the most sensitive on top. If the rounding of this word dominates, a bit is worth 6 dB; if the rounding of another word or flipped decisions dominate, it is worth nothing.";
        figure(
            "sensitivity",
            "PSNR by fraction bits, word by word".into(),
            caption,
            charts,
            [640, height],
        )
        .map(|figure| ChartFigure {
            columns: 3,
            ..figure
        })
    }

    /// Words with many values: one curve each.
    fn curves(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        for scene in self.scenes() {
            let all = self.one_word(scene);
            let fields: BTreeSet<&str> = all
                .iter()
                .map(|(field, ..)| *field)
                .filter(|field| !field.is_empty())
                .collect();
            for (field, part) in fields.iter().flat_map(|field| [(*field, 0), (*field, 1)]) {
                let is_of = |(other, more, _): &&(&str, [i32; 2], &Row)| {
                    (*other == field && more[part] != 0 && more[1 - part] == 0) || other.is_empty()
                };
                let mut rows: Vec<(f64, &Row)> = all
                    .iter()
                    .filter(is_of)
                    .map(|(_, more, row)| (f64::from(more[part]), *row))
                    .collect();
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
                if rows.len() > CURVE && charts.len() < MOST_PANELS {
                    let of = ["integer", "fraction"][part];
                    let x = format!("{of} bits more than {} has", self.base.name);
                    charts.push(Box::new(self.curve(
                        &rows,
                        format!("{scene}: {field}"),
                        &x,
                        part == 1,
                    )));
                }
            }
        }
        let caption = "One word made narrower and wider. On the slope its rounding dominates: 6 dB per bit, as the dashed line. On the plateau another word or flipped decisions dominate; it is higher in lockstep, which has no flips. Beyond the cliff the range of the word is too small.";
        figure(
            "curves",
            "PSNR by bits of one word".into(),
            caption,
            charts,
            [600, 420],
        )
    }

    fn curve(&self, rows: &[(f64, &Row)], title: String, x: &str, has_slope: bool) -> Panel {
        let series = |name: &str, column: &str, mark, colour| {
            let points: Vec<[f64; 2]> = rows
                .iter()
                .filter_map(|(bits, row)| Some([*bits, self.number(row, column)?]))
                .collect();
            Series {
                name: name.into(),
                points,
                mark,
                colour,
            }
        };
        let both = [
            series("fixed − golden", columns::PSNR_DB, Mark::Rings, 0),
            series(
                "in lockstep, no flips",
                columns::LOCKSTEP_PSNR_DB,
                Mark::Rings,
                2,
            ),
        ];
        let mut all: Vec<Series> = both
            .into_iter()
            .filter(|series| !series.points.is_empty())
            .collect();
        let places = || {
            all.iter()
                .flat_map(|series| series.points.iter().map(|point| point[1]))
        };
        let (least, most) = (
            places().fold(f64::INFINITY, f64::min),
            places().fold(f64::NEG_INFINITY, f64::max),
        );
        // Through the middle of the slope, if there is one.
        let steepest = all.last().filter(|_| has_slope).and_then(|series| {
            series
                .points
                .windows(2)
                .filter(|pair| pair[1][1] - pair[0][1] > 4.0 * (pair[1][0] - pair[0][0]))
                .nth(1)
                .map(|pair| pair[0])
        });
        if let Some([x0, y0]) = steepest {
            const DB_A_BIT: f64 = 6.0206;
            let end = |y: f64| [x0 + (y - y0) / DB_A_BIT, y];
            let (first, last) = (
                rows.first().map_or(x0, |row| row.0),
                rows.last().map_or(x0, |row| row.0),
            );
            let at = |x: f64| [x, y0 + (x - x0) * DB_A_BIT];
            let low = if at(first)[1] < least {
                end(least)
            } else {
                at(first)
            };
            let high = if at(last)[1] > most {
                end(most)
            } else {
                at(last)
            };
            all.push(Series {
                name: "6 dB per bit".into(),
                points: vec![low, high],
                mark: Mark::Dashed,
                colour: 6,
            });
        }
        Panel {
            title,
            x: Axis::linear(x),
            y: Axis::linear("PSNR, dB"),
            series: all,
            ..Panel::default()
        }
    }

    /// Words with several values: share of still pixels that jump, by bits and by PSNR.
    fn flicker(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        for scene in self.scenes() {
            let all = self.one_word(scene);
            let fields: BTreeSet<&str> = all
                .iter()
                .map(|(field, ..)| *field)
                .filter(|field| !field.is_empty())
                .collect();
            let mut by_bits: Vec<Series> = Vec::new();
            let mut by_db: Vec<Series> = Vec::new();
            for field in fields {
                let mut rows: Vec<(i32, &Row)> = (all.iter())
                    .filter(|(other, [int, _], _)| {
                        (*other == field || other.is_empty()) && *int == 0
                    })
                    .map(|(_, [_, frac], row)| (*frac, *row))
                    .collect();
                rows.sort_by_key(|(bits, _)| *bits);
                // A logarithmic axis has no 0.
                let percent = |row: &Row| {
                    self.number(row, columns::FLICKER_JUMPS)
                        .map(|jumps| 100.0 * jumps)
                        .filter(|jumps| *jumps > 0.0)
                };
                let series = |points: Vec<[f64; 2]>, colour: usize| Series {
                    name: field.to_owned(),
                    points,
                    mark: Mark::Rings,
                    colour,
                };
                let bits: Vec<[f64; 2]> = rows
                    .iter()
                    .filter_map(|(bits, row)| Some([f64::from(*bits), percent(row)?]))
                    .collect();
                if bits.len() < 3 {
                    continue;
                }
                by_bits.push(series(bits, by_bits.len()));
                let place = |(_, row): &(i32, &Row)| {
                    Some([self.number(row, columns::PSNR_DB)?, percent(row)?])
                };
                by_db.push(series(rows.iter().filter_map(place).collect(), by_db.len()));
            }
            let y = || Axis::log("still pixels that jump, %");
            let of_bits = format!("fraction bits more than {} has", self.base.name);
            for (series, what, x) in [
                (by_bits, "by bits", of_bits.as_str()),
                (by_db, "by decibels", "fixed − golden, dB, first frame"),
            ] {
                if !series.is_empty() {
                    let title = format!("{}: jumps {what}", cut(scene));
                    charts.push(Box::new(Panel {
                        title,
                        x: Axis::linear(x),
                        y: y(),
                        series,
                        ..Panel::default()
                    }));
                }
            }
        }
        let caption = "How many of the pixels that should not change from frame to frame change by more than 4/255, fixed − golden. Words of equal PSNR may flicker differently: a rounding of the position moves a splat in one frame, a rounding of its weight is the same in all frames.";
        figure(
            "flicker",
            "Flicker by bits of one word".into(),
            caption,
            charts,
            [600, 420],
        )
    }

    /// Layers and merge rules: the error of the method, and merges.
    fn layers(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        for scene in self.scenes() {
            let mut by_rule: BTreeMap<String, BTreeMap<u64, &Row>> = BTreeMap::new();
            for row in self.of(scene) {
                let Ok(machine) = self.machine(row) else {
                    continue;
                };
                let fragment = &machine.fragment;
                let rule = serde_json::to_value(fragment.merge)
                    .ok()
                    .and_then(|rule| rule.as_str().map(str::to_owned))
                    .unwrap_or_default();
                let evicts = if fragment.evict_hidden {
                    ""
                } else {
                    ", hidden ones kept"
                };
                by_rule
                    .entry(format!("{rule}{evicts}"))
                    .or_default()
                    .entry(u64::from(fragment.layers))
                    .or_insert(row);
            }
            if by_rule.values().all(|rows| rows.len() < 2) {
                continue;
            }
            let panel = |title: &str, column: &str, y: Axis| {
                let scale = if column == columns::MERGED { 1e-3 } else { 1.0 };
                let series =
                    |(colour, (rule, rows)): (usize, (&String, &BTreeMap<u64, &Row>))| Series {
                        name: rule.clone(),
                        points: rows
                            .iter()
                            .filter_map(|(layers, row)| {
                                Some([*layers as f64, self.number(row, column)? * scale])
                            })
                            .collect(),
                        mark: Mark::Rings,
                        colour,
                    };
                let series = by_rule.iter().enumerate().map(series).collect();
                Panel {
                    title: format!("{scene}: {title}"),
                    x: Axis::linear("layers: fragments per pixel"),
                    y,
                    series,
                    ..Panel::default()
                }
            };
            charts.push(Box::new(panel(
                "the method's error",
                columns::GOLDEN_VS_IDEAL_PSNR_DB,
                Axis::linear("PSNR, golden − ideal, dB"),
            )));
            charts.push(Box::new(panel(
                "merges",
                columns::MERGED,
                Axis::linear("merged contributions, thousands"),
            )));
        }
        let caption = "Gain of another layer, or of another merge rule: words cannot make the picture better than this.";
        figure(
            "layers",
            "Layers and rules for merging".into(),
            caption,
            charts,
            [600, 420],
        )
    }

    /// Clocks: gates of the smallest machine of each, its latency and frames per second.
    fn clock(&self) -> Option<ChartFigure> {
        const FIELD: &str = "timing.clock_hz";
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        for scene in self.scenes() {
            // Only the number of stages is changed.
            let is_of = |field: &str| {
                field == FIELD || field.starts_with("timing.") && field.ends_with(".latency")
            };
            let mut smallest: Vec<(f64, f64, &Row)> = Vec::new();
            for row in self
                .of(scene)
                .filter(|row| self.changes(row).iter().all(|(field, _)| is_of(field)))
            {
                let clock = self.table.shown(row, FIELD).parse::<f64>().ok();
                let Some((clock, gates)) = clock.zip(self.number(row, columns::GATES)) else {
                    continue;
                };
                match smallest.iter_mut().find(|(other, ..)| *other == clock) {
                    Some(least) if gates < least.1 => *least = (clock, gates, row),
                    Some(_) => {}
                    None => smallest.push((clock, gates, row)),
                }
            }
            smallest.sort_by(|a, b| a.0.total_cmp(&b.0));
            if smallest.len() < CURVE {
                continue;
            }
            let figures = [
                (columns::GATES, 1e-3, "gates, thousand NAND2"),
                (columns::LATENCY_NS, 1.0, "latency of all units, ns"),
                (columns::FRAMES_PER_SECOND, 1.0, SPEED[1]),
            ];
            for (column, scale, label) in figures {
                let points = (smallest.iter())
                    .filter_map(|(clock, _, row)| {
                        Some([clock / 1e6, self.number(row, column)? * scale])
                    })
                    .collect();
                let series = vec![Series {
                    name: "fewest gates".into(),
                    points,
                    mark: Mark::Rings,
                    colour: 0,
                }];
                let title = format!(
                    "{}: {}",
                    cut(scene),
                    label.split(',').next().unwrap_or_default()
                );
                charts.push(Box::new(Panel {
                    title,
                    x: Axis::linear("clock, MHz"),
                    y: Axis::linear(label),
                    series,
                    ..Panel::default()
                }));
            }
        }
        let caption = "Cost and gain of a faster clock: at each clock the machine with the fewest gates that differs only in clock and latencies. Up to the knee another stage costs little and gains much. Beyond it the pipeline registers grow, and their delay in each cycle cancels the gain.";
        figure(
            "clock",
            "Gates and latency by clock".into(),
            caption,
            charts,
            [600, 420],
        )
    }

    fn machine(&self, row: &Row) -> Result<Machine> {
        let value = |text: &str| serde_json::from_str(text).unwrap_or_else(|_| text.into());
        let changes: Vec<(String, serde_json::Value)> = (self.changes(row).into_iter())
            .filter(|(field, _)| field.starts_with("fragment."))
            .map(|(field, text)| (field.to_owned(), value(text)))
            .collect();
        machines::with(&self.base, &changes, "")
    }

    /// Every field of the timing: cycles, and the state of each unit in them.
    fn cycles(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        let mut most = 0;
        for scene in self.scenes() {
            let mut fields: Vec<&str> = Vec::new();
            for (field, _) in self.of(scene).flat_map(|row| self.changes(row)) {
                if field.starts_with("timing.") && !fields.contains(&field) {
                    fields.push(field);
                }
            }
            let mut values: Vec<(String, f64, &Row)> = Vec::new();
            for field in fields {
                // The fewest cycles of each value.
                let mut best: Vec<(String, f64, &Row)> = Vec::new();
                for row in self.of(scene) {
                    let Some(cycles) = self.number(row, columns::CYCLES) else {
                        continue;
                    };
                    let value = self.table.shown(row, field);
                    match best.iter_mut().find(|(other, ..)| *other == value) {
                        Some((_, least, best_row)) if cycles < *least => {
                            (*least, *best_row) = (cycles, row)
                        }
                        Some(_) => {}
                        None => best.push((value, cycles, row)),
                    }
                }
                if best.len() > 1 {
                    values.extend(best.into_iter().map(|(value, cycles, row)| {
                        let point = self.table.shown(row, columns::POINT);
                        (
                            format!("{} {value}, point {point}", short(field)),
                            cycles,
                            row,
                        )
                    }));
                }
            }
            values.truncate(MOST_BARS);
            if values.is_empty() {
                continue;
            }
            most = most.max(values.len());
            for unit in UNITS {
                let counts = |row: &Row| {
                    ACCOUNTS.map(|account| {
                        self.number(row, &columns::account(unit, account))
                            .unwrap_or(0.0)
                    })
                };
                if values
                    .iter()
                    .all(|(_, _, row)| counts(row).iter().sum::<f64>() == 0.0)
                {
                    continue;
                }
                let row = |(value, cycles, row): &(String, f64, &Row)| {
                    let counts = counts(row);
                    // Of several parallel units, the average of one.
                    let all: f64 = counts.iter().sum();
                    let limits = if self.table.text(row, columns::BOTTLENECK) == unit {
                        " (limits)"
                    } else {
                        ""
                    };
                    (
                        format!("{value}{limits}"),
                        counts
                            .map(|count| count / all.max(1.0) * cycles / 1e6)
                            .to_vec(),
                    )
                };
                charts.push(Box::new(Bars {
                    shape: Shape::Stack,
                    title: format!("{}: {unit}", cut(scene)),
                    axis: Axis::linear("million cycles of the frame"),
                    legend: ACCOUNTS.map(str::to_owned).to_vec(),
                    rows: values.iter().map(row).collect(),
                }));
            }
        }
        let caption = "One panel per unit: its states in the cycles of a frame. Each bar is the fastest machine with one value of a field, and the table has its other values under the number of its point; its parts are work (busy), no input (starved), no room at the output or a hazard of its own (blocked), and stalls for memory. The unit that limits a frame is marked.";
        figure(
            "cycles",
            "Cycles and stalls by microarchitecture".into(),
            caption,
            charts,
            [640, 150 + 22 * most as u32],
        )
    }

    /// Speed of the three renderers on this computer, and their errors.
    fn host_speed(&self) -> Option<ChartFigure> {
        let mut charts: Vec<Box<dyn Chart>> = Vec::new();
        for scene in self.scenes() {
            let points = |seconds: &str, column: &str| {
                let point =
                    |row: &Row| Some([1.0 / self.number(row, seconds)?, self.number(row, column)?]);
                self.of(scene).filter_map(point).collect::<Vec<[f64; 2]>>()
            };
            let [fixed, mut golden] = [
                points(columns::HOST_FIXED_SECONDS, columns::FIXED_VS_IDEAL_PSNR_DB),
                points(
                    columns::HOST_GOLDEN_SECONDS,
                    columns::GOLDEN_VS_IDEAL_PSNR_DB,
                ),
            ];
            golden.dedup();
            let ideal = self
                .of(scene)
                .find_map(|row| self.number(row, columns::HOST_IDEAL_SECONDS));
            let Some(ideal) = ideal.filter(|_| !fixed.is_empty() && !golden.is_empty()) else {
                continue;
            };
            // Ideal has no error: it is drawn above all others.
            let top = fixed
                .iter()
                .chain(&golden)
                .map(|point| point[1])
                .fold(0.0, f64::max)
                + 5.0;
            let series = |name: &str, points, mark, colour| Series {
                name: name.into(),
                points,
                mark,
                colour,
            };
            let notes = vec![([1.0 / ideal, top], "ideal: exact".to_owned())];
            let most = fixed
                .iter()
                .chain(&golden)
                .map(|point| point[0])
                .fold(1.0 / ideal, f64::max);
            charts.push(Box::new(Panel {
                title: scene.to_owned(),
                x: Axis::linear("frames/s of the simulator").within(0.0, 1.1 * most),
                y: Axis::linear("PSNR against ideal, dB"),
                series: vec![
                    series("fixed", fixed, Mark::Dots, 0),
                    series("golden", golden, Mark::Dots, 1),
                    series("ideal", vec![[1.0 / ideal, top]], Mark::Dots, 2),
                ],
                notes,
                ..Panel::default()
            }));
        }
        let caption = "How many frames a second each renderer draws on the computer that made the rows, and how close it comes to the ideal picture. Times differ from run to run.";
        figure(
            "host-speed",
            "Accuracy against speed of the simulator".into(),
            caption,
            charts,
            [640, 420],
        )
    }

    /// Every front, scene by scene, as tables; of equal machines only one.
    fn fronts(&self) -> String {
        let mut texts = Vec::new();
        for scene in self.scenes() {
            let does_vary = |names: [&str; 2]| {
                let pairs: Vec<[f64; 2]> = self
                    .of(scene)
                    .filter_map(|row| self.pair(row, names))
                    .collect();
                (0..2).all(|axis| varies(pairs.iter().map(|pair| pair[axis])))
            };
            // The total error, if it was measured and varies, else that of the arithmetic.
            let of_error = |cost: &'static str| {
                MEASURES
                    .iter()
                    .take(2)
                    .map(|measure| [cost, measure.column])
                    .find(|names| does_vary(*names))
            };
            let [area, speed] = [columns::AREA, columns::FRAMES_PER_SECOND];
            let kinds = [
                (of_error(area), [1.0, 1.0]),
                (of_error(speed), [-1.0, 1.0]),
                (Some([area, speed]), [1.0, 1.0]),
            ];
            for (names, signs) in kinds {
                let Some(names) = names.filter(|names| does_vary(*names)) else {
                    continue;
                };
                texts.push(self.front_table(scene, names, signs));
            }
        }
        texts.join("\n\n")
    }

    fn front_table(&self, scene: &str, names: [&'static str; 2], signs: [f64; 2]) -> String {
        let (points, front) = self.front(scene, names, signs);
        let places: Vec<[f64; 2]> = front.iter().map(|i| points[*i].1).collect();
        let mut distinct: Vec<usize> = (0..places.len()).collect();
        distinct.dedup_by(|a, b| places[*a] == places[*b]);
        let is_timed = points
            .iter()
            .any(|(row, _)| self.number(row, columns::FRAMES_PER_SECOND).is_some());
        let mut table = plain_table(&[
            "point",
            "area",
            "fixed − ideal dB",
            "fixed − golden dB",
            if is_timed { "frames/s" } else { "" },
        ]);
        let line: Vec<[f64; 2]> = distinct.iter().map(|nth| places[*nth]).collect();
        let rows: Vec<&Row> = spread(&line, 2 * NAMES)
            .into_iter()
            .map(|nth| points[front[distinct[nth]]].0)
            .collect();
        for row in &rows {
            let number = |name: &str, digits: usize| {
                self.number(row, name)
                    .map_or(String::new(), |value| format!("{value:.digits$}"))
            };
            table.add_row([
                number(columns::POINT, 0),
                thousands(self.number(row, columns::AREA).unwrap_or(0.0) as u64),
                number(columns::FIXED_VS_IDEAL_PSNR_DB, 1),
                number(columns::PSNR_DB, 1),
                number(columns::FRAMES_PER_SECOND, 1),
            ]);
        }
        let table = aligned(table).trim_fmt();
        let mut lines = table.lines();
        let mut text = lines.next().unwrap_or_default().to_owned();
        let shared = self.shared(&front.iter().map(|i| points[*i].0).collect::<Vec<_>>());
        for (line, row) in lines.zip(&rows) {
            let _ = write!(
                text,
                "\n{line}\n{}",
                wrapped(&format!("    {}", self.name(row, &shared, TABLE_LETTERS)))
            );
        }
        let change_list = |name: &str| {
            let error = MEASURES
                .iter()
                .find(|measure| measure.column == name)
                .map(|measure| measure.label);
            error.unwrap_or(if name == columns::AREA {
                "area"
            } else {
                "frames/s"
            })
        };
        let ties = if distinct.len() < front.len() {
            format!(", {} with their equals", front.len())
        } else {
            String::new()
        };
        let head = format!(
            "{}: of {} machines {} beaten by none in {} and {}{ties}{}",
            cut(scene),
            thousands(points.len() as u64),
            if distinct.len() == 1 {
                "1 is".into()
            } else {
                format!("{} are", distinct.len())
            },
            change_list(names[0]),
            change_list(names[1]),
            self.all_with(&shared, TABLE_LETTERS)
        );
        format!("{}\n{text}", wrapped(&head))
    }
}

fn figure(
    name: &'static str,
    title: String,
    caption: &str,
    mut charts: Vec<Box<dyn Chart>>,
    cell_px: [u32; 2],
) -> Option<ChartFigure> {
    charts.truncate(MOST_PANELS);
    let columns = if charts.len() > 1 { 2 } else { 1 };
    (!charts.is_empty()).then(|| ChartFigure {
        name,
        title,
        caption: caption.into(),
        charts,
        columns,
        cell_px,
    })
}

/// Points of a line to label, at most `most`: the ends, and others evenly spaced along it.
fn spread(line: &[[f64; 2]], most: usize) -> Vec<usize> {
    if line.len() <= most {
        return (0..line.len()).collect();
    }
    let range = |axis: usize| {
        let (low, high) = line
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
                (low.min(place[axis]), high.max(place[axis]))
            });
        (high - low).max(f64::MIN_POSITIVE)
    };
    let [width, height] = [range(0), range(1)];
    let mut along = vec![0.0];
    for pair in line.windows(2) {
        let step =
            ((pair[1][0] - pair[0][0]) / width).abs() + ((pair[1][1] - pair[0][1]) / height).abs();
        along.push(along[along.len() - 1] + step);
    }
    let whole = along[along.len() - 1];
    let mut named: Vec<usize> = Vec::new();
    for (i, at) in along.iter().enumerate() {
        // The next due label is at this point or before it.
        if named.len() < most && *at >= whole * named.len() as f64 / (most - 1) as f64 - 1e-12 {
            named.push(i);
        }
    }
    let last = line.len() - 1;
    if named.last() != Some(&last) {
        named.pop();
        named.push(last);
    }
    named
}

/// Least and greatest value.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

fn varies(values: impl Iterator<Item = f64>) -> bool {
    let (low, high) = extent(values);
    low < high
}

/// A scene's name, shortened for a title; those of a search contain the view.
fn cut(scene: &str) -> String {
    let first: String = scene.chars().take(SCENE_LETTERS).collect();
    if first.len() < scene.len() {
        format!("{first}…")
    } else {
        first
    }
}

/// With a sign, and a true minus.
fn signed(bits: i32) -> String {
    if bits < 0 {
        format!("−{}", -bits)
    } else {
        format!("+{bits}")
    }
}

/// The last two parts of a path.
fn short(field: &str) -> &str {
    field
        .rmatch_indices('.')
        .nth(1)
        .map_or(field, |(at, _)| &field[at + 1..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_spread_along_a_line_with_its_ends() {
        let crowd = |nth: usize| [nth as f64 * 1e-4, 0.0];
        let line: Vec<[f64; 2]> = (0..100)
            .map(crowd)
            .chain([[1.0, 1.0], [2.0, 1.0], [3.0, 5.0]])
            .collect();
        assert_eq!(spread(&line, 4), [0, 101, 102], "the crowd has one name");
        assert_eq!(spread(&line[..4], 4), [0, 1, 2, 3]);
        let even: Vec<[f64; 2]> = (0..=90).map(|nth| [f64::from(nth), 0.0]).collect();
        assert_eq!(
            spread(&even, 10),
            (0..10).map(|nth| 10 * nth).collect::<Vec<_>>()
        );
        assert_eq!(spread(&[[1.0, 1.0]; 9], 3), [0, 1, 8]);
    }
}
