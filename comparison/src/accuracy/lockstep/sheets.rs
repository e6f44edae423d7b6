//! Sheets: one pixel of `golden` grouped by sheets, led by the machine's decisions, and bounds on
//! the machine's error.
//!
//! Both renderers have the same sheet number per splat. The only decisions that can flip are the
//! order of sorted Gaussians and the contribution at which a pixel stops.

use super::Flips;
use super::pixel::{BoundedContribution, Common};
use crate::golden::shade::over;
use crate::golden::sheets::closed;
use crate::hardware::quantise::Quantised;
use crate::hardware::registers::{Bounded, SheetWords};
use crate::scene::{Scene, Sheet};
use glam::{DVec3, DVec4};
use rtl_model::pipeline::Elaborated;
use rtl_model::real::{Near, Real};
use rtl_model::units::fragment::Decision;

/// Values that the whole frame has in common.
pub struct SheetRules<'a> {
    words: SheetWords<'a, Near>,
    sorted: bool,
}

impl<'a> SheetRules<'a> {
    /// None if fragments are grouped by depth.
    pub fn new(scene: &'a Scene, machine: &Elaborated, quantised: &'a Quantised) -> Option<Self> {
        let frame = quantised.frame.ellipsoids.as_ref();
        Some(SheetRules {
            words: SheetWords::new(&Bounded, scene, machine, quantised)?,
            // Lists that were kept are not sorted: the difference is one of the method.
            sorted: frame.is_some_and(|ellipsoids| ellipsoids.sorted)
                && quantised.frame.lists.is_none(),
        })
    }

    /// Smaller weights make no fragment.
    pub fn least_weight(&self) -> Near {
        self.words.least_weight
    }
}

/// The sheet that is being summed.
#[derive(Clone, Copy, Debug)]
struct OpenSheet {
    weight: f64,
    rgb: DVec3,
    /// Σw and Σw·rgb.
    sums: [Near; 4],
}

/// State of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct SheetPixel {
    open: Option<OpenSheet>,
    golden: DVec4,
    /// The composite's slot.
    composite: [Near; 4],
    /// The machine drops all further contributions.
    stopped: bool,
    /// Depth of the last contribution: exact, and as the sort has it.
    last: Option<(f64, Near)>,
}

impl SheetPixel {
    /// Whether the machine drops all further contributions.
    pub fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Takes a contribution as the machine did; counts decisions that `golden` would take
    /// differently.
    pub fn take(
        &mut self,
        rules: &SheetRules,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        if self.stopped {
            return;
        }
        self.check_order(rules, common, arrival, flips);
        let each = rules.words.sheets.of == Sheet::Splat;
        if let (Decision::Accumulated(_), Some(open)) = (decision, &mut self.open) {
            open.add(common, arrival, arrival.weight);
            return;
        }
        let mut fresh = OpenSheet {
            weight: 0.0,
            rgb: DVec3::ZERO,
            sums: [Near::exact(0.0); 4],
        };
        fresh.add(
            common,
            arrival,
            if each {
                arrival.weight.min(rules.words.most_weight)
            } else {
                arrival.weight
            },
        );
        let done = if each { Some(fresh) } else { self.open.take() };
        let dropped = decision == Decision::Dropped;
        if let Some(done) = done {
            let (golden, composite) = self.blended(rules, common, &done);
            let through = Near::within(1.0 - golden.w, composite[3].around(golden.w).error);
            let stops = !rules.words.back_to_front && through.value < rules.words.sheets.stop;
            // Each contribution is a sheet. If the last one is kept, the machine's stop becomes
            // visible one contribution later.
            if !each || !rules.words.sheets.keeps_last {
                if stops != dropped {
                    flips.eviction(through.may_cross(rules.words.stop));
                }
            } else if dropped {
                self.stopped = true;
                return;
            }
            if !dropped || rules.words.sheets.keeps_last {
                (self.golden, self.composite) = (golden, composite);
            }
        }
        self.stopped = dropped;
        if !each && !dropped {
            self.open = Some(fresh);
        }
    }

    /// Compares the order of this contribution and the one before with golden's.
    fn check_order(
        &mut self,
        rules: &SheetRules,
        common: &Common,
        arrival: &BoundedContribution,
        flips: &mut Flips,
    ) {
        if !rules.sorted {
            return;
        }
        let key = common.machine.real_key(arrival.depth());
        if let Some((z, last)) = self.last
            && if rules.words.back_to_front {
                arrival.golden.z > z
            } else {
                arrival.golden.z < z
            }
        {
            flips.order(key.may_cross(last));
        }
        self.last = Some((arrival.golden.z, key));
    }

    /// The composite after one more sheet.
    fn blended(
        &self,
        rules: &SheetRules,
        common: &Common,
        sheet: &OpenSheet,
    ) -> (DVec4, [Near; 4]) {
        let exact = closed(&rules.words.sheets, sheet.weight, sheet.rgb);
        let [weight, r, g, b] = sheet.sums;
        let near = common.machine.real_close(
            weight,
            [r, g, b],
            &rules.words.registers,
            &rules.words.ratio,
        );
        let near = around(near, exact);
        let before = common.machine.real_read(self.composite);
        let (golden, composite) = if rules.words.back_to_front {
            (
                over(exact, self.golden),
                common.machine.real_merge(near, before),
            )
        } else {
            (
                over(self.golden, exact),
                common.machine.real_merge(before, near),
            )
        };
        (golden, around(composite, golden))
    }

    /// The pixel over the background, and the bound on the machine's.
    pub fn resolve(&self, rules: &SheetRules, common: &Common) -> [Near; 4] {
        let (golden, composite) = match &self.open {
            Some(open) => self.blended(rules, common, open),
            None => (self.golden, self.composite),
        };
        let near = common
            .machine
            .real_resolve(&[common.machine.real_read(composite)], common.background);
        around(
            near,
            over(golden, DVec4::from_array(common.shader.background())),
        )
    }
}

impl OpenSheet {
    fn add(&mut self, common: &Common, arrival: &BoundedContribution, weight: Near) {
        self.weight += arrival.golden.weight;
        self.rgb += arrival.golden.rgb;
        let [r, g, b, ..] = *arrival.attributes;
        for (lane, attribute) in [Near::exact(1.0), r, g, b].into_iter().enumerate() {
            self.sums[lane] =
                common
                    .machine
                    .real_accumulated(lane, self.sums[lane], weight, attribute);
        }
    }
}

fn around(near: [Near; 4], exact: DVec4) -> [Near; 4] {
    [0, 1, 2, 3].map(|i| near[i].around(exact[i]))
}
