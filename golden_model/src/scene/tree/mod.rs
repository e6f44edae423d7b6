//! Tree: a hierarchy of splats, in which each node approximates its descendants from afar (SS §8;
//! Rusinkiewicz and Levoy, *QSplat*, SIGGRAPH 2000).
//!
//! ```text
//! splats ─►[ halving along the longest side, in parallel ]─► nodes, breadth first ─┬─► file (`file`)
//!                                                                                  └─► cut (`cut`): the nodes that a view needs
//! ```
//! Leaves are the unchanged splats. An inner node's splat has the mean position, normal, colour and
//! opacity of the leaves below it, weighted by σ², the area that each represents. Its σ² is the sum
//! of their areas projected along its normal, so that coverage is preserved. If the leaves are
//! farther apart than that, it is the second moment of their kernels in its plane.
//!
//! Laws (tests/tree.rs): `every_leaf_is_in_the_tree_once`,
//! `spheres_and_cones_hold_what_lies_below`, `a_tree_is_the_same_at_any_number_of_threads`,
//! `a_node_from_afar_is_as_bright_as_its_leaves`.

pub mod cut;
pub mod file;

use super::{LEAST_RADIUS, Splat, ply::FARTHEST};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Most children of a node.
pub const MOST_CHILDREN: usize = 64;
/// Smaller sets of splats are split by one thread.
const SHARED_FROM: usize = 8192;
/// Relative margin of spheres, because their radii are rounded.
const MARGIN: f64 = 1e-9;
/// Margin of the cosines of cones.
const CONE_MARGIN: f64 = 1e-9;

/// A node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// The splat that is drawn for it.
    pub splat: Splat,
    /// Radius of a sphere around the splat's position, world units: it contains all discs below,
    /// with radius σ, and its own.
    pub sphere: f64,
    /// The greatest σ of its descendants and itself, world units.
    pub widest: f64,
    /// Cosine of the greatest angle between its normal and that of a descendant, in [−1, 1].
    pub cone: f64,
    /// Steps from the root.
    pub level: u32,
    /// Number of its first child; for a leaf the index of its splat in the input.
    pub first: u32,
    /// Number of its consecutive children; 0 for a leaf.
    pub children: u32,
}

impl Node {
    /// Whether it is a splat of the input.
    pub fn is_leaf(&self) -> bool {
        self.children == 0
    }

    /// Numbers of its children.
    pub fn below(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.children as usize
    }
}

/// A tree of splats: the root first, then level by level; children are consecutive, in the order of
/// their parents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tree {
    nodes: Vec<Node>,
    leaves: usize,
}

impl Tree {
    /// Builds a tree of splats with `children` children per node, 2 to [`MOST_CHILDREN`]. None
    /// without splats.
    pub fn new(splats: &[Splat], children: usize) -> Option<Tree> {
        if splats.is_empty() {
            return None;
        }
        let children = children.clamp(2, MOST_CHILDREN);
        let mut order: Vec<u32> = (0..splats.len() as u32).collect();
        let grown = grown(splats, &mut order, children);
        Some(laid_out(splats, &order, &grown))
    }

    /// All nodes, the root first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        self.leaves
    }

    /// The splats of the input, in their order.
    pub fn splats(&self) -> Vec<Splat> {
        let mut splats = vec![self.nodes[0].splat; self.leaves];
        self.nodes
            .iter()
            .filter(|node| node.is_leaf())
            .for_each(|node| splats[node.first as usize] = node.splat);
        splats
    }

    /// Number of levels, including those of the root and the leaves.
    pub fn levels(&self) -> usize {
        self.nodes.last().map_or(0, |node| node.level as usize + 1)
    }

    /// The most children of a node.
    pub fn most_children(&self) -> usize {
        self.nodes
            .iter()
            .map(|node| node.children as usize)
            .max()
            .unwrap_or(0)
    }
}

/// A node under construction: number of splats of the order below it.
struct Grown {
    splats: usize,
    children: Vec<Grown>,
}

