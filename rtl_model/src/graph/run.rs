//! Run: a graph's words for a batch of items, operator by operator, eight lanes of the host at a time.
//!
//! ```text
//! nodes ─►( container of each wire: 32 or 64 bits )─►( product and fit in one )─►( places used again )─► steps
//! ```
//! A wire of at most 32 bits is a row of 32-bit words; of others 64 bits are kept. Each step is one loop over the batch, compiled once with
//! vector instructions and once without.

use super::{Node, Operator, Wire};
use crate::functions::Table;
use crate::kernels::host::Kernel;
use crate::num::{Exacts, Fit, LANES, Lanes, Words};
use crate::probe::{Probe, Tap};
use std::cell::Cell;

/// Rows of eight items in a batch.
pub const ROWS: usize = 8;
/// Most items of a batch.
pub const BATCH: usize = ROWS * LANES;

/// A wire of a batch: of 32 bits, or of 64.
type Row<T> = [Cell<[T; LANES]>; ROWS];

/// Where a wire lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Among the words of 32 bits.
    Word(usize),
    /// Among the exact results.
    Exact(usize),
}

/// Where an input or a result of a program lies in its batch.
#[derive(Clone, Copy, Debug)]
pub struct Port(Place);

/// A loop over a batch. Numbers are rows.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// 64 bits of 32.
    Widen {
        from: usize,
        to: usize,
    },
    Product {
        a: usize,
        b: usize,
        to: usize,
    },
    ProductFit {
        a: usize,
        b: usize,
        fit: Fit,
        to: usize,
    },
    Sum {
        a: usize,
        b: usize,
        lefts: [u32; 2],
        to: usize,
    },
    Difference {
        a: usize,
        b: usize,
        lefts: [u32; 2],
        to: usize,
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
    Natural {
        from: usize,
        to: usize,
    },
    NaturalWord {
        from: usize,
        to: usize,
    },
    /// 32 bits of 64 that hold no more.
    Narrow {
        from: usize,
        to: usize,
    },
    AtMost {
        from: usize,
        most: i64,
        to: usize,
    },
    AtMostWord {
        from: usize,
        most: i64,
        to: usize,
    },
    /// Whether 32 bits hold everything on the way.
    Lookup {
        from: usize,
        table: usize,
        short: bool,
        to: usize,
    },
    Fit {
        from: usize,
        fit: Fit,
        to: usize,
    },
    FitWide {
        from: usize,
        fit: Fit,
        to: usize,
    },
}

/// A graph as steps.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<Step>,
    tables: Vec<Table>,
    /// Rows of 32 bits, and of 64.
    rows: [usize; 2],
    constants: Vec<(Place, i64)>,
    inputs: Vec<Place>,
    outputs: Vec<Place>,
}

impl Program {
    /// Of a graph.
    pub(super) fn new(nodes: &[Node], tables: &[Table], outputs: &[Wire]) -> Self {
        let mut compiler = Compiler::new(nodes, outputs);
        for place in 0..nodes.len() {
            compiler.kept(place);
        }
        for place in 0..nodes.len() {
            compiler.node(place);
        }
        for step in &mut compiler.steps {
            if let Step::Lookup { table, short, .. } = step {
                *short = tables[*table].is_short();
            }
        }
        let outputs = outputs.iter().map(|wire| compiler.place(*wire)).collect();
        let Compiler { steps, rows, constants, inputs, .. } = compiler;
        Program { steps, tables: tables.to_vec(), rows, constants, inputs, outputs }
    }

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
        let mut batch = Batch { words: vec![row(0); self.rows[WORD]], exacts: vec![row(0); self.rows[EXACT]] };
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

/// Rows of a batch.
#[derive(Clone, Debug)]
pub struct Batch {
    words: Vec<Row<i32>>,
    exacts: Vec<Row<i64>>,
}

impl Batch {
    /// Sets an input of some rows.
    #[inline(always)]
    pub fn set<T: Copy + Into<i64>>(&mut self, program: &Program, input: usize, rows: &[[T; LANES]]) {
        match program.inputs[input] {
            Place::Word(at) => {
                for (to, from) in self.words[at].iter_mut().zip(rows) {
                    *to.get_mut() = from.map(|word| word.into() as i32);
                }
            }
            Place::Exact(at) => {
                for (to, from) in self.exacts[at].iter_mut().zip(rows) {
                    *to.get_mut() = from.map(|word| word.into());
                }
            }
        }
    }

