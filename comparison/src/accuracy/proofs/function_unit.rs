//! Function units: reciprocal and reciprocal root, from the table's words through every Newton
//! step.
//!
//! Two lemmas in one script. First, for each step of the table: its word is right to the table's
//! error for all mantissas of the step. Second, for any mantissa and first guess that are right to
//! that error: the Newton steps, rounded as in the unit, end within the bound. Every mantissa lies
//! in one of the steps and its guess is that step's word, so the first lemma proves the hypothesis
//! of the second.

use super::script::{Script, near_one, number, within, word, words};
use super::{Proof, range, rounding};
use rtl_model::functions::{Reciprocal, ReciprocalRoot};
use rtl_model::num::{Format, Rounding, Word};

const LEMMAS: [&str; 4] = [
    "For each step of the table: m<i> is any mantissa in it, and the constant is the ROM's word.",
    "For all mantissas m and first guesses y0: the hypothesis about their product is the conclusion of the goals about single steps,",
    "because m is in one of the steps and y0 is that step's word. The goals about ranges: no word saturates.",
    "A test checks that operands are normalised correctly: normalisation_restores_the_operand.",
];

/// |x·y − 1| of a reciprocal.
pub fn reciprocal(machine: &str, signal: &str, unit: &Reciprocal) -> Proof {
    let shape = unit.shape();
    let bits = shape.bits as i32;
    let result = Word::new(Format::unsigned(1, bits));
    let mantissa = result.rounded(Rounding::Truncate);
    let (first, bound) = (unit.table_error(), unit.relative_error());
    let mut s = Script::default();
    let last = shape.newton_steps;
    s.definitions.push(format!("m = {}(x)", rounding(mantissa)));
    s.goals.push(format!("x*y{last} - 1 in {}", within(bound)));
    for (k, next) in (0..last).map(|k| (k, k + 1)) {
        s.definitions
            .push(format!("c{next} = {}(2 - m*y{k})", rounding(result)));
        s.definitions
            .push(format!("y{next} = {}(y{k}*c{next})", rounding(result)));
        s.goals
            .extend(["c", "y"].map(|name| format!("{name}{next} in {}", range(result))));
        // With e = m·y − 1: a step leaves −e², plus the errors of the two roundings.
        s.rewritings
            .push(format!("m*y{next} - 1 -> m*y{k}*(c{next} - (2 - m*y{k})) + m*(y{next} - y{k}*c{next}) - (m*y{k} - 1)*(m*y{k} - 1)"));
    }
    s.rewritings.push(format!(
        "x*y{last} - 1 -> (m*y{last} - 1) + (x - m)*y{last}"
    ));
    s.hypotheses.extend([
        "x in [1,2]".into(),
        guesses(&unit.guesses(), bits),
        format!("m*y0 - 1 in {}", within(first)),
    ]);
    let steps = 1 << shape.table_bits;
    for (i, guess) in (0..).zip(&unit.guesses()) {
        s.hypotheses.push(format!(
            "m{i} in {}",
            words(steps + i, steps + i + 1, shape.table_bits as i32)
        ));
        s.goals.push(format!(
            "m{i}*{} in {}",
            word(*guess, bits),
            near_one(first)
        ));
    }
    let what = format!(
        "y = 1/x by a table of {steps} words and {last} Newton steps, x normalised to [1,2)."
    );
    let formats = format!(
        "Mantissa m {mantissa}, truncated; correction c and result y {result}, rounded to nearest, ties up."
    );
    let proof = Proof {
        name: signal.into(),
        claim: "|x*y - 1|".into(),
        word: result,
        bound,
        script: s,
    };
    proof.explained(machine, &what, &formats, &LEMMAS)
}

