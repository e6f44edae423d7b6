//! Work: a compact record of the events of a frame, which timing replays.
//!
//! ```text
//!                    ┌─ reasons cull reason of each splat                    1 byte per splat
//! frame ─► Recorder ─┼─ boxes   boxes of the drawn splats                    12 bytes per splat
//!                    └─ tiles   kept pixels of each row                       2 bytes per row
//!                               decisions on their contributions              2 bytes per splat, 3 for each but additions
//!                               final contents of each pixel                  1 byte per pixel
//! ```
//! The simulator draws and records tiles of 16×16 pixels. Within a tile, splats are in input order.
//! The result of a pixel depends only on the order of its contributions, so every organisation of a
//! machine visits the same tiles in its own order.
//!
//! Laws: `the_record_equals_the_drawing`, `a_record_is_the_same_for_any_number_of_threads`.

pub mod lists;
mod sound;

pub use lists::{MergedList, MergedLists};

use lists::touches;

use serde::{Deserialize, Serialize};

/// Side of a recorded tile, pixels.
pub const TILE_PX: usize = 16;

/// Cull reason of a splat, or `Drawn`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CullReason {
    /// Not culled: it has a box.
    Drawn,
    /// At or in front of the near plane: culled in `project`.
    Near,
    /// Outside the guard band: culled in `project`.
    Outside,
    /// Faces away: culled in `ellipse`, like the next two.
    Backface,
    /// Amplitude too small to be visible.
    Faint,
    /// The box is outside the picture.
    Missing,
    /// Opacity too low for any of its weights to count: culled in `project`.
    Transparent,
}

impl CullReason {
    /// Whether the splat goes on from `project` to `ellipse`.
    pub fn leaves_project(self) -> bool {
        !matches!(
            self,
            CullReason::Near | CullReason::Outside | CullReason::Transparent
        )
    }
}

/// Decision on a node of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Found {
    /// Its children are read.
    Opened,
    /// It is drawn.
    Drawn,
    /// All splats below it face away.
    Away,
    /// All splats below it are outside the picture.
    Outside,
}

/// A visited node of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Visit {
    /// Its index, which gives its address in memory.
    pub node: u32,
    /// Index of its parent's visit, which is earlier; for the first visit, its own index.
    pub parent: u32,
    /// Decision on the node.
    pub found: Found,
}

/// Decision on a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// Added to a fragment.
    Accumulated,
    /// Its weight rounds to 0: it is dropped in `gauss`.
    Faint,
    /// Inserted into a free slot.
    Inserted,
    /// Two fragments merged, of which this number, 0 to 2, had to be shaded first. With windows: it
    /// was also blended, or two slots were added.
    Merged(u8),
    /// The deepest fragment was dropped.
    Evicted,
    /// Replaced a fragment, or was dropped behind it.
    Replaced,
    /// Its pixel stopped. Later contributions to this pixel are recorded as added, and change
    /// nothing.
    Stopped,
    /// Its pixel stopped because the previous sheet was blended when this contribution began
    /// another: it takes as long as a merge.
    MergedAndStopped,
}

impl Event {
    /// Whether the pixel accepts no further contributions.
    pub fn stops(self) -> bool {
        matches!(self, Event::Stopped | Event::MergedAndStopped)
    }
}

/// Box of a drawn splat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Footprint {
    /// Its index in the input.
    pub splat: u32,
    /// First and last column of its box.
    pub columns: [u16; 2],
    /// First and last row.
    pub rows: [u16; 2],
}

/// Words of a drawn splat that a test of tiles uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TestedWords {
    /// Position from the picture's middle (`project.pixel`).
    pub pixel: [i32; 2],
    /// Q00, Q01, Q11 (`ellipse.conic`, `ellipse.conic_cross`).
    pub conic: [i32; 3],
}

impl Footprint {
    /// Columns and rows.
    pub fn sides(&self) -> [[u16; 2]; 2] {
        [self.columns, self.rows]
    }
}

