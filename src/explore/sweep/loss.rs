//! Loss: finds the word, or set of words, that loses a decibel first when bits are removed.

use super::columns;
use super::table::{Row, Table};
use crate::hardware::machines;
use rtl_model::Machine;
use rtl_model::num::Format;

/// Threshold of a loss, dB.
const LOST_DB: f64 = 1.0;

/// A row that only reduces fraction bits.
#[derive(Clone, Debug, PartialEq)]
struct Reduction {
    words: Vec<String>,
    /// The greatest reduction of one word.
    bits: i32,
}

/// A sentence about the row that loses a decibel with the least reduction; of equal ones the one
/// that loses most. None if no row only reduces bits, or none reduces all of its words.
pub(super) fn first(table: &Table, base: &Machine) -> Option<String> {
    let words = machines::words(base);
    let column = [columns::LOCKSTEP_PSNR_DB, columns::PSNR_DB]
        .into_iter()
        .find(|name| {
            table
                .rows
                .iter()
                .any(|row| table.number(row, name).is_some())
        })?;
    let rows: Vec<(&Row, Reduction)> = (table.rows.iter().filter(|row| table.is_drawn(row)))
        .filter_map(|row| Some((row, less(table.text(row, columns::CHANGES), &words)?)))
        .collect();
    // Equal pictures have no PSNR: they count as infinite.
    let db = |row: &Row| table.number(row, column).unwrap_or(f64::INFINITY);
    let whole = |scene: &str| {
        rows.iter()
            .find(|(row, less)| less.bits == 0 && table.text(row, columns::SCENE) == scene)
            .map(|(row, _)| db(row))
    };
    let lost = |(row, less): &(&Row, Reduction)| {
        let before = whole(table.text(row, columns::SCENE))?;
        let loss = if before == db(row) {
            0.0
        } else {
            before - db(row)
        };
        (less.bits > 0).then(|| {
            (
                loss,
                before,
                db(row),
                less.clone(),
                table.text(row, columns::SCENE).to_owned(),
            )
        })
    };
    let losses: Vec<_> = rows.iter().filter_map(lost).collect();
    let losing = losses.iter().filter(|(loss, ..)| *loss >= LOST_DB);
    let first = losing.min_by(|(loss, _, _, less, _), (other_loss, _, _, other, _)| {
        less.bits.cmp(&other.bits).then(other_loss.total_cmp(loss))
    });
    let metric = if column == columns::PSNR_DB {
        "fixed − golden"
    } else {
        "in lockstep"
    };
    match first {
        Some((_, before, after, Reduction { words, bits }, scene)) => {
            let s = if *bits == 1 { "" } else { "s" };
            let text = |db: f64| {
                if db.is_finite() {
                    format!("{db:.1}")
                } else {
                    "equal".into()
                }
            };
            let how = format!(
                "{} → {} dB, {metric}, on {scene}",
                text(*before),
                text(*after)
            );
            Some(format!(
                "first to lose {LOST_DB:.0} dB: {} with {bits} bit{s} less, {how}",
                words.join(" and ")
            ))
        }
        None if losses.is_empty() => None,
        None => Some(format!("no word loses {LOST_DB:.0} dB, {metric}")),
    }
}

/// Words and bits that a row's changes remove; None if they change anything else.
fn less(changes: &str, words: &[(String, Format)]) -> Option<Reduction> {
    let mut all = Reduction {
        words: Vec::new(),
        bits: 0,
    };
    for change in changes.split(' ').filter(|change| !change.is_empty()) {
        let (field, value) = change.split_once('=')?;
        let (_, own) = words.iter().find(|(word, _)| word == field)?;
        let now: Format = value.parse().ok()?;
        let bits = own.frac_bits - now.frac_bits;
        if (Format {
            frac_bits: own.frac_bits,
            ..now
        }) != *own
            || bits < 0
        {
            return None;
        }
        if bits > 0 {
            all.words.push(field.to_owned());
            all.bits = all.bits.max(bits);
        }
    }
    Some(all)
}