/// |√x·y − 1| of a reciprocal root, and |m·y/√x − 1| of the root that is computed from it.
///
/// Roots are variables, s of the operand and t of its mantissa, so that all expressions are
/// polynomials.
pub fn root(machine: &str, signal: &str, unit: &ReciprocalRoot) -> Proof {
    let shape = unit.shape();
    let bits = shape.bits as i32;
    let result = Word::new(Format::unsigned(1, bits));
    let mantissa = Word::new(Format::unsigned(2, bits - 1)).rounded(Rounding::Truncate);
    let (first, bound) = (unit.table_error(), unit.relative_error());
    let mut s = Script::default();
    let last = shape.newton_steps;
    s.definitions.extend([
        "x = s*s".into(),
        "m = t*t".into(),
        format!("cut = {}(v)", rounding(mantissa)),
    ]);
    s.goals.extend([
        format!("s*y{last} - 1 in {}", within(bound)),
        format!("m*y{last}/s - 1 in {}", within(bound)),
    ]);
    for (k, next) in (0..last).map(|k| (k, k + 1)) {
        s.definitions
            .push(format!("q{next} = {}(y{k}*y{k})", rounding(result)));
        s.definitions.push(format!(
            "c{next} = {}((3 - m*q{next})*1b-1)",
            rounding(result)
        ));
        s.definitions
            .push(format!("y{next} = {}(y{k}*c{next})", rounding(result)));
        s.goals
            .extend(["q", "c", "y"].map(|name| format!("{name}{next} in {}", range(result))));
        // With e = t·y − 1: a step leaves −(3e² + e³)/2, plus the errors of the three roundings.
        let (z, e) = (format!("t*y{k}"), format!("(t*y{k} - 1)"));
        s.rewritings.push(format!(
            "t*y{next} - 1 -> {z}*(c{next} - (3 - m*q{next})*1b-1) - 1b-1*m*{z}*(q{next} - y{k}*y{k}) + t*(y{next} - y{k}*c{next}) - 1b-1*{e}*{e}*(3 + {e})"
        ));
    }
    s.rewritings.extend([
        format!("s*y{last} - 1 -> (t*y{last} - 1) + (s - t)*y{last}"),
        format!("m*y{last}/s - 1 -> (t*y{last} - 1) - t*y{last}*((s - t)/s) {{ s <> 0 }}"),
        "s - t -> (x - m)/(s + t) { s + t <> 0 }".into(),
    ]);
    // The loss of truncating any v is the assumed difference of x and m.
    let cut = format!("[0,{}]", number(mantissa.format.value(1)));
    s.goals.push(format!("v - cut in {cut}"));
    s.hypotheses.extend([
        "s in [1,2]".into(),
        "t in [1,2]".into(),
        format!("x - m in {cut}"),
    ]);
    let asked = |i: &i64| (i + 1) * 4 > 1 << shape.table_bits;
    let of_table: Vec<(i64, i64)> = (0..)
        .zip(unit.guesses())
        .filter(|(i, _)| asked(i))
        .collect();
    let asked_words: Vec<i64> = of_table.iter().map(|(_, guess)| *guess).collect();
    s.hypotheses.extend([
        guesses(&asked_words, bits),
        format!("t*y0 - 1 in {}", within(first)),
    ]);
    let step = 4.0 / unit.guesses().len() as f64;
    for (i, guess) in of_table {
        let [from, to] = [i as f64 * step, (i + 1) as f64 * step];
        s.hypotheses.push(format!(
            "m{i} in [{},{}]",
            number(from.max(1.0)),
            number(to)
        ));
        s.goals.push(format!(
            "sqrt(m{i})*{} in {}",
            word(guess, bits),
            near_one(first)
        ));
    }
    let what = format!(
        "y = 1/sqrt(x) by a table of {} words and {last} Newton steps, x normalised to [1,4).",
        unit.guesses().len()
    );
    let formats = format!(
        "Mantissa m {mantissa}, truncated; square q, half correction c and result y {result}, rounded to nearest, ties up."
    );
    let roots = [
        "s is the root of x and t that of m; m is x truncated, and v is any number that is truncated.",
        "The same bound holds for |m*y/sqrt(x) - 1|, the root that is a product of mantissa and result.",
    ];
    let grounds: Vec<&str> = roots.into_iter().chain(LEMMAS).collect();
    let claim = "|sqrt(x)*y - 1|".into();
    let proof = Proof {
        name: signal.into(),
        claim,
        word: result,
        bound,
        script: s,
    };
    proof.explained(machine, &what, &formats, &grounds)
}

/// The range of first guesses.
fn guesses(table: &[i64], bits: i32) -> String {
    let (least, most) = table
        .iter()
        .fold((i64::MAX, i64::MIN), |(least, most), word| {
            (least.min(*word), most.max(*word))
        });
    format!("y0 in {}", words(least, most, bits))
}