/// Record of a tile.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tile {
    /// Its first pixel.
    pub corner: [u16; 2],
    /// Splat by splat, row by row of its box in the tile: a bit per kept column, the first column
    /// of the tile in the LSB.
    rows: Vec<u16>,
    /// Splat by splat, the number of its events.
    counts: Vec<u16>,
    /// Contributions that were not simply added: 16 times the row of the box in the tile plus the
    /// tile's column, and the decision.
    events: Vec<(u8, Event)>,
    /// Final fragments per pixel, plus 16 times the number of them that are not shaded yet.
    pixels: Vec<u8>,
    /// In a frame with surroundings, the texel of each shaded fragment: for merges, event by event,
    /// then pixel by pixel.
    texels: Vec<u16>,
    /// On a machine that tests blocks, splat by splat, which blocks of the tile are kept: a bit
    /// each, by rows, the first in the LSB; else empty.
    #[serde(skip)]
    masks: Vec<u16>,
}

/// Instead of an index among the drawn splats: the splat has departed from the list.
pub const DEPARTED: u32 = u32::MAX;

/// Has no pixel in the list's tile.
const DEPARTED_FOOTPRINT: Footprint = Footprint {
    splat: u32::MAX,
    columns: [0; 2],
    rows: [0; 2],
};

/// Instead of a texel: no look-up.
pub const NO_TEXEL: u16 = u16::MAX;

impl Tile {
    /// Final fragments of a pixel, counted by rows, and the number of them that are not shaded yet.
    pub fn pixel(&self, pixel: usize) -> [u8; 2] {
        [self.pixels[pixel] % 16, self.pixels[pixel] / 16]
    }

    fn bytes(&self) -> usize {
        2 * (self.rows.len() + self.counts.len() + self.texels.len() + self.masks.len())
            + size_of::<(u8, Event)>() * self.events.len()
            + self.pixels.len()
    }

    /// Kept blocks of each splat.
    pub fn masks(&self) -> &[u16] {
        &self.masks
    }

    /// A reader at the start of the record.
    pub fn reader(&self) -> Reader<'_> {
        Reader {
            rows: &self.rows,
            counts: &self.counts,
            events: &self.events,
            texels: &self.texels,
        }
    }

    /// Texels of the fragments that are shaded in resolve, pixel by pixel.
    pub fn texels_of_pixels(&self) -> &[u16] {
        let left: usize = self
            .pixels
            .iter()
            .map(|pixel| usize::from(pixel / 16))
            .sum();
        &self.texels[self.texels.len().saturating_sub(left)..]
    }
}

/// Reads a tile, splat by splat.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rows: &'a [u16],
    counts: &'a [u16],
    events: &'a [(u8, Event)],
    texels: &'a [u16],
}

impl<'a> Reader<'a> {
    /// Texels of the fragments that were shaded for the next events; empty if the frame has no
    /// surroundings.
    pub fn texels(&mut self, events: &[(u8, Event)]) -> &'a [u16] {
        let shades = |(_, event): &(u8, Event)| {
            if let Event::Merged(shades) = event {
                usize::from(*shades)
            } else {
                0
            }
        };
        let (texels, left) = self
            .texels
            .split_at_checked(events.iter().map(shades).sum())
            .unwrap_or_default();
        self.texels = left;
        texels
    }

    /// Rows of the remaining splats.
    #[inline(always)]
    pub fn rows(&self) -> &'a [u16] {
        self.rows
    }

    /// The next splat, of `rows` rows: the kept columns of each row; and its events, each with 16
    /// times the row plus the column.
    #[inline(always)]
    pub fn splat(&mut self, rows: usize) -> (&'a [u16], &'a [(u8, Event)]) {
        let ([count, counts @ ..], Some((rows, rows_left))) =
            (self.counts, self.rows.split_at_checked(rows))
        else {
            return (&[], &[]);
        };
        let (events, events_left) = self.events.split_at(usize::from(*count));
        (self.rows, self.counts, self.events) = (rows_left, counts, events_left);
        (rows, events)
    }
}

