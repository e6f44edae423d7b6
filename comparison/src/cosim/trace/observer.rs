//! Observer: logs every transfer while the machine draws, in the order of the units; it is sorted
//! afterwards.

use super::coverage::Coverage;
use rtl_model::elaboration::unit;
use rtl_model::frame::Frame;
use rtl_model::num::Fit;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::Kind;
use rtl_model::probe;
use rtl_model::records::{PROJECT_FLAGS, PROJECTED, SET_UP, Weighed};
use rtl_model::units::fragment::{Contribution, Decision, Side, Slot};
use rtl_model::units::resolve::Layer;
use rtl_model::units::shade;
use std::any::Any;

/// Events of a record's words: the bits of `flags` in a key.
pub mod flag {
    use rtl_model::num::Fit;
    use rtl_model::units::fragment::Decision;

    /// A word lost bits below its LSB.
    pub const INEXACT: u8 = 1;
    /// A word saturated at its lower limit.
    pub const SATURATED_LOW: u8 = 2;
    /// A word saturated at its upper limit.
    pub const SATURATED_HIGH: u8 = 4;
    /// A word wrapped.
    pub const WRAPPED: u8 = 8;
    /// The record ends here: a culled splat, a weight of 0 or, for sheets, below the least.
    pub const CUT_OFF: u8 = 16;
    /// The contribution caused two fragments to merge.
    pub const MERGED: u8 = 32;
    /// The contribution caused the eviction of a fragment.
    pub const EVICTED: u8 = 64;

    /// Their names, from the LSB up.
    pub const NAMES: [&str; 7] = [
        "inexact",
        "saturated_low",
        "saturated_high",
        "wrapped",
        "cut_off",
        "merged",
        "evicted",
    ];

    /// Flags of the quantisation of an exact result with `more` fraction bits than elaborated.
    pub fn of(fit: &Fit, exact: i64, more: i64) -> u8 {
        let loss = fit.loss(exact, more);
        let losses = [
            (loss.inexact, INEXACT),
            (loss.saturated_low, SATURATED_LOW),
            (loss.saturated_high, SATURATED_HIGH),
            (loss.wrapped, WRAPPED),
        ];
        losses
            .iter()
            .filter(|(lost, _)| *lost)
            .fold(0, |flags, (_, flag)| flags | flag)
    }

    /// Flags of a decision of `fragment`.
    pub fn of_decision(decision: Decision) -> u8 {
        match decision {
            Decision::Merged(..) | Decision::Summed(..) | Decision::Closed(..) => MERGED,
            Decision::Evicted(_) => EVICTED,
            _ => 0,
        }
    }

    /// Names of the flags that are set.
    pub fn names(flags: u8) -> Vec<&'static str> {
        NAMES
            .into_iter()
            .enumerate()
            .filter(|(bit, _)| flags >> bit & 1 == 1)
            .map(|(_, name)| name)
            .collect()
    }
}

/// The transfers of a splat through `project` and `ellipse`.
#[derive(Clone, Copy, Debug)]
pub struct SetUpTransfer {
    pub splat: u32,
    pub project: [i64; PROJECTED],
    pub ellipse: [i64; SET_UP],
    pub flags: u8,
}

impl SetUpTransfer {
    /// Whether `project` did not cull it.
    pub fn leaves_project(&self) -> bool {
        self.project[..PROJECT_FLAGS] == [0; PROJECT_FLAGS]
    }
}

/// Sort key of a splat at a pixel, in the order of a machine that draws splat after splat, and each
/// box row by row.
pub fn key(splat: u32, x: u32, y: u32) -> u64 {
    u64::from(splat) << 28 | u64::from(y) << 14 | u64::from(x)
}

/// The splat, column and row of a [`key`].
pub fn parts(key: u64) -> [u32; 3] {
    [
        (key >> 28) as u32,
        key as u32 & 0x3fff,
        (key >> 14) as u32 & 0x3fff,
    ]
}

/// No decision: the weight is too small.
pub const NO_OUTCOME: u8 = u8::MAX;

/// The transfers of a fragment from raster to its slot.
#[derive(Clone, Copy, Debug)]
pub struct FragmentTransfer {
    pub key: u64,
    pub radial: i64,
    pub depth: i64,
    pub weight: u32,
    /// Code as in `fragment.out`, or [`NO_OUTCOME`].
    pub outcome: u8,
    pub slot: u8,
    /// Windows only.
    pub place: u8,
    pub gauss_flags: u8,
    pub fragment_flags: u8,
}

