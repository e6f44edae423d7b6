//! Vector lanes are held to plain lanes, operation by operation; plain lanes to what the words say.

use super::*;
use crate::host::{Work, plainly, vectorised};
use proptest::prelude::*;

/// Every operation on a few operands.
struct Everything<'a> {
    a: [i64; LANES],
    b: [i64; LANES],
    by: u32,
    table: &'a [i64],
    keys: [i32; 4],
}

impl Work for Everything<'_> {
    type Output = Vec<[i64; LANES]>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let [a, b] = [self.a, self.b].map(L::from_array);
        // Multiplier operands are words of at most 32 bits.
        let (narrow_a, narrow_b) = (a.right(32), b.right(32));
        let all = [
            L::splat(self.a[0]),
            a.right(1) + b.right(1),
            a.right(1) - b.right(1),
            narrow_a * narrow_b,
            -a.right(1),
            a & b,
            a | b,
            a.left(self.by),
            a.right(self.by),
            a.max(b),
            a.min(b),
            a.above(b),
            a.look_up(self.table),
            {
                let (distance, index) = L::nearest_of_4(&self.keys, self.a[0] as i32);
                L::splat(i64::from(distance) * 4 + index as i64)
            },
        ];
        all.into_iter().map(L::to_array).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn vector_lanes_equal_plain_lanes(
        a in prop::array::uniform8(any::<i64>()), b in prop::array::uniform8(any::<i64>()),
        by in 0..64u32, table_bits in 0..6u32, equal in 0..8usize,
        keys in prop::array::uniform4(prop_oneof![any::<i32>(), Just(i32::MIN), 0..4]),
    ) {
        let mut b = b;
        b[equal] = a[equal];
        let mut a = a;
        a[0] = if equal < 4 { i64::from(keys[equal]) } else { a[0] };
        let table: Vec<i64> = (0..1 << table_bits).map(|i| i * 1_000_003 - 7).collect();
        let work = || Everything { a, b, by, table: &table, keys };
        prop_assert_eq!(vectorised(work()), plainly(work()));
    }
}

#[test]
fn plain_lanes_do_what_words_do() {
    let a = Plain([3, -3, 0, 7, i64::MAX, -1, 12, -64]);
    let b = Plain([4, -4, 0, -7, 5, 1, 12, 64]);
    assert_eq!(a.above(b).0, [0, -1, 0, -1, -1, 0, 0, 0]);
    assert_eq!(a.right(1).0, [1, -2, 0, 3, i64::MAX / 2, -1, 6, -32]);
    assert_eq!(a.look_up(&[10, 11, 12, 13]).0, [13, 11, 10, 13, 13, 13, 10, 10]);
}
