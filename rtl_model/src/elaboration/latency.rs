//! Latency: the critical path of a unit, and its cycles.
//!
//! ```text
//! operators in series ─┬─► cycles, if each operator has its own registers
//!                      └─► delay, FO4 ─►( ÷ clock period less register )─► least cycles
//! ```
//! The path of a graph is the longest one through it; other units declare theirs, with the widths
//! of its operators. Delays are in tenths of FO4, the delay of a fanout-of-4 inverter, so that they
//! apply to any technology. They are rounded from the delays of open 180 nm standard cells, mapped
//! by Yosys and ABC (`sh tests/programs/delays.sh`, docs/book/clock-cells.md).
//!
//! Laws: `a_wider_operator_is_never_faster`, `a_faster_clock_never_takes_fewer_cycles`.

use crate::machine::timing::{Technology, Timing};
use crate::num::Word;

/// Cycles of a product with its own registers.
pub const PRODUCT: u32 = 2;
/// Cycles of a sum.
pub const SUM: u32 = 1;
/// Cycles of a table look-up.
pub const TABLE: u32 = 1;
/// Cycles of a normalisation: count zeros, shift.
pub const NORMALISE: u32 = 2;

/// Share of a register in each cycle, tenths of FO4: set-up, clock to output, skew.
pub const REGISTER: u32 = 50;

/// Limit of the widths here. Wider words are an elaboration error anyway.
const WIDEST: i32 = 1 << 12;

/// A path through operators in series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Path {
    /// Cycles, if every operator has its own registers.
    pub cycles: u32,
    /// Tenths of FO4.
    pub delay: u32,
}

/// log2 of a width, in sixteenths, linear between powers of two; 0 for widths up to 1.
fn log2(bits: i32) -> u32 {
    let bits = bits.clamp(1, 2 * WIDEST) as u32;
    let below = bits.ilog2();
    let power = 1 << below;
    16 * below + 16 * (bits - power) / power
}

/// Delay of a sum: a tree of carries.
fn adder(bits: i32) -> u32 {
    (35 * log2(bits) / 16).saturating_sub(26)
}

impl Path {
    fn step(self, cycles: u32, delay: u32) -> Path {
        Path {
            cycles: self.cycles.saturating_add(cycles),
            delay: self.delay.saturating_add(delay),
        }
    }

    /// A product: a tree of rows of adders, and the carries of the remaining sum.
    pub fn product(self, a: i32, b: i32) -> Path {
        self.step(
            PRODUCT,
            (75 * log2(a.min(b)) / 16).saturating_sub(105)
                + adder(a.clamp(0, WIDEST) + b.clamp(0, WIDEST)),
        )
    }

    /// The exact product of two words; bits of floating point are then shifted to their places.
    pub fn product_of(self, a: Word, b: Word) -> Path {
        let path = self.product(a.format.factor_bits(), b.format.factor_bits());
        if a.format.is_float() || b.format.is_float() {
            path.shift(a.format.width() + b.format.width())
        } else {
            path
        }
    }

    /// A sum, a difference or a comparison.
    pub fn sum(self, bits: i32) -> Path {
        self.step(SUM, adder(bits))
    }

    /// Sums of three terms.
    pub fn sum_of_three(self, bits: i32) -> Path {
        self.sum(bits).sum(bits)
    }

    /// A table of 2^`index_bits` words.
    pub fn table(self, index_bits: i32) -> Path {
        self.step(TABLE, 5 + 12 * index_bits.clamp(0, WIDEST) as u32)
    }

    /// Shifts the leading one to the front.
    pub fn normalise(self, bits: i32) -> Path {
        self.step(NORMALISE, adder(bits)).shift(bits)
    }

    /// Shifts by any number of places, within the cycles of the operator before it.
    pub fn shift(self, bits: i32) -> Path {
        self.step(0, log2(bits))
    }

    /// Selects one of `words` words, within the cycles of the operator before it.
    pub fn choose(self, words: u32) -> Path {
        self.step(0, log2(words as i32))
    }

    /// Rounds to a word and limits it, within the cycles of the operator before it.
    pub fn fit(self, bits: i32) -> Path {
        self.step(0, adder(bits) / 2 + 16)
    }

    /// [`Path::fit`] of an exact result of `from` bits, whose leading one goes to the front if the
    /// word is in floating point.
    pub fn fit_word(self, word: Word, from: i32) -> Path {
        let path = if word.format.is_float() {
            self.normalise(from)
        } else {
            self
        };
        path.fit(word.format.stored_bits())
    }

    /// A sum with each of some words, rounded to it; the slowest.
    pub fn accumulate<const N: usize>(self, words: [Word; N]) -> Path {
        words.into_iter().fold(Path::default(), |slowest, word| {
            let bits = word.format.width();
            slowest.parallel(self.sum(bits).fit_word(word, bits))
        })
    }

    /// Compares and selects one of two words, within the cycles of the operator before it.
    pub fn limit(self, bits: i32) -> Path {
        self.step(0, adder(bits)).choose(2)
    }

    /// Compares two words, within the cycles of the operator before it.
    pub fn compare(self, bits: i32) -> Path {
        self.step(0, adder(bits))
    }

