//! Fragments: keeps at most `l` layers of one pixel, by the machine's rules (docs/book/algorithm.md
//! §6).
//! ```text
//! contribution ─► near one? ─► accumulate
//!                 room? ─────► insert
//!                 hidden? ───► evict the deepest
//!                 else ──────► shade two, front over back
//! ```

use std::ops::Range;

use glam::{DVec3, DVec4};

use super::footprint::{Contribution, Footprint};
use super::shade::{Shader, over};
use super::tiles::{Cover, PIXELS_IN_A_TILE, Painter};
use super::{FragmentDepth, Outcomes, Rules};

/// One layer of one pixel. Unshaded it holds weighted sums; shaded it holds a premultiplied colour
/// and its alpha.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fragment {
    /// Sum of weights.
    pub weight: f64,
    /// Weighted sum of colours, or the premultiplied colour.
    pub rgb: DVec3,
    /// Weighted sum of opacities, or alpha.
    pub alpha: f64,
    /// Weighted sum of normals.
    pub normal: DVec3,
    /// Depth that contributions are compared with.
    pub z: f64,
    /// Material of the first contribution.
    pub material: u32,
    /// Whether it holds a colour instead of sums.
    pub shaded: bool,
    /// Sheet of the fragment, if fragments are grouped by sheets.
    pub sheet: u32,
    /// Column and row.
    pub pixel: [u16; 2],
}

/// Outcome of one contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Added to the fragment in `slot`.
    Accumulated {
        /// Where it was added.
        slot: usize,
    },
    /// Took a free slot.
    Inserted {
        /// The slot that it took.
        slot: usize,
    },
    /// The pixel was full. In z order, with the new one among the fragments, number `slot` and the
    /// next were merged; the result is in `slot`.
    Merged {
        /// Where the merged fragment is now.
        slot: usize,
        /// The new contribution's place among the fragments in z order, before the merge.
        place: usize,
    },
    /// Added to the front or the back of the closed fragment in `slot`, because its surface was
    /// closed already.
    Late {
        /// Where it was added.
        slot: usize,
        /// The side that it was added to.
        side: Side,
    },
    /// Blended between the front and the back of the closed fragment in `slot`.
    Inside {
        /// Where it was blended.
        slot: usize,
    },
    /// The pixel was full. In the order of nearest depths, with the new one among the fragments,
    /// number `slot` and the next were summed; the sum is in `slot`.
    Summed {
        /// Where the sum is now.
        slot: usize,
        /// The new contribution's place among the fragments, before the sum.
        place: usize,
    },
    /// The pixel was full, and no two fragments could be summed: the two deepest, of which `slot`
    /// is the front, were closed and combined.
    Closed {
        /// Where the closed fragment is now.
        slot: usize,
        /// The new contribution's place among the fragments, before they were combined.
        place: usize,
        /// Whether the second was blended between the two sides of the first instead of behind it.
        inside: bool,
    },
    /// The pixel was full and its deepest fragment hidden; that fragment was dropped.
    Evicted {
        /// The new contribution's slot; none if it was itself the deepest.
        slot: Option<usize>,
    },
    /// Nearer than the contents of the z-buffer.
    Replaced,
    /// Deeper than the contents of the z-buffer.
    Dropped,
}

/// Side of a closed fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Its nearest surface.
    Front,
    /// Its deepest surface.
    Back,
}

impl Fragment {
    /// A fragment of one contribution to this column and row.
    pub fn new(footprint: &Footprint, contribution: &Contribution, pixel: [u32; 2]) -> Self {
        let weight = contribution.weight;
        Fragment {
            weight,
            rgb: footprint.rgb * weight,
            alpha: footprint.opacity * weight,
            normal: footprint.normal * weight,
            z: contribution.z,
            material: footprint.material,
            shaded: false,
            sheet: footprint.sheet,
            pixel: pixel.map(|place| place as u16),
        }
    }

    /// Adds a contribution; depth and material stay those of the first.
    pub fn add(&mut self, contribution: &Fragment) {
        self.weight += contribution.weight;
        self.rgb += contribution.rgb;
        self.alpha += contribution.alpha;
        self.normal += contribution.normal;
    }

    /// Whether its alpha reaches a limit; of sums, only if their weight covers the pixel.
    pub fn is_opaque(&self, limit: f64, coverage_threshold: f64) -> bool {
        if self.shaded {
            self.alpha >= limit
        } else {
            self.alpha >= limit * self.weight && self.weight >= coverage_threshold
        }
    }

