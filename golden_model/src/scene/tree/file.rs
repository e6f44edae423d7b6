//! File: encodes a tree of splats as bytes, and back (docs/book/level-of-detail.md has the layout).
//!
//! ```text
//! 64 bytes   magic (16), nodes (u64), leaves (u64), SHA-256 of all that follows (32)
//! 128 bytes  each node: position, normal (3 f64 each), σ, rgb (3), α, sphere, widest, cone (f64 each); material, level, first, children (u32 each)
//! ```
//! All numbers are little-endian. A file is checked for everything that a traversal relies on.
//! Children are in the order of their parents, so that no node has two parents and none is below
//! itself. Each leaf's index is used once. Spheres and cones contain their descendants.
//!
//! Laws (tests/tree.rs): `a_tree_that_is_read_is_the_one_that_was_written`,
//! `no_damage_is_taken_for_a_tree`, `a_file_that_lies_is_refused`.

use super::super::{LEAST_RADIUS, Splat, ply::FARTHEST};
use super::{MOST_CHILDREN, Node, Tree};
use glam::DVec3;
use sha2::{Digest, Sha256};

/// Beginning of a tree file.
const MAGIC: &[u8; 16] = b"splatsim-tree-1\n";
/// Bytes before the first node.
const HEADER: usize = 64;
/// Bytes of a node.
const NODE: usize = 128;
/// Most levels: a binary tree of the greatest number of splats has 27.
const MOST_LEVELS: u32 = 64;
/// Tolerance for unit vectors, spheres and cones, because other writers round too.
const OFF: f64 = 1e-6;
const ROUNDED: f64 = 1e-9;

type Parsed<T> = Result<T, String>;

/// Encodes a tree.
pub fn bytes(tree: &Tree) -> Vec<u8> {
    let mut nodes = Vec::with_capacity(NODE * tree.nodes().len());
    for node in tree.nodes() {
        let Splat {
            position,
            normal,
            radius,
            rgb,
            opacity,
            material,
        } = node.splat;
        let vectors = [position.to_array(), normal.to_array()]
            .into_iter()
            .flatten();
        let numbers = vectors.chain([radius]).chain(rgb).chain([
            opacity,
            node.sphere,
            node.widest,
            node.cone,
        ]);
        nodes.extend(numbers.flat_map(f64::to_le_bytes));
        nodes.extend(
            [material, node.level, node.first, node.children]
                .into_iter()
                .flat_map(u32::to_le_bytes),
        );
    }
    let counts = [tree.nodes().len(), tree.leaves()].map(|count| (count as u64).to_le_bytes());
    [
        MAGIC,
        counts.as_flattened(),
        &Sha256::digest(&nodes),
        &nodes,
    ]
    .concat()
}

/// Decodes the bytes of [`bytes()`]. The error is the second half of a sentence that begins with
/// the file's name.
pub fn parse(bytes: &[u8]) -> Parsed<Tree> {
    let rest = bytes
        .strip_prefix(MAGIC)
        .ok_or("is not a tree of splats, as `splatsim tree` writes them")?;
    let damaged = |what: String| format!("is damaged: {what}");
    if bytes.len() < HEADER {
        return Err(damaged(format!(
            "it has {} bytes, fewer than the {HEADER} of its header",
            bytes.len()
        )));
    }
    let (header, records) = rest.split_at(HEADER - MAGIC.len());
    let [count, leaves] =
        [0, 8].map(|at| u64::from_le_bytes(std::array::from_fn(|i| header[at + i])));
    if count.checked_mul(NODE as u64) != Some(records.len() as u64)
        || count == 0
        || count > u64::from(u32::MAX)
    {
        return Err(damaged(format!(
            "its header declares {count} nodes of {NODE} bytes, and {} bytes follow",
            records.len()
        )));
    }
    if Sha256::digest(records)[..] != header[16..] {
        return Err(damaged("its digest differs".into()));
    }
    let nodes: Vec<Node> = records.chunks_exact(NODE).map(node).collect();
    check(&nodes, leaves).map_err(damaged)?;
    Ok(Tree {
        nodes,
        leaves: leaves as usize,
    })
}

fn node(record: &[u8]) -> Node {
    let number = |nth: usize| f64::from_le_bytes(std::array::from_fn(|i| record[8 * nth + i]));
    let count = |nth: usize| u32::from_le_bytes(std::array::from_fn(|i| record[112 + 4 * nth + i]));
    let vector = |nth: usize| DVec3::new(number(nth), number(nth + 1), number(nth + 2));
    let splat = Splat {
        position: vector(0),
        normal: vector(3),
        radius: number(6),
        rgb: vector(7).to_array(),
        opacity: number(10),
        material: count(0),
    };
    Node {
        splat,
        sphere: number(11),
        widest: number(12),
        cone: number(13),
        level: count(1),
        first: count(2),
        children: count(3),
    }
}