/// Splits splats, and reorders them so that the descendants of a node are consecutive.
fn grown(splats: &[Splat], order: &mut [u32], children: usize) -> Grown {
    let count = order.len();
    if count == 1 {
        return Grown {
            splats: 1,
            children: Vec::new(),
        };
    }
    Grown {
        splats: count,
        children: parts(splats, order, children.min(count), children),
    }
}

/// `count` parts with about the same number of splats each, by halving along the longest side.
fn parts(splats: &[Splat], order: &mut [u32], count: usize, children: usize) -> Vec<Grown> {
    if count == 1 {
        return vec![grown(splats, order, children)];
    }
    let first = count.div_ceil(2);
    let at = (order.len() * first / count).clamp(first, order.len() - (count - first));
    let position = |index: &u32| splats[*index as usize].position;
    let (low, high) = order.iter().map(position).fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(low, high), position| (low.min(position), high.max(position)),
    );
    let side = (high - low).to_array();
    let axis = (1..3).fold(0, |longest, axis| {
        if side[axis] > side[longest] {
            axis
        } else {
            longest
        }
    });
    // Splats at one place are ordered by number: halves do not depend on the input order, and no
    // half is empty.
    order.select_nth_unstable_by(at, |a, b| {
        position(a)[axis]
            .total_cmp(&position(b)[axis])
            .then(a.cmp(b))
    });
    let is_shared = order.len() >= SHARED_FROM;
    let (near, far) = order.split_at_mut(at);
    let split = |half: &mut [u32], count: usize| parts(splats, half, count, children);
    let (mut near, far) = if is_shared {
        rayon::join(|| split(near, first), || split(far, count - first))
    } else {
        (split(near, first), split(far, count - first))
    };
    near.extend(far);
    near
}

/// Numbers nodes level by level, and computes them from the leaves up.
fn laid_out(splats: &[Splat], order: &[u32], root: &Grown) -> Tree {
    // A node's start in the order, its level, and the start of its children.
    let mut queue: Vec<(&Grown, usize, u32, usize)> = vec![(root, 0, 0, 0)];
    let mut nth = 0;
    while nth < queue.len() {
        let (grown, start, level, _) = queue[nth];
        queue[nth].3 = queue.len();
        let mut at = start;
        for child in &grown.children {
            queue.push((child, at, level + 1, 0));
            at += child.splats;
        }
        nth += 1;
    }
    let leaf = Node {
        splat: splats[0],
        sphere: 0.0,
        widest: 0.0,
        cone: 1.0,
        level: 0,
        first: 0,
        children: 0,
    };
    let mut nodes = vec![leaf; queue.len()];
    let mut sums = vec![LeafSums::default(); queue.len()];
    for (nth, (grown, start, level, first)) in queue.iter().enumerate().rev() {
        if grown.children.is_empty() {
            let place = order[*start];
            let splat = splats[place as usize];
            sums[nth] = LeafSums::of(&splat);
            nodes[nth] = Node {
                splat,
                sphere: splat.radius,
                widest: splat.radius,
                cone: 1.0 - CONE_MARGIN,
                level: *level,
                first: place,
                children: 0,
            };
            continue;
        }
        let children = grown.children.len();
        sums[nth] = sums[*first..*first + children]
            .iter()
            .copied()
            .reduce(LeafSums::and)
            .unwrap_or_default();
        let below = order[*start..*start + grown.splats]
            .iter()
            .map(|place| &splats[*place as usize]);
        let widest = nodes[*first..*first + children]
            .iter()
            .map(|node| node.widest)
            .fold(0.0, f64::max);
        let node = inner(&sums[nth], below, widest);
        nodes[nth] = Node {
            level: *level,
            first: *first as u32,
            children: children as u32,
            ..node
        };
    }
    Tree {
        nodes,
        leaves: splats.len(),
    }
}

/// Sums over leaves, each weighted by σ².
#[derive(Clone, Copy, Debug, Default)]
struct LeafSums {
    area: f64,
    mean: DVec3,
    /// Second moments of positions about their mean, times the area.
    moment: DMat3,
    /// Σσ⁴.
    kernels: f64,
    normal: DVec3,
    opacity: f64,
    /// Weighted by opacity, and unweighted.
    rgb: [DVec3; 2],
}

