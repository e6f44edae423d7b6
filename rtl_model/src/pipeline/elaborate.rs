//! Elaborate: makes a machine that can draw of a description, or every misfit at once, in
//! sentences.
//!
//! A description is checked once, as an RTL elaboration would; afterwards the datapath cannot fail.

use super::discs::Discs;
use crate::elaboration::latency::Path;
use crate::elaboration::masks::{MOST_TILES_PER_CYCLE, Masks};
use crate::elaboration::microarchitecture::{
    BinShape, BinWords, ContributionShape, Harmonics, Microarchitecture, Paths, SORT_COUNT_BITS,
};
use crate::elaboration::{Elaboration, Operator, Part, Signal};
use crate::frame::{Each, Frame, Kernel, View};
use crate::functions::{Reciprocal, ReciprocalRoot, Table};
use crate::machine::timing::Organisation;
use crate::machine::{Group, MOST_TILE_BITS, Machine, Operators, SortKind};
use crate::num::{Fit, Format, MAX_WIDTH_BITS};
use crate::records::unit;
use crate::units::fragment::FragmentRegisters;
use crate::units::fragment::window::WindowRegisters;
use crate::units::{
    colour, contribution, ellipse, fragment, gauss, project, raster, resolve, shade,
};

/// Bits of a column or row of tiles: a picture has up to 2^14 pixels, and tiles have 4 or more.
const TILE_BITS: i32 = 12;

/// A machine that has been checked and can draw.
#[derive(Clone, Debug)]
pub struct Elaborated {
    /// The description.
    pub machine: Machine,
    /// Every signal, in the order of the diagram.
    pub signals: Vec<Signal>,
    /// Parts that its units are built of.
    pub parts: Vec<Part>,
    pub(crate) project: project::Project,
    pub(crate) ellipse: ellipse::Ellipse,
    /// Harmonics → colour, if the machine evaluates them.
    pub(crate) colour: Option<colour::Colour>,
    /// Both for discs, on the host; none where operators round.
    pub(crate) discs: Option<Discs>,
    /// Depth to key.
    pub(crate) sort: Option<Fit>,
    /// The light of a splat that is lit before it is drawn, as its record has colours.
    pub(crate) emission: Fit,
    /// Test of blocks of pixels, if the machine has one.
    pub(crate) contribution: Option<contribution::Contribution>,
    pub(crate) raster: raster::Raster,
    pub(crate) gauss: gauss::Gauss,
    /// At most l fragments a pixel.
    pub fragment: fragment::Fragment,
    /// Normalise and light.
    pub shade: shade::Shade,
    /// Blend into the frame.
    pub resolve: resolve::Resolve,
    /// The microarchitecture.
    pub timing: Microarchitecture,
    /// Whether recorded work has the words and keys that other tests of tiles and other kinds of
    /// sort depend on, even if this machine needs none of them; not set by elaboration.
    pub records_choices: bool,
}

