//! Raster: walks a splat's box and makes a fragment wherever the radial index is below the cutoff
//! (forward differencing, docs/book/algorithm.md §4).
//!
//! ```text
//! conic ─►[ seed ]─► radial ─►(+)─►(+)─► …   r at each pixel centre; first += second, radial += first: two adds per pixel
//! pixel ─►    │      first  ─►(+)─┘
//!             └────► depth  ─►(+)─► …        z of the tangent plane: one add per pixel; clamped to t_z ± depth_range
//! ```
//! Each row is seeded again, or rows are differenced as pixels are (`rows`). Adds are exact, so the
//! only errors are those of the seed and of the increments: e₀ + n·e₁ + n(n−1)/2·e₂ after n pixels.
//! Both adders wrap. That is harmless inside the footprint as long as the register holds the r of
//! the whole box, whose corners reach 2·cutoff/(1−|ρ|).
//!
//! With [`Rows::Direct`] nothing is differenced but z. Each lane computes the r of its own pixel:
//! ```text
//! pixel ─►(−)─► offset ─►(×)─► square: dx², dx·dy, dy² ─►(× conic)─►(Σ)─► radial ─►[ 0 ≤ r < cutoff? ]
//! ```
//!
//! Because adds are exact, the simulator may change their order. It enters the boxes of eight
//! splats in parallel, directly where they meet a square of 16 × 16 pixels, and steps eight columns
//! of one box from row to row. Depth is computed for fragments only. Without a probe, [`short`]
//! walks most boxes in words of 32 bits.
//!
//! Losses: `offset`, `gradient`, the seeds of `radial` and `depth`, and the differences are rounded
//! to nearest. The radial index is clamped to [0, cutoff) at the output, because differencing may
//! leave it slightly below 0. [`Rows::Direct`] loses bits in `offset`, `square` and `radial`; a
//! pixel whose r is below 0 makes no fragment, as in most published machines.
//!
//! Laws: `stepping_equals_the_closed_form`,
//! `seeded_and_differenced_rows_agree_within_their_guard_bits`,
//! `a_radial_index_below_zero_is_zero`, `direct_pixels_equal_their_products`.

use crate::elaboration::latency::Path;
use crate::elaboration::masks::Masks;
use crate::elaboration::{Elaboration, Operator};
use crate::kernels::ONES;
use crate::machine::timing::Organisation;
use crate::machine::{Machine, Rows};
use crate::num::register::RegisterBits;
use crate::num::{Exact, Fit, Format, LANES, Lanes, MAX_WIDTH_BITS, Register, Word, three, two};
use crate::probe::{Probe, Tap};
use crate::records::unit;

const UNIT: &str = unit::RASTER;

/// Side of the square that boxes are cut to, pixels.
const SIDE_PX: usize = 16;
/// Greatest number of fragments of a span. The array has eight more entries, one vector.
const SPAN_FRAGMENTS: usize = SIDE_PX * SIDE_PX;

/// Input port: one splat. The memory layout is as declared, so that the first eight words are one
/// vector of the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
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

/// Eight splats where their boxes enter a square of 16 × 16 pixels: registers at that pixel, with
/// their differences by column and row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walks {
    /// Part of each box in the square: its first row, and its numbers of columns and rows.
    top: [i64; LANES],
    columns: [i64; LANES],
    rows: [i64; LANES],
    /// Columns of the box before the part.
    columns_on: [i64; LANES],
    /// The part's first pixel in the square: 16 · row + column.
    first_pixel: [i64; LANES],
    /// Used where rows are differenced; otherwise each row has its own.
    seed: Seed<[RegisterBits; LANES]>,
    by_column_twice: [RegisterBits; LANES],
    by_row: [RegisterBits; LANES],
    by_row_twice: [RegisterBits; LANES],
    by_both: [RegisterBits; LANES],
    depth_slope: [[i64; LANES]; 2],
    /// The depth clamp (shape: [`Raster::depth_exact`]).
    nearest: [i64; LANES],
    deepest: [i64; LANES],
}

impl Walks {
    /// Pixels of the square at a [`Span`]'s places: 16 · row + column.
    #[inline(always)]
    pub fn pixels(&self, lane: usize, places: [u8; LANES]) -> [u8; LANES] {
        // Every pixel number is at most 255, so a byte never carries into the next.
        let first = EACH * (self.first_pixel[lane] as u64 & 0xff);
        u64::from_le_bytes(places).wrapping_add(first).to_le_bytes()
    }

    /// The part's first pixel in the square: 16 · row + column.
    pub fn first_pixel(&self, lane: usize) -> u8 {
        (self.first_pixel[lane] & 0xff) as u8
    }

    /// Rows of a splat's box in the tile, and the tile's column at which the box begins.
    pub fn part(&self, lane: usize) -> (usize, usize) {
        (
            self.size(lane)[1],
            self.first_pixel[lane] as usize % SIDE_PX,
        )
    }

    #[inline(always)]
    fn size(&self, lane: usize) -> [usize; 2] {
        [
            self.columns[lane] as usize,
            (self.rows[lane] as usize).min(SIDE_PX),
        ]
    }
}

/// Registers at one pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Seed<T> {
    radial: T,
    by_column: T,
    depth: T,
}

/// Words of eight splats, one vector per field.
#[derive(Clone, Copy, Debug)]
struct Splats<L> {
    pixel: [L; 2],
    conic: [L; 3],
    depth: L,
    depth_slope: [L; 2],
    /// First columns of their boxes.
    first_column: L,
    first_row: L,
}

/// Where eight boxes meet a square.
#[derive(Clone, Copy, Debug)]
struct BoxParts<L> {
    /// Columns and rows of each box before its part in the square.
    on: [L; 2],
    /// Columns and rows of the part.
    size: [L; 2],
    /// Its first pixel in the square: 16 · row + column.
    first_pixel: L,
}

/// Registers of eight splats at the first pixels of their parts, with the increments per row.
#[derive(Clone, Copy, Debug)]
struct EnteredBoxes<L> {
    seed: Seed<L>,
    by_row: L,
    by_row_twice: L,
    by_both: L,
}