impl LeafSums {
    fn of(splat: &Splat) -> Self {
        let area = splat.radius * splat.radius;
        let rgb = DVec3::from_array(splat.rgb) * area;
        LeafSums {
            area,
            mean: splat.position,
            moment: DMat3::ZERO,
            kernels: area * area,
            normal: splat.normal * area,
            opacity: splat.opacity * area,
            rgb: [rgb * splat.opacity, rgb],
        }
    }

    /// Sums of both, by the parallel axis theorem, which avoids differences of large squares.
    fn and(self, other: LeafSums) -> LeafSums {
        let area = self.area + other.area;
        let part = if area > 0.0 { other.area / area } else { 0.5 };
        let apart = other.mean - self.mean;
        let outer = DMat3::from_cols(apart * apart.x, apart * apart.y, apart * apart.z)
            * (self.area * part);
        LeafSums {
            area,
            mean: self.mean + apart * part,
            moment: self.moment + other.moment + outer,
            kernels: self.kernels + other.kernels,
            normal: self.normal + other.normal,
            opacity: self.opacity + other.opacity,
            rgb: [self.rgb[0] + other.rgb[0], self.rgb[1] + other.rgb[1]],
        }
    }
}

/// A node above these leaves, with `widest` as the greatest σ; its place in the tree is set later.
fn inner<'a>(sums: &LeafSums, below: impl Iterator<Item = &'a Splat> + Clone, widest: f64) -> Node {
    let Some(first) = below.clone().next() else {
        unreachable!("an inner node has leaves below it")
    };
    // If normals cancel, any direction is as good.
    let length = sums.normal.length();
    let normal = if length > 1e-6 * sums.area {
        sums.normal / length
    } else {
        first.normal
    };
    // A mean may round to one ulp beyond the range of its values.
    let (low, high) = (below.clone().map(|splat| splat.position))
        .fold((first.position, first.position), |(low, high), position| {
            (low.min(position), high.max(position))
        });
    let position = sums.mean.clamp(low, high);
    let (mut reach, mut cone, mut facing) = (0.0f64, 1.0f64, 0.0);
    let mut areas: Vec<(u32, f64)> = Vec::new();
    for splat in below {
        let cosine = splat.normal.dot(normal);
        let area = splat.radius * splat.radius;
        reach = reach.max((splat.position - position).length() + splat.radius);
        cone = cone.min(cosine);
        facing += area * cosine.max(0.0);
        match areas
            .iter_mut()
            .find(|(material, _)| *material == splat.material)
        {
            Some((_, sum)) => *sum += area,
            None => areas.push((splat.material, area)),
        }
    }
    // The material with the most area; of equal ones the first in the list.
    areas.sort_unstable_by_key(|(material, _)| *material);
    let material = areas
        .iter()
        .copied()
        .reduce(|most, other| if other.1 > most.1 { other } else { most })
        .map_or(0, |(material, _)| material);
    let trace = sums.moment.x_axis.x + sums.moment.y_axis.y + sums.moment.z_axis.z;
    let in_plane = (trace - normal.dot(sums.moment * normal)).max(0.0) / 2.0;
    let second_moment = (in_plane + sums.kernels) / sums.area;
    // Covering the square of its sphere once is enough: many splats at one place are not larger
    // than one.
    let variance = facing.max(second_moment).min(2.0 * reach * reach);
    let radius = variance.sqrt().clamp(LEAST_RADIUS, FARTHEST);
    let opacity = (sums.opacity / sums.area * (facing / variance).min(1.0)).clamp(0.0, 1.0);
    let rgb = if sums.opacity > 0.0 {
        sums.rgb[0] / sums.opacity
    } else {
        sums.rgb[1] / sums.area
    };
    let rgb = rgb.clamp(DVec3::ZERO, DVec3::ONE).to_array();
    let splat = Splat {
        position,
        normal,
        radius,
        rgb,
        opacity,
        material,
    };
    let sphere = reach.max(radius) * (1.0 + MARGIN);
    Node {
        splat,
        sphere,
        widest: widest.max(radius),
        cone: (cone - CONE_MARGIN).max(-1.0),
        level: 0,
        first: 0,
        children: 0,
    }
}