    /// Merges two fragments at the front's depth.
    pub fn merge(front: &Fragment, back: &Fragment, shader: &Shader) -> Fragment {
        front.with_light(over(
            shader.premultiplied(front),
            shader.premultiplied(back),
        ))
    }

    /// The same fragment, shaded to this light.
    pub fn with_light(&self, light: DVec4) -> Fragment {
        Fragment {
            rgb: light.truncate(),
            alpha: light.w,
            shaded: true,
            ..*self
        }
    }
}

/// One slot of a pixel: a fragment, and the state of the grouping rule.
pub(crate) trait Slot: Copy + Default {
    /// A slot with one contribution.
    fn new(fragment: Fragment) -> Self;
    fn fragment(&self) -> &Fragment;
    fn add(&mut self, contribution: &Fragment);
    /// Sets the depth that contributions are compared with from now on.
    fn set_depth(&mut self, z: f64);
    /// Merges two slots; the result is shaded.
    fn merge(front: &Self, back: &Self, shader: &Shader) -> Self;
    /// The slot that a contribution of this depth joins, if any.
    fn slot_for(z_threshold: f64, z: f64, slots: &[Self]) -> Option<usize>;
}

impl Slot for Fragment {
    fn new(fragment: Fragment) -> Self {
        fragment
    }

    fn fragment(&self) -> &Fragment {
        self
    }

    fn add(&mut self, contribution: &Fragment) {
        Fragment::add(self, contribution);
    }

    fn set_depth(&mut self, z: f64) {
        self.z = z;
    }

    fn merge(front: &Self, back: &Self, shader: &Shader) -> Self {
        Fragment::merge(front, back, shader)
    }

    fn slot_for(z_threshold: f64, z: f64, slots: &[Self]) -> Option<usize> {
        nearest_within(z_threshold, z, slots)
    }
}

/// The fragment unit: the fragments of one tile.
pub(super) struct FragmentPainter<'a, S> {
    rules: &'a Rules,
    z_threshold: f64,
    shader: &'a Shader,
    /// Slots of a pixel.
    layers: usize,
    /// A pixel's slots are contiguous, followed by a spare one for overflow.
    slots: Vec<S>,
    /// Slots in use, per pixel.
    used: Vec<usize>,
    outcomes: Outcomes,
}

impl<'a, S: Slot> FragmentPainter<'a, S> {
    pub fn new(rules: &'a Rules, z_threshold: f64, shader: &'a Shader) -> Self {
        let layers = if rules.merge == Merge::Replace {
            1
        } else {
            rules.layers.max(1)
        };
        let slots = vec![S::default(); PIXELS_IN_A_TILE * (layers + 1)];
        let used = vec![0; PIXELS_IN_A_TILE];
        FragmentPainter {
            rules,
            z_threshold,
            shader,
            layers,
            slots,
            used,
            outcomes: Outcomes::default(),
        }
    }

    /// The fragments of one pixel in slot order.
    pub fn fragments(&mut self, pixel: usize) -> &mut [S] {
        let first = pixel * (self.layers + 1);
        &mut self.slots[first..first + self.used[pixel]]
    }

    /// Takes one contribution and returns its outcome.
    pub fn decide(&mut self, pixel: usize, new: Fragment) -> Decision {
        let first = pixel * (self.layers + 1);
        let slots = &mut self.slots[first..=first + self.layers];
        let used = &mut self.used[pixel];
        if let Some(slot) = S::slot_for(self.z_threshold, new.z, &slots[..*used]) {
            let target = &mut slots[slot];
            target.add(&new);
            if self.rules.fragment_depth == FragmentDepth::Nearest {
                target.set_depth(target.fragment().z.min(new.z));
            }
            return Decision::Accumulated { slot };
        }
        if *used < self.layers {
            slots[*used] = S::new(new);
            *used += 1;
            return Decision::Inserted { slot: *used - 1 };
        }
        match self.rules.merge.pair_of() {
            None => replace(&mut slots[0], new),
            Some(pair) => overflow(self.rules, pair, self.shader, slots, new),
        }
    }
}

impl Cover for Footprint {
    type Contribution = Fragment;

    fn sides(&self) -> [Range<u32>; 2] {
        [self.columns.clone(), self.rows.clone()]
    }

    fn contribute(
        &self,
        columns: Range<u32>,
        rows: Range<u32>,
        mut take: impl FnMut([u32; 2], Fragment),
    ) {
        for y in rows {
            let row = self.row(y);
            for x in columns.clone() {
                if let Some(contribution) = row.at(x) {
                    take([x, y], Fragment::new(self, &contribution, [x, y]));
                }
            }
        }
    }
}

