//! Detail: the cut of a tree within a budget of a machine, and a report of the cut
//! (docs/book/level-of-detail.md).
//!
//! ```text
//! scene with a tree ─┬─► bytes ÷ bytes/node = nodes ──────────────────────► cut ─► evaluation
//!                    └─► cycles: draw and time a cut, bisect ─┘
//! ```
//! Laws (tests/tree.rs): `a_budget_of_bytes_is_kept_on_every_machine`,
//! `a_budget_of_cycles_is_kept_on_every_machine`.

use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::hardware::quantise::quantise;
use crate::output::text::thousands;
use crate::scene::Scene;
use crate::scene::tree::cut::{Budget, CutLimits, Detail, DetailRules, VisitResult};
use rtl_model::pipeline::Elaborated;
use rtl_model::timing;
use schemars::JsonSchema;
use serde::Serialize;
use std::borrow::Cow;

/// The drawn cut of a tree.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DetailReport {
    /// Splats that the tree was built from.
    pub leaves: u64,
    /// Nodes of the tree, including leaves.
    pub nodes: u64,
    /// Levels of the tree.
    pub levels: u64,
    /// Greatest size of a drawn node that is not a leaf, pixels.
    pub pixels: f64,
    /// Size of the largest such node, pixels; infinite sizes, at the near plane, are reported as
    /// the greatest number.
    pub coarsest_px: f64,
    /// Nodes that were read to find the cut.
    pub read: u64,
    /// Nodes of the cut.
    pub drawn: u64,
    /// Nodes whose normals, and all below them, face away.
    pub away: u64,
    /// Nodes that are outside the picture with all nodes below them.
    pub outside: u64,
    /// Greatest number of nodes on the stack whose children were still to be read.
    pub deepest_stack: u64,
    /// Bytes of a node in memory.
    pub node_bytes: u64,
    /// Bytes of the nodes that were read, each counted once. The bytes on the channel, in whole
    /// bursts, are `splats` of `cycles.memory`.
    pub read_bytes: u64,
}

impl DetailReport {
    /// Figures of a cut, on a machine with `node_bytes` bytes per node.
    pub fn new(detail: &Detail, node_bytes: u32) -> Self {
        let (tree, cut) = (&detail.tree, &detail.cut);
        let found = |found: VisitResult| {
            cut.visits
                .iter()
                .filter(|visit| visit.found == found)
                .count() as u64
        };
        let read = cut.visits.len() as u64;
        DetailReport {
            leaves: tree.leaves() as u64,
            nodes: tree.nodes().len() as u64,
            levels: tree.levels() as u64,
            pixels: detail.rules.pixels,
            coarsest_px: cut.coarsest_px.min(f64::MAX),
            read,
            drawn: found(VisitResult::Drawn),
            away: found(VisitResult::Away),
            outside: found(VisitResult::Outside),
            deepest_stack: cut.deepest as u64,
            node_bytes: node_bytes.into(),
            read_bytes: read * u64::from(node_bytes),
        }
    }

    /// The figures in a sentence.
    pub fn summary(&self) -> String {
        let culled = match [self.away, self.outside] {
            [0, 0] => String::new(),
            [away, outside] => format!(", {} culled", thousands(away + outside)),
        };
        format!(
            "level of detail: {} splats for {}, at most {:.3} px unless a leaf; {} nodes of {} bytes read{culled}, {} on the stack",
            thousands(self.drawn),
            thousands(self.leaves),
            self.pixels.max(self.coarsest_px),
            thousands(self.read),
            self.node_bytes,
            thousands(self.deepest_stack)
        )
    }
}

/// [`within_budget`] that consumes the scene.
///
/// # Errors
/// As [`within_budget`].
pub fn bounded(scene: Scene, machine: &Elaborated) -> Result<Scene> {
    let cut = match within_budget(&scene, machine)? {
        Cow::Owned(cut) => Some(cut),
        Cow::Borrowed(_) => None,
    };
    Ok(cut.unwrap_or(scene))
}

/// The scene with the finest cut within its budgets of bytes and cycles on a machine; unchanged if
/// it has none.
///
/// # Errors
/// [`Error::Input`] if even the root exceeds the budget, or the machine cannot hold the scene.
pub fn within_budget<'a>(scene: &'a Scene, machine: &Elaborated) -> Result<Cow<'a, Scene>> {
    let Some(detail) = &scene.detail else {
        return Ok(Cow::Borrowed(scene));
    };
    let Budget {
        splats,
        bytes,
        cycles,
    } = detail.rules.budget;
    if bytes.or(cycles).is_none() {
        return Ok(Cow::Borrowed(scene));
    }
    // Both budgets become limits of the cut, so that the machine is no longer needed.
    let rules = DetailRules {
        budget: Budget {
            splats,
            ..Budget::default()
        },
        ..detail.rules
    };
    let cut = |limits: CutLimits| {
        let detail = Detail {
            rules,
            ..detail.clone()
        };
        Scene {
            detail: Some(detail),
            ..scene.clone()
        }
        .cut_within(&limits)
    };
    let too_little = |what: &str, takes: u64, has: u64| {
        let sentence = format!(
            "level_of_detail.budget.{what} is {has}, and the coarsest frame of {} takes {takes}",
            scene.name
        );
        Err(Error::input(sentence))
    };
    let nodes = bytes.map(|bytes| bytes / u64::from(machine.timing.node_bytes));
    if let (Some(0), Some(bytes)) = (nodes, bytes) {
        return too_little("bytes", machine.timing.node_bytes.into(), bytes);
    }
    let within = |opened: u64| {
        cut(CutLimits {
            nodes,
            opened: Some(opened),
        })
    };
    let Some(budget) = cycles else {
        return Ok(Cow::Owned(cut(CutLimits {
            nodes,
            opened: None,
        })));
    };
    let taken = |scene: &Scene| -> Result<u64> {
        let quantised = quantise(scene, &machine.machine)?;
        let (_, _, work) = fixed::draw_measured(machine, &quantised);
        Ok(timing::replay(&machine.timing, &work, timing::Detail::Total).total)
    };
    let coarsest = within(0);
    let least = taken(&coarsest)?;
    if least > budget {
        return too_little("cycles", least, budget);
    }
    // Frames are drawn and timed. The last one within the budget is kept, also if cycles do not
    // grow with every node.
    let finest = cut(CutLimits {
        nodes,
        opened: None,
    });
    let opened = finest.detail.as_ref().map_or(0, |detail| {
        detail
            .cut
            .visits
            .iter()
            .filter(|visit| visit.found == VisitResult::Opened)
            .count()
    });
    if taken(&finest)? <= budget {
        return Ok(Cow::Owned(finest));
    }
    let (mut best, mut fits, mut exceeds) = (coarsest, 0, opened as u64);
    while exceeds - fits > 1 {
        let middle = fits + (exceeds - fits) / 2;
        let scene = within(middle);
        if taken(&scene)? <= budget {
            (best, fits) = (scene, middle);
        } else {
            exceeds = middle;
        }
    }
    Ok(Cow::Owned(best))
}
