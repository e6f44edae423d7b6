//! Fragment: keeps at most `layers` fragments a pixel: accumulates, inserts, merges, evicts (Surface Splatting §6, ALGORITHM §6).
//!
//! ```text
//! weight, depth, attributes ─►[ match: unshaded, |z − z_f| < ε, nearest ]─┬─ found ─► accumulate: sums += weight · attributes
//!                                                                        ├─ slot free ─► insert
//!                                                                        └─ full ─► evict the deepest if something is hidden,
//!                                                        shade ◄── two fragments ──┘ else merge an adjacent pair, front over back
//! ```
//! Losses: each sum is rounded once per contribution and saturates; so is what a merge writes back, by the same fits.
//! A shaded slot keeps its premultiplied colour and its opacity where an unshaded one keeps their sums.
//!
//! Laws: `every_contribution_has_one_outcome`, `slots_are_in_depth_order_after_a_merge`.

use crate::machine::{Elaboration, FragmentDepth, Machine, Merge};
use crate::num::lanes::nearest_of;
use crate::num::{Exact, Fit, Lanes, Word, three};
use crate::probe::{Probe, Tap};

const UNIT: &str = "fragment";

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

/// A contribution's part that is the splat's: 1, r, g, b, α, n_x, n_y, n_z.
pub type Attributes = [i32; SUMS];

/// Input port: one contribution to one pixel, as watchers see it.
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

/// What became of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Added to the fragment in this slot.
    Accumulated(usize),
    /// Opened this free slot.
    Inserted(usize),
    /// Made two fragments merge: places in depth order, of `layers` + 1, of the front and the back one.
    Merged(usize, usize),
    /// Made the deepest fragment vanish behind an opaque one; `true` if it was the contribution itself.
    Evicted(bool),
    /// Replaced what was there (z-buffer).
    Replaced,
    /// Was dropped behind what was there (z-buffer).
    Dropped,
}

/// How often each [`Decision`] was taken.
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
    /// Contributions to the busiest pixel.
    pub most_in_a_pixel: u64,
}

impl Outcomes {
    /// Adds what another part of the frame counted.
    pub fn absorb(&mut self, other: &Outcomes) {
        self.accumulated += other.accumulated;
        self.inserted += other.inserted;
        self.merged += other.merged;
        self.evicted += other.evicted;
        self.replaced += other.replaced;
        self.dropped += other.dropped;
        self.most_in_a_pixel = self.most_in_a_pixel.max(other.most_in_a_pixel);
    }

    /// All contributions.
    pub fn total(&self) -> u64 {
        self.accumulated + self.inserted + self.merged + self.evicted + self.replaced + self.dropped
    }
}

/// Shade port, answer: a fragment's colour times its opacity, and its opacity (`shade.premultiplied`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Premultiplied {
    /// Colour times opacity.
    pub colour: [i64; 3],
    /// Opacity.
    pub opacity: i64,
}

/// The host's word for a sum: 32 bits where everything fits, else 64.
pub trait Lane: Copy + Default + Send + Sync + 'static {
    /// The unit's limits in this word.
    fn limits(unit: &Fragment) -> &Limits<Self>;
    /// Adds `weight · attributes`, each rounded, to sums that saturate.
    fn accumulate(sums: &mut [Self; SUMS], attributes: &Attributes, weight: i64, limits: &Limits<Self>);
    /// From a word that fits.
    fn put(word: i64) -> Self;
    /// The word.
    fn get(self) -> i64;
}

/// What an accumulation needs where all of its fits are plain, lane by lane.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits<L> {
    half: [L; SUMS],
    right: [L; SUMS],
    min: [L; SUMS],
    max: [L; SUMS],
}

impl<L: Lane> Limits<L> {
    fn new(half: [i64; SUMS], right: [u32; SUMS], words: [Word; SUMS]) -> Self {
        Limits {
            half: half.map(L::put),
            right: right.map(|right| L::put(right.into())),
            min: words.map(|word| L::put(word.format.min())),
            max: words.map(|word| L::put(word.format.max())),
        }
    }
}

