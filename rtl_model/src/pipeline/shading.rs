//! Shading: the ports to shade, from setup, from fragment and from resolve.

use super::Elaborated;
use crate::frame::Splat;
use crate::kernels::host::Kernel;
use crate::num::{LANES, Lanes, Words, three};
use crate::probe::{Probe, Tap};
use crate::records::{Layer, NORMAL, OPACITY, Premultiplied, SUMS, Slot, WEIGHT};
use crate::units::shade;
use crate::units::shade::lanes::Fragments;

/// A splat as shade is given it, where it is lit before it is drawn.
pub(super) fn emitting<P: Probe>(
    machine: &Elaborated,
    rgb: [i32; 3],
    normal: [i32; 3],
    material: u32,
    tap: &mut Tap<P>,
) -> shade::Input {
    input_of(
        &machine.fragment.emitting(rgb, normal, material, tap),
        [0; 2],
    )
}

/// The light of a splat, in the words of its colour.
pub(super) fn emitted<P: Probe>(
    machine: &Elaborated,
    light: [i64; 3],
    tap: &mut Tap<P>,
) -> [i32; 3] {
    three!(channel => tap.fit_one(&machine.emission, light[channel]) as i32)
}

/// The port from fragment to shade. A call of its own, so that its instructions can be told from
/// those of fragment.
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
    let Premultiplied { colour, opacity } = if fragment.shaded {
        machine.fragment.shaded(fragment, tap)
    } else {
        shade_slot(machine, lights, fragment, pixel, tap)
    };
    layer_of(slot, fragment, &shade::Output { colour, opacity })
}

/// A fragment as resolve is given it, with its light.
pub(super) fn layer_of(slot: usize, fragment: &Slot, light: &shade::Output) -> Layer {
    let weight = if fragment.shaded {
        0
    } else {
        fragment.sums[WEIGHT]
    };
    Layer {
        slot,
        depth: fragment.depth,
        weight,
        merged: fragment.shaded,
        colour: light.colour,
        opacity: light.opacity,
    }
}

/// Up to eight fragments to shade.
pub(super) struct ShadeEight<'a, P> {
    pub shade: &'a shade::Shade,
    pub lights: &'a shade::LightRegisters<'a>,
    pub inputs: &'a [shade::Input],
    pub probe: &'a mut P,
}

impl<P: Probe> Kernel for ShadeEight<'_, P> {
    type Output = [shade::Output; LANES];

    #[inline(always)]
    fn run<V: Lanes>(self) -> [shade::Output; LANES] {
        let ShadeEight {
            shade,
            lights,
            inputs,
            probe,
        } = self;
        // Beyond the last fragment, the last again: a lane that is not observed.
        let all: [shade::Input; LANES] =
            std::array::from_fn(|lane| inputs[lane.min(inputs.len() - 1)]);
        let mut outputs = [shade::Output::default(); LANES];
        let fragments = Fragments::<V::Words>::of(&all);
        let by_material = ByMaterial {
            materials: all.map(|input| input.material),
            left: ((1u32 << inputs.len()) - 1) as u8,
        };
        for (material, same) in by_material {
            let tap = &mut Tap::new(&mut *probe);
            tap.live = same;
            let shaded = shade.lanes(lights, material, fragments, tap).outputs();
            (0..LANES)
                .filter(|lane| same & 1 << lane != 0)
                .for_each(|lane| outputs[lane] = shaded[lane]);
        }
        outputs
    }
}

/// Lights up to eight splats before they are drawn, on a machine whose sums have at most 32 bits.
pub(super) struct EmitEight<'a, P> {
    pub machine: &'a Elaborated,
    pub lights: &'a shade::LightRegisters<'a>,
    pub splats: &'a [Splat],
    /// Colours, by channel.
    pub rgb: [[i32; LANES]; 3],
    /// Camera-space normals, by part.
    pub normals: [[i32; LANES]; 3],
    /// The splats that are drawn.
    pub live: u8,
    pub probe: &'a mut P,
}

impl<P: Probe> Kernel for EmitEight<'_, P> {
    /// Red, green and blue.
    type Output = [[i32; LANES]; 3];

    #[inline(always)]
    fn run<V: Lanes>(self) -> [[i32; LANES]; 3] {
        let EmitEight {
            machine,
            lights,
            splats,
            rgb,
            normals,
            live,
            probe,
        } = self;
        let mut materials = [0; LANES];
        for (lane, splat) in splats.iter().enumerate().take(LANES) {
            materials[lane] = splat.material;
        }
        let tap = &mut Tap::new(&mut *probe);
        tap.live = live;
        let sums = machine.fragment.emitting_lanes(
            three!(i => V::Words::from_array(rgb[i])),
            three!(i => V::Words::from_array(normals[i])),
            tap,
        );
        let fragments = Fragments::of_sums(sums);
        let mut light = [V::Words::splat(0); 3];
        let by_material = ByMaterial {
            materials,
            left: live,
        };
        for (material, same) in by_material {
            let tap = &mut Tap::new(&mut *probe);
            tap.live = same;
            let shaded = machine.shade.lanes(lights, material, fragments, tap);
            let is_same = std::array::from_fn(|lane| -i32::from(same & 1 << lane != 0));
            let is_same = V::Words::from_array(is_same);
            light = three!(i => shaded.colour[i].where_else(is_same, light[i]));
        }
        let tap = &mut Tap::new(&mut *probe);
        tap.live = live;
        three!(i => tap.fit_words(&machine.emission, light[i].exact()).to_array())
    }
}

/// The materials of the live lanes of eight, each with the lanes that have it. An iterator, because
/// a closure would be compiled without the host's vector instructions.
struct ByMaterial {
    materials: [u32; LANES],
    left: u8,
}

impl Iterator for ByMaterial {
    type Item = (u32, u8);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, u8)> {
        // Mostly one material.
        let material = *self.materials.get(self.left.trailing_zeros() as usize)?;
        let mut same = 0;
        for (lane, of_lane) in self.materials.iter().enumerate() {
            same |= u8::from(*of_lane == material) << lane;
        }
        same &= self.left;
        self.left &= !same;
        Some((material, same))
    }
}
