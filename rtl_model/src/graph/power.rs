//! Power: the power of two that a wire is relative to, where the data decides on it.
//!
//! A wire's value is `word · 2^(power − frac_bits)`. A normaliser, a reciprocal and a root make
//! words that are relative to a power; products multiply powers, and a fit may put a result under
//! another. So the shifts between them follow from what the wires are relative to, and no unit
//! states them.

use super::Wire;

/// Most wires that one power depends on.
const MOST: usize = 4;

/// 2^(constant + Σ factor · exponent): a sum over wires that hold exponents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Power {
    pub(super) constant: i32,
    terms: [(Wire, i32); MOST],
    count: usize,
}

impl Power {
    /// 2^0: a word that is what it says.
    pub const ONE: Power = Power {
        constant: 0,
        terms: [(Wire(0), 0); MOST],
        count: 0,
    };

    /// 2^exponent of a wire.
    pub(super) fn of(exponent: Wire) -> Power {
        Power {
            constant: 0,
            terms: [(exponent, 1), (Wire(0), 0), (Wire(0), 0), (Wire(0), 0)],
            count: 1,
        }
    }

    /// Wires and their factors.
    pub(super) fn terms(&self) -> &[(Wire, i32)] {
        &self.terms[..self.count]
    }

    /// The same sum over other wires.
    pub(super) fn with_wires(mut self, mut of: impl FnMut(Wire) -> Wire) -> Power {
        self.terms[..self.count]
            .iter_mut()
            .for_each(|(wire, _)| *wire = of(*wire));
        self
    }

    /// The product of two.
    ///
    /// # Panics
    /// Where it depends on more wires than any unit's does.
    pub fn times(mut self, other: Power) -> Power {
        self.constant = self.constant.saturating_add(other.constant);
        for &(wire, factor) in other.terms() {
            match self.terms[..self.count]
                .iter_mut()
                .find(|(known, _)| *known == wire)
            {
                Some((_, known)) => *known += factor,
                None => {
                    self.terms[self.count] = (wire, factor);
                    self.count += 1;
                }
            }
            if let Some(gone) = self.terms[..self.count]
                .iter()
                .position(|(_, factor)| *factor == 0)
            {
                self.count -= 1;
                self.terms.swap(gone, self.count);
                self.terms[self.count] = (Wire(0), 0);
            }
        }
        self
    }

    /// The n-th power of it.
    pub fn power(mut self, n: i32) -> Power {
        if n == 0 {
            return Power::ONE;
        }
        self.constant = self.constant.saturating_mul(n);
        self.terms[..self.count]
            .iter_mut()
            .for_each(|(_, factor)| *factor *= n);
        self
    }

    /// Its inverse.
    pub fn inverse(self) -> Power {
        self.power(-1)
    }

    /// Its square root, of an even power.
    ///
    /// # Panics
    /// Where it is not even.
    pub(super) fn root(mut self) -> Power {
        let half = |exponent: &mut i32| {
            assert!(*exponent % 2 == 0, "a root is taken of a square");
            *exponent /= 2;
        };
        half(&mut self.constant);
        self.terms[..self.count]
            .iter_mut()
            .for_each(|(_, factor)| half(factor));
        self
    }

    /// The same times 2^`places`.
    pub fn shifted(self, places: i32) -> Power {
        Power {
            constant: self.constant.saturating_add(places),
            ..self
        }
    }
}