impl Lane for i32 {
    fn limits(unit: &Fragment) -> &Limits<i32> {
        &unit.narrow_limits
    }
    #[inline(always)]
    fn accumulate(sums: &mut [i32; SUMS], attributes: &Attributes, weight: i64, limits: &Limits<i32>) {
        let weight = weight as i32;
        let mut next = [0; SUMS];
        for lane in 0..SUMS {
            let rounded = attributes[lane].wrapping_mul(weight).wrapping_add(limits.half[lane]) >> (limits.right[lane] & 31);
            next[lane] = sums[lane].wrapping_add(rounded).max(limits.min[lane]).min(limits.max[lane]);
        }
        *sums = next;
    }
    #[inline(always)]
    fn put(word: i64) -> i32 {
        word as i32
    }
    #[inline(always)]
    fn get(self) -> i64 {
        i64::from(self)
    }
}

impl Lane for i64 {
    fn limits(unit: &Fragment) -> &Limits<i64> {
        &unit.wide_limits
    }
    #[inline(always)]
    fn accumulate(sums: &mut [i64; SUMS], attributes: &Attributes, weight: i64, limits: &Limits<i64>) {
        for lane in 0..SUMS {
            let rounded = (i64::from(attributes[lane]) * weight + limits.half[lane]) >> (limits.right[lane] & 63);
            sums[lane] = (sums[lane] + rounded).max(limits.min[lane]).min(limits.max[lane]);
        }
    }
    #[inline(always)]
    fn put(word: i64) -> i64 {
        word
    }
    #[inline(always)]
    fn get(self) -> i64 {
        self
    }
}

/// No fragment can match this depth: it is farther than any ε from any depth word.
const NO_MATCH: i32 = i32::MIN;

/// The fragments of a tile's pixels; slot s of pixel p is entry `p · layers + s`.
#[derive(Clone, Debug)]
pub struct Tile<L> {
    layers: usize,
    sums: Vec<[L; SUMS]>,
    depth: Vec<i32>,
    /// Depth of an unshaded fragment, else [`NO_MATCH`]; slot s of pixel p is entry `p · stride + s`.
    key: Vec<i32>,
    /// 4 or 8, whatever holds the layers.
    stride: usize,
    material: Vec<u32>,
    live: [u8; TILE_AREA],
    contributions: [u32; TILE_AREA],
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

impl<L: Lane> Tile<L> {
    /// An empty tile.
    pub fn new(layers: usize) -> Self {
        let slots = TILE_AREA * layers;
        let stride = if layers <= 4 { 4 } else { 8 };
        Tile {
            layers,
            sums: vec![[L::default(); SUMS]; slots],
            depth: vec![0; slots],
            key: vec![NO_MATCH; TILE_AREA * stride],
            stride,
            material: vec![0; slots],
            live: [0; TILE_AREA],
            contributions: [0; TILE_AREA],
        }
    }

    /// Empties the tile.
    pub fn clear(&mut self) {
        self.live.fill(0);
        self.contributions.fill(0);
        self.key.fill(NO_MATCH);
    }

    /// How many contributions a pixel has had.
    pub fn contributions(&self, pixel: usize) -> u32 {
        self.contributions[pixel]
    }

    /// How many fragments a pixel has.
    pub fn live(&self, pixel: usize) -> usize {
        usize::from(self.live[pixel])
    }

    /// The fragment in a slot.
    pub fn slot(&self, pixel: usize, slot: usize) -> Slot {
        let at = pixel * self.layers + slot;
        Slot {
            sums: self.sums[at].map(L::get),
            depth: i64::from(self.depth[at]),
            material: self.material[at],
            shaded: self.key[pixel * self.stride + slot] == NO_MATCH,
        }
    }

