//! Unit replay: drives one unit by itself, records in and records out, as in a test bench of its
//! RTL implementation.
//!
//! Words and order of a record are those of [`ports`](crate::pipeline::ports). Units are not
//! connected: the output of one unit is not passed to another.
//!
//! Laws: `a_trace_replays_through_the_units` (tests/trace.rs of the bench).

use super::Elaborated;
use super::set_up::{ellipse_words, projected_words};
use super::shading::{emitted, emitting};
use crate::frame::{self, Each, Frame, View};
use crate::kernels::{PackedTile, Path};
use crate::num::lanes::Plain;
use crate::num::{LANES, Lanes};
use crate::probe::{Observer, Probe, Tap};
use crate::records::{
    Contribution, Decision, DiscIn, EllipsoidIn, FragmentIn, GaussIn, Held, Layer, MAX_LAYERS,
    PROJECTED, Premultiplied, RasterIn, RasterOut, SET_UP, SheetIn, Slot, TILE_AREA, TILE_PX,
    WindowIn,
};
use crate::units::fragment::sheets::{SheetInput, SheetRegisters};
use crate::units::fragment::window::{self, Cluster, Clusters, WindowRegisters};
use crate::units::fragment::{self, FragmentRegisters};
use crate::units::{project, raster, shade};

type DynProbe<'a, 'w> = crate::probe::DynProbe<'a, 'w, true>;
type Plainly = Path<false, Plain, i64>;

fn narrow(word: i64) -> i32 {
    word as i32
}

/// `project`: takes a record of `project.in`; the opacity counts where the frame has ellipsoids.
pub fn project(
    machine: &Elaborated,
    frame: &Frame,
    position: [i64; 3],
    opacity: i64,
    observer: &mut dyn Observer<'_>,
) -> [i64; PROJECTED] {
    let transparent = frame
        .ellipsoids
        .as_ref()
        .is_some_and(|of| opacity < of.kernel.least_opacity);
    let mut inputs = position.to_vec();
    inputs.push(-i64::from(transparent));
    inputs.extend(project::registers(&frame.view));
    let made = machine
        .project
        .graph()
        .one(&inputs, &mut Tap::new(&mut DynProbe::new(observer)));
    projected_words(made, transparent)
}

/// `ellipse`: takes a record of `ellipse.in`, in a picture of this size.
pub fn ellipse(
    machine: &Elaborated,
    view: &View,
    size_px: [u32; 2],
    input: [i64; DiscIn::WORDS],
    observer: &mut dyn Observer<'_>,
) -> [i64; SET_UP] {
    let i = DiscIn::from_words(input);
    let mut inputs = vec![
        i.normal_x,
        i.normal_y,
        i.normal_z,
        i.radius,
        i.exponent,
        i.forward,
        i.inverse_depth,
        i.inverse_depth_exponent,
        i.slope_x,
        i.slope_y,
        i.pixel_x,
        i.pixel_y,
    ];
    let unit = &machine.ellipse;
    let variant = unit.variant(view.aspect.is_some(), None);
    inputs.extend(unit.registers(variant, view, size_px, &frame::Kernel::default()));
    ellipse_words(
        unit.datapath(variant)
            .graph
            .one(&inputs, &mut Tap::new(&mut DynProbe::new(observer))),
    )
}