/// One word of each of eight splats.
macro_rules! word {
    ($splats:ident.$($field:tt)+) => {{
        let mut words = [0; LANES];
        for lane in 0..LANES {
            words[lane] = i64::from($splats[lane].$($field)+);
        }
        L::from_array(words)
    }};
}

/// Output port: the fragments of one splat in the square.
#[derive(Clone, Debug)]
pub struct Span {
    fragments: usize,
    /// Place of each fragment, from the first pixel of the box's part in the square: 16 · row +
    /// column.
    place: [u8; SPAN_FRAGMENTS + LANES],
    /// r of every pixel of the part, as in its register (`raster.radial`), eight columns per
    /// vector.
    radial: [[[RegisterBits; LANES]; 2]; SIDE_PX],
    /// z of each row's first pixel, unclamped, as in its register (`raster.depth`), where each row
    /// is seeded again.
    depth: [RegisterBits; SIDE_PX],
}

impl Default for Span {
    fn default() -> Self {
        Span {
            fragments: 0,
            place: [0; SPAN_FRAGMENTS + LANES],
            radial: [[[0; LANES]; 2]; SIDE_PX],
            depth: [0; SIDE_PX],
        }
    }
}

impl Span {
    /// Number of fragments.
    #[inline(always)]
    pub fn fragments(&self) -> usize {
        self.fragments
    }

    /// Places of all fragments, from the part's first pixel: 16 · row + column.
    pub fn all(&self) -> &[u8] {
        &self.place[..self.fragments]
    }

    /// Keeps the fragments whose pixels of the square are kept. Not inlined, so that it costs
    /// machines nothing that test no blocks.
    #[inline(never)]
    pub fn retain(&mut self, first_pixel: u8, mut is_kept: impl FnMut(u8) -> bool) {
        let mut kept = 0;
        for nth in 0..self.fragments {
            let place = self.place[nth];
            self.place[kept] = place;
            kept += usize::from(is_kept(place.wrapping_add(first_pixel)));
        }
        self.fragments = kept;
    }

    /// Places of eight fragments, from the part's first pixel: 16 · row + column.
    #[inline(always)]
    pub fn places(&self, first: usize) -> [u8; LANES] {
        let first = first % SPAN_FRAGMENTS;
        self.place[first..first + LANES]
            .try_into()
            .unwrap_or_default()
    }

    /// Keeps the pixels, of eight in a row, that are in the part's `columns` and below the cutoff.
    #[inline(always)]
    fn keep<L: Lanes>(&mut self, [row, eight]: [usize; 2], radial: L, cutoff: L, columns: u8) {
        let inside = cutoff.above(radial).signs() & columns;
        let places = ONES[usize::from(inside)] + EACH * (SIDE_PX * row + LANES * eight) as u64;
        // There are no more fragments than pixels, so eight more always fit.
        let kept = self.fragments % SPAN_FRAGMENTS;
        self.place[kept..kept + LANES].copy_from_slice(&places.to_le_bytes());
        self.radial[row][eight] = radial.to_array();
        self.fragments += inside.count_ones() as usize;
    }
}

/// 1 in each byte.
const EACH: u64 = 0x0101_0101_0101_0101;

/// Columns of the square, eight at a time.
const COLUMNS: [[i64; LANES]; 2] = [[0, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 12, 13, 14, 15]];
/// n(n−1)/2 for each column n.
const PAIRS: [[i64; LANES]; 2] = [
    [0, 0, 1, 3, 6, 10, 15, 21],
    [28, 36, 45, 55, 66, 78, 91, 105],
];

/// n(n−1)/2 for each number of steps across the square.
const PAIRS_BEFORE: [i64; SIDE_PX + 1] = [
    0, 0, 1, 3, 6, 10, 15, 21, 28, 36, 45, 55, 66, 78, 91, 105, 120,
];

/// Bits of a column or a row: a picture has up to 16384.
const PIXEL_BITS: i32 = 14;

/// The word of dx², dx·dy and dy²: the machine's, or one that holds them exactly.
pub fn square(machine: &Machine) -> Word {
    let offset = Exact::from(machine.raster.offset);
    let exact = offset.times(offset);
    // A sign, and the square of the least offset. One that is too wide is refused.
    let int_bits = (exact.int_bits + 2).min(MAX_WIDTH_BITS - exact.frac_bits);
    (machine.raster.square).unwrap_or_else(|| Word::new(Format::signed(int_bits, exact.frac_bits)))
}

/// Critical path: offset, gradient, seed, compare; or offset, square, r, compare.
pub fn path(machine: &Machine) -> Path {
    let m = &machine.raster;
    let bits = |word: Word| word.format.width();
    let (offset, gradient, conic) = (
        bits(m.offset),
        bits(m.gradient),
        bits(machine.ellipse.conic),
    );
    let at_offset = Path::default()
        .sum(bits(machine.project.pixel))
        .fit_word(m.offset, bits(machine.project.pixel));
    if m.rows == Rows::Direct {
        let square = square(machine);
        return at_offset
            .product_of(m.offset, m.offset)
            .fit_word(square, 2 * offset)
            .product_of(machine.ellipse.conic, square)
            .sum_of_three(conic + bits(square))
            .fit(bits(m.radial))
            .sum(bits(m.radial));
    }
    let seed = at_offset
        .product_of(machine.ellipse.conic, m.offset)
        .sum(conic + offset)
        .fit_word(m.gradient, conic + offset)
        .product_of(m.offset, m.gradient)
        .sum(offset + gradient)
        .fit(bits(m.radial));
    // To a tile: products are ready with the seed, and sums take no extra cycles. Down and across
    // use two rows of carries.
    let on = Path {
        cycles: 0,
        ..Path::default().sum_of_three(bits(m.radial))
    };
    let on = if cuts_boxes(machine) {
        on
    } else {
        Path::default()
    };
    seed.then(on).sum(bits(m.radial))
}

/// Whether boxes are cut to tiles, so that seeds are moved to each tile.
fn cuts_boxes(machine: &Machine) -> bool {
    machine.timing.organisation == Organisation::Binned
}

/// Number of directions in which registers of r are stepped.
fn directions(rows: Rows) -> u32 {
    match rows {
        Rows::Direct => 0,
        Rows::Seeded => 1,
        Rows::Differenced => 2,
    }
}