    fn write(&mut self, pixel: usize, slot: usize, fragment: &Slot) {
        let at = pixel * self.layers + slot;
        self.sums[at] = fragment.sums.map(L::put);
        self.depth[at] = fragment.depth as i32;
        self.key[pixel * self.stride + slot] = if fragment.shaded { NO_MATCH } else { fragment.depth as i32 };
        self.material[at] = fragment.material;
    }
}

impl<L: Lane> Tile<L> {
    /// Moves the fragments from slot `from` on one slot back; the last is lost.
    fn shift_back(&mut self, pixel: usize, from: usize) {
        let slots = pixel * self.layers + from..(pixel + 1) * self.layers - 1;
        let to = slots.start + 1;
        self.sums.copy_within(slots.clone(), to);
        self.depth.copy_within(slots.clone(), to);
        self.material.copy_within(slots, to);
        let keys = pixel * self.stride + from..pixel * self.stride + self.layers - 1;
        let to = keys.start + 1;
        self.key.copy_within(keys, to);
    }
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Fragment {
    layers: usize,
    merge: Merge,
    evict_hidden: bool,
    nearest_depth: bool,
    depth: Fit,
    sums: [Fit; SUMS],
    /// Left shifts that align a sum and a product.
    align: [[u32; 2]; SUMS],
    narrow_limits: Limits<i32>,
    wide_limits: Limits<i64>,
    /// Whether 32-bit sums and products hold everything.
    narrow: bool,
    opaque: i64,
    opaque_frac_bits: u32,
    weight_frac_bits: u32,
    opacity_frac_bits: u32,
    /// Shaded words into the slot, and back.
    store: [Fit; 2],
    read: Fit,
    blend: [Fit; 2],
    premultiplied_frac_bits: u32,
}

/// Names of the sums' signals.
const SIGNALS: [&str; SUMS] =
    ["weight_sum", "colour_sum", "colour_sum", "colour_sum", "opacity_sum", "normal_sum", "normal_sum", "normal_sum"];

impl Fragment {
    /// Elaborates the unit; `depth` is the shape of the depth that arrives.
    pub fn new(e: &mut Elaboration, machine: &Machine, depth: Exact) -> Self {
        let m = &machine.fragment;
        let layers = e.within(UNIT, "layers", m.layers, 1, MAX_LAYERS as u32) as usize;
        e.require(m.merge != Merge::Replace || m.layers == 1, || {
            format!("fragment.merge is replace, a z-buffer, with {} layers: it needs fragment.layers 1", m.layers)
        });
        e.within(UNIT, "opaque_permille", m.opaque_permille, 1, 1000);
        e.port(UNIT, "normal", m.normal);
        e.signedness(UNIT, "normal", m.normal, true);
        e.holds_one(UNIT, "normal", m.normal);
        e.port(UNIT, "opaque", m.opaque);
        e.holds_one(UNIT, "opaque", m.opaque);
        e.signedness(UNIT, "depth", m.depth, false);
        e.saturates(UNIT, "depth", m.depth);
        e.require(m.depth.format.width() <= 30, || {
            format!("fragment.depth is {}, {} bits: the depth comparators take at most 30", m.depth, m.depth.format.width())
        });
        for (name, word, signed) in [
            ("weight_sum", m.weight_sum, false),
            ("colour_sum", m.colour_sum, false),
            ("opacity_sum", m.opacity_sum, false),
            ("normal_sum", m.normal_sum, true),
        ] {
            e.signedness(UNIT, name, word, signed);
        }
        let s = &machine.splat;
        let one = Word::new(crate::num::Format::unsigned(1, 0));
        let attributes = [one, s.rgb, s.rgb, s.rgb, s.opacity, m.normal, m.normal, m.normal];
        let words = [m.weight_sum, m.colour_sum, m.colour_sum, m.colour_sum, m.opacity_sum, m.normal_sum, m.normal_sum, m.normal_sum];
        let products: [Exact; SUMS] = std::array::from_fn(|lane| {
            if lane == WEIGHT { machine.gauss.weight.into() } else { e.times(UNIT, machine.gauss.weight, attributes[lane]) }
        });
        let sums: [Fit; SUMS] = std::array::from_fn(|lane| e.fit(UNIT, SIGNALS[lane], words[lane], products[lane].plus(words[lane])));
        let align = std::array::from_fn(|lane| {
            let (sum, product) = (words[lane].format.frac_bits, products[lane].frac_bits);
            [(product - sum).clamp(0, 62) as u32, (sum - product).clamp(0, 62) as u32]
        });
        let premultiplied = machine.shade.premultiplied;
        let shaded = Exact::from(premultiplied);
        let over = e.times(UNIT, premultiplied, premultiplied).plus(shaded);
        // Compared in 128 bits: Σw·α with the opacity limit times Σw.
        let limit = e.times(UNIT, m.opaque, m.weight_sum);
        let compared = limit.plus(m.opacity_sum).bits();
        e.require(compared <= 126, || {
            format!(
                "fragment.opacity_sum {} is compared with fragment.opaque · fragment.weight_sum in {compared} bits: 126 can be held",
                m.opacity_sum
            )
        });
        let half = sums.map(|fit| fit.half());
        let right = align.map(|[right, _]: [u32; 2]| right);
        Fragment {
            layers,
            merge: m.merge,
            evict_hidden: m.evict_hidden,
            nearest_depth: m.fragment_depth == FragmentDepth::Nearest,
            depth: e.fit(UNIT, "depth", m.depth, depth),
            narrow_limits: Limits::new(half, right, words),
            wide_limits: Limits::new(half, right, words),
            narrow: (0..SUMS).all(|lane| is_narrow(machine.gauss.weight, attributes[lane], words[lane], &sums[lane])),
            sums,
            align,
            opaque: (i128::from(m.opaque.format.one()) * i128::from(m.opaque_permille) / 1000) as i64,
            opaque_frac_bits: m.opaque.format.frac_bits as u32,
            weight_frac_bits: m.weight_sum.format.frac_bits as u32,
            opacity_frac_bits: m.opacity_sum.format.frac_bits as u32,
            store: [e.fit(UNIT, "colour_sum", m.colour_sum, shaded), e.fit(UNIT, "opacity_sum", m.opacity_sum, shaded)],
            read: e.fit("shade", "premultiplied", premultiplied, m.colour_sum.into()),
            blend: [e.fit(UNIT, "colour_sum", m.colour_sum, over), e.fit(UNIT, "opacity_sum", m.opacity_sum, over)],
            premultiplied_frac_bits: premultiplied.format.frac_bits as u32,
        }
    }