/// The transfers of a fragment through shade.
#[derive(Clone, Copy, Debug)]
pub struct Shaded {
    /// Key of the contribution that caused the merge; or of the pixel, with splat 0.
    pub key: u64,
    /// Index among those with this key.
    pub nth: u8,
    pub input: shade::Input,
    pub output: shade::Output,
    pub flags: u8,
}

/// A splat whose colour comes from harmonics.
#[derive(Clone, Copy, Debug)]
pub struct Coloured {
    pub splat: u32,
    pub rgb: [i32; 3],
    pub flags: u8,
}

/// A splat that is lit before it is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    pub splat: u32,
    /// Its transfers through shade.
    pub shaded: Shaded,
    /// Its colour from then on.
    pub rgb: [i32; 3],
    /// Flags of the words of the request to shade, and of the answer.
    pub flags: [u8; 2],
}

/// Fragments that a pixel holds at the end of a frame.
#[derive(Clone, Debug)]
pub struct HeldFragments {
    pub key: u64,
    pub slots: Vec<Slot>,
    /// The light of each slot; for sheets, of all together.
    pub layers: Vec<Layer>,
    pub frame: [i64; 4],
    pub flags: u8,
}

/// All transfers of a frame.
#[derive(Clone, Debug, Default)]
pub struct Observations {
    /// Splats before this one are drawn, but not logged.
    pub first_splat: u32,
    pub set_up: Vec<SetUpTransfer>,
    /// If colours come from harmonics: one per splat that left setup.
    pub coloured: Vec<Coloured>,
    /// If splats are lit before they are drawn: one per splat.
    pub emitted: Vec<Emitted>,
    /// If splats are sorted: for each drawn splat, by its number, its index in drawing order.
    pub order: Vec<u32>,
    /// Flags of raster, by splat and tile.
    pub walked: Vec<(u32, u8)>,
    pub arrivals: Vec<FragmentTransfer>,
    /// Shaded for a merge.
    pub merged: Vec<Shaded>,
    /// Shaded at the end of the frame.
    pub resolved: Vec<Shaded>,
    pub held: Vec<HeldFragments>,
    /// Roundings and limits that occurred.
    pub coverage: Coverage,
    /// Smaller weights make no fragment.
    least_weight: i64,
    /// Reasons for which `project` culls.
    project_cases: &'static [&'static str],
    /// Words of this signal are not used.
    unread: Option<usize>,
    /// Words of this signal cross no port.
    unseen: Option<usize>,
    /// Possible outcomes of a contribution.
    outcomes: &'static [&'static str],
    /// Number of a full pixel's last slot.
    deepest: u8,
    /// Flags since the last transfer.
    observed: u8,
    /// Flags from before the request to shade.
    before_shade: u8,
    /// Splats are being set up.
    setting_up: bool,
    /// Key of the current contribution, and the number of fragments that it has had shaded.
    taking: Option<(u64, u8)>,
    /// Shaded for the pixel that is being resolved, or for the splat that is being set up.
    lit: Vec<Shaded>,
}

impl Observations {
    /// Logs a frame's splats from `first_splat` on.
    pub fn new(machine: &Elaborated, frame: &Frame, first_splat: u32) -> Self {
        Observations {
            first_splat,
            coverage: Coverage::new(machine),
            least_weight: least_weight(frame),
            project_cases: project_cases(frame),
            unread: unread(machine, frame),
            unseen: unseen(machine),
            outcomes: outcomes(Kind::of(frame)),
            deepest: machine.machine.fragment.layers.saturating_sub(1) as u8,
            ..Observations::default()
        }
    }

    /// Maps the splats in keys to these numbers.
    pub fn number(&mut self, numbers: &[u32]) {
        let renumbered = |all: u64| {
            let [splat, x, y] = parts(all);
            key(numbers[splat as usize], x, y)
        };
        self.arrivals
            .iter_mut()
            .for_each(|arrival| arrival.key = renumbered(arrival.key));
        self.merged
            .iter_mut()
            .for_each(|shaded| shaded.key = renumbered(shaded.key));
    }