/// Logic in one cycle: from a pixel's registers to those of the next pixel, which come from a seed,
/// the next column or the next row. The next pixel is selected before its seed is ready, except
/// that a box cut to a tile needs its sides first.
pub fn stamp(machine: &Machine) -> Path {
    let m = &machine.raster;
    let radial = directions(m.rows).min(1) as i32 * m.radial.format.width();
    let registers = Path::default()
        .choose(2)
        .sum(radial.max(m.depth.format.width()))
        .choose(2);
    let sides = Path::default()
        .choose(2)
        .limit(PIXEL_BITS)
        .sum(PIXEL_BITS)
        .choose(2);
    // The next run of a mask is found while the current one is walked: the first bit, its row, the
    // end of the run there.
    let runs = Masks::of(machine).map_or(Path::default(), |masks| {
        Path::default()
            .compare(masks.bits as i32)
            .choose(masks.across())
            .compare(masks.across() as i32)
    });
    if cuts_boxes(machine) {
        registers.parallel(sides).parallel(runs)
    } else {
        registers
    }
}

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Raster {
    rows: Rows,
    offset: Fit,
    /// Of [`Rows::Direct`], which uses none of `gradient`, `first` and `second`.
    square: Option<Fit>,
    gradient: Fit,
    radial: Fit,
    first: Fit,
    second: Fit,
    depth: Fit,
    radial_register: Register,
    depth_register: Register,
    places: Alignment,
    /// Limit of z below which z and all its partial sums fit in 31 bits at every place; 0 where
    /// there is no clamp, and for [`Rows::Direct`].
    short_depth: i64,
}

/// Left shifts that align words.
#[derive(Clone, Copy, Debug)]
struct Alignment {
    /// Fraction bits of positions, and of offsets.
    pixel: u32,
    offset: u32,
    /// [`Raster::doubles`].
    doubles: u32,
    /// To the fraction bits of the register `radial`.
    cutoff: u32,
    first: u32,
    second: u32,
    /// To the fraction bits of the register `depth`.
    depth_slope: u32,
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
        let is_direct = m.rows == Rows::Direct;
        let f = |word: Word| word.format.frac_bits;
        for (name, word, signed) in [("cutoff", m.cutoff, false), ("offset", m.offset, true)] {
            e.number(UNIT, name, word, signed);
        }
        for (name, word) in [("radial", m.radial), ("depth", m.depth)] {
            e.signedness(UNIT, name, word, true);
            e.fixed_point(UNIT, name, word);
        }
        e.fixed_point(UNIT, "cutoff", m.cutoff);
        e.within(UNIT, "most_cutoff", m.most_cutoff.unwrap_or(32), 1, 32);
        e.holds_one(UNIT, "offset", m.offset);
        if is_direct {
            let offset = m.offset.format.width();
            e.require(m.square.is_some() || 2 * offset < MAX_WIDTH_BITS, || {
                format!("raster.square is left out, but exact squares of raster.offset {} need {} bits, and {MAX_WIDTH_BITS} can be held: give raster.square", m.offset, 2 * offset + 1)
            });
            let square = square(machine);
            e.number(UNIT, "square", square, true);
        } else {
            e.port(UNIT, "gradient", m.gradient);
            for (name, word) in [
                ("gradient", m.gradient),
                ("first", m.first),
                ("second", m.second),
            ] {
                e.signedness(UNIT, name, word, true);
            }
            for (name, word) in [("first", m.first), ("second", m.second)] {
                e.fixed_point(UNIT, name, word);
            }
            e.require(m.square.is_none(), || {
                "raster.square is given, but only raster.rows `direct` uses it".into()
            });
        }
        let differences = [("first", m.first), ("second", m.second)];
        let differences = differences.into_iter().filter(|_| !is_direct);
        for (name, word) in differences.chain([("cutoff", m.cutoff)]) {
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
        let bits = |word: Word| word.format.stored_bits();
        // The splat is held while it is walked.
        let held = 2 * (bits(pixel) + bits(s.conic) + bits(s.depth_slope))
            + bits(s.conic_cross)
            + bits(machine.project.depth)
            + bits(s.depth_range)
            + 4 * PIXEL_BITS;
        e.part(UNIT, Operator::Register(held));
        e.choice(UNIT, 2, held);
        // Column and row: loaded, counted, compared with the last.
        e.copies(2, |e| {
            e.part(UNIT, Operator::Register(PIXEL_BITS));
            e.choice(UNIT, 3, PIXEL_BITS);
            e.adders(UNIT, 2, PIXEL_BITS);
        });
        // The picture's middle is up to 8192 pixels from its first pixel.
        let middle = Exact {
            int_bits: 14,
            frac_bits: 1,
        };
        let offset = e.copies(2, |e| {
            e.adders(UNIT, 1, middle.bits());
            let sum = e.sum(UNIT, [pixel.into(), middle]);
            e.fit(UNIT, "offset", m.offset, sum)
        });
        let finer = f(s.conic_cross) - f(s.conic);
        e.require(finer == 0 || is_direct && finer == 1, || {
            format!("ellipse.conic {} and ellipse.conic_cross {} need the same fraction bits: they are summed", s.conic, s.conic_cross)
        });
        let directions = directions(m.rows);
        let [radial, gradient, first, second];
        let mut square = None;
        if is_direct {
            let fitted;
            [fitted, radial] = Raster::evaluates(e, machine, middle);
            square = Some(fitted);
            // Not declared: nothing is differenced.
            [gradient, first, second] = [m.gradient, m.first, m.second]
                .map(|word| Fit::new(radial.signal, word, word.into()));
        } else {
            let along = e.copies(2, |e| e.times(UNIT, s.conic, m.offset));
            // Q01·dy; and Q01·dx, where rows are differenced.
            let across = e.copies(directions, |e| e.times(UNIT, s.conic_cross, m.offset));
            gradient = e.copies(2, |e| {
                let sum = e.sum(UNIT, [along, across.doubled()]);
                e.fit(UNIT, "gradient", m.gradient, sum)
            });
            let square = e.copies(2, |e| e.times(UNIT, m.offset, m.gradient));
            let sum = e.sum(UNIT, [square; 2]);
            radial = e.fit(UNIT, "radial", m.radial, sum);
            first = e.copies(directions, |e| {
                let sum = e.sum(UNIT, [along.doubled(), along, across.doubled()]);
                e.fit(UNIT, "first", m.first, sum)
            });
            second = e.copies(directions, |e| {
                e.fit(UNIT, "second", m.second, Exact::from(s.conic).doubled())
            });
        }
        let lean = e.copies(2, |e| e.times(UNIT, s.depth_slope, m.offset));
        let plane = e.sum(UNIT, [lean, lean, machine.project.depth.into()]);
        let depth = e.fit(UNIT, "depth", m.depth, plane);
        // depth ± depth_range.
        let clamped = Raster::depth_exact(machine).bits();
        e.adders(UNIT, 2, clamped);
        let [radial_bits, first_bits, depth_bits] = [m.radial, m.first, m.depth].map(bits);
        let step = |e: &mut Elaboration, words: &[i32]| {
            for &bits in words {
                e.part(UNIT, Operator::Register(bits));
                e.choice(UNIT, 2, bits);
                e.adders(UNIT, 1, bits);
            }
        };
        if m.rows == Rows::Differenced {
            // Rows and their first differences are stepped as pixels are.
            step(e, &[radial_bits, first_bits, depth_bits, first_bits]);
        }
        e.per_lane(|e| {
            // radial += first, first += second, depth += slope, or a seed; less than the cutoff;
            // not negative; clamped from both sides.
            let stepped = [radial_bits, first_bits, depth_bits];
            step(e, if is_direct { &stepped[2..] } else { &stepped });
            e.adders(UNIT, 1, radial_bits);
            if !is_direct {
                e.choice(UNIT, 2, radial_bits);
            }
            e.copies(2, |e| e.limit(UNIT, clamped));
        });
        if cuts_boxes(machine) {
            Raster::goes_on(e, machine, directions);
        }
        if let Some(masks) = Masks::of(machine) {
            Raster::finds_runs(e, &masks);
        }
        let camera = f(machine.project.depth);
        let finest = f(m.depth).max(camera).max(f(s.depth_range));
        let clamp = [
            places(finest, f(m.depth)),
            places(finest, camera),
            places(finest, f(s.depth_range)),
        ];
        let depth_slope_places = places(f(m.depth), f(s.depth_slope));
        let deepest = [(machine.project.depth, clamp[1]), (s.depth_range, clamp[2])]
            .map(|(word, by)| i128::from(word.format.max()) << by);
        let are_short =
            deepest[0] + deepest[1] < 1 << 30 && clamp[0] < 16 && depth_slope_places < 16;
        Raster {
            short_depth: if are_short && !is_direct {
                1 << (31 - clamp[0] as i32).min(bits(m.depth) - 1).max(0)
            } else {
                0
            },
            rows: m.rows,
            offset,
            square,
            gradient,
            radial,
            first,
            second,
            depth,
            radial_register: Register::new(m.radial),
            depth_register: Register::new(m.depth),
            places: Alignment {
                pixel: f(pixel).max(1) as u32,
                offset: f(m.offset) as u32,
                doubles: Raster::doubles(machine),
                cutoff: places(f(m.radial), f(m.cutoff)),
                first: places(f(m.radial), f(m.first)),
                second: places(f(m.radial), f(m.second)),
                depth_slope: depth_slope_places,
                plane: [
                    places(plane.frac_bits, lean.frac_bits),
                    places(plane.frac_bits, camera),
                ],
                clamp,
            },
        }
    }

