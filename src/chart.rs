//! Chart: curves, points and bars as PNG files, drawn the same on every computer (the font comes along).
//!
//! ```text
//! numbers ─► [panel: axes, series, marks] ─┬─► one panel, or a grid of them ─► PNG
//!            [bars: names, values] ────────┤
//!            [extents: formats, words] ────┘
//! ```

mod extents;
mod tiles;

pub use extents::{Extent, Extents};
pub use tiles::{Tile, Words};

use crate::error::{Error, Result};
use crate::picture::write_beside;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::FontStyle;
use std::ops::Range;
use std::path::Path;
use std::sync::Once;

/// Colours that stay apart for the colour-blind (Okabe and Ito, 2008), the first for what matters most.
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
    /// What it shows, with its unit.
    pub label: String,
    /// By powers of ten.
    pub log: bool,
    /// Least and greatest value; of what is drawn where not given.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// An axis by equal steps.
    pub fn linear(label: &str) -> Self {
        Axis { label: label.into(), ..Axis::default() }
    }

    /// An axis by powers of ten; values that are not positive are not drawn.
    pub fn log(label: &str) -> Self {
        Axis { label: label.into(), log: true, range: None }
    }

    /// From here to there.
    pub fn within(self, low: f64, high: f64) -> Self {
        Axis { range: Some([low, high]), ..self }
    }

    /// Where a value lies on the axis; none where it cannot be shown.
    fn place(&self, value: f64) -> Option<f64> {
        let place = if self.log { libm::log10(value) } else { value };
        place.is_finite().then_some(place)
    }

    fn told(&self, place: f64) -> String {
        let value = if self.log { libm::pow(10.0, place) } else { place };
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

    /// What a mark of the axis says; nothing between the powers of ten, where at least two of those are marked.
    fn mark(&self, place: f64, span: &Range<f64>) -> String {
        let between = (place - place.round()).abs() > 1e-6;
        let decades = span.end.floor() - span.start.ceil();
        if self.log && between && decades >= 1.0 { String::new() } else { self.told(place) }
    }

    /// The range that shows all of these values, with a margin.
    fn span(&self, values: impl Iterator<Item = f64>) -> Range<f64> {
        if let Some([low, high]) = self.range {
            return self.place(low).unwrap_or(0.0)..self.place(high).unwrap_or(1.0);
        }
        let places = values.filter_map(|value| self.place(value));
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
        if low > high {
            return 0.0..1.0;
        }
        let margin = if high > low { 0.04 * (high - low) } else { 0.5 };
        low - margin..high + margin
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line from point to point.
    Line,
    /// A dashed line.
    Dashed,
    /// A dot at each point.
    Dots,
}

/// One series of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// For the legend; none there if empty.
    pub name: String,
    /// What is drawn.
    pub points: Vec<[f64; 2]>,
    /// How.
    pub mark: Mark,
    /// Number of its colour.
    pub colour: usize,
}

/// One set of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What it shows.
    pub series: Vec<Series>,
    /// Upright lines with a word beside them, and the number of their colour.
    pub limits: Vec<(f64, String, usize)>,
}

/// Numbers by name, as horizontal bars side by side.
#[derive(Clone, Debug, Default)]
pub struct Bars {
    /// Above them.
    pub title: String,
    /// What the bars' length shows, with its unit.
    pub axis: Axis,
    /// Names of the bars of one row.
    pub legend: Vec<String>,
    /// A name and a value for each bar.
    pub rows: Vec<(String, Vec<f64>)>,
}

/// Something that can be drawn into a rectangle.
pub trait Draw {
    /// Draws.
    ///
    /// # Errors
    /// A sentence of the drawing library.
    fn draw(&self, area: &Area) -> std::result::Result<(), String>;
}

/// A rectangle to draw in.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

fn told(error: impl std::fmt::Display) -> String {
    error.to_string()
}

const FONT: &str = "sans-serif";
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(225, 225, 225);

/// How far the words of a limit are moved to the right, pixels: they stand on their side.
const BESIDE_PX: i32 = 15;

impl Draw for Panel {
    fn draw(&self, area: &Area) -> std::result::Result<(), String> {
        let all = || self.series.iter().flat_map(|series| &series.points);
        let x = self.x.span(all().map(|point| point[0]).chain(self.limits.iter().map(|limit| limit.0)));
        let y = self.y.span(all().map(|point| point[1]));
        let (left, top) = (x.start, y.end - 0.02 * (y.end - y.start));
        let spans = (x.clone(), y.clone());
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 19).into_font().color(&INK))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)
            .map_err(told)?;
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
            .map_err(told)?;
        for (at, word, colour) in &self.limits {
            let (Some(at), colour) = (self.x.place(*at), COLOURS[colour % COLOURS.len()]) else { continue };
            let range = chart.y_range();
            let line = [(at, range.start), (at, range.end)];
            chart.draw_series(DashedLineSeries::new(line, 4, 4, colour.into())).map_err(told)?;
            let style = (FONT, 13).into_font().transform(FontTransform::Rotate90).color(&colour);
            // The words stand beside their line, not on it.
            let words = EmptyElement::at((at.max(left), top)) + Text::new(word.clone(), (BESIDE_PX, 0), style);
            chart.draw_series([words]).map_err(told)?;
        }
        for series in &self.series {
            let colour = COLOURS[series.colour % COLOURS.len()];
            let place = |point: &[f64; 2]| Some((self.x.place(point[0])?, self.y.place(point[1])?));
            let points: Vec<(f64, f64)> = series.points.iter().filter_map(place).collect();
            let drawn = match series.mark {
                Mark::Line => chart.draw_series(LineSeries::new(points, colour.stroke_width(2))),
                Mark::Dashed => chart.draw_series(DashedLineSeries::new(points, 7, 5, colour.stroke_width(2))),
                Mark::Dots => chart.draw_series(points.into_iter().map(|point| Circle::new(point, 2, colour.filled()))),
            };
            let drawn = drawn.map_err(told)?;
            if !series.name.is_empty() {
                let swatch = move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(3));
                drawn.label(&series.name).legend(swatch);
            }
        }
        if self.series.iter().any(|series| !series.name.is_empty()) {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::LowerRight)
                .background_style(WHITE.mix(0.85))
                .border_style(FAINT)
                .label_font((FONT, 14).into_font().color(&INK))
                .draw()
                .map_err(told)?;
        }
        Ok(())
    }
}