/// `ellipse` of ellipsoids: takes a record of `ellipse.in`. `None` where the frame or the machine
/// has no ellipsoids.
pub fn ellipsoid(
    machine: &Elaborated,
    frame: &Frame,
    input: [i64; EllipsoidIn::WORDS],
    observer: &mut dyn Observer<'_>,
) -> Option<[i64; SET_UP]> {
    let i = EllipsoidIn::from_words(input);
    let ellipsoids = frame.ellipsoids.as_ref()?;
    machine.machine.ellipse.ellipsoid?;
    let unit = &machine.ellipse;
    let cutoff = unit.box_cutoff(&frame.view, &ellipsoids.kernel, narrow(i.opacity));
    let mut inputs = vec![
        i.normal_x,
        i.normal_y,
        i.normal_z,
        i.radius,
        i.exponent,
        i.forward,
        i.inverse_depth,
        i.inverse_depth_exponent,
        i.slope_x,
        i.slope_y,
        i.pixel_x,
        i.pixel_y,
        i.opacity,
        cutoff,
    ];
    if !ellipsoids.own.is_empty() {
        inputs.extend([
            i.quaternion_w,
            i.quaternion_x,
            i.quaternion_y,
            i.quaternion_z,
            i.scale_0,
            i.scale_1,
            i.scale_2,
        ]);
    }
    let variant = unit.variant_of(frame);
    inputs.extend(unit.registers(
        variant,
        &frame.view,
        [frame.width, frame.height],
        &ellipsoids.kernel,
    ));
    Some(ellipse_words(
        unit.datapath(variant)
            .graph
            .one(&inputs, &mut Tap::new(&mut DynProbe::new(observer))),
    ))
}

/// `colour`: takes a record of `colour.in`. `None` where the machine has no such unit.
pub fn colour(
    machine: &Elaborated,
    frame: &Frame,
    words: &[i64],
    observer: &mut dyn Observer<'_>,
) -> Option<[i64; 3]> {
    let (position, coefficients) = words.split_at_checked(3)?;
    let inputs = [position, &frame.view.eye, coefficients].concat();
    let unit = machine.colour.as_ref()?;
    Some(
        unit.graph()
            .one(&inputs, &mut Tap::new(&mut DynProbe::new(observer))),
    )
}

/// Request to `shade` for a splat with this colour, normal and material, before it is drawn:
/// `ellipse.request`.
pub fn emission(
    machine: &Elaborated,
    rgb: [i64; 3],
    normal: [i64; 3],
    material: u32,
    observer: &mut dyn Observer<'_>,
) -> shade::Input {
    emitting(
        machine,
        rgb.map(narrow),
        normal.map(narrow),
        material,
        &mut Tap::new(&mut DynProbe::new(observer)),
    )
}

/// Colour of a splat after it is lit, from the light in `ellipse.answer`.
pub fn emitted_colour(
    machine: &Elaborated,
    light: [i64; 3],
    observer: &mut dyn Observer<'_>,
) -> [i64; 3] {
    emitted(machine, light, &mut Tap::new(&mut DynProbe::new(observer))).map(i64::from)
}

/// `sort`: takes depths in the order of `sort.in`. Returns for each record of `sort.out` the index
/// of its depth, and its key. `None` where the machine has no sort.
pub fn sort(
    machine: &Elaborated,
    depths: &[i64],
    observer: &mut dyn Observer<'_>,
) -> Option<Vec<(usize, i64)>> {
    let key = machine.sort.as_ref()?;
    let probe = &mut DynProbe::new(observer);
    let tap = &mut Tap::new(probe);
    let mut keyed: Vec<(usize, i64)> = depths
        .iter()
        .enumerate()
        .map(|(nth, depth)| (nth, tap.fit_one(key, *depth)))
        .collect();
    // The farthest first, where each Gaussian is blended at once.
    let farthest_first = machine.machine.fragment.composite().is_some();
    keyed.sort_by_key(|(_, key)| if farthest_first { -key } else { *key });
    Some(keyed)
}