    /// Left shift of products with Q01, for twice their value at the fraction bits of those with
    /// Q00. With [`Rows::Direct`], Q01 may have one more fraction bit.
    fn doubles(machine: &Machine) -> u32 {
        let [conic, cross] =
            [machine.ellipse.conic, machine.ellipse.conic_cross].map(|word| word.format.frac_bits);
        places(conic + 1, cross)
    }

    /// Parts that compute r in each lane; returns the fits of squares and of r.
    fn evaluates(e: &mut Elaboration, machine: &Machine, middle: Exact) -> [Fit; 2] {
        let (m, s) = (&machine.raster, &machine.ellipse);
        e.per_lane(|e| {
            e.copies(2, |e| {
                e.adders(UNIT, 1, middle.bits());
                let sum = e.sum(UNIT, [machine.project.pixel.into(), middle]);
                e.fit(UNIT, "offset", m.offset, sum)
            });
            let word = square(machine);
            let square = e.copies(3, |e| {
                let product = e.times(UNIT, m.offset, m.offset);
                e.fit(UNIT, "square", word, product)
            });
            let along = e.copies(2, |e| e.times(UNIT, s.conic, word));
            let across = e.times(UNIT, s.conic_cross, word);
            let across = match Raster::doubles(machine) {
                0 => across.scaled(1),
                _ => across.doubled(),
            };
            let sum = e.sum(UNIT, [along, across, along]);
            [square, e.fit(UNIT, "radial", m.radial, sum)]
        })
    }

    /// Parts that cut a box to a tile, and compute the registers of its seed there in closed form,
    /// at most a picture's columns and rows away.
    fn goes_on(e: &mut Elaboration, machine: &Machine, directions: u32) {
        let (m, slope) = (&machine.raster, machine.ellipse.depth_slope);
        // For columns and for rows: the tile's far side, the nearer of both far sides, and the
        // number of columns or rows before the tile.
        e.copies(2, |e| {
            e.adders(UNIT, 2, PIXEL_BITS);
            e.copies(2, |e| e.limit(UNIT, PIXEL_BITS));
        });
        // Products of at most this many bits, and their adders. They need no wider multiplier. A
        // register keeps only the bits in its range, so only full adders for those bits are built,
        // one row of them per product row.
        let product = |e: &mut Elaboration, bits: i32, times: i32, room: i32| {
            for lowest in (0..bits.min(room)).step_by(PIXEL_BITS as usize) {
                let (piece, room) = ((bits - lowest).min(PIXEL_BITS), room - lowest);
                let full_adders: i32 = (1..times)
                    .map(|row| (piece.min(room - row) - 1).max(0))
                    .sum();
                e.part(
                    UNIT,
                    Operator::Multiplier([piece, 1 + full_adders / (piece - 1).max(1)]),
                );
                if lowest > 0 {
                    e.adders(UNIT, 1, room.min(piece + times));
                }
            }
        };
        // Bits of a register from the LSB of a difference upwards.
        let room = |register: Word, difference: Word| {
            register.format.width() - (register.format.frac_bits - difference.format.frac_bits)
        };
        // A register adds a difference times the steps, or times the pairs of steps.
        let gets = |e: &mut Elaboration, register: Word, difference: Word, times: i32| {
            product(
                e,
                difference.format.width(),
                times,
                room(register, difference),
            );
            e.adders(UNIT, 1, register.format.width());
        };
        e.copies(directions.max(1), |e| {
            if directions > 0 {
                e.adders(UNIT, 1, PIXEL_BITS);
                product(e, PIXEL_BITS, PIXEL_BITS, room(m.radial, m.second) + 1);
                gets(e, m.radial, m.first, PIXEL_BITS);
                gets(e, m.radial, m.second, 2 * PIXEL_BITS - 1);
                // The first difference by column; by row too where rows are stepped.
                e.copies(directions, |e| gets(e, m.first, m.second, PIXEL_BITS));
            }
            gets(e, m.depth, slope, PIXEL_BITS);
        });
    }