impl Elaborated {
    /// Every reciprocal, by the name of its unit and its own.
    pub fn reciprocals(&self) -> [(&'static str, &Reciprocal); 3] {
        [
            ("project.reciprocal", self.project.reciprocal()),
            ("ellipse.slope_reciprocal", self.ellipse.slope_reciprocal()),
            ("shade.reciprocal", self.shade.reciprocal()),
        ]
    }

    /// Every reciprocal root, by the name of its unit and its own.
    pub fn roots(&self) -> [(&'static str, &ReciprocalRoot); 3] {
        [
            ("ellipse.root", self.ellipse.root()),
            ("ellipse.extent_root", self.ellipse.extent_root()),
            ("shade.root", self.shade.root()),
        ]
    }

    /// |(a, b, 1)| of `ellipse`, `ellipse.ray_root`, if it sets ellipsoids up.
    pub fn ray_root(&self) -> Option<&ReciprocalRoot> {
        self.ellipse.ray_root()
    }

    /// √(det V_r) of `ellipse`, `ellipse.compensation_root`, if it compensates opacities.
    pub fn compensation_root(&self) -> Option<&ReciprocalRoot> {
        self.ellipse.compensation_root()
    }

    /// The cutoff (`raster.cutoff`) of an ellipsoid's box, from its opacity.
    pub fn box_cutoff(&self, view: &View, kernel: &Kernel, opacity: i32) -> i64 {
        self.ellipse.box_cutoff(view, kernel, opacity)
    }

    /// The cutoff (`raster.cutoff`) that the contribution test compares r of a splat with; none if
    /// the frame's blocks are not tested.
    pub fn contribution_cutoff(&self, frame: &Frame, splat: usize) -> Option<i64> {
        self.tests_blocks(frame)?;
        let whole = self.raster.cutoff(frame.view.cutoff);
        let kernel = &frame.ellipsoids.as_ref()?.kernel;
        let own = self.box_cutoff(&frame.view, kernel, frame.splats[splat].opacity);
        Some(own.min(whole))
    }

    /// The contribution test, if the frame's splats are Gaussians and the machine has one.
    pub fn tests_blocks(&self, frame: &Frame) -> Option<&contribution::Contribution> {
        let sheets = frame.sheets.as_ref()?;
        frame.ellipsoids.as_ref()?;
        (self.contribution.as_ref()).filter(|_| sheets.each == Each::Splat)
    }

    /// The constant 1/2π as `ellipse` holds it (`ellipse.inverse_two_pi`).
    pub fn inverse_two_pi(&self) -> i64 {
        self.ellipse.inverse_two_pi()
    }

    /// Harmonics → colour, if the machine evaluates them.
    pub fn colour(&self) -> Option<&colour::Colour> {
        self.colour.as_ref()
    }

    /// Test of blocks of pixels, if the machine has one.
    pub fn contribution(&self) -> Option<&contribution::Contribution> {
        self.contribution.as_ref()
    }

    /// Registers of windows; none where fragments are grouped otherwise.
    pub fn windows(&self, frame: &Frame) -> Option<WindowRegisters> {
        let Frame {
            z_threshold,
            coverage_threshold,
            ..
        } = *frame;
        self.fragment.windows(
            frame.window.as_ref()?,
            FragmentRegisters {
                z_threshold,
                coverage_threshold,
            },
        )
    }

    /// The table of e^(−r/2), `gauss.table`.
    pub fn gaussian(&self) -> &Table {
        self.gauss.table()
    }
}

impl Machine {
    /// Checks the description and works out everything that does not change while it draws; or
    /// every misfit, a sentence each.
    pub fn elaborate(&self) -> Result<Elaborated, Vec<String>> {
        let e = &mut Elaboration::new(self.operators);
        check_splat(self, e);
        let (project, ellipse, colour) = (
            project::Project::new(e, self),
            ellipse::Ellipse::new(e, self),
            colour::Colour::new(e, self),
        );
        let disc = &ellipse
            .datapath(ellipse.variant(self.ellipse.aspect.is_some(), None))
            .graph;
        let discs = (self.operators == Operators::Exact).then(|| {
            Discs::new(
                self,
                &e.signals,
                project.graph(),
                disc,
                ellipse.inverse_two_pi(),
            )
        });
        let sort = self.elaborate_sort(e);
        let contribution = contribution::Contribution::new(e, self);
        let raster = raster::Raster::new(e, self);
        let gauss = e.per_lane(|e| gauss::Gauss::new(e, self));
        let fragment = fragment::Fragment::new(e, self, raster::Raster::depth_exact(self));
        // Of windows a second one lights splats in setup, of two tile buffers one what a tile
        // holds in the end.
        let shade = e.copies(self.shade_units(), |e| shade::Shade::new(e, self));
        let resolve = resolve::Resolve::new(e, self);
        e.uses_operators();
        let emission = self.elaborate_emission(e);
        let bin = self.elaborate_bin(e);
        let paths = Paths {
            project: project.graph().path(),
            // Words that do not fit have been refused by now.
            ellipse: if e.errors.is_empty() {
                ellipse.path()
            } else {
                disc.path()
            },
            gauss: gauss.graph().path(),
            contribution: (contribution.as_ref()).map_or(Path::default(), |unit| unit.path(self)),
            // A step per layer.
            resolve: resolve.layer_path().times(self.fragment.layers),
            ..self.paths(resolve.layer_path())
        };
        let blocks = contribution.as_ref().map(|_| ContributionShape {
            masks: Masks::of(self),
            latency: paths.contribution.cycles_at(&self.timing).max(1),
            bits: contribution::splat_bits(self),
        });
        let timing = self.elaborate_timing(e, &paths, bin, blocks);
        let elaborated = Elaborated {
            discs,
            project,
            ellipse,
            colour,
            sort,
            raster,
            gauss,
            fragment,
            shade,
            resolve,
            emission,
            contribution,
            timing,
            records_choices: false,
            machine: self.clone(),
            signals: std::mem::take(&mut e.signals),
            parts: std::mem::take(&mut e.parts),
        };
        if e.errors.is_empty() {
            Ok(elaborated)
        } else {
            // A word of three coordinates is refused once.
            let mut errors: Vec<String> = Vec::new();
            for error in std::mem::take(&mut e.errors) {
                if !errors.contains(&error) {
                    errors.push(error);
                }
            }
            Err(errors)
        }
    }

    /// The test of tiles, if the machine has one.
    fn elaborate_bin(&self, e: &mut Elaboration) -> Option<BinShape> {
        self.check_masks(e);
        self.elaborate_listing(e);
        let words = BinWords::of(self)?;
        e.require(self.timing.organisation == Organisation::Binned, || {
            "timing.organisation is immediate, but bin.test tests tiles, and only a binned machine has lists of tiles: leave `bin` out, or use binned".into()
        });
        // A contribution test makes those of a machine that has one.
        let masks = Masks::of(self).filter(|_| self.contribution.is_none());
        let engines = self.timing.engines.unwrap_or(1).clamp(1, 64);
        // Lists that are kept have every tile of a box: only `list` tests, for its masks.
        let are_kept = self.keeps_lists().is_some();
        let tiles = if are_kept { 0 } else { self.tiles_per_cycle() };
        words.declare(masks, [tiles, engines], e);
        let cycles = |path: Path| path.cycles_at(&self.timing).max(1);
        let shape = BinShape {
            test: words.test,
            latency: 0,
            bits: [words.splat_bits(), words.tile_bits()],
            masks,
            mask_latency: masks.map(|masks| cycles(masks.path(words))),
            words,
        };
        let latency = if are_kept { 0 } else { cycles(shape.path()) };
        Some(BinShape { latency, ..shape })
    }

    /// Parts for each tile after the first that is listed in a cycle: its column and row, its entry
    /// on the way to memory, and the place in its list.
    fn elaborate_listing(&self, e: &mut Elaboration) {
        let Some(given) = self.bin.and_then(|bin| bin.tiles_per_cycle) else {
            return;
        };
        e.within(unit::BIN, "tiles_per_cycle", given, 1, MOST_TILES_PER_CYCLE);
        e.require(self.timing.organisation == Organisation::Binned, || {
            "timing.organisation is immediate, but bin.tiles_per_cycle lists tiles: leave `bin` out, or use binned".into()
        });
        let tiles = self.tiles_per_cycle();
        let entry_bits = SORT_COUNT_BITS as i32
            + self.sorting().map_or(0, |sort| sort.key_bits() as i32)
            + self.listed_mask_bits() as i32;
        e.copies(tiles - 1, |e| {
            e.copies(2, |e| e.part(unit::BIN, Operator::Register(TILE_BITS)));
            e.adders(unit::BIN, 2, TILE_BITS);
            e.part(unit::BIN, Operator::Register(entry_bits));
            e.adders(unit::BIN, 1, SORT_COUNT_BITS as i32);
        });
        // Each of them can have the next write.
        e.choice(unit::BIN, tiles, entry_bits);
    }

    fn elaborate_sort(&self, e: &mut Elaboration) -> Option<Fit> {
        let has_weights = self.sort.is_some_and(|sort| sort.depth_weight.is_some());
        e.require(!has_weights || self.sums_gaussians(), || {
            "sort.depth_weight weights summed Gaussians, and sort.kind is another: leave it out, or let sort.kind be none".into()
        });
        e.require(!has_weights || self.ellipse.ellipsoid.is_some(), || {
            "sort.depth_weight weights Gaussians, but ellipse.ellipsoid is left out, which has the words of Gaussians: `--machine weighted` has them".into()
        });
        if self.sums_gaussians() {
            e.require(self.fragment.sheets.is_some(), || {
                "sort.kind is none, which sums Gaussians, but fragment.sheets is left out, which has the words of sums: `--machine weighted` has them".into()
            });
            e.require(self.sort.is_none_or(|sort| sort.tile_bits.is_none()), || {
                "sort.tile_bits is a part of the key of radix, but sort.kind is none: leave it out".into()
            });
        }
        let sort = &self.sorting()?;
        e.number(unit::SORT, "key", sort.key, false);
        e.fixed_point(unit::SORT, "key", sort.key);
        e.within(unit::SORT, "digit_bits", sort.digit_bits, 1, 16);
        if let Some(bits) = sort.tile_bits {
            e.within(unit::SORT, "tile_bits", bits, 1, MOST_TILE_BITS);
            e.require(sort.kind == SortKind::Radix, || {
                "sort.tile_bits is a part of the key of radix, but each tile's list is sorted by itself: leave it out".into()
            });
        }
        if sort.kind != SortKind::Radix {
            // Sorters are a part of the microarchitecture.
            return Some(e.fit(unit::SORT, "key", sort.key, self.project.depth));
        }
        // One counts the next digit's values, one counts where the next entry of this digit's value
        // goes, or sums up.
        e.adders(unit::SORT, 2, SORT_COUNT_BITS as i32);
        // The digit of a pass is chosen from the key, for the entry that moves and for the one that
        // is counted.
        let key_bits = sort.key_bits() as i32;
        let digit_bits = sort.digit_bits.clamp(1, 16);
        e.copies(2, |e| {
            e.choice(unit::SORT, sort.passes(), digit_bits as i32)
        });
        // An entry, a splat's number, its key and its mask, is read, and is written.
        let mask_bits = self.listed_mask_bits() as i32;
        e.copies(2, |e| {
            e.part(
                unit::SORT,
                Operator::Register(SORT_COUNT_BITS as i32 + key_bits + mask_bits),
            )
        });
        Some(e.fit(unit::SORT, "key", sort.key, self.project.depth))
    }

    /// Only ellipsoids, and splats that are grouped by windows, are lit before they are drawn.
    fn elaborate_emission(&self, e: &mut Elaboration) -> Fit {
        let (word, from) = (self.splat.rgb, self.shade.premultiplied.into());
        let left = word.format.frac_bits - self.shade.premultiplied.format.frac_bits;
        let is_lit = self.ellipse.ellipsoid.is_some() || self.fragment.group != Group::First;
        e.require(!is_lit || left <= 31, || {
            let fits = Format { frac_bits: self.shade.premultiplied.format.frac_bits, ..word.format }.within(MAX_WIDTH_BITS);
            format!(
                "splat.rgb is {word}, {left} fraction bits finer than shade.premultiplied, which lights splats: {fits} would hold all of it"
            )
        });
        if is_lit && left <= 31 {
            e.copies(3, |e| e.fit(unit::ELLIPSE, "emission", word, from))
        } else {
            Fit::new(0, word, from)
        }
    }

    /// Longest path through the units that are not graphs, and through `colour` by degree.
    fn paths(&self, layer: Path) -> Paths {
        Paths {
            colour: self.colour.map_or_else(Default::default, |words| {
                [1, 2, 3].map(|degree| Harmonics {
                    path: colour::path(self, &words, degree),
                    products: colour::products(&words, degree),
                    bits: colour::bits(&words, degree),
                })
            }),
            raster: raster::path(self),
            fragment: fragment::path(self),
            over: fragment::over(self),
            shade: shade::path(self),
            one_cycle: [
                ("a stamp", unit::RASTER, raster::stamp(self)),
                ("a stamp", unit::FRAGMENT, fragment::stamp(self)),
                ("a layer", unit::RESOLVE, layer),
            ],
            ..Paths::default()
        }
    }
}

/// The splat record is no unit's: its words are checked here.
fn check_splat(machine: &Machine, e: &mut Elaboration) {
    let splat = &machine.splat;
    for (name, word, signed) in [
        ("position", splat.position, true),
        ("normal", splat.normal, true),
        ("radius", splat.radius, false),
        ("rgb", splat.rgb, false),
        ("opacity", splat.opacity, false),
    ] {
        e.number("splat", name, word, signed);
    }
    e.holds_one_or_an_ulp_less(machine, "splat", "rgb", splat.rgb);
    e.holds_one_or_an_ulp_less(machine, "splat", "opacity", splat.opacity);
    e.holds_one("splat", "normal", splat.normal);
}
