//! Contribution: tests a block of pixels by r at a few of them, the leaders (FLICKER, arXiv
//! 2603.01158). The rasteriser passes over blocks that fail for a Gaussian.
//!
//! ```text
//! pixel, leader ─►(−)─► offset ─►(×)─┬─► square: dx², dy² ─┐
//!                                    └─► product: dx·dy ───┼─►(×)─►(Σ)─► radial ─►[ < cutoff ]─►[ any leader ]─► kept
//! conic ──────────────────► conic, conic_cross ────────────┘                          │
//! opacity ─►[ table of cutoffs ]──────────────────────────────────────────────────────┘
//! ```
//! The weight at a pixel is amplitude · exp(−r/2), so it counts only below a cutoff that depends on
//! the amplitude. The test compares r with that cutoff: the frame's, or the lower one of the table
//! that also limits boxes (`ellipse.ellipsoid.reach_bits`). So it needs no exponential.
//!
//! The test is lossy. A block is passed over if its leaders are all outside of the footprint, and a
//! footprint may lie between them. Words that are too narrow make further errors. This is the rule
//! as published.
//!
//! Losses: every word is rounded as its description says. `radial` is unsigned: a sum below 0, by
//! rounding, is 0.
//!
//! Laws: `a_block_is_kept_if_a_leader_is_inside` (tests), `kept_pixels_are_unchanged`
//! (tests/machines).

use crate::elaboration::latency::Path;
use crate::elaboration::masks::{self, Masks};
use crate::elaboration::{Elaboration, Operator};
use crate::graph::{Asked, Builder, Graph, Program, Wire};
use crate::machine::{self, Leaders, Machine};
use crate::num::{Exact, Word, two};
use crate::records::{MIDDLE, PIXEL_BITS, PLACE, unit};

const UNIT: &str = unit::CONTRIBUTION;

/// Most leaders of a block.
pub const MOST_LEADERS: usize = 4;

/// Inputs of the graph of a block: pixel, conic, cutoff; the block's first and last column, first
/// and last row; (pixels − 1)/2 of both sides of the picture.
pub const INPUTS: usize = 12;

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Contribution {
    words: machine::Contribution,
    graph: Graph<1>,
    program: Program,
    /// r at the leaders; those of a diagonal twice.
    asked: Asked<MOST_LEADERS>,
}

impl Contribution {
    /// Elaborates the unit, if the machine has one.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let words = machine.contribution?;
        if !check(e, machine, &words) {
            return None;
        }
        let engines = machine.timing.engines.unwrap_or(1).clamp(1, 64);
        let blocks = machine.contribution_blocks();
        let errors = e.errors.len();
        let (graph, radial) = e.copies(engines * blocks, |e| block(e, machine, &words));
        e.copies(engines, |e| surroundings(e, machine, blocks));
        (e.errors.len() == errors).then(|| Contribution {
            words,
            program: graph.program(),
            asked: graph.asked(radial),
            graph,
        })
    }

    /// Critical path: from the record of a splat to whether any bit of its mask is set.
    pub fn path(&self, machine: &Machine) -> Path {
        let bits = Masks::of(machine).map_or(1, |masks| masks.bits);
        self.graph.path().choose(bits)
    }

    /// Side of a block, pixels.
    pub fn block_px(&self) -> u32 {
        self.words.block_px
    }

    /// Leader pixels of a block.
    pub fn leaders(&self) -> Leaders {
        self.words.leaders
    }

    /// Whether a block is kept: its inputs are [`INPUTS`].
    pub fn graph(&self) -> &Graph<1> {
        &self.graph
    }

    /// The same for a batch of blocks.
    pub fn program(&self) -> &Program {
        &self.program
    }
}

/// Bits of a splat before the test.
pub fn splat_bits(machine: &Machine) -> i32 {
    let m = &machine.ellipse;
    let bits = |word: Word| word.format.stored_bits();
    2 * bits(machine.project.pixel)
        + 2 * bits(m.conic)
        + bits(m.conic_cross)
        + bits(machine.raster.cutoff)
        + 4 * PIXEL_BITS
}

/// Checks the description; returns whether a graph can be built.
fn check(e: &mut Elaboration, machine: &Machine, words: &machine::Contribution) -> bool {
    let errors = e.errors.len();
    e.require(
        machine.ellipse.ellipsoid.is_some() && machine.fragment.sheets.is_some(),
        || {
            "contribution tests blocks for Gaussians, but the machine draws no Gaussians: leave `contribution` out, or give `ellipse.ellipsoid` and `fragment.sheets`".into()
        },
    );
    e.require(!machine.sums_gaussians(), || {
        "contribution tests blocks for Gaussians that are blended, but sort.kind is none, which sums them: leave `contribution` out".into()
    });
    e.require([4, 8].contains(&words.block_px), || {
        format!(
            "contribution.block_px is {}: it can be 4 or 8",
            words.block_px
        )
    });
    for (name, word, signed) in [
        ("offset", words.offset, true),
        ("square", words.square, false),
        ("product", words.product, true),
        ("conic", words.conic, false),
        ("conic_cross", words.conic_cross, true),
        ("radial", words.radial, false),
    ] {
        e.number(UNIT, name, word, signed);
    }
    // The widest result that is used without being fitted.
    let exact = |conic: Word, of: Word| Exact::from(conic).times(of);
    let sum = exact(words.conic, words.square)
        .plus(exact(words.conic, words.square))
        .plus(exact(words.conic_cross, words.product).scaled(1));
    e.holds_exact("the sum that contribution.radial is made from", sum);
    e.holds_exact(
        "the square that contribution.square is made from",
        Exact::from(words.offset).times(words.offset),
    );
    e.errors.len() == errors
}

