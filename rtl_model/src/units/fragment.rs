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

use crate::machine::{Elaboration, FragmentDepth, Machine, Merge, Operator};
use crate::num::{Exact, Fit, Lanes, Seen, Word, Words, three};
use crate::probe::{Probe, Tap};
use sheets::Sheets;
use std::cmp::Ordering;

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
    Accumulated(u8),
    /// Opened this free slot.
    Inserted(u8),
    /// Made two fragments merge: places in depth order, of `layers` + 1, of the front and the back one.
    Merged(u8, u8),
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

/// [`Sums`] in the host's words, side by side in one vector register where they are 32 bits.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub struct HostSums<L>([L; SUMS]);

impl<L: Lane> HostSums<L> {
    fn put(sums: &Sums) -> Self {
        HostSums(sums.map(L::put))
    }

    fn get(&self) -> Sums {
        self.0.map(L::get)
    }
}

/// The host's word for a sum: 32 bits where everything fits, else 64.
pub trait Lane: Copy + Default + Send + Sync + 'static {
    /// The unit's limits in this word.
    fn limits(unit: &Fragment) -> &Limits<Self>;
    /// Adds `weight · attributes`, each rounded, to sums that saturate. For whoever watches, where words of 31 bits hold all: what was
    /// seen.
    fn accumulate<V: Lanes>(
        sums: &mut HostSums<Self>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<Self>,
    ) -> Option<Seen<V::Words>>;
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
    fn accumulate<V: Lanes>(
        sums: &mut HostSums<i32>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<i32>,
    ) -> Option<Seen<V::Words>> {
        let Limits { half, right, min, max } = limits;
        let unlimited = V::add_product(&mut sums.0, attributes, weight as i32, half, right, [min, max]);
        let words = V::Words::from_array(sums.0);
        Some(Seen { words, limited: !(unlimited - words).is_zero().signs() })
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
    fn accumulate<V: Lanes>(
        HostSums(sums): &mut HostSums<i64>,
        attributes: &Attributes,
        weight: i64,
        limits: &Limits<i64>,
    ) -> Option<Seen<V::Words>> {
        // Words of at most 32 bits each: one multiplication.
        let weight = weight as i32;
        for lane in 0..SUMS {
            let product = i64::from(attributes[lane]) * i64::from(weight);
            let rounded = (product + limits.half[lane]) >> (limits.right[lane] & 63);
            sums[lane] = (sums[lane] + rounded).max(limits.min[lane]).min(limits.max[lane]);
        }
        None
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

/// Set in the key of a slot that is shaded or empty: its depth is then farther than any ε from any depth word.
const NO_MATCH: i32 = i32::MIN;
/// Widest depth that the comparators take, bits.
const MAX_DEPTH_BITS: i32 = 30;

/// The fragments of a tile's pixels.
#[derive(Clone, Debug)]
pub struct Tile<L> {
    /// Depth of each slot of each pixel, with [`NO_MATCH`] where it is not to be matched.
    keys: [[i32; MAX_LAYERS]; TILE_AREA],
    /// Slot by slot: those in use lie side by side in the cache.
    sums: [[HostSums<L>; TILE_AREA]; MAX_LAYERS],
    material: [[u32; TILE_AREA]; MAX_LAYERS],
    live: [u8; TILE_AREA],
    contributions: [u32; TILE_AREA],
}

impl<L: Lane> Default for Tile<L> {
    fn default() -> Self {
        Tile {
            keys: [[NO_MATCH; MAX_LAYERS]; TILE_AREA],
            sums: [[HostSums::default(); TILE_AREA]; MAX_LAYERS],
            material: [[0; TILE_AREA]; MAX_LAYERS],
            live: [0; TILE_AREA],
            contributions: [0; TILE_AREA],
        }
    }
}

/// A slot's number, as the host is to see it: never beyond the last.
#[inline(always)]
fn within(slot: usize) -> usize {
    slot % MAX_LAYERS
}

impl<L: Lane> Tile<L> {
    /// Empties the tile.
    pub fn clear(&mut self) {
        self.live.fill(0);
        self.contributions.fill(0);
        self.keys.fill([NO_MATCH; MAX_LAYERS]);
    }

    /// How many contributions a pixel has had.
    pub fn contributions(&self, pixel: u8) -> u32 {
        self.contributions[usize::from(pixel)]
    }

    /// How many fragments a pixel has.
    pub fn live(&self, pixel: u8) -> usize {
        usize::from(self.live[usize::from(pixel)])
    }

    /// The fragment in a slot.
    pub fn slot(&self, pixel: u8, slot: usize) -> Slot {
        self.read(pixel, slot).get()
    }

    #[inline(always)]
    fn sums(&self, pixel: u8, slot: usize) -> &HostSums<L> {
        &self.sums[within(slot)][usize::from(pixel)]
    }

    #[inline(always)]
    fn key(&self, pixel: u8, slot: usize) -> i32 {
        self.keys[usize::from(pixel)][within(slot)]
    }

    #[inline(always)]
    fn depth(&self, pixel: u8, slot: usize) -> i32 {
        self.key(pixel, slot) & !NO_MATCH
    }

    #[inline(always)]
    fn read(&self, pixel: u8, slot: usize) -> HostSlot<L> {
        let material = self.material[within(slot)][usize::from(pixel)];
        HostSlot { sums: *self.sums(pixel, slot), key: self.key(pixel, slot), material }
    }

    #[inline(always)]
    fn write(&mut self, pixel: u8, slot: usize, fragment: HostSlot<L>) {
        let (slot, pixel) = (within(slot), usize::from(pixel));
        self.sums[slot][pixel] = fragment.sums;
        self.keys[pixel][slot] = fragment.key;
        self.material[slot][pixel] = fragment.material;
    }

    #[inline(always)]
    fn copy(&mut self, pixel: u8, from: usize, to: usize) {
        self.write(pixel, to, self.read(pixel, from));
    }
}

/// A fragment outside its slot, in the host's words.
#[derive(Clone, Copy, Debug, Default)]
struct HostSlot<L> {
    sums: HostSums<L>,
    key: i32,
    material: u32,
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

impl<L: Lane> HostSlot<L> {
    fn get(&self) -> Slot {
        Slot { sums: self.sums.get(), depth: i64::from(self.key & !NO_MATCH), material: self.material, shaded: self.key < 0 }
    }

    fn put(slot: &Slot) -> Self {
        let key = slot.depth as i32 | if slot.shaded { NO_MATCH } else { 0 };
        HostSlot { sums: HostSums::put(&slot.sums), key, material: slot.material }
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
    /// Factors that bring Σw·α and Σw times the opacity limit to the same places.
    opaque_scales: [i128; 2],
    /// Least opacity of a shaded fragment that is opaque.
    opaque_shaded: i64,
    /// Shaded words into the slot, and back.
    store: [Fit; 2],
    read: [Fit; 2],
    blend: [Fit; 2],
    premultiplied_frac_bits: u32,
    sheets: Option<Sheets>,
    /// Of a contribution's weight.
    weight_frac_bits: u32,
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
        e.require(m.depth.format.width() <= MAX_DEPTH_BITS, || {
            format!("fragment.depth is {}, {} bits: the depth comparators take at most {MAX_DEPTH_BITS}", m.depth, m.depth.format.width())
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
            if lane == WEIGHT { machine.gauss.weight.into() } else { e.per_lane(|e| e.times(UNIT, machine.gauss.weight, attributes[lane])) }
        });
        let sums: [Fit; SUMS] = std::array::from_fn(|lane| {
            e.per_lane(|e| {
                let sum = e.sum(UNIT, [products[lane], words[lane].into()]);
                e.fit(UNIT, SIGNALS[lane], words[lane], sum)
            })
        });
        let slot = machine.fragment_bits();
        e.per_lane(|e| {
            // All slots, as they are read and as they are written.
            e.copies(2 * layers as u32, |e| e.part(UNIT, Operator::Register(slot)));
            if m.sheets.is_some() {
                // A sheet's number against the open one's; each slot stays, is added to, or is begun.
                e.adders(UNIT, 1, m.depth.format.width());
                e.copies(layers as u32, |e| e.choice(UNIT, 3, slot));
            } else {
                Fragment::sorter(e, machine, layers as u32, slot);
            }
        });
        let align = std::array::from_fn(|lane| {
            let (sum, product) = (words[lane].format.frac_bits, products[lane].frac_bits);
            [(product - sum).clamp(0, 62) as u32, (sum - product).clamp(0, 62) as u32]
        });
        let premultiplied = machine.shade.premultiplied;
        let shaded = Exact::from(premultiplied);
        let over = e.copies(4, |e| {
            let product = e.times(UNIT, premultiplied, premultiplied);
            e.sum(UNIT, [product, shaded])
        });
        let light = premultiplied.format.width();
        // 1 less the front's opacity; lights of the front, of the back and of what is handed on, shaded before or now.
        e.adders(UNIT, 1, light);
        e.copies(2 * 4, |e| e.choice(UNIT, 2, light));
        e.choice(UNIT, layers as u32, slot);
        // Compared in 128 bits: Σw·α with the opacity limit times Σw.
        let limit = Exact::from(m.opaque).times(m.weight_sum);
        let compared = limit.plus(m.opacity_sum).bits();
        e.require(compared <= 126, || {
            format!(
                "fragment.opacity_sum {} is compared with fragment.opaque · fragment.weight_sum in {compared} bits: 126 can be held",
                m.opacity_sum
            )
        });
        let opaque = i128::from(m.opaque.format.one()) * i128::from(m.opaque_permille) / 1000;
        let (limit_places, opacity_places) = (limit.frac_bits, m.opacity_sum.format.frac_bits);
        let half = sums.map(|fit| fit.half());
        let right = align.map(|[right, _]: [u32; 2]| right);
        Fragment {
            layers,
            merge: m.merge,
            evict_hidden: m.evict_hidden,
            nearest_depth: m.fragment_depth == FragmentDepth::Nearest,
            depth: e.per_lane(|e| e.fit(UNIT, "depth", m.depth, depth)),
            narrow_limits: Limits::new(half, right, words),
            wide_limits: Limits::new(half, right, words),
            narrow: (0..SUMS).all(|lane| is_narrow(machine.gauss.weight, attributes[lane], words[lane], &sums[lane])),
            sums,
            align,
            opaque_scales: [1 << (limit_places - opacity_places).max(0), opaque << (opacity_places - limit_places).max(0)],
            opaque_shaded: -((-opaque << opacity_places) >> m.opaque.format.frac_bits) as i64,
            store: [e.copies(3, |e| e.fit(UNIT, "colour_sum", m.colour_sum, shaded)), e.fit(UNIT, "opacity_sum", m.opacity_sum, shaded)],
            read: [(3, m.colour_sum), (1, m.opacity_sum)]
                .map(|(copies, sum)| e.copies(copies, |e| e.fit("shade", "premultiplied", premultiplied, sum.into()))),
            blend: [e.copies(3, |e| e.fit(UNIT, "colour_sum", m.colour_sum, over)), e.fit(UNIT, "opacity_sum", m.opacity_sum, over)],
            premultiplied_frac_bits: premultiplied.format.frac_bits as u32,
            sheets: Sheets::new(e, machine),
            weight_frac_bits: machine.gauss.weight.format.frac_bits.max(0) as u32,
        }
    }

    /// What finds a contribution's slot, or makes room for it: all slots and the fresh one are ranked, for any of them may be evicted.
    fn sorter(e: &mut Elaboration, machine: &Machine, layers: u32, slot: i32) {
        let m = &machine.fragment;
        let (depth, weight) = (m.depth.format.width(), m.weight_sum.format.width());
        let places = layers + 1;
        // |z − z_f| < ε against every slot, and the nearest of them: accumulated.
        e.copies(layers, |e| {
            e.adders(UNIT, 3, depth);
            e.choice(UNIT, 2, depth);
        });
        e.copies(layers - 1, |e| e.limit(UNIT, depth));
        e.choice(UNIT, layers, slot);
        // Each against each: which is in front; each place takes one of them.
        e.adders(UNIT, places * layers / 2, depth);
        e.copies(places, |e| e.choice(UNIT, places, slot));
        // Whether one is opaque: Σw against what covers, Σw·α against Σw times a constant.
        let limit = Exact::from(m.opaque).times(m.weight_sum).bits();
        e.copies(places, |e| {
            e.adders(UNIT, 1, weight);
            e.adders(UNIT, 2, limit);
        });
        // The closest pair.
        if m.merge == Merge::NearestPair {
            e.adders(UNIT, layers, depth);
            e.copies(layers - 1, |e| e.limit(UNIT, depth));
            e.choice(UNIT, layers, slot);
            e.copies(layers, |e| e.choice(UNIT, 2, slot));
        }
        // Written: the sums, the merged one, or what has this place now.
        e.copies(layers, |e| e.choice(UNIT, 3, slot));
    }

    /// Whether all of its hot fits are plain.
    pub fn is_plain(&self) -> bool {
        let short = |fit: &Fit| fit.is_plain() && fit.places() < 32;
        self.depth.is_plain() && self.sums.iter().all(short) && self.align.iter().all(|[_, left]| *left == 0)
    }

    /// Whether 32-bit sums and products hold everything.
    pub fn is_narrow(&self) -> bool {
        self.narrow
    }

    /// The opacity (`fragment.opacity_sum`) from which a shaded fragment counts as opaque.
    pub fn opaque_shaded(&self) -> i64 {
        self.opaque_shaded
    }

    /// Signals of its sums.
    pub fn sum_signals(&self) -> [usize; SUMS] {
        self.sums.map(|fit| fit.signal)
    }

    /// The fit of a depth.
    pub fn depth_fit(&self) -> &Fit {
        &self.depth
    }

    /// Depths as the comparators see them. Nobody but a watcher can tell what lies below 0 from 0.
    #[inline(always)]
    pub fn depth<const PLAIN: bool, V: Lanes, P: Probe>(&self, exact: V, tap: &mut Tap<P>) -> V {
        if P::WORDS { tap.fit(&self.depth, exact) } else { tap.fit_natural::<PLAIN, V>(&self.depth, exact.max(V::splat(0))) }
    }

    /// Takes one contribution in. Its material is not read unless it opens a fragment.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the ports of the unit, one by one")]
    pub fn contribute<const PLAIN: bool, V: Lanes, L: Lane, P: Probe>(
        &self,
        tile: &mut Tile<L>,
        pixel: u8,
        [weight, depth]: [i64; 2],
        attributes: &Attributes,
        material: &u32,
        registers: &Registers,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Decision {
        let at = usize::from(pixel);
        tile.contributions[at] += 1;
        let key = depth as i32;
        let near = V::near(&tile.keys[at], key, registers.z_threshold as u32);
        if near != 0 {
            // Rarely more than one.
            let several = near & (near - 1) != 0;
            let slot = within(if several { V::nearest(&tile.keys[at], key) } else { near.trailing_zeros() as usize });
            self.accumulate::<PLAIN, V, L, P>(&mut tile.sums[slot][at], weight, attributes, tap);
            if self.nearest_depth {
                tile.keys[at][slot] = tile.keys[at][slot].min(key);
            }
            return Decision::Accumulated(slot as u8);
        }
        let mut fresh = HostSlot { sums: HostSums::default(), key, material: *material };
        self.accumulate::<PLAIN, V, L, P>(&mut fresh.sums, weight, attributes, tap);
        let live = tile.live[at];
        if usize::from(live) < self.layers {
            tile.write(pixel, usize::from(live), fresh);
            tile.live[at] += 1;
            return Decision::Inserted(live);
        }
        self.overflow(tile, pixel, &fresh, registers, shade, tap.probe)
    }

    #[inline(always)]
    fn accumulate<const PLAIN: bool, V: Lanes, L: Lane, P: Probe>(
        &self,
        sums: &mut HostSums<L>,
        weight: i64,
        attributes: &Attributes,
        tap: &mut Tap<P>,
    ) {
        if PLAIN && (!P::WORDS || P::EIGHT) {
            let before = *sums;
            match L::accumulate::<V>(sums, attributes, weight, L::limits(self)) {
                Some(seen) if P::WORDS => return tap.probe.sums(seen),
                _ if !P::WORDS => return,
                _ => *sums = before,
            }
        }
        self.accumulate_one_by_one(sums, weight, attributes, tap);
    }

    fn accumulate_one_by_one<L: Lane, P: Probe>(&self, sums: &mut HostSums<L>, weight: i64, attributes: &Attributes, tap: &mut Tap<P>) {
        for (lane, sum) in sums.0.iter_mut().enumerate() {
            let [of_sum, of_product] = self.align[lane];
            let exact = (sum.get() << of_sum) + ((i64::from(attributes[lane]) * weight) << of_product);
            *sum = L::put(tap.fit_one(&self.sums[lane], exact));
        }
    }

    /// One fragment too many: replace, evict or merge.
    #[cold]
    #[inline(never)]
    fn overflow<L: Lane, P: Probe>(
        &self,
        tile: &mut Tile<L>,
        pixel: u8,
        fresh: &HostSlot<L>,
        registers: &Registers,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        probe: &mut P,
    ) -> Decision {
        if self.merge == Merge::Replace {
            let nearer = fresh.key < tile.depth(pixel, 0);
            if nearer {
                tile.write(pixel, 0, *fresh);
            }
            return if nearer { Decision::Replaced } else { Decision::Dropped };
        }
        self.sort(tile, pixel);
        // Stable: the fresh one comes after its equals.
        let behind = tile.keys[usize::from(pixel)][..self.layers].iter().position(|key| key & !NO_MATCH > fresh.key);
        let place = behind.unwrap_or(self.layers);
        if self.evict_hidden && self.hides(tile, pixel, fresh, place, registers) {
            if place < self.layers {
                (place..self.layers - 1).rev().for_each(|slot| tile.copy(pixel, slot, slot + 1));
                tile.write(pixel, place, *fresh);
            }
            return Decision::Evicted(place == self.layers);
        }
        let stacked = |position: usize, tile: &Tile<L>| match position.cmp(&place) {
            Ordering::Less => tile.read(pixel, position),
            Ordering::Equal => *fresh,
            Ordering::Greater => tile.read(pixel, position - 1),
        };
        let front = self.front_of_pair(|position| stacked(position, tile).key & !NO_MATCH);
        let [over, under] = [stacked(front, tile), stacked(front + 1, tile)];
        let merged = self.merged(&over.get(), &under.get(), shade, &mut Tap::new(probe));
        // The slots between the pair and the fresh one's place move over by one.
        if place < front {
            (place..front - 1).rev().for_each(|slot| tile.copy(pixel, slot, slot + 1));
            tile.write(pixel, place, *fresh);
        } else if place > front + 1 {
            (front + 2..place).for_each(|slot| tile.copy(pixel, slot, slot - 1));
            tile.write(pixel, place - 1, *fresh);
        }
        tile.write(pixel, front, HostSlot::put(&merged));
        Decision::Merged(front as u8, front as u8 + 1)
    }

    /// Brings a full pixel's slots into depth order; after the first overflow they stay in it.
    #[inline(always)]
    fn sort<L: Lane>(&self, tile: &mut Tile<L>, pixel: u8) {
        if !tile.keys[usize::from(pixel)][..self.layers].is_sorted_by_key(|key| key & !NO_MATCH) {
            let mut stack = [HostSlot::default(); MAX_LAYERS];
            let stack = &mut stack[..self.layers];
            stack.iter_mut().enumerate().for_each(|(slot, fragment)| *fragment = tile.read(pixel, slot));
            stack.sort_by_key(|fragment| fragment.key & !NO_MATCH);
            stack.iter().enumerate().for_each(|(slot, fragment)| tile.write(pixel, slot, *fragment));
        }
    }

    /// Whether one of the fragments, the fresh one at its place among them, hides the deepest.
    #[inline(always)]
    fn hides<L: Lane>(&self, tile: &Tile<L>, pixel: u8, fresh: &HostSlot<L>, place: usize, registers: &Registers) -> bool {
        let in_front = self.layers - usize::from(place < self.layers);
        (0..in_front).any(|slot| self.is_opaque(tile.sums(pixel, slot), tile.key(pixel, slot), registers))
            || place < self.layers && self.is_opaque(&fresh.sums, fresh.key, registers)
    }

    /// The nearer of the two to merge, in a stack in depth order.
    fn front_of_pair(&self, depth: impl Fn(usize) -> i32) -> usize {
        match self.merge {
            // The first of equals: the pair nearer to the eye.
            Merge::NearestPair => (0..self.layers).min_by_key(|&i| depth(i + 1) - depth(i)).unwrap_or(0),
            _ => self.layers - 1,
        }
    }

    /// Whether nothing behind a fragment can be seen: opaque itself, and covering the pixel.
    #[inline(always)]
    fn is_opaque<L: Lane>(&self, sums: &HostSums<L>, key: i32, registers: &Registers) -> bool {
        let [weight, opacity] = [sums.0[WEIGHT].get(), sums.0[OPACITY].get()];
        if key < 0 {
            return opacity >= self.opaque_shaded;
        }
        let [of_opacity, of_weight] = self.opaque_scales;
        weight >= registers.coverage_threshold && i128::from(opacity) * of_opacity >= i128::from(weight) * of_weight
    }

    /// Front over back, at the front's depth.
    fn merged<P: Probe>(&self, front: &Slot, back: &Slot, shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied, tap: &mut Tap<P>) -> Slot {
        let light = |fragment: &Slot, tap: &mut Tap<P>| {
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
        Slot { sums: self.blended(&over, &under, tap), depth: front.depth, material: front.material, shaded: true }
    }

    /// Front over back.
    fn blended<P: Probe>(&self, over: &Premultiplied, under: &Premultiplied, tap: &mut Tap<P>) -> Sums {
        let one = 1 << self.premultiplied_frac_bits;
        let blend = |over: i64, under: i64, front: i64| (over << self.premultiplied_frac_bits) + under * (one - front);
        let mut sums = [0; SUMS];
        for channel in 0..3 {
            let exact = blend(over.colour[channel], under.colour[channel], over.opacity);
            sums[COLOUR + channel] = tap.fit_one(&self.blend[0], exact);
        }
        sums[OPACITY] = tap.fit_one(&self.blend[1], blend(over.opacity, under.opacity, over.opacity));
        sums
    }

    /// One splat, of weight 1 and opaque, as if it were a fragment: what is lit before it is drawn.
    pub fn emitting<P: Probe>(&self, rgb: [i32; 3], normal: [i32; 3], material: u32, tap: &mut Tap<P>) -> Slot {
        let attributes: Attributes = [1, rgb[0], rgb[1], rgb[2], 0, normal[0], normal[1], normal[2]];
        let mut sums = [0; SUMS];
        for (lane, sum) in sums.iter_mut().enumerate() {
            let [_, of_product] = self.align[lane];
            *sum = tap.fit_one(&self.sums[lane], (i64::from(attributes[lane]) << self.weight_frac_bits) << of_product);
        }
        sums[OPACITY] = self.sums[OPACITY].word.format.one();
        Slot { sums, depth: 0, material, shaded: false }
    }

    /// What a shaded slot holds.
    pub fn shaded<P: Probe>(&self, fragment: &Slot, tap: &mut Tap<P>) -> Premultiplied {
        let s = &fragment.sums;
        Premultiplied {
            colour: three!(channel => tap.fit_one(&self.read[0], s[COLOUR + channel])),
            opacity: tap.fit_one(&self.read[1], s[OPACITY]),
        }
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
pub mod sheets;

#[cfg(test)]
mod tests;
