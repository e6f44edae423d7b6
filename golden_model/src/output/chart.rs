//! Chart: curves, points and bars as PNG, drawn the same on every computer (the font comes along),
//! or as SVG.
//!
//! ```text
//! numbers ─► [panel: axes, series, marks, notes] ─┬─► one of them, or a grid ─┬─► PNG
//!            [bars: names, values] ───────────────┤                           └─► SVG
//!            [extents: formats, words] ───────────┘
//! ```

mod extents;
mod tiles;

pub use extents::{Extent, Extents};
pub use tiles::{PictureTile, TextLines};

use crate::error::{Error, Result};
use crate::output::files::write_beside;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;
use std::path::Path;
use std::sync::Once;

/// Colours that colour-blind readers can distinguish (Okabe and Ito, 2008), the first for the most
/// important series.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// One axis.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// Label, with the unit.
    pub label: String,
    /// Logarithmic scale.
    pub log: bool,
    /// Least and greatest value; by default those of the data.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Axis {
            label: label.into(),
            ..Axis::default()
        }
    }

    /// A logarithmic axis; values that are not positive are not drawn.
    pub fn log(label: &str) -> Self {
        Axis {
            label: label.into(),
            log: true,
            range: None,
        }
    }

    /// The axis with this range.
    pub fn within(self, low: f64, high: f64) -> Self {
        Axis {
            range: Some([low, high]),
            ..self
        }
    }

    /// Position of a value on the axis; none if it cannot be shown.
    fn place(&self, value: f64) -> Option<f64> {
        let place = if self.log { libm::log10(value) } else { value };
        place.is_finite().then_some(place)
    }

    fn written(&self, place: f64) -> String {
        let value = if self.log {
            libm::pow(10.0, place)
        } else {
            place
        };
        let magnitude = value.abs();
        if value == 0.0 {
            "0".into()
        } else if (0.01..10_000.0).contains(&magnitude) {
            let text = format!("{value:.3}");
            text.trim_end_matches('0').trim_end_matches('.').into()
        } else {
            let text = format!("{value:.1e}");
            text.replace(".0e", "e")
        }
    }

    /// Text of a mark of the axis, with enough digits to distinguish marks. Between powers of ten
    /// it is empty if at least two powers are marked.
    fn mark(&self, place: f64, span: &Range<f64>) -> String {
        let between = (place - place.round()).abs() > 1e-6;
        let decades = span.end.floor() - span.start.ceil();
        if self.log && between && decades >= 1.0 {
            return String::new();
        }
        // Least distance of marks.
        let step = (span.end - span.start) / 20.0;
        let drawing_error = self.written(place);
        let most = span.start.abs().max(span.end.abs());
        let is_exact = (drawing_error.parse::<f64>().unwrap_or(place) - place).abs() < 0.1 * step;
        if self.log || is_exact && !PLAIN.contains(&most) {
            return drawing_error;
        }
        let digits = (-libm::log10(step)).ceil().max(0.0) as usize;
        let text = format!("{place:.digits$}");
        if digits == 0 {
            text
        } else {
            text.trim_end_matches('0').trim_end_matches('.').into()
        }
    }

    /// The range that contains all of these values, with a margin.
    fn span(&self, values: impl Iterator<Item = f64>) -> Range<f64> {
        if let Some([low, high]) = self.range {
            return self.place(low).unwrap_or(0.0)..self.place(high).unwrap_or(1.0);
        }
        let places = values.filter_map(|value| self.place(value));
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        if low > high {
            return 0.0..1.0;
        }
        let margin = if high > low { 0.04 * (high - low) } else { 0.5 };
        // Values that differ only in their last digits are one value at the resolution of an axis.
        let least = LEAST_SPAN * low.abs().max(high.abs()) - (high - low);
        let margin = margin.max(least / 2.0);
        low - margin..high + margin
    }
}

/// The shortest axis, relative to its values: six digits distinguish its marks.
const LEAST_SPAN: f64 = 2e-4;

/// Greatest values of an axis whose marks need no powers of ten.
const PLAIN: Range<f64> = 1e-3..1e7;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line from point to point.
    Line,
    /// A dashed line.
    Dashed,
    /// A dot at each point.
    Dots,
    /// A line with a ring at each point.
    Rings,
    /// A cross at each point.
    Crosses,
    /// A triangle at each point.
    Triangles,
}

