//! Packed: a fragment in the host's words; eight sums of 32 bits fill one vector register.

use super::tile::NO_MATCH;
use crate::num::{Fit, Lanes, LimitedWords, Word, Words};
use crate::records::{Attributes, SUMS, Slot, Sums};

/// [`Sums`] in the host's words.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct PackedSums<A>(pub [A; SUMS]);

impl<A: Accumulator> PackedSums<A> {
    /// From words that fit.
    pub fn put(sums: &Sums) -> Self {
        PackedSums(sums.map(A::put))
    }

    /// The words.
    pub fn get(&self) -> Sums {
        self.0.map(A::get)
    }
}

/// The host's word for a sum: 32 bits if every value fits, else 64.
pub trait Accumulator: Copy + Default + Send + Sync + 'static {
    /// The limits in this word.
    fn limits(limits: &SumLimits) -> &Limits<Self>;
    /// Adds `weight · attributes`, each rounded, to sums that saturate. Returns the extremes for
    /// probes, if words of 31 bits hold every value.
    fn accumulate<V: Lanes>(
        sums: &mut PackedSums<Self>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<Self>,
    ) -> Option<LimitedWords<V::Words>>;
    /// From a word that fits.
    fn put(word: i64) -> Self;
    /// The word.
    fn get(self) -> i64;
}

/// Limits of an accumulation, lane by lane, if all of its fits are simple.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits<A> {
    half: [A; SUMS],
    right: [A; SUMS],
    min: [A; SUMS],
    max: [A; SUMS],
}

impl<A: Accumulator> Limits<A> {
    fn new(half: [i64; SUMS], right: [u32; SUMS], words: [Word; SUMS]) -> Self {
        Limits {
            half: half.map(A::put),
            right: right.map(|right| A::put(right.into())),
            min: words.map(|word| A::put(word.format.min())),
            max: words.map(|word| A::put(word.format.max())),
        }
    }
}

/// [`Limits`] in either word.
#[derive(Clone, Copy, Debug, Default)]
pub struct SumLimits {
    narrow: Limits<i32>,
    wide: Limits<i64>,
}

impl SumLimits {
    /// For sums in these words, each shifted right by `right` after its half is added.
    pub fn new(half: [i64; SUMS], right: [u32; SUMS], words: [Word; SUMS]) -> Self {
        SumLimits {
            narrow: Limits::new(half, right, words),
            wide: Limits::new(half, right, words),
        }
    }
}

impl Accumulator for i32 {
    fn limits(limits: &SumLimits) -> &Limits<i32> {
        &limits.narrow
    }
    #[inline(always)]
    fn accumulate<V: Lanes>(
        sums: &mut PackedSums<i32>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<i32>,
    ) -> Option<LimitedWords<V::Words>> {
        let Limits {
            half,
            right,
            min,
            max,
        } = limits;
        let unlimited = V::add_product(
            &mut sums.0,
            attributes,
            weight as i32,
            half,
            right,
            [min, max],
        );
        let words = V::Words::from_array(sums.0);
        Some(LimitedWords {
            words,
            limited: !(unlimited - words).is_zero().signs(),
        })
    }
    #[inline(always)]
    fn put(word: i64) -> i32 {
        word as i32
    }
    #[inline(always)]
    fn get(self) -> i64 {
        i64::from(self)
    }
}

impl Accumulator for i64 {
    fn limits(limits: &SumLimits) -> &Limits<i64> {
        &limits.wide
    }
    #[inline(always)]
    fn accumulate<V: Lanes>(
        PackedSums(sums): &mut PackedSums<i64>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<i64>,
    ) -> Option<LimitedWords<V::Words>> {
        // Both words have at most 32 bits: one multiplication.
        let weight = weight as i32;
        for lane in 0..SUMS {
            let product = i64::from(attributes[lane]) * i64::from(weight);
            let rounded = (product + limits.half[lane]) >> (limits.right[lane] & 63);
            sums[lane] = (sums[lane] + rounded)
                .max(limits.min[lane])
                .min(limits.max[lane]);
        }
        None
    }
    #[inline(always)]
    fn put(word: i64) -> i64 {
        word
    }
    #[inline(always)]
    fn get(self) -> i64 {
        self
    }
}

/// Whether 32 bits hold a lane's product, its rounding and its sum.
pub fn fits_32_bits(weight: Word, attribute: Word, sum: Word, fit: &Fit) -> bool {
    let most = i128::from(weight.format.max()) * i128::from(attribute.format.max())
        + i128::from(fit.half());
    let least = i128::from(weight.format.max()) * i128::from(attribute.format.min());
    let held = i128::from(i32::MIN)..=i128::from(i32::MAX);
    let right = fit.places().clamp(0, 62);
    let sums = [sum.format.max(), sum.format.min()].map(i128::from);
    held.contains(&most)
        && held.contains(&least)
        && held.contains(&(sums[0] + (most >> right)))
        && held.contains(&(sums[1] + (least >> right)))
        && right < 32
}

/// A fragment, unpacked from its slot, in the host's words.
#[derive(Clone, Copy, Debug, Default)]
pub struct PackedSlot<A> {
    /// Its sums.
    pub sums: PackedSums<A>,
    /// Its depth, with [`NO_MATCH`] if no contribution may match it.
    pub key: i32,
    /// Index into the frame's materials.
    pub material: u32,
}

impl<A: Accumulator> PackedSlot<A> {
    /// The fragment.
    pub fn get(&self) -> Slot {
        Slot {
            sums: self.sums.get(),
            depth: i64::from(self.depth()),
            material: self.material,
            shaded: self.key < 0,
        }
    }

    /// From words that fit.
    pub fn put(slot: &Slot) -> Self {
        let key = slot.depth as i32 | if slot.shaded { NO_MATCH } else { 0 };
        PackedSlot {
            sums: PackedSums::put(&slot.sums),
            key,
            material: slot.material,
        }
    }

    /// Its depth.
    #[inline(always)]
    pub fn depth(&self) -> i32 {
        self.key & !NO_MATCH
    }
}