    /// Counts the places before the leading one.
    pub fn count(self, bits: i32) -> Path {
        self.step(NORMALISE, adder(bits))
    }

    /// Reads or writes a memory.
    pub fn memory(self) -> Path {
        self.step(1, 150)
    }

    /// Registers without an operator.
    pub fn wait(self, cycles: u32) -> Path {
        self.step(cycles, 0)
    }

    /// Appends another path.
    pub fn then(self, other: Path) -> Path {
        self.step(other.cycles, other.delay)
    }

    /// The longer of two parallel paths.
    pub fn parallel(self, other: Path) -> Path {
        Path {
            cycles: self.cycles.max(other.cycles),
            delay: self.delay.max(other.delay),
        }
    }

    /// The path `count` times in series.
    pub fn times(self, count: u32) -> Path {
        Path {
            cycles: self.cycles.saturating_mul(count),
            delay: self.delay.saturating_mul(count),
        }
    }

    /// Least cycles at a clock, with registers that cut the path evenly; none if the register takes
    /// the whole cycle.
    pub fn least_cycles(self, technology: Technology, clock_hz: u64) -> Option<u32> {
        let Some(fo4_fs) = technology.fo4_fs() else {
            return Some(1);
        };
        let period = period(fo4_fs, clock_hz);
        let left = period
            .checked_sub(u64::from(REGISTER))
            .filter(|left| *left > 0)?;
        Some(
            u64::from(self.delay)
                .div_ceil(left)
                .clamp(1, u64::from(u32::MAX)) as u32,
        )
    }

    /// Default latency: as few cycles as the clock allows. Ideal gates take no time; their latency
    /// is that of operators with their own registers.
    pub fn cycles_at(self, timing: &Timing) -> u32 {
        if timing.technology == Technology::Ideal {
            return self.cycles.max(1);
        }
        self.least_cycles(timing.technology, timing.clock_hz)
            .unwrap_or(1)
    }

    /// Cycles if every operator keeps its registers: [`Path::cycles`], or more if the clock
    /// requires more.
    pub fn registered_at(self, timing: &Timing) -> u32 {
        self.cycles.max(
            self.least_cycles(timing.technology, timing.clock_hz)
                .unwrap_or(1),
        )
    }

    /// Highest clock at which it takes at most `cycles` cycles, Hz; none if any clock does.
    pub fn highest_clock(self, technology: Technology, cycles: u32) -> Option<u64> {
        let fo4_fs = technology.fo4_fs()?;
        let period = self.delay.div_ceil(cycles.max(1)).saturating_add(REGISTER);
        Some(10_000_000_000_000_000 / (u64::from(period) * fo4_fs))
    }
}

/// A clock period, tenths of FO4.
fn period(fo4_fs: u64, clock_hz: u64) -> u64 {
    10_000_000_000_000_000 / clock_hz.max(1).saturating_mul(fo4_fs).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wider_operator_is_never_faster() {
        let operators: [fn(i32) -> Path; 6] = [
            |bits| Path::default().product(bits, 18),
            |bits| Path::default().product(18, bits),
            |bits| Path::default().sum(bits),
            |bits| Path::default().table(bits),
            |bits| Path::default().normalise(bits),
            |bits| Path::default().fit(bits),
        ];
        for operator in operators {
            for bits in -2..62 {
                let [narrow, wide] = [bits, bits + 1].map(operator);
                assert!(
                    narrow.delay <= wide.delay && narrow.cycles == wide.cycles,
                    "{bits} bits: {narrow:?}, {wide:?}"
                );
            }
        }
    }

    #[test]
    fn a_faster_clock_never_takes_fewer_cycles() {
        let path = Path::default().product(24, 24).sum(48).normalise(48);
        for technology in [
            Technology::Nm180,
            Technology::Nm65,
            Technology::Nm28,
            Technology::Nm7,
            Technology::Fpga,
        ] {
            let mut before = 0;
            for megahertz in 1..4000 {
                let Some(cycles) = path.least_cycles(technology, megahertz * 1_000_000) else {
                    assert_eq!(
                        path.least_cycles(technology, (megahertz + 1) * 1_000_000),
                        None
                    );
                    continue;
                };
                assert!(cycles >= before, "{technology:?} at {megahertz} MHz");
                before = cycles;
            }
            assert!(before > 0);
        }
    }

    #[test]
    fn the_least_cycles_leave_room_for_a_register_in_each_period() {
        // 100 FO4 of 10 ps and a register of 5 FO4: 1.05 ns in one cycle, 0.55 ns in two.
        let path = Path {
            cycles: 1,
            delay: 1000,
        };
        let at = |megahertz: u64| path.least_cycles(Technology::Nm28, megahertz * 1_000_000);
        assert_eq!(
            [at(952), at(953), at(1818), at(1819)],
            [Some(1), Some(2), Some(2), Some(3)]
        );
        assert_eq!(at(20_000), None);
        assert_eq!(
            path.highest_clock(Technology::Nm28, 1)
                .map(|hz| hz / 1_000_000),
            Some(952)
        );
        assert_eq!(path.least_cycles(Technology::Ideal, u64::MAX), Some(1));
    }
}