/// One series of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend; not listed if empty.
    pub name: String,
    /// Points that are drawn.
    pub points: Vec<[f64; 2]>,
    /// Mark.
    pub mark: Mark,
    /// Index of its colour.
    pub colour: usize,
}

/// One set of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Title above the panel.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Series that it shows.
    pub series: Vec<Series>,
    /// Vertical lines with a label, and the index of their colour.
    pub limits: Vec<(f64, String, usize)>,
    /// Labels of points; no label covers another.
    pub notes: Vec<([f64; 2], String)>,
}

/// Shape of a row's values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// One bar per value, one below the other.
    #[default]
    Bars,
    /// Bars in sequence, whose total length is their sum.
    Stack,
    /// One dot per value, on one line.
    Dots,
}

/// Numbers by name, row by row.
#[derive(Clone, Debug, Default)]
pub struct Bars {
    /// Shape that they are drawn in.
    pub shape: Shape,
    /// Title above the bars.
    pub title: String,
    /// Axis along the bars, with its unit.
    pub axis: Axis,
    /// Names of the bars of one row.
    pub legend: Vec<String>,
    /// A name and a value per bar.
    pub rows: Vec<(String, Vec<f64>)>,
}

/// A drawing that fits into a rectangle.
pub trait Draw {
    /// Draws.
    ///
    /// # Errors
    /// A sentence of the drawing library.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult;
}

/// A drawing for any backend.
pub trait Chart {
    /// Draws pixels.
    ///
    /// # Errors
    /// As [`Draw::draw`].
    fn draw_pixels(&self, area: &Area<BitMapBackend>) -> DrawResult;

    /// Draws shapes.
    ///
    /// # Errors
    /// As [`Draw::draw`].
    fn draw_shapes(&self, area: &Area<SVGBackend>) -> DrawResult;
}

impl<T: Draw> Chart for T {
    fn draw_pixels(&self, area: &Area<BitMapBackend>) -> DrawResult {
        self.draw(area)
    }

    fn draw_shapes(&self, area: &Area<SVGBackend>) -> DrawResult {
        self.draw(area)
    }
}

/// A rectangle for a drawing.
pub type Area<B> = DrawingArea<B, Shift>;

/// Nothing, or an error message of the drawing library.
type DrawResult = std::result::Result<(), String>;

fn drawing_error(error: impl std::fmt::Display) -> String {
    error.to_string()
}

const FONT: &str = "sans-serif";
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(225, 225, 225);

/// Heights of a caption and of a line of a legend above bars, pixels.
const CAPTION_PX: i32 = 38;
const LEGEND_PX: i32 = 22;
/// The square of a legend, the space next to it, and between its names, pixels.
const SWATCH_PX: i32 = 14;
const GAP_PX: i32 = 6;
const APART_PX: i32 = 22;

/// Distance of the label of a limit from its line, pixels: the text is vertical.
const BESIDE_PX: i32 = 15;