impl<S: Slot> Painter for FragmentPainter<'_, S> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        let decision = self.decide(pixel, contribution);
        self.outcomes.count(decision);
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let shader = self.shader;
        let fragments = self.fragments(pixel);
        let (colour, layers) = (resolve(shader, fragments), fragments.len() as u64);
        self.outcomes.most_surfaces_in_a_pixel = self.outcomes.most_surfaces_in_a_pixel.max(layers);
        self.used[pixel] = 0;
        colour
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

/// The pixel: its fragments front to back, over the background.
pub(super) fn resolve<S: Slot>(shader: &Shader, slots: &mut [S]) -> [f64; 4] {
    slots.sort_by(|a, b| a.fragment().z.total_cmp(&b.fragment().z));
    shader.blend(slots.iter().map(S::fragment))
}

/// The unshaded fragment nearest in z among those nearer than ε; the lowest slot on ties.
pub fn nearest_within(z_threshold: f64, z: f64, fragments: &[Fragment]) -> Option<usize> {
    let (mut least, mut nearest) = (z_threshold, None);
    for (slot, fragment) in fragments.iter().enumerate() {
        let distance = (z - fragment.z).abs();
        if !fragment.shaded && distance < least {
            (least, nearest) = (distance, Some(slot));
        }
    }
    nearest
}

/// The z-buffer: keeps the nearer one.
fn replace<S: Slot>(old: &mut S, new: Fragment) -> Decision {
    if new.z < old.fragment().z {
        *old = S::new(new);
        Decision::Replaced
    } else {
        Decision::Dropped
    }
}

/// Makes room for one fragment: drops a hidden one, or merges two. Leaves the slots in z order; the
/// last is spare.
fn overflow<S: Slot>(
    rules: &Rules,
    pair: fn(&[S]) -> usize,
    shader: &Shader,
    slots: &mut [S],
    new: Fragment,
) -> Decision {
    let deepest = slots.len() - 1;
    slots[deepest] = S::new(new);
    slots[..deepest].sort_by(|a, b| a.fragment().z.total_cmp(&b.fragment().z));
    let place = slots[..deepest].partition_point(|slot| slot.fragment().z <= new.z);
    slots[place..].rotate_right(1);
    let hides = |slot: &S| {
        slot.fragment()
            .is_opaque(rules.opaque, shader.coverage_threshold())
    };
    if rules.evict_hidden && slots[..deepest].iter().any(hides) {
        return Decision::Evicted {
            slot: (place < deepest).then_some(place),
        };
    }
    let slot = pair(slots);
    slots[slot] = S::merge(&slots[slot], &slots[slot + 1], shader);
    slots[slot + 1..].rotate_left(1);
    Decision::Merged { slot, place }
}

/// Which two fragments are merged when a pixel overflows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// The adjacent pair with the smallest difference in z (SS §6).
    NearestPair,
    /// The two deepest.
    FarthestPair,
    /// No merge: the plain z-buffer of one layer, whatever [`Rules::layers`] is (SS §4).
    Replace,
    /// Two fragments in the same window of ε are summed. If there are none, the two deepest are
    /// closed; closed fragments still take late contributions.
    Window,
}

/// Returns the front of the adjacent pair to merge, given fragments in z order.
pub type PairRule = fn(&[Fragment]) -> usize;

impl Merge {
    /// The rule that selects the pair to merge; none for a z-buffer.
    pub fn pair(self) -> Option<PairRule> {
        self.pair_of()
    }

    fn pair_of<S: Slot>(self) -> Option<fn(&[S]) -> usize> {
        match self {
            Merge::NearestPair => Some(nearest_pair),
            Merge::FarthestPair | Merge::Window => Some(farthest_pair),
            Merge::Replace => None,
        }
    }
}

fn farthest_pair<S: Slot>(slots: &[S]) -> usize {
    slots.len().saturating_sub(2)
}

/// The front of the adjacent pair with the smallest difference in z; on ties the one nearer to the
/// eye.
fn nearest_pair<S: Slot>(slots: &[S]) -> usize {
    let gaps = slots
        .windows(2)
        .map(|pair| pair[1].fragment().z - pair[0].fragment().z)
        .enumerate();
    gaps.min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(front, _)| front)
}