    /// Sorts everything by splat, pixels row by row.
    pub fn sort(&mut self) {
        use rayon::prelude::*;
        self.arrivals
            .par_sort_unstable_by_key(|arrival| arrival.key);
        self.merged
            .par_sort_unstable_by_key(|shaded| (shaded.key, shaded.nth));
        self.resolved
            .par_sort_unstable_by_key(|shaded| (shaded.key, shaded.nth));
        self.held.par_sort_unstable_by_key(|held| held.key);
        self.walked.sort_unstable();
        self.walked.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.1 |= if same { next.1 } else { 0 };
            same
        });
    }

    /// Counts the decisions of units.
    pub fn decisions(&self, coverage: &mut Coverage) {
        for splat in &self.set_up {
            let [near, outside, transparent, ..] = splat.project;
            let [backface, faint, missing, ..] = splat.ellipse;
            let reasons = [near, outside, transparent]
                .into_iter()
                .zip(self.project_cases);
            reasons.for_each(|(flag, case)| coverage.count_if(flag != 0, "project", case));
            let cases = [
                (backface, "ellipse", "backface"),
                (faint, "ellipse", "faint"),
                (missing, "ellipse", "outside"),
            ];
            cases.into_iter().for_each(|(flag, unit, case)| {
                coverage.count_if(splat.leaves_project() && flag != 0, unit, case)
            });
        }
        for arrival in &self.arrivals {
            coverage.count_if(arrival.weight == 0, "gauss", "weight 0");
            if self.least_weight > 1 {
                let below = (1..self.least_weight).contains(&i64::from(arrival.weight));
                coverage.count_if(below, "gauss", "weight below the least");
            }
            for (number, outcome) in self.outcomes.iter().enumerate() {
                coverage.count_if(usize::from(arrival.outcome) == number, "fragment", outcome);
            }
        }
    }

    /// Whether a weight makes a fragment.
    pub fn counts(&self, weight: u32) -> bool {
        i64::from(weight) >= self.least_weight
    }

    fn flush(&mut self) -> u8 {
        std::mem::take(&mut self.observed)
    }
}

/// The signal whose words are not used, if there is one.
pub fn unread(machine: &Elaborated, frame: &Frame) -> Option<usize> {
    frame
        .sheets
        .as_ref()
        .map(|_| machine.fragment.depth_fit().signal)
}

/// The signal whose words cross no port, if there is one.
pub fn unseen(machine: &Elaborated) -> Option<usize> {
    machine
        .signals
        .iter()
        .position(|signal| signal.unit == unit::FRAGMENT && signal.name == "window.density")
}

/// Reasons for which `project` culls, in the order of their flags.
pub fn project_cases(frame: &Frame) -> &'static [&'static str] {
    &["near", "outside", "transparent"][..if frame.ellipsoids.is_some() { 3 } else { 2 }]
}

/// The least weight of a frame that makes a fragment.
pub fn least_weight(frame: &Frame) -> i64 {
    frame
        .sheets
        .as_ref()
        .map_or(1, |sheets| sheets.least_weight.max(1))
}

/// Outcomes of contributions, in the order of their codes in `fragment.out`: first those that are
/// not specific to windows.
const OUTCOMES: [&str; 12] = [
    "accumulated",
    "inserted",
    "merged",
    "evicted",
    "replaced",
    "dropped",
    "late-front",
    "late-back",
    "inside",
    "summed",
    "closed-behind",
    "closed-inside",
];

/// Outcomes that contributions may have in a frame of this kind.
pub fn outcomes(kind: Kind) -> &'static [&'static str] {
    &OUTCOMES[..if kind.windows { OUTCOMES.len() } else { 6 }]
}

/// A decision as in `fragment.out`: outcome, slot and, for windows, place. `deepest` is the number
/// of a full pixel's last slot.
pub fn outcome(decision: Decision, deepest: u8) -> [u8; 3] {
    match decision {
        Decision::Accumulated(slot) => [0, slot, 0],
        Decision::Inserted(slot) => [1, slot, 0],
        Decision::Merged(front, _) => [2, front, 0],
        Decision::Evicted(itself) => [3, itself.into(), 0],
        Decision::Replaced => [4, 0, 0],
        Decision::Dropped => [5, 0, 0],
        Decision::Late(slot, Side::Front) => [6, slot, 0],
        Decision::Late(slot, Side::Back) => [7, slot, 0],
        Decision::Inside(slot) => [8, slot, 0],
        Decision::Summed(front, place) => [9, front, place],
        Decision::Closed(place, inside) => [10 + u8::from(inside), deepest, place],
    }
}

