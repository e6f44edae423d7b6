//! Raster: forward differencing, from the seed through n columns (and n rows if rows are
//! differenced) to the last register; or, with direct evaluation, from the offset of a pixel to r.

use super::script::{Script, within, words};
use super::{Proof, rounding};
use rtl_model::Machine;
use rtl_model::machine::Rows;
use rtl_model::num::Word;
use rtl_model::units::raster::real::steps_error;
use rtl_model::units::raster::square;

const GROUNDS: [&str; 4] = [
    "x, y is the offset where the registers are seeded, xx, xy, yy the conic, both in their words; X, Y is the last pixel's.",
    "R, F, G are the registers radial, first by column, first by row, numbered by adds; Sx, Sy, Sb the second differences.",
    "Assumed: none of gradient, first and second saturates (each run counts that).",
    "Not proved: that the register does not wrap. The claim is modulo its reach: a_wrap_is_harmless_inside_the_footprint.",
];

const DIRECT_GROUNDS: [&str; 3] = [
    "x, y is the offset of the pixel, xx, xy, yy the conic, both in their words.",
    "Assumed: no square saturates (each run counts that).",
    "Not proved: that r does not wrap. The claim is modulo the reach of its word.",
];

/// |radial − r| with direct evaluation, of a pixel at most `reach_px` from the splat's centre.
fn direct(machine: &Machine, square: Word, reach_px: u32) -> Proof {
    let m = &machine.raster;
    let bound = steps_error(machine, f64::from(reach_px), [0; 2]);
    let mut s = Script::default();
    for (name, word) in [
        ("xx", machine.ellipse.conic),
        ("xy", machine.ellipse.conic_cross),
        ("yy", machine.ellipse.conic),
    ] {
        let format = word.format;
        s.hypotheses
            .push(format!("@FIX({name},{})", -format.frac_bits));
        s.hypotheses.push(format!(
            "{name} in {}",
            words(format.min(), format.max(), format.frac_bits)
        ));
    }
    for name in ["x", "y"] {
        s.hypotheses
            .push(format!("@FIX({name},{})", -m.offset.format.frac_bits));
        s.hypotheses
            .push(format!("{name} in {}", within(f64::from(reach_px))));
    }
    for (name, exact) in [("sx", "x*x"), ("sb", "x*y"), ("sy", "y*y")] {
        s.definitions
            .push(format!("{name} = {}({exact})", rounding(square)));
    }
    let sum = "xx*sx + 2*xy*sb + yy*sy";
    s.definitions.extend([
        format!("R = {}({sum})", rounding(m.radial)),
        "r = xx*x*x + 2*xy*x*y + yy*y*y".into(),
    ]);
    s.goals.push(format!("R - r in {}", within(bound)));
    s.rewritings.push(format!(
        "R - r -> (R - ({sum})) + xx*(sx - x*x) + 2*xy*(sb - x*y) + yy*(sy - y*y)"
    ));
    let proof = Proof {
        name: format!("raster.radial.{reach_px}"),
        claim: "|radial - r|".into(),
        word: m.radial,
        bound,
        script: s,
    };
    proof.explained(
        &machine.name,
        &format!("r of a pixel that is at most {reach_px} px from the centre in x and y."),
        &format!(
            "Conic {}, offset {}, square {square}, radial {}.",
            machine.ellipse.conic, m.offset, m.radial
        ),
        &DIRECT_GROUNDS,
    )
}

/// |radial − r| after `steps` columns, and as many rows if they are differenced, of a box that
/// begins at most `steps` pixels from the splat's centre.
pub fn radial(machine: &Machine, steps: u32) -> Proof {
    let m = &machine.raster;
    if m.rows == Rows::Direct {
        return direct(machine, square(machine), steps);
    }
    let rows = if m.rows == Rows::Differenced {
        steps
    } else {
        0
    };
    let bound = steps_error(machine, f64::from(steps), [steps, steps]);
    let pairs = steps * (steps - 1) / 2;
    let mut s = Script::default();
    for (name, word) in [
        ("xx", machine.ellipse.conic),
        ("xy", machine.ellipse.conic_cross),
        ("yy", machine.ellipse.conic),
    ] {
        s.hypotheses
            .push(format!("@FIX({name},{})", -word.format.frac_bits));
    }
    for name in ["x", "y"] {
        s.hypotheses
            .push(format!("@FIX({name},{})", -m.offset.format.frac_bits));
        s.hypotheses
            .push(format!("{name} in {}", within(f64::from(steps))));
    }
    // Every rounded word, and how often its loss counts at the last pixel.
    let seed = [
        ("gx", m.gradient, "xx*x + 2*xy*y", "x".to_owned()),
        ("gy", m.gradient, "yy*y", "y".to_owned()),
        ("R0", m.radial, "x*gx + y*gy", "1".to_owned()),
        ("F0", m.first, "2*xx*x + xx + 2*xy*y", steps.to_string()),
        ("Sx", m.second, "2*xx", pairs.to_string()),
    ];
    let of_rows = [
        ("G0", m.first, "2*yy*y + yy + 2*xy*x", rows.to_string()),
        ("Sy", m.second, "2*yy", pairs.to_string()),
        ("Sb", m.second, "2*xy", (rows * steps).to_string()),
    ];
    let mut losses = Vec::new();
    for (name, word, exact, times) in seed
        .into_iter()
        .chain(of_rows.into_iter().filter(|_| rows > 0))
    {
        s.definitions
            .push(format!("{name} = {}({exact})", rounding(word)));
        losses.push(format!("{times}*({name} - ({exact}))"));
    }
    // Down the first column of the box, then along the row.
    let adds = rows + steps;
    for (n, next) in (0..adds).map(|n| (n, n + 1)) {
        let [by, first, second] = if n < rows {
            ["G", "F", "Sb"]
        } else {
            ["F", "F", "Sx"]
        };
        s.definitions.push(format!("R{next} = R{n} + {by}{n}"));
        s.definitions
            .push(format!("{first}{next} = {first}{n} + {second}"));
        if n < rows {
            s.definitions.push(format!("G{next} = G{n} + Sy"));
        }
    }
    s.definitions.extend([
        format!("X = x + {steps}"),
        format!("Y = y + {rows}"),
        "r = xx*X*X + 2*xy*X*Y + yy*Y*Y".into(),
    ]);
    s.goals.push(format!("R{adds} - r in {}", within(bound)));
    s.rewritings
        .push(format!("R{adds} - r -> {}", losses.join(" + ")));
    let way = if rows > 0 {
        format!("{steps} columns and {rows} rows from the box's first pixel")
    } else {
        format!("{steps} columns from a row's first pixel")
    };
    let what = format!("r after {way}, which is at most {steps} px from the centre in x and y.");
    let formats = format!(
        "Conic {}, offset {}, gradient {}, radial {}, first {}, second {}.",
        machine.ellipse.conic, m.offset, m.gradient, m.radial, m.first, m.second
    );
    let proof = Proof {
        name: format!("raster.radial.{steps}"),
        claim: "|radial - r|".into(),
        word: m.radial,
        bound,
        script: s,
    };
    proof.explained(&machine.name, &what, &formats, &GROUNDS)
}