#[cfg(test)]
mod tests {
    use super::super::{Group, WindowOptions};
    use super::*;

    const NEAREST: Rules = Rules {
        layers: 3,
        merge: Merge::NearestPair,
        evict_hidden: false,
        turn_normals: true,
        opaque: 0.999,
        fragment_depth: FragmentDepth::First,
        group: Group::First,
        window: WindowOptions {
            join: 0.0,
            late: true,
            inside: true,
        },
        sums_gaussians: false,
        weights_fall_with_depth: false,
        reflection: None,
        lists: None,
        blocks: None,
    };

    /// Grey 0.5, full weight.
    fn at(z: f64, opacity: f64) -> Fragment {
        Fragment {
            weight: 1.0,
            rgb: DVec3::splat(0.5),
            alpha: opacity,
            z,
            ..Fragment::default()
        }
    }

    /// Decisions about these contributions at ε = 1, and the final depths of the slots.
    fn decisions(rules: &Rules, contributions: &[Fragment]) -> (Vec<Decision>, Vec<f64>) {
        let shader = Shader::unlit(0.25);
        let mut golden = FragmentPainter::<Fragment>::new(rules, 1.0, &shader);
        let decisions = contributions
            .iter()
            .map(|contribution| golden.decide(0, *contribution))
            .collect();
        (
            decisions,
            golden
                .fragments(0)
                .iter()
                .map(|fragment| fragment.z)
                .collect(),
        )
    }

    fn last(rules: &Rules, depths: &[f64]) -> (Decision, Vec<f64>) {
        let contributions: Vec<Fragment> = depths.iter().map(|z| at(*z, 0.5)).collect();
        let (decisions, slots) = decisions(rules, &contributions);
        (decisions[decisions.len() - 1], slots)
    }

    #[test]
    fn a_contribution_joins_the_nearest_fragment_and_the_lowest_slot_on_ties() {
        assert_eq!(
            last(&NEAREST, &[10.0, 11.0, 10.75]).0,
            Decision::Accumulated { slot: 1 }
        );
        assert_eq!(
            last(&NEAREST, &[11.0, 10.0, 10.5]).0,
            Decision::Accumulated { slot: 0 }
        );
    }

    #[test]
    fn the_threshold_itself_is_too_far() {
        assert_eq!(
            last(&NEAREST, &[10.0, 11.0]).0,
            Decision::Inserted { slot: 1 }
        );
        assert_eq!(
            last(&NEAREST, &[10.0, 9.0]).0,
            Decision::Inserted { slot: 1 }
        );
    }

    #[test]
    fn a_fragment_keeps_its_first_depth_or_takes_the_nearest() {
        assert_eq!(last(&NEAREST, &[10.0, 9.5]).1, [10.0]);
        let rules = Rules {
            fragment_depth: FragmentDepth::Nearest,
            ..NEAREST
        };
        assert_eq!(last(&rules, &[10.0, 9.5, 10.25]).1, [9.5]);
    }

    #[test]
    fn the_nearest_pair_merges_and_on_ties_the_one_nearer_to_the_eye() {
        let (decision, slots) = last(&NEAREST, &[30.0, 10.0, 22.0, 14.0]);
        assert_eq!(
            (decision, slots),
            (
                Decision::Merged { slot: 0, place: 1 },
                vec![10.0, 22.0, 30.0]
            )
        );
        let (decision, slots) = last(&NEAREST, &[30.0, 10.0, 20.0, 40.0]);
        assert_eq!(
            (decision, slots),
            (
                Decision::Merged { slot: 0, place: 3 },
                vec![10.0, 30.0, 40.0]
            )
        );
    }

    #[test]
    fn the_farthest_pair_merges() {
        let rules = Rules {
            merge: Merge::FarthestPair,
            ..NEAREST
        };
        let (decision, slots) = last(&rules, &[30.0, 10.0, 12.0, 20.0]);
        assert_eq!(
            (decision, slots),
            (
                Decision::Merged { slot: 2, place: 2 },
                vec![10.0, 12.0, 20.0]
            )
        );
    }

    #[test]
    fn the_new_fragment_comes_after_equals_and_a_shaded_one_takes_no_contributions() {
        // 12 and 13 merge at 12; another 12 finds no unshaded fragment, overflows and lands behind
        // the shaded one.
        let (decision, slots) = last(&NEAREST, &[10.0, 12.0, 16.0, 13.0, 12.0]);
        assert_eq!(
            (decision, slots),
            (
                Decision::Merged { slot: 1, place: 2 },
                vec![10.0, 12.0, 16.0]
            )
        );
    }

