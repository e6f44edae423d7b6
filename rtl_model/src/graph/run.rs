//! Run: a graph's steps for a batch of items, eight lanes of the host at a time. Each step is one
//! loop over the batch, compiled once with vector instructions and once without.

use super::Functions;
use super::compile::{EXACT, WORD};
use crate::kernels::host::Kernel;
use crate::num::{Exacts, Fit, LANES, Lanes, Words};
use crate::probe::{Probe, Tap};
use std::cell::Cell;

/// Rows of eight items in a batch.
pub const ROWS: usize = 8;
/// Most items of a batch.
pub const BATCH: usize = ROWS * LANES;

/// A wire of a batch: of 32 bits; or of 64, of each eight those of even number first, as products
/// of words come.
type Row<T> = [Cell<[T; LANES]>; ROWS];

/// Where a wire lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Among the words of 32 bits.
    Word(usize),
    /// Among the exact results.
    Exact(usize),
}

/// Where an input or a result of a program lies in its batch.
#[derive(Clone, Copy, Debug)]
pub struct Port(Place);

/// Eight exact results of each row. Numbers are rows, pairs of small ones shifts to the left.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source {
    From(Place),
    Product(usize, usize),
    Sum([usize; 2], [u32; 2]),
    Difference([usize; 2], [u32; 2]),
    /// A term, and a product that is added to it or taken from it.
    WithProduct {
        from: Place,
        left: u32,
        product: [usize; 2],
        of_product: u32,
        is_difference: bool,
    },
    /// Shifted left by its own places.
    Normalised(usize, usize),
}

/// What becomes of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sink {
    Exact(usize),
    /// Of results that are words of 32 bits.
    Word(usize),
    Fit(Fit, usize),
    /// Into a word that may have more than 32 bits.
    FitWide(Fit, usize),
    /// Of results that have so many more fraction bits.
    FitShifted(Fit, usize, usize),
    /// Rounded between two operators, unseen by the probe.
    Rounded(Fit, usize),
}

/// What is done to one wire.
#[derive(Clone, Copy, Debug)]
pub(super) enum Unary {
    Negation,
    Magnitude,
    AtLeast(i64),
    AtMost(i64),
    APlaceMore,
    Not,
}

/// A loop over a batch. Numbers are rows.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Value {
        source: Source,
        sink: Sink,
    },
    SumOfWords {
        a: usize,
        b: usize,
        lefts: [u32; 2],
        to: usize,
    },
    DifferenceOfWords {
        a: usize,
        b: usize,
        lefts: [u32; 2],
        to: usize,
    },
    Unary {
        unary: Unary,
        from: usize,
        to: usize,
    },
    UnaryWord {
        unary: Unary,
        from: usize,
        to: usize,
    },
    Opposed {
        from: usize,
        other: usize,
        to: usize,
    },
    Turned {
        from: usize,
        by: usize,
        to: usize,
    },
    Lesser {
        a: usize,
        b: usize,
        to: usize,
    },
    Greater {
        a: usize,
        b: usize,
        to: usize,
    },
    Guarded {
        from: usize,
        condition: usize,
        instead: i64,
        to: usize,
    },
    /// Whether 32 bits hold everything on the way.
    Lookup {
        from: usize,
        table: usize,
        short: bool,
        to: usize,
    },
    Largest {
        parts: [usize; 3],
        to: usize,
    },
    Lead {
        from: usize,
        to: usize,
    },
    Reciprocal {
        from: Place,
        unit: usize,
        to: usize,
        exponent: usize,
    },
    InverseRoot {
        from: Place,
        unit: usize,
        to: usize,
        exponent: usize,
    },
    Root {
        from: Place,
        unit: usize,
        to: usize,
        exponent: usize,
    },
    /// Rows and factors.
    Exponents {
        terms: [(usize, i32); 4],
        count: usize,
        constant: i32,
        to: usize,
    },
    Above {
        a: usize,
        b: usize,
        lefts: [u32; 2],
        to: usize,
    },
    AboveWords {
        a: usize,
        b: usize,
        to: usize,
    },
    Either {
        a: usize,
        b: usize,
        to: usize,
    },
    Both {
        a: usize,
        b: usize,
        to: usize,
    },
    Drop {
        condition: usize,
    },
}