/// `raster`: takes a record of `raster.in` without its tag. Returns column, row, radial index and
/// depth of each fragment, row by row.
pub fn raster(
    machine: &Elaborated,
    view: &View,
    size_px: [u32; 2],
    input: [i64; RasterIn::WORDS],
    observer: &mut dyn Observer<'_>,
) -> Vec<[i64; RasterOut::WORDS]> {
    let record = RasterIn::from_words(input);
    let RasterIn {
        first_column: left,
        last_column: right,
        first_row: top,
        last_row: bottom,
        ..
    } = record;
    let side = |first: i64, last: i64| [first as u16, last as u16];
    let i = record.map(narrow);
    let input = raster::Input {
        pixel: [i.pixel_x, i.pixel_y],
        conic: [i.conic_xx, i.conic_xy, i.conic_yy],
        depth: i.depth,
        depth_slope: [i.depth_slope_x, i.depth_slope_y],
        depth_range: i.depth_range,
        columns: side(left, right),
        rows: side(top, bottom),
    };
    let cutoff = machine.raster.cutoff(view.cutoff);
    let tile = TILE_PX as i64;
    let mut fragments = Vec::new();
    for row in top / tile..=bottom / tile {
        for column in left / tile..=right / tile {
            let corner = [(column * tile) as u16, (row * tile) as u16];
            let mut span = raster::Span::default();
            let walks = machine.raster.enter::<Plain, DynProbe>(
                size_px,
                corner,
                &[&input; LANES],
                &mut Tap::new(&mut DynProbe::new(observer)).first(1),
            );
            machine.raster.span::<Plain, DynProbe>(
                size_px,
                &walks,
                0,
                &input,
                cutoff,
                &mut span,
                &mut Tap::new(&mut DynProbe::new(observer)),
            );
            for first in 0..span.fragments() {
                let places = span.places(first);
                let [radial, depth] = machine
                    .raster
                    .fragments::<Plain>(&walks, 0, &span, places)
                    .map(|lanes| lanes.to_array()[0]);
                let pixel = i64::from(walks.pixels(0, places)[0]);
                let made = RasterOut {
                    x: column * tile + pixel % tile,
                    y: row * tile + pixel / tile,
                    radial,
                    depth,
                };
                fragments.push(made.into_words());
            }
        }
    }
    fragments.sort_unstable_by_key(|[x, y, ..]| [*y, *x]);
    fragments
}

/// `gauss`: takes a record of `gauss.in`; returns its weight.
pub fn gauss(
    machine: &Elaborated,
    input: [i64; GaussIn::WORDS],
    observer: &mut dyn Observer<'_>,
) -> i64 {
    let GaussIn { radial, amplitude } = GaussIn::from_words(input);
    let probe = &mut DynProbe::new(observer);
    let tap = &mut Tap::new(probe).first(1);
    let [_, weight] = machine.gauss.graph().one(&[radial, amplitude], tap);
    weight
}

/// `shade`: shades one fragment with the lights and materials of a frame.
pub fn shade(
    machine: &Elaborated,
    frame: &Frame,
    input: &shade::Input,
    observer: &mut dyn Observer<'_>,
) -> shade::Output {
    let highlights = machine.shade.highlights(&frame.lighting);
    machine.shade.one(
        &shade::LightRegisters::of(frame, &highlights),
        input,
        &mut Tap::new(&mut DynProbe::new(observer)),
    )
}

/// `resolve`: takes the layers of a pixel, front to back; returns its frame word.
pub fn resolve(
    machine: &Elaborated,
    frame: &Frame,
    layers: &[Layer],
    observer: &mut dyn Observer<'_>,
) -> [i64; 4] {
    machine.resolve.one(
        layers,
        frame.background,
        &mut Tap::new(&mut DynProbe::new(observer)),
    )
}

/// `fragment`, with the pixels of one tile.
pub struct Fragments<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    tile: Box<PackedTile<i64>>,
}

impl<'a> Fragments<'a> {
    /// A tile with empty pixels.
    pub fn new(machine: &'a Elaborated, frame: &'a Frame) -> Self {
        Fragments {
            machine,
            frame,
            tile: Box::default(),
        }
    }

