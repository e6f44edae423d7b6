//! Reach: computes the radial index up to which a splat's weights count, where the splat's
//! amplitude is its opacity. The table of cutoffs by opacity is built from this, exactly.
//!
//! ```text
//! opacity ─►[ellipse: peak]─► amplitude ─►[gauss]─► weight at each radial index, ≥ least?
//! ```
//! Law: `no_weight_beyond_its_reach_counts` (tests/machines).

use crate::graph::Graph;
use crate::machine::Machine;
use crate::num::{Fit, Format};
use crate::probe::{NoProbe, Tap};
use crate::units::gauss;

/// Weights of splats whose amplitude is their opacity.
#[derive(Clone, Debug)]
pub struct Reach {
    peak: Fit,
    gauss: Graph<1>,
    opacity: Format,
    /// Greatest words: of an opacity up to 1, and of a radial index.
    most: [i64; 2],
}

impl Reach {
    /// Weights on a machine.
    pub fn new(machine: &Machine) -> Self {
        let (opacity, radial) = (machine.splat.opacity, machine.gauss.radial_index.format);
        Reach {
            peak: Fit::new(0, machine.ellipse.amplitude, opacity.into()),
            gauss: gauss::weights(machine),
            opacity: opacity.format,
            most: [opacity.format.one().min(opacity.format.max()), radial.max()],
        }
    }

    /// Weight (`gauss.weight`) for an opacity (`splat.opacity`) at a radial index
    /// (`gauss.radial_index`).
    pub fn weight(&self, opacity: i64, radial_index: i64) -> i64 {
        let [weight] = self.gauss.one(
            &[radial_index, self.peak.one(opacity)],
            &mut Tap::new(&mut NoProbe),
        );
        weight
    }

    /// Greatest radial index (`gauss.radial_index`) at which an opacity has at least this weight;
    /// `None` where it has it nowhere. Weights fall with the radial index.
    pub fn farthest(&self, opacity: i64, least_weight: i64) -> Option<i64> {
        let counts = |radial: i64| self.weight(opacity, radial) >= least_weight;
        counts(0).then(|| last_that([0, self.most[1]], counts))
    }

    /// Least opacity (`splat.opacity`) that has at least this weight anywhere; the next word after 1 where
    /// no opacity up to 1 has.
    pub fn least_opacity(&self, least_weight: i64) -> i64 {
        let is_seen = |opacity: i64| self.weight(opacity, 0) >= least_weight;
        if is_seen(0) {
            0
        } else {
            let unseen = last_that([0, self.most[0]], |opacity| !is_seen(opacity));
            self.opacity.representable_from(unseen + 1)
        }
    }
}

/// Last number of a range for which `holds`. It must hold for a first part of the range, at least
/// for its first number.
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
