//! Sheets: sums the contributions of one sheet to a pixel and blends sheet after sheet (EWA §7.1,
//! docs/book/algorithm-resolve.md §9); also the exact result.

use glam::{DVec3, DVec4};

use super::Outcomes;
use super::fragments::Fragment;
use super::shade::over;
use super::tiles::{PIXELS_IN_A_TILE, Painter};
use crate::scene::{Opacity, Sheet, Sheets};

/// A sheet's colour times opacity, and its opacity, from its optical depth and the products of
/// colour and optical depth.
pub fn closed(sheets: &Sheets, weight: f64, rgb: DVec3) -> DVec4 {
    if sheets.of == Sheet::Splat {
        let ratio = if weight > sheets.most_weight {
            sheets.most_weight / weight
        } else {
            1.0
        };
        return (rgb * ratio).extend(weight * ratio);
    }
    let ratio = sheets.opacity.over_depth(weight);
    (rgb * ratio).extend(weight * ratio)
}

/// One pixel: the open sheet, and the composite of the sheets before it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SheetState {
    open: Option<Fragment>,
    composite: DVec4,
    stopped: bool,
    sheets: u64,
}

/// Outcome of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SheetOutcome {
    /// Added to the open sheet.
    Added,
    /// Began the pixel's first sheet.
    First,
    /// Began a sheet; the one before was blended.
    Next,
    /// The pixel takes no more contributions.
    Dropped,
}

impl SheetState {
    /// Takes one contribution.
    pub fn take(&mut self, scene_sheets: &Sheets, new: &Fragment) -> SheetOutcome {
        if self.stopped {
            return SheetOutcome::Dropped;
        }
        if scene_sheets.of == Sheet::Splat {
            let kept = self.blend(scene_sheets, closed(scene_sheets, new.weight, new.rgb));
            self.sheets += u64::from(kept);
            return match (kept, self.sheets) {
                (false, _) => SheetOutcome::Dropped,
                (true, 1) => SheetOutcome::First,
                _ => SheetOutcome::Next,
            };
        }
        match &mut self.open {
            Some(open) if scene_sheets.of == Sheet::Sum || open.sheet == new.sheet => {
                open.add(new);
                return SheetOutcome::Added;
            }
            Some(open) => {
                let sheet = closed(scene_sheets, open.weight, open.rgb);
                self.blend(scene_sheets, sheet);
                if self.stopped {
                    self.open = None;
                    return SheetOutcome::Dropped;
                }
            }
            None => {}
        }
        self.open = Some(*new);
        self.sheets += 1;
        if self.sheets == 1 {
            SheetOutcome::First
        } else {
            SheetOutcome::Next
        }
    }

    /// Blends the sheet; returns whether it was kept.
    fn blend(&mut self, scene_sheets: &Sheets, sheet: DVec4) -> bool {
        let blended = over_or_under(scene_sheets, self.composite, sheet);
        self.stopped = !scene_sheets.back_to_front && 1.0 - blended.w < scene_sheets.stop;
        let kept = !self.stopped || scene_sheets.keeps_last;
        if kept {
            self.composite = blended;
        }
        kept
    }

    /// Final colour times opacity, and opacity.
    pub fn colour(&self, scene_sheets: &Sheets) -> DVec4 {
        let last = |open: &Fragment| {
            over_or_under(
                scene_sheets,
                self.composite,
                closed(scene_sheets, open.weight, open.rgb),
            )
        };
        self.open.as_ref().map_or(self.composite, last)
    }
}

/// The next sheet blended with those before it.
fn over_or_under(sheets: &Sheets, before: DVec4, next: DVec4) -> DVec4 {
    if sheets.back_to_front {
        over(next, before)
    } else {
        over(before, next)
    }
}

/// The hardware's algorithm: at most two layers per pixel.
pub(super) struct SheetPainter<'a> {
    sheets: &'a Sheets,
    background: DVec4,
    pixels: Vec<SheetState>,
    outcomes: Outcomes,
}

