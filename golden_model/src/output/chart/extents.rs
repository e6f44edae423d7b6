//! Extents: formats as boxes over powers of two, shaded by the words that they held.
//!
//! ```text
//!             2⁻²⁰        2⁻⁸         1          2⁸
//! name        [   ░▒▓▓▒░░             :  ]■           format   narrowest
//!              └ bits that nothing    :  └ too far    observed words, darker if more frequent
//!                needed are empty    binary point
//! ```

use super::{Area, COLOURS, Draw, DrawResult, FAINT, FONT, INK, drawing_error};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// One format and its words.
#[derive(Clone, Debug)]
pub struct Extent {
    /// Text to its left.
    pub name: String,
    /// Text to its right, one cell per head.
    pub columns: [String; 3],
    /// Powers of two of the LSB and of the least power that no magnitude reaches.
    pub places: [i32; 2],
    /// Share of all words between each power of two and the next.
    pub parts: Vec<(i32, f64)>,
    /// Powers of two by which results exceeded the format; 0 if none did.
    pub beyond: i32,
}

/// Formats by group, one below the other.
#[derive(Clone, Debug)]
pub struct Extents {
    /// Title above the chart.
    pub title: String,
    /// Heads of the columns to the right.
    pub heads: [String; 3],
    /// Names and formats.
    pub groups: Vec<(String, Vec<Extent>)>,
}

const ROW_PX: i32 = 16;
const PLACE_PX: i32 = 12;
const NAMES_PX: i32 = 216;
const COLUMN_PX: i32 = 78;
const MARGIN_PX: i32 = 14;
/// Height of title, legend and axis.
const HEAD_PX: i32 = 92;
/// Powers of two between marks.
const MARK: i32 = 4;
/// Decades of shares that shades distinguish.
const DECADES: f64 = 6.0;
const OUTLINE: RGBColor = RGBColor(120, 120, 120);

impl Extents {
    /// Width and height.
    pub fn size_px(&self) -> [u32; 2] {
        let [first, last] = self.span();
        let rows: usize = self
            .groups
            .iter()
            .map(|(_, extents)| extents.len() + 1)
            .sum();
        let width = 2 * MARGIN_PX + NAMES_PX + (last - first) * PLACE_PX + 3 * COLUMN_PX;
        [
            width as u32,
            (HEAD_PX + rows as i32 * ROW_PX + MARGIN_PX) as u32,
        ]
    }

    /// The least and the greatest power of two of the chart.
    fn span(&self) -> [i32; 2] {
        let all = || self.groups.iter().flat_map(|(_, extents)| extents);
        let first = all()
            .map(|extent| extent.places[0])
            .min()
            .unwrap_or(0)
            .min(0);
        let last = all()
            .map(|extent| extent.places[1] + extent.beyond.min(8))
            .max()
            .unwrap_or(0)
            .max(1);
        [
            first.div_euclid(MARK) * MARK,
            (last + MARK).div_euclid(MARK) * MARK,
        ]
    }
}

fn text(size: i32, anchor: HPos) -> TextStyle<'static> {
    (FONT, size)
        .into_font()
        .color(&INK)
        .pos(Pos::new(anchor, VPos::Center))
}

/// From nearly white to the first of the colours, by the logarithm of a share.
fn shade(part: f64) -> RGBColor {
    let depth = (1.0 + libm::log10(part.max(f64::MIN_POSITIVE)) / DECADES)
        .clamp(0.0, 1.0)
        .mul_add(0.88, 0.12);
    let RGBColor(r, g, b) = COLOURS[0];
    let [r, g, b] =
        [r, g, b].map(|channel| (255.0 + (f64::from(channel) - 255.0) * depth).round() as u8);
    RGBColor(r, g, b)
}

/// Text of a power of two.
fn power(exponent: i32) -> String {
    if exponent == 0 {
        return "1".into();
    }
    let digits = exponent.to_string();
    let raised = digits.chars().map(|digit| match digit {
        '-' => '⁻',
        _ => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize - '0' as usize],
    });
    format!("2{}", raised.collect::<String>())
}

