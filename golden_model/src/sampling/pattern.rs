//! Pattern: chooses the positions of points, stratified or as blue noise.
//!
//! - Stratified: the surface's area is divided into as many equal parts as there are points, with
//!   one point at a random position in each.
//! - Blue noise: darts are thrown, and a dart too close to an earlier one is removed (Cook 1986,
//!   *Stochastic sampling in computer graphics*). When few find room, the distance shrinks (McCool
//!   and Fiume 1992, *Hierarchical Poisson disk sampling distributions*), until the requested
//!   number is reached. Faces with opposite orientation are two sides, with no distance between
//!   their points.

use super::surface::{Site, Surface};
use crate::scene::digest::mixed;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Square of the first distance, in areas per point. An endless sequence of darts converges to
/// 0.6965 of it (jamming of discs, a coverage of 0.547).
const FIRST: f64 = 0.68;
/// Rounds with one dart per point before the distance shrinks; afterwards it shrinks after each
/// round.
const BEFORE_SHRINKING: usize = 4;
/// Factor of the distance per step: 70 steps halve its square.
const SHRUNK: f64 = 0.995;
/// Rounds after which all darts are accepted: surfaces with a hundred thousand coincident layers
/// would not terminate.
const MOST_ROUNDS: usize = 2000;

/// Pseudorandom numbers: SplitMix64, as the words of a counter.
struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    fn new(seed: u64) -> Self {
        SplitMix64 { state: mixed(seed) }
    }

    /// In [0, 1), on 2⁻⁵³.
    fn next(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        unit(self.state)
    }
}

fn unit(state: u64) -> f64 {
    (mixed(state) >> 11) as f64 / (1u64 << 53) as f64
}

/// One point in each of `count` parts of equal area.
pub(super) fn stratified(surface: &Surface, count: usize, seed: u64) -> Vec<Site> {
    let start = mixed(seed);
    let jitter =
        |i: usize| unit(start.wrapping_add((i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    (0..count)
        .into_par_iter()
        .map(|i| surface.at(((i as f64 + jitter(i)) / count as f64).min(1.0 - f64::EPSILON)))
        .collect()
}

/// The requested number of points, and the least distance between any two on one side.
///
/// In each round every stratum gets a dart, in sequence from a random stratum on. Neighbours in
/// memory are neighbours on the surface, which reduces the time for a million points to seconds.
pub(super) fn blue_noise(surface: &Surface, count: usize, seed: u64) -> (Vec<Site>, f64) {
    let mut random = SplitMix64::new(seed);
    let mut distance = (FIRST * surface.area() / count as f64).sqrt();
    let mut board = Board::new(distance);
    let mut sites: Vec<Site> = Vec::with_capacity(count);
    let mut round = 0;
    while sites.len() < count {
        let is_late = round >= MOST_ROUNDS;
        let first = (random.next() * count as f64) as usize;
        for i in (first..count).chain(0..first) {
            let site =
                surface.at(((i as f64 + random.next()) / count as f64).min(1.0 - f64::EPSILON));
            let (position, face) = (surface.position(&site), surface.face(&site));
            if is_late || board.is_free(position, face, distance) {
                sites.push(site);
                board.add(position, face);
                if sites.len() == count {
                    break;
                }
            }
        }
        round += 1;
        if round >= BEFORE_SHRINKING && sites.len() < count {
            distance *= SHRUNK;
            if distance < board.reach / 2.0 {
                board = Board::new(distance);
                sites
                    .iter()
                    .for_each(|site| board.add(surface.position(site), surface.face(site)));
            }
        }
    }
    (sites, if round > MOST_ROUNDS { 0.0 } else { distance })
}

/// Points in cubes twice as wide as their reach. Each point is entered in all cubes that its reach
/// touches, so that a look-up reads only one cube.
struct Board {
    reach: f64,
    last_of_cube: HashMap<[i64; 3], u32, BuildHasherDefault<Mixing>>,
    entries: Vec<BoardEntry>,
}

struct BoardEntry {
    position: DVec3,
    face: DVec3,
    before: u32,
}

const NONE: u32 = u32::MAX;

impl Board {
    fn new(reach: f64) -> Self {
        Board {
            reach,
            last_of_cube: HashMap::default(),
            entries: Vec::new(),
        }
    }

    fn cube(&self, position: DVec3) -> [i64; 3] {
        (position / (2.0 * self.reach))
            .floor()
            .to_array()
            .map(|c| c as i64)
    }

    fn is_free(&self, position: DVec3, face: DVec3, distance: f64) -> bool {
        let mut at = *self.last_of_cube.get(&self.cube(position)).unwrap_or(&NONE);
        while at != NONE {
            let entry = &self.entries[at as usize];
            if entry.position.distance_squared(position) < distance * distance
                && entry.face.dot(face) > 0.0
            {
                return false;
            }
            at = entry.before;
        }
        true
    }

    fn add(&mut self, position: DVec3, face: DVec3) {
        let (low, high) = (
            self.cube(position - self.reach),
            self.cube(position + self.reach),
        );
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let number = self.entries.len() as u32;
                    let before = self.last_of_cube.insert([x, y, z], number).unwrap_or(NONE);
                    self.entries.push(BoardEntry {
                        position,
                        face,
                        before,
                    });
                }
            }
        }
    }
}

/// A hash of three integers; the standard hash takes as long as everything else together.
#[derive(Default)]
struct Mixing(u64);

impl Hasher for Mixing {
    fn finish(&self) -> u64 {
        mixed(self.0)
    }

    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let mut low_first = [0; 8];
            low_first[..word.len()].copy_from_slice(word);
            self.write_u64(u64::from_le_bytes(low_first));
        }
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(21) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }
}