/// Record of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Cull reason of each splat, in input order.
    pub cull_reasons: Vec<CullReason>,
    /// The drawn splats, in input order.
    pub footprints: Vec<Footprint>,
    /// Drawing order: indices among the drawn splats; empty for input order.
    pub order: Vec<u32>,
    /// Key of each drawn splat, in input order, on a machine that distributes lists to buckets by
    /// it; else empty.
    #[serde(skip)]
    pub keys: Vec<u32>,
    /// On a machine that keeps lists from frame to frame: the lists of the frame, each with an
    /// order of its own; `order` is then that of the depths.
    #[serde(skip)]
    pub lists: Option<MergedLists>,
    /// Words of each drawn splat, in input order, on a machine that tests tiles; else empty.
    #[serde(skip)]
    pub tested: Vec<TestedWords>,
    /// The cutoff (`raster.cutoff`) on such a machine; else 0.
    #[serde(skip)]
    pub cutoff: i64,
    /// Every drawn splat is lit before it is drawn.
    pub preshaded: bool,
    /// All splats have the axes in the registers.
    pub shared_axes: bool,
    /// Degree of the spherical harmonics of the colours, 0 to 3; 0 if records have colours.
    pub harmonics: u8,
    /// Every tile that a box touches, by rows.
    pub tiles: Vec<Tile>,
    /// Nodes of a tree that were read to find the splats; empty if the splats are consecutive in
    /// memory.
    pub walk: Vec<Visit>,
    /// Number of nodes whose children are requested at the same time.
    pub ahead: u32,
    /// Drawn nodes in drawing order; empty if they are drawn in the order of the walk.
    pub listed: Vec<u32>,
    /// The frame has surroundings, which the machine reflects.
    pub mirrors: bool,
    /// In such a frame, if splats are lit before they are drawn, the texel of each drawn splat: row
    /// and column of the map, a byte each.
    pub texels: Vec<u16>,
}

impl Work {
    /// Kept blocks of the splats of each tile, tile by tile; empty if blocks were not tested.
    pub fn masks(&self) -> Vec<u16> {
        let masks = self.tiles.iter().flat_map(|tile| &tile.masks);
        masks.copied().collect()
    }

    /// Takes the masks of a record that was read.
    ///
    /// # Errors
    /// The fault, as a part of a sentence.
    pub fn take_masks(&mut self, masks: &[u16]) -> Result<(), String> {
        let mut left = masks;
        for tile in &mut self.tiles {
            let (own, rest) = left
                .split_at_checked(tile.counts.len())
                .ok_or("its masks are not those of its tiles")?;
            (tile.masks, left) = (own.to_vec(), rest);
        }
        if left.is_empty() {
            Ok(())
        } else {
            Err("its masks are not those of its tiles".into())
        }
    }

    /// Whether blocks were tested when the record was made.
    pub fn has_masks(&self) -> bool {
        self.footprints.is_empty() || self.tiles.iter().any(|tile| !tile.masks.is_empty())
    }

    /// The drawn splats by tiles with this side: their indices in [`Work::footprints`].
    pub fn bins(&self, side_px: usize) -> Bins {
        if let Some(lists) = &self.lists {
            let drawn = |splat| {
                let nth = self.drawn(splat)?;
                Some((nth, self.footprints[nth as usize].sides()))
            };
            return lists.bins([self.width, self.height], side_px, drawn);
        }
        let input = 0..if self.order.is_empty() {
            self.footprints.len() as u32
        } else {
            0
        };
        let drawn = self.order.iter().copied().chain(input);
        Bins::new(
            [self.width, self.height],
            side_px,
            drawn.map(|nth| (nth, self.footprints[nth as usize].sides())),
        )
    }