/// A graph as steps.
#[derive(Clone, Debug)]
pub struct Program {
    pub(super) steps: Vec<Step>,
    pub(super) functions: Functions,
    /// Rows of 32 bits, and of 64.
    pub(super) rows: [usize; 2],
    pub(super) constants: Vec<(Place, i64)>,
    pub(super) inputs: Vec<Place>,
    pub(super) outputs: Vec<Place>,
}

impl Program {
    /// Where an input lies.
    pub fn input(&self, input: usize) -> Port {
        Port(self.inputs[input])
    }

    /// Where a result lies.
    pub fn output(&self, output: usize) -> Port {
        Port(self.outputs[output])
    }

    /// Rows for a batch, with the constants in them.
    pub fn batch(&self) -> Batch {
        let mut batch = Batch {
            words: vec![row(0); self.rows[WORD]],
            exacts: vec![row(0); self.rows[EXACT]],
        };
        for &(place, value) in &self.constants {
            match place {
                Place::Word(at) => batch.words[at] = row(value as i32),
                Place::Exact(at) => batch.exacts[at] = row(value),
            }
        }
        batch
    }
}

/// A row that holds one value.
fn row<T: Copy>(value: T) -> Row<T> {
    std::array::from_fn(|_| Cell::new([value; LANES]))
}

/// A row of exact results from eight in their order.
#[inline(always)]
fn evens_first([a, b, c, d, e, f, g, h]: [i64; LANES]) -> [i64; LANES] {
    [a, c, e, g, b, d, f, h]
}

/// Eight exact results in their order from a row of them.
#[inline(always)]
fn in_order([a, c, e, g, b, d, f, h]: [i64; LANES]) -> [i64; LANES] {
    [a, b, c, d, e, f, g, h]
}

/// Rows of a batch.
#[derive(Clone, Debug)]
pub struct Batch {
    words: Vec<Row<i32>>,
    exacts: Vec<Row<i64>>,
}

impl Batch {
    /// Sets an input of some rows.
    #[inline(always)]
    pub fn set<T: Copy + Into<i64>>(
        &mut self,
        program: &Program,
        input: usize,
        rows: &[[T; LANES]],
    ) {
        match program.inputs[input] {
            Place::Word(at) => {
                for (to, from) in self.words[at].iter_mut().zip(rows) {
                    *to.get_mut() = from.map(|word| word.into() as i32);
                }
            }
            Place::Exact(at) => {
                for (to, from) in self.exacts[at].iter_mut().zip(rows) {
                    *to.get_mut() = evens_first(from.map(|word| word.into()));
                }
            }
        }
    }

    /// Sets a row of an input that is a word.
    #[inline(always)]
    pub fn set_row(&self, program: &Program, input: usize, row: usize, words: [i32; LANES]) {
        match program.inputs[input] {
            Place::Word(at) => self.words[at][row].set(words),
            Place::Exact(at) => self.exacts[at][row].set(evens_first(words.map(i64::from))),
        }
    }

    /// Sets an input of all items.
    pub fn set_all(&mut self, program: &Program, input: usize, value: i64) {
        match program.inputs[input] {
            Place::Word(at) => self.words[at] = row(value as i32),
            Place::Exact(at) => self.exacts[at] = row(value),
        }
    }