    #[test]
    fn a_single_layer_merges_with_every_contribution() {
        let rules = Rules {
            layers: 1,
            ..NEAREST
        };
        assert_eq!(
            last(&rules, &[10.0, 5.0]),
            (Decision::Merged { slot: 0, place: 0 }, vec![5.0])
        );
    }

    #[test]
    fn a_merge_is_front_over_back_premultiplied() {
        let shader = Shader::unlit(0.25);
        let mut golden = FragmentPainter::<Fragment>::new(
            &Rules {
                layers: 1,
                ..NEAREST
            },
            1.0,
            &shader,
        );
        golden.decide(0, at(10.0, 0.5));
        golden.decide(0, at(20.0, 1.0));
        let merged = golden.fragments(0)[0];
        // 0.5·0.5 + 0.5·1·(1 − 0.5)
        assert_eq!(
            (merged.rgb, merged.alpha, merged.shaded),
            (DVec3::splat(0.5), 1.0, true)
        );
        golden.decide(
            0,
            Fragment {
                rgb: DVec3::X,
                ..at(5.0, 0.25)
            },
        );
        // 0.25 + 0.75·0.5
        assert_eq!(golden.fragments(0)[0].rgb, DVec3::new(0.625, 0.375, 0.375));
    }

    #[test]
    fn the_deepest_fragment_is_dropped_behind_an_opaque_one() {
        let rules = Rules {
            evict_hidden: true,
            ..NEAREST
        };
        let fragments = [at(10.0, 1.0), at(20.0, 0.5), at(30.0, 0.5)];
        let (decided, slots) = decisions(&rules, &[&fragments[..], &[at(25.0, 0.5)]].concat());
        assert_eq!(
            (decided[3], slots),
            (Decision::Evicted { slot: Some(2) }, vec![10.0, 20.0, 25.0])
        );
        let (decided, slots) = decisions(&rules, &[&fragments[..], &[at(35.0, 0.5)]].concat());
        assert_eq!(
            (decided[3], slots),
            (Decision::Evicted { slot: None }, vec![10.0, 20.0, 30.0])
        );
    }

    #[test]
    fn the_new_fragment_can_hide_others_itself() {
        let rules = Rules {
            evict_hidden: true,
            ..NEAREST
        };
        let (decided, slots) = decisions(
            &rules,
            &[at(10.0, 0.5), at(20.0, 0.5), at(30.0, 0.5), at(15.0, 1.0)],
        );
        assert_eq!(
            (decided[3], slots),
            (Decision::Evicted { slot: Some(1) }, vec![10.0, 15.0, 20.0])
        );
    }

    #[test]
    fn an_opaque_deepest_fragment_hides_nothing() {
        let rules = Rules {
            evict_hidden: true,
            ..NEAREST
        };
        let (decided, _) = decisions(
            &rules,
            &[at(10.0, 0.5), at(20.0, 0.5), at(30.0, 1.0), at(15.0, 0.5)],
        );
        assert_eq!(decided[3], Decision::Merged { slot: 0, place: 1 });
    }

    #[test]
    fn an_opaque_fragment_also_covers() {
        let thin = Fragment {
            weight: 0.2,
            alpha: 0.2,
            ..at(10.0, 1.0)
        };
        assert!(!thin.is_opaque(0.999, 0.25));
        assert!(
            Fragment {
                weight: 0.25,
                alpha: 0.25,
                ..thin
            }
            .is_opaque(0.999, 0.25)
        );
        assert!(
            !at(10.0, 0.9989).is_opaque(0.999, 0.25) && at(10.0, 0.9991).is_opaque(0.999, 0.25)
        );
        assert!(
            Fragment {
                weight: 0.0,
                shaded: true,
                ..at(10.0, 1.0)
            }
            .is_opaque(0.999, 0.25)
        );
    }

    #[test]
    fn replace_keeps_the_nearer_one() {
        let rules = Rules {
            merge: Merge::Replace,
            ..NEAREST
        };
        let (decided, slots) = decisions(
            &rules,
            &[at(10.0, 1.0), at(12.0, 1.0), at(9.5, 1.0), at(8.0, 1.0)],
        );
        let expected = [
            Decision::Inserted { slot: 0 },
            Decision::Dropped,
            Decision::Accumulated { slot: 0 },
            Decision::Replaced,
        ];
        assert_eq!((&decided[..], slots), (&expected[..], vec![8.0]));
    }
}
