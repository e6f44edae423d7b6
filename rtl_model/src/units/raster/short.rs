//! Short: raster in words of 32 bits, eight pixels at a time, for runs that need fragments only.
//! This is not hardware: it is how the simulator draws fast.
//!
//! A pixel is inside where r less the cutoff is below 0. Modulo 2^32 that test is exact if r is
//! known to stay within 2^31 of the cutoff, and its register not to wrap, over a whole part of a
//! box. r is convex along a row or a column of the part. It is therefore at most the greatest of
//! the part's corners, and at least the least of them minus an eighth of its second differences
//! times the squares of the sides.
//!
//! Law: `words_of_32_bits_walk_as_wide_ones_do`.

use super::{BoxParts, EnteredBoxes, Input, Raster, Rows, SIDE_PX, Splats, first_bits, magnitude};
use crate::num::register::RegisterBits;
use crate::num::{LANES, Lanes, Words, two};
use crate::probe::{Probe, Tap};

/// Eight splats where their boxes enter a square of 16 × 16 pixels, in words of 32 bits.
#[derive(Clone, Copy, Debug)]
pub struct ShortWalks {
    /// Parts of the boxes in the square.
    columns: [i32; LANES],
    rows: [i32; LANES],
    /// The part's first pixel in the square: 16 · row + column.
    first_pixel: [i32; LANES],
    /// Columns and rows of the box before the part.
    on: [[i32; LANES]; 2],
    /// r less the cutoff at the first pixel, with its differences.
    beyond: [i32; LANES],
    by_column: [i32; LANES],
    by_column_twice: [i32; LANES],
    by_row: [i32; LANES],
    by_row_twice: [i32; LANES],
    by_both: [i32; LANES],
    /// z there, unclamped, with its differences, at the fraction bits of its register.
    depth: [i32; LANES],
    depth_by: [[i32; LANES]; 2],
    /// The depth clamp (shape: [`Raster::depth_exact`]).
    nearest: [i32; LANES],
    deepest: [i32; LANES],
}

/// Seeds of each row: r less the cutoff, its difference by column, and z at each row's first pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShortRows {
    beyond: [[i32; LANES]; 2],
    by_column: [[i32; LANES]; 2],
    depth: [[i32; LANES]; 2],
}

/// Arrangement of eight pixels that are tested together.
#[derive(Debug)]
pub struct BlockShape {
    rows: usize,
    first_column: usize,
    column: [i32; LANES],
    /// n(n−1)/2 for each column n.
    pairs: [i32; LANES],
    /// −1 in the second row.
    second: [i32; LANES],
    /// Increments to the next rows: multiples of by_row, and of by_row_twice.
    by_row: [i32; LANES],
    by_row_twice: [i32; LANES],
    /// Place of each pixel: 16 · row + column.
    place: [i32; LANES],
}

impl BlockShape {
    const fn new(rows: usize, first_column: usize) -> Self {
        let (mut shape, mut lane) = (
            BlockShape {
                rows,
                first_column,
                column: [0; LANES],
                pairs: [0; LANES],
                second: [0; LANES],
                by_row: [rows as i32; LANES],
                by_row_twice: [0; LANES],
                place: [0; LANES],
            },
            0,
        );
        while lane < LANES {
            let (row, column) = (lane * rows / LANES, first_column + lane % (LANES / rows));
            shape.column[lane] = column as i32;
            shape.pairs[lane] = (column * column.saturating_sub(1) / 2) as i32;
            shape.second[lane] = -(row as i32);
            // From row j to j + 2: by_row twice and by_row_twice once, and by_row_twice twice more
            // where by_row already includes it once.
            shape.by_row_twice[lane] = (rows as i32 - 1) * (1 + 2 * row as i32);
            shape.place[lane] = (SIDE_PX * row + column) as i32;
            lane += 1;
        }
        shape
    }

    /// Shapes that cover a part with this many columns.
    #[inline(always)]
    pub fn of(columns: usize) -> &'static [BlockShape] {
        static SHAPES: [BlockShape; 3] = [
            BlockShape::new(2, 0),
            BlockShape::new(1, 0),
            BlockShape::new(1, LANES),
        ];
        match columns {
            0..=4 => &SHAPES[..1],
            5..=8 => &SHAPES[1..2],
            _ => &SHAPES[1..],
        }
    }

    /// Bit mask of its pixels that are in the first `columns` columns.
    #[inline(always)]
    fn within(&self, columns: usize) -> u8 {
        let row = first_bits(columns - self.first_column);
        if self.rows == 2 { row | row << 4 } else { row }
    }
}