impl<'a> SheetPainter<'a> {
    pub fn new(sheets: &'a Sheets, background: [f64; 4]) -> Self {
        let pixels = vec![SheetState::default(); PIXELS_IN_A_TILE];
        SheetPainter {
            sheets,
            background: DVec4::from_array(background),
            pixels,
            outcomes: Outcomes::default(),
        }
    }
}

impl Painter for SheetPainter<'_> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        *match self.pixels[pixel].take(self.sheets, &contribution) {
            SheetOutcome::Added => &mut self.outcomes.accumulated,
            SheetOutcome::First => &mut self.outcomes.inserted,
            SheetOutcome::Next => &mut self.outcomes.merged,
            SheetOutcome::Dropped => &mut self.outcomes.dropped,
        } += 1;
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let done = std::mem::take(&mut self.pixels[pixel]);
        self.outcomes.most_surfaces_in_a_pixel =
            self.outcomes.most_surfaces_in_a_pixel.max(done.sheets);
        over(done.colour(self.sheets), self.background).to_array()
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

/// Colour times opacity, and opacity, of a contribution. Contributions of a volume hide what is
/// behind them by exactly e^(−x); those of a Gaussian by its weight.
fn exact(sheets: &Sheets, fragment: &Fragment) -> DVec4 {
    if sheets.of == Sheet::Splat {
        return closed(sheets, fragment.weight, fragment.rgb);
    }
    let ratio = Opacity::Exponential.over_depth(fragment.weight);
    (fragment.rgb * ratio).extend(fragment.weight * ratio)
}

/// The exact result of Gaussians that come in the order of their depths: as [`IdealSheetPainter`],
/// but no contribution has to be kept.
pub(super) struct IdealOrderedPainter<'a> {
    sheets: &'a Sheets,
    background: DVec4,
    /// The blended contributions of each pixel, and their number.
    pixels: Vec<(DVec4, u64)>,
    outcomes: Outcomes,
}

impl<'a> IdealOrderedPainter<'a> {
    pub fn new(sheets: &'a Sheets, background: [f64; 4]) -> Self {
        IdealOrderedPainter {
            sheets,
            background: DVec4::from_array(background),
            pixels: vec![(DVec4::ZERO, 0); PIXELS_IN_A_TILE],
            outcomes: Outcomes::default(),
        }
    }
}

impl Painter for IdealOrderedPainter<'_> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        let (front, count) = &mut self.pixels[pixel];
        *front = over(*front, exact(self.sheets, &contribution));
        *count += 1;
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let (all, count) = std::mem::take(&mut self.pixels[pixel]);
        self.outcomes.inserted += count;
        self.outcomes.most_surfaces_in_a_pixel = self.outcomes.most_surfaces_in_a_pixel.max(count);
        over(all, self.background).to_array()
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

/// The exact result, without a limit of slots: every contribution separately, nearest first, none
/// left out and none late.
pub(super) struct IdealSheetPainter<'a> {
    sheets: &'a Sheets,
    background: DVec4,
    contributions: Vec<Vec<Fragment>>,
    outcomes: Outcomes,
}

impl<'a> IdealSheetPainter<'a> {
    pub fn new(sheets: &'a Sheets, background: [f64; 4]) -> Self {
        let contributions = vec![Vec::new(); PIXELS_IN_A_TILE];
        IdealSheetPainter {
            sheets,
            background: DVec4::from_array(background),
            contributions,
            outcomes: Outcomes::default(),
        }
    }
}

impl Painter for IdealSheetPainter<'_> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        self.contributions[pixel].push(contribution);
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let contributions = &mut self.contributions[pixel];
        contributions.sort_by(|a, b| a.z.total_cmp(&b.z));
        let all = contributions.iter().fold(DVec4::ZERO, |front, fragment| {
            over(front, exact(self.sheets, fragment))
        });
        let count = contributions.len() as u64;
        self.outcomes.inserted += count;
        self.outcomes.most_surfaces_in_a_pixel = self.outcomes.most_surfaces_in_a_pixel.max(count);
        contributions.clear();
        over(all, self.background).to_array()
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}
