//! Sound: checks that a record from a file can be that of a frame, so that it can be replayed.
//!
//! Laws (tests/recording.rs of the bench): `a_record_that_is_read_is_the_one_that_was_written`,
//! `no_damage_is_taken_for_a_record`.

use super::{CullReason, Event, Footprint, Found, TILE_PX, Tile, Visit, Work};

/// Greatest side of a picture, pixels.
const MOST_PX: u32 = 16_384;

fn require(holds: bool, fault: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(fault.to_owned()) }
}

impl Work {
    /// Checks that the parts of the record are consistent.
    ///
    /// # Errors
    /// The fault, as a part of a sentence.
    pub fn check(&self) -> Result<(), String> {
        let sizes = [self.width, self.height];
        require(
            sizes.iter().all(|size| (1..=MOST_PX).contains(size)),
            "the picture's size is not 1 to 16384",
        )?;
        self.check_lists()?;
        require(self.harmonics <= 3, "its harmonics have a degree above 3")?;
        self.check_splats()?;
        self.check_walk()?;
        let emitted = if self.mirrors && self.preshaded {
            self.footprints.len()
        } else {
            0
        };
        require(
            self.texels.len() == emitted,
            "its splats look up other texels than they can",
        )?;
        let columns = (self.width as usize).div_ceil(TILE_PX);
        let is_after = |pair: &[Tile]| pair[0].place(columns) < pair[1].place(columns);
        let is_inside = |tile: &Tile| {
            (0..2).all(|i| {
                usize::from(tile.corner[i]) % TILE_PX == 0 && u32::from(tile.corner[i]) < sizes[i]
            })
        };
        require(
            self.tiles.iter().all(is_inside) && self.tiles.windows(2).all(is_after),
            "its tiles are misaligned, out of order or outside the picture",
        )?;
        // Counted before lists of them are made: a box of a few bytes can touch a million tiles.
        let entries: u64 = self.footprints.iter().map(Footprint::tiles).sum();
        require(
            self.tiles
                .iter()
                .map(|tile| tile.counts.len() as u64)
                .sum::<u64>()
                == entries,
            "its tiles are not those of its splats",
        )?;
        let lists = self.bins(TILE_PX);
        let mut tiles = self.tiles.iter().peekable();
        for place in (0..lists.tiles()).filter(|place| !lists.of(*place).is_empty()) {
            let tile = tiles
                .next_if(|tile| tile.place(columns) == place)
                .ok_or("a tile that a splat touches is missing")?;
            tile.check(
                lists
                    .of(place)
                    .iter()
                    .map(|nth| &self.footprints[*nth as usize]),
            )?;
            require(
                tile.texels.len() == if self.mirrors { tile.shades() } else { 0 },
                "a tile's fragments look up other texels than they can",
            )?;
        }
        require(
            tiles.next().is_none(),
            "it has a tile that no splat touches",
        )
    }

    /// No list has a splat twice, and new splats are drawn there. The tiles' records show whether a
    /// splat is missing.
    fn check_lists(&self) -> Result<(), String> {
        let Some(lists) = &self.lists else {
            return Ok(());
        };
        let is_tile = lists.tile_px >= TILE_PX as u32
            && lists.tile_px <= MOST_PX
            && lists.tile_px.is_multiple_of(TILE_PX as u32);
        let is_chunk = lists.chunk.is_power_of_two() && (4..=65_536).contains(&lists.chunk);
        require(
            is_tile && is_chunk,
            "its lists have impossible tiles or chunks",
        )?;
        let [columns, rows] =
            [self.width, self.height].map(|size| size.div_ceil(lists.tile_px) as usize);
        require(
            lists.tiles.len() == columns * rows,
            "its lists are not those of its tiles",
        )?;
        for (tile, list) in lists.tiles.iter().enumerate() {
            let mut splats = list.splats.clone();
            splats.sort_unstable();
            let is_known = |splat: &u32| (*splat as usize) < self.cull_reasons.len();
            require(
                splats.windows(2).all(|pair| pair[0] < pair[1]) && splats.iter().all(is_known),
                "a list has a splat twice, or one that is not there",
            )?;
            let is_here = |splat| self.drawn_in(splat, tile, lists.tile_px).is_some();
            let mut new = list.splats.iter().zip(&list.new).filter(|(_, new)| **new);
            require(
                list.new.len() == list.splats.len() && new.all(|(splat, _)| is_here(*splat)),
                "a list has a new splat whose box does not touch its tile",
            )?;
        }
        Ok(())
    }

    fn check_walk(&self) -> Result<(), String> {
        if self.walk.is_empty() {
            return require(
                self.listed.is_empty(),
                "its splats are listed, but it has no walk",
            );
        }
        let is_below = |(nth, visit): (usize, &Visit)| {
            let parent = visit.parent as usize;
            nth == 0 && parent == 0 || parent < nth && self.walk[parent].found == Found::Opened
        };
        require(
            self.walk.iter().enumerate().all(is_below),
            "its walk reads nodes whose parent is not opened",
        )?;
        let drawn = || {
            self.walk
                .iter()
                .filter(|visit| visit.found == Found::Drawn)
                .map(|visit| visit.node)
        };
        require(
            drawn().count() == self.cull_reasons.len(),
            "its walk draws other splats than there are",
        )?;
        let [mut walked, mut listed] = [drawn().collect::<Vec<u32>>(), self.listed.clone()];
        walked.sort_unstable();
        listed.sort_unstable();
        require(
            self.listed.is_empty() || listed == walked,
            "its list has other nodes than its walk",
        )
    }