    /// Whether all of its hot fits are plain.
    pub fn is_plain(&self) -> bool {
        let short = |fit: &Fit| fit.is_plain() && fit.places() < 32;
        self.sums.iter().all(short) && self.align.iter().all(|[_, left]| *left == 0)
    }

    /// Whether 32-bit sums and products hold everything.
    pub fn is_narrow(&self) -> bool {
        self.narrow
    }

    /// The fit of a depth.
    pub fn depth_fit(&self) -> &Fit {
        &self.depth
    }

    /// Depths as the comparators see them.
    #[inline(always)]
    pub fn depth<V: Lanes, P: Probe>(&self, exact: V, tap: &mut Tap<P>) -> V {
        tap.fit(&self.depth, exact)
    }

    /// Takes one contribution in.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the ports of the unit, one by one")]
    pub fn contribute<const PLAIN: bool, V: Lanes, L: Lane, P: Probe>(
        &self,
        tile: &mut Tile<L>,
        pixel: usize,
        [weight, depth]: [i64; 2],
        attributes: &Attributes,
        material: u32,
        registers: &Registers,
        shade: impl FnMut(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Decision {
        tile.contributions[pixel] += 1;
        let first_key = pixel * tile.stride;
        let z_threshold = registers.z_threshold as u32;
        // The keys of a pixel are 4 or 8, whatever holds the layers; the rest never match.
        let (distance, slot) = match tile.key[first_key..first_key + tile.stride].as_array::<4>() {
            Some(keys) => V::nearest_of_4(keys, depth as i32),
            None => tile.key[first_key..].first_chunk().map_or((u32::MAX, 0), |keys: &[i32; 8]| nearest_of(keys, depth as i32)),
        };
        if distance < z_threshold {
            let at = pixel * self.layers + slot;
            self.accumulate::<PLAIN, L, P>(&mut tile.sums[at], weight, attributes, tap);
            if self.nearest_depth {
                tile.depth[at] = tile.depth[at].min(depth as i32);
                tile.key[first_key + slot] = tile.depth[at];
            }
            return Decision::Accumulated(slot);
        }
        let mut sums = [L::default(); SUMS];
        self.accumulate::<PLAIN, L, P>(&mut sums, weight, attributes, tap);
        let fresh = Slot { sums: sums.map(L::get), depth, material, shaded: false };
        let live = usize::from(tile.live[pixel]);
        if live < self.layers {
            tile.write(pixel, live, &fresh);
            tile.live[pixel] += 1;
            return Decision::Inserted(live);
        }
        self.overflow(tile, pixel, fresh, registers, shade, tap)
    }

    #[inline(always)]
    fn accumulate<const PLAIN: bool, L: Lane, P: Probe>(
        &self,
        sums: &mut [L; SUMS],
        weight: i64,
        attributes: &Attributes,
        tap: &mut Tap<P>,
    ) {
        if PLAIN && !P::WORDS {
            return L::accumulate(sums, attributes, weight, L::limits(self));
        }
        for lane in 0..SUMS {
            let [of_sum, of_product] = self.align[lane];
            let exact = (sums[lane].get() << of_sum) + ((i64::from(attributes[lane]) * weight) << of_product);
            sums[lane] = L::put(tap.fit_one(&self.sums[lane], exact));
        }
    }

    /// One fragment too many: replace, evict or merge.
    #[cold]
    #[inline(never)]
    fn overflow<L: Lane, P: Probe>(
        &self,
        tile: &mut Tile<L>,
        pixel: usize,
        fresh: Slot,
        registers: &Registers,
        shade: impl FnMut(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Decision {
        if self.merge == Merge::Replace {
            let nearer = fresh.depth < tile.slot(pixel, 0).depth;
            if nearer {
                tile.write(pixel, 0, &fresh);
            }
            return if nearer { Decision::Replaced } else { Decision::Dropped };
        }
        self.sort(tile, pixel);
        // Stable: the fresh one comes after its equals.
        let first = pixel * self.layers;
        let place = tile.depth[first..first + self.layers].iter().filter(|&&depth| i64::from(depth) <= fresh.depth).count();
        if self.evict_hidden && self.hides(tile, pixel, &fresh, place, registers) {
            if place < self.layers {
                tile.shift_back(pixel, place);
                tile.write(pixel, place, &fresh);
            }
            return Decision::Evicted(place == self.layers);
        }
        let mut stack = [Slot::default(); MAX_LAYERS + 1];
        for (position, fragment) in stack[..=self.layers].iter_mut().enumerate() {
            *fragment = if position == place { fresh } else { tile.slot(pixel, position - usize::from(position > place)) };
        }
        let stack = &mut stack[..=self.layers];
        let front = self.pair(stack);
        let merged = self.merged(&stack[front], &stack[front + 1], shade, tap);
        stack[front] = merged;
        stack[front + 1..].rotate_left(1);
        self.write_all(tile, pixel, &stack[..self.layers]);
        Decision::Merged(front, front + 1)
    }

    /// Brings a full pixel's slots into depth order; after the first overflow they stay in it.
    fn sort<L: Lane>(&self, tile: &mut Tile<L>, pixel: usize) {
        let first = pixel * self.layers;
        if tile.depth[first..first + self.layers].is_sorted() {
            return;
        }
        let mut stack = [Slot::default(); MAX_LAYERS];
        for (slot, fragment) in stack[..self.layers].iter_mut().enumerate() {
            *fragment = tile.slot(pixel, slot);
        }
        stack[..self.layers].sort_by_key(|fragment| fragment.depth);
        self.write_all(tile, pixel, &stack[..self.layers]);
    }

    /// Whether one of the fragments, the fresh one at its place among them, hides the deepest.
    fn hides<L: Lane>(&self, tile: &Tile<L>, pixel: usize, fresh: &Slot, place: usize, registers: &Registers) -> bool {
        let in_front = self.layers - usize::from(place < self.layers);
        let of_slot = |slot: usize| {
            let at = pixel * self.layers + slot;
            let shaded = tile.key[pixel * tile.stride + slot] == NO_MATCH;
            self.is_opaque(tile.sums[at][WEIGHT].get(), tile.sums[at][OPACITY].get(), shaded, registers)
        };
        (0..in_front).any(of_slot) || place < self.layers && self.is_opaque(fresh.sums[WEIGHT], fresh.sums[OPACITY], false, registers)
    }

    fn write_all<L: Lane>(&self, tile: &mut Tile<L>, pixel: usize, stack: &[Slot]) {
        for (slot, fragment) in stack.iter().enumerate() {
            tile.write(pixel, slot, fragment);
        }
    }

    /// The nearer of the two to merge, in a stack in depth order.
    fn pair(&self, stack: &[Slot]) -> usize {
        match self.merge {
            Merge::NearestPair => {
                // The first of equals: the pair nearer to the eye.
                (0..self.layers).min_by_key(|&i| stack[i + 1].depth - stack[i].depth).unwrap_or(0)
            }
            _ => self.layers - 1,
        }
    }

    /// Whether nothing behind a fragment can be seen: opaque itself, and covering the pixel.
    fn is_opaque(&self, weight: i64, opacity: i64, shaded: bool, registers: &Registers) -> bool {
        if shaded {
            return i128::from(opacity) << self.opaque_frac_bits >= i128::from(self.opaque) << self.opacity_frac_bits;
        }
        let of_weight = (i128::from(self.opaque) * i128::from(weight)) << self.opacity_frac_bits;
        weight >= registers.coverage_threshold && i128::from(opacity) << (self.opaque_frac_bits + self.weight_frac_bits) >= of_weight
    }

    /// Front over back, at the front's depth.
    fn merged<P: Probe>(
        &self,
        front: &Slot,
        back: &Slot,
        mut shade: impl FnMut(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Slot {
        let mut light = |fragment: &Slot, tap: &mut Tap<P>| {
            if fragment.shaded {
                return self.shaded(fragment, tap);
            }
            // A shaded fragment lives in a slot: what a slot cannot hold is lost before the blend, as after it.
            let Premultiplied { colour, opacity } = shade(fragment, tap);
            let mut stored = *fragment;
            for (channel, colour) in colour.into_iter().enumerate() {
                stored.sums[COLOUR + channel] = tap.fit_one(&self.store[0], colour);
            }
            stored.sums[OPACITY] = tap.fit_one(&self.store[1], opacity);
            self.shaded(&stored, tap)
        };
        let (over, under) = (light(front, tap), light(back, tap));
        let one = 1 << self.premultiplied_frac_bits;
        let blend = |over: i64, under: i64, front: i64| (over << self.premultiplied_frac_bits) + under * (one - front);
        let mut sums = [0; SUMS];
        for channel in 0..3 {
            let exact = blend(over.colour[channel], under.colour[channel], over.opacity);
            sums[COLOUR + channel] = tap.fit_one(&self.blend[0], exact);
        }
        sums[OPACITY] = tap.fit_one(&self.blend[1], blend(over.opacity, under.opacity, over.opacity));
        Slot { sums, depth: front.depth, material: front.material, shaded: true }
    }

    /// What a shaded slot holds.
    pub fn shaded<P: Probe>(&self, fragment: &Slot, tap: &mut Tap<P>) -> Premultiplied {
        let s = &fragment.sums;
        Premultiplied {
            colour: three!(channel => tap.fit_one(&self.read, s[COLOUR + channel])),
            opacity: tap.fit_one_shifted(&self.read, s[OPACITY], i64::from(self.opacity_frac_bits) - self.colour_frac_bits()),
        }
    }

    fn colour_frac_bits(&self) -> i64 {
        i64::from(self.sums[COLOUR].word.format.frac_bits)
    }
}

/// Registers that a frame loads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Registers {
    /// ε (`fragment.depth`).
    pub z_threshold: i64,
    /// τ (`fragment.weight_sum`).
    pub coverage_threshold: i64,
}

/// Whether 32 bits hold a lane's product, its rounding and its sum.
fn is_narrow(weight: Word, attribute: Word, sum: Word, fit: &Fit) -> bool {
    let most = i128::from(weight.format.max()) * i128::from(attribute.format.max()) + i128::from(fit.half());
    let least = i128::from(weight.format.max()) * i128::from(attribute.format.min());
    let held = i128::from(i32::MIN)..=i128::from(i32::MAX);
    let right = fit.places().clamp(0, 62);
    let sums = [sum.format.max(), sum.format.min()].map(i128::from);
    held.contains(&most)
        && held.contains(&least)
        && held.contains(&(sums[0] + (most >> right)))
        && held.contains(&(sums[1] + (least >> right)))
        && right < 32
}

impl Outcomes {
    /// Counts one.
    #[inline(always)]
    pub fn count(&mut self, decision: Decision) {
        match decision {
            Decision::Accumulated(_) => self.accumulated += 1,
            Decision::Inserted(_) => self.inserted += 1,
            Decision::Merged(..) => self.merged += 1,
            Decision::Evicted(_) => self.evicted += 1,
            Decision::Replaced => self.replaced += 1,
            Decision::Dropped => self.dropped += 1,
        }
    }
}

pub mod real;

#[cfg(test)]
mod tests;
