//! Bin: decides for each tile of a splat's box whether the splat gets an entry in the tile's list,
//! on a machine whose `bin.test` is not `box`. The same test decides for each subtile whether its bit
//! is set in the mask of an entry.
//!
//! ```text
//! once per splat
//! pixel, box ─►(−)─► offset ─┬─►(× conic)─► greatest slope, r and error in the box ─►[ fits the words? ]─► whole
//!                            └─► reach ─►[ error ]─►(+ cutoff)─► threshold c ─►(× Q00, × Q11)─► limits
//! once per tile
//! offset, tile ─►[ cut to the box ]─► corners ─►(× conic)─► Qd ─┬─► nearest side of a slab ─►( ² )─►[ > limit ]─► beyond
//!                                                               └─► d·Qd, signs along the sides ─►[ ellipse ]─► outside
//! ```
//! A tile is rejected only if no pixel of it that is in the splat's box can have r below the
//! cutoff. Let R be the rectangle between the outermost pixel centres of this part of the box, d an
//! offset from the splat's centre, and q(d) = d·Qd in exact arithmetic on the words of the record.
//!
//! *oriented-box*. As q(d)·Q00 − (Qd)_x² = det Q · d_y², and det Q ≥ 0, a d with (Qd)_x² > c·Q00
//! has q(d) > c. The lines (Qd)_x = ±√(c·Q00) touch the ellipse q = c, as do (Qd)_y = ±√(c·Q11).
//! Both pairs follow the long axis of a thin ellipse: by the direction Q·e_x, one step of the power
//! iteration, the pair is wider than that of the axis by a factor of at most √(1 + 1/aspect²), for
//! the larger of Q00 and Q11. With the sides of the box itself they are the turned box. R is
//! rejected if it is beyond one of the four lines; Qd is linear, so the corners decide.
//!
//! *ellipse* also rejects R if q ≥ c at all four corners and no side of R has a point where q is
//! stationary along the side. That is exact: q is convex, so its minimum over R is at a corner, at
//! a stationary point of a side, or in the centre. If the centre is in R, a side has a stationary
//! point. Proof: the line (Qd)_y = 0 through the centre is flatter than the line (Qd)_x = 0, as
//! Q01² ≤ Q00·Q11. If the first leaves R through a vertical side, q is stationary there. Otherwise
//! it leaves through a horizontal side, the steeper one leaves through the same side before it, and
//! q is stationary there.
//!
//! *Error of the rasteriser.* It starts at offsets of whole pixels from `raster.offset`, as this
//! unit does, so both have the same d. Its r differs from q(d) by
//! - (|d_x| + |d_y|)·g for two products with rounded words of `raster.gradient`, each wrong by at
//!   most g. The corners of this unit have the same products, and the same error again;
//! - f for each step by a rounded `raster.first`, at most 2·(reach_x + reach_y) steps;
//! - the rounding of the seed in `raster.radial`;
//! - nothing for `raster.second`: a machine that rounds it is refused.
//!
//! So c = cutoff + (reach_x + reach_y)·2^k + rounding of the seed, where 2^k ≥ 2g + 2f, rounded up.
//!
//! *Words that do not hold the box.* If an offset, a slope, a difference or r of some pixel of the
//! box may not fit its word, the rasteriser saturates or wraps there, and no bound holds: the splat
//! is *whole*, and gets an entry in every tile of its box. The bounds are products of the greatest
//! offsets in the box with magnitudes of the conic. A splat whose conic has a negative determinant
//! (by rounding) is whole too.
//!
//! Losses: the nearest side of a slab is truncated; threshold, limits and bounds are rounded up.
//!
//! Laws: `no_test_of_tiles_or_subtiles_loses_a_pixel`,
//! `an_ellipse_never_has_more_entries_than_its_boxes`.