    /// Takes a result of some rows as an input, of this program or of another's batch.
    #[inline(always)]
    pub fn carry(&self, from: Port, rows: usize, to: Port, batch: &Batch) {
        match (from.0, to.0) {
            (Place::Word(from), Place::Word(to)) => {
                self.words[from]
                    .iter()
                    .zip(&batch.words[to])
                    .take(rows)
                    .for_each(|(from, to)| to.set(from.get()));
            }
            (Place::Exact(from), Place::Exact(to)) => {
                self.exacts[from]
                    .iter()
                    .zip(&batch.exacts[to])
                    .take(rows)
                    .for_each(|(from, to)| to.set(from.get()));
            }
            (Place::Word(from), Place::Exact(to)) => {
                self.words[from]
                    .iter()
                    .zip(&batch.exacts[to])
                    .take(rows)
                    .for_each(|(from, to)| to.set(evens_first(from.get().map(i64::from))));
            }
            (Place::Exact(from), Place::Word(to)) => {
                let narrowed = |word: i64| word as i32;
                self.exacts[from]
                    .iter()
                    .zip(&batch.words[to])
                    .take(rows)
                    .for_each(|(from, to)| to.set(in_order(from.get()).map(narrowed)));
            }
        }
    }

    /// Sets one item of an input.
    #[cfg(test)]
    pub fn set_one(&mut self, program: &Program, input: usize, item: usize, word: i64) {
        let (row, lane) = (item / LANES % ROWS, item % LANES);
        match program.inputs[input] {
            Place::Word(at) => self.words[at][row].get_mut()[lane] = word as i32,
            Place::Exact(at) => {
                let cell = &self.exacts[at][row];
                let mut words = in_order(cell.get());
                words[lane] = word;
                cell.set(evens_first(words));
            }
        }
    }

    /// A result, a word of at most 32 bits, of some rows.
    #[inline(always)]
    pub fn words(&self, program: &Program, output: usize, rows: &mut [[i32; LANES]]) {
        match program.outputs[output] {
            Place::Word(at) => rows
                .iter_mut()
                .zip(&self.words[at])
                .for_each(|(to, from)| *to = from.get()),
            Place::Exact(at) => rows
                .iter_mut()
                .zip(&self.exacts[at])
                .for_each(|(to, from)| *to = in_order(from.get()).map(|word| word as i32)),
        }
    }

    /// A result of eight items, words of at most 32 bits.
    #[inline(always)]
    pub fn row(&self, program: &Program, output: usize, row: usize) -> [i32; LANES] {
        match program.outputs[output] {
            Place::Word(at) => self.words[at][row].get(),
            Place::Exact(at) => in_order(self.exacts[at][row].get()).map(|word| word as i32),
        }
    }

    /// An input of eight items, words of at most 32 bits.
    #[inline(always)]
    pub fn input_row(&self, program: &Program, input: usize, row: usize) -> [i32; LANES] {
        match program.inputs[input] {
            Place::Word(at) => self.words[at][row].get(),
            Place::Exact(at) => in_order(self.exacts[at][row].get()).map(|word| word as i32),
        }
    }

    /// A result of eight items.
    pub fn result(&self, program: &Program, output: usize, row: usize) -> [i64; LANES] {
        match program.outputs[output] {
            Place::Word(at) => self.words[at][row].get().map(i64::from),
            Place::Exact(at) => in_order(self.exacts[at][row].get()),
        }
    }
}

/// A run of a program over a batch: which items are still there where it ends, eight a row.
#[derive(Debug)]
pub struct Run<'a, 'p, P> {
    /// What is run.
    pub program: &'a Program,
    /// Its rows, with the inputs.
    pub batch: &'a mut Batch,
    /// Which items are shown to the probe, eight a row; as many rows are run.
    pub live: &'a [u8],
    /// Observes the words.
    pub probe: &'p mut P,
}

impl<P: Probe> Kernel for Run<'_, '_, P> {
    type Output = [u8; ROWS];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [u8; ROWS] {
        self.steps::<L::Words>()
    }
}

/// Eight items of a row.
macro_rules! at {
    ($from:expr, $row:ident) => {
        W::from_array($from[$row].get())
    };
}

