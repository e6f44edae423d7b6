//! Fragment's records: contributions, decisions on them, and the contents of a pixel.

/// Side of a tile, pixels.
pub const TILE_PX: usize = 16;
/// Pixels of a tile.
pub const TILE_AREA: usize = TILE_PX * TILE_PX;
/// Sums of a fragment: weight, rgb, opacity, normal.
pub const SUMS: usize = 8;
/// Greatest number of layers.
pub const MAX_LAYERS: usize = 8;

/// The sums of one fragment; of a shaded one, the colour and opacity instead of their sums.
pub type Sums = [i64; SUMS];
/// Index of the weight sum.
pub const WEIGHT: usize = 0;
/// Index of the first colour sum.
pub const COLOUR: usize = 1;
/// Index of the opacity sum.
pub const OPACITY: usize = 4;
/// Index of the first normal sum.
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

/// The splat's factors in a contribution: 1, r, g, b, α, n_x, n_y, n_z.
pub type Attributes = [i32; SUMS];

/// Input port of fragment: one contribution to one pixel, as probes see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contribution {
    /// Index of the splat in the frame.
    pub splat: u32,
    /// r (`gauss.radial_index`).
    pub radial_index: i64,
    /// w (`gauss.weight`).
    pub weight: i64,
    /// z (`fragment.depth`).
    pub depth: i64,
}

/// Decision on a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Added to the fragment in this slot.
    Accumulated(u8),
    /// Inserted into this free slot.
    Inserted(u8),
    /// Two fragments merged: indices of the front and the back one among `layers` + 1 fragments in
    /// depth order.
    Merged(u8, u8),
    /// The deepest fragment was dropped behind an opaque one; `true` if it was the contribution
    /// itself.
    Evicted(bool),
    /// Replaced the pixel's fragment (z-buffer).
    Replaced,
    /// Dropped behind the pixel's fragment (z-buffer).
    Dropped,
    /// Late: blended into this closed slot, over its front or under its back (windows).
    Late(u8, Side),
    /// Blended into this closed slot, between its front and its back (windows).
    Inside(u8),
    /// Two slots were added: index of the front one and of the contribution, among `layers` + 1 in
    /// depth order (windows).
    Summed(u8, u8),
    /// The two deepest slots closed, the deeper one behind or (`true`) inside the other; index of
    /// the contribution (windows).
    Closed(u8, bool),
}

/// Part of a closed slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The nearest surface of the slot.
    Front,
    /// The deepest surface of the slot.
    Back,
}

/// Count of each [`Decision`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcomes {
    /// Added to a fragment.
    pub accumulated: u64,
    /// Inserted into a free slot.
    pub inserted: u64,
    /// Two fragments merged.
    pub merged: u64,
    /// The deepest fragment was dropped.
    pub evicted: u64,
    /// Replaced a fragment.
    pub replaced: u64,
    /// Dropped.
    pub dropped: u64,
    /// Late, into a closed slot.
    pub late: u64,
    /// Blended inside a closed slot.
    pub inside: u64,
    /// Two slots were added.
    pub summed: u64,
    /// Contributions to the busiest pixel.
    pub most_in_a_pixel: u64,
}

impl Outcomes {
    /// Counts one decision.
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

    /// Adds the counts of another part of the frame.
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

    /// Number of contributions.
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

/// Result of shade: a fragment's colour times its opacity, and its opacity (`shade.premultiplied`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Premultiplied {
    /// Colour times opacity.
    pub colour: [i64; 3],
    /// Opacity.
    pub opacity: i64,
}

/// A fragment, unpacked from its slot.
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

/// Bits of a sheet number.
pub const SHEET_BITS: i32 = 31;

/// Flag in the key of the composite: the pixel accepts no further sheets.
pub const STOPPED: i32 = 1;

/// A pixel with sheets, unpacked from its slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held {
    /// The pixel accepts no further sheets.
    pub stopped: bool,
    /// Sums of the blended sheets.
    pub composite: Sums,
    /// The number and the sums of the open sheet, if any.
    pub open: Option<(u32, Sums)>,
}

impl Held {
    /// Unpacks a pixel's slots: the composite, then the open sheet, if any.
    pub fn of(slots: &[Slot]) -> Self {
        let composite = slots.first().copied().unwrap_or_default();
        Held {
            stopped: composite.depth & i64::from(STOPPED) != 0,
            composite: composite.sums,
            open: slots.get(1).map(|slot| (slot.depth as u32, slot.sums)),
        }
    }
}