impl Draw for Bars {
    fn draw(&self, area: &Area) -> std::result::Result<(), String> {
        let values = self.rows.iter().flat_map(|(_, values)| values.iter().copied());
        let mut span = self.axis.span(values.chain((!self.axis.log).then_some(0.0)));
        if self.axis.log {
            span.start = span.start.floor();
        }
        let (start, whole) = (span.start, span.clone());
        let rows = self.rows.len() as f64;
        // The legend stands below the last bar, not on it.
        let below = if self.legend.len() > 1 { 0.075 * rows * self.legend.len() as f64 } else { 0.0 };
        let longest = self.rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0) as u32;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 19).into_font().color(&INK))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(30 + 8 * longest)
            .build_cartesian_2d(span, -below..rows.max(1.0))
            .map_err(told)?;
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
            .map_err(told)?;
        let many = self.legend.len().max(1);
        for bar in 0..many {
            let colour = COLOURS[bar % COLOURS.len()];
            let rectangle = |(row, (_, values)): (usize, &(String, Vec<f64>))| {
                let end = self.axis.place(*values.get(bar)?)?;
                let top = rows - row as f64 - 0.12 - 0.76 * bar as f64 / many as f64;
                Some(Rectangle::new([(start, top), (end.max(start), top - 0.76 / many as f64)], colour.filled()))
            };
            let bars: Vec<_> = self.rows.iter().enumerate().filter_map(rectangle).collect();
            let drawn = chart.draw_series(bars).map_err(told)?;
            if let Some(name) = self.legend.get(bar) {
                drawn.label(name).legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 14, y + 5)], colour.filled()));
            }
        }
        let style = (FONT, 14).into_font().color(&INK).pos(plotters::style::text_anchor::Pos::new(
            plotters::style::text_anchor::HPos::Right,
            plotters::style::text_anchor::VPos::Center,
        ));
        for (row, (name, _)) in self.rows.iter().enumerate() {
            let (x, y) = chart.backend_coord(&(start, rows - row as f64 - 0.5));
            let (dx, dy) = area.get_base_pixel();
            area.draw(&Text::new(name.clone(), (x - dx - 8, y - dy), style.clone())).map_err(told)?;
        }
        if self.legend.len() > 1 {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::LowerRight)
                .background_style(WHITE.mix(0.85))
                .border_style(FAINT)
                .label_font((FONT, 14).into_font().color(&INK))
                .draw()
                .map_err(told)?;
        }
        Ok(())
    }
}

/// Draws in a grid of `columns`, each cell of this many pixels, and writes a PNG.
///
/// # Errors
/// [`Error::Job`] where it cannot be drawn or written.
pub fn write_png(drawings: &[&dyn Draw], columns: usize, [width, height]: [u32; 2], path: &Path) -> Result<()> {
    register_font();
    let columns = columns.clamp(1, drawings.len().max(1));
    let rows = drawings.len().div_ceil(columns).max(1);
    let (width, height) = (width * columns as u32, height * rows as u32);
    let mut pixels = vec![255; width as usize * height as usize * 3];
    draw(drawings, columns, rows, &mut pixels, (width, height)).map_err(|e| Error::job(format!("{}: {e}", path.display())))?;
    write_beside(path, |file| {
        let png = PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::NoFilter);
        png.write_image(&pixels, width, height, ExtendedColorType::Rgb8).map_err(|error| error.to_string())
    })
}

fn draw(drawings: &[&dyn Draw], columns: usize, rows: usize, pixels: &mut [u8], size: (u32, u32)) -> std::result::Result<(), String> {
    let root = BitMapBackend::with_buffer(pixels, size).into_drawing_area();
    for (drawing, area) in drawings.iter().zip(root.split_evenly((rows, columns))) {
        drawing.draw(&area)?;
    }
    root.present().map_err(told)
}

/// The font of every chart, once.
fn register_font() {
    static ONCE: Once = Once::new();
    // A font that is compiled in cannot be an invalid one.
    ONCE.call_once(|| drop(plotters::style::register_font(FONT, FontStyle::Normal, dejavu::sans::regular())));
}

#[cfg(test)]
mod tests;
