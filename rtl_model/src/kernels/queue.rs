//! Queue: fragments between gauss and fragment. The host computes the weights of eight splats,
//! eight fragments at a time, before it accumulates any of them one by one. So each loop keeps its
//! own constants.

use crate::num::{LANES, Words};
use crate::records::TILE_AREA;

/// Most fragments of eight splats in a tile.
const MOST: usize = LANES * TILE_AREA;

/// Fragments in order of arrival.
#[derive(Clone, Debug)]
pub struct Queue {
    len: usize,
    weight: [i32; 2 * MOST + LANES],
    depth: [i32; 2 * MOST + LANES],
    /// 256 times the lane of the splat, plus the pixel.
    place: [i32; 2 * MOST + LANES],
}

/// A fragment in the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Queued {
    /// w (`gauss.weight`).
    pub weight: i32,
    /// z (`fragment.depth`).
    pub depth: i32,
    /// Pixel of the tile: 16 · row + column.
    pub pixel: u8,
    /// Index among the eight splats.
    pub lane: usize,
}

impl Default for Queue {
    fn default() -> Self {
        Queue {
            len: 0,
            weight: [0; 2 * MOST + LANES],
            depth: [0; 2 * MOST + LANES],
            place: [0; 2 * MOST + LANES],
        }
    }
}

impl Queue {
    /// Empties the queue.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Number of fragments.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The fragment at an index.
    #[inline(always)]
    pub fn get(&self, nth: usize) -> Queued {
        let nth = nth % (2 * MOST);
        let [pixel, lane, ..] = self.place[nth].to_le_bytes();
        Queued {
            weight: self.weight[nth],
            depth: self.depth[nth],
            pixel,
            lane: usize::from(lane) % LANES,
        }
    }

    /// Appends those of eight fragments whose bits are set in `which`; the first fragment has the
    /// LSB. Words: weights, depths and 256 · lane + pixel.
    #[inline(always)]
    pub fn push<W: Words>(&mut self, [weight, depth, place]: [W; 3], which: u8) {
        let lanes = W::from_bytes(ONES[usize::from(which)].to_le_bytes());
        // Twice the greatest length, so eight more always have room.
        let to = self.len % (2 * MOST)..self.len % (2 * MOST) + LANES;
        self.weight[to.clone()].copy_from_slice(&weight.pick(lanes).to_array());
        self.depth[to.clone()].copy_from_slice(&depth.pick(lanes).to_array());
        self.place[to].copy_from_slice(&place.pick(lanes).to_array());
        self.len += which.count_ones() as usize;
    }
}

/// The positions of the ones in eight bits, a byte each, the LSB's first.
pub static ONES: [u64; 256] = {
    let mut all = [0; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut place, mut found) = (8, 0);
        while place > 0 {
            place -= 1;
            if bits >> place & 1 == 1 {
                found = found << 8 | place;
            }
        }
        all[bits as usize] = found;
        bits += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::words::PlainWords;

    #[test]
    fn pushed_fragments_keep_their_order_and_dropped_ones_are_absent() {
        let mut queue = Queue::default();
        let mut expected = Vec::new();
        for round in 0..300 {
            let words = |first: i32| std::array::from_fn(|lane| first + lane as i32);
            let (weight, depth, place): ([i32; LANES], [i32; LANES], _) = (
                words(10 * round),
                words(-round),
                words(0x700 + 247 - round % 240),
            );
            let which = (round * 37) as u8;
            queue.push([weight, depth, place].map(PlainWords), which);
            for lane in (0..LANES).filter(|lane| which & 1 << lane != 0) {
                let pixel = (place[lane] & 0xff) as u8;
                expected.push(Queued {
                    weight: weight[lane],
                    depth: depth[lane],
                    pixel,
                    lane: 7,
                });
            }
        }
        assert!(expected.len() > 1000);
        assert_eq!(
            (0..queue.len())
                .map(|nth| queue.get(nth))
                .collect::<Vec<_>>(),
            expected
        );
        queue.clear();
        assert!(queue.is_empty());
    }

    /// The greatest number of fragments of eight splats, and then some that are dropped.
    #[test]
    fn a_full_queue_has_room_for_none_more() {
        let mut queue = Queue::default();
        for round in 0..MOST / LANES {
            queue.push([PlainWords([round as i32; LANES]); 3], u8::MAX);
        }
        queue.push([PlainWords([-1; LANES]); 3], 0);
        assert_eq!(queue.len(), MOST);
        assert!((0..MOST).all(|nth| queue.get(nth).weight == (nth / LANES) as i32));
    }
}