    /// Kept lists with all entries: indices among the drawn splats, and [`DEPARTED`] for those that
    /// have departed from the list.
    pub fn kept_bins(&self) -> Option<Bins> {
        let lists = self.lists.as_ref()?;
        let [columns, rows] =
            [self.width, self.height].map(|size| size.div_ceil(lists.tile_px) as usize);
        let (mut starts, mut entries) = (vec![0], Vec::new());
        for (tile, list) in lists.tiles.iter().enumerate().take(columns * rows) {
            entries.extend(list.splats.iter().map(|splat| {
                self.drawn_in(*splat, tile, lists.tile_px)
                    .unwrap_or(DEPARTED)
            }));
            starts.push(entries.len());
        }
        starts.resize(columns * rows + 1, entries.len());
        Some(Bins {
            columns,
            rows,
            starts,
            entries,
        })
    }

    /// The index of a splat among the drawn ones, if its box touches a tile with this side.
    fn drawn_in(&self, splat: u32, tile: usize, tile_px: u32) -> Option<u32> {
        let columns = self.width.div_ceil(tile_px) as usize;
        self.drawn(splat).filter(|nth| {
            let sides = self.footprints[*nth as usize].sides();
            touches(sides, tile, tile_px, columns)
        })
    }

    /// The index of a splat among the drawn ones; none if it was culled.
    pub fn drawn(&self, splat: u32) -> Option<u32> {
        let found = (self.footprints).binary_search_by_key(&splat, |footprint| footprint.splat);
        found.ok().map(|nth| nth as u32)
    }

    /// Whether the machine sorts the splats.
    pub fn is_sorted(&self) -> bool {
        !self.order.is_empty() || self.lists.is_some()
    }

    /// Copies the footprints at these indices to consecutive memory, because the host would stall
    /// on each of the scattered ones.
    pub fn look_up(&self, places: &[u32], footprints: &mut Vec<Footprint>) {
        footprints.clear();
        let of = |nth: &u32| self.footprints.get(*nth as usize).copied();
        footprints.extend(
            places
                .iter()
                .map(|nth| of(nth).unwrap_or(DEPARTED_FOOTPRINT)),
        );
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        self.cull_reasons.len()
            + 4 * (self.order.len() + self.keys.len())
            + size_of::<TestedWords>() * self.tested.len()
            + self.lists.as_ref().map_or(0, |lists| {
                let of = |list: &MergedList| 5 * list.splats.len();
                lists.tiles.iter().map(of).sum::<usize>()
            })
            + size_of::<Footprint>() * self.footprints.len()
            + self.tiles.iter().map(Tile::bytes).sum::<usize>()
            + size_of::<Visit>() * self.walk.len()
            + 4 * self.listed.len()
            + 2 * self.texels.len()
    }

    /// Greatest number of places that the walk takes on the walker's stack; 0 if there is no walk.
    /// Nodes keep their places until their children are tested.
    pub fn deepest_stack(&self) -> u64 {
        let mut groups = self
            .walk
            .chunk_by(|one, next| one.parent == next.parent && one.node != 0)
            .peekable();
        let (mut stack, mut deepest) = (u64::from(groups.peek().is_some()), 0);
        while groups.peek().is_some() {
            let requested = stack.clamp(1, self.ahead.max(1).into());
            let read = groups.by_ref().take(requested as usize).flatten();
            let pushed = read.filter(|visit| visit.found == Found::Opened).count() as u64;
            stack = stack.saturating_sub(requested) + pushed;
            deepest = deepest.max(stack + requested);
        }
        deepest
    }

    /// Final contents of each pixel, row by row: fragments, and the number of them that are not
    /// shaded yet.
    pub fn held(&self) -> Vec<[u8; 2]> {
        let [width, height] = [self.width, self.height].map(|size| size as usize);
        let mut held = vec![[0; 2]; width * height];
        for tile in &self.tiles {
            let [x, y] = tile.corner.map(usize::from);
            for row in 0..TILE_PX.min(height - y) {
                let first = (y + row) * width + x;
                for (column, held) in held[first..first + TILE_PX.min(width - x)]
                    .iter_mut()
                    .enumerate()
                {
                    *held = tile.pixel(row * TILE_PX + column);
                }
            }
        }
        held
    }