/// A part of a box, eight pixels at a time, starting at its first rows.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<'a, W> {
    shape: &'static BlockShape,
    /// Seeds of the rows, where each row has one.
    seeds: Option<&'a ShortRows>,
    row: usize,
    rows: usize,
    /// Bit mask of pixels in the part's columns.
    within: u8,
    place: W,
    beyond: W,
    by_rows: W,
    by_rows_twice: W,
    /// Sum of a row's second differences by column.
    bend: W,
    depth: W,
    depth_by_rows: W,
    depth_by_column: W,
}

impl<W: Words> Blocks<'_, W> {
    /// Bit mask of the pixels that make a fragment, among those for which a condition holds.
    #[inline(always)]
    pub fn inside(&self, condition: W) -> u8 {
        let inside = (self.beyond & condition).signs() & self.within;
        if self.row + self.shape.rows > self.rows {
            inside & 0xf
        } else {
            inside
        }
    }

    /// Places of the pixels in the square: 16 · row + column.
    #[inline(always)]
    pub fn pixels(&self) -> W {
        self.place
    }

    /// Moves to the next rows; returns whether there are any.
    #[inline(always)]
    pub fn go_on(&mut self) -> bool {
        self.row += self.shape.rows;
        if self.row >= self.rows {
            return false;
        }
        self.place = self.place + W::splat((SIDE_PX * self.shape.rows) as i64);
        if let Some(seeds) = self.seeds {
            self.seed(seeds);
        } else {
            self.beyond = self.beyond.wrapping_add(self.by_rows);
            self.by_rows = self.by_rows.wrapping_add(self.by_rows_twice);
            self.depth = self.depth.wrapping_add(self.depth_by_rows);
        }
        true
    }

    /// Loads rows from their seeds.
    #[inline(always)]
    fn seed(&mut self, seeds: &ShortRows) {
        let eight = self.row / LANES % 2;
        let rows = W::splat(self.row as i64) - W::from_array(self.shape.second);
        let by_column = W::from_array(seeds.by_column[eight]).pick(rows);
        let along = by_column
            .wrapping_times(W::from_array(self.shape.column))
            .wrapping_add(self.bend);
        self.beyond = W::from_array(seeds.beyond[eight])
            .pick(rows)
            .wrapping_add(along);
        self.depth = W::from_array(seeds.depth[eight])
            .pick(rows)
            .wrapping_add(self.depth_by_column);
    }
}

impl ShortWalks {
    /// Columns of a splat's part.
    #[inline(always)]
    pub fn columns(&self, lane: usize) -> usize {
        self.columns[lane] as usize
    }
}

impl Raster {
    /// Whether words of 31 bits hold r less a cutoff, and every clamped depth.
    pub fn is_short(&self, cutoff: RegisterBits) -> bool {
        self.radial_register.read(cutoff) <= 1 << 30 && self.short_depth > 0
    }

