//! Gauss: the table of e^(−r/2), from the ROM's words through interpolation and rounding.
//!
//! Two lemmas in one script. First, for each step: the ROM's line begins and ends within half an
//! LSB of the exponential (nearest: its word is as close to the exponential of the middle). Second,
//! for any such line: the rounded result lies within the bound.
//!
//! Gappa has no exponential. The script states two facts about it: its value at the ends or middles
//! of the steps, to 2^−54, and its greatest distance within a step from the chord or from the
//! middle. A test checks both against an independent exponential.

use super::script::{Script, number, within, word, words};
use super::{Proof, range, rounding};
use rtl_model::functions::table::{EXP_FRAC_BITS, gaussian_words, real};
use rtl_model::machine::{Interpolation, TableShape};
use rtl_model::pipeline::Elaborated;
use rtl_model::real::{Near, Real, Scale, power_of_two};

/// Error of the table's exponential, in ulp (`the_exponential_is_right_to_two_to_the_minus_54`).
const EXP_ERROR: i64 = 1 << (EXP_FRAC_BITS - 54);

/// Slope and curvature of e^(−r/2), at most.
const SLOPE: f64 = 0.5;
const CURVATURE: f64 = 0.25;

const GROUNDS: [&str; 4] = [
    "Assumed: e<i>, exp(-r/2) at the steps' ends (linear) or middles (nearest), to 2^-54; E, exp(-r/2) anywhere in a step, at most 1",
    "and, by its slope and curvature, at most this far below the chord h between a and b (linear), or from the middle's a (nearest).",
    "Both are tested for every argument of the named machines: the_exponential_is_where_the_proofs_assume_it.",
    "The goal about a range: no word saturates.",
];

/// |falloff − e^(−r/2)| for every radial index r.
pub fn table(machine: &Elaborated) -> Proof {
    let m = &machine.machine.gauss;
    let (table, argument) = (machine.gaussian(), m.radial_index.format);
    let TableShape {
        index_bits,
        interpolation,
    } = m.table;
    let step = table.step() * power_of_two(argument.int_bits);
    let between = real::between(interpolation, step, SLOPE, CURVATURE);
    let unfitted = machine.gauss_table_error();
    let bound = Near::within(SLOPE, unfitted)
        .fit(table.fit(), Scale::ONE)
        .error;

    let frac_bits = m.falloff.format.frac_bits;
    // Half an LSB; and a whole one more, by which a table that does not hold 1 is scaled.
    let halves = if m.falloff.format.max() < m.falloff.format.one() {
        3
    } else {
        1
    };
    let half = word(halves, frac_bits + 1);
    let lines: Vec<(i64, i64)> = table.lines().collect();
    let ends = lines
        .iter()
        .flat_map(|(value, step)| [*value, value + step]);
    let (least, most) = ends.fold((i64::MAX, i64::MIN), |(least, most), end| {
        (least.min(end), most.max(end))
    });
    let rom = words(least, most, frac_bits);

    let mut s = Script::default();
    let falloff = rounding(m.falloff);
    s.goals.extend([
        format!("w - E in {}", within(bound)),
        format!("w in {}", range(m.falloff)),
    ]);
    s.hypotheses.extend([
        format!("v in {rom}"),
        format!("v - a in [-{half},{half}]"),
        "E in [0,1]".into(),
    ]);
    let (lemma, kind) = match interpolation {
        Interpolation::Nearest => {
            s.definitions.push(format!("w = {falloff}(v)"));
            s.hypotheses.push(format!("a - E in {}", within(between)));
            s.rewritings
                .push("w - E -> (w - v) + (v - a) + (a - E)".into());
            (
                "v is the step's word, and a the exponential of the step's middle.",
                "nearest",
            )
        }
        Interpolation::Linear => {
            s.definitions.extend([
                "p = v + d*f".into(),
                "h = a + (b - a)*f".into(),
                format!("w = {falloff}(p)"),
            ]);
            s.hypotheses.extend([
                format!("v + d in {rom}"),
                format!("v + d - b in [-{half},{half}]"),
                "f in [0,1]".into(),
            ]);
            s.hypotheses
                .push(format!("h - E in [0,{}]", number(between)));
            s.rewritings
                .push("w - E -> (w - p) + (p - h) + (h - E)".into());
            // Between two ends a line is no farther off than at the worse end: the rest of the
            // limit is a sum of products of non-negative terms.
            s.rewritings.push(format!(
                "p - h -> {half} - (({half} - (v - a))*(1 - f) + ({half} - (v + d - b))*f)"
            ));
            s.rewritings.push(format!(
                "p - h -> ((v - a) + {half})*(1 - f) + ((v + d - b) + {half})*f - {half}"
            ));
            s.rewritings.push("p -> v*(1 - f) + (v + d)*f".into());
            let most = word(most, frac_bits);
            s.rewritings.push(format!(
                "p -> {most} - (({most} - v)*(1 - f) + ({most} - (v + d))*f)"
            ));
            (
                "v and v + d are the ROM's words at the step's ends, a and b the exponentials there, f is the fraction of r.",
                "linear",
            )
        }
    };
    for (i, exact) in gaussian_words(
        index_bits,
        argument.int_bits,
        interpolation,
        1 << EXP_FRAC_BITS,
    )
    .into_iter()
    .enumerate()
    {
        s.hypotheses.push(format!(
            "e{i} in {}",
            words(exact - EXP_ERROR, exact + EXP_ERROR, EXP_FRAC_BITS as i32)
        ));
    }
    // An interval around each word.
    let around = |i: usize, word: i64| {
        format!(
            "e{i} in {}",
            words(2 * word - halves, 2 * word + halves, frac_bits + 1)
        )
    };
    for (i, (value, delta)) in lines.into_iter().enumerate() {
        s.goals.push(around(i, value));
        if interpolation == Interpolation::Linear {
            s.goals.push(around(i + 1, value + delta));
        }
    }
    let what = format!(
        "falloff w = exp(-r/2) of the radial index r by a table of {} steps, {kind}.",
        1 << index_bits
    );
    let formats = format!("r {}; the ROM's words and w {}.", m.radial_index, m.falloff);
    let steps = "For each step: the goal about e<i> is half an ulp around the ROM's word. For all steps, by these goals:";
    let grounds: Vec<&str> = [steps, lemma].into_iter().chain(GROUNDS).collect();
    let proof = Proof {
        name: "gauss.table".into(),
        claim: "|falloff - exp(-r/2)|".into(),
        word: m.falloff,
        bound,
        script: s,
    };
    proof.explained(&machine.machine.name, &what, &formats, &grounds)
}