    /// Texels of the fragments that are shaded in resolve, pixel by pixel, tile by tile; and the
    /// index of each pixel's first one, by rows of the picture.
    pub fn texels_of_pixels(&self) -> (Vec<u16>, Vec<u32>) {
        let [width, height] = [self.width, self.height].map(|size| size as usize);
        let (mut texels, mut first) = (Vec::new(), vec![0; width * height]);
        for tile in &self.tiles {
            let [x, y] = tile.corner.map(usize::from);
            let mut next = texels.len() as u32;
            for pixel in 0..TILE_PX * TILE_PX {
                let [column, row] = [x + pixel % TILE_PX, y + pixel / TILE_PX];
                if column < width && row < height {
                    first[row * width + column] = next;
                }
                next += u32::from(tile.pixel(pixel)[1]);
            }
            texels.extend(tile.texels_of_pixels());
        }
        (texels, first)
    }

    /// Whether a pixel stops before its last contribution.
    pub fn stops(&self) -> bool {
        self.tiles
            .iter()
            .any(|tile| tile.events.iter().any(|(_, event)| event.stops()))
    }

    /// Rows of the boxes of all drawn splats.
    pub fn rows(&self) -> u64 {
        self.footprints
            .iter()
            .map(|footprint| u64::from(footprint.rows[1] - footprint.rows[0]) + 1)
            .sum()
    }
}

/// Records a tile.
#[derive(Clone, Debug, Default)]
struct TileRecorder {
    rows: Vec<u16>,
    counts: Vec<u16>,
    events: Vec<(u8, Event)>,
    pixels: Vec<u8>,
    /// The current span: its contributions, and the number of them that are done.
    places: Vec<u8>,
    recorded: usize,
    shaded: u8,
    /// Texels of fragments; also of splats that are lit before they are drawn, in the recorder of
    /// their setup.
    texels: Vec<u16>,
    masks: Vec<u16>,
}

/// Records the work of a frame, or of a part of it.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// Drawn splats, and culled ones.
    footprints: Vec<Footprint>,
    culled: Vec<(u32, CullReason)>,
    order: Vec<u32>,
    keys: Vec<u32>,
    lists: Option<MergedLists>,
    tested: Vec<TestedWords>,
    cutoff: i64,
    preshaded: bool,
    shared_axes: bool,
    harmonics: u8,
    mirrors: bool,
    tiles: Vec<Tile>,
    now: TileRecorder,
}

/// Cull reasons, in the order of the lanes of [`Recorder::culled`].
pub const CULLED: [CullReason; 6] = [
    CullReason::Near,
    CullReason::Outside,
    CullReason::Transparent,
    CullReason::Backface,
    CullReason::Faint,
    CullReason::Missing,
];

impl Recorder {
    /// Record of a frame.
    pub fn work(self, width: u32, height: u32) -> Work {
        let Recorder {
            footprints,
            culled,
            order,
            keys,
            lists,
            tested,
            cutoff,
            preshaded,
            shared_axes,
            harmonics,
            mirrors,
            mut tiles,
            now,
        } = self;
        let mut cull_reasons = vec![CullReason::Drawn; footprints.len() + culled.len()];
        for (splat, cull_reason) in culled {
            cull_reasons[splat as usize] = cull_reason;
        }
        tiles.sort_by_key(|tile| [tile.corner[1], tile.corner[0]]);
        Work {
            width,
            height,
            cull_reasons,
            footprints,
            order,
            keys,
            lists,
            tested,
            cutoff,
            preshaded,
            shared_axes,
            harmonics,
            tiles,
            walk: Vec::new(),
            ahead: 0,
            listed: Vec::new(),
            mirrors,
            texels: now.texels,
        }
    }

    /// A recorder for another part of the frame.
    pub fn fork(&self) -> Self {
        Recorder::default()
    }

    /// Adds the record of another part: of the following splats, or of other tiles.
    pub fn absorb(&mut self, other: Recorder) {
        self.footprints.extend(other.footprints);
        self.culled.extend(other.culled);
        self.tiles.extend(other.tiles);
        self.now.texels.extend(other.now.texels);
    }

