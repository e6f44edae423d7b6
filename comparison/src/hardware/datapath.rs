//! Datapath: draws the words of a unit, each below those that it is made from.
//!
//! ```text
//! words ─► rows: one more than the last word that it is made from ─► places in a row, below their sources ─► SVG
//! ```
//! An input is in the row above the first word that reads it. A row of more than five words takes
//! several lines.

use rtl_model::graph::flow::Flow;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Width and height of a box, pixels.
const BOX: [f64; 2] = [138.0, 46.0];
/// Between boxes of a row.
const GAP: f64 = 14.0;
/// From row to row.
const ROW: f64 = 92.0;
/// Boxes of a row.
const ACROSS: usize = 5;
/// Around the boxes.
const MARGIN: f64 = 8.0;
/// Letters of a name that a box holds.
const LETTERS: usize = 20;

/// A word and its place: the middle and the upper edge of its box.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// The word.
    pub word: &'a Flow,
    /// Pixels from the left.
    pub x: f64,
    /// Pixels from the top.
    pub y: f64,
}

/// Words with their places.
#[derive(Clone, Debug)]
pub struct Layout<'a> {
    /// In the order of the graph. Words that nothing is made from, and that are made from nothing,
    /// are left out.
    pub words: Vec<Placed<'a>>,
    /// Width and height, pixels.
    pub size_px: [f64; 2],
}

/// What a word is made from, and its readers, by their numbers.
#[derive(Clone, Default)]
struct Links {
    sources: Vec<usize>,
    readers: Vec<usize>,
}

impl<'a> Layout<'a> {
    /// Places words.
    pub fn new(words: &'a [Flow]) -> Self {
        let numbers: BTreeMap<&str, usize> = (words.iter().map(|word| word.name.as_str()))
            .zip(0..)
            .collect();
        let mut links = vec![Links::default(); words.len()];
        for (number, word) in words.iter().enumerate() {
            // A word of a loop is also made from a later one.
            let sources = word
                .from
                .iter()
                .filter_map(|name| numbers.get(name.as_str()));
            for &source in sources.filter(|source| **source < number) {
                links[number].sources.push(source);
                links[source].readers.push(number);
            }
        }
        let mut rows = vec![0_i64; words.len()];
        for number in 0..words.len() {
            let above = links[number].sources.iter().map(|source| rows[*source]);
            rows[number] = above.max().map_or(0, |row| row + 1);
        }
        for (number, Links { sources, readers }) in links.iter().enumerate() {
            if let (true, Some(first)) = (
                sources.is_empty(),
                readers.iter().map(|reader| rows[*reader]).min(),
            ) {
                rows[number] = first - 1;
            }
        }
        let mut by_row: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for (number, Links { sources, readers }) in links.iter().enumerate() {
            if !sources.is_empty() || !readers.is_empty() {
                by_row.entry(rows[number]).or_default().push(number);
            }
        }
        let mut places: Vec<Option<[f64; 2]>> = vec![None; words.len()];
        let mut lines = 0;
        for row in by_row.into_values() {
            // Below the middle of its sources; inputs come first.
            let middle = |number: usize| {
                let above: Vec<f64> = (links[number].sources.iter())
                    .filter_map(|source| places[*source].map(|[x, _]| x))
                    .collect();
                if above.is_empty() {
                    -1.0
                } else {
                    above.iter().sum::<f64>() / above.len() as f64
                }
            };
            let mut keyed: Vec<(f64, usize)> = row.into_iter().map(|at| (middle(at), at)).collect();
            keyed.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
            for line in keyed.chunks(ACROSS) {
                let left = (ACROSS - line.len()) as f64 * (BOX[0] + GAP) / 2.0;
                for (nth, (_, number)) in line.iter().enumerate() {
                    places[*number] = Some([
                        left + nth as f64 * (BOX[0] + GAP) + (BOX[0] + GAP) / 2.0,
                        MARGIN + lines as f64 * ROW,
                    ]);
                }
                lines += 1;
            }
        }
        let placed = words.iter().zip(places);
        Layout {
            words: placed
                .filter_map(|(word, place)| place.map(|[x, y]| Placed { word, x, y }))
                .collect(),
            size_px: [
                ACROSS as f64 * (BOX[0] + GAP),
                (lines.max(1) - 1) as f64 * ROW + BOX[1] + 2.0 * MARGIN,
            ],
        }
    }