impl Draw for Panel {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let all = || self.series.iter().flat_map(|series| &series.points);
        let x = self.x.span(
            all()
                .map(|point| point[0])
                .chain(self.limits.iter().map(|limit| limit.0)),
        );
        let y = self.y.span(all().map(|point| point[1]));
        let (left, top) = (x.start, y.end - 0.02 * (y.end - y.start));
        let spans = (x.clone(), y.clone());
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 19).into_font().color(&INK))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)
            .map_err(drawing_error)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_labels(7)
            .y_labels(7)
            .x_label_formatter(&|place| self.x.mark(*place, &spans.0))
            .y_label_formatter(&|place| self.y.mark(*place, &spans.1))
            .label_style((FONT, 14).into_font().color(&INK))
            .light_line_style(TRANSPARENT)
            .bold_line_style(FAINT)
            .axis_style(INK)
            .draw()
            .map_err(drawing_error)?;
        for (at, word, colour) in &self.limits {
            let (Some(at), colour) = (self.x.place(*at), COLOURS[colour % COLOURS.len()]) else {
                continue;
            };
            let range = chart.y_range();
            let line = [(at, range.start), (at, range.end)];
            chart
                .draw_series(DashedLineSeries::new(line, 4, 4, colour.into()))
                .map_err(drawing_error)?;
            let style = (FONT, 13)
                .into_font()
                .transform(FontTransform::Rotate90)
                .color(&colour);
            // The text is next to its line, not on it.
            let words = EmptyElement::at((at.max(left), top))
                + Text::new(word.clone(), (BESIDE_PX, 0), style);
            chart.draw_series([words]).map_err(drawing_error)?;
        }
        for series in &self.series {
            let colour = COLOURS[series.colour % COLOURS.len()];
            let place = |point: &[f64; 2]| Some((self.x.place(point[0])?, self.y.place(point[1])?));
            let points: Vec<(f64, f64)> = series.points.iter().filter_map(place).collect();
            let drawn = match series.mark {
                Mark::Line => chart.draw_series(LineSeries::new(points, colour.stroke_width(2))),
                Mark::Dashed => {
                    chart.draw_series(DashedLineSeries::new(points, 7, 5, colour.stroke_width(2)))
                }
                Mark::Dots => chart.draw_series(
                    points
                        .into_iter()
                        .map(|point| Circle::new(point, 2, colour.filled())),
                ),
                Mark::Crosses => chart.draw_series(
                    points
                        .into_iter()
                        .map(|point| Cross::new(point, 7, colour.stroke_width(3))),
                ),
                Mark::Triangles => chart.draw_series(
                    points
                        .into_iter()
                        .map(|point| TriangleMarker::new(point, 9, colour.filled())),
                ),
                Mark::Rings => {
                    let rings = points
                        .iter()
                        .map(|point| Circle::new(*point, 5, colour.stroke_width(2)));
                    chart.draw_series(rings).map_err(drawing_error)?;
                    chart.draw_series(LineSeries::new(points, colour.stroke_width(1)))
                }
            };
            let drawn = drawn.map_err(drawing_error)?;
            if !series.name.is_empty() {
                match series.mark {
                    Mark::Crosses => drawn
                        .label(&series.name)
                        .legend(move |(x, y)| Cross::new((x + 9, y), 6, colour.stroke_width(3))),
                    Mark::Triangles => drawn
                        .label(&series.name)
                        .legend(move |(x, y)| TriangleMarker::new((x + 9, y), 7, colour.filled())),
                    Mark::Dots => drawn
                        .label(&series.name)
                        .legend(move |(x, y)| Circle::new((x + 9, y), 3, colour.filled())),
                    _ => drawn.label(&series.name).legend(move |(x, y)| {
                        PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(3))
                    }),
                };
            }
        }
        if self.series.iter().any(|series| !series.name.is_empty()) {
            chart
                .configure_series_labels()
                .position(self.emptiest_corner(&spans))
                .background_style(WHITE.mix(0.85))
                .border_style(FAINT)
                .label_font((FONT, 14).into_font().color(&INK))
                .draw()
                .map_err(drawing_error)?;
        }
        // Positions of labels are in pixels of the whole picture, those of drawing in pixels of the
        // area.
        let (columns, rows) = area.get_pixel_range();
        let points =
            all().filter_map(|point| Some((self.x.place(point[0])?, self.y.place(point[1])?)));
        let points: Vec<(i32, i32)> = points.map(|point| chart.backend_coord(&point)).collect();
        let notes = self
            .notes
            .iter()
            .filter_map(|([x, y], word)| Some(((self.x.place(*x)?, self.y.place(*y)?), word)));
        let plain = (FONT, 13).into_font().color(&INK);
        let mut taken: Vec<[i32; 4]> = points
            .iter()
            .map(|(x, y)| [x - 6, y - 6, x + 6, y + 6])
            .collect();
        for (place, word) in notes {
            let at = chart.backend_coord(&place);
            let (width, height) = area
                .estimate_text_size(word, &plain)
                .map_err(drawing_error)?;
            let (left, top) =
                free_place(at, [width as i32, height as i32], &taken, [&columns, &rows]);
            let (dx, dy) = area.get_base_pixel();
            let end = (
                if left > at.0 {
                    left - 2
                } else {
                    left + width as i32 + 2
                },
                top + height as i32 / 2,
            );
            if (end.1 - at.1).abs() > 6 {
                let leader = vec![(at.0 - dx, at.1 - dy), (end.0 - dx, end.1 - dy)];
                area.draw(&PathElement::new(leader, INK.mix(0.35)))
                    .map_err(drawing_error)?;
            }
            area.draw(&Text::new(
                word.clone(),
                (left - dx, top - dy),
                plain.clone(),
            ))
            .map_err(drawing_error)?;
            taken.push([left, top, left + width as i32, top + height as i32]);
        }
        Ok(())
    }
}

