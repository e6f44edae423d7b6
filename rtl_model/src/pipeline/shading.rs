//! Shading: the ports to shade, from setup, from fragment and from resolve.

use super::Elaborated;
use crate::num::three;
use crate::probe::{Probe, Tap};
use crate::records::{Layer, NORMAL, OPACITY, Premultiplied, SUMS, Slot, WEIGHT};
use crate::units::shade;

/// A splat as shade is given it, where it is lit before it is drawn.
pub(super) fn emitting<P: Probe>(machine: &Elaborated, rgb: [i32; 3], normal: [i32; 3], material: u32, tap: &mut Tap<P>) -> shade::Input {
    input_of(&machine.fragment.emitting(rgb, normal, material, tap), [0; 2])
}

/// The light of a splat, in the words of its colour.
pub(super) fn emitted<P: Probe>(machine: &Elaborated, light: [i64; 3], tap: &mut Tap<P>) -> [i32; 3] {
    three!(channel => tap.fit_one(&machine.emission, light[channel]) as i32)
}

/// The port from fragment to shade. A call of its own, so that its instructions can be told from those of fragment.
#[inline(never)]
pub(super) fn shade_for_merge<P: Probe>(
    machine: &Elaborated,
    lights: &shade::LightRegisters,
    slot: &Slot,
    pixel: [u32; 2],
    tap: &mut Tap<P>,
) -> Premultiplied {
    if P::WORK {
        tap.probe.shaded();
    }
    shade_slot(machine, lights, slot, pixel, tap)
}

/// The port from fragment, and from resolve, to shade.
pub(super) fn shade_slot<P: Probe>(
    machine: &Elaborated,
    lights: &shade::LightRegisters,
    slot: &Slot,
    pixel: [u32; 2],
    tap: &mut Tap<P>,
) -> Premultiplied {
    let input = input_of(slot, pixel);
    if P::WORK && lights.surroundings.is_some() {
        tap.probe.lit();
    }
    if P::TRANSFERS {
        tap.probe.shade_in();
    }
    let output = machine.shade.one(lights, &input, tap);
    if P::TRANSFERS {
        tap.probe.shade_out(&input, &output);
    }
    let shade::Output { colour, opacity } = output;
    Premultiplied { colour, opacity }
}

/// A fragment as shade is given it.
pub(super) fn input_of(slot: &Slot, pixel: [u32; 2]) -> shade::Input {
    let s: &[i64; SUMS] = &slot.sums;
    shade::Input {
        weight: s[WEIGHT],
        colour: [s[1], s[2], s[3]],
        opacity: s[OPACITY],
        normal: [s[NORMAL], s[NORMAL + 1], s[NORMAL + 2]],
        material: slot.material,
        pixel: pixel.map(i64::from),
    }
}

pub(super) fn lit_layer<P: Probe>(
    machine: &Elaborated,
    lights: &shade::LightRegisters,
    slot: usize,
    fragment: &Slot,
    pixel: [u32; 2],
    tap: &mut Tap<P>,
) -> Layer {
    let Premultiplied { colour, opacity } =
        if fragment.shaded { machine.fragment.shaded(fragment, tap) } else { shade_slot(machine, lights, fragment, pixel, tap) };
    layer_of(slot, fragment, &shade::Output { colour, opacity })
}

/// A fragment as resolve is given it, with its light.
pub(super) fn layer_of(slot: usize, fragment: &Slot, light: &shade::Output) -> Layer {
    let weight = if fragment.shaded { 0 } else { fragment.sums[WEIGHT] };
    Layer { slot, depth: fragment.depth, weight, merged: fragment.shaded, colour: light.colour, opacity: light.opacity }
}
