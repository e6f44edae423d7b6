//! Fragment over the reals: bounds the distance of sums and merged fragments from the exact ones.
//!
//! p(word) is an ulp. A truncated word loses up to a whole ulp, downwards, where this text gives
//! half an ulp.
//! ```text
//! accumulate   one contribution adds ½p(sum) to its own error, nothing where the sum has all of the product's places;
//!              K of them K·½p(sum): one-sided, and so without cancelling, where the sum is truncated
//! store, read  a shaded word in a slot: ½p(sum), then ½p(premultiplied), and neither where the sum can hold every shaded word
//! blend        C_f + C_b·(1 − α_f): δC_f + (1 − α_f)·δC_b + (C_b + δC_b)·δα_f + ½p(sum)
//!              1 − (1 − α_f)·(1 − α_b): (1 − α_b)·δα_f + (1 − α_f)·δα_b + δα_f·δα_b + ½p(sum)
//! ```
//! Each result is clamped to its word's limits. Colours and opacity each have their sum's format.
//!
//! Laws: `accumulating_is_within_its_bound`, `merging_is_within_its_bound`, and `…_is_tight` of
//! both.

use super::{COLOUR, Fragment, NORMAL};
use crate::num::Fit;
use crate::real::{Real, Scale};

impl Fragment {
    /// A sum after one more contribution: lane by lane as in [`super::Sums`].
    pub fn real_accumulated<R: Real>(&self, lane: usize, sum: R, weight: R, attribute: R) -> R {
        let fit = &self.sums[lane];
        (sum + weight * attribute).refit(fit.word.format.frac_bits + fit.places() as i32, fit)
    }

    /// A splat's colour and normal as sums of weight 1.
    pub fn real_emitting<R: Real>(&self, rgb: [R; 3], normal: [R; 3]) -> ([R; 3], [R; 3]) {
        let held = |attribute: R, lane: usize| attribute.fit(&self.sums[lane], Scale::ONE);
        (
            rgb.map(|channel| held(channel, COLOUR)),
            normal.map(|part| held(part, NORMAL)),
        )
    }

    /// Greatest error, down and up, that the roundings of this many contributions cause, where the
    /// sum stays in its format's range.
    pub fn accumulation_loss(&self, lane: usize, contributions: u32) -> [f64; 2] {
        let (fit, format) = (&self.sums[lane], self.sums[lane].word.format);
        if fit.places() <= 0 && !format.is_float() {
            return [0.0; 2];
        }
        let place = format.value(1) * format.ulp_at(f64::INFINITY);
        fit.word
            .loss()
            .map(|ulps| ulps * f64::from(contributions) * place)
    }

    /// Words that a slot holds of a shaded fragment, as a merge or resolve reads them.
    pub fn real_stored<R: Real>(&self, shaded: [R; 4]) -> [R; 4] {
        let [r, g, b, opacity] = shaded;
        let [of_colour, of_opacity] = &self.store;
        let [r, g, b] = [r, g, b].map(|channel| self.kept(channel, of_colour));
        [r, g, b, self.kept(opacity, of_opacity)]
    }

    fn kept<R: Real>(&self, shaded: R, store: &Fit) -> R {
        if self.keeps_all(store) {
            return shaded;
        }
        self.real_read_from(
            shaded.refit(self.premultiplied_frac_bits as i32, store),
            store,
        )
    }

    /// Whether a slot's word has all places and the range of a shaded one.
    fn keeps_all(&self, store: &Fit) -> bool {
        let (slot, shaded) = (store.word.format, self.read[0].word.format);
        slot.frac_bits >= shaded.frac_bits
            && slot.value(slot.max()) >= shaded.value(shaded.max())
            && slot.kept_bits() >= shaded.kept_bits()
            && slot.value(slot.least_magnitude()) <= shaded.value(shaded.least_magnitude())
    }

    /// A shaded slot's colour times opacity, and opacity, as a merge or resolve reads them.
    pub fn real_read<R: Real>(&self, slot: [R; 4]) -> [R; 4] {
        let [r, g, b, opacity] = slot;
        let [of_colour, of_opacity] = &self.blend;
        let [r, g, b] = [r, g, b].map(|channel| self.real_read_from(channel, of_colour));
        [r, g, b, self.real_read_from(opacity, of_opacity)]
    }

    fn real_read_from<R: Real>(&self, slot: R, from: &Fit) -> R {
        slot.refit(from.word.format.frac_bits, &self.read[0])
    }

    /// Front over back, into a slot.
    pub fn real_blend<R: Real>(&self, front: [R; 4], back: [R; 4]) -> [R; 4] {
        let one = R::constant(1.0);
        let through = one - front[3];
        let [of_colour, of_opacity] = &self.blend;
        // α_f + α_b·(1 − α_f) as 1 − (1 − α_f)·(1 − α_b): each error counts once, and is scaled by
        // what the other fragment lets through.
        let opacity = one - through * (one - back[3]);
        std::array::from_fn(|i| {
            if i < 3 {
                (front[i] + back[i] * through).fit(of_colour, Scale::ONE)
            } else {
                opacity.fit(of_opacity, Scale::ONE)
            }
        })
    }
}

#[cfg(test)]
mod tests;
