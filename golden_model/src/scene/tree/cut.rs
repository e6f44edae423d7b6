//! Cut: selects the coarsest nodes of a tree that are small enough on the screen, and the nodes
//! that the traversal unit reads to find them.
//!
//! ```text
//! root ─► [stack of children, some at a time] ─► each child: faces away, or is outside? ─► small enough, or a leaf? ─┬─► drawn
//!                       ▲                                                                                            └─► its children, pushed
//!                       └───────────────────────────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//! The size of a node is the diameter of its sphere at the sphere's nearest point: `2·R·s/(z − R)`
//! pixels, infinite if that is at or in front of the near plane. A budget replaces the largest node
//! by its children first (of equal ones that with the lowest number), and stops at the first for
//! which there is no room. Descendants of a culled node are drawn by no machine and in no order.
//!
//! Laws (tests/tree.rs): `a_cut_covers_every_leaf_once`, `smaller_pixels_never_cut_coarser`,
//! `budgets_are_kept_and_used`, `what_is_culled_has_no_contribution`,
//! `at_no_pixels_the_leaves_are_drawn`.

use super::super::{Filter, Scene, View};
use super::{Node, Tree};
use serde::{Deserialize, Serialize};
use std::collections::BinaryHeap;
use std::sync::Arc;

/// Cones are widened by this sine, because a machine's normals are rounded.
const CONE_SLACK: f64 = 1.0 / 256.0;
/// Margin of footprints, pixels.
const SLACK_PX: f64 = 1.0;

/// Order in which a cut is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DrawOrder {
    /// In the order of the traversal.
    Walk,
    /// The largest on the screen first, of equal ones that with the lowest number.
    CoarseToFine,
}

/// Limits per frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Budget {
    /// Splats that are drawn.
    pub splats: Option<u64>,
    /// Bytes of nodes that are read, in the machine's formats.
    pub bytes: Option<u64>,
    /// Cycles of the frame, on the machine.
    pub cycles: Option<u64>,
}

/// Selection from a tree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetailRules {
    /// Larger nodes are not drawn, except leaves, pixels.
    pub pixels: f64,
    /// Order of drawing.
    pub order: DrawOrder,
    /// Leaves out nodes outside the picture and, if back faces are culled, those that face away.
    pub culls: bool,
    /// Number of nodes whose children are requested before any of them is tested; at least 1.
    pub ahead: usize,
    /// Limits per frame.
    pub budget: Budget,
}

/// Result for a node that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum VisitResult {
    /// Too large: its children are read.
    Opened,
    /// It is drawn.
    Drawn,
    /// All its descendants face away.
    Away,
    /// All its descendants are outside the picture, or in front of the near plane.
    Outside,
}

/// A node that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Visit {
    /// Its number.
    pub node: u32,
    /// Index of its parent's visit; for the root its own.
    pub parent: u32,
    /// Result.
    pub found: VisitResult,
}

/// Nodes of a tree that a view needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// Every node that was read, in order.
    pub visits: Vec<Visit>,
    /// Nodes that are drawn, in order.
    pub drawn: Vec<u32>,
    /// Largest node that is drawn and not a leaf, pixels; 0 if there is none.
    pub coarsest_px: f64,
    /// Most nodes whose children were pending.
    pub deepest: usize,
}

/// A tree, and the part that is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detail {
    /// The tree.
    pub tree: Arc<Tree>,
    /// Selection rules.
    pub rules: DetailRules,
    /// The cut for this view.
    pub cut: Cut,
}

/// Further limits, if the cost of a node is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CutLimits {
    /// Nodes that are read.
    pub nodes: Option<u64>,
    /// Nodes that are replaced by their children.
    pub opened: Option<u64>,
}

impl Detail {
    /// A tree without a cut.
    pub fn new(tree: Arc<Tree>, rules: DetailRules) -> Self {
        Detail {
            tree,
            rules,
            cut: Cut {
                visits: Vec::new(),
                drawn: Vec::new(),
                coarsest_px: 0.0,
                deepest: 0,
            },
        }
    }

    /// Splats of the cut.
    pub fn splats(&self) -> Vec<super::Splat> {
        self.cut
            .drawn
            .iter()
            .map(|node| self.tree.nodes()[*node as usize].splat)
            .collect()
    }
}

impl Scene {
    /// Recomputes the cut of the scene's tree, if it has one: after the camera or the picture's
    /// size changed.
    #[must_use]
    pub fn cut(self) -> Scene {
        self.cut_within(&CutLimits::default())
    }

