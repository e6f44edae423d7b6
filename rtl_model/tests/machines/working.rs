//! Is the recorded work the work that was done?

use crate::frames::{ellipsoids, frame, in_tile};
use rtl_model::frame::Each;
use rtl_model::machine::Merge;
use rtl_model::pipeline::{draw_measured, draw_unobserved, draw_with_decisions};
use rtl_model::probe::Observer;
use rtl_model::units::fragment::{Contribution, Decision};
use rtl_model::units::resolve::Layer;
use rtl_model::work::{CullReason, Event, TILE_PX, Work};
use rtl_model::{Elaborated, Frame, Machine};
use std::any::Any;
use std::collections::BTreeMap;

/// Observes decisions one by one: the decision on each contribution, pixel by pixel, and the final
/// slots of each pixel.
#[derive(Default)]
struct DecisionLog {
    pixels: BTreeMap<[u32; 2], Vec<(u32, Decision)>>,
    held: BTreeMap<[u32; 2], [u8; 2]>,
    /// Number of slots that contributions opened.
    inserted: BTreeMap<[u32; 2], u8>,
}

impl Observer<'static> for DecisionLog {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(DecisionLog::default())
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        let fork = seen.downcast::<DecisionLog>().unwrap();
        self.pixels.extend(fork.pixels);
        self.held.extend(fork.held);
        self.inserted.extend(fork.inserted);
    }

    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        self.pixels
            .entry([x, y])
            .or_default()
            .push((contribution.splat, decision));
        *self.inserted.entry([x, y]).or_default() +=
            u8::from(matches!(decision, Decision::Inserted(_)));
    }

    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], _frame: [i64; 4]) {
        let left = layers.iter().filter(|layer| !layer.merged).count();
        self.held.insert([x, y], [layers.len() as u8, left as u8]);
    }
}

/// Contributions in the record, pixel by pixel, including faint ones.
fn recorded_contributions(work: &Work) -> BTreeMap<[u32; 2], Vec<(u32, Event)>> {
    let mut pixels: BTreeMap<[u32; 2], Vec<_>> = BTreeMap::new();
    for tile in &work.tiles {
        let mut reader = tile.reader();
        let [left, top] = tile.corner;
        let as_they_come = (0..work.footprints.len() as u32).collect();
        let drawn = if work.order.is_empty() {
            &as_they_come
        } else {
            &work.order
        };
        for footprint in drawn.iter().map(|nth| &work.footprints[*nth as usize]) {
            let [columns, rows] = [
                in_tile(footprint.columns, left),
                in_tile(footprint.rows, top),
            ];
            if columns.is_empty() || rows.is_empty() {
                continue;
            }
            let (kept, events) = reader.splat(rows.len());
            let mut events: BTreeMap<_, _> = events.iter().copied().collect();
            for (nth, (row, kept)) in rows.zip(kept).enumerate() {
                for column in (0..TILE_PX).filter(|column| kept & (1 << column) != 0) {
                    assert!(columns.contains(&column));
                    let event = events
                        .remove(&((16 * nth + column) as u8))
                        .unwrap_or(Event::Accumulated);
                    pixels
                        .entry([u32::from(left) + column as u32, u32::from(top) + row as u32])
                        .or_default()
                        .push((footprint.splat, event));
                }
            }
            assert!(
                events.is_empty(),
                "events of pixels that were not kept: {events:?}"
            );
        }
    }
    pixels
}

fn is_same(event: Event, decision: Decision, forms_windows: bool) -> bool {
    match decision {
        // Windows are formed first.
        Decision::Evicted(_) if forms_windows => event == Event::Merged(0),
        Decision::Accumulated(_) => event == Event::Accumulated,
        Decision::Inserted(_) => event == Event::Inserted,
        Decision::Merged(..) | Decision::Closed(..) => matches!(event, Event::Merged(0..=2)),
        Decision::Late(..) | Decision::Inside(_) | Decision::Summed(..) => {
            event == Event::Merged(0)
        }
        Decision::Evicted(_) => event == Event::Evicted,
        Decision::Replaced | Decision::Dropped => event == Event::Replaced,
    }
}

fn crowds() -> Vec<(Elaborated, Frame)> {
    let mut all = Vec::new();
    for name in Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES) {
        for (layers, merge) in [
            (3, Merge::FarthestPair),
            (2, Merge::NearestPair),
            (1, Merge::Replace),
        ] {
            let mut machine = Machine::named(name).unwrap();
            let merge = if machine.fragment.window.is_some() {
                Merge::Window
            } else {
                merge
            };
            (
                machine.fragment.layers,
                machine.fragment.merge,
                machine.fragment.evict_hidden,
            ) = (layers, merge, layers == 3);
            let mut frame = frame(&machine, 5, 10_000);
            (frame.width, frame.height) = (75, 40);
            frame.splats = (0..60)
                .flat_map(|seed| crate::frames::frame(&machine, seed, 500).splats)
                .collect();
            all.push((machine.elaborate().unwrap(), frame));
        }
    }
    all
}