    /// The frame has surroundings.
    pub fn mirrors(&mut self) {
        self.mirrors = true;
    }

    /// A fragment goes to shade, in a frame with surroundings.
    pub fn lit(&mut self) {
        self.now.texels.push(NO_TEXEL);
    }

    /// That fragment looks up four texels, the first of them in this column and row.
    pub fn looked_up(&mut self, [column, row]: [u8; 2]) {
        if let Some(last) = self.now.texels.last_mut() {
            *last = u16::from_be_bytes([row, column]);
        }
    }

    /// Those of eight splats that were not drawn, by [`CULLED`], the first splat in the LSB.
    pub fn culled(&mut self, first: u32, lanes: [u8; CULLED.len()]) {
        for (lanes, cull_reason) in lanes.into_iter().zip(CULLED) {
            self.culled.extend(
                (0..8)
                    .filter(|lane| lanes & (1 << lane) != 0)
                    .map(|lane| (first + lane, cull_reason)),
            );
        }
    }

    /// All splats with a box have been recorded. They are drawn in this order. Keys, if any, are in
    /// input order.
    pub fn sorted(&mut self, order: Vec<u32>, keys: Vec<u32>) {
        (self.order, self.keys) = (order, keys);
    }

    /// The machine keeps lists from frame to frame, and these are the lists of this one.
    pub fn merged(&mut self, lists: MergedLists) {
        self.lists = Some(lists);
    }

    /// Tiles are tested: words of all splats with a box, in input order, and the cutoff.
    pub fn tested(&mut self, words: Vec<TestedWords>, cutoff: i64) {
        (self.tested, self.cutoff) = (words, cutoff);
    }

    /// Splats are ellipsoids: whether those with a box are lit before they are drawn, whether all
    /// have the axes in the registers, and the degree of the harmonics of their colours.
    pub fn ellipsoids(&mut self, preshaded: bool, shared_axes: bool, harmonics: u8) {
        (self.preshaded, self.shared_axes, self.harmonics) = (preshaded, shared_axes, harmonics);
    }

    /// A splat has a box.
    pub fn drawn(&mut self, splat: u32, [columns, rows]: [[u16; 2]; 2]) {
        self.footprints.push(Footprint {
            splat,
            columns,
            rows,
        });
    }

    /// A splat's part of a tile, which has `rows` rows from column `left` of the tile on, keeps
    /// these pixels: 16 · row + column.
    #[inline(always)]
    pub fn span(&mut self, rows: usize, left: usize, places: &[u8]) {
        self.now.places.clear();
        self.now.recorded = 0;
        let mut kept = [0u16; TILE_PX];
        for place in places {
            kept[usize::from(place / 16) % TILE_PX] |= 1 << (usize::from(place % 16) + left);
            self.now.places.push(place + left as u8);
        }
        self.now.rows.extend_from_slice(&kept[..rows]);
        self.now.counts.push(0);
    }

    /// Which blocks of the next splat's part of the tile are kept.
    pub fn blocks(&mut self, mask: u16) {
        self.now.masks.push(mask);
    }

    /// Decision on the contribution to the next pixel.
    #[inline(always)]
    pub fn became(&mut self, event: Event) {
        let TileRecorder {
            places,
            recorded,
            counts,
            events,
            ..
        } = &mut self.now;
        if event != Event::Accumulated
            && let Some(count) = counts.last_mut()
        {
            *count += 1;
            events.push((places[*recorded], event));
        }
        *recorded += 1;
    }

    /// A fragment is shaded before it merges.
    #[inline(always)]
    pub fn shaded(&mut self) {
        self.now.shaded += 1;
    }

    /// Fragments shaded since the last call.
    #[inline(always)]
    pub fn take_shaded(&mut self) -> u8 {
        std::mem::take(&mut self.now.shaded)
    }