impl Panel {
    /// Corner in which a legend covers the fewest points.
    fn emptiest_corner(&self, (x, y): &(Range<f64>, Range<f64>)) -> SeriesLabelPosition {
        const NEAR: f64 = 0.35;
        let part = |axis: &Axis, span: &Range<f64>, value: f64| {
            Some((axis.place(value)? - span.start) / (span.end - span.start))
        };
        let place = |[a, b]: &[f64; 2]| Some((part(&self.x, x, *a)?, part(&self.y, y, *b)?));
        let mut places: Vec<(f64, f64)> = self
            .series
            .iter()
            .flat_map(|series| &series.points)
            .filter_map(place)
            .collect();
        // A line is covered along its whole length.
        for series in self
            .series
            .iter()
            .filter(|series| matches!(series.mark, Mark::Line | Mark::Dashed))
        {
            let ends: Vec<(f64, f64)> = series.points.iter().filter_map(place).collect();
            let between = |pair: &[(f64, f64)], part: f64| {
                (
                    pair[0].0 + part * (pair[1].0 - pair[0].0),
                    pair[0].1 + part * (pair[1].1 - pair[0].1),
                )
            };
            places.extend(
                ends.windows(2)
                    .flat_map(|pair| (1..16).map(|nth| between(pair, f64::from(nth) / 16.0))),
            );
        }
        let corners = [
            (SeriesLabelPosition::LowerRight, 1.0, 0.0),
            (SeriesLabelPosition::UpperRight, 1.0, 1.0),
            (SeriesLabelPosition::UpperLeft, 0.0, 1.0),
            (SeriesLabelPosition::LowerLeft, 0.0, 0.0),
        ];
        let near = |right: f64, top: f64| {
            places
                .iter()
                .filter(|(x, y)| (x - right).abs() < NEAR && (y - top).abs() < NEAR)
                .count()
        };
        let [first, ..] = &corners;
        let best = corners
            .iter()
            .min_by_key(|(_, right, top)| near(*right, *top))
            .unwrap_or(first);
        best.0.clone()
    }
}

/// Position for a label of this size next to a point: the nearest one that covers the least of the
/// drawing.
fn free_place(
    (x, y): (i32, i32),
    [width, height]: [i32; 2],
    taken: &[[i32; 4]],
    [columns, rows]: [&Range<i32>; 2],
) -> (i32, i32) {
    let middle = y - height / 2;
    let heights = (0..8).flat_map(|step| [-step * height, step * height]);
    let places = heights.flat_map(|dy| {
        [
            (x + 9 + dy.abs() / 4, middle + dy),
            (x - 9 - dy.abs() / 4 - width, middle + dy),
        ]
    });
    let inside = |(left, top): &(i32, i32)| {
        *left >= columns.start + 70
            && left + width < columns.end
            && *top >= rows.start + 38
            && top + height < rows.end - 50
    };
    let covered = |(left, top): &(i32, i32)| {
        let [right, bottom] = [left + width, top + height];
        let shared = |[l, t, r, b]: &[i32; 4]| {
            (right.min(*r) - left.max(l)).max(0) * (bottom.min(*b) - top.max(t)).max(0)
        };
        taken
            .iter()
            .map(|box_px| i64::from(shared(box_px)))
            .sum::<i64>()
    };
    places
        .filter(inside)
        .min_by_key(covered)
        .unwrap_or((x + 9, middle))
}