    fn check_splats(&self) -> Result<(), String> {
        let is_drawn = |footprint: &Footprint| {
            self.cull_reasons.get(footprint.splat as usize) == Some(&CullReason::Drawn)
        };
        let ascends = self
            .footprints
            .windows(2)
            .all(|pair| pair[0].splat < pair[1].splat);
        let drawn = self
            .cull_reasons
            .iter()
            .filter(|cull_reason| **cull_reason == CullReason::Drawn)
            .count();
        require(
            ascends && drawn == self.footprints.len() && self.footprints.iter().all(is_drawn),
            "its boxes are not those of its splats",
        )?;
        let is_inside =
            |[first, last]: [u16; 2], size: u32| first <= last && u32::from(last) < size;
        let all_inside = self
            .footprints
            .iter()
            .all(|f| is_inside(f.columns, self.width) && is_inside(f.rows, self.height));
        require(all_inside, "a box lies outside of the picture")?;
        let mut seen = vec![false; self.order.len()];
        for nth in &self.order {
            if let Some(seen) = seen.get_mut(*nth as usize) {
                *seen = true;
            }
        }
        let is_order = self.order.is_empty()
            || self.order.len() == self.footprints.len() && seen.iter().all(|seen| *seen);
        require(is_order, "its order leaves splats out")?;
        require(
            self.tested.is_empty() || self.tested.len() == self.footprints.len(),
            "its words for tests of tiles are not those of its splats",
        )?;
        let have_keys = self.keys.is_empty() || self.keys.len() == self.order.len();
        require(
            have_keys
                && [false, true].into_iter().any(|farthest_first| {
                    (self.order.windows(2))
                        .all(|pair| self.is_before(pair[0], pair[1], farthest_first))
                }),
            "its order is not that of its keys",
        )
    }

    /// Whether a splat is drawn before another by their keys. Splats with equal keys are in input
    /// order.
    fn is_before(&self, one: u32, other: u32, farthest_first: bool) -> bool {
        let key = |nth: u32| {
            let key = self.keys.get(nth as usize).copied().map(i64::from);
            key.map(|key| (if farthest_first { -key } else { key }, nth))
        };
        self.keys.is_empty() || key(one) < key(other)
    }
}

impl Footprint {
    /// Number of tiles that it touches.
    fn tiles(&self) -> u64 {
        let across = |[first, last]: [u16; 2]| {
            u64::from(last) / TILE_PX as u64 - u64::from(first) / TILE_PX as u64 + 1
        };
        across(self.columns) * across(self.rows)
    }
}

impl Tile {
    /// Its index among the tiles of the picture.
    fn place(&self, columns: usize) -> usize {
        let [column, row] = self.corner.map(|at| usize::from(at) / TILE_PX);
        row * columns + column
    }

    /// Fragments that are shaded: for merges, and in resolve.
    fn shades(&self) -> usize {
        let merged = |(_, event): &(u8, Event)| {
            if let Event::Merged(shades) = event {
                usize::from(*shades)
            } else {
                0
            }
        };
        self.events.iter().map(merged).sum::<usize>()
            + self
                .pixels
                .iter()
                .map(|held| usize::from(held / 16))
                .sum::<usize>()
    }

    /// Whether it contains exactly these splats, in this order.
    fn check<'a>(&self, splats: impl Iterator<Item = &'a Footprint>) -> Result<(), String> {
        require(
            self.pixels.len() == TILE_PX * TILE_PX,
            "a tile does not have 256 pixels",
        )?;
        require(
            self.pixels.iter().all(|held| held / 16 <= held % 16),
            "more fragments are to be shaded than a pixel holds",
        )?;
        let (mut rows, mut events) = (&self.rows[..], &self.events[..]);
        let mut counts = self.counts.iter();
        for splat in splats {
            let [columns, lines] =
                [(splat.columns, 0), (splat.rows, 1)].map(|([first, last], side)| {
                    let corner = self.corner[side];
                    usize::from(first.max(corner) - corner)
                        ..(usize::from(last) - usize::from(corner) + 1).min(TILE_PX)
                });
            let count = counts
                .next()
                .ok_or("a tile does not contain all of its splats")?;
            let (kept, rows_left) = rows
                .split_at_checked(lines.len())
                .ok_or("a tile has fewer rows than its splats")?;
            let (own, events_left) = events
                .split_at_checked(usize::from(*count))
                .ok_or("a tile has fewer contributions than it counts")?;
            (rows, events) = (rows_left, events_left);
            let inside = (1u32 << columns.end) - (1u32 << columns.start);
            require(
                kept.iter().all(|kept| u32::from(*kept) & !inside == 0),
                "a row keeps pixels outside of its box",
            )?;
            // At most once per pixel, and only for kept pixels.
            let mut left: [u16; TILE_PX] =
                std::array::from_fn(|row| kept.get(row).copied().unwrap_or_default());
            let mut is_kept = |(place, event): &(u8, Event)| {
                let (row, bit) = (&mut left[usize::from(place / 16)], 1 << (place % 16));
                std::mem::replace(row, *row & !bit) & bit != 0
                    && !matches!(event, Event::Merged(3..))
            };
            require(
                own.iter().all(&mut is_kept),
                "a contribution is recorded for a pixel that is not kept",
            )?;
        }
        require(
            counts.len() == 0 && rows.is_empty() && events.is_empty(),
            "a tile contains more than its splats",
        )
    }
}
