//! Raster: walks a splat's box and makes a fragment wherever the radial index is below the cutoff (forward differencing, ALGORITHM §4).
//!
//! ```text
//! conic ─►[ seed ]─► radial ─►(+)─►(+)─► …   r at each pixel centre; first += second, radial += first: two adds a pixel
//! pixel ─►    │      first  ─►(+)─┘
//!             └────► depth  ─►(+)─► …        z of the tangent plane: one add a pixel; clamped to t_z ± depth_range
//! ```
//! A row is seeded afresh, or rows are differenced as pixels are (`rows`). Adds are exact, so an error is that of the seed and
//! of the increments alone: e₀ + n·e₁ + n(n−1)/2·e₂ after n pixels. Both adders wrap: that is harmless inside the footprint
//! as long as the register holds the r of the whole box, of which corners reach 2·cutoff/(1−|ρ|).
//!
//! Losses: `offset`, `gradient`, the seeds of `radial` and `depth`, and the differences are rounded to nearest; the radial
//! index is clamped to [0, cutoff) on its way out, for differencing may leave it slightly below 0.
//!
//! Laws: `stepping_equals_the_closed_form`, `seeded_and_differenced_rows_agree_within_their_guard_bits`.

use crate::machine::{Elaboration, Machine, Rows};
use crate::num::register::Held;
use crate::num::{Exact, Fit, Format, LANES, Lanes, MAX_WIDTH_BITS, Register, Word, three, two};
use crate::probe::{Probe, Tap};

const UNIT: &str = "raster";

/// Side of the square of pixels that a [`Span`] numbers.
const SIDE_PX: usize = 16;
/// Most fragments of a span, and room for the last eight lanes.
const SPAN_FRAGMENTS: usize = SIDE_PX * SIDE_PX;

/// Input port: one splat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Input {
    /// Position from the picture's middle (`project.pixel`).
    pub pixel: [i32; 2],
    /// Q00, Q01, Q11 (`ellipse.conic`, `ellipse.conic_cross`).
    pub conic: [i32; 3],
    /// t_z (`project.depth`).
    pub depth: i32,
    /// z_x, z_y (`ellipse.depth_slope`).
    pub depth_slope: [i32; 2],
    /// Half-width of the depth clamp (`ellipse.depth_range`).
    pub depth_range: i32,
    /// First and last column of the box.
    pub columns: [u16; 2],
    /// First and last row of the box.
    pub rows: [u16; 2],
}

/// Output port: the fragments of one splat in a square of 16 × 16 pixels.
#[derive(Clone, Debug)]
pub struct Span {
    fragments: usize,
    pixel: [u8; SPAN_FRAGMENTS + LANES],
    /// r of each, as its register holds it (`raster.radial`).
    radial: [Held; SPAN_FRAGMENTS + LANES],
    /// z of each, unclamped, as its register holds it (`raster.depth`).
    depth: [Held; SPAN_FRAGMENTS + LANES],
}

impl Default for Span {
    fn default() -> Self {
        let held = [0; SPAN_FRAGMENTS + LANES];
        Span { fragments: 0, pixel: [0; SPAN_FRAGMENTS + LANES], radial: held, depth: held }
    }
}

impl Span {
    /// Forgets all fragments.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.fragments = 0;
    }

    /// How many fragments there are.
    #[inline(always)]
    pub fn fragments(&self) -> usize {
        self.fragments
    }

    /// A fragment's pixel, row by row, 0 to 255.
    #[inline(always)]
    pub fn pixel(&self, fragment: usize) -> usize {
        usize::from(self.pixel[fragment])
    }
}

/// One splat's registers at one pixel of its box, with their differences by column and row.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    input: Input,
    /// Columns between the box's first and this pixel.
    skipped: i64,
    radial: Held,
    depth: Held,
    by_column: Held,
    by_column_twice: Held,
    by_row: Held,
    by_row_twice: Held,
    by_both: Held,
    depth_by: [Held; 2],
    /// The depth clamp (shape: [`Raster::depth_exact`]).
    nearest: i64,
    deepest: i64,
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Raster {
    rows: Rows,
    offset: Fit,
    gradient: Fit,
    radial: Fit,
    first: Fit,
    second: Fit,
    depth: Fit,
    radial_register: Register,
    depth_register: Register,
    words: Words,
}

/// Fraction bits of the words that are aligned here.
#[derive(Clone, Copy, Debug)]
struct Words {
    pixel: u32,
    offset: u32,
    cutoff: i32,
    first: i32,
    second: i32,
    depth_slope: i32,
    /// Left shifts that align t_z with the products of depth slopes.
    plane: [u32; 2],
    /// Left shifts that align depth register, t_z and depth range.
    clamp: [u32; 3],
}

