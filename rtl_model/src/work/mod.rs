//! Work: what happened in a frame, recorded compactly, for timing to replay.
//!
//! ```text
//!                    ┌─ fates   what became of each splat                  1 byte a splat
//! frame ─► Recorder ─┼─ boxes   what the drawn ones covered               12 bytes a splat
//!                    └─ tiles   which pixels each row kept                 2 bytes a row
//!                               what became of their contributions         2 bytes a splat, 3 for each that was not just added
//!                               what each pixel held in the end            1 byte a pixel
//! ```
//! The simulator draws tiles of 16×16 pixels, and records them so; within a tile splats come in
//! input order. Every organisation of a machine goes through the same tiles in its own order, for a
//! pixel's result depends on nothing but the order of its contributions.
//!
//! Laws: `the_record_equals_the_drawing`, `a_record_is_the_same_for_any_number_of_threads`.

mod sound;

use serde::{Deserialize, Serialize};

/// Side of a recorded tile, pixels.
pub const TILE_PX: usize = 16;

/// Fate of a splat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fate {
    /// It has a box.
    Drawn,
    /// At or before the near plane: it ends in `project`.
    Near,
    /// Outside of the guard band: it ends in `project`.
    Outside,
    /// Faces away: it ends in `ellipse`, as the two that follow.
    Backface,
    /// Nothing to see.
    Faint,
    /// The box misses the picture.
    Missing,
    /// Too little opacity for any of its weights to count: it ends in `project`.
    Transparent,
}

impl Fate {
    /// Whether the splat goes on from `project` to `ellipse`.
    pub fn leaves_project(self) -> bool {
        !matches!(self, Fate::Near | Fate::Outside | Fate::Transparent)
    }
}

/// What became of a node of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Found {
    /// Its children are read.
    Opened,
    /// It is drawn.
    Drawn,
    /// All below it face away.
    Away,
    /// All below it lie outside of the picture.
    Outside,
}

/// A node of a tree that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Visit {
    /// Its number: where it lies in memory.
    pub node: u32,
    /// Place of its parent's visit, which is before it; of the first its own.
    pub parent: u32,
    /// What became of it.
    pub found: Found,
}

/// Outcome of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// Added to a fragment.
    Accumulated,
    /// Its weight rounds to 0: it ends in `gauss`.
    Faint,
    /// Opened a slot.
    Inserted,
    /// Made two fragments merge, of which so many, 0 to 2, had to be shaded for it; of windows, was
    /// blended too, or made two add up.
    Merged(u8),
    /// Made the deepest fragment vanish.
    Evicted,
    /// Replaced a fragment, or was dropped behind it.
    Replaced,
    /// Made its pixel stop: whatever comes after it there is recorded as if it were added, and
    /// changes nothing.
    Stopped,
    /// The same by the sheet that was blended because it begins another: that takes as long as a
    /// merge.
    MergedAndStopped,
}

impl Event {
    /// Whether its pixel takes nothing more.
    pub fn stops(self) -> bool {
        matches!(self, Event::Stopped | Event::MergedAndStopped)
    }
}

/// Where a drawn splat lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Footprint {
    /// Its place in the input.
    pub splat: u32,
    /// First and last column of its box.
    pub columns: [u16; 2],
    /// First and last row.
    pub rows: [u16; 2],
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
    /// Splat by splat, row by row of its box in the tile: which columns were kept, the first of the
    /// tile in the last place.
    rows: Vec<u16>,
    /// Splat by splat, how many of its contributions were not just added.
    counts: Vec<u16>,
    /// Those: where, 16 times the row of the box in the tile, and the tile's column; and what.
    events: Vec<(u8, Event)>,
    /// Fragments at the end, and 16 times how many of them were left to shade.
    pixels: Vec<u8>,
    /// Of a frame with surroundings what each fragment that was shaded looked up: for merges, event
    /// by event, then pixel by pixel.
    texels: Vec<u16>,
}

/// In the place of a texel: nothing was looked up.
pub const NO_TEXEL: u16 = u16::MAX;

impl Tile {
    /// Fragments that a pixel, counted by rows, ended with, and how many were left to shade.
    pub fn pixel(&self, pixel: usize) -> [u8; 2] {
        [self.pixels[pixel] % 16, self.pixels[pixel] / 16]
    }

    /// Bytes that it takes.
    fn bytes(&self) -> usize {
        2 * (self.rows.len() + self.counts.len() + self.texels.len())
            + size_of::<(u8, Event)>() * self.events.len()
            + self.pixels.len()
    }

