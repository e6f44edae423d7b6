//! Host: how the simulator uses the host computer. This module is not hardware, and does not change
//! a bit of any result.
//!
//! The only `unsafe` code of the crate: vector instructions, after detection. They only gain speed
//! (`cargo bench`), and are checked against plain lanes and words, operation by operation and frame
//! by frame, by `vector_lanes_equal_plain_lanes`, `vector_words_equal_plain_words` and
//! `every_machine_that_elaborates_draws_every_frame`.
#![allow(unsafe_code, reason = "see above; everywhere else it is denied")]

use crate::num::lanes::Plain;
use crate::num::{LANES, Lanes};

/// A kernel: work that gains from vector instructions. To be compiled for them, `run` and
/// everything it calls must be `#[inline(always)]`.
pub trait Kernel {
    /// Result of the work.
    type Output;
    /// Does the work, with this kind of lanes.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// A way to run kernels.
pub trait Host: Copy + Send + Sync {
    /// Whether eight lanes take less time than eight single items.
    const VECTORISED: bool;
    /// Runs a kernel.
    fn run<K: Kernel>(self, kernel: K) -> K::Output;
}

/// With vector instructions. Values exist only if the host has them.
#[derive(Clone, Copy, Debug)]
pub struct Vectorised(());

impl Vectorised {
    /// A value if the host has the instructions.
    pub fn detect() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        return avx2::detected().then_some(Vectorised(()));
        #[cfg(not(target_arch = "x86_64"))]
        None
    }
}

impl Host for Vectorised {
    const VECTORISED: bool = true;

    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the features were detected when this was made.
        return unsafe { avx2::run(kernel) };
        #[cfg(not(target_arch = "x86_64"))]
        unvectorised(kernel)
    }
}

/// Without vector instructions.
#[derive(Clone, Copy, Debug)]
pub struct Unvectorised;

impl Host for Unvectorised {
    const VECTORISED: bool = false;

    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        unvectorised(kernel)
    }
}

/// Runs a kernel with vector instructions if the host has them.
pub fn vectorised<K: Kernel>(kernel: K) -> K::Output {
    match Vectorised::detect() {
        Some(host) => host.run(kernel),
        None => unvectorised(kernel),
    }
}

/// Runs a kernel without vector instructions. Not inlined, so that each kernel is compiled once.
#[inline(never)]
pub fn unvectorised<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Plain>()
}

/// Eight lanes in two AVX2 registers, eight words in one.
#[cfg(target_arch = "x86_64")]
pub mod avx2 {
    use super::{Kernel, LANES, Lanes};
    use crate::num::{Exacts, Words, two};
    use std::arch::x86_64::*;
    use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

    /// Whether the host has every instruction that this module uses.
    pub fn detected() -> bool {
        is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
    }