use crate::elaboration::latency::Path;
use crate::elaboration::masks::Masks;
use crate::elaboration::microarchitecture::BinWords;
use crate::elaboration::{Elaboration, Operator, Part};
use crate::graph::{Builder, Graph, Wire};
use crate::machine::{BinTest, Machine, MaskMaker, Rows};
use crate::num::{Exact, Format, Rounding, Word, two};
use crate::records::{MIDDLE, PIXEL_BITS, PLACE, unit};

const UNIT: &str = unit::BIN;

/// Widest operand of a product here, bits.
const OPERAND_BITS: i32 = 31;

/// Inputs of the graph of a splat: pixel, conic, first and last column, first and last row; then
/// [`registers`].
pub const SPLAT_INPUTS: usize = 9;
/// Results of the graph of a splat: offset of its box's first pixel, threshold, both limits, whole.
pub const SPLAT_OUTPUTS: usize = 6;
/// Inputs of the graph of a tile: the conic, the results of the splat, and the part of the box in
/// the tile: first and last column, first and last row, counted from the box's first.
pub const TILE_INPUTS: usize = 3 + SPLAT_OUTPUTS + 4;

/// Registers of a frame, in the order of the graph's inputs: cutoff, and (pixels − 1)/2 of both
/// sides of the picture.
pub fn registers(cutoff: i64, size_px: [u32; 2]) -> [i64; 3] {
    let [width, height] = size_px.map(|pixels| i64::from(pixels) - 1);
    [cutoff, width, height]
}

impl BinWords {
    /// Those of a machine that tests tiles.
    pub fn of(machine: &Machine) -> Option<Self> {
        let test = machine.bin.map_or(BinTest::Box, |bin| bin.test);
        (test != BinTest::Box).then_some(BinWords {
            test,
            rows: machine.raster.rows,
            pixel: machine.project.pixel,
            conic: machine.ellipse.conic,
            conic_cross: machine.ellipse.conic_cross,
            cutoff: machine.raster.cutoff,
            offset: machine.raster.offset,
            gradient: machine.raster.gradient,
            radial: machine.raster.radial,
            first: machine.raster.first,
            second: machine.raster.second,
        })
    }

    /// Refuses words that the test cannot use, and declares the parts of the tests of tiles, and of
    /// those of subtiles: for a number of tiles per cycle, 0 if `bin` tests none, and for a number of
    /// engines.
    pub fn declare(&self, masks: Option<Masks>, [tiles, engines]: [u32; 2], e: &mut Elaboration) {
        for (name, word) in [
            ("raster.offset", self.offset),
            ("raster.gradient", self.gradient),
            ("ellipse.conic", self.conic),
            ("ellipse.conic_cross", self.conic_cross),
        ] {
            e.require(!word.format.is_float(), || {
                format!("bin.test counts the last places of {name}, but {word} is floating point: use bin.test `box`, or fixed point")
            });
            e.require(word.format.width() <= OPERAND_BITS, || {
                format!(
                    "bin.test multiplies {name}, which is {word}: it can have at most {OPERAND_BITS} bits"
                )
            });
        }
        let doubled = self.conic.format.frac_bits - 1;
        e.require(self.second.format.frac_bits >= doubled, || {
            let fits = Format { frac_bits: doubled, ..self.second.format };
            format!("bin.test needs second differences without an error, but raster.second is {}: {fits} would hold twice ellipse.conic", self.second)
        });
        let is_even =
            self.offset.round == Rounding::NearestEven && self.offset.format.frac_bits < 1;
        e.require(!is_even, || {
            format!("bin.test needs offsets of whole pixels from each other, but raster.offset is {} and rounds ties to even: let it round to nearest, or have a fraction bit", self.offset)
        });
        e.require(self.rows != Rows::Direct, || {
            "bin.test bounds the error of differences, but raster.rows is direct: use bin.test `box`, or raster.rows `seeded`".into()
        });
        if !e.errors.is_empty() {
            return;
        }
        let in_bin = masks.filter(|masks| masks.made == MaskMaker::Bin);
        if tiles > 0 {
            self.declare_tests((UNIT, 1), (in_bin, tiles), e);
        }
        if let Some(in_list) = masks.filter(|masks| masks.made == MaskMaker::List) {
            self.declare_tests((unit::LIST, engines), (Some(in_list), 1), e);
        }
    }