    /// Takes a result of some rows as an input, of this program or of another's batch.
    #[inline(always)]
    pub fn carry(&self, from: Port, rows: usize, to: Port, batch: &Batch) {
        match (from.0, to.0) {
            (Place::Word(from), Place::Word(to)) => {
                self.words[from].iter().zip(&batch.words[to]).take(rows).for_each(|(from, to)| to.set(from.get()));
            }
            (Place::Exact(from), Place::Exact(to)) => {
                self.exacts[from].iter().zip(&batch.exacts[to]).take(rows).for_each(|(from, to)| to.set(from.get()));
            }
            (Place::Word(from), Place::Exact(to)) => {
                self.words[from].iter().zip(&batch.exacts[to]).take(rows).for_each(|(from, to)| to.set(from.get().map(i64::from)));
            }
            (Place::Exact(from), Place::Word(to)) => {
                let narrowed = |word: i64| word as i32;
                self.exacts[from].iter().zip(&batch.words[to]).take(rows).for_each(|(from, to)| to.set(from.get().map(narrowed)));
            }
        }
    }

    /// Sets one item of an input.
    #[cfg(test)]
    pub fn set_one(&mut self, program: &Program, input: usize, item: usize, word: i64) {
        let (row, lane) = (item / LANES % ROWS, item % LANES);
        match program.inputs[input] {
            Place::Word(at) => self.words[at][row].get_mut()[lane] = word as i32,
            Place::Exact(at) => self.exacts[at][row].get_mut()[lane] = word,
        }
    }

    /// A result, a word of at most 32 bits, of some rows.
    #[inline(always)]
    pub fn words(&self, program: &Program, output: usize, rows: &mut [[i32; LANES]]) {
        match program.outputs[output] {
            Place::Word(at) => rows.iter_mut().zip(&self.words[at]).for_each(|(to, from)| *to = from.get()),
            Place::Exact(at) => rows.iter_mut().zip(&self.exacts[at]).for_each(|(to, from)| *to = from.get().map(|word| word as i32)),
        }
    }

    /// A result of eight items.
    #[cfg(test)]
    pub fn result(&self, program: &Program, output: usize, row: usize) -> [i64; LANES] {
        match program.outputs[output] {
            Place::Word(at) => self.words[at][row].get().map(i64::from),
            Place::Exact(at) => self.exacts[at][row].get(),
        }
    }
}

/// A run of a program over a batch.
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
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        self.steps::<L::Words>();
    }
}

/// Does the same to each row.
macro_rules! rows {
    ($rows:ident, $to:ident[$row:ident] = $result:expr) => {
        for $row in 0..$rows {
            $to[$row].set($result.to_array());
        }
    };
}

/// Eight items of a row.
macro_rules! at {
    ($kind:ident, $from:ident[$row:ident]) => {
        $kind::from_array($from[$row].get())
    };
}

/// Fits each row, seen by the probe.
macro_rules! fits {
    ($self:ident, $tap:ident, $rows:ident, $to:ident[$row:ident] = $result:expr) => {
        for $row in 0..$rows {
            $tap.live = $self.live[$row];
            $to[$row].set($result.to_array());
        }
    };
}

