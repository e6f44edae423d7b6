//! Work: what happened in a frame, recorded compactly, for timing to replay.
//!
//! ```text
//!                    ┌─ fates   what became of each splat                  1 byte a splat
//! frame ─► Recorder ─┼─ boxes   what the drawn ones covered               12 bytes a splat
//!                    └─ tiles   which pixels each row kept                 2 bytes a row
//!                               what became of their contributions         1 byte for each that was not just added
//!                               what each pixel held in the end            1 byte a pixel
//! ```
//! The simulator draws tiles of 16×16 pixels, and records them so; within a tile splats come in input order. Every organisation of a
//! machine goes through the same tiles in its own order, for a pixel's result depends on nothing but the order of its contributions.
//!
//! Laws: `what_is_recorded_is_what_was_drawn`, `a_record_is_the_same_for_any_number_of_threads`.

/// Side of a recorded tile, pixels.
pub const TILE_PX: usize = 16;

/// What became of a splat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It has a box.
    Drawn,
    /// At or before the near plane: it ends in `project`.
    Near,
    /// Outside of the guard band: it ends in `project`.
    Outside,
    /// Faces away: it ends in `ellipse`, as all that follow.
    Backface,
    /// Nothing to see.
    Faint,
    /// The box misses the picture.
    Missing,
}

/// What became of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Added to a fragment.
    Accumulated,
    /// Its weight rounds to 0: it ends in `gauss`.
    Faint,
    /// Opened a slot.
    Inserted,
    /// Made two fragments merge, of which so many, 0 to 2, had to be shaded for it.
    Merged(u8),
    /// Made the deepest fragment vanish.
    Evicted,
    /// Replaced a fragment, or was dropped behind it.
    Replaced,
}

/// Events in the order of their codes.
const EVENTS: [Event; 7] =
    [Event::Faint, Event::Inserted, Event::Merged(0), Event::Merged(1), Event::Merged(2), Event::Evicted, Event::Replaced];
/// The longest run of accumulations before an event that its byte holds; a byte of all ones is so many and no event.
const LONGEST: u8 = 31;
const CODES: u8 = 8;

/// Where a drawn splat lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// What happened in a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Its first pixel.
    pub corner: [u16; 2],
    /// Splat by splat, row by row of its box in the tile: which columns were kept, the first of the tile in the last place.
    rows: Vec<u16>,
    /// Runs of accumulations, each with the event that ends it.
    events: Vec<u8>,
    /// Fragments at the end, and 16 times how many of them were left to shade.
    pixels: Vec<u8>,
}

impl Tile {
    /// Fragments that a pixel, counted by rows, ended with, and how many were left to shade.
    pub fn pixel(&self, pixel: usize) -> [u8; 2] {
        [self.pixels[pixel] % 16, self.pixels[pixel] / 16]
    }

    /// Bytes that it takes.
    fn bytes(&self) -> usize {
        2 * self.rows.len() + self.events.len() + self.pixels.len()
    }

    /// Reads it from its beginning.
    pub fn reader(&self) -> Reader<'_> {
        Reader { tile: self, row: 0, event: 0, accumulated: 0 }
    }
}

/// Goes through a tile, splat by splat.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    tile: &'a Tile,
    row: usize,
    /// The next byte.
    event: usize,
    /// Accumulations of its run that are told.
    accumulated: u8,
}

impl Reader<'_> {
    /// Which columns the next row kept.
    #[inline(always)]
    pub fn row(&mut self) -> u16 {
        self.row += 1;
        self.tile.rows[self.row - 1]
    }

    /// What became of the next pixel that was kept.
    #[inline(always)]
    pub fn event(&mut self) -> Event {
        loop {
            let Some(&byte) = self.tile.events.get(self.event) else { return Event::Accumulated };
            let run = byte / CODES;
            if self.accumulated < run {
                self.accumulated += 1;
                return Event::Accumulated;
            }
            (self.event, self.accumulated) = (self.event + 1, 0);
            if run < LONGEST {
                return EVENTS[usize::from(byte % CODES) % EVENTS.len()];
            }
        }
    }

    /// Whether nothing but accumulations lies among the next so many pixels; then they are told.
    #[inline(always)]
    pub fn only_accumulates(&mut self, pixels: u32) -> bool {
        let left = match self.tile.events.get(self.event) {
            Some(byte) => u32::from(byte / CODES - self.accumulated),
            None => u32::MAX,
        };
        if pixels > left {
            return false;
        }
        if left < u32::MAX {
            self.accumulated += pixels as u8;
        }
        true
    }
}