    /// Reads it from its beginning.
    pub fn reader(&self) -> Reader<'_> {
        Reader {
            rows: &self.rows,
            counts: &self.counts,
            events: &self.events,
            texels: &self.texels,
        }
    }

    /// What the fragments looked up that were left to shade in the end, pixel by pixel.
    pub fn texels_of_pixels(&self) -> &[u16] {
        let left: usize = self
            .pixels
            .iter()
            .map(|pixel| usize::from(pixel / 16))
            .sum();
        &self.texels[self.texels.len().saturating_sub(left)..]
    }
}

/// Goes through a tile, splat by splat.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rows: &'a [u16],
    counts: &'a [u16],
    events: &'a [(u8, Event)],
    texels: &'a [u16],
}

impl<'a> Reader<'a> {
    /// What the fragments that were shaded for these events, the next ones, looked up; nothing
    /// where nothing is mirrored.
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

    /// Rows of the next splat, and of all that follow.
    #[inline(always)]
    pub fn rows(&self) -> &'a [u16] {
        self.rows
    }

    /// The next splat, of so many rows: which columns each row kept; where, 16 times the row and
    /// the column, a contribution was not just added, and what became of it.
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
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Fate of each splat, in input order.
    pub fates: Vec<Fate>,
    /// The drawn splats, in input order.
    pub footprints: Vec<Footprint>,
    /// In which order they are drawn: places among them; empty where they are drawn in input order.
    pub order: Vec<u32>,
    /// Key of each drawn splat, in input order, on a machine that distributes lists to buckets by
    /// it; else empty.
    #[serde(skip)]
    pub keys: Vec<u32>,
    /// Every drawn splat is lit before it is drawn.
    pub preshaded: bool,
    /// All splats have the axes that lie in registers.
    pub shared_axes: bool,
    /// Degree of the spherical harmonics that become the colour of every drawn splat, 0 to 3; 0
    /// where records have colours.
    pub harmonics: u8,
    /// Every tile that a box touches, by rows.
    pub tiles: Vec<Tile>,
    /// Nodes of a tree that were read to find the splats; none where these lie in memory one after
    /// the other.
    pub walk: Vec<Visit>,
    /// How many nodes' children are asked for at a time.
    pub ahead: u32,
    /// Nodes that are drawn, in that order; empty where they are drawn as the walk comes to them.
    pub listed: Vec<u32>,
    /// The frame has surroundings, which the machine mirrors.
    pub mirrors: bool,
    /// Of such a frame, if splats are lit before they are drawn, what each drawn one looked up: a
    /// row and a column of the map, a byte each.
    pub texels: Vec<u16>,
}

impl Work {
    /// The drawn splats by tiles of so many pixels a side: their places among [`Work::footprints`].
    pub fn bins(&self, side_px: usize) -> Bins {
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

    /// Brings the footprints of these places together: they lie scattered, and whoever went from
    /// one to the next would wait for each.
    pub fn look_up(&self, places: &[u32], footprints: &mut Vec<Footprint>) {
        footprints.clear();
        footprints.extend(places.iter().map(|nth| self.footprints[*nth as usize]));
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.fates.len()
            + 4 * (self.order.len() + self.keys.len())
            + size_of::<Footprint>() * self.footprints.len()
            + self.tiles.iter().map(Tile::bytes).sum::<usize>()
            + size_of::<Visit>() * self.walk.len()
            + 4 * self.listed.len()
            + 2 * self.texels.len()
    }

    /// Most nodes of its walk that took a place on the walker's stack; 0 where there is no walk.
    /// Those that are asked for keep their places until their children are tested.
    pub fn deepest_stack(&self) -> u64 {
        let mut groups = self
            .walk
            .chunk_by(|one, next| one.parent == next.parent && one.node != 0)
            .peekable();
        let (mut stack, mut deepest) = (u64::from(groups.peek().is_some()), 0);
        while groups.peek().is_some() {
            let asked = stack.clamp(1, self.ahead.max(1).into());
            let read = groups.by_ref().take(asked as usize).flatten();
            let pushed = read.filter(|visit| visit.found == Found::Opened).count() as u64;
            stack = stack.saturating_sub(asked) + pushed;
            deepest = deepest.max(stack + asked);
        }
        deepest
    }

    /// Contents of each pixel in the end, row by row: fragments, and how many of them are left to
    /// shade.
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

    /// What fragments look up that are left to shade, pixel by pixel, tile after tile; and by rows
    /// of the picture where each pixel's begin.
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
    /// The span that is being recorded: where its contributions lie, and how many of them were.
    places: Vec<u8>,
    recorded: usize,
    shaded: u8,
    /// What fragments looked up; of splats that are lit before they are drawn, if they are set up
    /// here.
    texels: Vec<u16>,
}

/// Records the work of a frame, or of a part of it.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// Drawn splats, and those that were not.
    footprints: Vec<Footprint>,
    culled: Vec<(u32, Fate)>,
    order: Vec<u32>,
    keys: Vec<u32>,
    preshaded: bool,
    shared_axes: bool,
    harmonics: u8,
    mirrors: bool,
    tiles: Vec<Tile>,
    now: TileRecorder,
}