impl<P: Probe> Run<'_, '_, P> {
    #[inline(always)]
    fn steps<W: Words>(self) {
        type X<W> = <W as Words>::Exact;
        let Batch { words, exacts } = &*self.batch;
        let rows = self.live.len().min(ROWS);
        let tap = &mut Tap::new(self.probe);
        for step in &self.program.steps {
            match *step {
                Step::Widen { from, to } => {
                    let (from, to) = (&words[from], &exacts[to]);
                    rows!(rows, to[row] = at!(W, from[row]).exact());
                }
                Step::Narrow { from, to } => {
                    let (from, to) = (&exacts[from], &words[to]);
                    rows!(rows, to[row] = X::<W>::from_array(from[row].get()).low());
                }
                Step::Product { a, b, to } => {
                    let (a, b, to) = (&words[a], &words[b], &exacts[to]);
                    rows!(rows, to[row] = (at!(W, a[row]) * at!(W, b[row])));
                }
                Step::ProductFit { a, b, ref fit, to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    if let (false, Some(fit)) = (P::WORDS, fit.narrow::<W>()) {
                        rows!(rows, to[row] = fit.words(at!(W, a[row]) * at!(W, b[row])));
                    } else {
                        fits!(self, tap, rows, to[row] = tap.fit_words(fit, at!(W, a[row]) * at!(W, b[row])));
                    }
                }
                Step::Sum { a, b, lefts: [p, q], to } => {
                    let (a, b, to) = (&exacts[a], &exacts[b], &exacts[to]);
                    rows!(rows, to[row] = (X::<W>::from_array(a[row].get()).left(p) + X::<W>::from_array(b[row].get()).left(q)));
                }
                Step::Difference { a, b, lefts: [p, q], to } => {
                    let (a, b, to) = (&exacts[a], &exacts[b], &exacts[to]);
                    rows!(rows, to[row] = (X::<W>::from_array(a[row].get()).left(p) - X::<W>::from_array(b[row].get()).left(q)));
                }
                Step::SumOfWords { a, b, lefts: [p, q], to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(rows, to[row] = (at!(W, a[row]).left(p) + at!(W, b[row]).left(q)));
                }
                Step::DifferenceOfWords { a, b, lefts: [p, q], to } => {
                    let (a, b, to) = (&words[a], &words[b], &words[to]);
                    rows!(rows, to[row] = (at!(W, a[row]).left(p) - at!(W, b[row]).left(q)));
                }
                Step::Natural { from, to } => {
                    let (from, to) = (&exacts[from], &exacts[to]);
                    rows!(rows, to[row] = X::<W>::from_array(from[row].get()).max(X::<W>::splat(0)));
                }
                Step::NaturalWord { from, to } => {
                    let (from, to) = (&words[from], &words[to]);
                    rows!(rows, to[row] = at!(W, from[row]).max(W::splat(0)));
                }
                Step::AtMost { from, most, to } => {
                    let (from, to) = (&exacts[from], &exacts[to]);
                    rows!(rows, to[row] = X::<W>::from_array(from[row].get()).min(X::<W>::splat(most)));
                }
                Step::AtMostWord { from, most, to } => {
                    let (from, to) = (&words[from], &words[to]);
                    rows!(rows, to[row] = at!(W, from[row]).min(W::splat(most)));
                }
                Step::Lookup { from, table, short, to } => {
                    let (from, to, table) = (&words[from], &words[to], &self.program.tables[table]);
                    if short && !P::WORDS {
                        let table = table.natural::<W>();
                        rows!(rows, to[row] = table.words(at!(W, from[row])));
                    } else {
                        fits!(self, tap, rows, to[row] = tap.fit_words(table.fit(), table.exact_words(at!(W, from[row]))));
                    }
                }
                Step::Fit { from, ref fit, to } => {
                    let (from, to) = (&exacts[from], &words[to]);
                    if let (false, Some(fit)) = (P::WORDS, fit.narrow::<W>()) {
                        rows!(rows, to[row] = fit.words(X::<W>::from_array(from[row].get())));
                    } else {
                        fits!(self, tap, rows, to[row] = tap.fit_words(fit, X::<W>::from_array(from[row].get())));
                    }
                }
                Step::FitWide { from, ref fit, to } => {
                    let (from, to) = (&exacts[from], &exacts[to]);
                    fits!(self, tap, rows, to[row] = tap.fit_wide(fit, X::<W>::from_array(from[row].get())));
                }
            }
        }
    }
}

