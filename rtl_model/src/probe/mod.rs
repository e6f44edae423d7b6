//! Probe: what can be observed while the machine draws. The default methods do nothing and cost
//! nothing.
//!
//! Units pass every fitted word and every decision to a [`Tap`]; with [`NoProbe`] the compiler
//! removes these calls. Forks of a probe observe parts of a frame. Absorbing forks is associative,
//! so the number of threads does not change a count.
//!
//! A probe observes words one by one, or ([`Probe::EIGHT`]) eight at a time without their losses.
//! In the second case it can request that an item of work (eight splats or a tile) is
//! [repeated](Probe::resample) with single words.

mod composite;
mod meters;
mod observer;
mod ranges;
mod recorder;

pub use composite::Composite;
pub use meters::Meters;
pub use observer::{DynProbe, Observer};
pub use ranges::{BINS, Range, Ranges};

use crate::num::{Exacts, Fit, LANES, Lanes, LimitedWords, Register, Words, three};
use crate::records::{
    Contribution, Decision, Layer, PROJECTED, SET_UP, ShadeInput, ShadeOutput, Slot, Weighed,
};
use crate::work::{CULLED, MergedLists, TestedWords};

/// A probe of the machine.
pub trait Probe: Send + Sync + Sized {
    /// Whether the probe observes words; if not, the compiler drops the calls.
    const WORDS: bool;
    /// Whether the probe accepts words eight at a time, without their exact results, where
    /// possible.
    const EIGHT: bool = false;
    /// Whether the probe observes contributions and resolved pixels.
    const DECISIONS: bool;
    /// Whether frames with this probe get vector instructions and specialised paths for common
    /// machines: fast to draw, slow to compile.
    const QUICK: bool = false;

    /// Whether the probe observes work: outcomes of splats, rows, contributions and pixels.
    const WORK: bool = false;
    /// Whether the probe observes transfers, record by record as in
    /// [`ports`](crate::pipeline::ports). The machine then processes one item at a time, and words
    /// observed between two transfers belong to the second.
    const TRANSFERS: bool = false;

    /// A fresh probe of the same kind, for another part of the frame.
    fn fork(&self) -> Self;
    /// Adds the observations of a fork.
    fn absorb(&mut self, fork: Self);
    /// `exact` (with `more` fraction bits than elaborated) became `word` at `fit.signal`.
    fn word(&mut self, _fit: &Fit, _exact: i64, _more: i64, _word: i64) {}
    /// A word of a signal that no limit changed.
    #[inline(always)]
    fn one(&mut self, _signal: usize, _word: i64) {}
    /// Words of a signal. Only the `live` lanes count (a bit each).
    #[inline(always)]
    fn eight<W: Words>(&mut self, _signal: usize, _fitted: LimitedWords<W>, _live: u8) {}
    /// [`Probe::eight`] for words of up to 48 bits, and the lanes that a limit changed.
    #[inline(always)]
    fn wide(&mut self, _signal: usize, _words: [i64; LANES], _limited: u8, _live: u8) {}
    /// Three words of a signal that no limit changed.
    #[inline(always)]
    fn three(&mut self, _signal: usize, _words: [i64; 3]) {}
    /// The eight sums of a fragment, in the order of their signals.
    #[inline(always)]
    fn sums<W: Words>(&mut self, _fitted: LimitedWords<W>) {}
    /// A register exceeded its format and wrapped.
    fn wrapped(&mut self, _signal: usize) {}
    /// A register of a signal passes through all values from the first to the second, which are not
    /// words themselves.
    fn reached(&mut self, _signal: usize, _results: [i64; 2]) {}
    /// All words of an item of work have been observed: item `item` of `of` in the frame. Returns
    /// the ranges that observe the same item again, word by word, if any.
    #[inline(always)]
    fn resample(&mut self, _item: usize, _of: usize) -> Option<&mut Ranges> {
        None
    }