    /// Runs a kernel on [`Vectors`].
    ///
    /// # Safety
    /// The host must have the instructions: [`detected`].
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    pub unsafe fn run<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Vectors>()
    }

    /// Eight lanes. Values exist only inside [`run`], so the host has the instructions below.
    #[derive(Clone, Copy, Debug)]
    pub struct Vectors([__m256i; 2]);

    /// The same instruction on both registers.
    ///
    /// SAFETY: values of [`Vectors`] exist only inside [`run`], whose caller ensures that the host
    /// has the instructions.
    macro_rules! both {
        ($i:ident => $instruction:expr) => {
            Vectors(unsafe {
                [
                    {
                        let $i = 0;
                        $instruction
                    },
                    {
                        let $i = 1;
                        $instruction
                    },
                ]
            })
        };
    }

    /// Eight words of 32 bits in a register.
    macro_rules! eight {
        ($words:expr) => {
            _mm256_loadu_si256($words.as_ptr().cast())
        };
    }

    /// The sign of 64 bits.
    const SIGN: i64 = i64::MIN;

    impl Lanes for Vectors {
        type Words = VectorWords;

        #[inline(always)]
        fn from_array(words: [i64; LANES]) -> Self {
            both!(i => _mm256_loadu_si256(words.as_ptr().add(4 * i).cast()))
        }
        #[inline(always)]
        fn from_bytes(bytes: [u8; LANES]) -> Self {
            both!(i => _mm256_cvtepu8_epi64(_mm_cvtsi64_si128(i64::from_le_bytes(bytes) >> (32 * i))))
        }
        #[inline(always)]
        fn transposed(items: &[[i32; LANES]; LANES]) -> [Self; LANES] {
            // Word n of four items, each followed by their word n + 4, for n from 0 to 3.
            macro_rules! four {
                ($first:expr) => {{
                    let (a, b) = (eight!(items[$first]), eight!(items[$first + 1]));
                    let (c, d) = (eight!(items[$first + 2]), eight!(items[$first + 3]));
                    let (ab, cd) = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
                    let (ab_after, cd_after) =
                        (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
                    [
                        _mm256_unpacklo_epi64(ab, cd),
                        _mm256_unpackhi_epi64(ab, cd),
                        _mm256_unpacklo_epi64(ab_after, cd_after),
                        _mm256_unpackhi_epi64(ab_after, cd_after),
                    ]
                }};
            }
            // SAFETY: as `both`; every item is eight words.
            let fours = unsafe { [four!(0), four!(4)] };
            macro_rules! words {
                ($n:expr, $quarter:ident => $low_or_high:expr) => {
                    Vectors(two!(half => {
                        let $quarter = fours[half][$n];
                        unsafe { _mm256_cvtepi32_epi64($low_or_high) }
                    }))
                };
            }
            macro_rules! both_words {
                ($n:expr) => {
                    [words!($n, four => _mm256_castsi256_si128(four)), words!($n, four => _mm256_extracti128_si256::<1>(four))]
                };
            }
            let [[w0, w4], [w1, w5], [w2, w6], [w3, w7]] = [
                both_words!(0),
                both_words!(1),
                both_words!(2),
                both_words!(3),
            ];
            [w0, w1, w2, w3, w4, w5, w6, w7]
        }
        #[inline(always)]
        fn to_array(self) -> [i64; LANES] {
            let mut words = [0; LANES];
            // SAFETY: as `both`; the array holds both registers.
            unsafe {
                _mm256_storeu_si256(words.as_mut_ptr().cast(), self.0[0]);
                _mm256_storeu_si256(words.as_mut_ptr().add(4).cast(), self.0[1]);
            }
            words
        }
        #[inline(always)]
        fn splat(word: i64) -> Self {
            both!(_i => _mm256_set1_epi64x(word))
        }
        #[inline(always)]
        fn low(self) -> VectorWords {
            // SAFETY: as `both`. Low halves by pairs, then pairs in order.
            VectorWords(unsafe {
                let [a, b] = [
                    _mm256_castsi256_ps(self.0[0]),
                    _mm256_castsi256_ps(self.0[1]),
                ];
                let low = _mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(a, b));
                _mm256_permute4x64_epi64::<0b11_01_10_00>(low)
            })
        }
        #[inline(always)]
        fn left(self, by: u32) -> Self {
            both!(i => _mm256_sll_epi64(self.0[i], _mm_cvtsi32_si128(by as i32)))
        }
        // AVX2 has only unsigned right shifts of 64-bit lanes; adding 2^63 makes the lanes
        // unsigned.
        #[inline(always)]
        fn right(self, by: u32) -> Self {
            let moved = Self::splat((SIGN as u64 >> by) as i64);
            both!(i => {
                let biased = _mm256_xor_si256(self.0[i], _mm256_set1_epi64x(SIGN));
                _mm256_sub_epi64(_mm256_srl_epi64(biased, _mm_cvtsi32_si128(by as i32)), moved.0[i])
            })
        }
        #[inline(always)]
        fn right_unsigned(self, by: u32) -> Self {
            both!(i => _mm256_srl_epi64(self.0[i], _mm_cvtsi32_si128(by as i32)))
        }
        #[inline(always)]
        fn wrapping_add(self, other: Self) -> Self {
            self + other
        }
        #[inline(always)]
        fn times(self, naturals: Self) -> Self {
            both!(i => {
                let high = _mm256_mul_epu32(_mm256_srli_epi64::<32>(self.0[i]), naturals.0[i]);
                _mm256_add_epi64(_mm256_mul_epu32(self.0[i], naturals.0[i]), _mm256_slli_epi64::<32>(high))
            })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            both!(i => _mm256_blendv_epi8(self.0[i], other.0[i], _mm256_cmpgt_epi64(other.0[i], self.0[i])))
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            both!(i => _mm256_blendv_epi8(self.0[i], other.0[i], _mm256_cmpgt_epi64(self.0[i], other.0[i])))
        }
        #[inline(always)]
        fn min_of_halves(self, other: Self) -> Self {
            both!(i => _mm256_min_epu32(self.0[i], other.0[i]))
        }
        #[inline(always)]
        fn above(self, other: Self) -> Self {
            both!(i => _mm256_cmpgt_epi64(self.0[i], other.0[i]))
        }
        #[inline(always)]
        fn look_up(self, table: &[i64]) -> Self {
            assert!(table.len().is_power_of_two(), "a table has 2^n words");
            let low = table.len() as i64 - 1;
            // SAFETY: as `both`; the address is cut to the table's length, a power of two.
            both!(i => _mm256_i64gather_epi64::<8>(table.as_ptr(), _mm256_and_si256(self.0[i], _mm256_set1_epi64x(low))))
        }
        #[inline(always)]
        fn look_up_pairs(self, table: &[[i64; 2]]) -> [Self; 2] {
            assert!(table.len().is_power_of_two(), "a table has 2^n pairs");
            let words = table.as_flattened().as_ptr();
            let even = self.left(1) & Self::splat(2 * (table.len() as i64 - 1));
            // SAFETY: as `both`; the address is cut to the table's length, a power of two.
            two!(word => both!(i => _mm256_i64gather_epi64::<8>(words.add(word), even.0[i])))
        }
        #[inline(always)]
        fn prefetch<T>(item: &T) {
            let first = std::ptr::from_ref(item).cast::<i8>();
            for line in (0..size_of::<T>()).step_by(64) {
                // SAFETY: a line of the item; a prefetch has no effect on values.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(first.add(line)) };
            }
        }
        #[inline(always)]
        fn signs(self) -> u8 {
            // SAFETY: as `both`.
            let [low, high] =
                two!(i => unsafe { _mm256_movemask_pd(_mm256_castsi256_pd(self.0[i])) });
            (low | high << 4) as u8
        }
        #[inline(always)]
        fn add_product(
            sums: &mut [i32; LANES],
            words: &[i32; LANES],
            factor: i32,
            half: &[i32; LANES],
            right: &[i32; LANES],
            [min, max]: [&[i32; LANES]; 2],
        ) -> VectorWords {
            // SAFETY: as `both`; every array is eight words.
            unsafe {
                let product = _mm256_mullo_epi32(eight!(words), _mm256_set1_epi32(factor));
                let rounded =
                    _mm256_srav_epi32(_mm256_add_epi32(product, eight!(half)), eight!(right));
                let sum = _mm256_add_epi32(eight!(sums), rounded);
                let limited = _mm256_min_epi32(_mm256_max_epi32(sum, eight!(min)), eight!(max));
                _mm256_storeu_si256(sums.as_mut_ptr().cast(), limited);
                VectorWords(sum)
            }
        }
        #[inline(always)]
        fn near(keys: &[i32; LANES], word: i32, limit: u32) -> u32 {
            // SAFETY: as `both`.
            unsafe {
                let distance = distance(eight!(keys), word);
                let far = _mm256_cmpeq_epi32(
                    _mm256_max_epu32(distance, _mm256_set1_epi32(limit as i32)),
                    distance,
                );
                _mm256_movemask_ps(_mm256_castsi256_ps(far)) as u32 ^ 0xff
            }
        }
        #[inline(always)]
        fn nearest(keys: &[i32; LANES], word: i32) -> usize {
            // SAFETY: as `both`.
            unsafe {
                let distance = distance(eight!(keys), word);
                let least =
                    _mm256_min_epu32(distance, _mm256_permute2x128_si256::<1>(distance, distance));
                let least = _mm256_min_epu32(least, _mm256_shuffle_epi32::<0b01_00_11_10>(least));
                let least = _mm256_min_epu32(least, _mm256_shuffle_epi32::<0b10_11_00_01>(least));
                let equal =
                    _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(distance, least)));
                equal.trailing_zeros() as usize
            }
        }
    }

    /// Distances of eight words from another word; 2^31 is correct as an unsigned number.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn distance(words: __m256i, word: i32) -> __m256i {
        _mm256_abs_epi32(_mm256_sub_epi32(_mm256_set1_epi32(word), words))
    }

    impl Add for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn add(self, other: Vectors) -> Vectors {
            both!(i => _mm256_add_epi64(self.0[i], other.0[i]))
        }
    }

    impl Sub for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn sub(self, other: Vectors) -> Vectors {
            both!(i => _mm256_sub_epi64(self.0[i], other.0[i]))
        }
    }

    impl Neg for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn neg(self) -> Vectors {
            both!(i => _mm256_sub_epi64(_mm256_setzero_si256(), self.0[i]))
        }
    }

    impl BitAnd for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn bitand(self, other: Vectors) -> Vectors {
            both!(i => _mm256_and_si256(self.0[i], other.0[i]))
        }
    }

    impl BitOr for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn bitor(self, other: Vectors) -> Vectors {
            both!(i => _mm256_or_si256(self.0[i], other.0[i]))
        }
    }

    /// Product of two words of at most 32 bits each.
    impl Mul for Vectors {
        type Output = Vectors;
        #[inline(always)]
        fn mul(self, other: Vectors) -> Vectors {
            both!(i => _mm256_mul_epi32(self.0[i], other.0[i]))
        }
    }

    /// Eight words in one register. Values exist only inside [`run`], as those of [`Vectors`].
    #[derive(Clone, Copy, Debug)]
    pub struct VectorWords(__m256i);

    /// Eight exact results: even lanes in the first register, odd lanes in the second, as the
    /// products of 32-bit words are.
    #[derive(Clone, Copy, Debug)]
    pub struct VectorExacts([__m256i; 2]);

    /// One instruction on a register of words.
    ///
    /// SAFETY: values of [`VectorWords`] exist only inside [`run`], whose caller ensures that the
    /// host has the instructions.
    macro_rules! word {
        ($instruction:expr) => {
            VectorWords(unsafe { $instruction })
        };
    }

    /// The same instruction on even and odd lanes.
    ///
    /// SAFETY: as `word`.
    macro_rules! even_and_odd {
        ($i:ident => $instruction:expr) => {
            VectorExacts(two!($i => unsafe { $instruction }))
        };
    }

    impl VectorWords {
        /// Odd lanes moved to the even ones.
        #[inline(always)]
        fn odd(self) -> Self {
            word!(_mm256_shuffle_epi32::<0b11_11_01_01>(self.0))
        }

        /// Even and odd words, extended with zeros.
        #[inline(always)]
        fn natural(self) -> [__m256i; 2] {
            // SAFETY: as `word`.
            unsafe {
                [
                    _mm256_blend_epi32::<0b10101010>(self.0, _mm256_setzero_si256()),
                    _mm256_srli_epi64::<32>(self.0),
                ]
            }
        }
    }

    impl Words for VectorWords {
        type Exact = VectorExacts;

        #[inline(always)]
        fn from_array(words: [i32; LANES]) -> Self {
            word!(_mm256_loadu_si256(words.as_ptr().cast()))
        }
        #[inline(always)]
        fn from_bytes(bytes: [u8; LANES]) -> Self {
            word!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(
                bytes
            ))))
        }
        #[inline(always)]
        fn times(self, other: Self) -> Self {
            word!(_mm256_mullo_epi32(self.0, other.0))
        }
        #[inline(always)]
        fn to_array(self) -> [i32; LANES] {
            let mut words = [0; LANES];
            // SAFETY: as `word`; the array holds the register.
            unsafe { _mm256_storeu_si256(words.as_mut_ptr().cast(), self.0) };
            words
        }
        #[inline(always)]
        fn splat(word: i64) -> Self {
            debug_assert!(
                word == i64::from(word as i32),
                "a constant is wider than 32 bits"
            );
            word!(_mm256_set1_epi32(word as i32))
        }
        #[inline(always)]
        fn exact(self) -> VectorExacts {
            self * Self::splat(1)
        }
        #[inline(always)]
        fn left(self, by: u32) -> Self {
            word!(_mm256_sll_epi32(self.0, _mm_cvtsi32_si128(by as i32)))
        }
        #[inline(always)]
        fn right(self, by: u32) -> Self {
            word!(_mm256_sra_epi32(self.0, _mm_cvtsi32_si128(by as i32)))
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            word!(_mm256_max_epi32(self.0, other.0))
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            word!(_mm256_min_epi32(self.0, other.0))
        }
        #[inline(always)]
        fn above(self, other: Self) -> Self {
            word!(_mm256_cmpgt_epi32(self.0, other.0))
        }
        #[inline(always)]
        fn where_else(self, condition: Self, other: Self) -> Self {
            word!(_mm256_blendv_epi8(other.0, self.0, condition.0))
        }
        #[inline(always)]
        fn is_zero(self) -> Self {
            word!(_mm256_cmpeq_epi32(self.0, _mm256_setzero_si256()))
        }
        #[inline(always)]
        fn abs(self) -> Self {
            word!(_mm256_abs_epi32(self.0))
        }
        #[inline(always)]
        fn look_up(self, table: &[i32]) -> Self {
            assert!(table.len().is_power_of_two(), "a table has 2^n words");
            let low = table.len() as i32 - 1;
            // SAFETY: as `word`; the address is cut to the table's length, a power of two.
            word!(_mm256_i32gather_epi32::<4>(
                table.as_ptr(),
                _mm256_and_si256(self.0, _mm256_set1_epi32(low))
            ))
        }
        #[inline(always)]
        fn look_up_pairs(self, table: &[[i32; 2]]) -> [Self; 2] {
            assert!(table.len().is_power_of_two(), "a table has 2^n pairs");
            let at = (Self::splat(table.len() as i64 - 1) & self).to_array();
            // Two pairs per half register, one load each. A gather of eight takes about forty
            // operations on hosts that split it up.
            //
            // SAFETY: as `word`; the address is cut to the table's length, a power of two.
            macro_rules! pairs {
                ($a:literal, $b:literal) => {
                    _mm_set_epi64x(pair!($b), pair!($a))
                };
            }
            macro_rules! pair {
                ($n:literal) => {
                    table
                        .as_ptr()
                        .add(at[$n] as usize)
                        .cast::<i64>()
                        .read_unaligned()
                };
            }
            unsafe {
                let ends = _mm256_castsi256_ps(_mm256_set_m128i(pairs!(4, 5), pairs!(0, 1)));
                let others = _mm256_castsi256_ps(_mm256_set_m128i(pairs!(6, 7), pairs!(2, 3)));
                [
                    VectorWords(_mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(
                        ends, others,
                    ))),
                    VectorWords(_mm256_castps_si256(_mm256_shuffle_ps::<0b11_01_11_01>(
                        ends, others,
                    ))),
                ]
            }
        }
        #[inline(always)]
        fn wrapping_add(self, other: Self) -> Self {
            self + other
        }
        #[inline(always)]
        fn wrapping_times(self, other: Self) -> Self {
            self.times(other)
        }
        #[inline(always)]
        fn signs(self) -> u8 {
            // SAFETY: as `word`.
            unsafe { _mm256_movemask_ps(_mm256_castsi256_ps(self.0)) as u8 }
        }
        #[inline(always)]
        fn pick(self, lanes: Self) -> Self {
            word!(_mm256_permutevar8x32_epi32(self.0, lanes.0))
        }
        // By words, by pairs, by halves of the register.
        #[inline(always)]
        fn transposed(r: [Self; LANES]) -> [Self; LANES] {
            macro_rules! pairs {
                ($low:ident, $high:ident, $rows:ident: $($a:literal $b:literal),*) => {
                    [$(word!($low($rows[$a].0, $rows[$b].0)), word!($high($rows[$a].0, $rows[$b].0))),*]
                };
            }
            let w: [Self; LANES] =
                pairs!(_mm256_unpacklo_epi32, _mm256_unpackhi_epi32, r: 0 1, 2 3, 4 5, 6 7);
            let p: [Self; LANES] =
                pairs!(_mm256_unpacklo_epi64, _mm256_unpackhi_epi64, w: 0 2, 1 3, 4 6, 5 7);
            macro_rules! halves {
                ($half:literal: $($a:literal $b:literal),*) => { [$(word!(_mm256_permute2x128_si256::<$half>(p[$a].0, p[$b].0))),*] };
            }
            let [[a, b, c, d], [e, f, g, h]]: [[Self; 4]; 2] = [
                halves!(0x20: 0 4, 1 5, 2 6, 3 7),
                halves!(0x31: 0 4, 1 5, 2 6, 3 7),
            ];
            [a, b, c, d, e, f, g, h]
        }
    }

    impl Exacts for VectorExacts {
        type Words = VectorWords;

        #[inline(always)]
        fn from_array(w: [i64; LANES]) -> Self {
            even_and_odd!(i => _mm256_setr_epi64x(w[i], w[i + 2], w[i + 4], w[i + 6]))
        }
        #[inline(always)]
        fn to_array(self) -> [i64; LANES] {
            let mut parts = [[0; LANES / 2]; 2];
            let mut words = [0; LANES];
            for (i, part) in parts.iter_mut().enumerate() {
                // SAFETY: as `word`; the array holds the register.
                unsafe { _mm256_storeu_si256(part.as_mut_ptr().cast(), self.0[i]) };
            }
            for (i, word) in words.iter_mut().enumerate() {
                *word = parts[i % 2][i / 2];
            }
            words
        }
        #[inline(always)]
        fn from_evens_first(words: [i64; LANES]) -> Self {
            // SAFETY: as `word`; the array is two registers.
            even_and_odd!(i => _mm256_loadu_si256(words.as_ptr().add(i * LANES / 2).cast()))
        }
        #[inline(always)]
        fn to_evens_first(self) -> [i64; LANES] {
            let mut words = [0; LANES];
            for (i, half) in self.0.into_iter().enumerate() {
                // SAFETY: as `word`; the array holds two registers.
                unsafe { _mm256_storeu_si256(words.as_mut_ptr().add(i * LANES / 2).cast(), half) };
            }
            words
        }
        #[inline(always)]
        fn splat(word: i64) -> Self {
            even_and_odd!(_i => _mm256_set1_epi64x(word))
        }
        #[inline(always)]
        fn left(self, by: u32) -> Self {
            even_and_odd!(i => _mm256_sll_epi64(self.0[i], _mm_cvtsi32_si128(by as i32)))
        }
        #[inline(always)]
        fn left_by(self, by: VectorWords) -> Self {
            let by = by.natural();
            even_and_odd!(i => _mm256_sllv_epi64(self.0[i], by[i]))
        }
        // As in `Vectors`.
        #[inline(always)]
        fn right(self, by: u32) -> Self {
            let moved = Self::splat((SIGN as u64 >> by) as i64);
            even_and_odd!(i => {
                let biased = _mm256_xor_si256(self.0[i], _mm256_set1_epi64x(SIGN));
                _mm256_sub_epi64(_mm256_srl_epi64(biased, _mm_cvtsi32_si128(by as i32)), moved.0[i])
            })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            even_and_odd!(i => _mm256_blendv_epi8(self.0[i], other.0[i], _mm256_cmpgt_epi64(other.0[i], self.0[i])))
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            even_and_odd!(i => _mm256_blendv_epi8(self.0[i], other.0[i], _mm256_cmpgt_epi64(self.0[i], other.0[i])))
        }
        #[inline(always)]
        fn above(self, other: Self) -> VectorWords {
            even_and_odd!(i => _mm256_cmpgt_epi64(self.0[i], other.0[i])).low()
        }
        #[inline(always)]
        fn abs(self) -> Self {
            let negated = -self;
            even_and_odd!(i => {
                let (own, negated) = (_mm256_castsi256_pd(self.0[i]), _mm256_castsi256_pd(negated.0[i]));
                _mm256_castpd_si256(_mm256_blendv_pd(own, negated, own))
            })
        }
        // From the exponent of a double. The bits after the leading one are cleared, so no lane is
        // rounded up to the next power of two. Both halves become doubles by placing them below a
        // much higher one, which is then subtracted.
        #[inline(always)]
        fn leading_zeros(self) -> VectorWords {
            const LOW: i64 = 0x4330_0000_0000_0000;
            const HIGH: i64 = 0x4530_0000_0000_0000;
            const BOTH: i64 = 0x4530_0000_0010_0000;
            let floats = even_and_odd!(i => {
                let lead = _mm256_andnot_si256(_mm256_srli_epi64::<1>(self.0[i]), self.0[i]);
                let low = _mm256_blend_epi32::<0b10101010>(lead, _mm256_set1_epi64x(LOW));
                let high = _mm256_or_si256(_mm256_srli_epi64::<32>(lead), _mm256_set1_epi64x(HIGH));
                let high = _mm256_sub_pd(_mm256_castsi256_pd(high), _mm256_castsi256_pd(_mm256_set1_epi64x(BOTH)));
                _mm256_castpd_si256(_mm256_add_pd(high, _mm256_castsi256_pd(low)))
            });
            VectorWords::splat(1086) - floats.cut_deep(52)
        }
        #[inline(always)]
        fn low(self) -> VectorWords {
            word!(_mm256_blend_epi32::<0b10101010>(
                self.0[0],
                _mm256_shuffle_epi32::<0b10_10_00_00>(self.0[1])
            ))
        }
        #[inline(always)]
        fn cut(self, by: u32) -> VectorWords {
            // Results of odd lanes are already in the high halves.
            word!({
                let even = _mm256_srl_epi64(self.0[0], _mm_cvtsi32_si128(by as i32));
                let odd = _mm256_sll_epi64(self.0[1], _mm_cvtsi32_si128(32 - by as i32));
                _mm256_blend_epi32::<0b10101010>(even, odd)
            })
        }
        #[inline(always)]
        fn cut_deep(self, by: u32) -> VectorWords {
            let high = word!(_mm256_blend_epi32::<0b10101010>(
                _mm256_shuffle_epi32::<0b11_11_01_01>(self.0[0]),
                self.0[1]
            ));
            high.right(by - 32)
        }
        #[inline(always)]
        fn cut_by(self, by: VectorWords) -> Option<VectorWords> {
            // SAFETY: as `word`.
            if unsafe { _mm256_testz_si256(by.0, _mm256_set1_epi32(!63)) } == 0 {
                return None;
            }
            // If the count is in range, a shift is one instruction.
            let counts = (by & VectorWords::splat(63)).natural();
            let cut: Self = even_and_odd!(i => {
                let sign = _mm256_set1_epi64x(SIGN);
                let biased = _mm256_xor_si256(self.0[i], sign);
                _mm256_sub_epi64(_mm256_srlv_epi64(biased, counts[i]), _mm256_srlv_epi64(sign, counts[i]))
            });
            // A word of 31 bits, offset by half of their range, has no bits above them.
            let moved = cut + Self::splat(1 << 30);
            // SAFETY: as `word`.
            if unsafe {
                _mm256_testz_si256(
                    _mm256_or_si256(moved.0[0], moved.0[1]),
                    _mm256_set1_epi64x(-1 << 31),
                )
            } == 0
            {
                return None;
            }
            Some(cut.low())
        }
    }

    macro_rules! operator {
        ($($operator:ident $name:ident $words:ident $exacts:ident;)*) => {$(
            impl $operator for VectorWords {
                type Output = VectorWords;
                #[inline(always)]
                fn $name(self, other: VectorWords) -> VectorWords {
                    word!($words(self.0, other.0))
                }
            }

            impl $operator for VectorExacts {
                type Output = VectorExacts;
                #[inline(always)]
                fn $name(self, other: VectorExacts) -> VectorExacts {
                    even_and_odd!(i => $exacts(self.0[i], other.0[i]))
                }
            }
        )*};
    }
    operator! {
        Add add _mm256_add_epi32 _mm256_add_epi64;
        Sub sub _mm256_sub_epi32 _mm256_sub_epi64;
        BitAnd bitand _mm256_and_si256 _mm256_and_si256;
        BitOr bitor _mm256_or_si256 _mm256_or_si256;
    }

    impl Neg for VectorWords {
        type Output = VectorWords;
        #[inline(always)]
        fn neg(self) -> VectorWords {
            word!(_mm256_sub_epi32(_mm256_setzero_si256(), self.0))
        }
    }

    impl Neg for VectorExacts {
        type Output = VectorExacts;
        #[inline(always)]
        fn neg(self) -> VectorExacts {
            even_and_odd!(i => _mm256_sub_epi64(_mm256_setzero_si256(), self.0[i]))
        }
    }

    impl Mul for VectorWords {
        type Output = VectorExacts;
        #[inline(always)]
        fn mul(self, other: VectorWords) -> VectorExacts {
            let (own, other) = ([self, self.odd()], [other, other.odd()]);
            even_and_odd!(i => _mm256_mul_epi32(own[i].0, other[i].0))
        }
    }
}