    /// Parts that find the next run of set bits in the mask of an entry, so that the seed moves to
    /// it instead of to the tile.
    fn finds_runs(e: &mut Elaboration, masks: &Masks) {
        let [bits, across] = [masks.bits, masks.across()].map(|bits| bits as i32);
        e.part(UNIT, Operator::Register(bits));
        e.choice(UNIT, 2, bits);
        // The first bit that is left, its row, and the end of its run there: carries.
        e.adders(UNIT, 1, bits);
        e.choice(UNIT, masks.across(), across);
        e.adders(UNIT, 1, across);
        // Columns of the run before, and whether they are the same.
        e.part(UNIT, Operator::Register(across));
        e.adders(UNIT, 1, across);
        // For columns and for rows, both sides of the run in the picture: inside of the box, and
        // selected instead of those of the tile.
        e.copies(4, |e| {
            e.adders(UNIT, 1, PIXEL_BITS);
            e.limit(UNIT, PIXEL_BITS);
            e.choice(UNIT, 2, PIXEL_BITS);
        });
    }

    /// Shape of the clamped depth.
    pub fn depth_exact(machine: &Machine) -> Exact {
        Exact::from(machine.project.depth)
            .plus(machine.ellipse.depth_range)
            .plus(machine.raster.depth)
    }

    /// The cutoff, aligned to the register.
    pub fn cutoff(&self, cutoff: i64) -> i64 {
        self.radial_register.load(cutoff, self.places.cutoff)
    }