    /// Recomputes the cut within further limits.
    #[must_use]
    pub fn cut_within(mut self, limits: &CutLimits) -> Scene {
        let Some(mut detail) = self.detail.take() else {
            return self;
        };
        detail.cut = Eye::new(&self, &detail).cut(limits);
        self.splats = detail.splats();
        self.detail = Some(detail);
        self
    }

    /// The scene with all splats and no tree: what a cut approximates.
    #[must_use]
    pub fn full(&self) -> Option<Scene> {
        let detail = self.detail.as_ref()?;
        Some(Scene {
            splats: detail.tree.splats(),
            detail: None,
            ..self.clone()
        })
    }
}

/// A view of a tree.
struct Eye<'a> {
    nodes: &'a [Node],
    rules: DetailRules,
    view: View,
    near: f64,
    culls_backfaces: bool,
    /// Greatest |x/z| and |y/z| of drawn splats.
    guard: [f64; 2],
    root_cutoff: f64,
    low_pass: f64,
    /// False for filters on the splat's plane: no bound of their footprint is known here.
    culls_outside: bool,
}

impl<'a> Eye<'a> {
    fn new(scene: &Scene, detail: &'a Detail) -> Self {
        let view = scene.view();
        Eye {
            nodes: detail.tree.nodes(),
            rules: detail.rules,
            near: scene.camera.near,
            culls_backfaces: detail.rules.culls && scene.surface.cull_backfaces,
            guard: [0, 1].map(|axis| view.slope(axis, scene.kernel.guard)),
            root_cutoff: scene.kernel.cutoff.sqrt(),
            low_pass: scene.kernel.low_pass,
            culls_outside: detail.rules.culls && scene.kernel.filter != Filter::SourceEwa,
            view,
        }
    }

    /// Diameter of its sphere, pixels.
    fn size_px(&self, node: &Node) -> f64 {
        let nearest = (self.view.rotation * (node.splat.position - self.view.eye)).z - node.sphere;
        if nearest > self.near {
            2.0 * node.sphere * self.view.longest_focal_px() / nearest
        } else {
            f64::INFINITY
        }
    }

    /// Whether its children are drawn instead: it is too large, or would be culled by its own
    /// normal although some descendants face the eye.
    fn is_coarse(&self, node: &Node) -> bool {
        let hides = || {
            self.culls_backfaces
                && node.cone <= 0.0
                && node.splat.normal.dot(node.splat.position - self.view.eye) >= 0.0
        };
        !node.is_leaf() && (self.size_px(node) > self.rules.pixels || hides())
    }

    /// Reason for which all its descendants are culled.
    fn culled(&self, node: &Node) -> Option<VisitResult> {
        if self.culls_outside && self.is_outside(node) {
            return Some(VisitResult::Outside);
        }
        (self.culls_backfaces && self.is_away(node)).then_some(VisitResult::Away)
    }

    /// Whether every splat with its centre in the sphere, and at most the widest radius, is outside
    /// the picture.
    fn is_outside(&self, node: &Node) -> bool {
        let t = self.view.rotation * (node.splat.position - self.view.eye);
        if t.z + node.sphere <= self.near {
            return true;
        }
        let nearest = t.z - node.sphere;
        if nearest <= self.near {
            return false;
        }
        // An ellipse extends by √(cutoff·V), and every entry of V is at most k²·(1 + a² + b²) + v:
        // the major axis of an EWA footprint.
        let slope = |at: f64, guard: f64| ((at.abs() + node.sphere) / nearest).min(guard);
        let [a, b] = [slope(t.x, self.guard[0]), slope(t.y, self.guard[1])];
        let k = self.view.longest_focal_px() * node.widest / nearest;
        let reach =
            self.root_cutoff * (k * k * (1.0 + a * a + b * b) + self.low_pass).sqrt() + SLACK_PX;
        (0..2).any(|axis| {
            // Planes through the eye along the picture's sides, moved out by the footprint.
            let (focal, centre) = (self.view.focal_px[axis], self.view.centre_px[axis]);
            [
                (-1.0, centre),
                (1.0, 2.0 * self.view.half_px[axis] - centre),
            ]
            .into_iter()
            .any(|(towards, side)| {
                let side = side + reach;
                focal * towards * t[axis] - side * t.z > node.sphere * focal.hypot(side)
            })
        })
    }

