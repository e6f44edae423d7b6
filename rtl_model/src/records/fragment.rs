//! Fragment's records: contributions, what became of them, and what a pixel keeps.

/// Side of a tile, pixels.
pub const TILE_PX: usize = 16;
/// Pixels of a tile.
pub const TILE_AREA: usize = TILE_PX * TILE_PX;
/// Sums of a fragment: weight, rgb, opacity, normal.
pub const SUMS: usize = 8;
/// Greatest number of layers.
pub const MAX_LAYERS: usize = 8;

/// The sums of one fragment, or the colour and opacity of a shaded one in the places of theirs.
pub type Sums = [i64; SUMS];
/// Where a fragment's weight sum lies.
pub const WEIGHT: usize = 0;
/// Where its colour begins.
pub const COLOUR: usize = 1;
/// Where its opacity lies.
pub const OPACITY: usize = 4;
/// Where its normal begins.
pub const NORMAL: usize = 5;

/// Names of the sums' signals in the unit fragment.
pub const SUM_SIGNALS: [&str; SUMS] = [
    "weight_sum",
    "colour_sum",
    "colour_sum",
    "colour_sum",
    "opacity_sum",
    "normal_sum",
    "normal_sum",
    "normal_sum",
];

/// A contribution's part that is the splat's: 1, r, g, b, α, n_x, n_y, n_z.
pub type Attributes = [i32; SUMS];

/// Input port of fragment: one contribution to one pixel, as probes see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contribution {
    /// Which splat of the frame.
    pub splat: u32,
    /// r (`gauss.radial_index`).
    pub radial_index: i64,
    /// w (`gauss.weight`).
    pub weight: i64,
    /// z (`fragment.depth`).
    pub depth: i64,
}

/// Outcome of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Added to the fragment in this slot.
    Accumulated(u8),
    /// Opened this free slot.
    Inserted(u8),
    /// Made two fragments merge: places in depth order, of `layers` + 1, of the front and the back
    /// one.
    Merged(u8, u8),
    /// Made the deepest fragment vanish behind an opaque one; `true` if it was the contribution
    /// itself.
    Evicted(bool),
    /// Replaced what was there (z-buffer).
    Replaced,
    /// Was dropped behind what was there (z-buffer).
    Dropped,
    /// Came late: blended into this closed slot, over its front or under its back (windows).
    Late(u8, Side),
    /// Blended into this closed slot, between its front and its back (windows).
    Inside(u8),
    /// Made two slots add up: the place of the front one, and that of the contribution, among
    /// `layers` + 1 in depth order (windows).
    Summed(u8, u8),
    /// Made the two deepest close, the deeper one behind or (`true`) inside of the other; the
    /// contribution's place (windows).
    Closed(u8, bool),
}

/// Part of a closed slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Its nearest surface.
    Front,
    /// Its deepest surface.
    Back,
}

/// Count of each [`Decision`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcomes {
    /// Added to a fragment.
    pub accumulated: u64,
    /// Opened a slot.
    pub inserted: u64,
    /// Made two fragments merge.
    pub merged: u64,
    /// Made the deepest fragment vanish.
    pub evicted: u64,
    /// Replaced a fragment.
    pub replaced: u64,
    /// Was dropped.
    pub dropped: u64,
    /// Came late to a closed slot.
    pub late: u64,
    /// Blended inside of a closed slot.
    pub inside: u64,
    /// Made two slots add up.
    pub summed: u64,
    /// Contributions to the busiest pixel.
    pub most_in_a_pixel: u64,
}

impl Outcomes {
    /// Counts one.
    #[inline(always)]
    pub fn count(&mut self, decision: Decision) {
        match decision {
            Decision::Accumulated(_) => self.accumulated += 1,
            Decision::Inserted(_) => self.inserted += 1,
            Decision::Merged(..) | Decision::Closed(..) => self.merged += 1,
            Decision::Evicted(_) => self.evicted += 1,
            Decision::Replaced => self.replaced += 1,
            Decision::Dropped => self.dropped += 1,
            Decision::Late(..) => self.late += 1,
            Decision::Inside(_) => self.inside += 1,
            Decision::Summed(..) => self.summed += 1,
        }
    }

    /// Adds what another part of the frame counted.
    pub fn absorb(&mut self, other: &Outcomes) {
        self.accumulated += other.accumulated;
        self.inserted += other.inserted;
        self.merged += other.merged;
        self.evicted += other.evicted;
        self.replaced += other.replaced;
        self.dropped += other.dropped;
        self.late += other.late;
        self.inside += other.inside;
        self.summed += other.summed;
        self.most_in_a_pixel = self.most_in_a_pixel.max(other.most_in_a_pixel);
    }

    /// All contributions.
    pub fn total(&self) -> u64 {
        self.accumulated
            + self.inserted
            + self.merged
            + self.evicted
            + self.replaced
            + self.dropped
            + self.late
            + self.inside
            + self.summed
    }
}

/// Answer of shade: a fragment's colour times its opacity, and its opacity (`shade.premultiplied`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Premultiplied {
    /// Colour times opacity.
    pub colour: [i64; 3],
    /// Opacity.
    pub opacity: i64,
}

/// A fragment outside its slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slot {
    /// Sums, or shaded colour and opacity.
    pub sums: Sums,
    /// z of the fragment (`fragment.depth`).
    pub depth: i64,
    /// Index into the frame's materials.
    pub material: u32,
    /// Whether `sums` hold a shaded colour.
    pub shaded: bool,
}

/// Bits of a sheet's number.
pub const SHEET_BITS: i32 = 31;

/// In the key of the composite: the pixel takes nothing more.
pub const STOPPED: i32 = 1;

/// A pixel of sheets, as it is outside its slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held {
    /// It takes nothing more.
    pub stopped: bool,
    /// Sums of what has been blended.
    pub composite: Sums,
    /// The open sheet, if there is one: its number and its sums.
    pub open: Option<(u32, Sums)>,
}

impl Held {
    /// A pixel by its slots: what has been blended, and maybe an open sheet.
    pub fn of(slots: &[Slot]) -> Self {
        let composite = slots.first().copied().unwrap_or_default();
        Held {
            stopped: composite.depth & i64::from(STOPPED) != 0,
            composite: composite.sums,
            open: slots.get(1).map(|slot| (slot.depth as u32, slot.sums)),
        }
    }
}
