use crate::elaboration::Part;
use crate::frame::{Aspect, View};
use crate::machine::Machine;
use crate::num::lanes::Plain;
use crate::num::words::PlainWords;
use crate::num::{Exacts, LANES, Words};
use crate::probe::{NoProbe, Tap};
use crate::units::ellipse::Input;
use std::cell::Cell;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

thread_local! {
    static PRODUCTS: Cell<u32> = const { Cell::new(0) };
}

/// Words, or what they make, that count their products.
#[derive(Clone, Copy, Debug)]
struct Counted<T>(T);

type Word = Counted<PlainWords>;
type Exact = Counted<Plain>;

impl Mul for Word {
    type Output = Exact;

    fn mul(self, other: Self) -> Exact {
        PRODUCTS.set(PRODUCTS.get() + 1);
        Counted(self.0 * other.0)
    }
}

impl<T: Add<Output = T>> Add for Counted<T> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Counted(self.0 + other.0)
    }
}

impl<T: Sub<Output = T>> Sub for Counted<T> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Counted(self.0 - other.0)
    }
}

impl<T: Neg<Output = T>> Neg for Counted<T> {
    type Output = Self;

    fn neg(self) -> Self {
        Counted(-self.0)
    }
}

impl<T: BitAnd<Output = T>> BitAnd for Counted<T> {
    type Output = Self;

    fn bitand(self, other: Self) -> Self {
        Counted(self.0 & other.0)
    }
}

impl<T: BitOr<Output = T>> BitOr for Counted<T> {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Counted(self.0 | other.0)
    }
}

/// An argument of what is counted.
trait Argument {
    type Plain;

    fn plain(self) -> Self::Plain;
}

impl<T> Argument for Counted<T> {
    type Plain = T;

    fn plain(self) -> T {
        self.0
    }
}

impl Argument for u32 {
    type Plain = u32;

    fn plain(self) -> u32 {
        self
    }
}

/// Methods that do as those of what is counted.
macro_rules! as_counted {
    ($(fn $name:ident(self $(, $argument:ident: $type:ty)*) -> $out:ty;)*) => {
        $(fn $name(self $(, $argument: $type)*) -> $out {
            Counted(self.0.$name($($argument.plain()),*))
        })*
    };
}

impl Words for Word {
    type Exact = Exact;

    as_counted! {
        fn exact(self) -> Exact;
        fn left(self, by: u32) -> Self;
        fn right(self, by: u32) -> Self;
        fn max(self, other: Self) -> Self;
        fn min(self, other: Self) -> Self;
        fn above(self, other: Self) -> Self;
        fn is_zero(self) -> Self;
        fn abs(self) -> Self;
        fn pick(self, lanes: Self) -> Self;
        fn where_else(self, condition: Self, other: Self) -> Self;
    }

    fn from_array(words: [i32; LANES]) -> Self {
        Counted(PlainWords::from_array(words))
    }

    fn from_bytes(bytes: [u8; LANES]) -> Self {
        Counted(PlainWords::from_bytes(bytes))
    }

    // Of the host's short forms alone: no unit's function multiplies so.
    fn times(self, other: Self) -> Self {
        Counted(self.0.times(other.0))
    }

    fn to_array(self) -> [i32; LANES] {
        self.0.to_array()
    }

    fn splat(word: i64) -> Self {
        Counted(PlainWords::splat(word))
    }

    fn look_up(self, table: &[i32]) -> Self {
        Counted(self.0.look_up(table))
    }

    fn look_up_pairs(self, table: &[[i32; 2]]) -> [Self; 2] {
        self.0.look_up_pairs(table).map(Counted)
    }

    fn wrapping_add(self, other: Self) -> Self {
        Counted(self.0.wrapping_add(other.0))
    }

    fn wrapping_times(self, other: Self) -> Self {
        Counted(self.0.wrapping_times(other.0))
    }

    fn signs(self) -> u8 {
        self.0.signs()
    }

    fn transposed(rows: [Self; LANES]) -> [Self; LANES] {
        PlainWords::transposed(rows.map(|row| row.0)).map(Counted)
    }
}

impl Exacts for Exact {
    type Words = Word;

    as_counted! {
        fn left(self, by: u32) -> Self;
        fn left_by(self, by: Word) -> Self;
        fn right(self, by: u32) -> Self;
        fn max(self, other: Self) -> Self;
        fn min(self, other: Self) -> Self;
        fn above(self, other: Self) -> Word;
        fn abs(self) -> Self;
        fn leading_zeros(self) -> Word;
        fn low(self) -> Word;
        fn cut(self, by: u32) -> Word;
        fn cut_deep(self, by: u32) -> Word;
    }

    fn from_array(words: [i64; LANES]) -> Self {
        Counted(Plain::from_array(words))
    }

    fn to_array(self) -> [i64; LANES] {
        self.0.to_array()
    }

    fn splat(word: i64) -> Self {
        Counted(Plain::splat(word))
    }

    fn cut_by(self, by: Word) -> Option<Word> {
        self.0.cut_by(by.0).map(Counted)
    }
}

/// How many products `work` makes for each splat.
fn products<T>(work: impl FnOnce(&mut Tap<NoProbe>) -> T) -> (u32, T) {
    PRODUCTS.set(0);
    let done = work(&mut Tap::new(&mut NoProbe));
    (PRODUCTS.get(), done)
}

#[test]
fn what_setup_multiplies_is_what_it_declares() {
    for name in Machine::NAMES {
        let file = Machine::named(name).unwrap();
        let machine = file.elaborate().unwrap();
        let declared = |unit: &str| machine.parts.iter().filter(|part| part.unit == unit).map(Part::products).sum::<u32>();
        let view = View { cutoff: 1, aspect: file.ellipse.aspect.map(|_| Aspect::default()), ..View::default() };
        let one = Word::splat(1);
        let (project, point) = products(|tap| machine.project.lanes(&view, [one; 3], Word::splat(0), tap));
        assert_eq!(project, declared("project"), "{name}");
        let input = Input {
            normal: [one; 3],
            radius: one,
            forward: point.camera[2],
            exponent: point.exponent,
            inverse_depth: point.inverse_depth,
            slope: point.slope,
            pixel: point.pixel,
        };
        let (ellipse, _) = products(|tap| machine.ellipse.lanes(&view, [16; 2], &input, tap));
        assert_eq!(ellipse, declared("ellipse"), "{name}");
    }
}

/// A wider digit saves a pass and is paid for: two counts for each of its values.
#[test]
fn counts_of_digits_are_memory() {
    let bits = |digit_bits| {
        let mut machine = Machine::named("gaussian").unwrap();
        machine.sort.iter_mut().for_each(|sort| sort.digit_bits = digit_bits);
        machine.elaborate().unwrap().timing.storage.memory_bits
    };
    assert_eq!(bits(16) - bits(8), 2 * 32 * (65_536 - 256));
    assert_eq!(bits(9) - bits(8), 2 * 32 * 256);
    let without = Machine { sort: None, ..Machine::named("gaussian").unwrap() };
    assert_eq!(bits(8) - without.elaborate().unwrap().timing.storage.memory_bits, 2 * 32 * 256);
}
