//! Vector lanes, checked against plain lanes, operation by operation; plain lanes, checked against
//! words.

use super::*;
use crate::kernels::host::{Kernel, unvectorised, vectorised};
use proptest::prelude::*;

/// Every operation on a few operands.
struct Everything<'a> {
    a: [i64; LANES],
    b: [i64; LANES],
    by: [i64; LANES],
    table: &'a [i64],
    keys: [i32; LANES],
}

impl Kernel for Everything<'_> {
    type Output = Vec<[i64; LANES]>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let [a, b] = [self.a, self.b].map(L::from_array);
        let uniform = self.by[0] as u32;
        // Multiplier operands are words of at most 32 bits.
        let (narrow_a, narrow_b) = (a.right(32), b.right(32));
        let pairs = a.look_up_pairs(self.table.as_chunks().0);
        let (low, high) = (
            self.a.map(|word| word as i32),
            self.b.map(|word| word as i32),
        );
        let mut sums = self.keys;
        let limits = [
            low.map(|word| word.min(1000)),
            high.map(|word| word.max(-1000)),
        ];
        let unlimited = L::add_product(
            &mut sums,
            &low,
            self.b[0] as i32,
            &high,
            &self.by.map(|by| by as i32 / 2),
            [&limits[0], &limits[1]],
        );
        let all = [
            L::splat(self.a[0]),
            a.right(1) + b.right(1),
            a.right(1) - b.right(1),
            narrow_a * narrow_b,
            -a.right(1),
            a & b,
            a | b,
            a.left(uniform),
            a.right(uniform),
            a.max(b),
            a.min(b),
            a.min_of_halves(b),
            a.above(b),
            a.look_up(self.table),
            L::splat(i64::from(a.any_negative())),
            L::splat(i64::from(a.signs())),
            L::splat(i64::from(L::near(
                &self.keys,
                self.a[0] as i32,
                self.b[0] as u32 >> (self.by[0] / 2),
            ))),
            L::splat(L::nearest(&self.keys, self.a[0] as i32) as i64),
            L::from_bytes(self.a[0].to_le_bytes()),
            a.wrapping_add(b),
            a.times(b & L::splat(0xffff_ffff)),
            a.max(L::splat(0)).right_unsigned(uniform),
            pairs[0],
            pairs[1],
            L::from_array(sums.map(i64::from)),
            L::from_array(unlimited.to_array().map(i64::from)),
            L::from_array(a.low().to_array().map(i64::from)),
        ];
        let transposed = L::transposed(&std::array::from_fn(|item| {
            low.map(|word| word.rotate_left(item as u32))
        }));
        all.into_iter().chain(transposed).map(L::to_array).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn vector_lanes_equal_plain_lanes(
        a in prop::array::uniform8(any::<i64>()), b in prop::array::uniform8(any::<i64>()),
        by in prop::array::uniform8(0..64i64), table_bits in 1..6u32, equal in 0..8usize,
        keys in prop::array::uniform8(prop_oneof![any::<i32>(), Just(i32::MIN), 0..4]),
    ) {
        let mut b = b;
        b[equal] = a[equal];
        let mut a = a;
        a[0] = if b[0] < 0 { i64::from(keys[equal]) } else { a[0] };
        let table: Vec<i64> = (0..1 << table_bits).map(|i| i * 1_000_003 - 7).collect();
        let work = || Everything { a, b, by, table: &table, keys };
        prop_assert_eq!(vectorised(work()), unvectorised(work()));
    }
}

#[test]
fn plain_lanes_compute_what_single_words_do() {
    let a = Plain([3, -3, 0, 7, i64::MAX, -1, 12, -64]);
    let b = Plain([4, -4, 0, -7, 5, 1, 12, 64]);
    assert_eq!(a.above(b).0, [0, -1, 0, -1, -1, 0, 0, 0]);
    assert_eq!(a.right(1).0, [1, -2, 0, 3, i64::MAX / 2, -1, 6, -32]);
    assert_eq!(
        a.look_up(&[10, 11, 12, 13]).0,
        [13, 11, 10, 13, 13, 13, 10, 10]
    );
}
