//! Cut: what a view draws of a tree, the coarsest nodes that are small enough on the screen, and
//! what a walker reads to find them.
//!
//! ```text
//! root ─► [stack of children, some at a time] ─► each child: faces away, or lies outside? ─► small enough, or a leaf? ─┬─► drawn
//!                       ▲                                                                                                └─► its children, pushed
//!                       └─────────────────────────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//! A node is as large as its sphere's diameter at the sphere's nearest point: `2·R·s/(z − R)`
//! pixels, without end where that is at the near plane or before it. A budget lets the largest node
//! become its children first, of equals the one with the lowest number, and ends before the first
//! that it has no room for. What is culled draws nothing below it, on no machine and in no order.
//!
//! Laws (tests/tree.rs): `a_cut_covers_every_leaf_once`, `smaller_pixels_never_cut_coarser`,
//! `budgets_are_kept_and_used`, `what_is_culled_has_no_contribution`,
//! `at_no_pixels_the_leaves_are_drawn`.

use super::super::{Filter, Scene, View};
use super::{Node, Tree};
use serde::{Deserialize, Serialize};
use std::collections::BinaryHeap;
use std::sync::Arc;

/// Angles of a cone are taken as wider by this part of a turn's sine: words of a machine's normals
/// are rounded.
const CONE_SLACK: f64 = 1.0 / 256.0;
/// Pixels that footprints are taken as wider by.
const SLACK_PX: f64 = 1.0;

/// Order in which a cut is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// As the walk comes to them.
    Walk,
    /// The largest on the screen first, of equals the one with the lowest number.
    CoarseToFine,
}

/// What a frame may take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Budget {
    /// Splats that are drawn.
    pub splats: Option<u64>,
    /// Bytes of nodes that are read, by the machine's words.
    pub bytes: Option<u64>,
    /// Cycles of the frame, on the machine.
    pub cycles: Option<u64>,
}

/// How much of a tree is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rules {
    /// No node that is larger is drawn, unless it is a leaf, pixels.
    pub pixels: f64,
    /// In which order.
    pub order: Order,
    /// Leaves out what lies outside of the picture, and where back faces are culled what faces
    /// away.
    pub culls: bool,
    /// How many nodes' children are asked for at a time, before any of them is looked at; at
    /// least 1.
    pub ahead: usize,
    /// What the frame may take.
    pub budget: Budget,
}

/// What became of a node that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Found {
    /// Too large: its children are read.
    Opened,
    /// It is drawn.
    Drawn,
    /// All below it face away.
    Away,
    /// All below it lie outside of the picture, or before the near plane.
    Outside,
}

/// A node that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Visit {
    /// Its number.
    pub node: u32,
    /// Place of its parent's visit; of the root its own.
    pub parent: u32,
    /// What became of it.
    pub found: Found,
}

/// What a view needs of a tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// Every node that was read, in order.
    pub visits: Vec<Visit>,
    /// Nodes that are drawn, in order.
    pub drawn: Vec<u32>,
    /// Largest node that is drawn and no leaf, pixels; 0 where there is none.
    pub coarsest_px: f64,
    /// Most nodes whose children waited to be read.
    pub deepest: usize,
}

/// A tree, and what is drawn of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detail {
    /// The tree.
    pub tree: Arc<Tree>,
    /// How much of it is drawn.
    pub rules: Rules,
    /// What that is in this view.
    pub cut: Cut,
}

/// Further limits, for who knows what a node takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Nodes that are read.
    pub nodes: Option<u64>,
    /// Nodes that become their children.
    pub opened: Option<u64>,
}