impl Draw for Bars {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let sum = |values: &[f64]| values.iter().sum::<f64>();
        let ends = |(_, values): &(String, Vec<f64>)| {
            if self.shape == Shape::Stack {
                vec![sum(values)]
            } else {
                values.clone()
            }
        };
        let values = self.rows.iter().flat_map(ends);
        let from_zero = !self.axis.log && self.shape != Shape::Dots;
        let mut span = self.axis.span(values.chain(from_zero.then_some(0.0)));
        if self.axis.log {
            span.start = span.start.floor();
        }
        let (start, whole) = (span.start, span.clone());
        // Bars of negative values extend to the left.
        let foot = if self.axis.log {
            start
        } else {
            0.0_f64.clamp(start, span.end)
        };
        let rows = self.rows.len() as f64;
        let area = &self.draw_head(area)?;
        let longest = self
            .rows
            .iter()
            .map(|(name, _)| name.chars().count())
            .max()
            .unwrap_or(0) as u32;
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .margin_top(2)
            .x_label_area_size(44)
            .y_label_area_size(30 + 8 * longest)
            .build_cartesian_2d(span, 0.0..rows.max(1.0))
            .map_err(drawing_error)?;
        chart
            .configure_mesh()
            .x_desc(&self.axis.label)
            .x_label_formatter(&|place| self.axis.mark(*place, &whole))
            .disable_y_mesh()
            .y_labels(0)
            .label_style((FONT, 14).into_font().color(&INK))
            .light_line_style(TRANSPARENT)
            .bold_line_style(FAINT)
            .axis_style(INK)
            .draw()
            .map_err(drawing_error)?;
        if self.shape == Shape::Dots {
            let line = |row: usize| {
                let middle = rows - row as f64 - 0.5;
                PathElement::new(vec![(start, middle), (whole.end, middle)], FAINT)
            };
            chart
                .draw_series((0..self.rows.len()).map(line))
                .map_err(drawing_error)?;
        }
        let many = self.legend.len().max(1);
        for bar in 0..many {
            let colour = COLOURS[bar % COLOURS.len()];
            let place = |row: usize, values: &[f64]| {
                let top = rows - row as f64 - 0.12;
                let value = *values.get(bar)?;
                Some(match self.shape {
                    Shape::Bars => {
                        let top = top - 0.76 * bar as f64 / many as f64;
                        [
                            (foot, top),
                            (self.axis.place(value)?.max(start), top - 0.76 / many as f64),
                        ]
                    }
                    Shape::Stack => {
                        let before = sum(&values[..bar]);
                        [
                            (self.axis.place(before)?, top),
                            (self.axis.place(before + value)?, top - 0.76),
                        ]
                    }
                    Shape::Dots => [(self.axis.place(value)?, top - 0.38); 2],
                })
            };
            let places: Vec<_> = (self.rows.iter().enumerate())
                .filter_map(|(row, (_, values))| place(row, values))
                .collect();
            let drawn = match self.shape {
                Shape::Dots => chart.draw_series(
                    places
                        .iter()
                        .map(|[at, _]| Circle::new(*at, 4, colour.filled())),
                ),
                _ => chart.draw_series(
                    places
                        .iter()
                        .map(|corners| Rectangle::new(*corners, colour.filled())),
                ),
            };
            drawn.map_err(drawing_error)?;
        }
        let style = (FONT, 14)
            .into_font()
            .color(&INK)
            .pos(Pos::new(HPos::Right, VPos::Center));
        for (row, (name, _)) in self.rows.iter().enumerate() {
            let (x, y) = chart.backend_coord(&(start, rows - row as f64 - 0.5));
            let (dx, dy) = area.get_base_pixel();
            area.draw(&Text::new(
                name.clone(),
                (x - dx - 8, y - dy),
                style.clone(),
            ))
            .map_err(drawing_error)?;
        }
        Ok(())
    }
}