    /// Enters eight splats' boxes in the square with this first pixel. Each box must touch the
    /// square.
    #[inline(always)]
    pub fn enter<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        square: [u16; 2],
        inputs: &[&Input; LANES],
        tap: &mut Tap<P>,
    ) -> Walks {
        let splats = Splats::<L>::of(inputs);
        let parts = BoxParts::<L>::of(square, inputs, &splats);
        let [nearest, deepest] = self.clamps(inputs, &splats);
        let mut walks = Walks {
            top: (splats.first_row + parts.on[1]).to_array(),
            columns: parts.size[0].to_array(),
            rows: parts.size[1].to_array(),
            columns_on: parts.on[0].to_array(),
            first_pixel: parts.first_pixel.to_array(),
            by_column_twice: if self.rows == Rows::Direct {
                [0; LANES]
            } else {
                self.second(splats.conic[0], tap).to_array()
            },
            depth_slope: two!(axis => splats.depth_slope[axis].to_array()),
            nearest: nearest.to_array(),
            deepest: deepest.to_array(),
            ..Walks::default()
        };
        if self.rows == Rows::Differenced {
            let EnteredBoxes {
                seed,
                by_row,
                by_row_twice,
                by_both,
            } = self.enter_boxes(
                size_px,
                &splats,
                L::from_array(walks.by_column_twice),
                parts.on,
                tap,
            );
            walks.seed = seed.to_array();
            walks.by_row = by_row.to_array();
            walks.by_row_twice = by_row_twice.to_array();
            walks.by_both = by_both.to_array();
        }
        walks
    }

    /// Depth clamps of eight splats (shape: [`Raster::depth_exact`]).
    #[inline(always)]
    fn clamps<L: Lanes>(&self, inputs: &[&Input; LANES], splats: &Splats<L>) -> [L; 2] {
        let (depth, range) = (
            splats.depth.left(self.places.clamp[1]),
            word!(inputs.depth_range).left(self.places.clamp[2]),
        );
        [depth - range, depth + range]
    }

    /// Seeds the first pixels of the boxes and moves to the square, in closed form.
    #[inline(always)]
    fn enter_boxes<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        splats: &Splats<L>,
        by_column_twice: L,
        [columns_on, rows_on]: [L; 2],
        tap: &mut Tap<P>,
    ) -> EnteredBoxes<L> {
        let first = [splats.first_column, splats.first_row];
        let at = self.offsets(size_px, first, splats, tap);
        let seed = self.seed(splats, at, tap);
        let [_, xy, yy] = splats.conic;
        let by_row = (yy * at[1] + xy * at[0]).left(1) + yy.left(self.places.offset);
        let by_row = self
            .radial_register
            .load_lanes(tap.fit(&self.first, by_row), self.places.first);
        let (by_row_twice, by_both) = (self.second(yy, tap), self.second(xy, tap));
        let depth_by = two!(axis => self.depth_register.load_lanes(splats.depth_slope[axis], self.places.depth_slope));
        let below = Seed {
            radial: after(seed.radial, by_row, by_row_twice, rows_on),
            by_column: seed.by_column.wrapping_add(by_both.times(rows_on)),
            depth: seed.depth.wrapping_add(depth_by[1].times(rows_on)),
        };
        EnteredBoxes {
            seed: below.skip(by_column_twice, depth_by[0], columns_on),
            by_row: by_row
                .wrapping_add(by_row_twice.times(rows_on))
                .wrapping_add(by_both.times(columns_on)),
            by_row_twice,
            by_both,
        }
    }

    #[inline(always)]
    fn second<L: Lanes, P: Probe>(&self, conic: L, tap: &mut Tap<P>) -> L {
        self.radial_register
            .load_lanes(tap.fit(&self.second, conic.left(1)), self.places.second)
    }

    /// Makes the fragments of one of the splats.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "one argument per port")]
    pub fn span<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        walks: &Walks,
        lane: usize,
        input: &Input,
        cutoff: RegisterBits,
        span: &mut Span,
        tap: &mut Tap<P>,
    ) {
        span.fragments = 0;
        match self.rows {
            Rows::Differenced => self.walk_down::<L, P>(walks, lane, cutoff, span, tap),
            Rows::Seeded => self.row_by_row::<L, P>(size_px, walks, lane, input, cutoff, span, tap),
            Rows::Direct => self.directly::<L, P>(size_px, walks, lane, input, cutoff, span, tap),
        }
    }

    /// Steps all columns from row to row.
    #[inline(always)]
    fn walk_down<L: Lanes, P: Probe>(
        &self,
        w: &Walks,
        lane: usize,
        cutoff: RegisterBits,
        span: &mut Span,
        tap: &mut Tap<P>,
    ) {
        let [columns, rows] = w.size(lane);
        if P::WORDS {
            self.watch_rows(w, lane, tap);
        }
        let by_row_twice = L::splat(w.by_row_twice[lane]);
        for eight in 0..eights(columns) {
            let mut radial: L = eight_columns(
                w.seed.radial[lane],
                w.seed.by_column[lane],
                w.by_column_twice[lane],
                eight,
            );
            let mut by_row: L = eight_columns(w.by_row[lane], w.by_both[lane], 0, eight);
            let inside = first_bits(columns - eight * LANES);
            for row in 0..rows {
                span.keep([row, eight], radial, L::splat(cutoff), inside);
                radial = radial.wrapping_add(by_row);
                by_row = by_row.wrapping_add(by_row_twice);
            }
        }
    }

    /// Seeds every row, eight rows at a time.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as `span`")]
    fn row_by_row<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        walks: &Walks,
        lane: usize,
        input: &Input,
        cutoff: RegisterBits,
        span: &mut Span,
        tap: &mut Tap<P>,
    ) {
        let [columns, rows] = walks.size(lane);
        let by_column_twice = walks.by_column_twice[lane];
        let splat = Splats::<L>::all(input);
        let depth_by_column = self
            .depth_register
            .load_lanes(splat.depth_slope[0], self.places.depth_slope);
        for first in (0..rows).step_by(LANES) {
            if P::WORDS {
                tap.live = first_bits(rows - first);
            }
            let y = L::splat(walks.top[lane] + first as i64) + L::from_array(COLUMNS[0]);
            let seed = self.seed(
                &splat,
                self.offsets(size_px, [splat.first_column, y], &splat, tap),
                tap,
            );
            let seed = seed.skip(
                L::splat(by_column_twice),
                depth_by_column,
                L::splat(walks.columns_on[lane]),
            );
            let seed = seed.to_array();
            for row in first..rows.min(first + LANES) {
                let [radial, by_column] = [seed.radial[row % LANES], seed.by_column[row % LANES]];
                if P::WORDS {
                    let seed = Seed {
                        radial,
                        by_column,
                        depth: seed.depth[row % LANES],
                    };
                    self.watch_row(
                        &seed,
                        by_column_twice,
                        walks.depth_slope[0][lane],
                        columns,
                        tap,
                    );
                }
                span.depth[row] = seed.depth[row % LANES];
                for eight in 0..eights(columns) {
                    let radial = eight_columns(radial, by_column, by_column_twice, eight);
                    let inside = first_bits(columns - eight * LANES);
                    span.keep([row, eight], radial, L::splat(cutoff), inside);
                }
            }
        }
    }

    /// Evaluates every pixel, eight columns at a time.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as `span`")]
    fn directly<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        walks: &Walks,
        lane: usize,
        input: &Input,
        cutoff: RegisterBits,
        span: &mut Span,
        tap: &mut Tap<P>,
    ) {
        let Some(square) = &self.square else {
            return;
        };
        let [columns, rows] = walks.size(lane);
        let splat = Splats::<L>::all(input);
        let [xx, xy, yy] = splat.conic;
        let depth_by_column = self
            .depth_register
            .load_lanes(splat.depth_slope[0], self.places.depth_slope)
            .times(L::splat(walks.columns_on[lane]));
        let left = splat.first_column + L::splat(walks.columns_on[lane]);
        for row in 0..rows {
            // Of z, at the first column of the box; dy is that of all its pixels.
            tap.live = 1;
            let at_row = L::splat(walks.top[lane] + row as i64);
            let seed = self.offsets(size_px, [splat.first_column, at_row], &splat, tap);
            let depth = self.depth_seed(&splat, seed, tap);
            span.depth[row] = depth.wrapping_add(depth_by_column).to_array()[0];
            if P::WORDS {
                let z = self.depth_register.read(span.depth[row]);
                let slope = walks.depth_slope[0][lane] << self.places.depth_slope;
                let last = z + (columns as i64 - 1) * slope;
                tap.probe
                    .reached(self.depth.signal, [z.min(last), z.max(last)]);
            }
            for (eight, column) in COLUMNS.iter().enumerate().take(eights(columns)) {
                let inside = first_bits(columns - eight * LANES);
                tap.live = inside;
                let at = [left + L::from_array(*column), at_row];
                let [x, y] = self.offsets(size_px, at, &splat, tap);
                let [of_x, of_both, of_y] = three!(i => {
                    tap.fit(square, [x, x, y][i] * [x, y, y][i])
                });
                let both = (xy * of_both).left(self.places.doubles);
                let sum = xx * of_x + both + yy * of_y;
                let radial = tap.fit_register(&self.radial, self.radial_register, sum);
                span.keep(
                    [row, eight],
                    radial,
                    L::splat(cutoff),
                    inside & !radial.signs(),
                );
            }
        }
    }

    /// Reports to the probe how far the registers go in the part of a box, and where they wrap.
    #[inline(always)]
    fn watch_rows<P: Probe>(&self, w: &Walks, lane: usize, tap: &mut Tap<P>) {
        let seed = Seed {
            radial: w.seed.radial[lane],
            by_column: w.seed.by_column[lane],
            depth: w.seed.depth[lane],
        };
        let by_row = [w.by_row[lane], w.by_row_twice[lane], w.by_both[lane]];
        let depth_slope = two!(axis => w.depth_slope[axis][lane]);
        if self.reach(
            &seed,
            w.by_column_twice[lane],
            by_row,
            depth_slope,
            w.size(lane),
            tap,
        ) {
            self.walk_rows(w, lane, tap);
        }
    }

    /// Reports to the probe how far the registers go in a row, and where they wrap.
    #[inline(always)]
    fn watch_row<P: Probe>(
        &self,
        seed: &Seed<RegisterBits>,
        by_column_twice: RegisterBits,
        depth_slope: i64,
        columns: usize,
        tap: &mut Tap<P>,
    ) {
        if self.reach(
            seed,
            by_column_twice,
            [0; 3],
            [depth_slope, 0],
            [columns, 1],
            tap,
        ) {
            self.walk_row(seed.radial, seed.by_column, by_column_twice, columns, tap);
        }
    }

    /// Extremes of the registers without wrapping: r, up to the column after the last, its first
    /// difference, and z. They are at the part's corners, because r is convex. Returns whether a
    /// register may wrap.
    #[inline(always)]
    fn reach<P: Probe>(
        &self,
        seed: &Seed<RegisterBits>,
        by_column_twice: RegisterBits,
        by_row: [RegisterBits; 3],
        depth_slope: [i64; 2],
        [columns, rows]: [usize; 2],
        tap: &mut Tap<P>,
    ) -> bool {
        let (on, down) = (columns as i64, rows as i64 - 1);
        let [r, by_column] =
            [seed.radial, seed.by_column].map(|held| self.radial_register.read(held));
        let by_column_twice = self.radial_register.read(by_column_twice);
        let [by_row, by_row_twice, by_both] = by_row.map(|held| self.radial_register.read(held));
        // Words have at most 48 bits and sides at most 16 pixels, so 64 bits hold all of this.
        let along = on * by_column + PAIRS_BEFORE[columns % 17] * by_column_twice;
        let across = down * by_row + PAIRS_BEFORE[(rows - 1) % 17] * by_row_twice;
        let both = on * down * by_both;
        let [low, high] = extremes([r, r + along, r + across, r + along + across + both]);
        let (turn, lean) = ((on - 1) * by_column_twice, down * by_both);
        let [least, most] = extremes([
            by_column,
            by_column + turn,
            by_column + lean,
            by_column + turn + lean,
        ]);
        tap.probe
            .reached(self.radial.signal, [low.min(least), high.max(most)]);

        let z = self.depth_register.read(seed.depth);
        let depth_slope = two!(axis => depth_slope[axis] << self.places.depth_slope);
        let [along, across] = [(on - 1) * depth_slope[0], down * depth_slope[1]];
        tap.probe.reached(
            self.depth.signal,
            extremes([z, z + along, z + across, z + along + across]),
        );

        // A convex r is never below its tangent plane.
        let lowest = r + (on * by_column).min(0) + (down * by_row).min(0) + both.min(0);
        let [min, max] = self.radial.limits();
        lowest.min(least) < min || high.max(most) > max || by_column_twice < 0 || by_row_twice < 0
    }

    /// Reports to the probe where the rows' registers wrap.
    #[inline(never)]
    fn walk_rows<P: Probe>(&self, w: &Walks, lane: usize, tap: &mut Tap<P>) {
        let [columns, rows] = w.size(lane);
        let (mut radial, mut by_row, mut by_column) =
            (w.seed.radial[lane], w.by_row[lane], w.seed.by_column[lane]);
        for _ in 0..rows {
            self.walk_row(radial, by_column, w.by_column_twice[lane], columns, tap);
            radial = radial.wrapping_add(by_row);
            by_row = by_row.wrapping_add(w.by_row_twice[lane]);
            by_column = by_column.wrapping_add(w.by_both[lane]);
        }
    }

    fn walk_row<P: Probe>(
        &self,
        mut radial: RegisterBits,
        mut first: RegisterBits,
        second: RegisterBits,
        columns: usize,
        tap: &mut Tap<P>,
    ) {
        for _ in 0..columns {
            if radial.checked_add(first).is_none() {
                tap.probe.wrapped(self.radial.signal);
            }
            radial = radial.wrapping_add(first);
            first = first.wrapping_add(second);
        }
    }

    /// r (`raster.radial`), at least 0, and z clamped to what the disc can reach (shape:
    /// [`Raster::depth_exact`]), of eight fragments.
    #[inline(always)]
    pub fn fragments<L: Lanes>(
        &self,
        walks: &Walks,
        lane: usize,
        span: &Span,
        places: [u8; LANES],
    ) -> [L; 2] {
        let place = L::from_bytes(places);
        let held = place.look_up(span.radial.as_flattened().as_flattened());
        let radial = self.radial_register.read_unsigned(held.max(L::splat(0)));
        let [column, row] = [
            place & L::splat(SIDE_PX as i64 - 1),
            place.right_unsigned(SIDE_PX.ilog2()),
        ];
        let [by_column, by_row] = two!(axis => L::splat(walks.depth_slope[axis][lane]));
        let (start, lean) = match self.rows {
            Rows::Differenced => (
                L::splat(walks.seed.depth[lane]),
                column * by_column + row * by_row,
            ),
            Rows::Seeded | Rows::Direct => (row.look_up(&span.depth), column * by_column),
        };
        let depth = start.wrapping_add(
            self.depth_register
                .load_lanes(lean, self.places.depth_slope),
        );
        let depth = self
            .depth_register
            .read_lanes(depth)
            .left(self.places.clamp[0]);
        [
            radial,
            depth
                .max(L::splat(walks.nearest[lane]))
                .min(L::splat(walks.deepest[lane])),
        ]
    }

    /// Centres of the pixels in these columns and rows, from the splats' centres.
    #[inline(always)]
    fn offsets<L: Lanes, P: Probe>(
        &self,
        size_px: [u32; 2],
        pixel: [L; 2],
        splats: &Splats<L>,
        tap: &mut Tap<P>,
    ) -> [L; 2] {
        let from_middle =
            two!(axis => pixel[axis].left(1) + L::splat(1 - i64::from(size_px[axis])));
        two!(axis => tap.fit(&self.offset, from_middle[axis].left(self.places.pixel - 1) - splats.pixel[axis]))
    }

    /// r, its first difference by column, and z, at offsets from the centres.
    #[inline(always)]
    fn seed<L: Lanes, P: Probe>(
        &self,
        splats: &Splats<L>,
        [x, y]: [L; 2],
        tap: &mut Tap<P>,
    ) -> Seed<L> {
        let [xx, xy, yy] = splats.conic;
        let (along, across) = (xx * x, (xy * y).left(1));
        let by_x = tap.fit(&self.gradient, along + across);
        let by_y = tap.fit(&self.gradient, yy * y);
        let first = tap.fit(
            &self.first,
            along.left(1) + xx.left(self.places.offset) + across,
        );
        Seed {
            radial: tap.fit_register(&self.radial, self.radial_register, x * by_x + y * by_y),
            by_column: self.radial_register.load_lanes(first, self.places.first),
            depth: self.depth_seed(splats, [x, y], tap),
        }
    }

    #[inline(always)]
    fn depth_seed<L: Lanes, P: Probe>(
        &self,
        splats: &Splats<L>,
        [x, y]: [L; 2],
        tap: &mut Tap<P>,
    ) -> L {
        let [by_x, by_y] = splats.depth_slope;
        let [lean, camera] = self.places.plane;
        let plane = (by_x * x + by_y * y).left(lean) + splats.depth.left(camera);
        tap.fit_register(&self.depth, self.depth_register, plane)
    }
}