/// Eight exact results of a row.
macro_rules! exact_at {
    ($from:expr, $row:ident) => {
        X::<W>::from_evens_first($from[$row].get())
    };
}

/// Exact results of eight items.
type X<W> = <W as Words>::Exact;

impl<P: Probe> Run<'_, '_, P> {
    #[inline(always)]
    fn steps<W: Words>(self) -> [u8; ROWS] {
        let Batch { words, exacts } = &*self.batch;
        let Functions {
            tables,
            reciprocals,
            roots,
            ..
        } = &self.program.functions;
        let rows = self.live.len().min(ROWS);
        let mut live = [0; ROWS];
        live[..rows].copy_from_slice(&self.live[..rows]);
        let tap = &mut Tap::new(self.probe);
        // What a source makes and a sink takes: in one loop of both, each source would be compiled
        // with each sink.
        let mut made = [X::<W>::splat(0); ROWS];
        macro_rules! make {
            ($row:ident => $result:expr) => {
                for $row in 0..rows {
                    made[$row] = $result;
                }
            };
        }
        // Does the same to each row.
        macro_rules! rows {
            ($to:ident[$row:ident] = $result:expr) => {
                for $row in 0..rows {
                    $to[$row].set($result.to_array());
                }
            };
        }
        // The same of words that the probe sees.
        macro_rules! fits {
            ($to:ident[$row:ident] = $result:expr) => {
                for $row in 0..rows {
                    tap.item($row, live[$row]);
                    $to[$row].set($result.to_array());
                }
            };
        }
        macro_rules! from {
            ($place:expr) => {
                match $place {
                    Place::Word(from) => {
                        let from = &words[from];
                        make!(row => at!(from, row).exact());
                    }
                    Place::Exact(from) => {
                        let from = &exacts[from];
                        make!(row => exact_at!(from, row));
                    }
                }
            };
        }
        // 1/x or 1/√x of a wire, and its exponent.
        macro_rules! inverse {
            ($unit:expr, $from:expr, $to:expr, $exponent:expr) => {{
                let (unit, to, exponent) = (&$unit, &words[$to], &words[$exponent]);
                from!($from);
                for row in 0..rows {
                    tap.item(row, live[row]);
                    let inverse = unit.lanes(made[row], tap);
                    to[row].set(inverse.mantissa.to_array());
                    exponent[row].set(inverse.exponent.to_array());
                }
            }};
        }
        for step in &self.program.steps {
            match *step {
                Step::Value {
                    ref source,
                    ref sink,
                } => {
                    match *source {
                        Source::From(place) => from!(place),
                        Source::Product(a, b) => {
                            let (a, b) = (&words[a], &words[b]);
                            make!(row => at!(a, row) * at!(b, row));
                        }
                        Source::Sum([a, b], [p, q]) => {
                            let (a, b) = (&exacts[a], &exacts[b]);
                            make!(row => exact_at!(a, row).left(p) + exact_at!(b, row).left(q));
                        }
                        Source::Difference([a, b], [p, q]) => {
                            let (a, b) = (&exacts[a], &exacts[b]);
                            make!(row => exact_at!(a, row).left(p) - exact_at!(b, row).left(q));
                        }
                        Source::WithProduct {
                            from,
                            left: p,
                            product: [a, b],
                            of_product: q,
                            is_difference,
                        } => {
                            from!(from);
                            let (a, b) = (&words[a], &words[b]);
                            if is_difference {
                                make!(row => made[row].left(p) - (at!(a, row) * at!(b, row)).left(q));
                            } else {
                                make!(row => made[row].left(p) + (at!(a, row) * at!(b, row)).left(q));
                            }
                        }
                        Source::Normalised(from, by) => {
                            let (from, by) = (&exacts[from], &words[by]);
                            make!(row => exact_at!(from, row).left_by(at!(by, row)));
                        }
                    }
                    match *sink {
                        Sink::Exact(to) => {
                            let to = &exacts[to];
                            for row in 0..rows {
                                to[row].set(made[row].to_evens_first());
                            }
                        }
                        Sink::Word(to) => {
                            let to = &words[to];
                            rows!(to[row] = made[row].low());
                        }
                        Sink::Fit(ref fit, to) => {
                            let to = &words[to];
                            match fit.narrow::<W>() {
                                Some(fit) if !P::WORDS => rows!(to[row] = fit.words(made[row])),
                                Some(_) => fits!(to[row] = tap.fit_words(fit, made[row])),
                                None if fit.is_deep() => {
                                    fits!(to[row] = tap.fit_top(fit, made[row]))
                                }
                                None => fits!(to[row] = tap.fit_wide(fit, made[row]).low()),
                            }
                        }
                        Sink::FitWide(ref fit, to) => {
                            let to = &exacts[to];
                            for row in 0..rows {
                                tap.item(row, live[row]);
                                to[row].set(tap.fit_wide(fit, made[row]).to_evens_first());
                            }
                        }
                        Sink::Rounded(ref fit, to) => {
                            let to = &exacts[to];
                            for row in 0..rows {
                                to[row].set(fit.wide(made[row]).to_evens_first());
                            }
                        }
                        Sink::FitShifted(ref fit, more, to) => {
                            let (more, to) = (&words[more], &words[to]);
                            fits!(to[row] = tap.fit_shifted(fit, made[row], at!(more, row)));
                        }
                    }
                }
                Step::SumOfWords {
                    a,
                    b,
                    lefts: [p, q],
                    to,
                } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = (at!(a, row).left(p) + at!(b, row).left(q)));
                }
                Step::DifferenceOfWords {
                    a,
                    b,
                    lefts: [p, q],
                    to,
                } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = (at!(a, row).left(p) - at!(b, row).left(q)));
                }
                Step::UnaryWord { unary, from, to } => {
                    let (from, to) = (&words[from], &words[to]);
                    match unary {
                        Unary::Negation => rows!(to[row] = (-at!(from, row))),
                        Unary::Magnitude => rows!(to[row] = at!(from, row).abs()),
                        Unary::AtLeast(least) => {
                            rows!(to[row] = at!(from, row).max(W::splat(least)))
                        }
                        Unary::AtMost(most) => rows!(to[row] = at!(from, row).min(W::splat(most))),
                        Unary::APlaceMore => rows!(to[row] = (at!(from, row) + W::splat(1))),
                        Unary::Not => rows!(to[row] = at!(from, row).not()),
                    }
                }
                Step::Unary { unary, from, to } => {
                    let (from, to) = (&exacts[from], &exacts[to]);
                    macro_rules! exact_rows {
                        ($row:ident => $result:expr) => {
                            for $row in 0..rows {
                                to[$row].set($result.to_evens_first());
                            }
                        };
                    }
                    match unary {
                        Unary::Negation => exact_rows!(row => (-exact_at!(from, row))),
                        Unary::Magnitude => exact_rows!(row => exact_at!(from, row).abs()),
                        Unary::AtLeast(least) => {
                            exact_rows!(row => exact_at!(from, row).max(X::<W>::splat(least)))
                        }
                        Unary::AtMost(most) => {
                            exact_rows!(row => exact_at!(from, row).min(X::<W>::splat(most)))
                        }
                        Unary::APlaceMore => {
                            exact_rows!(row => (exact_at!(from, row) + X::<W>::splat(1)))
                        }
                        // A condition is a word.
                        Unary::Not => {}
                    }
                }
                Step::Opposed { from, other, to } => {
                    let (from, other, to) = (&words[from], &words[other], &words[to]);
                    rows!(
                        to[row] = at!(from, row)
                            .where_else(W::splat(0).above(at!(other, row)), -at!(from, row))
                    );
                }
                Step::Turned { from, by, to } => {
                    let (from, by, to) = (&words[from], &words[by], &words[to]);
                    rows!(
                        to[row] = (-at!(from, row))
                            .where_else(at!(by, row).above(W::splat(0)), at!(from, row))
                    );
                }
                Step::Lesser { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = at!(a, row).min(at!(b, row)));
                }
                Step::Greater { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = at!(a, row).max(at!(b, row)));
                }
                Step::Guarded {
                    from,
                    condition,
                    instead,
                    to,
                } => {
                    let (from, condition, to) = (&words[from], &words[condition], &words[to]);
                    rows!(
                        to[row] = W::splat(instead).where_else(at!(condition, row), at!(from, row))
                    );
                }
                Step::Lookup {
                    from,
                    table,
                    short,
                    to,
                } => {
                    let (from, to, table) = (&words[from], &words[to], &tables[table]);
                    if short && !P::WORDS {
                        let table = table.natural::<W>();
                        rows!(to[row] = table.words(at!(from, row)));
                    } else {
                        fits!(
                            to[row] = tap.fit_words(table.fit(), table.exact_words(at!(from, row)))
                        );
                    }
                }
                Step::Largest {
                    parts: [a, b, c],
                    to,
                } => {
                    let (a, b, c, to) = (&exacts[a], &exacts[b], &exacts[c], &exacts[to]);
                    for row in 0..rows {
                        let bits = exact_at!(a, row).abs()
                            | exact_at!(b, row).abs()
                            | exact_at!(c, row).abs();
                        to[row].set((bits | X::<W>::splat(1)).to_evens_first());
                    }
                }
                Step::Lead { from, to } => {
                    let (from, to) = (&exacts[from], &words[to]);
                    rows!(to[row] = (exact_at!(from, row).leading_zeros() - W::splat(2)));
                }
                Step::Reciprocal {
                    from,
                    unit,
                    to,
                    exponent,
                } => inverse!(reciprocals[unit], from, to, exponent),
                Step::InverseRoot {
                    from,
                    unit,
                    to,
                    exponent,
                } => inverse!(roots[unit], from, to, exponent),
                Step::Root {
                    from,
                    unit,
                    to,
                    exponent,
                } => {
                    let (unit, to, exponent) = (&roots[unit], &exacts[to], &words[exponent]);
                    from!(from);
                    for row in 0..rows {
                        tap.item(row, live[row]);
                        let (root, power) = unit.root_lanes(made[row], tap);
                        to[row].set(root.to_evens_first());
                        exponent[row].set(power.to_array());
                    }
                }
                Step::Exponents {
                    ref terms,
                    count,
                    constant,
                    to,
                } => {
                    for (row, to) in words[to].iter().enumerate().take(rows) {
                        let mut sum = W::splat(constant.into());
                        for &(from, factor) in terms.iter().take(count) {
                            let exponent =
                                at!(&words[from], row).left(factor.unsigned_abs().trailing_zeros());
                            sum = if factor < 0 {
                                sum - exponent
                            } else {
                                sum + exponent
                            };
                        }
                        to.set(sum.to_array());
                    }
                }
                Step::Above {
                    a,
                    b,
                    lefts: [p, q],
                    to,
                } => {
                    let (a, b, to) = (&exacts[a], &exacts[b], &words[to]);
                    rows!(to[row] = exact_at!(a, row).left(p).above(exact_at!(b, row).left(q)));
                }
                Step::AboveWords { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = at!(a, row).above(at!(b, row)));
                }
                Step::Either { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = (at!(a, row) | at!(b, row)));
                }
                Step::Both { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(to[row] = (at!(a, row) & at!(b, row)));
                }
                Step::Drop { condition } => {
                    if P::WORDS {
                        let condition = &words[condition];
                        for row in 0..rows {
                            live[row] &= !at!(condition, row).signs();
                        }
                    }
                }
            }
        }
        live
    }
}
