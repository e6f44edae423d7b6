//! Pipeline: connects the units. Only this folder defines their order.
//!
//! ```text
//! splats ─► project ─► ellipse ─► raster ─► gauss ─► fragment ─► resolve ─► frame
//!           └──── "setup" ────┘                        └► shade ◄┘
//! ```
//! The simulator draws tile by tile, whatever the order of the modelled machine: a pixel's result
//! depends only on the order of its own contributions, which is the order of the splats. Tiles and
//! blocks of splats are distributed over threads.
//!
//! Law: `threads_and_probes_change_no_bit`.

mod blend;
mod blocks;
mod discs;
mod elaborate;
mod fill;
mod lists;
mod merges;
pub mod ports;
mod reach;
pub mod real;
pub mod rtl;
mod set_up;
mod shading;
pub mod unit_replay;

pub use elaborate::Elaborated;
pub use fill::fill;
pub use reach::Reach;
pub use set_up::{Setup, SetupRecord, set_up};

use crate::frame::Frame;
use crate::kernels::host::{Kernel, unvectorised, vectorised};
use crate::probe::{Composite, DynProbe, NoProbe, Observer, Probe, Ranges};
use crate::records::Outcomes;
use crate::work::Work;

/// Splats that were not drawn, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Culled {
    /// At or before the near plane.
    pub near: u64,
    /// Outside the guard band, or the box misses the picture.
    pub outside: u64,
    /// Nothing visible.
    pub faint: u64,
    /// Faces away.
    pub backface: u64,
    /// Opacity so low that no weight would count.
    pub transparent: u64,
}

impl Culled {
    fn absorb(&mut self, other: &Culled) {
        self.near += other.near;
        self.outside += other.outside;
        self.faint += other.faint;
        self.backface += other.backface;
        self.transparent += other.transparent;
    }
}

/// A finished frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawing {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA words (`resolve.frame`), row-major, row 0 on top.
    pub frame: Vec<[u32; 4]>,
    /// Whether the pixel has a fragment.
    pub covered: Vec<bool>,
    /// Splats that were not drawn.
    pub culled: Culled,
    /// Outcomes of the contributions.
    pub outcomes: Outcomes,
}

/// Draws a frame.
pub fn draw<P: Probe>(machine: &Elaborated, frame: &Frame, probe: &mut P) -> Drawing {
    let setup = set_up(machine, frame, probe);
    fill(machine, frame, &setup, probe)
}

/// Draws a frame with no probe. It is compiled here once; generic functions are compiled again in
/// each crate that calls them.
pub fn draw_unobserved(machine: &Elaborated, frame: &Frame) -> Drawing {
    fill_unobserved(machine, frame, &set_up_unobserved(machine, frame))
}

/// Draws some tiles of a frame with no probe; the other tiles keep the background. `tiles` states for
/// each tile of [`crate::work::TILE_PX`] pixels whether it is drawn, by rows.
///
/// # Panics
/// If `tiles` has fewer items than the frame has tiles.
pub fn draw_tiles(machine: &Elaborated, frame: &Frame, tiles: &[bool]) -> Drawing {
    let setup = set_up_unobserved(machine, frame);
    fill::fill_tiles(machine, frame, (&setup, Some(tiles)), &mut NoProbe)
}

/// [`set_up`] with no probe.
pub fn set_up_unobserved(machine: &Elaborated, frame: &Frame) -> Setup {
    set_up(machine, frame, &mut NoProbe)
}

/// [`fill`] with no probe.
pub fn fill_unobserved(machine: &Elaborated, frame: &Frame, setup: &Setup) -> Drawing {
    fill(machine, frame, setup, &mut NoProbe)
}

/// Draws a frame once, measures the range of every signal and records the work.
pub fn draw_measured(machine: &Elaborated, frame: &Frame) -> (Drawing, Ranges, Work) {
    let mut probe = Composite::new(&machine.signals);
    let setup = set_up_measured(machine, frame, &mut probe);
    let drawing = fill_measured(machine, frame, &setup, &mut probe);
    let (ranges, work) = probe.finish(frame.width, frame.height);
    (drawing, ranges, work)
}

/// [`set_up`], measured and recorded.
pub fn set_up_measured(machine: &Elaborated, frame: &Frame, probe: &mut Composite) -> Setup {
    set_up(machine, frame, probe)
}

/// [`fill`], measured and recorded.
pub fn fill_measured(
    machine: &Elaborated,
    frame: &Frame,
    setup: &Setup,
    probe: &mut Composite,
) -> Drawing {
    fill(machine, frame, setup, probe)
}

/// Draws a frame and reports every decision to an observer, tile by tile.
pub fn draw_with_decisions<'w>(
    machine: &Elaborated,
    frame: &Frame,
    observer: &mut dyn Observer<'w>,
) -> Drawing {
    fill(
        machine,
        frame,
        &set_up_unobserved(machine, frame),
        &mut DynProbe::<false>::new(observer),
    )
}

/// Draws a frame and reports every transfer to an observer.
pub fn draw_observed<'w>(
    machine: &Elaborated,
    frame: &Frame,
    observer: &mut dyn Observer<'w>,
) -> Drawing {
    let setup = set_up_observed(machine, frame, observer);
    fill_observed(machine, frame, &setup, observer)
}

/// [`set_up`], with every transfer reported to an observer.
pub fn set_up_observed<'w>(
    machine: &Elaborated,
    frame: &Frame,
    observer: &mut dyn Observer<'w>,
) -> Setup {
    set_up(machine, frame, &mut DynProbe::<true>::new(observer))
}

/// [`fill`], with every transfer reported to an observer.
pub fn fill_observed<'w>(
    machine: &Elaborated,
    frame: &Frame,
    setup: &Setup,
    observer: &mut dyn Observer<'w>,
) -> Drawing {
    fill(machine, frame, setup, &mut DynProbe::<true>::new(observer))
}

/// Runs a kernel on the host path for a probe. The other branch is not compiled.
fn run<P: Probe, K: Kernel>(kernel: K) -> K::Output {
    if P::QUICK {
        vectorised(kernel)
    } else {
        unvectorised(kernel)
    }
}
