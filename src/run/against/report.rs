//! Report: figures of a frame against its photograph, their means over frames, and tables of both
//! for a terminal.

use super::photograph::Photograph;
use crate::accuracy::{Fidelity, db_text, fidelity};
use crate::output::picture::Picture;
use crate::output::text::{aligned, plain_table, wrapped};
use schemars::JsonSchema;
use serde::Serialize;

/// Greatest number of frames in a table.
const MOST_ROWS: usize = 20;

/// A frame against its photograph, in code values (sRGB as files store it, not linear light). The
/// drawn pictures are rounded to the photograph's number of bits, like their PNG files. They are
/// over black where they are not opaque.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(rename = "AgainstPhotograph")]
pub struct Against {
    /// The photograph's file.
    pub picture: String,
    /// Bits per channel of the photograph, 8 or 16.
    pub bits: u32,
    /// Fidelity of exact arithmetic.
    pub golden: Fidelity,
    /// Fidelity of the machine.
    pub fixed: Fidelity,
    /// Loss by the machine's arithmetic.
    pub fixed_minus_golden: Loss,
}

/// Means over all frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(rename = "AgainstPhotographs")]
pub struct Means {
    /// Fidelity of exact arithmetic.
    pub golden: Fidelity,
    /// Fidelity of the machine.
    pub fixed: Fidelity,
    /// Loss by the machine's arithmetic.
    pub fixed_minus_golden: Loss,
}

/// Fixed minus golden, each against a photograph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Loss {
    /// Below 0 if the machine is farther from the photograph. 0 if both pictures equal it; none if
    /// only one of them does. A mean is none if a frame has none.
    pub psnr_db: Option<f64>,
    /// Below 0 if the machine is farther from the photograph.
    pub ssim: f64,
    /// Above 0 if the machine is farther from the photograph.
    pub flip: f64,
}

impl Loss {
    fn new(golden: &Fidelity, fixed: &Fidelity) -> Self {
        let psnr_db = match (golden.psnr_db, fixed.psnr_db) {
            (Some(golden), Some(fixed)) => Some(fixed - golden),
            (None, None) => Some(0.0),
            _ => None,
        };
        Loss {
            psnr_db,
            ssim: fixed.ssim - golden.ssim,
            flip: fixed.flip - golden.flip,
        }
    }
}

impl Against {
    pub(super) fn new(
        photograph: &Photograph,
        golden: &Picture,
        fixed: &Picture,
        encoded: bool,
    ) -> Self {
        let Photograph {
            name,
            bits,
            picture,
            ..
        } = photograph;
        let [golden, fixed] =
            [golden, fixed].map(|drawn| fidelity(&drawn.stored(encoded, *bits), picture));
        Against {
            picture: name.clone(),
            bits: *bits,
            golden,
            fixed,
            fixed_minus_golden: Loss::new(&golden, &fixed),
        }
    }

    /// The table of one frame.
    pub fn table(&self) -> String {
        let head = format!(
            "against {}, code values of {} bits:",
            self.picture, self.bits
        );
        format!(
            "{}\n{}",
            wrapped(&head),
            table(&self.golden, &self.fixed, &self.fixed_minus_golden, "equal")
        )
    }
}

impl Means {
    /// Means of these frames; none without frames.
    pub fn new<'a>(frames: impl IntoIterator<Item = &'a Against>) -> Option<Self> {
        let frames: Vec<&Against> = frames.into_iter().collect();
        let count = frames.len() as f64;
        let mean = |value: &dyn Fn(&Against) -> f64| {
            frames.iter().map(|frame| value(frame)).sum::<f64>() / count
        };
        let mean_db = |value: &dyn Fn(&Against) -> Option<f64>| {
            let all: Option<Vec<f64>> = frames.iter().map(|frame| value(frame)).collect();
            all.map(|all| all.iter().sum::<f64>() / count)
        };
        let fidelity = |of: fn(&Against) -> &Fidelity| Fidelity {
            psnr_db: mean_db(&|frame| of(frame).psnr_db),
            ssim: mean(&|frame| of(frame).ssim),
            flip: mean(&|frame| of(frame).flip),
            not_finite: frames.iter().map(|frame| of(frame).not_finite).sum(),
        };
        let fixed_minus_golden = Loss {
            psnr_db: mean_db(&|frame| frame.fixed_minus_golden.psnr_db),
            ssim: mean(&|frame| frame.fixed_minus_golden.ssim),
            flip: mean(&|frame| frame.fixed_minus_golden.flip),
        };
        (!frames.is_empty()).then(|| Means {
            golden: fidelity(|frame| &frame.golden),
            fixed: fidelity(|frame| &frame.fixed),
            fixed_minus_golden,
        })
    }

    /// The means, and a row per frame; with many frames only those with the greatest loss.
    pub fn tables(&self, frames: &[(u64, &Against)]) -> String {
        let head = format!(
            "against photographs, code values, mean of {} frames:",
            frames.len()
        );
        let means = table(
            &self.golden,
            &self.fixed,
            &self.fixed_minus_golden,
            "infinite",
        );
        let mut rows = frames.to_vec();
        // If only golden equals the photograph, the loss is the greatest possible.
        rows.sort_by(|(_, a), (_, b)| {
            let loss = |frame: &Against| {
                frame
                    .fixed_minus_golden
                    .psnr_db
                    .unwrap_or(if frame.golden.psnr_db.is_none() {
                        f64::MIN
                    } else {
                        f64::MAX
                    })
            };
            loss(a).total_cmp(&loss(b))
        });
        rows.truncate(MOST_ROWS);
        rows.sort_by_key(|(frame, _)| *frame);
        let mut each = plain_table(&[
            "frame",
            "golden dB",
            "SSIM",
            "FLIP",
            "fixed dB",
            "SSIM",
            "FLIP",
            "fixed − golden",
        ]);
        for (
            frame,
            Against {
                golden,
                fixed,
                fixed_minus_golden,
                ..
            },
        ) in &rows
        {
            let [
                [golden_db, golden_ssim, golden_flip],
                [fixed_db, fixed_ssim, fixed_flip],
            ] = [golden, fixed].map(|of| cells(of, "equal"));
            let [loss_db, ..] = steps(fixed_minus_golden);
            each.add_row([
                frame.to_string(),
                golden_db,
                golden_ssim,
                golden_flip,
                fixed_db,
                fixed_ssim,
                fixed_flip,
                loss_db,
            ]);
        }
        let rest = frames.len() - rows.len();
        let rest = if rest > 0 {
            format!("\nthose with the greatest loss; {rest} more are in report.json")
        } else {
            String::new()
        };
        format!("{head}\n{means}\n\n{}{rest}", aligned(each).trim_fmt())
    }
}