impl Detail {
    /// Of a tree, not cut yet.
    pub fn new(tree: Arc<Tree>, rules: Rules) -> Self {
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
    /// The scene with what its view needs of its tree, if it has one: after the camera or the
    /// picture's size changed.
    #[must_use]
    pub fn cut(self) -> Scene {
        self.cut_within(&Limits::default())
    }

    /// The same within further limits.
    #[must_use]
    pub fn cut_within(mut self, limits: &Limits) -> Scene {
        let Some(mut detail) = self.detail.take() else {
            return self;
        };
        detail.cut = Eye::new(&self, &detail).cut(limits);
        self.splats = detail.splats();
        self.detail = Some(detail);
        self
    }

    /// The scene with every splat and no tree: what a cut stands for.
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
    rules: Rules,
    view: View,
    near: f64,
    culls_backfaces: bool,
    /// Greatest |x/z| and |y/z| of what is drawn.
    guard: [f64; 2],
    root_cutoff: f64,
    low_pass: f64,
    /// What is filtered on its own plane has no bound that is known here.
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

    /// Whether its children are to be drawn instead: it is too large, or would be culled for its
    /// own normal, though those below it look all ways.
    fn is_coarse(&self, node: &Node) -> bool {
        let hides = || {
            self.culls_backfaces
                && node.cone <= 0.0
                && node.splat.normal.dot(node.splat.position - self.view.eye) >= 0.0
        };
        !node.is_leaf() && (self.size_px(node) > self.rules.pixels || hides())
    }

    /// Why nothing below it can be seen.
    fn culled(&self, node: &Node) -> Option<Found> {
        if self.culls_outside && self.is_outside(node) {
            return Some(Found::Outside);
        }
        (self.culls_backfaces && self.is_away(node)).then_some(Found::Away)
    }

    /// Whether every splat with its centre in the sphere, and none wider than the widest, misses
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
        // An ellipse reaches √(cutoff·V) to a side, and no entry of V is more than k²·(1 + a² +
        // b²) + v: the major axis of an EWA footprint.
        let slope = |at: f64, guard: f64| ((at.abs() + node.sphere) / nearest).min(guard);
        let [a, b] = [slope(t.x, self.guard[0]), slope(t.y, self.guard[1])];
        let k = self.view.longest_focal_px() * node.widest / nearest;
        let reach =
            self.root_cutoff * (k * k * (1.0 + a * a + b * b) + self.low_pass).sqrt() + SLACK_PX;
        (0..2).any(|axis| {
            // Planes through the eye along the picture's sides, so far out.
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

    /// Whether every normal of the cone points away from the eye, wherever in the sphere it is.
    fn is_away(&self, node: &Node) -> bool {
        let way = node.splat.position - self.view.eye;
        let distance = way.length();
        if distance <= node.sphere || node.cone <= 0.0 {
            return false;
        }
        // sin(θ + φ), with θ the cone's angle and φ that under which the eye sees the sphere's
        // radius; both are below 90°.
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

    fn cut(&self, limits: &Limits) -> Cut {
        let budget = self.rules.budget;
        let is_bounded = budget.splats.is_some() || *limits != Limits::default();
        let opened = is_bounded.then(|| self.opened(limits));
        let opens = |number: u32, node: &Node| match &opened {
            Some(opened) => opened[number as usize],
            None => self.is_coarse(node),
        };
        let mut visits = Vec::new();
        // Groups of children that are to be read, each with its parent's visit; the root is a group
        // by itself.
        let mut stack = vec![(0u32, 1u32, 0u32)];
        let mut deepest = 0;
        while !stack.is_empty() {
            let popped = stack.split_off(stack.len().saturating_sub(self.rules.ahead.max(1)));
            let (pushed, asked) = (stack.len(), popped.len());
            let below = |(first, count, parent): (u32, u32, u32)| {
                (first..first + count).map(move |number| (number, parent))
            };
            for (number, parent) in popped.into_iter().rev().flat_map(below) {
                let node = &self.nodes[number as usize];
                let found = match self.culled(node) {
                    Some(culled) => culled,
                    None if opens(number, node) => {
                        stack.push((node.first, node.children, visits.len() as u32));
                        Found::Opened
                    }
                    None => Found::Drawn,
                };
                visits.push(Visit {
                    node: number,
                    parent,
                    found,
                });
            }
            // The first child's children come next.
            stack[pushed..].reverse();
            // Those that were asked for keep their places until their children are tested.
            deepest = deepest.max(stack.len() + asked);
        }
        let mut drawn: Vec<u32> = visits
            .iter()
            .filter(|visit| visit.found == Found::Drawn)
            .map(|visit| visit.node)
            .collect();
        let size = |number: &u32| self.size_px(&self.nodes[*number as usize]);
        if self.rules.order == Order::CoarseToFine {
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

    /// Which nodes become their children within the budget, the largest first.
    fn opened(&self, limits: &Limits) -> Vec<bool> {
        let mut opened = vec![false; self.nodes.len()];
        let waits = |number: u32| {
            let node = &self.nodes[number as usize];
            self.is_coarse(node).then(|| Waiting {
                size_px: self.size_px(node),
                number,
            })
        };
        let is_seen = |number: u32| self.culled(&self.nodes[number as usize]).is_none();
        let mut heap: BinaryHeap<Waiting> =
            is_seen(0).then(|| waits(0)).flatten().into_iter().collect();
        let (mut splats, mut read, mut count) = (u64::from(is_seen(0)), 1, 0);
        while let Some(Waiting { number, .. }) = heap.pop() {
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
            heap.extend(seen.into_iter().filter_map(waits));
        }
        opened
    }
}

/// A node that may become its children.
struct Waiting {
    size_px: f64,
    number: u32,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.size_px
            .total_cmp(&other.size_px)
            .then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Waiting {}
