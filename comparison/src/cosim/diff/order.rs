//! Order: finds the order of a device's records.
//!
//! A trace has records splat after splat. A binned design gives the records of a tile together,
//! splat after splat within each. If a file is not in the order of the trace, orders of square
//! tiles are tried: in the order in which the device visited the tiles if records have their pixel,
//! else row by row, with pixels from the trace's keys. If the device's `raster.out` is compared
//! too, the order of later streams follows it. Another order is used only if it leaves far fewer
//! differences; a sentence of the report names it.

use super::align::{Mismatch, Name, Numbered, Sequence};
use super::{Sides, X, Y, part};
use crate::error::Result;
use std::collections::HashMap;

/// Required order of streams that have a total order in the trace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RequiredOrder {
    /// The trace's order, or tile order if the file is in it.
    #[default]
    Auto,
    /// The order of the trace.
    Trace,
    /// Tile order: the records of a tile together.
    Tiles,
    /// Any order: records are compared by tag and pixel, or as a set if they have neither.
    Any,
}

/// Order in which records were compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsedOrder {
    Trace,
    PerPixel,
    /// Square tiles of this side, pixels.
    Tiles(i64),
    /// The order of the device's `raster.out`.
    Raster,
    ByName,
    Set,
}

impl UsedOrder {
    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            UsedOrder::Trace => "trace",
            UsedOrder::PerPixel => "per-pixel",
            UsedOrder::Tiles(_) => "tiles",
            UsedOrder::Raster => "raster.out",
            UsedOrder::ByName => "any",
            UsedOrder::Set => "set",
        }
    }

    /// A sentence, unless it is the order of the trace.
    pub fn note(self) -> Option<String> {
        match self {
            UsedOrder::Trace | UsedOrder::PerPixel => None,
            UsedOrder::Tiles(side) => Some(format!("compared tile by tile, {side}×{side} pixels each, as a binned design gives them (--order trace compares in the trace's order)")),
            UsedOrder::Raster => Some("compared in the order of the given raster.out (--order trace compares in the trace's order)".into()),
            UsedOrder::ByName => Some("compared by tag and pixel, in any order".into()),
            UsedOrder::Set => Some("compared as a set, because its records have neither tag nor pixel: with the device's raster.out too, they are compared one by one".into()),
        }
    }
}

/// For each line of a device, its expected record.
pub type Permutation = Vec<u32>;

/// Differences, sorted by expected record.
pub struct Ordered {
    pub found: Vec<Mismatch>,
    pub order: UsedOrder,
    /// Set if nothing differs, and the order is not the trace's.
    pub permutation: Option<Permutation>,
}

impl Ordered {
    fn of(found: Vec<Mismatch>, order: UsedOrder) -> Self {
        Ordered {
            found,
            order,
            permutation: None,
        }
    }

    /// Number of adjacent differences of the first one's kind, including it.
    pub fn run(&self) -> usize {
        let goes_on = |pair: &&[Mismatch]| match (pair[0], pair[1]) {
            (Mismatch::Missing { record }, Mismatch::Missing { record: next }) => {
                next == record + 1
            }
            (Mismatch::Surplus { line, .. }, Mismatch::Surplus { line: next, .. }) => {
                next == line + 1
            }
            _ => false,
        };
        1 + self.found.windows(2).take_while(goes_on).count()
    }
}

/// Sides of the tiles that are tried, pixels.
const SIDES_PX: [i64; 5] = [16, 8, 32, 4, 64];
/// Fewer differences do not justify another order.
const FEW: usize = 4;