    /// Parts of the tests in a unit: of some tiles at a time, or of the subtiles of their masks.
    fn declare_tests(
        &self,
        (unit, copies): (&'static str, u32),
        (masks, tiles): (Option<Masks>, u32),
        e: &mut Elaboration,
    ) {
        // No probe observes its words, so they are no signals.
        let own = &mut Elaboration::default();
        self.splat_in(own);
        // The splat that is tested: conic, results of its graph, box.
        let held = self.splat_bits() + self.tile_bits();
        own.part(UNIT, Operator::Register(held));
        own.part(UNIT, Operator::Hold(held));
        own.copies(tiles * masks.map_or(1, |masks| masks.tests), |own| {
            self.tile_in(own);
            // Tiles are counted; the tile's far side, and the part of the box in it.
            own.copies(2, |own| {
                own.part(UNIT, Operator::Register(PIXEL_BITS));
                own.choice(UNIT, 2, PIXEL_BITS);
                own.adders(UNIT, 4, PIXEL_BITS);
                own.copies(2, |own| own.limit(UNIT, PIXEL_BITS));
            });
        });
        // The mask, and the bits that are set in a cycle.
        if let Some(masks) = masks {
            own.copies(tiles, |own| {
                own.part(UNIT, Operator::Register(masks.bits as i32));
                own.choice(UNIT, 2, masks.bits as i32);
            });
        }
        e.errors.append(&mut own.errors);
        e.parts.extend(own.parts.drain(..).map(|part| Part {
            unit,
            copies: part.copies * copies,
            ..part
        }));
    }

    fn conic_bits(&self) -> i32 {
        2 * self.conic.format.width() + self.conic_cross.format.width()
    }

    /// Bits of a splat before the test.
    pub fn splat_bits(&self) -> i32 {
        2 * self.pixel.format.width() + self.conic_bits() + 4 * PIXEL_BITS
    }

    /// Bits of what the tests of its tiles use.
    pub fn tile_bits(&self) -> i32 {
        let [threshold, limit] = [self.threshold(), self.limit()].map(Format::width);
        self.conic_bits() + 2 * self.offset.format.width() + threshold + 2 * limit + 1
    }

    /// Critical path: from a splat to its first entry.
    pub fn path(&self) -> Path {
        self.splat().path().then(self.tile().path())
    }

    /// Format of the threshold: twice the cutoff's range, because the error may be as large.
    fn threshold(&self) -> Format {
        let int_bits = self.cutoff.format.int_bits + 1;
        let finest = self.offset.format.frac_bits + self.gradient.format.frac_bits;
        Format::unsigned(int_bits, finest.min(OPERAND_BITS - 1 - int_bits).max(0))
    }

    /// Format of a limit, threshold · Q00.
    fn limit(&self) -> Format {
        let exact = Exact::from(self.threshold()).times(self.conic);
        let frac_bits = exact
            .frac_bits
            .min(2 * self.gradient.format.frac_bits)
            .min(44 - exact.int_bits)
            .max(0);
        Format::unsigned(exact.int_bits.max(1 - frac_bits), frac_bits)
    }

    /// Format of the nearest side of a slab, whose square meets a limit. Greater ones saturate.
    fn slab(&self) -> Format {
        let (gradient, limit) = (self.gradient.format, self.limit());
        let int_bits = (limit.int_bits + 1).div_euclid(2) + 1;
        let frac_bits = gradient
            .frac_bits
            .min((limit.frac_bits + 1) / 2)
            .min(OPERAND_BITS - 1 - int_bits)
            .max(0);
        Format::unsigned(int_bits.max(1 - frac_bits), frac_bits)
    }

    /// The power of two that bounds the error of a seed and of its steps, per pixel of reach.
    fn error_places(&self) -> Option<i32> {
        let product = self.conic.format.frac_bits + self.offset.format.frac_bits;
        let of = |word: Word| error(word, product);
        match [of(self.gradient), of(self.first)] {
            [None, None] => None,
            // 2·2^k, or at most 2·(2^k + 2^k).
            [Some(places), None] | [None, Some(places)] => Some(places + 1),
            [Some(one), Some(other)] => Some(one.max(other) + 2),
        }
    }

    /// What is computed once per splat.
    pub fn splat(&self) -> Graph<SPLAT_OUTPUTS> {
        self.splat_in(&mut Elaboration::default())
    }

    /// The same, with its signals.
    pub fn splat_in(&self, e: &mut Elaboration) -> Graph<SPLAT_OUTPUTS> {
        let g = &mut Builder::new(e, UNIT);
        let pixel = two!(_i => g.input(self.pixel));
        let (xx, xy, yy) = (
            g.input(self.conic),
            g.input(self.conic_cross),
            g.input(self.conic),
        );
        let sides = two!(_axis => [g.state(PLACE, false), g.state(PLACE, false)]);
        let cutoff = g.input(self.cutoff);
        let middle = two!(_axis => g.state(MIDDLE, false));

        // From the centre to the first and the last pixel, and the greater distance.
        let places = Exact::from(self.offset);
        let [least, most] = [self.offset.format.min(), self.offset.format.max()]
            .map(|word| g.constant(word, places));
        let none = g.constant(0, places);
        let mut whole = Vec::new();
        let mut reach = Vec::new();
        let first = two!(axis => {
            let [first, last] = [0, 1].map(|end| {
                let from_middle = g.minus(sides[axis][end], middle[axis]);
                g.minus(from_middle, pixel[axis])
            });
            whole.push(above(g, least, first));
            whole.push(above(g, last, most));
            let [first, last] = [first, last].map(|edge| g.fit("offset", self.offset, edge));
            let back = g.minus(none, first);
            g.elaboration().limit(UNIT, self.offset.format.width());
            let far = g.greater(back, last);
            reach.push(g.not_below_0(far));
            first
        });
        let across = {
            let [cross, back] = [xy, g.constant(0, Exact::from(self.conic_cross))];
            let back = g.minus(back, cross);
            g.elaboration().limit(UNIT, self.conic_cross.format.width());
            let magnitude = g.greater(back, cross);
            g.not_below_0(magnitude)
        };
        let ([x, y], reach) = ([reach[0], reach[1]], g.plus(reach[0], reach[1]));

        // Greatest slopes, first and second differences in the box.
        let slope = two!(axis => {
            let [own, own_reach, other_reach] = if axis == 0 { [xx, x, y] } else { [yy, y, x] };
            let (along, turned) = (g.times(own, own_reach), g.times(across, other_reach));
            let both = g.plus(along, turned);
            // One product of the seed has both turned terms.
            let gradient = if axis == 0 { g.plus(both, turned) } else { along };
            let gradient = self.bound(g, "gradient", gradient, self.gradient, &mut whole);
            let twice = g.scaled(both, 1);
            let difference = g.plus(twice, own);
            self.bound(g, "first", difference, self.first, &mut whole);
            gradient
        });
        for conic in [xx, across, yy] {
            let twice = g.scaled(conic, 1);
            self.bound(g, "second", twice, self.second, &mut whole);
        }

        // r in the box's corners, and the error of r.
        let radial = {
            let (by_x, by_y) = (g.times(x, slope[0]), g.times(y, slope[1]));
            g.plus(by_x, by_y)
        };
        let mut threshold = cutoff;
        let mut radial_and_error = radial;
        let format = self.threshold();
        if let Some(places) = self.error_places() {
            let error = g.scaled(reach, places);
            let error = g.fit(
                "error",
                Word::new(format).rounded(Rounding::Truncate),
                error,
            );
            let largest = g.constant(format.max() - 1, format.into());
            whole.push(above(g, error, largest));
            let error = g.an_ulp_more(error);
            threshold = g.plus(threshold, error);
            radial_and_error = g.plus(radial, error);
        }
        if let Some(places) = error(
            self.radial,
            self.offset.format.frac_bits + self.gradient.format.frac_bits,
        ) {
            let seed = g.constant(
                1,
                Exact {
                    int_bits: places + 1,
                    frac_bits: -places,
                },
            );
            threshold = g.plus(threshold, seed);
            radial_and_error = g.plus(radial_and_error, seed);
        }
        self.bound(g, "radial", radial_and_error, self.radial, &mut whole);
        let threshold = g.fit(
            "threshold",
            Word::new(format).rounded(Rounding::Truncate),
            threshold,
        );
        let largest = g.constant(format.max() - 1, format.into());
        whole.push(above(g, threshold, largest));
        let threshold = g.an_ulp_more(threshold);
        let limit = two!(axis => {
            let product = g.times(threshold, if axis == 0 { xx } else { yy });
            let limit = Word::new(self.limit()).rounded(Rounding::Truncate);
            let limit = g.fit("limit", limit, product);
            g.an_ulp_more(limit)
        });
        let (squares, cross) = (g.times(xx, yy), g.times(xy, xy));
        whole.push(above(g, cross, squares));
        let whole = whole
            .into_iter()
            .reduce(|one, other| g.either(one, other))
            .unwrap_or_default();
        g.build([first[0], first[1], threshold, limit[0], limit[1], whole])
    }

    /// Rounds a magnitude up, and notes where a word may not hold it.
    fn bound(
        &self,
        g: &mut Builder,
        name: &str,
        magnitude: Wire,
        word: Word,
        whole: &mut Vec<Wire>,
    ) -> Wire {
        let places = g.shape(magnitude);
        let frac_bits = places.frac_bits.min(word.format.frac_bits);
        // The sign is one of the bits of the word.
        let int_bits = word.format.int_bits.max(1 - frac_bits);
        let bound = Word::new(Format::unsigned(int_bits, frac_bits)).rounded(Rounding::Truncate);
        let bounded = g.fit(name, bound, magnitude);
        // The largest word is 2^(int_bits − 1) less one ulp, and this is rounded down.
        let largest = (1 << (int_bits - 1 + frac_bits).max(0)) - 2;
        let largest = g.constant(largest, bound.into());
        whole.push(above(g, bounded, largest));
        g.an_ulp_more(bounded)
    }

    /// The test of a tile: whether the splat gets an entry.
    pub fn tile(&self) -> Graph<1> {
        self.tile_in(&mut Elaboration::default())
    }

    /// The same, with its signals.
    pub fn tile_in(&self, e: &mut Elaboration) -> Graph<1> {
        let g = &mut Builder::new(e, UNIT);
        let (xx, xy, yy) = (
            g.input(self.conic),
            g.input(self.conic_cross),
            g.input(self.conic),
        );
        let first = two!(_axis => g.input(self.offset));
        let more = |format: Format| Exact {
            int_bits: format.int_bits + 1,
            frac_bits: format.frac_bits,
        };
        let threshold = g.state(more(self.threshold()), false);
        let limit = two!(_axis => g.state(more(self.limit()), false));
        let whole = g.condition_input();
        let [x, y] = two!(axis => {
            let ends = [g.state(PLACE, false), g.state(PLACE, false)];
            ends.map(|end| {
                let offset = g.plus(first[axis], end);
                g.fit("offset", self.offset, offset)
            })
        });

        // Qd in the corners, by column and row.
        let [[xx_x, xy_x], [xy_y, yy_y]] = [[(xx, x), (xy, x)], [(xy, y), (yy, y)]]
            .map(|pair| pair.map(|(conic, ends)| ends.map(|end| g.times(conic, end))));
        let lean = [[xx_x, xy_y], [xy_x, yy_y]]
            .map(|[of_x, of_y]| of_x.map(|of_x| of_y.map(|of_y| g.plus(of_x, of_y))));
        // The first is above the line in all corners, or below the opposite line.
        let slab = Word::new(self.slab()).rounded(Rounding::Truncate);
        let beyond = two!(axis => {
            let corners = lean[axis].as_flattened();
            let mut nearest = |is_below: bool| {
                let sides = [0, 1, 2, 3].map(|corner| {
                    let side = if is_below { g.negated(corners[corner]) } else { corners[corner] };
                    g.fit("slab", slab, side)
                });
                let [one, two, three, four] = sides;
                g.elaboration().copies(3, |e| e.limit(UNIT, slab.format.width()));
                let (one, three) = (g.lesser(one, two), g.lesser(three, four));
                g.lesser(one, three)
            };
            let [above_it, below_it] = [false, true].map(&mut nearest);
            g.elaboration().limit(UNIT, slab.format.width());
            let nearest = g.greater(above_it, below_it);
            let square = g.times(nearest, nearest);
            above(g, square, limit[axis])
        });
        let mut rejected = g.either(beyond[0], beyond[1]);
        if self.test == BinTest::Ellipse {
            let outside = self.is_outside(g, [x, y], [xx_x, xy_y, yy_y], &lean, threshold);
            rejected = g.either(rejected, outside);
        }
        let accepted = g.not(rejected);
        let listed = g.either(accepted, whole);
        g.build([listed])
    }

    /// Whether a rectangle does not meet the ellipse.
    fn is_outside(
        &self,
        g: &mut Builder,
        [x, y]: [[Wire; 2]; 2],
        [xx_x, xy_y, yy_y]: [[Wire; 2]; 3],
        [lean_x, lean_y]: &[[[Wire; 2]; 2]; 2],
        threshold: Wire,
    ) -> Wire {
        // r = x·(Q00·x + 2·Q01·y) + y·(Q11·y), as the rasteriser seeds it.
        let rows = two!(row => {
            let by_y = g.fit("gradient", self.gradient, yy_y[row]);
            g.times(y[row], by_y)
        });
        let mut outside = Vec::new();
        for column in 0..2 {
            for row in 0..2 {
                let turned = g.scaled(xy_y[row], 1);
                let by_x = g.plus(xx_x[column], turned);
                let by_x = g.fit("gradient", self.gradient, by_x);
                let product = g.times(x[column], by_x);
                let radial = g.plus(product, rows[row]);
                let inside = above(g, threshold, radial);
                outside.push(g.not(inside));
            }
        }
        // Along a side, q falls at its first corner and rises at its last.
        for side in 0..2 {
            for [from, to] in [
                [lean_x[0][side], lean_x[1][side]],
                [lean_y[side][0], lean_y[side][1]],
            ] {
                // A sign is a bit, and 0 takes a gate per bit.
                let none = g.constant(0, g.shape(from));
                let (rises, falls) = (g.above(from, none), g.above(none, to));
                outside.push(g.either(rises, falls));
            }
        }
        outside
            .into_iter()
            .reduce(|one, other| g.both(one, other))
            .unwrap_or_default()
    }
}

/// The power of two that a word is wrong by at most, if it is made from a result with so many
/// fraction bits; none if it holds them.
fn error(word: Word, frac_bits: i32) -> Option<i32> {
    let own = word.format.frac_bits;
    let half = i32::from(word.round != Rounding::Truncate);
    (own < frac_bits).then_some(-own - half)
}

/// A comparison, by an adder.
fn above(g: &mut Builder, a: Wire, b: Wire) -> Wire {
    let difference = g.shape(a).plus(g.shape(b));
    let e = g.elaboration();
    e.holds_exact("a comparison of the test of tiles, bin.test,", difference);
    e.adders(UNIT, 1, difference.bits());
    g.above(a, b)
}

#[cfg(test)]
mod tests;