/// Turns nodes into steps.
struct Compiler<'n> {
    nodes: &'n [Node],
    /// How often each wire is still to be read; results of the graph always are.
    reads: Vec<usize>,
    /// Rows of each wire, of 32 bits and of 64.
    rows_of: Vec<[Option<usize>; 2]>,
    /// Rows that nothing reads any more, of 32 bits and of 64, and how many there are.
    free: [Vec<usize>; 2],
    rows: [usize; 2],
    steps: Vec<Step>,
    constants: Vec<(Place, i64)>,
    inputs: Vec<Place>,
}

/// Kinds of rows.
const WORD: usize = 0;
const EXACT: usize = 1;

impl<'n> Compiler<'n> {
    fn new(nodes: &'n [Node], outputs: &[Wire]) -> Self {
        let mut reads = vec![0; nodes.len()];
        for node in nodes {
            node.operator.reads().for_each(|wire| reads[wire.place()] += 1);
        }
        outputs.iter().for_each(|wire| reads[wire.place()] += 1);
        Compiler {
            nodes,
            reads,
            rows_of: vec![[None; 2]; nodes.len()],
            free: Default::default(),
            rows: [0; 2],
            steps: Vec::new(),
            constants: Vec::new(),
            inputs: Vec::new(),
        }
    }

    /// Whether 32 bits hold a wire.
    fn is_word(&self, wire: Wire) -> bool {
        self.nodes[wire.place()].shape.bits() < 32
    }

    fn row(&mut self, kind: usize, wire: Wire) -> usize {
        let row = self.free[kind].pop().unwrap_or_else(|| {
            self.rows[kind] += 1;
            self.rows[kind] - 1
        });
        self.rows_of[wire.place()][kind] = Some(row);
        row
    }

    fn place(&self, wire: Wire) -> Place {
        match self.rows_of[wire.place()] {
            [Some(row), _] => Place::Word(row),
            [None, row] => Place::Exact(row.unwrap_or_default()),
        }
    }

    /// The row where a wire lies in 32 bits.
    fn word(&mut self, wire: Wire) -> usize {
        if let [Some(row), _] = self.rows_of[wire.place()] {
            return row;
        }
        let from = self.rows_of[wire.place()][EXACT].unwrap_or_default();
        let to = self.row(WORD, wire);
        self.steps.push(Step::Narrow { from, to });
        to
    }

    /// The row where a wire lies in 64 bits.
    fn exact(&mut self, wire: Wire) -> usize {
        if let [_, Some(row)] = self.rows_of[wire.place()] {
            return row;
        }
        let from = self.rows_of[wire.place()][WORD].unwrap_or_default();
        let to = self.row(EXACT, wire);
        self.steps.push(Step::Widen { from, to });
        to
    }

    /// A wire was read: where nothing else will read it, its rows are free.
    fn read(&mut self, wire: Wire) {
        let place = wire.place();
        self.reads[place] -= 1;
        let is_kept = matches!(self.nodes[place].operator, Operator::Input(_) | Operator::Constant(_));
        if self.reads[place] == 0 && !is_kept {
            for kind in [WORD, EXACT] {
                self.free[kind].extend(self.rows_of[place][kind].take());
            }
        }
    }

    /// Whether a product goes into one fit and nowhere else.
    fn is_fitted(&self, product: Wire) -> bool {
        let fits = |node: &Node| matches!(node.operator, Operator::Fit(from, fit) if from == product && fit.is_short());
        self.reads[product.place()] == 1 && self.nodes.iter().any(fits)
    }

