//! Detail: what a machine makes of a budget, and what was drawn of a tree
//! (docs/book/level-of-detail.md).
//!
//! ```text
//! scene with a tree ─┬─► bytes ÷ bytes a node = nodes ──────────────────────► cut ─► evaluation
//!                    └─► cycles: a frame of a cut ─► too many? fewer, else more, by halving
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

/// What was drawn of a tree.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DetailReport {
    /// Splats that the tree was built of.
    pub leaves: u64,
    /// Nodes of the tree, leaves among them.
    pub nodes: u64,
    /// Levels of the tree.
    pub levels: u64,
    /// Limit of a drawn node's size that is no leaf, pixels.
    pub pixels: f64,
    /// Size of the largest such node, pixels; infinite ones, at the near plane, are told as the
    /// greatest number.
    pub coarsest_px: f64,
    /// Nodes that were read to find what is drawn.
    pub read: u64,
    /// Those among them that are drawn.
    pub drawn: u64,
    /// Those whose normals, and all below them, face away.
    pub away: u64,
    /// Those that, with all below them, lie outside of the picture.
    pub outside: u64,
    /// Most nodes that waited on the stack for their children to be read.
    pub deepest_stack: u64,
    /// Bytes of a node in memory.
    pub node_bytes: u64,
    /// Bytes of the nodes that were read, once each; what came over the channel, in whole bursts,
    /// is `cycles.memory`'s `splats`.
    pub read_bytes: u64,
}

impl DetailReport {
    /// Of a cut, on a machine with nodes of so many bytes.
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

    /// In a sentence.
    pub fn summary(&self) -> String {
        let culled = match [self.away, self.outside] {
            [0, 0] => String::new(),
            [away, outside] => format!(", {} culled", thousands(away + outside)),
        };
        format!(
            "level of detail: {} splats for {}, none above {:.3} px that has finer ones; {} nodes of {} bytes read{culled}, {} on the stack",
            thousands(self.drawn),
            thousands(self.leaves),
            self.pixels.max(self.coarsest_px),
            thousands(self.read),
            self.node_bytes,
            thousands(self.deepest_stack)
        )
    }
}

/// [`within_budget`] of a scene that nobody else needs.
///
/// # Errors
/// As there.
pub fn bounded(scene: Scene, machine: &Elaborated) -> Result<Scene> {
    let cut = match within_budget(&scene, machine)? {
        Cow::Owned(cut) => Some(cut),
        Cow::Borrowed(_) => None,
    };
    Ok(cut.unwrap_or(scene))
}

/// The scene with the finest cut that its budgets of bytes and cycles leave room for on a machine;
/// as it is where it has none.
///
/// # Errors
/// [`Error::Input`] where not even the root has room, or the machine cannot hold the scene.
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
    // Both become limits of the cut: nobody has to know the machine any more.
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
    // Frames are drawn and timed; the last that has room is kept, whether or not cycles grow with
    // every node.
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
