//! Vector words, checked against plain words, operation by operation; plain words, checked against
//! single words.

use super::*;
use crate::kernels::host::{Kernel, unvectorised, vectorised};
use crate::num::Lanes;
use proptest::prelude::*;

type Row = [i64; LANES];

/// Every operation on a few operands.
struct Everything<'a> {
    words: [[i32; LANES]; 3],
    exacts: [Row; 2],
    /// Shifts of exact results; halved and quartered, of words.
    by: [i32; LANES],
    table: &'a [i32],
}

impl Everything<'_> {
    fn of_words<W: Words>(&self) -> Vec<[i32; LANES]> {
        let [a, b, c] = self.words.map(W::from_array);
        // Sums and magnitudes must be words.
        let [half_a, half_b] = [a.right(1), b.right(1)];
        let by = self.by[0] as u32 & 31;
        let pairs: Vec<[i32; 2]> = self
            .table
            .iter()
            .map(|word| [*word, !word.rotate_left(7)])
            .collect();
        let all = [
            W::splat(i64::from(self.words[0][0])),
            half_a + half_b,
            half_a - half_b,
            -half_a,
            a & b,
            a | b,
            a.left(by),
            a.right(by),
            a.max(b),
            a.min(b),
            a.above(b),
            a.where_else(b.above(c), b),
            a.is_zero(),
            a.is_none(),
            a.above(b).not(),
            half_a.abs(),
            a.look_up(self.table),
            W::splat(i64::from(a.signs())),
            a.pick(b & W::splat(7)),
            a.right(16).times(b.right(16)),
            a.wrapping_add(b),
            a.wrapping_times(b),
            a.look_up_pairs(&pairs)[0],
            a.look_up_pairs(&pairs)[1],
            W::from_bytes(std::array::from_fn(|byte| self.words[byte % 3][byte] as u8)),
        ];
        let rows = [a, b, c, half_a, half_b, -half_a, -half_b, a & c];
        all.into_iter()
            .chain(W::transposed(rows))
            .chain(W::transposed(W::transposed(rows)))
            .map(W::to_array)
            .collect()
    }

    fn of_exacts<X: Exacts>(&self) -> Vec<Row> {
        let [a, b] = self.exacts.map(X::from_array);
        let [word, other, third] = self.words.map(X::Words::from_array);
        let [half_a, half_b] = [a.right(1), b.right(1)];
        let by = X::Words::from_array(self.by);
        let few = self.by[0] as u32 & 31;
        let positive = X::from_array(self.exacts[0].map(|v| (v & i64::MAX).max(1)));
        let of_words = [
            a.above(b),
            positive.leading_zeros(),
            a.low(),
            a.cut(few),
            a.cut_deep(few + 32),
            X::Words::splat(i64::from(a.cut_by(by).is_some())),
            a.cut_by(by).unwrap_or(word),
            a.cut_by(X::Words::splat(63)).unwrap_or(word),
            word.exact().cut_by(by).unwrap_or(other),
            word.exact().cut_by(X::Words::splat(0)).unwrap_or(other),
        ];
        let all = [
            X::splat(self.exacts[0][0]),
            half_a + half_b,
            half_a - half_b,
            -half_a,
            a | b,
            word * other,
            X::Words::dot([2, -3, 1], [word, other, third]),
            a.left(few),
            a.left(few + 32),
            a.left_by(by & X::Words::splat(63)),
            a.right(few),
            a.right(few + 32),
            a.max(b),
            a.min(b),
            half_a.abs(),
        ];
        of_words
            .into_iter()
            .map(Words::exact)
            .chain(all)
            .map(X::to_array)
            .collect()
    }
}

impl Kernel for Everything<'_> {
    type Output = (Vec<[i32; LANES]>, Vec<Row>);

    fn run<L: Lanes>(self) -> Self::Output {
        (
            self.of_words::<L::Words>(),
            self.of_exacts::<<L::Words as Words>::Exact>(),
        )
    }
}

/// Powers of two, one more and one less, and any word.
fn word() -> impl Strategy<Value = i32> {
    prop_oneof![
        any::<i32>(),
        (0..32u32, -1..=1i32, any::<bool>()).prop_map(|(power, step, negative)| {
            let near = (1i32 << power).wrapping_add(step);
            if negative { near.wrapping_neg() } else { near }
        })
    ]
}