/// What happened in a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What became of each splat, in input order.
    pub fates: Vec<Fate>,
    /// The drawn splats, in input order.
    pub footprints: Vec<Footprint>,
    /// Every tile that a box touches, by rows.
    pub tiles: Vec<Tile>,
}

impl Work {
    /// The drawn splats by tiles of so many pixels a side: their places among [`Work::footprints`].
    pub fn bins(&self, side_px: usize) -> Bins {
        let boxes = self.footprints.iter().zip(0..).map(|(footprint, nth)| (nth, footprint.sides()));
        Bins::new([self.width, self.height], side_px, boxes)
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.fates.len() + size_of::<Footprint>() * self.footprints.len() + self.tiles.iter().map(Tile::bytes).sum::<usize>()
    }

    /// How many fragments of each pixel, row by row, are left to shade in the end.
    pub fn left_to_shade(&self) -> Vec<u8> {
        let [width, height] = [self.width, self.height].map(|size| size as usize);
        let mut left = vec![0; width * height];
        for tile in &self.tiles {
            let [x, y] = tile.corner.map(usize::from);
            for row in 0..TILE_PX.min(height - y) {
                let first = (y + row) * width + x;
                for (column, left) in left[first..first + TILE_PX.min(width - x)].iter_mut().enumerate() {
                    *left = tile.pixel(row * TILE_PX + column)[1];
                }
            }
        }
        left
    }

    /// Rows of the boxes of all drawn splats.
    pub fn rows(&self) -> u64 {
        self.footprints.iter().map(|footprint| u64::from(footprint.rows[1] - footprint.rows[0]) + 1).sum()
    }
}

/// Records a tile.
#[derive(Clone, Debug, Default)]
struct TileRecorder {
    rows: Vec<u16>,
    events: Vec<u8>,
    pixels: Vec<u8>,
    /// Accumulations since the last event.
    run: u32,
    /// The span that is being told: where its contributions lie, how many of them were told, and what was not just added.
    places: Vec<u8>,
    told: usize,
    told_events: Vec<(u8, u8)>,
    shaded: u8,
}

impl TileRecorder {
    #[inline(always)]
    fn became(&mut self, event: Event) {
        if event != Event::Accumulated {
            let code = EVENTS.iter().position(|other| *other == event).unwrap_or(0) as u8;
            self.told_events.push((self.places[self.told], code));
        }
        self.told += 1;
    }

    /// All of a span is told. The simulator may go through its columns first: here it goes by rows.
    #[inline(always)]
    fn end_span(&mut self) {
        let mut told = 0;
        if !self.told_events.is_empty() {
            self.told_events.sort_unstable();
            self.places.sort_unstable();
            for &(place, code) in &self.told_events {
                let before = self.places.partition_point(|other| *other < place);
                self.run += (before - told) as u32;
                while self.run >= u32::from(LONGEST) {
                    self.events.push(LONGEST * CODES);
                    self.run -= u32::from(LONGEST);
                }
                self.events.push(self.run as u8 * CODES + code);
                (self.run, told) = (0, before + 1);
            }
            self.told_events.clear();
        }
        self.run += (self.places.len() - told) as u32;
        self.places.clear();
        self.told = 0;
    }
}

/// Records the work of a frame, or of a part of it.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// Drawn splats, and those that were not.
    footprints: Vec<Footprint>,
    culled: Vec<(u32, Fate)>,
    tiles: Vec<Tile>,
    now: TileRecorder,
}