impl<L: Lanes> Splats<L> {
    /// Words of eight splats.
    #[inline(always)]
    fn of(inputs: &[&Input; LANES]) -> Self {
        let mut words = [[0; LANES]; LANES];
        for lane in 0..LANES {
            let Input {
                pixel: [x, y],
                conic: [xx, xy, yy],
                depth,
                depth_slope: [by_x, by_y],
                ..
            } = *inputs[lane];
            words[lane] = [x, y, xx, xy, yy, depth, by_x, by_y];
        }
        let [x, y, xx, xy, yy, depth, by_x, by_y] = L::transposed(&words);
        let (first_column, first_row) = (word!(inputs.columns[0]), word!(inputs.rows[0]));
        Splats {
            pixel: [x, y],
            conic: [xx, xy, yy],
            depth,
            depth_slope: [by_x, by_y],
            first_column,
            first_row,
        }
    }

    /// Words of one splat, repeated eight times.
    #[inline(always)]
    fn all(splat: &Input) -> Self {
        Splats {
            pixel: two!(i => L::splat(splat.pixel[i].into())),
            conic: three!(i => L::splat(splat.conic[i].into())),
            depth: L::splat(splat.depth.into()),
            depth_slope: two!(i => L::splat(splat.depth_slope[i].into())),
            first_column: L::splat(splat.columns[0].into()),
            first_row: L::splat(splat.rows[0].into()),
        }
    }
}