    /// The next observations belong to the nth item of a batch.
    #[inline(always)]
    fn item(&mut self, _nth: usize) {}
    /// [`Probe::resample`] for a batch of items; the first of them has [`Probe::item`] 0.
    #[inline(always)]
    fn resample_batch(
        &mut self,
        _items: std::ops::Range<usize>,
        _of: usize,
        _again: impl FnMut(usize, &mut Ranges),
    ) {
    }
    /// A splat contributed to pixel (x, y), with this decision.
    fn contribution(
        &mut self,
        _x: u32,
        _y: u32,
        _contribution: &Contribution,
        _decision: Decision,
    ) {
    }
    /// Pixel (x, y), before it is resolved, has windows that start at these slots, a bit each, the
    /// first slot in the LSB.
    fn windows(&mut self, _x: u32, _y: u32, _starts: u8) {}
    /// Pixel (x, y) was resolved from these layers, front to back, to this frame word.
    fn resolved(&mut self, _x: u32, _y: u32, _layers: &[Layer], _frame: [i64; 4]) {}
    /// Those of eight splats from `first` on that were not drawn, by reason as in [`CULLED`], the
    /// first splat in the LSB.
    fn culled(&mut self, _first: u32, _lanes: [u8; CULLED.len()]) {}
    /// A splat has a box: its first and last column and row.
    #[inline(always)]
    fn drawn(&mut self, _splat: u32, _sides: [[u16; 2]; 2]) {}
    /// All splats with a box have been observed. They are drawn in this order, given as indices
    /// among them.
    fn sorted(&mut self, _order: Vec<u32>, _keys: Vec<u32>) {}
    /// After [`Probe::sorted`], on a machine that keeps lists from frame to frame: the lists of the
    /// frame. Each is drawn in its own order.
    fn merged(&mut self, _lists: MergedLists) {}
    /// All splats with a box have been observed. Tiles are tested with these words of them, in
    /// input order, and this cutoff.
    fn tested(&mut self, _words: Vec<TestedWords>, _cutoff: i64) {}
    /// Splats are ellipsoids: whether those with a box are lit before they are drawn, whether all
    /// have the axes in the registers, and the degree of the harmonics of their colours.
    fn ellipsoids(&mut self, _preshaded: bool, _shared_axes: bool, _harmonics: u8) {}
    /// A splat that is lit before it is drawn has this colour from now on. Its input to shade was
    /// observed before.
    fn emitted(&mut self, _splat: u32, _rgb: [i32; 3]) {}
    /// A splat's part of a tile, which has `rows` rows from column `left` of the tile on, keeps
    /// these pixels: 16 · row + column.
    #[inline(always)]
    fn span(&mut self, _rows: usize, _left: usize, _places: &[u8]) {}
    /// Blocks of the next splat's part of a tile that are kept, a bit each, by rows of the tile, the
    /// first in the LSB.
    fn blocks(&mut self, _mask: u16) {}
    /// Decision on the contribution to the next pixel; none if its weight rounds to 0.
    #[inline(always)]
    fn became(&mut self, _decision: Option<Decision>) {}
    /// The next pixel stopped with this contribution, whatever the decision on it: by blending the
    /// sheet before it, or by itself.
    fn stopped(&mut self, _by_merge: bool) {}
    /// A fragment is shaded before it merges.
    fn shaded(&mut self) {}
    /// A fragment goes to shade, in a frame with surroundings.
    fn lit(&mut self) {}
    /// That fragment reflects them: column and row of the first of the four texels of its look-up.
    fn looked_up(&mut self, _texel: [u8; 2]) {}
    /// All splats have been set up, in a frame with surroundings.
    fn mirrors(&mut self) {}
    /// The next pixel of a tile ends with this number of fragments, of which `shades` are not
    /// shaded yet.
    #[inline(always)]
    fn held(&mut self, _fragments: u8, _shades: u8) {}
    /// The colour of a splat that left setup, from its harmonics, after [`Probe::set_up`] of the
    /// splat.
    fn coloured(&mut self, _splat: u32, _rgb: [i32; 3]) {}
    /// A splat left setup with these words of `project.out` and of `ellipse.out`, before any
    /// masking.
    fn set_up(&mut self, _splat: u32, _project: [i64; PROJECTED], _ellipse: [i64; SET_UP]) {}
    /// The raster has finished a splat's part of a tile.
    fn walked(&mut self, _splat: u32) {}
    /// A splat's fragment at pixel (x, y) left raster and gauss.
    fn weighed(&mut self, _x: u32, _y: u32, _weighed: &Weighed) {}
    /// A fragment enters shade, from merging or from resolving. The following observations belong
    /// to shade.
    fn shade_in(&mut self) {}
    /// That fragment left shade.
    fn shade_out(&mut self, _input: &ShadeInput, _output: &ShadeOutput) {}
    /// The fragments that pixel (x, y) finally holds, slot by slot, each with its light. For
    /// sheets: the blended sheets, then the open one, with the light of all together.
    fn holds(&mut self, _x: u32, _y: u32, _slots: &[Slot], _layers: &[Layer]) {}
    /// The tile whose first pixel is (x, y) has been observed completely.
    fn tile(&mut self, _x: u32, _y: u32) {}
}

