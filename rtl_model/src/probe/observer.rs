//! Observer: a probe that is called through a table, so that the pipeline is compiled once for all
//! observers.

use super::Probe;
use crate::num::Fit;
use crate::records::{
    Contribution, Decision, Layer, PROJECTED, SET_UP, ShadeInput, ShadeOutput, Slot, Weighed,
};
use std::any::Any;

/// An observer is called for each observation: slower than a [`Probe`], but the machine is not
/// compiled for it. `'w` is the lifetime of its borrows.
pub trait Observer<'w>: Send + Sync {
    /// A fresh observer of the same kind, for another part of the frame.
    fn fork(&self) -> Box<dyn Observer<'w> + 'w>;
    /// Hands over its observations, in a form that observers of the same kind can take over.
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send>;
    /// Adds the observations that a fork has handed over.
    fn take_over(&mut self, observations: Box<dyn Any + Send>);
    /// As [`Probe::word`].
    fn word(&mut self, _fit: &Fit, _exact: i64, _more: i64, _word: i64) {}
    /// As [`Probe::wrapped`].
    fn wrapped(&mut self, _signal: usize) {}
    /// As [`Probe::contribution`].
    fn contribution(
        &mut self,
        _x: u32,
        _y: u32,
        _contribution: &Contribution,
        _decision: Decision,
    ) {
    }
    /// As [`Probe::windows`].
    fn windows(&mut self, _x: u32, _y: u32, _starts: u8) {}
    /// As [`Probe::resolved`].
    fn resolved(&mut self, _x: u32, _y: u32, _layers: &[Layer], _frame: [i64; 4]) {}
    /// As [`Probe::set_up`].
    fn set_up(&mut self, _splat: u32, _project: [i64; PROJECTED], _ellipse: [i64; SET_UP]) {}
    /// As [`Probe::coloured`].
    fn coloured(&mut self, _splat: u32, _rgb: [i32; 3]) {}
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
    fn shade_out(&mut self, _input: &ShadeInput, _output: &ShadeOutput) {}
    /// As [`Probe::holds`].
    fn holds(&mut self, _x: u32, _y: u32, _slots: &[Slot], _layers: &[Layer]) {}
    /// As [`Probe::tile`].
    fn tile(&mut self, _x: u32, _y: u32) {}
}

/// Ignores every observation.
impl Observer<'static> for super::NoProbe {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(*self)
    }
    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }
    fn take_over(&mut self, _seen: Box<dyn Any + Send>) {}
}

/// Passes observations on to an [`Observer`]: everything, transfer by transfer, or (`EVERYTHING`
/// false) only decisions.
pub struct DynProbe<'a, 'w, const EVERYTHING: bool>(Handle<'a, 'w>);

enum Handle<'a, 'w> {
    Lent(&'a mut (dyn Observer<'w> + 'a)),
    Own(Box<dyn Observer<'w> + 'w>),
}

impl<'a, 'w, const EVERYTHING: bool> DynProbe<'a, 'w, EVERYTHING> {
    /// A probe that passes observations on to this observer.
    pub fn new(observer: &'a mut (dyn Observer<'w> + 'a)) -> Self {
        DynProbe(Handle::Lent(observer))
    }

    fn observer(&mut self) -> &mut dyn Observer<'w> {
        match &mut self.0 {
            Handle::Lent(observer) => *observer,
            Handle::Own(observer) => observer.as_mut(),
        }
    }
}

impl<const EVERYTHING: bool> Probe for DynProbe<'_, '_, EVERYTHING> {
    const WORDS: bool = EVERYTHING;
    const DECISIONS: bool = true;
    const QUICK: bool = !EVERYTHING;
    const TRANSFERS: bool = EVERYTHING;

    fn fork(&self) -> Self {
        DynProbe(Handle::Own(match &self.0 {
            Handle::Lent(observer) => observer.fork(),
            Handle::Own(observer) => observer.fork(),
        }))
    }
    fn absorb(&mut self, fork: Self) {
        if let Handle::Own(observer) = fork.0 {
            self.observer().take_over(observer.hand_over());
        }
    }
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.observer().word(fit, exact, more, word);
    }
    fn wrapped(&mut self, signal: usize) {
        self.observer().wrapped(signal);
    }
    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        self.observer().contribution(x, y, contribution, decision);
    }
    fn windows(&mut self, x: u32, y: u32, starts: u8) {
        self.observer().windows(x, y, starts);
    }
    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], frame: [i64; 4]) {
        self.observer().resolved(x, y, layers, frame);
    }
    fn set_up(&mut self, splat: u32, project: [i64; PROJECTED], ellipse: [i64; SET_UP]) {
        self.observer().set_up(splat, project, ellipse);
    }
    fn coloured(&mut self, splat: u32, rgb: [i32; 3]) {
        self.observer().coloured(splat, rgb);
    }
    fn sorted(&mut self, order: Vec<u32>, _keys: Vec<u32>) {
        self.observer().sorted(order);
    }
    fn emitted(&mut self, splat: u32, rgb: [i32; 3]) {
        self.observer().emitted(splat, rgb);
    }
    fn walked(&mut self, splat: u32) {
        self.observer().walked(splat);
    }
    fn weighed(&mut self, x: u32, y: u32, weighed: &Weighed) {
        self.observer().weighed(x, y, weighed);
    }
    fn shade_in(&mut self) {
        self.observer().shade_in();
    }
    fn shade_out(&mut self, input: &ShadeInput, output: &ShadeOutput) {
        self.observer().shade_out(input, output);
    }
    fn holds(&mut self, x: u32, y: u32, slots: &[Slot], layers: &[Layer]) {
        self.observer().holds(x, y, slots, layers);
    }
    fn tile(&mut self, x: u32, y: u32) {
        self.observer().tile(x, y);
    }
}