    /// The picture, with the words of one unit named without it.
    pub fn svg(&self, unit: &str, title: &str) -> String {
        let [width, height] = self.size_px;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\" aria-label=\"datapath of {title}\">\n<title>datapath of {title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        let places: BTreeMap<&str, &Placed> = (self.words.iter())
            .map(|placed| (placed.word.name.as_str(), placed))
            .collect();
        for to in &self.words {
            for from in to
                .word
                .from
                .iter()
                .filter_map(|name| places.get(name.as_str()))
            {
                let [x, y, u, v] = [from.x, from.y + BOX[1], to.x, to.y];
                let bend = 18.0_f64.max((v - y).abs() / 2.0);
                let _ = writeln!(
                    text,
                    "<path d=\"M{x},{y}C{x},{} {u},{} {u},{v}\" fill=\"none\" stroke=\"#9aa3af\"/>",
                    y + bend,
                    v - bend
                );
            }
        }
        for Placed { word, x, y } in &self.words {
            let name = word
                .name
                .strip_prefix(unit)
                .and_then(|name| name.strip_prefix('.'));
            let name = name.unwrap_or(&word.name);
            let shown = if name.chars().count() > LETTERS {
                name.chars().take(LETTERS - 1).chain(['…']).collect()
            } else {
                name.to_owned()
            };
            let wires = match word.wires {
                1 => String::new(),
                wires => format!(" ×{wires}"),
            };
            let (left, fill) = (
                x - BOX[0] / 2.0,
                if word.from.is_empty() {
                    "#ffffff"
                } else {
                    "#eef2f7"
                },
            );
            let _ = writeln!(
                text,
                "<rect x=\"{left}\" y=\"{y}\" width=\"{}\" height=\"{}\" rx=\"6\" fill=\"{fill}\" stroke=\"#64748b\"/>\n<text x=\"{}\" y=\"{}\" fill=\"#111827\">{shown}</text>\n<text x=\"{}\" y=\"{}\" fill=\"#4b5563\">{}{wires}</text>",
                BOX[0],
                BOX[1],
                left + 8.0,
                y + 18.0,
                left + 8.0,
                y + 36.0,
                word.format,
            );
        }
        text + "</svg>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(name: &str, from: &[&str]) -> Flow {
        Flow {
            name: name.into(),
            format: "U1F8".into(),
            wires: 1,
            from: from.iter().map(|&name| name.into()).collect(),
        }
    }

    #[test]
    fn every_word_is_below_those_that_it_is_made_from_and_no_two_overlap() {
        let mut words = vec![word("a", &[]), word("b", &[]), word("alone", &[])];
        words.extend((0..7).map(|nth| word(&format!("c{nth}"), &["a", "b"])));
        words.push(word("late", &[]));
        words.push(word("d", &["c0", "late", "a"]));
        let layout = Layout::new(&words);
        let place = |name: &str| layout.words.iter().find(|placed| placed.word.name == name);
        assert!(place("alone").is_none() && layout.words.len() == words.len() - 1);
        for placed in &layout.words {
            for from in &placed.word.from {
                assert!(place(from).unwrap().y + BOX[1] < placed.y, "{from}");
            }
            let [width, height] = layout.size_px;
            assert!(placed.x >= BOX[0] / 2.0 && placed.x + BOX[0] / 2.0 <= width);
            assert!(placed.y >= 0.0 && placed.y + BOX[1] <= height);
            for other in &layout.words {
                let is_same = other.word.name == placed.word.name;
                assert!(
                    is_same
                        || (other.y - placed.y).abs() > BOX[1]
                        || (other.x - placed.x).abs() > BOX[0]
                );
            }
        }
        // An input is directly above its first reader, not at the top.
        assert!(place("late").unwrap().y > place("a").unwrap().y);
        let svg = layout.svg("unit", "unit");
        assert_eq!(svg.matches("<path").count(), 2 * 7 + 3);
        assert_eq!(Layout::new(&[]).words.len(), 0);
    }
}