/// No probe: nothing is observed.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProbe;

impl Probe for NoProbe {
    const QUICK: bool = true;
    const WORDS: bool = false;
    const DECISIONS: bool = false;
    fn fork(&self) -> Self {
        NoProbe
    }
    fn absorb(&mut self, _fork: Self) {}
}

/// A unit's connection to the probe: every fit goes through it.
#[derive(Debug)]
pub struct Tap<'a, P> {
    /// The probe.
    pub probe: &'a mut P,
    /// Lanes with a live item, the first in the LSB. The probe does not observe the others.
    pub live: u8,
}

impl<'a, P: Probe> Tap<'a, P> {
    /// A tap for one item at a time.
    #[inline(always)]
    pub fn new(probe: &'a mut P) -> Self {
        Tap {
            probe,
            live: u8::MAX,
        }
    }

    /// Limits the tap to the first `lanes` lanes.
    #[inline(always)]
    pub fn first(self, lanes: usize) -> Self {
        Tap {
            live: ((1 << lanes.min(LANES)) - 1) as u8,
            ..self
        }
    }

    /// The next observations belong to the nth item of a batch, in these lanes.
    #[inline(always)]
    pub fn item(&mut self, nth: usize, live: u8) {
        self.probe.item(nth);
        self.live = live;
    }

    /// Excludes the lanes where the condition holds.
    #[inline(always)]
    pub fn drop_where<W: Words>(&mut self, condition: W) {
        if P::WORDS {
            self.live &= !condition.signs();
        }
    }

    /// Fits one result.
    #[inline(always)]
    pub fn fit_one(&mut self, fit: &Fit, exact: i64) -> i64 {
        if P::EIGHT
            && let Some(word) = fit.one_within(exact)
        {
            self.probe.one(fit.signal, word);
            return word;
        }
        let word = fit.one(exact);
        if P::WORDS {
            self.probe.word(fit, exact, 0, word);
        }
        word
    }

    /// Fits three results.
    #[inline(always)]
    pub fn fit_three(&mut self, fit: &Fit, exact: [i64; 3]) -> [i64; 3] {
        if P::EIGHT
            && let Some(words) = fit.three_within(exact)
        {
            self.probe.three(fit.signal, words);
            return words;
        }
        three!(i => self.fit_one(fit, exact[i]))
    }

    /// Fits three results that have `more` fraction bits than elaborated.
    #[inline(always)]
    pub fn fit_three_shifted(&mut self, fit: &Fit, exact: [i64; 3], more: i64) -> [i64; 3] {
        if P::EIGHT
            && let Some(words) = fit.three_shifted_within(exact, more)
        {
            self.probe.three(fit.signal, words);
            return words;
        }
        three!(i => self.fit_one_shifted(fit, exact[i], more))
    }

    /// Fits one result that has `more` fraction bits than elaborated.
    #[inline(always)]
    pub fn fit_one_shifted(&mut self, fit: &Fit, exact: i64, more: i64) -> i64 {
        if P::EIGHT
            && let Some(word) = fit.one_shifted_within(exact, more)
        {
            self.probe.one(fit.signal, word);
            return word;
        }
        let word = fit.one_shifted(exact, more);
        if P::WORDS {
            self.probe.word(fit, exact, more, word);
        }
        word
    }