impl Bars {
    /// Draws title and legend above all bars, without covering any; returns the rest of the area.
    fn draw_head<B: DrawingBackend>(&self, area: &Area<B>) -> std::result::Result<Area<B>, String> {
        let style = (FONT, 14)
            .into_font()
            .color(&INK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        let width = area.dim_in_pixel().0 as i32;
        let mut places = Vec::new();
        let (mut x, mut line) = (APART_PX, 0);
        for name in self.legend.iter().filter(|_| self.legend.len() > 1) {
            let words_px = area
                .estimate_text_size(name, &style)
                .map_err(drawing_error)?
                .0 as i32;
            if x > APART_PX && x + SWATCH_PX + GAP_PX + words_px > width {
                (x, line) = (APART_PX, line + 1);
            }
            places.push((x, line));
            x += SWATCH_PX + GAP_PX + words_px + APART_PX;
        }
        let lines = places.last().map_or(0, |(_, line)| line + 1);
        let (head, body) = area.split_vertically(CAPTION_PX + LEGEND_PX * lines);
        let title = (FONT, 19)
            .into_font()
            .color(&INK)
            .pos(Pos::new(HPos::Center, VPos::Center));
        head.draw(&Text::new(
            self.title.clone(),
            (width / 2, CAPTION_PX / 2 + 3),
            title,
        ))
        .map_err(drawing_error)?;
        for (nth, (x, line)) in places.into_iter().enumerate() {
            let y = CAPTION_PX + LEGEND_PX * line + LEGEND_PX / 2 - 2;
            let square = [(x, y - 5), (x + SWATCH_PX, y + 5)];
            head.draw(&Rectangle::new(
                square,
                COLOURS[nth % COLOURS.len()].filled(),
            ))
            .map_err(drawing_error)?;
            head.draw(&Text::new(
                self.legend[nth].clone(),
                (x + SWATCH_PX + GAP_PX, y),
                style.clone(),
            ))
            .map_err(drawing_error)?;
        }
        Ok(body)
    }
}

/// Draws a grid with `columns` columns, each cell of this many pixels, and writes a PNG.
///
/// # Errors
/// [`Error::Job`] if it cannot be drawn or written.
pub fn write_png(charts: &[&dyn Chart], columns: usize, cell: [u32; 2], path: &Path) -> Result<()> {
    register_font();
    let (rows, columns, size) = grid(charts.len(), columns, cell);
    let mut pixels = vec![255; size.0 as usize * size.1 as usize * 3];
    let root = BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area();
    let cells = root.split_evenly((rows, columns));
    let drawn = charts
        .iter()
        .zip(&cells)
        .try_for_each(|(chart, area)| chart.draw_pixels(area));
    drawn
        .and_then(|()| root.present().map_err(drawing_error))
        .map_err(|e| Error::job(format!("{}: {e}", path.display())))?;
    drop((cells, root));
    write_beside(path, |file| {
        let png =
            PngEncoder::new_with_quality(file, CompressionType::Default, FilterType::NoFilter);
        png.write_image(&pixels, size.0, size.1, ExtendedColorType::Rgb8)
            .map_err(|error| error.to_string())
    })
}

/// The same as the text of an SVG, in a font of the viewer.
///
/// # Errors
/// [`Error::Job`] if it cannot be drawn.
pub fn svg(charts: &[&dyn Chart], columns: usize, cell: [u32; 2]) -> Result<String> {
    register_font();
    let (rows, columns, size) = grid(charts.len(), columns, cell);
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    let cells = root.split_evenly((rows, columns));
    let drawn = root.fill(&WHITE).map_err(drawing_error);
    let drawn = drawn.and_then(|()| {
        charts
            .iter()
            .zip(&cells)
            .try_for_each(|(chart, area)| chart.draw_shapes(area))
    });
    drawn
        .and_then(|()| root.present().map_err(drawing_error))
        .map_err(Error::job)?;
    drop((cells, root));
    Ok(text)
}

/// Rows, columns and pixels of a grid.
fn grid(charts: usize, columns: usize, [width, height]: [u32; 2]) -> (usize, usize, (u32, u32)) {
    let columns = columns.clamp(1, charts.max(1));
    let rows = charts.div_ceil(columns).max(1);
    (
        rows,
        columns,
        (width * columns as u32, height * rows as u32),
    )
}

/// Registers the font of all charts, once.
fn register_font() {
    static ONCE: Once = Once::new();
    // The font is compiled in and always valid.
    ONCE.call_once(|| {
        drop(plotters::style::register_font(
            FONT,
            FontStyle::Normal,
            dejavu::sans::regular(),
        ))
    });
}

#[cfg(test)]
mod tests;