fn places(finer: i32, coarser: i32) -> u32 {
    (finer - coarser).clamp(0, 62) as u32
}

impl Raster {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let (m, s) = (&machine.raster, &machine.ellipse);
        for (name, word, signed) in [("cutoff", m.cutoff, false), ("offset", m.offset, true), ("gradient", m.gradient, true)] {
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, signed);
        }
        for (name, word) in [("radial", m.radial), ("first", m.first), ("second", m.second), ("depth", m.depth)] {
            e.signedness(UNIT, name, word, true);
        }
        e.holds_one(UNIT, "offset", m.offset);
        let f = |word: Word| word.format.frac_bits;
        for (name, word) in [("first", m.first), ("second", m.second), ("cutoff", m.cutoff)] {
            e.require(f(word) <= f(m.radial), || {
                let fits = Format { frac_bits: f(m.radial), ..word.format }.within(MAX_WIDTH_BITS);
                format!("raster.{name} is {word}, finer than the register raster.radial {} that it meets: {fits} would fit", m.radial)
            });
        }
        let int_bits = m.cutoff.format.int_bits.clamp(0, MAX_WIDTH_BITS - 2) + 1;
        e.require(m.radial.format.int_bits >= int_bits, || {
            let fits = Format { int_bits, frac_bits: f(m.radial).min(MAX_WIDTH_BITS - int_bits), ..m.radial.format };
            format!("raster.radial is {}, too narrow for the cutoff raster.cutoff {} that it meets: {fits} would fit", m.radial, m.cutoff)
        });
        e.require(f(s.depth_slope) <= f(m.depth), || {
            let fits = Format { frac_bits: f(s.depth_slope), ..m.depth.format }.within(MAX_WIDTH_BITS);
            format!(
                "raster.depth is {}, coarser than the steps ellipse.depth_slope {} that it adds: {fits} would fit",
                m.depth, s.depth_slope
            )
        });
        let pixel = machine.project.pixel;
        // The picture's middle lies up to 8192 pixels from its first.
        let offset = e.fit(UNIT, "offset", m.offset, Exact::from(pixel).plus(Exact { int_bits: 14, frac_bits: 1 }));
        let along = e.times(UNIT, s.conic, m.offset);
        let across = e.times(UNIT, s.conic_cross, m.offset);
        let aligned = f(s.conic) == f(s.conic_cross);
        e.require(aligned, || {
            format!("ellipse.conic {} and ellipse.conic_cross {} need the same fraction bits: they are summed", s.conic, s.conic_cross)
        });
        let gradient = e.fit(UNIT, "gradient", m.gradient, along.plus(across.doubled()));
        let square = e.times(UNIT, m.offset, m.gradient);
        let radial = e.fit(UNIT, "radial", m.radial, square.plus(square));
        let first = e.fit(UNIT, "first", m.first, along.doubled().plus(along).plus(across.doubled()));
        let second = e.fit(UNIT, "second", m.second, Exact::from(s.conic).doubled());
        let lean = e.times(UNIT, s.depth_slope, m.offset);
        let plane = lean.plus(lean).plus(machine.project.depth);
        let depth = e.fit(UNIT, "depth", m.depth, plane);
        let camera = f(machine.project.depth);
        let finest = f(m.depth).max(camera).max(f(s.depth_range));
        Raster {
            rows: m.rows,
            offset,
            gradient,
            radial,
            first,
            second,
            depth,
            radial_register: Register::new(m.radial),
            depth_register: Register::new(m.depth),
            words: Words {
                pixel: f(pixel).max(1) as u32,
                offset: f(m.offset) as u32,
                cutoff: f(m.cutoff),
                first: f(m.first),
                second: f(m.second),
                depth_slope: f(s.depth_slope),
                plane: [places(plane.frac_bits, lean.frac_bits), places(plane.frac_bits, camera)],
                clamp: [places(finest, f(m.depth)), places(finest, camera), places(finest, f(s.depth_range))],
            },
        }
    }

    /// Whether all of its fits are plain.
    pub fn is_plain(&self) -> bool {
        let words = [&self.offset, &self.gradient, &self.first, &self.second];
        words.into_iter().all(Fit::is_plain) && [&self.radial, &self.depth].into_iter().all(Fit::is_plain_register)
    }

    /// Shape of the depth that leaves the clamp.
    pub fn depth_exact(machine: &Machine) -> Exact {
        Exact::from(machine.project.depth).plus(machine.ellipse.depth_range).plus(machine.raster.depth)
    }

    /// The cutoff as the register sees it.
    pub fn cutoff(&self, cutoff: i64) -> i64 {
        self.radial_register.load(cutoff, self.words.cutoff)
    }

    /// Enters a splat's box at pixel (x, y) of it.
    #[inline(always)]
    pub fn enter<const PLAIN: bool, P: Probe>(&self, size_px: [u32; 2], input: &Input, [x, y]: [u16; 2], tap: &mut Tap<P>) -> Walk {
        let w = &self.words;
        let depth = i64::from(input.depth) << w.clamp[1];
        let range = i64::from(input.depth_range) << w.clamp[2];
        let mut walk = Walk {
            input: *input,
            skipped: i64::from(x - input.columns[0]),
            radial: 0,
            depth: 0,
            by_column: 0,
            by_column_twice: self.second::<PLAIN, P>(input.conic[0], tap),
            by_row: 0,
            by_row_twice: 0,
            by_both: 0,
            depth_by: two!(axis => self.depth_register.load(i64::from(input.depth_slope[axis]), w.depth_slope)),
            nearest: depth - range,
            deepest: depth + range,
        };
        match self.rows {
            Rows::Seeded => self.begin_row::<PLAIN, P>(size_px, &mut walk, y, tap),
            Rows::Differenced => self.begin_box::<PLAIN, P>(size_px, &mut walk, y, tap),
        }
        walk
    }

    /// Goes to the next row, `y`.
    #[inline(always)]
    pub fn next_row<const PLAIN: bool, P: Probe>(&self, size_px: [u32; 2], walk: &mut Walk, y: u16, tap: &mut Tap<P>) {
        if self.rows == Rows::Seeded {
            return self.begin_row::<PLAIN, P>(size_px, walk, y, tap);
        }
        walk.radial = walk.radial.wrapping_add(walk.by_row);
        walk.by_row = walk.by_row.wrapping_add(walk.by_row_twice);
        walk.by_column = walk.by_column.wrapping_add(walk.by_both);
        walk.depth = walk.depth.wrapping_add(walk.depth_by[1]);
    }

    /// Seeds row `y` afresh.
    #[inline(always)]
    fn begin_row<const PLAIN: bool, P: Probe>(&self, size_px: [u32; 2], walk: &mut Walk, y: u16, tap: &mut Tap<P>) {
        let at = self.offsets::<PLAIN, P>(size_px, &walk.input, y, tap);
        self.seed::<PLAIN, P>(walk, at, tap);
        walk.skip_columns();
    }

    /// Seeds the box's first pixel and goes from there to row `y`.
    #[inline(always)]
    fn begin_box<const PLAIN: bool, P: Probe>(&self, size_px: [u32; 2], walk: &mut Walk, y: u16, tap: &mut Tap<P>) {
        let input = walk.input;
        let at = self.offsets::<PLAIN, P>(size_px, &input, input.rows[0], tap);
        self.seed::<PLAIN, P>(walk, at, tap);
        let [xy, yy] = [i64::from(input.conic[1]), i64::from(input.conic[2])];
        let by_row = (2 * yy * at[1]) + (yy << self.words.offset) + 2 * xy * at[0];
        walk.by_row = self.radial_register.load(tap.fit_plain::<PLAIN>(&self.first, by_row), self.words.first);
        walk.by_row_twice = self.second::<PLAIN, P>(input.conic[2], tap);
        walk.by_both = self.second::<PLAIN, P>(input.conic[1], tap);
        let rows = i64::from(y - input.rows[0]);
        if rows > 0 {
            walk.radial = after(walk.radial, walk.by_row, walk.by_row_twice, rows);
            walk.by_column = walk.by_column.wrapping_add(walk.by_both.wrapping_mul(rows));
            walk.by_row = walk.by_row.wrapping_add(walk.by_row_twice.wrapping_mul(rows));
            walk.depth = walk.depth.wrapping_add(walk.depth_by[1].wrapping_mul(rows));
        }
        walk.skip_columns();
    }

    #[inline(always)]
    fn second<const PLAIN: bool, P: Probe>(&self, conic: i32, tap: &mut Tap<P>) -> Held {
        self.radial_register.load(tap.fit_plain::<PLAIN>(&self.second, 2 * i64::from(conic)), self.words.second)
    }

    /// Adds the fragments of `columns` pixels from where the walk stands, which is pixel number `pixel` of the square.
    #[inline(always)]
    pub fn span<P: Probe>(&self, walk: &Walk, cutoff: Held, pixel: usize, columns: usize, span: &mut Span, tap: &mut Tap<P>) {
        let (mut radial, mut first, mut depth) = (walk.radial, walk.by_column, walk.depth);
        let mut fragments = span.fragments;
        for column in 0..columns {
            debug_assert!(fragments < SPAN_FRAGMENTS, "more fragments than pixels");
            let kept = fragments & (SPAN_FRAGMENTS - 1);
            span.pixel[kept] = (pixel + column) as u8;
            span.radial[kept] = radial;
            span.depth[kept] = depth;
            fragments += usize::from(radial < cutoff);
            if P::WORDS && radial.checked_add(first).is_none() {
                tap.probe.wrapped(self.radial.signal, 1);
            }
            radial = radial.wrapping_add(first);
            first = first.wrapping_add(walk.by_column_twice);
            depth = depth.wrapping_add(walk.depth_by[0]);
        }
        span.fragments = fragments;
    }

    /// r (`raster.radial`), and z clamped to what the disc can reach (shape: [`Raster::depth_exact`]), of eight of a span's fragments.
    #[inline(always)]
    pub fn fragments<L: Lanes>(&self, walk: &Walk, span: &Span, first: usize) -> [L; 2] {
        let held = |all: &[Held]| L::from_array(all[first..first + LANES].try_into().unwrap_or([0; LANES]));
        let depth = self.depth_register.read_lanes(held(&span.depth)).left(self.words.clamp[0]);
        [self.radial_register.read_lanes(held(&span.radial)), depth.max(L::splat(walk.nearest)).min(L::splat(walk.deepest))]
    }

    /// The box's first pixel centre of row `y`, from the splat's centre.
    #[inline(always)]
    fn offsets<const PLAIN: bool, P: Probe>(&self, size_px: [u32; 2], input: &Input, y: u16, tap: &mut Tap<P>) -> [i64; 2] {
        let pixel = [input.columns[0], y];
        let from_middle = two!(axis => 2 * i64::from(pixel[axis]) + 1 - i64::from(size_px[axis]));
        let from_centre = two!(axis => (from_middle[axis] << (self.words.pixel - 1)) - i64::from(input.pixel[axis]));
        two!(axis => tap.fit_plain::<PLAIN>(&self.offset, from_centre[axis]))
    }

    /// r, its first difference by column, and z, at an offset from the centre.
    #[inline(always)]
    fn seed<const PLAIN: bool, P: Probe>(&self, walk: &mut Walk, at: [i64; 2], tap: &mut Tap<P>) {
        let input = &walk.input;
        let [xx, xy, yy] = three!(i => i64::from(input.conic[i]));
        let [x, y] = at;
        let across = 2 * xy * y;
        let by_x = tap.fit_plain::<PLAIN>(&self.gradient, xx * x + across);
        let by_y = tap.fit_plain::<PLAIN>(&self.gradient, yy * y);
        let first = tap.fit_plain::<PLAIN>(&self.first, 2 * xx * x + (xx << self.words.offset) + across);
        walk.depth = self.depth_seed::<PLAIN, P>(input, at, tap);
        walk.radial = tap.fit_register::<PLAIN>(&self.radial, self.radial_register, x * by_x + y * by_y);
        walk.by_column = self.radial_register.load(first, self.words.first);
    }

    #[inline(always)]
    fn depth_seed<const PLAIN: bool, P: Probe>(&self, input: &Input, at: [i64; 2], tap: &mut Tap<P>) -> i64 {
        let [by_x, by_y] = two!(i => i64::from(input.depth_slope[i]));
        let [lean, camera] = self.words.plane;
        let plane = ((by_x * at[0] + by_y * at[1]) << lean) + (i64::from(input.depth) << camera);
        tap.fit_register::<PLAIN>(&self.depth, self.depth_register, plane)
    }
}

impl Walk {
    /// Goes from the box's first column to where the walk is to stand, in closed form.
    #[inline(always)]
    fn skip_columns(&mut self) {
        if self.skipped > 0 {
            self.radial = after(self.radial, self.by_column, self.by_column_twice, self.skipped);
            self.by_column = self.by_column.wrapping_add(self.by_column_twice.wrapping_mul(self.skipped));
            self.by_row = self.by_row.wrapping_add(self.by_both.wrapping_mul(self.skipped));
            self.depth = self.depth.wrapping_add(self.depth_by[0].wrapping_mul(self.skipped));
        }
    }
}

/// A twice differenced register after `steps` steps, in closed form.
#[inline(always)]
fn after(value: i64, first: i64, second: i64, steps: i64) -> i64 {
    let pairs = steps * (steps - 1) / 2;
    value.wrapping_add(first.wrapping_mul(steps)).wrapping_add(second.wrapping_mul(pairs))
}

pub mod real;

#[cfg(test)]
mod tests;