    /// The next pixel of the tile ends with this number of fragments, of which `shades` are not
    /// shaded yet.
    #[inline(always)]
    pub fn pixel(&mut self, fragments: u8, shades: u8) {
        self.now.pixels.push(fragments + 16 * shades);
    }

    /// The tile is finished.
    pub fn tile(&mut self, corner: [u16; 2]) {
        let TileRecorder {
            rows,
            counts,
            events,
            pixels,
            texels,
            masks,
            ..
        } = &mut self.now;
        let texels = std::mem::take(texels);
        let tile = Tile {
            corner,
            rows: rows.clone(),
            counts: counts.clone(),
            events: events.clone(),
            pixels: pixels.clone(),
            texels,
            masks: std::mem::take(masks),
        };
        rows.clear();
        counts.clear();
        events.clear();
        pixels.clear();
        self.tiles.push(tile);
    }
}

/// Boxes by the tiles that they touch, in input order.
#[derive(Clone, Debug)]
pub struct Bins {
    /// Tiles of a row.
    pub columns: usize,
    /// Rows of tiles.
    pub rows: usize,
    /// Tile t's entries are `starts[t]..starts[t + 1]`.
    starts: Vec<usize>,
    entries: Vec<u32>,
}

impl Bins {
    /// For a picture in tiles with this side, and numbered boxes: first and last column, first and
    /// last row.
    #[inline(always)]
    pub fn new(
        size_px: [u32; 2],
        side_px: usize,
        boxes: impl Iterator<Item = (u32, [[u16; 2]; 2])> + Clone,
    ) -> Self {
        let [columns, rows] = size_px.map(|size| (size as usize).div_ceil(side_px));
        let mut starts = vec![0; columns * rows + 1];
        boxes.clone().for_each(|(_, sides)| {
            each_tile(sides, side_px, columns, |tile| starts[tile + 1] += 1)
        });
        for tile in 0..columns * rows {
            starts[tile + 1] += starts[tile];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; starts[columns * rows]];
        boxes.for_each(|(entry, sides)| {
            each_tile(sides, side_px, columns, |tile| {
                entries[next[tile]] = entry;
                next[tile] += 1;
            });
        });
        Bins {
            columns,
            rows,
            starts,
            entries,
        }
    }

    /// Number of tiles.
    pub fn tiles(&self) -> usize {
        self.columns * self.rows
    }

    /// Number of entries in all tiles.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Number of entries in all tiles that have not departed.
    pub fn listed(&self) -> usize {
        self.entries
            .iter()
            .filter(|entry| **entry != DEPARTED)
            .count()
    }

    /// Removes the entries that do not hold, by tile and number.
    pub fn retain(&mut self, mut holds: impl FnMut(usize, u32) -> bool) {
        let mut kept = 0;
        for tile in 0..self.tiles() {
            let (from, to) = (self.starts[tile], self.starts[tile + 1]);
            self.starts[tile] = kept;
            for place in from..to {
                let entry = self.entries[place];
                if holds(tile, entry) {
                    self.entries[kept] = entry;
                    kept += 1;
                }
            }
        }
        let tiles = self.tiles();
        self.starts[tiles] = kept;
        self.entries.truncate(kept);
    }

    /// Number of entries in the tiles before a tile.
    pub fn first(&self, tile: usize) -> usize {
        self.starts[tile]
    }

    /// The numbers of the boxes that touch a tile.
    pub fn of(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }
}

/// Every tile that a box touches, by rows.
#[inline(always)]
pub fn each_tile(
    sides: [[u16; 2]; 2],
    side_px: usize,
    columns: usize,
    mut visit: impl FnMut(usize),
) {
    let tile = |pixel: u16| (u32::from(pixel) / side_px as u32) as usize;
    let [[left, right], [top, bottom]] = sides.map(|side| side.map(tile));
    // Most boxes touch one tile.
    if left == right && top == bottom {
        return visit(top * columns + left);
    }
    for row in top..bottom + 1 {
        (left..right + 1).for_each(|column| visit(row * columns + column));
    }
}