impl probe::Observer<'static> for Observations {
    fn fork(&self) -> Box<dyn probe::Observer<'static>> {
        Box::new(Observations {
            first_splat: self.first_splat,
            coverage: self.coverage.of_another_part(),
            least_weight: self.least_weight,
            project_cases: self.project_cases,
            unread: self.unread,
            unseen: self.unseen,
            outcomes: self.outcomes,
            deepest: self.deepest,
            ..Observations::default()
        })
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        let Ok(fork) = seen.downcast::<Observations>() else {
            return;
        };
        self.set_up.extend(fork.set_up);
        self.coloured.extend(fork.coloured);
        self.emitted.extend(fork.emitted);
        self.walked.extend(fork.walked);
        self.arrivals.extend(fork.arrivals);
        self.merged.extend(fork.merged);
        self.resolved.extend(fork.resolved);
        self.held.extend(fork.held);
        self.coverage.merge(fork.coverage);
    }

    fn word(&mut self, fit: &Fit, exact: i64, more: i64, _word: i64) {
        if self.unread == Some(fit.signal) {
            return;
        }
        self.coverage.fitted(fit, exact, more);
        if self.unseen == Some(fit.signal) {
            return;
        }
        self.observed |= flag::of(fit, exact, more);
    }

    fn wrapped(&mut self, _signal: usize) {
        self.observed |= flag::WRAPPED;
    }

    fn set_up(&mut self, splat: u32, project: [i64; PROJECTED], ellipse: [i64; SET_UP]) {
        let flags = self.flush();
        self.setting_up = true;
        if splat >= self.first_splat {
            self.set_up.push(SetUpTransfer {
                splat,
                project,
                ellipse,
                flags,
            });
        }
    }

    fn coloured(&mut self, splat: u32, rgb: [i32; 3]) {
        let flags = self.flush();
        if splat >= self.first_splat {
            self.coloured.push(Coloured { splat, rgb, flags });
        }
    }

    fn sorted(&mut self, order: Vec<u32>) {
        // Flags of the sort keys belong to no record.
        self.flush();
        self.order = order;
    }

    fn emitted(&mut self, splat: u32, rgb: [i32; 3]) {
        let after = self.flush();
        let Some(shaded) = self.lit.pop() else { return };
        if splat >= self.first_splat {
            self.emitted.push(Emitted {
                splat,
                shaded,
                rgb,
                flags: [self.before_shade, shaded.flags | after],
            });
        }
    }

    fn walked(&mut self, splat: u32) {
        let flags = self.flush();
        if splat >= self.first_splat {
            self.walked.push((splat, flags));
        }
    }

    fn weighed(&mut self, x: u32, y: u32, weighed: &Weighed) {
        let counts = weighed.weight >= self.least_weight;
        let gauss_flags = self.flush() | if counts { 0 } else { flag::CUT_OFF };
        let key = key(weighed.splat, x, y);
        self.taking = counts.then_some((key, 0));
        if weighed.splat >= self.first_splat {
            let Weighed {
                radial,
                depth,
                weight,
                ..
            } = *weighed;
            let arrival = FragmentTransfer {
                key,
                radial,
                depth,
                weight: weight as u32,
                outcome: NO_OUTCOME,
                slot: 0,
                place: 0,
                gauss_flags,
                fragment_flags: 0,
            };
            self.arrivals.push(arrival);
        }
    }

    fn contribution(&mut self, _x: u32, _y: u32, contribution: &Contribution, decision: Decision) {
        self.taking = None;
        let flags = self.flush();
        if contribution.splat < self.first_splat {
            return;
        }
        if let Some(arrival) = self.arrivals.last_mut() {
            [arrival.outcome, arrival.slot, arrival.place] = outcome(decision, self.deepest);
            arrival.fragment_flags = flags | flag::of_decision(decision);
        }
    }

    fn shade_in(&mut self) {
        self.before_shade = self.flush();
    }

    fn shade_out(&mut self, input: &shade::Input, output: &shade::Output) {
        let flags = self.flush();
        self.observed = if self.setting_up {
            0
        } else {
            self.before_shade
        };
        let (input, output) = (*input, *output);
        match &mut self.taking {
            Some((key, nth)) => {
                if parts(*key)[0] >= self.first_splat {
                    self.merged.push(Shaded {
                        key: *key,
                        nth: *nth,
                        input,
                        output,
                        flags,
                    });
                }
                *nth += 1;
            }
            None => self.lit.push(Shaded {
                key: 0,
                nth: self.lit.len() as u8,
                input,
                output,
                flags,
            }),
        }
    }

    fn holds(&mut self, x: u32, y: u32, slots: &[Slot], layers: &[Layer]) {
        let key = key(0, x, y);
        self.resolved
            .extend(self.lit.drain(..).map(|shaded| Shaded { key, ..shaded }));
        self.held.push(HeldFragments {
            key,
            slots: slots.to_vec(),
            layers: layers.to_vec(),
            frame: [0; 4],
            flags: 0,
        });
    }

    fn resolved(&mut self, _x: u32, _y: u32, _layers: &[Layer], frame: [i64; 4]) {
        let flags = self.flush();
        if let Some(held) = self.held.last_mut() {
            (held.frame, held.flags) = (frame, flags);
        }
    }
}
