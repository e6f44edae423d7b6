//! Reach: how far from its centre, as a radial index, a splat whose amplitude is its opacity has
//! weights that count. What the table of cutoffs by opacity is made of, exactly.
//!
//! ```text
//! opacity ─►[ellipse: peak]─► amplitude ─►[gauss]─► weight at each radial index, ≥ least?
//! ```
//! Law: `no_weight_beyond_its_reach_counts` (tests/machines).

use crate::graph::Graph;
use crate::machine::Machine;
use crate::num::Fit;
use crate::probe::{NoProbe, Tap};
use crate::units::gauss;

/// Weights of splats whose amplitude is their opacity.
#[derive(Clone, Debug)]
pub struct Reach {
    peak: Fit,
    gauss: Graph<1>,
    /// The greatest words of an opacity up to 1, and of a radial index.
    most: [i64; 2],
}

impl Reach {
    /// On a machine.
    pub fn new(machine: &Machine) -> Self {
        let (opacity, radial) = (machine.splat.opacity, machine.gauss.radial_index.format);
        Reach {
            peak: Fit::new(0, machine.ellipse.amplitude, opacity.into()),
            gauss: gauss::weights(machine),
            most: [opacity.format.one().min(opacity.format.max()), radial.max()],
        }
    }

    /// Weight (`gauss.weight`) of an opacity (`splat.opacity`) at a radial index
    /// (`gauss.radial_index`).
    pub fn weight(&self, opacity: i64, radial_index: i64) -> i64 {
        let [weight] = self.gauss.one(
            &[radial_index, self.peak.one(opacity)],
            &mut Tap::new(&mut NoProbe),
        );
        weight
    }

    /// The greatest radial index (`gauss.radial_index`) at which an opacity has at least this
    /// weight; none where it has none. Weights fall with the radial index.
    pub fn farthest(&self, opacity: i64, least_weight: i64) -> Option<i64> {
        let counts = |radial: i64| self.weight(opacity, radial) >= least_weight;
        counts(0).then(|| last_that([0, self.most[1]], counts))
    }

    /// The least opacity (`splat.opacity`) that has at least this weight anywhere; one place above
    /// 1 where none up to 1 has.
    pub fn least_opacity(&self, least_weight: i64) -> i64 {
        let is_seen = |opacity: i64| self.weight(opacity, 0) >= least_weight;
        if is_seen(0) {
            0
        } else {
            1 + last_that([0, self.most[0]], |opacity| !is_seen(opacity))
        }
    }
}

/// The last number of a range up to which something holds: it holds of the first.
fn last_that([first, last]: [i64; 2], holds: impl Fn(i64) -> bool) -> i64 {
    let (mut below, mut above) = (first, last + 1);
    while above - below > 1 {
        let middle = i64::midpoint(below, above);
        *(if holds(middle) {
            &mut below
        } else {
            &mut above
        }) = middle;
    }
    below
}