/// Checks what a traversal relies on.
fn check(nodes: &[Node], leaves: u64) -> Parsed<()> {
    let is = |holds: bool, number: usize, what: &str| {
        if holds {
            Ok(())
        } else {
            Err(format!("node {number} {what}"))
        }
    };
    let mut next = 1;
    let mut parents = vec![0u32; nodes.len()];
    let mut taken = vec![false; nodes.len()];
    let mut found = 0;
    for (number, node) in nodes.iter().enumerate() {
        check_numbers(node).map_err(|what| format!("node {number} {what}"))?;
        is(
            number > 0 || node.level == 0,
            number,
            "is the root, and its level is not 0",
        )?;
        is(number == 0 || number < next, number, "has no parent")?;
        is(node.level < MOST_LEVELS, number, "is deeper than any tree")?;
        if node.is_leaf() {
            let is_free = taken
                .get_mut(node.first as usize)
                .is_some_and(|taken| !std::mem::replace(taken, true));
            is(
                u64::from(node.first) < leaves && is_free,
                number,
                "is a leaf with a duplicate or invalid index",
            )?;
            found += 1;
            continue;
        }
        let children = node.children as usize;
        is(
            (2..=MOST_CHILDREN).contains(&children),
            number,
            "has one child, or more than 64",
        )?;
        is(
            node.first as usize == next && children <= nodes.len() - next,
            number,
            "has children that are not the next nodes",
        )?;
        for child in node.below() {
            is(
                nodes[child].level == node.level + 1,
                child,
                "is not one level below its parent",
            )?;
            is(
                nodes[child].widest <= node.widest,
                number,
                "has a wider splat below it than it declares",
            )?;
            parents[child] = number as u32;
        }
        next += children;
    }
    is(
        found == leaves,
        0,
        "has another number of leaves below it than the header declares",
    )?;
    for (number, leaf) in nodes.iter().enumerate().filter(|(_, node)| node.is_leaf()) {
        let mut above = number;
        while above > 0 {
            above = parents[above] as usize;
            let Node {
                splat,
                sphere,
                cone,
                ..
            } = &nodes[above];
            let reach = (leaf.splat.position - splat.position).length() + leaf.splat.radius;
            is(
                reach <= sphere * (1.0 + ROUNDED),
                above,
                "has a splat below it outside its sphere",
            )?;
            is(
                leaf.splat.normal.dot(splat.normal) >= cone - ROUNDED,
                above,
                "has a normal below it outside its cone",
            )?;
        }
    }
    // Inner nodes are culled like their descendants.
    for (number, inner) in nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
        let mut above = number;
        while above > 0 {
            above = parents[above] as usize;
            let Node {
                splat,
                sphere,
                cone,
                ..
            } = &nodes[above];
            let reach = (inner.splat.position - splat.position).length();
            is(
                reach <= sphere * (1.0 + ROUNDED),
                above,
                "has a node below it outside its sphere",
            )?;
            let is_within = *cone <= 0.0 || inner.splat.normal.dot(splat.normal) >= cone - ROUNDED;
            is(
                is_within,
                above,
                "has a node below it whose normal is outside its cone",
            )?;
        }
    }
    Ok(())
}

/// Checks the ranges of a node's numbers; comparisons with NaN are false.
fn check_numbers(node: &Node) -> Parsed<()> {
    let Splat {
        position,
        normal,
        radius,
        rgb,
        opacity,
        ..
    } = node.splat;
    let is = |holds: bool, what: &str| if holds { Ok(()) } else { Err(what.to_owned()) };
    is(
        position.is_finite() && position.abs().max_element() <= FARTHEST,
        "has a position that is NaN, or beyond 1e30",
    )?;
    is(
        (normal.length() - 1.0).abs() <= OFF,
        "has a normal that is not a unit vector",
    )?;
    is(
        (LEAST_RADIUS..=FARTHEST).contains(&radius),
        "has a radius outside of 1e-30 to 1e30",
    )?;
    is(
        rgb.iter()
            .chain([&opacity])
            .all(|value| (0.0..=1.0).contains(value)),
        "has a colour or an opacity outside of [0, 1]",
    )?;
    let reaches = [node.sphere, node.widest];
    is(
        reaches
            .iter()
            .all(|reach| *reach >= radius && *reach <= 8.0 * FARTHEST),
        "is wider than its sphere, or than its widest splat",
    )?;
    is(
        (-1.0..=1.0).contains(&node.cone),
        "has a cone whose cosine is outside of [−1, 1]",
    )
}
