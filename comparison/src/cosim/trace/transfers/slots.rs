//! Slots: fragments, and what is shaded, as words of records.

use super::super::observer::Shaded;
use rtl_model::units::fragment::sheets::Held;
use rtl_model::units::fragment::{COLOUR, NORMAL, OPACITY, Slot, WEIGHT};
use rtl_model::units::resolve::Layer;

pub(super) fn slot_words([x, y]: [u32; 2], number: usize, slot: &Slot, words: &mut Vec<i64>) {
    words.extend([
        x.into(),
        y.into(),
        number as i64,
        slot.shaded.into(),
        slot.depth,
        slot.material.into(),
    ]);
    words.extend(slot.sums);
}

pub(super) fn sums_of(shaded: &Shaded, words: &mut Vec<i64>) {
    let input = &shaded.input;
    words.push(input.weight);
    words.extend(input.colour);
    words.push(input.opacity);
    words.extend(input.normal);
    words.push(input.material.into());
}

pub(super) fn light_of(shaded: &Shaded, words: &mut Vec<i64>) {
    words.extend(shaded.output.colour);
    words.push(shaded.output.opacity);
}

pub(super) fn light(layer: &Layer) -> [i64; 4] {
    let [r, g, b] = layer.colour;
    [r, g, b, layer.opacity]
}

const _: () = assert!(
    WEIGHT == 0 && COLOUR == 1 && OPACITY == 4 && NORMAL == 5,
    "sums lie in the order of their record"
);

/// The pixel of a sheet: the blended part, and the open sheet.
pub(super) fn pixel_words([x, y]: [u32; 2], slots: &[Slot], words: &mut Vec<i64>) {
    let held = Held::of(slots);
    let (sheet, open) = held.open.unwrap_or_default();
    words.extend([x, y, held.stopped.into(), held.open.is_none().into()].map(i64::from));
    words.extend(&held.composite[COLOUR..=OPACITY]);
    words.push(sheet.into());
    words.extend(&open[WEIGHT..OPACITY]);
}