#[test]
fn the_record_equals_the_drawing() {
    let mut seen = BTreeMap::new();
    for (machine, frame) in crowds() {
        let (drawing, _, work) = draw_measured(&machine, &frame);
        assert_eq!(drawing, draw_unobserved(&machine, &frame));
        let mut witness = DecisionLog::default();
        draw_with_decisions(&machine, &frame, &mut witness);

        let recorded = recorded_contributions(&work);
        for (pixel, events) in &recorded {
            let decisions = witness.pixels.remove(pixel).unwrap_or_default();
            let kept: Vec<_> = events
                .iter()
                .filter(|(_, event)| *event != Event::Faint)
                .collect();
            assert_eq!(kept.len(), decisions.len(), "{pixel:?}");
            for ((splat, event), (of, decision)) in kept.into_iter().zip(decisions) {
                assert!(
                    *splat == of && is_same(*event, decision, frame.window.is_some()),
                    "{pixel:?}: {event:?} of {splat}, {decision:?} of {of}"
                );
            }
            events
                .iter()
                .for_each(|(_, event)| *seen.entry(format!("{event:?}")).or_insert(0) += 1);
        }
        assert!(witness.pixels.is_empty(), "{:?}", witness.pixels);
        for (pixel, held) in witness.held {
            let [column, row] = pixel.map(|at| at as usize % TILE_PX);
            let tile = work
                .tiles
                .iter()
                .find(|tile| tile.corner.map(u32::from) == pixel.map(|at| at / 16 * 16))
                .unwrap();
            let is = tile.pixel(TILE_PX * row + column);
            if frame.window.is_some() {
                // All slots. Windows make fewer layers of them; slots inside another are shaded
                // too.
                assert!(
                    is[0] == witness.inserted.remove(&pixel).unwrap_or(0)
                        && is[1] >= held[1]
                        && held[0] <= is[0],
                    "{pixel:?}"
                );
            } else {
                assert_eq!(is, held, "{pixel:?}");
            }
        }

        let cull_reasons = |of: &[CullReason]| {
            work.cull_reasons
                .iter()
                .filter(|cull_reason| of.contains(cull_reason))
                .count() as u64
        };
        let culled = drawing.culled;
        assert_eq!(work.cull_reasons.len(), frame.splats.len());
        assert_eq!(
            [
                cull_reasons(&[CullReason::Near]),
                cull_reasons(&[CullReason::Outside, CullReason::Missing])
            ],
            [culled.near, culled.outside]
        );
        assert_eq!(
            [
                cull_reasons(&[CullReason::Faint]),
                cull_reasons(&[CullReason::Backface])
            ],
            [culled.faint, culled.backface]
        );
        assert_eq!(cull_reasons(&[CullReason::Transparent]), culled.transparent);
        assert!(
            work.footprints
                .iter()
                .all(|footprint| work.cull_reasons[footprint.splat as usize] == CullReason::Drawn)
        );
        assert_eq!(
            cull_reasons(&[CullReason::Drawn]),
            work.footprints.len() as u64
        );
        assert!(
            work.footprints
                .is_sorted_by_key(|footprint| footprint.splat)
        );
        // A merge shades each of its fragments that is not shaded yet.
        let shades: u64 = recorded
            .values()
            .flatten()
            .map(|(_, event)| {
                if let Event::Merged(shades) = event {
                    u64::from(*shades)
                } else {
                    0
                }
            })
            .sum();
        assert!(
            shades <= 2 * drawing.outcomes.merged && (shades > 0) == (drawing.outcomes.merged > 0)
        );
    }
    for event in [
        "Accumulated",
        "Faint",
        "Inserted",
        "Merged(1)",
        "Merged(2)",
        "Evicted",
        "Replaced",
    ] {
        assert!(
            seen.get(event).is_some_and(|count| *count > 20),
            "{event}: {seen:?}"
        );
    }
}

/// A pixel of sheets stops once, with the contribution after which it drops all others.
#[test]
fn where_a_pixel_stops_is_recorded() {
    let mut seen = [0; 3];
    for (name, frames) in [("volume", 250), ("gaussian", 250)] {
        for seed in 0..frames {
            let machine = Machine::named(name).unwrap();
            let frame = ellipsoids(&machine, seed, 500);
            let Some(sheets) = &frame.sheets else {
                continue;
            };
            let machine = machine.elaborate().unwrap();
            let (_, _, work) = draw_measured(&machine, &frame);
            let mut witness = DecisionLog::default();
            draw_with_decisions(&machine, &frame, &mut witness);
            for (pixel, events) in recorded_contributions(&work) {
                let decisions = witness.pixels.remove(&pixel).unwrap_or_default();
                let kept: Vec<_> = events
                    .into_iter()
                    .filter(|(_, event)| *event != Event::Faint)
                    .collect();
                assert_eq!(kept.len(), decisions.len());
                let stops = kept.iter().position(|(_, event)| event.stops());
                for (nth, ((splat, event), (of, decision))) in
                    kept.into_iter().zip(decisions).enumerate()
                {
                    assert_eq!(splat, of);
                    match stops {
                        Some(at) if nth > at => assert_eq!(
                            (event, decision),
                            (Event::Accumulated, Decision::Dropped),
                            "{pixel:?}"
                        ),
                        // The last one may still count; the sheet before it has been blended.
                        Some(at) if nth == at => {
                            assert_eq!(
                                decision == Decision::Dropped,
                                !sheets.keeps_last || sheets.each == Each::Slice
                            );
                            assert_eq!(
                                event == Event::MergedAndStopped,
                                sheets.each == Each::Slice
                            );
                        }
                        _ => assert_ne!(decision, Decision::Dropped, "{pixel:?} has not stopped"),
                    }
                    seen[stops.map_or(0, |at| 1 + usize::from(nth > at))] += 1;
                }
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

#[test]
fn a_record_is_the_same_for_any_number_of_threads() {
    let (machine, mut frame) = crowds().swap_remove(0);
    frame.splats = frame.splats.iter().cycle().take(20_000).copied().collect();
    let with = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| draw_measured(&machine, &frame))
    };
    let one = with(1);
    assert!(one.2.footprints.len() > 9000);
    assert_eq!(with(2), one);
    assert_eq!(with(3), one);
}