/// The graph of one block, and r at its leaders.
fn block(
    e: &mut Elaboration,
    machine: &Machine,
    words: &machine::Contribution,
) -> (Graph<1>, [Wire; MOST_LEADERS]) {
    let g = &mut Builder::new(e, UNIT);
    let pixel = two!(_axis => g.input(machine.project.pixel));
    let (xx, xy, yy) = (
        g.input(machine.ellipse.conic),
        g.input(machine.ellipse.conic_cross),
        g.input(machine.ellipse.conic),
    );
    let cutoff = g.input(machine.raster.cutoff);
    // The last column of a block is the first with its low bits set.
    let sides = two!(_axis => [g.state(PLACE, false), g.state(PLACE, false)]);
    let middle = two!(_axis => g.state(MIDDLE, false));
    let [x, y] = two!(axis => sides[axis].map(|side| {
        let from_middle = g.minus(side, middle[axis]);
        let offset = g.minus(from_middle, pixel[axis]);
        g.fit("offset", words.offset, offset)
    }));
    let square = |g: &mut Builder, offset: Wire| {
        let square = g.times(offset, offset);
        g.fit("square", words.square, square)
    };
    let conic = [xx, yy].map(|conic| g.fit("conic", words.conic, conic));
    let cross = g.fit("conic_cross", words.conic_cross, xy);
    let [of_x, of_y] = [(0, x), (1, y)].map(|(axis, ends)| {
        ends.map(|end| {
            let square = square(g, end);
            g.times(conic[axis], square)
        })
    });
    let corner = |g: &mut Builder, [column, row]: [usize; 2]| {
        let product = g.times(x[column], y[row]);
        let product = g.fit("product", words.product, product);
        let of_both = g.times(cross, product);
        let of_both = g.scaled(of_both, 1);
        let straight = g.plus(of_x[column], of_y[row]);
        let sum = g.plus(straight, of_both);
        g.fit("radial", words.radial, sum)
    };
    let radial = match words.leaders {
        Leaders::Corners => [[0, 0], [1, 0], [0, 1], [1, 1]].map(|at| corner(g, at)),
        Leaders::Diagonal => {
            let [first, last] = [[0, 0], [1, 1]].map(|at| corner(g, at));
            [first, last, first, last]
        }
    };
    let kept = radial[..words.leaders.count() as usize]
        .iter()
        .map(|radial| {
            let bits = g.shape(cutoff).plus(g.shape(*radial)).bits();
            g.elaboration().adders(UNIT, 1, bits);
            g.above(cutoff, *radial)
        })
        .collect::<Vec<_>>();
    let kept = kept
        .into_iter()
        .reduce(|one, other| g.either(one, other))
        .unwrap_or_default();
    (g.build([kept]), radial)
}

/// Parts around the arithmetic: the splat that is tested, the next blocks of its box, its mask, and
/// the table of cutoffs.
fn surroundings(e: &mut Elaboration, machine: &Machine, blocks: u32) {
    let held = splat_bits(machine);
    e.part(UNIT, Operator::Register(held));
    e.part(UNIT, Operator::Hold(held));
    e.copies(blocks, |e| {
        e.copies(2, |e| {
            e.part(UNIT, Operator::Register(PIXEL_BITS));
            e.choice(UNIT, 2, PIXEL_BITS);
            e.adders(UNIT, 1, PIXEL_BITS);
        });
    });
    let bits = Masks::of(machine).map_or(0, |masks| masks.bits) as i32;
    e.part(UNIT, Operator::Register(bits));
    e.choice(UNIT, 2, bits);
    let reach_bits = (machine.ellipse.ellipsoid).and_then(|words| words.reach_bits);
    if let Some(reach_bits) = reach_bits {
        let reach_bits = reach_bits.clamp(1, 12);
        e.part(
            UNIT,
            Operator::Rom([1 << reach_bits, machine.raster.cutoff.format.width()]),
        );
        e.choice(UNIT, 2, reach_bits as i32);
    }
}

impl Machine {
    /// Blocks that the contribution test takes per cycle.
    pub fn contribution_blocks(&self) -> u32 {
        let timing = self.timing.contribution.unwrap_or_default();
        timing.blocks.clamp(1, masks::MOST_BLOCKS)
    }
}

pub mod real;

#[cfg(test)]
mod tests;