    /// Takes a record of `fragment.in` for a pixel of the tile; `answer` replaces shade.
    pub fn take(
        &mut self,
        input: [i64; FragmentIn::WORDS],
        mut answer: impl FnMut(&Slot) -> Premultiplied,
        observer: &mut dyn Observer<'_>,
    ) -> Decision {
        let FragmentIn {
            x,
            y,
            weight,
            depth: exact_depth,
            red,
            green,
            blue,
            opacity,
            normal_x,
            normal_y,
            normal_z,
            material,
        } = FragmentIn::from_words(input);
        let registers = FragmentRegisters {
            z_threshold: self.frame.z_threshold,
            coverage_threshold: self.frame.coverage_threshold,
        };
        let attributes = [1, red, green, blue, opacity, normal_x, normal_y, normal_z].map(narrow);
        let unit = &self.machine.fragment;
        let depth = unit
            .depth::<false, Plain, DynProbe>(
                Plain::splat(exact_depth),
                &mut Tap::new(&mut DynProbe::new(observer)).first(1),
            )
            .to_array()[0];
        let pixel = (y as usize % TILE_PX * TILE_PX + x as usize % TILE_PX) as u8;
        let answers = std::cell::RefCell::new(&mut answer);
        let mut shade = |slot: &Slot, _: &mut Tap<DynProbe>| (answers.borrow_mut())(slot);
        let probe = &mut DynProbe::new(observer);
        let tap = &mut Tap::new(probe);
        let material = material as u32;
        let input = fragment::Input {
            weight,
            depth,
            attributes: &attributes,
            material: &material,
        };
        let decision = unit.contribute::<Plainly, DynProbe>(
            &mut self.tile,
            pixel,
            input,
            &registers,
            &mut shade,
            tap,
        );
        let contribution = Contribution {
            splat: 0,
            radial_index: 0,
            weight,
            depth,
        };
        tap.probe
            .contribution(x as u32, y as u32, &contribution, decision);
        decision
    }

    /// Fragments of a pixel of the tile, slot by slot.
    pub fn held(&self, pixel: usize) -> Vec<Slot> {
        let at = (pixel % TILE_AREA) as u8;
        (0..self.tile.live(at))
            .map(|slot| self.tile.slot(at, slot))
            .collect()
    }

    /// Light of a shaded fragment, as it is read from its slot.
    pub fn lit(&self, slot: &Slot, observer: &mut dyn Observer<'_>) -> Premultiplied {
        self.machine
            .fragment
            .shaded(slot, &mut Tap::new(&mut DynProbe::new(observer)))
    }
}

/// `fragment` with sheets, with the pixels of one tile.
#[derive(Clone)]
pub struct Sheets<'a> {
    machine: &'a Elaborated,
    registers: SheetRegisters<'a>,
    tile: Box<PackedTile<i64>>,
}

impl<'a> Sheets<'a> {
    /// A tile with empty pixels.
    pub fn new(machine: &'a Elaborated, sheets: &'a frame::Sheets) -> Self {
        Sheets {
            machine,
            registers: machine.fragment.sheets(sheets),
            tile: Box::default(),
        }
    }

    /// Takes a record of `fragment.in` for a pixel of the tile.
    pub fn take(
        &mut self,
        input: [i64; SheetIn::WORDS],
        observer: &mut dyn Observer<'_>,
    ) -> Decision {
        let SheetIn {
            x,
            y,
            weight,
            sheet,
            red,
            green,
            blue,
        } = SheetIn::from_words(input);
        let attributes = [1, red, green, blue, 0, 0, 0, 0].map(narrow);
        let pixel = (y as usize % TILE_PX * TILE_PX + x as usize % TILE_PX) as u8;
        let probe = &mut DynProbe::new(observer);
        let tap = &mut Tap::new(probe);
        let unit = &self.machine.fragment;
        let input = SheetInput {
            sheet: sheet as u32,
            weight,
            attributes: &attributes,
        };
        unit.contribute_to_sheet::<Plainly, DynProbe>(
            &mut self.tile,
            pixel,
            input,
            &self.registers,
            tap,
        )
    }

    /// Sheets of a pixel of the tile; `None` where it is empty.
    pub fn held(&self, pixel: usize) -> Option<Held> {
        let at = (pixel % TILE_AREA) as u8;
        // Where each splat is a sheet, a sheet is never open.
        let open = self.registers.sheets.each == Each::Slice;
        let slots: Vec<Slot> = (0..self.tile.live(at).min(1 + usize::from(open)))
            .map(|slot| self.tile.slot(at, slot))
            .collect();
        (!slots.is_empty()).then(|| Held::of(&slots))
    }