    /// Inputs and constants have rows of their own, which no step writes.
    fn kept(&mut self, place: usize) {
        let wire = Wire(place as u16);
        let kind = if self.is_word(wire) { WORD } else { EXACT };
        match self.nodes[place].operator {
            Operator::Input(_) => {
                self.row(kind, wire);
                self.inputs.push(self.place(wire));
            }
            Operator::Constant(value) => {
                self.row(kind, wire);
                self.constants.push((self.place(wire), value));
            }
            _ => {}
        }
    }

    fn node(&mut self, place: usize) {
        let to = Wire(place as u16);
        let node = self.nodes[place];
        let kept = self.is_word(to);
        match node.operator {
            Operator::Input(_) | Operator::Constant(_) => {}
            Operator::Product(_) if self.is_fitted(to) => return,
            Operator::Product([a, b]) => {
                let (a, b, to) = (self.word(a), self.word(b), self.row(EXACT, to));
                self.steps.push(Step::Product { a, b, to });
            }
            Operator::Sum([a, b], lefts) => {
                if kept && self.is_word(a) && self.is_word(b) {
                    let (a, b, to) = (self.word(a), self.word(b), self.row(WORD, to));
                    self.steps.push(Step::SumOfWords { a, b, lefts, to });
                } else {
                    let (a, b, to) = (self.exact(a), self.exact(b), self.row(EXACT, to));
                    self.steps.push(Step::Sum { a, b, lefts, to });
                }
            }
            Operator::Difference([a, b], lefts) => {
                if kept && self.is_word(a) && self.is_word(b) {
                    let (a, b, to) = (self.word(a), self.word(b), self.row(WORD, to));
                    self.steps.push(Step::DifferenceOfWords { a, b, lefts, to });
                } else {
                    let (a, b, to) = (self.exact(a), self.exact(b), self.row(EXACT, to));
                    self.steps.push(Step::Difference { a, b, lefts, to });
                }
            }
            Operator::Natural(from) => {
                if let Place::Word(from) = self.place(from) {
                    let to = self.row(WORD, to);
                    self.steps.push(Step::NaturalWord { from, to });
                } else {
                    let (from, to) = (self.exact(from), self.row(EXACT, to));
                    self.steps.push(Step::Natural { from, to });
                }
            }
            Operator::AtMost(from, most) => {
                if let (Place::Word(from), true) = (self.place(from), most < 1 << 31) {
                    let to = self.row(WORD, to);
                    self.steps.push(Step::AtMostWord { from, most, to });
                } else {
                    let (from, to) = (self.exact(from), self.row(EXACT, to));
                    self.steps.push(Step::AtMost { from, most, to });
                }
            }
            Operator::Lookup(from, table) => {
                let (from, to) = (self.word(from), self.row(WORD, to));
                self.steps.push(Step::Lookup { from, table, short: false, to });
            }
            Operator::Fit(from, fit) => self.fit(from, fit, to),
        }
        node.operator.reads().for_each(|wire| self.read(wire));
    }

    fn fit(&mut self, from: Wire, fit: Fit, to: Wire) {
        if let (Operator::Product([a, b]), [None, None]) = (self.nodes[from.place()].operator, self.rows_of[from.place()]) {
            let (x, y, to) = (self.word(a), self.word(b), self.row(WORD, to));
            self.steps.push(Step::ProductFit { a: x, b: y, fit, to });
            self.read(a);
            self.read(b);
        } else if !fit.is_short() {
            let (from, to) = (self.exact(from), self.row(EXACT, to));
            self.steps.push(Step::FitWide { from, fit, to });
        } else {
            let (from, to) = (self.exact(from), self.row(WORD, to));
            self.steps.push(Step::Fit { from, fit, to });
        }
    }
}
