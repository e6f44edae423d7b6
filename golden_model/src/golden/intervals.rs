//! Intervals: groups contributions by the depths that a fragment spans, not by the depth of its
//! first contribution (docs/book/algorithm-resolve.md §11).
//!
//! A contribution joins a fragment if all its contributions together stay narrower than ε.
//! Therefore a fragment never spans more than a surface may. Overflow is handled as in the paper.

use super::fragments::{Fragment, Slot};
use super::shade::Shader;

/// Depths from the nearest to the farthest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    /// Nearest depth.
    pub near: f64,
    /// Farthest depth.
    pub far: f64,
}

impl Span {
    /// The span of one depth.
    pub fn at(z: f64) -> Self {
        Span { near: z, far: z }
    }

    /// Extends the span to a depth.
    pub fn with(self, z: f64) -> Self {
        Span {
            near: self.near.min(z),
            far: self.far.max(z),
        }
    }

    /// The span from the nearest to the farthest depth of both.
    pub fn union(self, other: Span) -> Self {
        Span {
            near: self.near.min(other.near),
            far: self.far.max(other.far),
        }
    }

    /// Distance from the nearest to the farthest depth.
    pub fn width(self) -> f64 {
        self.far - self.near
    }

    /// Whether a depth is inside, ends included.
    pub fn holds(self, z: f64) -> bool {
        self.near <= z && z <= self.far
    }

    /// Distance of a depth from the span; 0 inside.
    pub fn gap(self, z: f64) -> f64 {
        (self.near - z).max(z - self.far).max(0.0)
    }
}

/// A fragment and the depths of its contributions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spanning {
    fragment: Fragment,
    span: Span,
}

impl Slot for Spanning {
    fn new(fragment: Fragment) -> Self {
        Spanning {
            fragment,
            span: Span::at(fragment.z),
        }
    }

    fn fragment(&self) -> &Fragment {
        &self.fragment
    }

    fn add(&mut self, contribution: &Fragment) {
        self.fragment.add(contribution);
        self.span = self.span.with(contribution.z);
    }

    fn set_depth(&mut self, z: f64) {
        self.fragment.z = z;
    }

    fn merge(front: &Self, back: &Self, shader: &Shader) -> Self {
        Spanning {
            fragment: Fragment::merge(&front.fragment, &back.fragment, shader),
            span: front.span.union(back.span),
        }
    }

    fn slot_for(z_threshold: f64, z: f64, slots: &[Self]) -> Option<usize> {
        let open = slots
            .iter()
            .enumerate()
            .filter(|(_, slot)| !slot.fragment.shaded)
            .map(|(index, slot)| (index, slot.span));
        nearest_that_stays_within(z_threshold, z, open)
    }
}

/// The index of the span with the smallest gap to `z`, among those that contain `z` or stay
/// narrower than `width` together with it; the first on ties.
pub(crate) fn nearest_that_stays_within(
    width: f64,
    z: f64,
    spans: impl Iterator<Item = (usize, Span)>,
) -> Option<usize> {
    let (mut least, mut nearest) = (f64::INFINITY, None);
    for (index, span) in spans {
        let gap = span.gap(z);
        if (span.holds(z) || span.with(z).width() < width) && gap < least {
            (least, nearest) = (gap, Some(index));
        }
    }
    nearest
}