fn exact() -> impl Strategy<Value = i64> {
    prop_oneof![
        any::<i64>(),
        (0..64u32, -1..=1i64, any::<bool>()).prop_map(|(power, step, negative)| {
            let near = (1i64 << power).wrapping_add(step);
            if negative { near.wrapping_neg() } else { near }
        })
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5_000))]

    #[test]
    fn vector_words_equal_plain_words(
        words in prop::array::uniform3(prop::array::uniform8(word())), exacts in prop::array::uniform2(prop::array::uniform8(exact())),
        by in prop_oneof![prop::array::uniform8(0..64i32), prop::array::uniform8(-2..66i32), prop::array::uniform8(28..40i32)],
        table_bits in 0..6u32, equal in 0..LANES,
    ) {
        let (mut words, mut exacts) = (words, exacts);
        words[1][equal] = words[0][equal];
        exacts[1][equal] = exacts[0][equal];
        let table: Vec<i32> = (0..1 << table_bits).map(|i| i * 1_000_003 - 7).collect();
        let work = || Everything { words, exacts, by, table: &table };
        let plain = unvectorised(work());
        let vector = vectorised(work());
        for (operation, (vector, plain)) in vector.0.iter().zip(&plain.0).enumerate() {
            prop_assert_eq!(vector, plain, "operation {} of words", operation);
        }
        for (operation, (vector, plain)) in vector.1.iter().zip(&plain.1).enumerate() {
            prop_assert_eq!(vector, plain, "operation {} of exact results", operation);
        }
    }
}

/// All powers of two, and a little more and less.
#[test]
fn leading_zeros_do_not_round() {
    struct LeadingZeros([i64; LANES]);
    impl Kernel for LeadingZeros {
        type Output = [i32; LANES];
        fn run<L: Lanes>(self) -> [i32; LANES] {
            <L::Words as Words>::Exact::from_array(self.0)
                .leading_zeros()
                .to_array()
        }
    }
    for power in 0..63 {
        let near = [
            -2,
            -1,
            0,
            1,
            2,
            1 << (power / 2),
            -(1 << (power / 2)),
            (1 << power) - 1,
        ];
        let numbers = near.map(|step| ((1i64 << power).saturating_add(step)).max(1));
        let zeros = numbers.map(|number| number.leading_zeros() as i32);
        assert_eq!(vectorised(LeadingZeros(numbers)), zeros, "{numbers:?}");
    }
}

#[test]
fn plain_words_compute_what_single_words_do() {
    let (a, b) = (
        PlainWords([3, -3, 0, 7, i32::MAX, -1, 12, -64]),
        PlainWords([4, -4, 0, -7, 5, 1, 12, 64]),
    );
    assert_eq!(a.above(b).0, [0, -1, 0, -1, -1, 0, 0, 0]);
    assert_eq!(
        a.where_else(a.above(b), b).0,
        [4, -3, 0, 7, i32::MAX, 1, 12, 64]
    );
    assert_eq!(a.right(1).0, [1, -2, 0, 3, i32::MAX / 2, -1, 6, -32]);
    assert_eq!(a.is_none().0, [0, -1, -1, 0, 0, -1, 0, -1]);
    assert_eq!(
        (a.is_zero().0, a.is_zero().not().0),
        ([0, 0, -1, 0, 0, 0, 0, 0], [-1, -1, 0, -1, -1, -1, -1, -1])
    );
    assert_eq!(a.signs(), 0b10100010);
    assert_eq!(
        a.look_up(&[10, 11, 12, 13]).0,
        [13, 11, 10, 13, 13, 13, 10, 10]
    );
    assert_eq!(
        (a * b).0,
        [12, 12, 0, -49, 5 * i64::from(i32::MAX), -1, 144, -4096]
    );
    let rows = [0, 1, 2, 3, 4, 5, 6, 7]
        .map(|row| PlainWords([0, 1, 2, 3, 4, 5, 6, 7].map(|column| 10 * row + column)));
    assert_eq!(
        PlainWords::transposed(rows)[2].0,
        [2, 12, 22, 32, 42, 52, 62, 72]
    );
}

#[test]
fn plain_results_are_shifted_by_the_given_amounts() {
    let a = Plain([
        1 << 40,
        -1 << 40,
        (1 << 40) - 1,
        -1,
        0,
        1,
        5 << 33,
        -5 << 33,
    ]);
    assert_eq!(
        a.cut(12).0,
        [
            1 << 28,
            -1 << 28,
            (1 << 28) - 1,
            -1,
            0,
            0,
            10 << 20,
            -10 << 20
        ]
    );
    assert_eq!(a.cut_deep(32).0, [256, -256, 255, -1, 0, 0, 10, -10]);
    let mut by = [11, 10, 10, 0, 63, 0, 6, 7];
    assert_eq!(
        a.cut_by(PlainWords(by)).unwrap().0,
        [
            1 << 29,
            -1 << 30,
            (1 << 30) - 1,
            -1,
            0,
            1,
            5 << 27,
            -5 << 26
        ]
    );
    by[0] = 10;
    assert_eq!(a.cut_by(PlainWords(by)), None, "2^30 has more than 31 bits");
    by[0] = 64;
    assert_eq!(a.cut_by(PlainWords(by)), None, "no shift is that long");
}