/// `none` is the text for a missing PSNR.
fn table(golden: &Fidelity, fixed: &Fidelity, loss: &Loss, none: &str) -> String {
    let mut table = plain_table(&["", "PSNR dB", "SSIM", "FLIP"]);
    for (name, cells) in [
        ("golden", cells(golden, none)),
        ("fixed", cells(fixed, none)),
        ("fixed − golden", steps(loss)),
    ] {
        let [db, ssim, flip] = cells;
        table.add_row([name.to_owned(), db, ssim, flip]);
    }
    aligned(table).trim_fmt()
}

fn cells(of: &Fidelity, none: &str) -> [String; 3] {
    [
        db_text(of.psnr_db, of.not_finite, |db| format!("{db:.3}")).replace("equal", none),
        format!("{:.5}", of.ssim),
        format!("{:.5}", of.flip),
    ]
}

fn steps(loss: &Loss) -> [String; 3] {
    let db = loss.psnr_db.map_or("–".into(), |db| format!("{db:+.3}"));
    [
        db,
        format!("{:+.5}", loss.ssim),
        format!("{:+.5}", loss.flip),
    ]
    .map(|step| step.replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn against(golden: Option<f64>, fixed: Option<f64>, ssim: f64) -> Against {
        let of = |psnr_db| Fidelity {
            psnr_db,
            ssim,
            flip: 1.0 - ssim,
            not_finite: 0,
        };
        let [golden, fixed] = [golden, fixed].map(of);
        Against {
            picture: "a.png".into(),
            bits: 8,
            golden,
            fixed,
            fixed_minus_golden: Loss::new(&golden, &fixed),
        }
    }

    /// Worked out by hand.
    #[test]
    fn means_are_infinite_if_one_figure_is() {
        let frames = [
            against(Some(30.0), Some(29.0), 0.5),
            against(Some(20.0), Some(18.0), 0.25),
        ];
        let means = Means::new(&frames).unwrap();
        assert_eq!(
            (
                means.golden.psnr_db,
                means.fixed.psnr_db,
                means.golden.ssim,
                means.fixed.flip
            ),
            (Some(25.0), Some(23.5), 0.375, 0.625)
        );
        assert_eq!(
            means.fixed_minus_golden,
            Loss {
                psnr_db: Some(-1.5),
                ssim: 0.0,
                flip: 0.0
            }
        );
        let frames = [
            against(Some(30.0), Some(29.0), 0.5),
            against(None, None, 1.0),
        ];
        let means = Means::new(&frames).unwrap();
        assert_eq!(
            (
                means.golden.psnr_db,
                means.fixed.psnr_db,
                means.fixed_minus_golden.psnr_db
            ),
            (None, None, Some(-0.5))
        );
        let frames = [against(None, Some(29.0), 0.5)];
        assert_eq!(
            Means::new(&frames).unwrap().fixed_minus_golden.psnr_db,
            None
        );
        assert_eq!(Means::new(&[]), None);
    }

    #[test]
    fn frames_with_the_greatest_loss_are_listed_in_order() {
        let frames: Vec<Against> = (0..30)
            .map(|frame| against(Some(30.0), Some(f64::from(frame)), 0.5))
            .collect();
        let numbered: Vec<(u64, &Against)> = (0..30).rev().zip(&frames).collect();
        let text = Means::new(&frames).unwrap().tables(&numbered);
        let first: Vec<&str> = text
            .lines()
            .filter_map(|line| line.split_whitespace().next())
            .collect();
        let rows: Vec<u32> = first.iter().filter_map(|word| word.parse().ok()).collect();
        assert_eq!(rows, (10..30).collect::<Vec<_>>(), "{text}");
        assert!(
            text.ends_with("those with the greatest loss; 10 more are in report.json"),
            "{text}"
        );
        assert!(
            text.lines().all(|line| line.chars().count() <= 80),
            "{text}"
        );
    }
}