    /// [`Raster::enter`] in words of 32 bits, for a cutoff for which [`Raster::is_short`] holds;
    /// also returns a bit mask of the splats that they hold. Where each row has a seed,
    /// [`Raster::short_rows`] decides that.
    #[inline(always)]
    pub fn enter_short<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        square: [u16; 2],
        inputs: &[&Input; LANES],
        cutoff: RegisterBits,
        tap: &mut Tap<P>,
    ) -> (ShortWalks, u8) {
        let splats = Splats::<L>::of(inputs);
        let parts = BoxParts::<L>::of(square, inputs, &splats);
        let [nearest, deepest] = self.clamps(inputs, &splats);
        let by_column_twice = self.second(splats.conic[0], tap);
        let bend = self.radial_register.read_lanes(by_column_twice);
        let slopes = two!(axis => splats.depth_slope[axis].left(self.places.depth_slope));
        let mut walks = ShortWalks {
            columns: parts.size[0].low().to_array(),
            rows: parts.size[1].low().to_array(),
            first_pixel: parts.first_pixel.low().to_array(),
            on: two!(axis => parts.on[axis].low().to_array()),
            by_column_twice: bend.low().to_array(),
            depth_by: two!(axis => slopes[axis].low().to_array()),
            nearest: nearest.low().to_array(),
            deepest: deepest.low().to_array(),
            // Each row has its own value.
            beyond: [0; LANES],
            by_column: [0; LANES],
            by_row: [0; LANES],
            by_row_twice: [0; LANES],
            by_both: [0; LANES],
            depth: [0; LANES],
        };
        if self.rows == Rows::Seeded {
            return (walks, u8::MAX);
        }
        let EnteredBoxes {
            seed,
            by_row,
            by_row_twice,
            by_both,
        } = self.enter_boxes(size_px, &splats, by_column_twice, parts.on, tap);
        let [radial, by_column] = [
            self.radial_register.read_lanes(seed.radial),
            self.radial_register.read_lanes(seed.by_column),
        ];
        let [by_row, twist] = [
            self.radial_register.read_lanes(by_row),
            self.radial_register.read_lanes(by_both),
        ];
        let bend_down = self.radial_register.read_lanes(by_row_twice);
        let [on, down] = two!(axis => parts.size[axis] - L::splat(1));
        let ([along, dip], [across, dip_down]) =
            (side(by_column, bend, on), side(by_row, bend_down, down));
        let both = twist.times(on * down);
        let corners = [
            radial,
            radial + along,
            radial + across,
            radial + along + across + both,
        ];
        let cutoff = self.radial_register.read(cutoff);
        let held = self.stays(corners, dip + dip_down, cutoff)
            & self.are_short(seed.depth, magnitude(slopes[0]) + magnitude(slopes[1]));
        walks.beyond = (radial - L::splat(cutoff)).low().to_array();
        walks.by_column = by_column.low().to_array();
        walks.by_row = by_row.low().to_array();
        walks.by_row_twice = bend_down.low().to_array();
        walks.by_both = twist.low().to_array();
        walks.depth = self.depth_register.read_lanes(seed.depth).low().to_array();
        (walks, held.signs() & !(bend | bend_down).signs())
    }

    /// Lanes in which words of 32 bits hold r less the cutoff between these corners and no register
    /// wraps. r is at most an eighth of `dip` below the corners.
    #[inline(always)]
    fn stays<L: Lanes>(&self, [a, b, c, d]: [L; 4], dip: L, cutoff: i64) -> L {
        const REACH: i64 = 1 << 31;
        let [min, max] = self.radial.limits();
        let greatest = a.max(b).max(c.max(d));
        let least = a.min(b).min(c.min(d)) - dip.right(3);
        L::splat((max + 1).min(cutoff + REACH)).above(greatest)
            & least.above(L::splat(min.max(cutoff - REACH) - 1))
    }

    /// Whether z, from a register's value, stays short in a square with this sum of steps.
    #[inline(always)]
    fn are_short<L: Lanes>(&self, held: L, steps: L) -> L {
        // 64 bits hold this, as elaboration checks: words of at most 48 bits, and two of 32 bits
        // shifted up by less than 20.
        let farthest =
            steps.left(SIDE_PX.ilog2()) + magnitude(self.depth_register.read_lanes(held));
        L::splat(self.short_depth).above(farthest)
    }

    /// Seeds the rows of one of the splats, where each row has a seed; false where words of 32 bits
    /// do not hold one.
    #[inline(always)]
    #[must_use]
    #[expect(clippy::too_many_arguments, reason = "as `span`")]
    pub fn short_rows<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        walks: &ShortWalks,
        lane: usize,
        input: &Input,
        cutoff: RegisterBits,
        rows: &mut ShortRows,
        tap: &mut Tap<P>,
    ) -> bool {
        if self.rows == Rows::Differenced {
            return true;
        }
        let splat = Splats::<L>::all(input);
        let by_column_twice = self.second(splat.conic[0], tap);
        let bend = self.radial_register.read_lanes(by_column_twice);
        let depth_by_column = self
            .depth_register
            .load_lanes(splat.depth_slope[0], self.places.depth_slope);
        let steps = magnitude(splat.depth_slope[0]).left(self.places.depth_slope);
        let cutoff = self.radial_register.read(cutoff);
        let [columns_on, rows_on] = two!(axis => L::splat(walks.on[axis][lane].into()));
        let on = L::splat(i64::from(walks.columns[lane]) - 1);
        let in_part = (walks.rows[lane] as usize).min(SIDE_PX);
        for first in (0..in_part).step_by(LANES) {
            let y = splat.first_row
                + rows_on
                + L::splat(first as i64)
                + L::from_array(super::COLUMNS[0]);
            let seed = self.seed(
                &splat,
                self.offsets(size_px, [splat.first_column, y], &splat, tap),
                tap,
            );
            let seed = seed.skip(by_column_twice, depth_by_column, columns_on);
            let [radial, by_column] = [
                self.radial_register.read_lanes(seed.radial),
                self.radial_register.read_lanes(seed.by_column),
            ];
            let [along, dip] = side(by_column, bend, on);
            let (left, right) = (radial, radial + along);
            let held = self.stays([left, right, left, right], dip, cutoff)
                & self.are_short(seed.depth, steps);
            if !(held.signs() & !bend.signs()) & first_bits(in_part - first) != 0 {
                return false;
            }
            let eight = first / LANES;
            rows.beyond[eight] = (radial - L::splat(cutoff)).low().to_array();
            rows.by_column[eight] = by_column.low().to_array();
            rows.depth[eight] = self.depth_register.read_lanes(seed.depth).low().to_array();
        }
        true
    }

    /// Starts with one of the splats that words of 32 bits hold.
    #[inline(always)]
    pub fn blocks<'a, W: Words>(
        &self,
        walks: &ShortWalks,
        lane: usize,
        rows: &'a ShortRows,
        shape: &'static BlockShape,
    ) -> Blocks<'a, W> {
        let columns = W::from_array(shape.column);
        // No closure: see `three`.
        macro_rules! word {
            ($($field:tt)+) => {
                W::splat(walks.$($field)+[lane].into())
            };
        }
        let bend = word!(by_column_twice).wrapping_times(W::from_array(shape.pairs));
        let mut blocks = Blocks {
            shape,
            seeds: (self.rows == Rows::Seeded).then_some(rows),
            row: 0,
            rows: (walks.rows[lane] as usize).min(SIDE_PX),
            within: shape.within(walks.columns(lane)),
            place: W::from_array(shape.place) + word!(first_pixel),
            beyond: W::splat(0),
            by_rows: W::splat(0),
            by_rows_twice: W::splat(0),
            bend,
            depth: W::splat(0),
            depth_by_rows: W::splat(0),
            depth_by_column: word!(depth_by[0]).wrapping_times(columns),
        };
        if self.rows == Rows::Seeded {
            blocks.seed(rows);
            return blocks;
        }
        let second = W::from_array(shape.second);
        let by_row = word!(by_row).wrapping_add(word!(by_both).wrapping_times(columns));
        let along = word!(by_column).wrapping_times(columns).wrapping_add(bend);
        let (by_row_twice, depth_by_row) = (word!(by_row_twice), word!(depth_by[1]));
        let each = W::from_array(shape.by_row);
        blocks.beyond = word!(beyond)
            .wrapping_add(along)
            .wrapping_add(by_row & second);
        blocks.by_rows = by_row
            .wrapping_times(each)
            .wrapping_add(by_row_twice.wrapping_times(W::from_array(shape.by_row_twice)));
        blocks.by_rows_twice = by_row_twice.wrapping_times(each).wrapping_times(each);
        blocks.depth = word!(depth)
            .wrapping_add(blocks.depth_by_column)
            .wrapping_add(depth_by_row & second);
        blocks.depth_by_rows = depth_by_row.wrapping_times(each);
        blocks
    }

    /// The cutoff for [`Raster::short_fragments`], where [`Raster::is_short`].
    #[inline(always)]
    pub fn short_cutoff<W: Words>(&self, cutoff: RegisterBits) -> W {
        W::splat(self.radial_register.read(cutoff))
    }

    /// r, at least 0, and z clamped to the disc's depth range (shape: [`Raster::depth_exact`]), of
    /// the fragments among a block's pixels.
    #[inline(always)]
    pub fn short_fragments<W: Words>(
        &self,
        walks: &ShortWalks,
        lane: usize,
        blocks: &Blocks<W>,
        cutoff: W,
    ) -> [W; 2] {
        let zero = W::splat(0);
        let radial = (blocks.beyond.min(zero) + cutoff).max(zero);
        let (nearest, deepest) = (
            W::splat(walks.nearest[lane].into()),
            W::splat(walks.deepest[lane].into()),
        );
        [
            radial,
            blocks
                .depth
                .left(self.places.clamp[0])
                .max(nearest)
                .min(deepest),
        ]
    }
}

/// Sum of a first and a second difference along a side of this many steps, and eight times the
/// greatest dip below its ends.
#[inline(always)]
fn side<L: Lanes>(first: L, second: L, steps: L) -> [L; 2] {
    let square = steps * steps;
    let pairs = (square - steps).right_unsigned(1);
    [
        first.times(steps) + second.times(pairs),
        second.times(square),
    ]
}