impl Sides<'_> {
    /// Compares in the required order, or in the order of the file.
    pub(super) fn ordered(
        &self,
        order: RequiredOrder,
        rastered: Option<&Permutation>,
    ) -> Result<Ordered> {
        let (expected, got) = (self.expected, &self.got.records[..]);
        let numbered = Numbered::new(expected, got);
        let names = self.stream.names(expected).zip(self.stream.names(got));
        if let (true, Some((ours, theirs))) = (self.stream.per_pixel, &names) {
            return Ok(Ordered::of(
                numbered.by_name(ours, theirs, Sequence::ByName),
                UsedOrder::PerPixel,
            ));
        }
        let compare = |numbered: &Numbered, names: Option<(&[Name], &[Name])>| match names {
            Some((ours, theirs)) => numbered.by_name(ours, theirs, Sequence::Total),
            None => numbered.in_order(),
        };
        if numbered.expected == numbered.got {
            return Ok(Ordered::of(Vec::new(), UsedOrder::Trace));
        }
        if order == RequiredOrder::Any {
            let ordered = match &names {
                Some((ours, theirs)) => Ordered::of(
                    numbered.by_name(ours, theirs, Sequence::ByName),
                    UsedOrder::ByName,
                ),
                None => match rastered.filter(|order| order.len() == expected.len()) {
                    Some(rastered) => {
                        self.permuted(&numbered, rastered, UsedOrder::Raster, compare)
                    }
                    None => Ordered::of(numbered.as_a_set(), UsedOrder::Set),
                },
            };
            return Ok(self.with_permutation(ordered, names));
        }
        let in_trace_order = || {
            Ordered::of(
                compare(
                    &numbered,
                    names
                        .as_ref()
                        .map(|(ours, theirs)| (&ours[..], &theirs[..])),
                ),
                UsedOrder::Trace,
            )
        };
        let candidate = if order == RequiredOrder::Trace {
            None
        } else {
            self.candidate(&numbered, rastered)?
        };
        let Some((permutation, used)) = candidate else {
            return Ok(in_trace_order());
        };
        let other = self.permuted(&numbered, &permutation, used, compare);
        if order == RequiredOrder::Tiles || other.found.is_empty() {
            return Ok(self.with_permutation(other, names));
        }
        let first = in_trace_order();
        let is_far_better = other.found.len() * 4 <= first.found.len()
            && first.found.len() - other.found.len() >= FEW;
        Ok(if is_far_better { other } else { first })
    }

    /// Compares with the expected records in another order. Differences have the indices of the
    /// trace.
    fn permuted(
        &self,
        numbered: &Numbered,
        order: &[u32],
        used: UsedOrder,
        compare: impl Fn(&Numbered, Option<(&[Name], &[Name])>) -> Vec<Mismatch>,
    ) -> Ordered {
        let all = self.expected.len();
        let ours: Vec<Vec<i64>> = order
            .iter()
            .map(|&record| self.expected[record as usize].clone())
            .collect();
        let numbers = order
            .iter()
            .map(|&record| numbered.expected[record as usize])
            .collect();
        let numbered = Numbered {
            expected: numbers,
            got: numbered.got.clone(),
        };
        let names = self
            .stream
            .names(&ours)
            .zip(self.stream.names(&self.got.records));
        let found = compare(
            &numbered,
            names
                .as_ref()
                .map(|(ours, theirs)| (&ours[..], &theirs[..])),
        );
        let in_trace = |place: usize| order.get(place).map_or(all, |&record| record as usize);
        let found = found.into_iter().map(|mismatch| match mismatch {
            Mismatch::Different { record, line } => Mismatch::Different {
                record: in_trace(record),
                line,
            },
            Mismatch::Missing { record } => Mismatch::Missing {
                record: in_trace(record),
            },
            Mismatch::Surplus { line, before } => Mismatch::Surplus {
                line,
                before: in_trace(before),
            },
            // The next record of a tile is seldom the next one of the trace.
            Mismatch::Moved {
                record,
                line,
                swapped,
            } => Mismatch::Moved {
                record: in_trace(record),
                line: line + usize::from(swapped),
                swapped: false,
            },
        });
        Ordered::of(found.collect(), used)
    }

    fn with_permutation(
        &self,
        mut ordered: Ordered,
        names: Option<(Vec<Name>, Vec<Name>)>,
    ) -> Ordered {
        if let (true, Some((ours, theirs))) = (ordered.found.is_empty(), names) {
            let mut records: HashMap<Name, Vec<u32>> = HashMap::new();
            for (record, name) in ours.iter().enumerate().rev() {
                records.entry(*name).or_default().push(record as u32);
            }
            ordered.permutation = theirs
                .iter()
                .map(|name| records.get_mut(name).and_then(Vec::pop))
                .collect();
        }
        ordered
    }

    /// Another order that the device's file seems to be in.
    fn candidate(
        &self,
        numbered: &Numbered,
        rastered: Option<&Permutation>,
    ) -> Result<Option<(Permutation, UsedOrder)>> {
        let keys = self.trace.keys(self.stream)?;
        let pixels: Option<Vec<[i64; 2]>> = keys
            .iter()
            .map(|key| Some([part(key, X)?, part(key, Y)?]))
            .collect();
        let Some(pixels) = pixels else {
            return Ok(None);
        };
        if let (Some(rastered), None) = (
            rastered.filter(|order| order.len() == pixels.len()),
            self.stream.names(self.expected),
        ) {
            return Ok(Some((rastered.clone(), UsedOrder::Raster)));
        }
        let [_, x, y] = self.stream.naming();
        let their_pixels: Option<Vec<[i64; 2]>> = x.zip(y).map(|(x, y)| {
            self.got
                .records
                .iter()
                .map(|record| [record[x], record[y]])
                .collect()
        });
        let mut best: Option<(usize, Permutation, i64)> = None;
        for side in SIDES_PX {
            let tile = |[x, y]: [i64; 2]| [y / side, x / side];
            // Tiles in the order in which the device visited them; the others after them.
            let mut ranks: HashMap<[i64; 2], usize> = HashMap::new();
            for pixel in their_pixels.iter().flatten() {
                let next = ranks.len();
                ranks.entry(tile(*pixel)).or_insert(next);
            }
            let mut order: Permutation = (0..pixels.len() as u32).collect();
            order.sort_by_key(|&record| {
                let tile = tile(pixels[record as usize]);
                (ranks.get(&tile).copied().unwrap_or(usize::MAX), tile)
            });
            if order.is_sorted() {
                continue;
            }
            let score = likeness(
                order
                    .iter()
                    .map(|&record| numbered.expected[record as usize]),
                &numbered.got,
            );
            if best.as_ref().is_none_or(|(most, ..)| score > *most) {
                best = Some((score, order, side));
            }
        }
        let in_trace_order = likeness(numbered.expected.iter().copied(), &numbered.got);
        Ok(best
            .filter(|(score, ..)| *score > in_trace_order)
            .map(|(_, order, side)| (order, UsedOrder::Tiles(side))))
    }
}

/// Number of equal records at the start, at the end, and index by index if both sides have the same
/// number.
fn likeness(
    expected: impl DoubleEndedIterator<Item = u32> + ExactSizeIterator + Clone,
    got: &[u32],
) -> usize {
    let agree = |(a, b): &(u32, &u32)| a == *b;
    let beginning = expected.clone().zip(got).take_while(agree).count();
    let end = expected
        .clone()
        .rev()
        .zip(got.iter().rev())
        .take_while(agree)
        .count();
    let place_by_place = if expected.len() == got.len() {
        expected.zip(got).filter(agree).count()
    } else {
        0
    };
    beginning + end + place_by_place
}