impl Draw for Extents {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let [first, last] = self.span();
        let x = |place: i32| MARGIN_PX + NAMES_PX + (place - first) * PLACE_PX;
        let rows: i32 = self
            .groups
            .iter()
            .map(|(_, extents)| extents.len() as i32 + 1)
            .sum();
        let bottom = HEAD_PX + rows * ROW_PX;
        area.draw(&Text::new(
            self.title.clone(),
            (MARGIN_PX, 20),
            text(19, HPos::Left),
        ))
        .map_err(drawing_error)?;
        self.draw_legend(area)?;
        for place in (first..=last).step_by(MARK as usize) {
            let colour = if place == 0 { OUTLINE } else { FAINT };
            area.draw(&PathElement::new(
                vec![(x(place), HEAD_PX - 4), (x(place), bottom)],
                colour,
            ))
            .map_err(drawing_error)?;
            area.draw(&Text::new(
                power(place),
                (x(place), HEAD_PX - 14),
                text(13, HPos::Center),
            ))
            .map_err(drawing_error)?;
        }
        for (head, column) in self.heads.iter().zip(1..) {
            let at = (x(last) + column * COLUMN_PX, HEAD_PX - 14);
            area.draw(&Text::new(head.clone(), at, text(13, HPos::Right)))
                .map_err(drawing_error)?;
        }
        let mut top = HEAD_PX;
        for (group, extents) in &self.groups {
            let middle = top + ROW_PX / 2;
            area.draw(&Text::new(
                group.clone(),
                (MARGIN_PX, middle),
                text(15, HPos::Left),
            ))
            .map_err(drawing_error)?;
            top += ROW_PX;
            for extent in extents {
                extent.draw(area, x, top, x(last))?;
                top += ROW_PX;
            }
        }
        Ok(())
    }
}

impl Extents {
    fn draw_legend<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let y = 48;
        let mut x = MARGIN_PX;
        let words = |text_px: &mut i32, words: &str, width: i32| {
            let drawn = area
                .draw(&Text::new(
                    words.to_owned(),
                    (*text_px, y),
                    text(13, HPos::Left),
                ))
                .map_err(drawing_error);
            *text_px += width;
            drawn
        };
        words(&mut x, "part of the words: 10⁻⁶", 158)?;
        for step in 0..=6 {
            let square = [(x, y - 6), (x + PLACE_PX, y + 6)];
            area.draw(&Rectangle::new(
                square,
                shade(libm::pow(10.0, f64::from(step) - DECADES)).filled(),
            ))
            .map_err(drawing_error)?;
            x += PLACE_PX;
        }
        x += 6;
        words(&mut x, "1", 34)?;
        area.draw(&Rectangle::new(
            [(x, y - 6), (x + 4 * PLACE_PX, y + 6)],
            OUTLINE,
        ))
        .map_err(drawing_error)?;
        x += 4 * PLACE_PX + 8;
        words(
            &mut x,
            "the format: empty where its bits are not needed",
            330,
        )?;
        area.draw(&Rectangle::new(
            [(x, y - 6), (x + PLACE_PX, y + 6)],
            COLOURS[1].filled(),
        ))
        .map_err(drawing_error)?;
        x += PLACE_PX + 8;
        words(&mut x, "beyond it: saturated or wrapped", 0)
    }
}

impl Extent {
    fn draw<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        x: impl Fn(i32) -> i32,
        top: i32,
        end: i32,
    ) -> DrawResult {
        let (upper, lower, middle) = (top + 2, top + ROW_PX - 2, top + ROW_PX / 2);
        let filled = |from: i32, to: i32, colour: RGBColor| {
            let cell = [(x(from), upper), (x(to), lower)];
            area.draw(&Rectangle::new(cell, colour.filled()))
                .map_err(drawing_error)
        };
        area.draw(&Text::new(
            self.name.clone(),
            (MARGIN_PX + 14, middle),
            text(13, HPos::Left),
        ))
        .map_err(drawing_error)?;
        let [low, high] = self.places;
        filled(low, high, WHITE)?;
        for &(place, part) in self.parts.iter().filter(|(_, part)| *part > 0.0) {
            filled(place, place + 1, shade(part))?;
        }
        if self.beyond > 0 {
            filled(high, high + self.beyond.min(8), COLOURS[1])?;
        }
        area.draw(&Rectangle::new(
            [(x(low), upper), (x(high), lower)],
            OUTLINE,
        ))
        .map_err(drawing_error)?;
        for (cell, column) in self.columns.iter().zip(1..) {
            area.draw(&Text::new(
                cell.clone(),
                (end + column * COLUMN_PX, middle),
                text(13, HPos::Right),
            ))
            .map_err(drawing_error)?;
        }
        Ok(())
    }
}