    /// Composite of its sheets.
    pub fn lit(&self, pixel: usize, observer: &mut dyn Observer<'_>) -> Option<Premultiplied> {
        let at = (pixel % TILE_AREA) as u8;
        self.machine.fragment.composite(
            &self.tile,
            at,
            &self.registers,
            &mut Tap::new(&mut DynProbe::new(observer)),
        )
    }
}

/// `fragment` with intervals or windows, with the pixels of one tile.
pub struct Windows<'a> {
    machine: &'a Elaborated,
    registers: WindowRegisters,
    clusters: Clusters,
    live: [u8; TILE_AREA],
}

impl<'a> Windows<'a> {
    /// A tile with empty pixels; `None` where the frame's fragments are grouped otherwise.
    pub fn new(machine: &'a Elaborated, frame: &Frame) -> Option<Self> {
        let registers = machine.windows(frame)?;
        Some(Windows {
            machine,
            registers,
            clusters: Clusters::default(),
            live: [0; TILE_AREA],
        })
    }

    /// Takes a record of `fragment.in` for a pixel of the tile; `answer` replaces shade.
    pub fn take(
        &mut self,
        input: [i64; WindowIn::WORDS],
        mut answer: impl FnMut(&Slot) -> Premultiplied,
        observer: &mut dyn Observer<'_>,
    ) -> Decision {
        let WindowIn {
            x,
            y,
            red,
            green,
            blue,
            opacity,
            normal_x,
            normal_y,
            normal_z,
            light_r,
            light_g,
            light_b,
            ..
        } = WindowIn::from_words(input).map(narrow);
        let WindowIn {
            weight,
            depth: exact_depth,
            material,
            density,
            ..
        } = WindowIn::from_words(input);
        let unit = &self.machine.fragment;
        let probe = &mut DynProbe::new(observer);
        let depth = unit
            .depth::<false, Plain, DynProbe>(
                Plain::splat(exact_depth),
                &mut Tap::new(probe).first(1),
            )
            .to_array()[0];
        let attributes = [1, red, green, blue, opacity, normal_x, normal_y, normal_z];
        let input = window::Input {
            weight,
            depth,
            attributes: &attributes,
            material: material as u32,
            light: [light_r, light_g, light_b],
            density: narrow(density),
        };
        let pixel = (y as usize % TILE_PX * TILE_PX + x as usize % TILE_PX) as u8;
        let live = &mut self.live[usize::from(pixel)];
        let answers = std::cell::RefCell::new(&mut answer);
        let shade = |slot: &Slot, _: &mut Tap<DynProbe>| (answers.borrow_mut())(slot);
        let slots = self.clusters.of(pixel);
        let decision = unit.contribute_to_window(
            slots,
            usize::from(*live),
            &input,
            &self.registers,
            shade,
            &mut Tap::new(probe),
        );
        *live += u8::from(matches!(decision, Decision::Inserted(_)));
        decision
    }

    /// Slots of a pixel of the tile.
    pub fn held(&mut self, pixel: usize) -> &mut [Cluster] {
        let at = (pixel % TILE_AREA) as u8;
        &mut self.clusters.of(at)[..usize::from(self.live[usize::from(at)])]
    }

    /// Final layers of a pixel; `answer` replaces shade.
    pub fn layers(
        &mut self,
        pixel: usize,
        mut answer: impl FnMut(&Slot) -> Premultiplied,
        observer: &mut dyn Observer<'_>,
    ) -> Vec<Layer> {
        let mut layers = [Layer::default(); MAX_LAYERS];
        let answers = std::cell::RefCell::new(&mut answer);
        let shade = |slot: &Slot, _: &mut Tap<DynProbe>| (answers.borrow_mut())(slot);
        let (machine, registers) = (self.machine, self.registers.clone());
        let probe = &mut DynProbe::new(observer);
        let (count, ..) = machine.fragment.layers_of_windows(
            self.held(pixel),
            &registers,
            &mut layers,
            shade,
            &mut Tap::new(probe),
        );
        layers[..count].to_vec()
    }
}