    /// Whether every normal of the cone points away from the eye, for every position in the sphere.
    fn is_away(&self, node: &Node) -> bool {
        let way = node.splat.position - self.view.eye;
        let distance = way.length();
        if distance <= node.sphere || node.cone <= 0.0 {
            return false;
        }
        // sin(θ + φ), with θ the cone's angle and φ the angle of the sphere's radius seen from the
        // eye; both are below 90°.
        let (cos_cone, sin_sphere) = (node.cone, node.sphere / distance);
        let (sin_cone, cos_sphere) = (
            (1.0 - cos_cone * cos_cone).max(0.0).sqrt(),
            (1.0 - sin_sphere * sin_sphere).sqrt(),
        );
        let is_acute = cos_cone * cos_sphere - sin_cone * sin_sphere > 0.0;
        is_acute
            && node.splat.normal.dot(way) / distance
                > sin_cone * cos_sphere + cos_cone * sin_sphere + CONE_SLACK
    }

    fn cut(&self, limits: &CutLimits) -> Cut {
        let budget = self.rules.budget;
        let is_bounded = budget.splats.is_some() || *limits != CutLimits::default();
        let opened = is_bounded.then(|| self.opened(limits));
        let opens = |number: u32, node: &Node| match &opened {
            Some(opened) => opened[number as usize],
            None => self.is_coarse(node),
        };
        let mut visits = Vec::new();
        // Groups of children to read, each with its parent's visit; the root is its own group.
        let mut stack = vec![(0u32, 1u32, 0u32)];
        let mut deepest = 0;
        while !stack.is_empty() {
            let popped = stack.split_off(stack.len().saturating_sub(self.rules.ahead.max(1)));
            let (pushed, requested) = (stack.len(), popped.len());
            let below = |(first, count, parent): (u32, u32, u32)| {
                (first..first + count).map(move |number| (number, parent))
            };
            for (number, parent) in popped.into_iter().rev().flat_map(below) {
                let node = &self.nodes[number as usize];
                let found = match self.culled(node) {
                    Some(culled) => culled,
                    None if opens(number, node) => {
                        stack.push((node.first, node.children, visits.len() as u32));
                        VisitResult::Opened
                    }
                    None => VisitResult::Drawn,
                };
                visits.push(Visit {
                    node: number,
                    parent,
                    found,
                });
            }
            // The first child's children come next.
            stack[pushed..].reverse();
            // Requested groups occupy the stack until their children are tested.
            deepest = deepest.max(stack.len() + requested);
        }
        let mut drawn: Vec<u32> = visits
            .iter()
            .filter(|visit| visit.found == VisitResult::Drawn)
            .map(|visit| visit.node)
            .collect();
        let size = |number: &u32| self.size_px(&self.nodes[*number as usize]);
        if self.rules.order == DrawOrder::CoarseToFine {
            let mut sized: Vec<(f64, u32)> =
                drawn.iter().map(|number| (size(number), *number)).collect();
            sized.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            drawn = sized.into_iter().map(|(_, number)| number).collect();
        }
        let inner = drawn
            .iter()
            .filter(|number| !self.nodes[**number as usize].is_leaf());
        let coarsest_px = inner.map(size).fold(0.0, f64::max);
        Cut {
            visits,
            drawn,
            coarsest_px,
            deepest,
        }
    }

    /// The nodes that are replaced by their children within the budget, the largest first.
    fn opened(&self, limits: &CutLimits) -> Vec<bool> {
        let mut opened = vec![false; self.nodes.len()];
        let pending = |number: u32| {
            let node = &self.nodes[number as usize];
            self.is_coarse(node).then(|| PendingNode {
                size_px: self.size_px(node),
                number,
            })
        };
        let is_seen = |number: u32| self.culled(&self.nodes[number as usize]).is_none();
        let mut heap: BinaryHeap<PendingNode> = is_seen(0)
            .then(|| pending(0))
            .flatten()
            .into_iter()
            .collect();
        let (mut splats, mut read, mut count) = (u64::from(is_seen(0)), 1, 0);
        while let Some(PendingNode { number, .. }) = heap.pop() {
            let node = &self.nodes[number as usize];
            let seen: Vec<u32> = (node.first..node.first + node.children)
                .filter(|child| is_seen(*child))
                .collect();
            splats = splats + seen.len() as u64 - 1;
            read += u64::from(node.children);
            count += 1;
            let has_room =
                |limit: Option<u64>, takes: u64| limit.is_none_or(|limit| takes <= limit);
            let has_all = has_room(self.rules.budget.splats, splats)
                && has_room(limits.nodes, read)
                && has_room(limits.opened, count);
            if !has_all {
                break;
            }
            opened[number as usize] = true;
            heap.extend(seen.into_iter().filter_map(pending));
        }
        opened
    }
}

/// A node that may be replaced by its children.
struct PendingNode {
    size_px: f64,
    number: u32,
}

impl Ord for PendingNode {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.size_px
            .total_cmp(&other.size_px)
            .then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for PendingNode {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for PendingNode {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for PendingNode {}