/// Splats in the order of their places; a fate for each lane that has one.
pub const CULLED: [Fate; 5] = [Fate::Near, Fate::Outside, Fate::Backface, Fate::Faint, Fate::Missing];

impl Recorder {
    /// What was recorded of a frame.
    pub fn work(self, width: u32, height: u32) -> Work {
        let Recorder { footprints, culled, mut tiles, .. } = self;
        let mut fates = vec![Fate::Drawn; footprints.len() + culled.len()];
        for (splat, fate) in culled {
            fates[splat as usize] = fate;
        }
        tiles.sort_by_key(|tile| [tile.corner[1], tile.corner[0]]);
        Work { width, height, fates, footprints, tiles }
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
    }

    /// Of eight splats, which were not drawn, by [`CULLED`], the first in the last place.
    pub fn culled(&mut self, first: u32, lanes: [u8; 5]) {
        for (lanes, fate) in lanes.into_iter().zip(CULLED) {
            self.culled.extend((0..8).filter(|lane| lanes & (1 << lane) != 0).map(|lane| (first + lane, fate)));
        }
    }

    /// A splat has a box.
    pub fn drawn(&mut self, splat: u32, [columns, rows]: [[u16; 2]; 2]) {
        self.footprints.push(Footprint { splat, columns, rows });
    }

    /// A splat's part of a tile, of so many rows from column `left` of the tile on, keeps these places: 16 · row + column.
    #[inline(always)]
    pub fn span(&mut self, rows: usize, left: usize, places: &[u8]) {
        self.now.end_span();
        self.now.places.extend_from_slice(places);
        let mut kept = [0u16; TILE_PX];
        for place in places {
            kept[usize::from(place / 16) % TILE_PX] |= 1 << (usize::from(place % 16) + left);
        }
        self.now.rows.extend_from_slice(&kept[..rows]);
    }

    /// What became of the next place.
    #[inline(always)]
    pub fn became(&mut self, event: Event) {
        self.now.became(event);
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
        self.now.end_span();
        // A run that no event ends is not told: where bytes end, all accumulates.
        self.now.run = 0;
        let TileRecorder { rows, events, pixels, .. } = &mut self.now;
        let tile = Tile { corner, rows: rows.as_slice().into(), events: events.as_slice().into(), pixels: pixels.as_slice().into() };
        rows.clear();
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
    /// For a picture in tiles of so many pixels a side, and numbered boxes: first and last column, first and last row.
    #[inline(always)]
    pub fn new(size_px: [u32; 2], side_px: usize, boxes: impl Iterator<Item = (u32, [[u16; 2]; 2])> + Clone) -> Self {
        let [columns, rows] = size_px.map(|size| (size as usize).div_ceil(side_px));
        let mut starts = vec![0; columns * rows + 1];
        for (_, sides) in boxes.clone() {
            each_tile(sides, side_px, columns, |tile| starts[tile + 1] += 1);
        }
        for tile in 0..columns * rows {
            starts[tile + 1] += starts[tile];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; starts[columns * rows]];
        for (entry, sides) in boxes {
            each_tile(sides, side_px, columns, |tile| {
                entries[next[tile]] = entry;
                next[tile] += 1;
            });
        }
        Bins { columns, rows, starts, entries }
    }

    /// How many tiles there are.
    pub fn tiles(&self) -> usize {
        self.columns * self.rows
    }

    /// The numbers of the boxes that touch a tile.
    pub fn of(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }
}

/// Every tile that a box touches, by rows.
#[inline(always)]
pub fn each_tile(sides: [[u16; 2]; 2], side_px: usize, columns: usize, mut visit: impl FnMut(usize)) {
    let [across, down] = sides.map(|[first, last]| usize::from(first) / side_px..=usize::from(last) / side_px);
    for row in down {
        for column in across.clone() {
            visit(row * columns + column);
        }
    }
}
