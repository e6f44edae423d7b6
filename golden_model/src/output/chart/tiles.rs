//! Tiles: cells of a grid with pictures enlarged pixel by pixel, and with text.

use super::{Area, COLOURS, Draw, DrawResult, FONT, INK, Mark, drawing_error};
use crate::output::colour::srgb_byte;
use crate::output::picture::Picture;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// A picture under its caption, enlarged by the greatest integer that fits.
#[derive(Clone, Debug)]
pub struct PictureTile {
    /// Text above it.
    pub caption: String,
    /// Linear light, over black.
    pub picture: Picture,
}

/// Lines of text, each optionally next to a sample of how a series is drawn.
#[derive(Clone, Debug, Default)]
pub struct TextLines {
    /// The first line, larger.
    pub title: String,
    /// The other lines, already wrapped.
    pub lines: Vec<(Option<(Mark, usize)>, String)>,
}

/// Height of a caption, pixels.
const CAPTION_PX: i32 = 18;
/// Free space around a cell's content, pixels.
const MARGIN_PX: i32 = 3;

impl Draw for PictureTile {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let style = (FONT, 13).into_font().color(&INK);
        area.draw(&Text::new(
            self.caption.clone(),
            (MARGIN_PX, MARGIN_PX),
            style,
        ))
        .map_err(drawing_error)?;
        let (width, height) = area.dim_in_pixel();
        let (columns, rows) = (self.picture.width as i32, self.picture.height as i32);
        let side = ((width as i32 - 2 * MARGIN_PX) / columns)
            .min((height as i32 - 2 * MARGIN_PX - CAPTION_PX) / rows)
            .max(1);
        for (i, [r, g, b, _]) in self.picture.rgba.iter().enumerate() {
            let [x, y] = [
                MARGIN_PX + i as i32 % columns * side,
                MARGIN_PX + CAPTION_PX + i as i32 / columns * side,
            ];
            let [r, g, b] = [r, g, b].map(|channel| srgb_byte(*channel));
            // The second corner is exclusive.
            let square = [(x, y), (x + side, y + side)];
            area.draw(&Rectangle::new(square, RGBColor(r, g, b).filled()))
                .map_err(drawing_error)?;
        }
        Ok(())
    }
}

impl Draw for TextLines {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult {
        let title = (FONT, 16).into_font().color(&INK);
        area.draw(&Text::new(
            self.title.clone(),
            (2 * MARGIN_PX, 2 * MARGIN_PX),
            title,
        ))
        .map_err(drawing_error)?;
        for (i, (sample, line)) in self.lines.iter().enumerate() {
            let y = 2 * MARGIN_PX + 24 + 17 * i as i32;
            let mut x = 2 * MARGIN_PX;
            if let Some((mark, colour)) = sample {
                let style = COLOURS[colour % COLOURS.len()].stroke_width(2);
                let path = vec![(x, y + 7), (x + 26, y + 7)];
                match mark {
                    Mark::Line => area.draw(&PathElement::new(path, style)),
                    Mark::Dashed => area.draw(&DashedPathElement::new(path, 7, 5, style)),
                    Mark::Dots | Mark::Rings | Mark::Crosses | Mark::Triangles => {
                        area.draw(&Circle::new((x + 13, y + 7), 3, style.filled()))
                    }
                }
                .map_err(drawing_error)?;
                x += 34;
            }
            area.draw(&Text::new(
                line.clone(),
                (x, y),
                (FONT, 13).into_font().color(&INK),
            ))
            .map_err(drawing_error)?;
        }
        Ok(())
    }
}