    /// Fits eight results.
    #[inline(always)]
    pub fn fit<L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if P::WORDS {
            self.observe_lanes::<false, L>(fit, exact)
        } else {
            fit.lanes(exact)
        }
    }

    /// Fits eight results into registers that wrap.
    #[inline(always)]
    pub fn fit_register<L: Lanes>(&mut self, fit: &Fit, register: Register, exact: L) -> L {
        let result = fit.lanes_register(exact);
        let held = register.hold(result);
        if P::WORDS {
            let word = register.read_lanes(held);
            if P::EIGHT && fit.is_register() {
                let limited = (result.above(word) | word.above(result)).signs();
                if fit.word.format.width() < 32 {
                    self.probe.eight(
                        fit.signal,
                        LimitedWords {
                            words: word.low(),
                            limited,
                        },
                        self.live,
                    );
                } else {
                    self.probe
                        .wide(fit.signal, word.to_array(), limited, self.live);
                }
            } else {
                self.report(*fit, exact.to_array(), [0; LANES], word.to_array());
            }
        }
        held
    }

    /// Fits eight results ≥ 0 to unsigned words ([`Fit::lanes_unsigned`]).
    #[inline(always)]
    pub fn fit_unsigned<const SIMPLE_FITS: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if P::WORDS {
            self.observe_lanes::<true, L>(fit, exact)
        } else {
            fit.lanes_unsigned::<SIMPLE_FITS, L>(exact)
        }
    }

    /// [`Tap::fit_unsigned`] for a word that represents every result.
    #[inline(always)]
    pub fn fit_within<const SIMPLE_FITS: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if P::WORDS {
            self.observe_lanes::<true, L>(fit, exact)
        } else {
            fit.lanes_within::<SIMPLE_FITS, L>(exact)
        }
    }

    #[inline(always)]
    fn observe_lanes<const UNSIGNED: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if P::EIGHT
            && let Some((words, limited)) = fit.lanes_limited::<UNSIGNED, L>(exact)
        {
            if fit.is_short() {
                self.probe.eight(
                    fit.signal,
                    LimitedWords {
                        words: words.low(),
                        limited,
                    },
                    self.live,
                );
            } else {
                self.probe
                    .wide(fit.signal, words.to_array(), limited, self.live);
            }
            return words;
        }
        L::from_array(self.observe_one_by_one(*fit, exact.to_array(), [0; LANES]))
    }

    /// Fits eight results to words of at most 32 bits.
    #[inline(always)]
    pub fn fit_words<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        if P::WORDS {
            self.observe_words(
                fit,
                exact,
                if P::EIGHT {
                    fit.words_limited(exact)
                } else {
                    None
                },
            )
        } else {
            fit.words(exact)
        }
    }

    /// Fits eight results, which a normaliser has shifted to the top of their 62 bits, to words of
    /// at most 32 bits.
    #[inline(always)]
    pub fn fit_top<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        if P::WORDS {
            self.observe_words(
                fit,
                exact,
                if P::EIGHT {
                    fit.top_limited(exact)
                } else {
                    None
                },
            )
        } else {
            fit.top(exact)
        }
    }

    #[inline(always)]
    fn observe_words<X: Exacts>(
        &mut self,
        fit: &Fit,
        exact: X,
        fitted: Option<LimitedWords<X::Words>>,
    ) -> X::Words {
        let Some(fitted) = fitted else {
            return X::from_array(self.observe_one_by_one(*fit, exact.to_array(), [0; LANES]))
                .low();
        };
        self.probe.eight(fit.signal, fitted, self.live);
        fitted.words
    }

    /// Fits eight results to words that can have more than 32 bits.
    #[inline(always)]
    pub fn fit_wide<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X {
        if P::EIGHT
            && let Some((words, limited)) = fit.wide_limited(exact)
        {
            if fit.is_short() {
                self.probe.eight(
                    fit.signal,
                    LimitedWords {
                        words: words.low(),
                        limited,
                    },
                    self.live,
                );
            } else {
                self.probe
                    .wide(fit.signal, words.to_array(), limited, self.live);
            }
            return words;
        }
        if P::WORDS {
            X::from_array(self.observe_one_by_one(*fit, exact.to_array(), [0; LANES]))
        } else {
            fit.wide(exact)
        }
    }

    /// Fits eight results, each with `more` fraction bits than elaborated, to words of at most 32
    /// bits.
    #[inline(always)]
    pub fn fit_shifted<X: Exacts>(&mut self, fit: &Fit, exact: X, more: X::Words) -> X::Words {
        if P::EIGHT
            && let Some(fitted) = fit.shifted_limited(exact, more)
        {
            self.probe.eight(fit.signal, fitted, self.live);
            return fitted.words;
        }
        if P::WORDS {
            X::from_array(self.observe_one_by_one(*fit, exact.to_array(), more.exact().to_array()))
                .low()
        } else {
            fit.words_shifted(exact, more)
        }
    }

    /// Fits eight results one by one and reports the live ones: the slow path of every observed
    /// fit. It takes a copy of the fit, as in `num::fit`.
    #[cold]
    #[inline(never)]
    fn observe_one_by_one(
        &mut self,
        fit: Fit,
        exact: [i64; LANES],
        more: [i64; LANES],
    ) -> [i64; LANES] {
        let mut words = exact;
        for (word, more) in words.iter_mut().zip(more) {
            *word = fit.one_shifted(*word, more);
        }
        self.report(fit, exact, more, words);
        words
    }

    #[inline(never)]
    fn report(&mut self, fit: Fit, exact: [i64; LANES], more: [i64; LANES], words: [i64; LANES]) {
        for lane in (0..LANES).filter(|lane| self.live & (1 << lane) != 0) {
            self.probe.word(&fit, exact[lane], more[lane], words[lane]);
        }
    }
}

#[cfg(test)]
mod tests;
