//! Told: watchers that the pipeline is not compiled for. It is compiled once for all of them, and calls them through a table.

use super::{PROJECTED, Probe, SET_UP, Weighed};
use crate::num::Fit;
use crate::units::fragment::{Contribution, Decision, Slot};
use crate::units::resolve::Layer;
use crate::units::shade;
use std::any::Any;

/// A watcher that is told what it wants to hear, one call at a time: slower than a [`Probe`], and no code of the machine is compiled for
/// it. `'w` is what it borrows.
pub trait Watcher<'w>: Send + Sync {
    /// A fresh watcher of the same kind, for another part of the frame.
    fn fork(&self) -> Box<dyn Watcher<'w> + 'w>;
    /// What it has seen, in a form that one of its kind understands.
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send>;
    /// Takes over what a fork has handed over.
    fn take_over(&mut self, seen: Box<dyn Any + Send>);
    /// As [`Probe::word`].
    fn word(&mut self, _fit: &Fit, _exact: i64, _more: i64, _word: i64) {}
    /// As [`Probe::wrapped`].
    fn wrapped(&mut self, _signal: usize) {}
    /// As [`Probe::contribution`].
    fn contribution(&mut self, _x: u32, _y: u32, _contribution: &Contribution, _decision: Decision) {}
    /// As [`Probe::resolved`].
    fn resolved(&mut self, _x: u32, _y: u32, _layers: &[Layer], _frame: [i64; 4]) {}
    /// As [`Probe::set_up`].
    fn set_up(&mut self, _splat: u32, _project: [i64; PROJECTED], _ellipse: [i64; SET_UP]) {}
    /// As [`Probe::sorted`].
    fn sorted(&mut self, _order: Vec<u32>) {}
    /// As [`Probe::emitted`].
    fn emitted(&mut self, _splat: u32, _rgb: [i32; 3]) {}
    /// As [`Probe::walked`].
    fn walked(&mut self, _splat: u32) {}
    /// As [`Probe::weighed`].
    fn weighed(&mut self, _x: u32, _y: u32, _weighed: &Weighed) {}
    /// As [`Probe::shade_in`].
    fn shade_in(&mut self) {}
    /// As [`Probe::shade_out`].
    fn shade_out(&mut self, _input: &shade::Input, _output: &shade::Output) {}
    /// As [`Probe::holds`].
    fn holds(&mut self, _x: u32, _y: u32, _slots: &[Slot], _layers: &[Layer]) {}
    /// As [`Probe::tile`].
    fn tile(&mut self, _x: u32, _y: u32) {}
}

/// Hears nothing.
impl Watcher<'static> for super::Unwatched {
    fn fork(&self) -> Box<dyn Watcher<'static>> {
        Box::new(*self)
    }
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }
    fn take_over(&mut self, _seen: Box<dyn Any + Send>) {}
}

/// Passes on what a [`Watcher`] wants: everything, transfer by transfer, or (`ALL` false) decisions alone.
pub(crate) struct Told<'a, 'w, const ALL: bool>(Ear<'a, 'w>);

enum Ear<'a, 'w> {
    Lent(&'a mut (dyn Watcher<'w> + 'a)),
    Own(Box<dyn Watcher<'w> + 'w>),
}

impl<'a, 'w, const ALL: bool> Told<'a, 'w, ALL> {
    pub(crate) fn new(watcher: &'a mut (dyn Watcher<'w> + 'a)) -> Self {
        Told(Ear::Lent(watcher))
    }

    fn watcher(&mut self) -> &mut dyn Watcher<'w> {
        match &mut self.0 {
            Ear::Lent(watcher) => *watcher,
            Ear::Own(watcher) => watcher.as_mut(),
        }
    }
}

impl<const ALL: bool> Probe for Told<'_, '_, ALL> {
    const WORDS: bool = ALL;
    const DECISIONS: bool = true;
    const TRANSFERS: bool = ALL;

    fn fork(&self) -> Self {
        Told(Ear::Own(match &self.0 {
            Ear::Lent(watcher) => watcher.fork(),
            Ear::Own(watcher) => watcher.fork(),
        }))
    }
    fn absorb(&mut self, fork: Self) {
        if let Ear::Own(watcher) = fork.0 {
            self.watcher().take_over(watcher.hand_over());
        }
    }
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.watcher().word(fit, exact, more, word);
    }
    fn wrapped(&mut self, signal: usize) {
        self.watcher().wrapped(signal);
    }
    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        self.watcher().contribution(x, y, contribution, decision);
    }
    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], frame: [i64; 4]) {
        self.watcher().resolved(x, y, layers, frame);
    }
    fn set_up(&mut self, splat: u32, project: [i64; PROJECTED], ellipse: [i64; SET_UP]) {
        self.watcher().set_up(splat, project, ellipse);
    }
    fn sorted(&mut self, order: Vec<u32>) {
        self.watcher().sorted(order);
    }
    fn emitted(&mut self, splat: u32, rgb: [i32; 3]) {
        self.watcher().emitted(splat, rgb);
    }
    fn walked(&mut self, splat: u32) {
        self.watcher().walked(splat);
    }
    fn weighed(&mut self, x: u32, y: u32, weighed: &Weighed) {
        self.watcher().weighed(x, y, weighed);
    }
    fn shade_in(&mut self) {
        self.watcher().shade_in();
    }
    fn shade_out(&mut self, input: &shade::Input, output: &shade::Output) {
        self.watcher().shade_out(input, output);
    }
    fn holds(&mut self, x: u32, y: u32, slots: &[Slot], layers: &[Layer]) {
        self.watcher().holds(x, y, slots, layers);
    }
    fn tile(&mut self, x: u32, y: u32) {
        self.watcher().tile(x, y);
    }
}