impl<L: Lanes> BoxParts<L> {
    /// Parts of boxes in the square with this first pixel. Each box must touch the square.
    #[inline(always)]
    fn of(square: [u16; 2], inputs: &[&Input; LANES], splats: &Splats<L>) -> Self {
        let [x, y] = two!(axis => L::splat(square[axis].into()));
        let last = L::splat(SIDE_PX as i64 - 1);
        let from = [splats.first_column.max(x), splats.first_row.max(y)];
        let to = [
            word!(inputs.columns[1]).min(x + last),
            word!(inputs.rows[1]).min(y + last),
        ];
        BoxParts {
            on: [from[0] - splats.first_column, from[1] - splats.first_row],
            size: two!(axis => to[axis] - from[axis] + L::splat(1)),
            first_pixel: (from[1] - y).left(SIDE_PX.ilog2()) + from[0] - x,
        }
    }
}

impl<L: Lanes> Seed<L> {
    /// Moves some columns ahead, in closed form.
    #[inline(always)]
    fn skip(self, by_column_twice: L, depth_by_column: L, columns: L) -> Self {
        Seed {
            radial: after(self.radial, self.by_column, by_column_twice, columns),
            by_column: self.by_column.wrapping_add(by_column_twice.times(columns)),
            depth: self.depth.wrapping_add(depth_by_column.times(columns)),
        }
    }

    #[inline(always)]
    fn to_array(self) -> Seed<[RegisterBits; LANES]> {
        Seed {
            radial: self.radial.to_array(),
            by_column: self.by_column.to_array(),
            depth: self.depth.to_array(),
        }
    }
}

/// A twice differenced register after some steps, in closed form.
#[inline(always)]
fn after<L: Lanes>(value: L, first: L, second: L, steps: L) -> L {
    let pairs = (steps * (steps - L::splat(1))).right(1);
    value
        .wrapping_add(first.times(steps))
        .wrapping_add(second.times(pairs))
}

/// A twice differenced register at the first or second eight columns from this one.
#[inline(always)]
fn eight_columns<L: Lanes>(
    value: RegisterBits,
    first: RegisterBits,
    second: RegisterBits,
    eight: usize,
) -> L {
    let [columns, pairs] = [L::from_array(COLUMNS[eight]), L::from_array(PAIRS[eight])];
    L::splat(value)
        .wrapping_add(L::splat(first).times(columns))
        .wrapping_add(L::splat(second).times(pairs))
}

/// The magnitude of each lane.
#[inline(always)]
fn magnitude<L: Lanes>(words: L) -> L {
    words.max(-words)
}

/// The least and the greatest of four.
#[inline(always)]
fn extremes([a, b, c, d]: [i64; 4]) -> [i64; 2] {
    [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))]
}

/// Number of vectors of eight columns for this many columns of the square.
#[inline(always)]
fn eights(columns: usize) -> usize {
    columns.div_ceil(LANES).min(2)
}

/// A byte with its lowest `count` bits set.
#[inline(always)]
fn first_bits(count: usize) -> u8 {
    ((1 << count.min(8)) - 1) as u8
}

pub mod real;
pub mod short;

#[cfg(test)]
mod tests;