/// Splats in the order of their places; a fate for each lane that has one.
pub const CULLED: [Fate; 6] = [
    Fate::Near,
    Fate::Outside,
    Fate::Transparent,
    Fate::Backface,
    Fate::Faint,
    Fate::Missing,
];

impl Recorder {
    /// Record of a frame.
    pub fn work(self, width: u32, height: u32) -> Work {
        let Recorder {
            footprints,
            culled,
            order,
            keys,
            preshaded,
            shared_axes,
            harmonics,
            mirrors,
            mut tiles,
            now,
        } = self;
        let mut fates = vec![Fate::Drawn; footprints.len() + culled.len()];
        for (splat, fate) in culled {
            fates[splat as usize] = fate;
        }
        tiles.sort_by_key(|tile| [tile.corner[1], tile.corner[0]]);
        Work {
            width,
            height,
            fates,
            footprints,
            order,
            keys,
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

    /// A recorder of another part.
    pub fn fork(&self) -> Self {
        Recorder::default()
    }

    /// Takes over another part: of the splats that follow, or other tiles.
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

    /// It looks up four texels, the first of them in this column and row.
    pub fn looked_up(&mut self, [column, row]: [u8; 2]) {
        if let Some(last) = self.now.texels.last_mut() {
            *last = u16::from_be_bytes([row, column]);
        }
    }

    /// Of eight splats, which were not drawn, by [`CULLED`], the first in the last place.
    pub fn culled(&mut self, first: u32, lanes: [u8; CULLED.len()]) {
        for (lanes, fate) in lanes.into_iter().zip(CULLED) {
            self.culled.extend(
                (0..8)
                    .filter(|lane| lanes & (1 << lane) != 0)
                    .map(|lane| (first + lane, fate)),
            );
        }
    }

    /// All splats with a box have been recorded; they are drawn in this order. Keys, if any, are in
    /// input order.
    pub fn sorted(&mut self, order: Vec<u32>, keys: Vec<u32>) {
        (self.order, self.keys) = (order, keys);
    }

    /// Splats are ellipsoids: whether each with a box is lit before it is drawn, whether all have
    /// the axes in the registers, and the degree of the harmonics that their colours are.
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

    /// A splat's part of a tile, of so many rows from column `left` of the tile on, keeps these
    /// places: 16 · row + column.
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

    /// The next place had this outcome.
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

    /// A fragment is shaded so that it can merge.
    #[inline(always)]
    pub fn shaded(&mut self) {
        self.now.shaded += 1;
    }

    /// Fragments shaded since this was asked last.
    #[inline(always)]
    pub fn take_shaded(&mut self) -> u8 {
        std::mem::take(&mut self.now.shaded)
    }

    /// The next pixel of the tile ends with so many fragments, of which so many are left to shade.
    #[inline(always)]
    pub fn pixel(&mut self, fragments: u8, shades: u8) {
        self.now.pixels.push(fragments + 16 * shades);
    }

    /// The tile is done.
    pub fn tile(&mut self, corner: [u16; 2]) {
        let TileRecorder {
            rows,
            counts,
            events,
            pixels,
            texels,
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
        };
        rows.clear();
        counts.clear();
        events.clear();
        pixels.clear();
        self.tiles.push(tile);
    }
}

/// Which boxes touch which tile, in input order.
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
    /// For a picture in tiles of so many pixels a side, and numbered boxes: first and last column,
    /// first and last row.
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
    // Most touch one.
    if left == right && top == bottom {
        return visit(top * columns + left);
    }
    for row in top..bottom + 1 {
        (left..right + 1).for_each(|column| visit(row * columns + column));
    }
}
