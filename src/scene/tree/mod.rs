//! Tree: a hierarchy of splats, each drawn from afar like all below it (SS §8; Rusinkiewicz and
//! Levoy, *QSplat*, SIGGRAPH 2000).
//!
//! ```text
//! splats ─►[ halves along the longest side, several at a time ]─► nodes, breadth first ─┬─► file (`file`)
//!                                                                                      └─► cut (`cut`): what a view needs of them
//! ```
//! Leaves are the splats as they are. An inner node's splat has of the leaves below it, weighted by
//! σ², the area that each stands for: the mean position, normal, colour and opacity; and as σ²
//! their areas' sum, as far as they face the way that it does, so that coverage stays what it was,
//! or the second moment of their kernels in its plane where they lie farther apart than that.
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
/// Fewer splats are split by one thread.
const SHARED_FROM: usize = 8192;
/// Spheres are larger by this part than what they hold: their radii are rounded.
const MARGIN: f64 = 1e-9;
/// Cosines of cones are less by this than those of what they hold.
const CONE_MARGIN: f64 = 1e-9;

/// A node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// What is drawn of it.
    pub splat: Splat,
    /// Radius of a sphere around the splat's position, world units: it holds all discs below, of
    /// one σ, and its own.
    pub sphere: f64,
    /// The greatest σ below, its own among them, world units.
    pub widest: f64,
    /// Cosine of the greatest angle between its normal and one below, in [−1, 1].
    pub cone: f64,
    /// Steps from the root.
    pub level: u32,
    /// Number of its first child; of a leaf its place among the splats that the tree was built of.
    pub first: u32,
    /// How many children it has, one after the other; none of a leaf.
    pub children: u32,
}

impl Node {
    /// Whether it is a splat that the tree was built of.
    pub fn is_leaf(&self) -> bool {
        self.children == 0
    }

    /// Numbers of its children.
    pub fn below(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.children as usize
    }
}

/// A tree of splats: the root first, then level by level; children of one node follow each other,
/// in the order of their parents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tree {
    nodes: Vec<Node>,
    leaves: usize,
}

impl Tree {
    /// Builds a tree of splats with so many children a node, 2 to [`MOST_CHILDREN`]. None of no
    /// splats.
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

    /// How many of them are leaves.
    pub fn leaves(&self) -> usize {
        self.leaves
    }

    /// The splats that it was built of, in their order.
    pub fn splats(&self) -> Vec<Splat> {
        let mut splats = vec![self.nodes[0].splat; self.leaves];
        self.nodes
            .iter()
            .filter(|node| node.is_leaf())
            .for_each(|node| splats[node.first as usize] = node.splat);
        splats
    }

    /// Levels, the root's and the leaves' among them.
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

/// A node while the tree grows: how many splats of the order lie below it.
struct Grown {
    splats: usize,
    children: Vec<Grown>,
}

/// Splits splats, and reorders them so that those below a node follow each other.
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

/// So many parts of about as many splats each, by halving along the longest side.
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
    // Those at one place go by their number: halves are the same in whatever order they come, and
    // no half is empty.
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

/// Numbers nodes level by level, and fills them from the leaves up.
fn laid_out(splats: &[Splat], order: &[u32], root: &Grown) -> Tree {
    // A node's place in the order, its level, and where its children begin.
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
    let mut sums = vec![Sums::default(); queue.len()];
    for (nth, (grown, start, level, first)) in queue.iter().enumerate().rev() {
        if grown.children.is_empty() {
            let place = order[*start];
            let splat = splats[place as usize];
            sums[nth] = Sums::of(&splat);
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
            .reduce(Sums::and)
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
struct Sums {
    area: f64,
    mean: DVec3,
    /// Of positions about their mean, times the area.
    moment: DMat3,
    /// Σσ⁴.
    kernels: f64,
    normal: DVec3,
    opacity: f64,
    /// Weighted by opacity too, and not.
    rgb: [DVec3; 2],
}

impl Sums {
    fn of(splat: &Splat) -> Self {
        let area = splat.radius * splat.radius;
        let rgb = DVec3::from_array(splat.rgb) * area;
        Sums {
            area,
            mean: splat.position,
            moment: DMat3::ZERO,
            kernels: area * area,
            normal: splat.normal * area,
            opacity: splat.opacity * area,
            rgb: [rgb * splat.opacity, rgb],
        }
    }

    /// Of both, by the parallel axis theorem: no difference of large squares.
    fn and(self, other: Sums) -> Sums {
        let area = self.area + other.area;
        let part = if area > 0.0 { other.area / area } else { 0.5 };
        let apart = other.mean - self.mean;
        let outer = DMat3::from_cols(apart * apart.x, apart * apart.y, apart * apart.z)
            * (self.area * part);
        Sums {
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

/// A node above these leaves, of which the widest splat below has that σ; its place in the tree is
/// not known yet.
fn inner<'a>(sums: &Sums, below: impl Iterator<Item = &'a Splat> + Clone, widest: f64) -> Node {
    let Some(first) = below.clone().next() else {
        unreachable!("an inner node has leaves below it")
    };
    // Where normals cancel out, none is better than another.
    let length = sums.normal.length();
    let normal = if length > 1e-6 * sums.area {
        sums.normal / length
    } else {
        first.normal
    };
    // A mean may round to a last place beyond what it is of.
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
    // That of most of the area; of equals the first in the list.
    areas.sort_unstable_by_key(|(material, _)| *material);
    let material = areas
        .iter()
        .copied()
        .reduce(|most, other| if other.1 > most.1 { other } else { most })
        .map_or(0, |(material, _)| material);
    let trace = sums.moment.x_axis.x + sums.moment.y_axis.y + sums.moment.z_axis.z;
    let in_plane = (trace - normal.dot(sums.moment * normal)).max(0.0) / 2.0;
    let second_moment = (in_plane + sums.kernels) / sums.area;
    // What covers its sphere's square once covers enough: splats at one place are no larger for
    // being many.
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
