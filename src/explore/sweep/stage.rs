//! Stage: draws points of a plan on one scene, and keeps common results; independent of folder,
//! order and thread.
//!
//! ```text
//! scene ─► ideal, once ─┐
//! rules ─► golden, kept ┼─► frame, work, errors, kept ─┬─ timing ─► cycles, energy ─► row
//! formats ─► machine ───┘                              └─ timing ─► …
//! ```
//! Frames are drawn in parallel, one per thread. If a machine does the same work as an earlier one
//! on the same microarchitecture, its cycles are reused.
//!
//! A row depends only on the plan, the scene, unit costs and the version, and its key is a digest
//! of these. It is the same in any process and order, except for the seconds of `host_`.

use super::columns::{self, Errors, Findings, FrameFindings, ReplayFindings, Screened};
use super::plan::{self, MachineChange, PlanScreen, Points};
use super::table::{CellKind, Column, Row};
use crate::accuracy::flicker::{Flicker, FlickerSums};
use crate::accuracy::screen::{self, Screening, TileSplats, Until};
use crate::accuracy::{distance, metrics, partial};
use crate::error::{Error, Result};
use crate::golden;
use crate::golden::Rules;
use crate::hardware::quantise::Part;
use crate::hardware::searched::Against;
use crate::hardware::{fixed, machines};
use crate::output::picture::Picture;
use crate::output::text::plain;
use crate::performance::clock;
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::CyclesReport;
use crate::performance::timings;
use crate::run::evaluation::Evaluation;
use crate::run::report::MachineReport;
use crate::run::timed;
use crate::scene::digest::{digest, digest_of};
use crate::scene::{Camera, Scene};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::{Sort, SortKind};
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{Cycles, Detail, MOST_OF_A_BATCH, RecordedFrame, stamp_order};
use rtl_model::work::Work;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Facts about the scene that a point needs.
#[derive(Clone, Debug)]
pub(super) struct Head {
    /// Digest of everything that is drawn.
    pub digest: String,
    /// Whether a tree is traversed; it adds hardware to every machine.
    pub has_tree: bool,
}

impl Head {
    /// The head of a scene.
    pub fn of(scene: &Scene) -> Self {
        Head {
            digest: digest_of(scene),
            has_tree: scene.detail.is_some(),
        }
    }
}

/// A machine of the plan on a scene.
pub(super) struct Point {
    number: u64,
    changes: Vec<MachineChange>,
    machine: Machine,
    /// A digest of everything that determines the row.
    pub key: String,
    /// Number of its stamp order among those of its group: only machines with the same one are
    /// replayed as a batch.
    order: usize,
}

impl Point {
    /// The point with this number.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such machine.
    pub fn new(points: &Points, prices: &Prices, scene: &Head, number: u64) -> Result<Self> {
        let (nth, changes) = points.point(number);
        let mut machine = plan::machine_of(&points.base, &changes, &format!("point {number}"))?;
        machines::pay(&mut machine, scene.has_tree);
        let mut all = vec![
            json!(env!("CARGO_PKG_VERSION")),
            json!(scene.digest),
            json!(Machine {
                name: String::new(),
                ..machine.clone()
            }),
            json!(prices),
            json!(points.plan.lockstep),
            json!(plan::exact_of(&changes)),
        ];
        if let Some(screen) = points.plan.screen {
            all.push(json!({"screen": screen}));
        }
        let cameras = points.cameras(nth);
        if !cameras.is_empty() {
            all.push(json!(cameras));
        }
        Ok(Point {
            number,
            changes,
            machine,
            key: digest(Value::Array(all).to_string().as_bytes()),
            order: 0,
        })
    }

    /// Everything that a frame depends on: the machine without its timing, without the test of its
    /// lists and the kind of its sort, and its exact parts.
    fn formats(&self, points: &Points) -> String {
        let base = &points.base;
        let same_kind = |sort: Sort| match base.sort {
            // Sums are another picture.
            _ if base.sums_gaussians() || sort.kind == SortKind::None => sort,
            // So are lists that are kept from frame to frame.
            _ if base.keeps_lists().is_some() || sort.kind == SortKind::Incremental => sort,
            Some(of_base) => Sort {
                kind: of_base.kind,
                digit_bits: of_base.digit_bits,
                incremental: sort.incremental,
                ..sort
            },
            None => sort,
        };
        let machine = Machine {
            timing: base.timing,
            bin: base.bin,
            sort: self.machine.sort.map(same_kind),
            ..self.machine.clone()
        };
        json!([machine, plan::exact_of(&self.changes)]).to_string()
    }
}

/// Common results of all points on a scene. Threads may draw on it in parallel.
pub struct Stage {
    points: Points,
    prices: Prices,
    nth: usize,
    scene: Scene,
    head: Head,
    /// Whether machines of one frame can test tiles or sort in different ways.
    changes_lists: bool,
    ideal: Picture,
    /// The following frames, for flicker.
    film: Vec<Picture>,
    ideal_seconds: f64,
    screen: Option<Screen>,
    goldens: Kept<Rules, GoldenPicture>,
    frames: Kept<String, Framed>,
    replays: Replays,
}

/// A frame, or why its machine cannot draw it.
type Framed = std::result::Result<DrawnFrame, String>;

/// Points with the same frame, with the rows of the first ones.
struct Begun<'a> {
    rows: Vec<(u64, Row)>,
    frame: Arc<Framed>,
    /// Seconds of the frame per point.
    seconds: f64,
    rest: &'a [Point],
}

/// Golden with certain rules.
struct GoldenPicture {
    picture: Picture,
    /// The following frames, for flicker.
    film: Vec<Picture>,
    /// Against ideal.
    psnr_db: Option<f64>,
    seconds: f64,
}

/// Number of golden pictures that are kept.
const GOLDENS: usize = 16;
/// Number of frames that are kept: their work takes more memory than a picture.
const FRAMES: usize = 2;
/// Points of one frame per thread whose rows are written together, first and at most: the loss if
/// the sweep is killed.
const REPLAYED_TOGETHER: [usize; 2] = [MOST_OF_A_BATCH, 8 * MOST_OF_A_BATCH];
/// Target interval between writes of rows and lines of progress, seconds.
const ROWS_EVERY: f64 = 5.0;

impl Stage {
    /// Scene `nth` of the plan, as [`Points::scene`] loads it. Draws `ideal`.
    pub fn new(points: &Points, prices: &Prices, nth: usize, scene: Scene) -> Self {
        let (ideal, ideal_seconds) = timed(|| golden::ideal(&scene).picture);
        let head = Head::of(&scene);
        let film = frames(&scene, points.cameras(nth), |seen| {
            golden::ideal(seen).picture
        })
        .collect::<Vec<_>>();
        let (goldens, frames) = (
            Kept::new((GOLDENS / (1 + film.len())).max(1)),
            Kept::new(FRAMES),
        );
        let replays = Replays::default();
        let screen = Screen::new(points, &scene, &ideal);
        let changes_lists = points
            .columns()
            .iter()
            .any(|(field, _)| timings::changes_lists(field));
        Stage {
            changes_lists,
            points: points.clone(),
            prices: *prices,
            nth,
            scene,
            head,
            ideal,
            film,
            ideal_seconds,
            screen,
            goldens,
            frames,
            replays,
        }
    }

    /// Columns of the rows.
    pub fn columns(&self) -> Vec<Column> {
        columns::all(&self.points)
    }

    /// Draws points of this scene and passes each row to `each`, in the same order for any number
    /// of threads. Points that differ only in timing share a frame; the rows of large groups are
    /// passed in several parts.
    ///
    /// # Errors
    /// [`Error::Input`] if a point is not of this scene; errors of `each`.
    pub fn draw(
        &self,
        numbers: &[u64],
        mut each: impl FnMut(u64, Row) -> Result<()>,
    ) -> Result<()> {
        let threads = rayon::current_num_threads();
        let [first, most] = REPLAYED_TOGETHER.map(|points| points * threads);
        for groups in self.groups(numbers)?.chunks(threads) {
            for Begun {
                rows,
                frame,
                seconds,
                mut rest,
            } in self.begun(groups, first)
            {
                rows.into_iter()
                    .try_for_each(|(number, row)| each(number, row))?;
                let mut together = first;
                while !rest.is_empty() {
                    let (now, later) = rest.split_at(whole_batches(rest, together));
                    let (rows, taken) = timed(|| self.rows(now, &frame, seconds));
                    rows.into_iter()
                        .try_for_each(|(number, row)| each(number, row))?;
                    together =
                        ((now.len() as f64 * ROWS_EVERY / taken) as usize).clamp(first, most);
                    rest = later;
                }
            }
        }
        Ok(())
    }

    /// The frames of some groups, each with the rows of its first points.
    fn begun<'a>(&self, groups: &'a [Vec<Point>], most: usize) -> Vec<Begun<'a>> {
        let golden = |group: &Vec<Point>| self.golden_of(&drawn_by(group).machine);
        let begin = |group: &'a Vec<Point>, frame: &dyn Fn() -> Arc<Framed>| {
            let (frame, seconds) = timed(frame);
            let (seconds, (first, rest)) = (
                seconds / group.len() as f64,
                group.split_at(whole_batches(group, most)),
            );
            Begun {
                rows: self.rows(first, &frame, seconds),
                frame,
                seconds,
                rest,
            }
        };
        if let [group] = groups {
            // Other threads may draw the rest of it.
            let frame = || {
                self.frames.get(&group[0].formats(&self.points), || {
                    self.frame(drawn_by(group), &golden(group))
                })
            };
            return vec![begin(group, &frame)];
        }
        // A thread must not block on golden here: it might be making it itself.
        let groups: Vec<_> = groups.iter().map(|group| (group, golden(group))).collect();
        groups
            .par_iter()
            .map(|(group, golden)| begin(group, &|| Arc::new(self.frame(drawn_by(group), golden))))
            .collect()
    }

    /// Groups points with the same frame. In a group, points that can be replayed as a batch follow
    /// each other.
    fn groups(&self, numbers: &[u64]) -> Result<Vec<Vec<Point>>> {
        let mut groups: Vec<Vec<Point>> = Vec::new();
        let mut orders: Vec<BTreeMap<String, usize>> = Vec::new();
        let mut places = BTreeMap::new();
        for number in numbers {
            if *number >= self.points.count() || self.points.point(*number).0 != self.nth {
                return Err(Error::input(format!(
                    "the plan has no point {number} on {}",
                    self.scene.name
                )));
            }
            let mut point = Point::new(&self.points, &self.prices, &self.head, *number)?;
            let place = *places
                .entry(point.formats(&self.points))
                .or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
                orders.push(BTreeMap::new());
            }
            let next = orders[place].len();
            let order = format!("{:?}", stamp_order(&point.machine));
            point.order = *orders[place].entry(order).or_insert(next);
            groups[place].push(point);
        }
        for group in &mut groups {
            group.sort_by_key(|point| point.order);
        }
        Ok(groups)
    }

    /// Golden with the rules of a machine, or why they cannot be used.
    fn golden_of(&self, machine: &Machine) -> std::result::Result<Arc<GoldenPicture>, String> {
        let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        Ok(self.golden(&fixed::rules(&elaborated.machine)))
    }

    fn golden(&self, rules: &Rules) -> Arc<GoldenPicture> {
        self.goldens.get(rules, || {
            let (picture, seconds) = timed(|| golden::render(&self.scene, rules).picture);
            let psnr_db = distance(&picture, &self.ideal).psnr_db;
            let film = frames(&self.scene, self.points.cameras(self.nth), |seen| {
                golden::render(seen, rules).picture
            })
            .collect();
            GoldenPicture {
                picture,
                film,
                psnr_db,
                seconds,
            }
        })
    }

    /// The rows of points with the same frame, with the seconds of their frame per point.
    fn rows(&self, group: &[Point], frame: &Framed, frame_seconds: f64) -> Vec<(u64, Row)> {
        let (found, seconds) = timed(|| match frame {
            Ok(drawn) => drawn.on(
                &group.iter().map(|point| &point.machine).collect::<Vec<_>>(),
                &self.prices,
                &self.replays,
            ),
            Err(sentence) => (group.iter())
                .map(|point| Err(misfit(point).unwrap_or_else(|| sentence.clone())))
                .collect(),
        });
        let base = machines::value(&self.points.base);
        let fields = self.points.columns();
        let row = |(point, found): (&Point, std::result::Result<Findings, String>)| {
            let mut found = found.unwrap_or_else(|sentence| Findings {
                misfit: Some(sentence),
                ..Findings::default()
            });
            found.host_seconds = frame_seconds + seconds / group.len() as f64;
            let changes: Vec<String> = point
                .changes
                .iter()
                .map(|(field, value)| format!("{field}={}", plain(value)))
                .collect();
            let own = fields.iter().map(|(field, kind)| {
                let changed = point
                    .changes
                    .iter()
                    .find(|(other, _)| other == field)
                    .map(|(_, value)| value);
                match changed.or_else(|| base.pointer(&machines::pointer(field))) {
                    None => Value::Null,
                    Some(value) if *kind == CellKind::Text => json!(plain(value)),
                    Some(number) => machines::whole(number.clone()),
                }
            });
            let head = [
                json!(point.number),
                json!(point.key),
                json!(self.scene.name),
                json!(changes.join(" ")),
            ];
            (
                point.number,
                head.into_iter()
                    .chain(own)
                    .chain(columns::cells(&self.points, &found))
                    .collect(),
            )
        };
        group.iter().zip(found).map(row).collect()
    }

    /// The results of a point that do not depend on timing; or why its machine cannot draw.
    fn frame(
        &self,
        point: &Point,
        golden: &std::result::Result<Arc<GoldenPicture>, String>,
    ) -> Framed {
        let golden = golden.as_ref().map_err(String::clone)?;
        if self.scene.is_of_sequence() {
            machines::draws_alone(&point.machine, "a sweep draws the first frame alone")
                .map_err(|error| error.to_string())?;
        }
        let exact = plan::exact_of(&point.changes);
        if exact.is_empty() {
            self.drawn(&point.machine, golden)
        } else {
            self.partial(&point.machine, golden, &exact)
        }
    }

    fn drawn(
        &self,
        machine: &Machine,
        golden: &GoldenPicture,
    ) -> std::result::Result<DrawnFrame, String> {
        let mut elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        // Words that are recorded for other tests would differ where the work is otherwise equal.
        elaborated.records_choices = self.changes_lists;
        let rejected = |screen: &Screen| {
            let exact = match screen.least.against {
                Against::Golden => &golden.picture,
                Against::Ideal => &self.ideal,
            };
            screen.rejected(&self.scene, exact, &elaborated)
        };
        if let Some(screened) = self.screen.as_ref().and_then(rejected) {
            return Ok(DrawnFrame {
                found: Findings {
                    screened: Some(screened),
                    ..Findings::default()
                },
                work: None,
            });
        }
        let evaluation =
            Evaluation::on(&self.scene, &elaborated).map_err(|error| error.to_string())?;
        let (observed, fixed_seconds) = timed(|| evaluation.observe());
        let frame = FrameFindings {
            overflows: observed.overflows(),
            outcomes: observed.drawing.outcomes,
            fixed_seconds,
            ideal_seconds: self.ideal_seconds,
        };
        let lockstep = self
            .points
            .plan
            .lockstep
            .then(|| evaluation.lockstep().summary(&observed.picture));
        let errors = Some(self.errors(&observed.picture, golden)?);
        let flicker = self.flicker(observed.picture, golden, |seen| {
            let evaluation =
                Evaluation::on(seen, &evaluation.machine).map_err(|error| error.to_string())?;
            Ok(evaluation.picture(&evaluation.draw()))
        })?;
        Ok(DrawnFrame {
            found: Findings {
                errors,
                frame: Some(frame),
                lockstep,
                flicker,
                ..Findings::default()
            },
            work: Some(Arc::new(observed.work)),
        })
    }

    /// The same in mixed precision, with some units or words in f64: only errors, because such
    /// hardware does not exist.
    fn partial(
        &self,
        machine: &Machine,
        golden: &GoldenPicture,
        exact: &[String],
    ) -> std::result::Result<DrawnFrame, String> {
        let evaluation =
            Evaluation::new(&self.scene, machine).map_err(|error| error.to_string())?;
        let is_exact = |word: &str| exact.iter().any(|name| machines::is_below(word, name));
        let choice = partial::ChosenWords::new(&evaluation.machine, |word| !is_exact(word));
        let picture = |evaluation: &Evaluation| {
            let stage = partial::MixedDrawing::new(
                &evaluation.scene,
                &evaluation.machine,
                &evaluation.quantised,
            );
            stage.fill(&choice, &stage.set_up(&choice))
        };
        let first = picture(&evaluation);
        let errors = Some(self.errors(&first, golden)?);
        let flicker = self.flicker(first, golden, |seen| {
            Ok(picture(
                &Evaluation::on(seen, &evaluation.machine).map_err(|error| error.to_string())?,
            ))
        })?;
        Ok(DrawnFrame {
            found: Findings {
                errors,
                flicker,
                ..Findings::default()
            },
            work: None,
        })
    }

    /// Changes of the errors from frame to frame, if requested; a sentence if a frame cannot be
    /// drawn.
    fn flicker(
        &self,
        first: Picture,
        golden: &GoldenPicture,
        draw: impl Fn(&Scene) -> std::result::Result<Picture, String>,
    ) -> std::result::Result<Option<Flicker>, String> {
        let cameras = self.points.cameras(self.nth);
        if cameras.is_empty() {
            return Ok(None);
        }
        let films = golden
            .film
            .iter()
            .zip(&self.film)
            .zip(frames(&self.scene, cameras, draw))
            .zip(1..);
        let mut before = (first, &golden.picture, &self.ideal);
        let mut all = FlickerSums::default();
        for (((golden, ideal), fixed), number) in films {
            let fixed = fixed.map_err(|sentence| format!("frame {number}: {sentence}"))?;
            all = all.and(&FlickerSums::new(
                [&before.0, before.1, before.2],
                [&fixed, golden, ideal],
            ));
            before = (fixed, golden, ideal);
        }
        Ok(Some(all.flicker()))
    }

    /// Errors of a picture; a sentence if a pixel of a picture is NaN or infinite.
    fn errors(
        &self,
        picture: &Picture,
        golden: &GoldenPicture,
    ) -> std::result::Result<Errors, String> {
        let of_ideal = distance(picture, &self.ideal);
        let fixed_vs_golden = metrics(picture, &golden.picture);
        let not_finite = fixed_vs_golden.not_finite.max(of_ideal.not_finite);
        if not_finite > 0 {
            return Err(format!(
                "{not_finite} pixels have no finite number, and cannot be compared"
            ));
        }
        Ok(Errors {
            fixed_vs_golden,
            golden_vs_ideal_psnr_db: golden.psnr_db,
            fixed_vs_ideal_psnr_db: of_ideal.psnr_db,
            golden_seconds: golden.seconds,
        })
    }
}

/// Number of points, at most `most`, that make only whole batches, apart from the last batch of a
/// stamp order.
fn whole_batches(points: &[Point], most: usize) -> usize {
    if points.len() <= most {
        return points.len();
    }
    let ends_a_batch = |end: &usize| {
        let order = points[*end].order;
        let same = points[..*end].iter().rev();
        same.take_while(|point| point.order == order).count() % MOST_OF_A_BATCH == 0
    };
    (1..=most).rev().find(ends_a_batch).unwrap_or(most)
}

/// Why the machine of a point cannot be built, if it cannot.
fn misfit(point: &Point) -> Option<String> {
    let failed = fixed::elaborate(&point.machine).err();
    failed.map(|error| error.to_string())
}

/// The point whose machine draws the frame of a group: the first that can be built, if any.
fn drawn_by(group: &[Point]) -> &Point {
    let can_draw = group.iter().find(|point| misfit(point).is_none());
    can_draw.unwrap_or(&group[0])
}

/// Draws a scene from each camera except the first, lazily.
fn frames<T>(
    scene: &Scene,
    cameras: &[Camera],
    draw: impl Fn(&Scene) -> T,
) -> impl Iterator<Item = T> {
    let later = cameras.get(1..).unwrap_or_default();
    let mut seen = (!later.is_empty()).then(|| scene.clone());
    later.iter().filter_map(move |camera| {
        let seen = seen.as_mut()?;
        seen.camera = *camera;
        Some(draw(seen))
    })
}

/// A frame without its time.
struct DrawnFrame {
    found: Findings,
    /// None in mixed precision, and of a sample.
    work: Option<Arc<Work>>,
}

/// What machines are screened with before they are drawn in full.
struct Screen {
    least: PlanScreen,
    /// The picture of the plan's machine, with whose errors samples are compared.
    drawn: Picture,
    splats: TileSplats,
    part: Part,
}

impl Screen {
    /// The screen of a plan on a scene; `None` without a least PSNR, or if the plan's machine cannot
    /// draw the scene, or if samples would save no time.
    fn new(points: &Points, scene: &Scene, ideal: &Picture) -> Option<Self> {
        let least = points.plan.screen?;
        let base = fixed::elaborate(&points.base).ok()?;
        let evaluation = Evaluation::on(scene, &base).ok()?;
        let splats = TileSplats::of(scene, ideal, &base)?;
        Some(Screen {
            least,
            drawn: evaluation.picture(&evaluation.draw()),
            splats,
            part: Part::of(scene),
        })
    }

    /// The estimate for a machine that surely misses the least PSNR; `None` if it must be drawn in
    /// full.
    fn rejected(&self, scene: &Scene, exact: &Picture, machine: &Elaborated) -> Option<Screened> {
        // What their lists contain depends on earlier frames.
        if machine.machine.keeps_lists().is_some() {
            return None;
        }
        let view = screen::View {
            scene,
            exact,
            allowed: screen::allowed(exact, self.least.psnr_db),
            splats: &self.splats,
            part: &self.part,
        };
        let screening = Screening {
            reference: vec![screen::tile_errors(&self.drawn, exact)],
            stricter: 1.0,
            nth: 0,
            until: Until::Sure,
        };
        // A machine that cannot hold the scene fails with a sentence when it is drawn in full.
        let estimate = screening.estimate(&[view], machine, None).ok()??;
        let psnr_db = |load: f64| self.least.psnr_db - 10.0 * libm::log10(load);
        (estimate.low > 1.0).then(|| Screened {
            tiles: estimate.tiles,
            psnr_db: psnr_db(estimate.load),
            psnr_high_db: psnr_db(estimate.low),
        })
    }
}

impl DrawnFrame {
    /// The frame with its time on each machine.
    fn on(
        &self,
        machines: &[&Machine],
        prices: &Prices,
        replays: &Replays,
    ) -> Vec<std::result::Result<Findings, String>> {
        let elaborated: Vec<_> = machines
            .par_iter()
            .map(|machine| fixed::elaborate(machine).map_err(|error| error.to_string()))
            .collect();
        let Some(work) = &self.work else {
            let found = |elaborated: std::result::Result<_, _>| {
                elaborated.map(|_: Elaborated| self.found.clone())
            };
            return elaborated.into_iter().map(found).collect();
        };
        let timings: Vec<&Microarchitecture> = elaborated
            .iter()
            .flatten()
            .map(|elaborated| &elaborated.timing)
            .collect();
        let mut replayed = replays.of(&timings, work).into_iter();
        let found = |elaborated: std::result::Result<Elaborated, String>| {
            let elaborated = elaborated?;
            let (units, cycles) = replayed
                .next()
                .expect("each machine that can be built was replayed");
            let replay = ReplayFindings {
                cycles,
                cost: CostReport::new(&elaborated, &units, prices),
                machine: MachineReport::new(&elaborated),
                units,
                latency_ns: clock::latency_ns(&elaborated),
            };
            Ok(Findings {
                replay: Some(replay),
                ..self.found.clone()
            })
        };
        elaborated.into_iter().map(found).collect()
    }
}

/// Replays that are kept for machines with the same work: the first, from which the others mostly
/// differ in one field, and the last few.
#[derive(Default)]
struct Replays(Mutex<Vec<Arc<ReplayedWork>>>);

/// Work on a microarchitecture, and its cycles.
struct ReplayedWork {
    timing: Microarchitecture,
    work: Arc<Work>,
    cycles: (Cycles, CyclesReport),
}

/// Most replays that are kept.
const REPLAYS: usize = 4;

impl Replays {
    /// Cycles of this work on each machine, and the bottleneck, which takes a few more replays.
    fn of(&self, timings: &[&Microarchitecture], work: &Arc<Work>) -> Vec<(Cycles, CyclesReport)> {
        let known = self
            .0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let is_same = |known: &ReplayedWork, timing: &Microarchitecture| {
            known.timing.same_cycles_as(timing) && known.work == *work
        };
        let known_of = |timing: &Microarchitecture| {
            known
                .iter()
                .find(|known| is_same(known, timing))
                .map(|known| known.cycles.clone())
        };
        let mut all: Vec<Option<(Cycles, CyclesReport)>> =
            timings.iter().map(|timing| known_of(timing)).collect();

        // Of several with the same timing only the first is replayed.
        let mut new: Vec<usize> = Vec::new();
        let mut same_as = vec![None; timings.len()];
        for nth in (0..timings.len()).filter(|nth| all[*nth].is_none()) {
            same_as[nth] = new
                .iter()
                .position(|other| timings[*other].same_cycles_as(timings[nth]));
            if same_as[nth].is_none() {
                same_as[nth] = Some(new.len());
                new.push(nth);
            }
        }
        let new: Vec<&Microarchitecture> = new.into_iter().map(|nth| timings[nth]).collect();
        let frame = RecordedFrame::new(work);
        let units = frame.replay_all(&new, Detail::Accounts);
        let frames: Vec<_> = new.iter().copied().zip(&units).collect();
        let reports = CyclesReport::all(&frames, &frame);
        let replayed: Vec<(Cycles, CyclesReport)> = units.into_iter().zip(reports).collect();

        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for (timing, cycles) in new.into_iter().zip(&replayed) {
            if known.len() == REPLAYS {
                known.remove(1);
            }
            known.push(Arc::new(ReplayedWork {
                timing: timing.clone(),
                work: Arc::clone(work),
                cycles: cycles.clone(),
            }));
        }
        for (cycles, same_as) in all.iter_mut().zip(same_as) {
            *cycles = cycles
                .take()
                .or_else(|| same_as.map(|nth| replayed[nth].clone()));
        }
        all.into_iter().flatten().collect()
    }
}

/// The most recently used values; each is made once, even if several threads request it.
struct Kept<K, V> {
    most: usize,
    /// The most recent first.
    values: Mutex<VecDeque<(K, Slot<V>)>>,
}

/// A value that exists or is being made.
type Slot<V> = Arc<OnceLock<Arc<V>>>;

impl<K: PartialEq + Clone, V> Kept<K, V> {
    fn new(most: usize) -> Self {
        Kept {
            most,
            values: Mutex::default(),
        }
    }

    fn get(&self, key: &K, make: impl FnOnce() -> V) -> Arc<V> {
        let slot = self.slot(key);
        Arc::clone(slot.get_or_init(|| Arc::new(make())))
    }

    fn slot(&self, key: &K) -> Slot<V> {
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let known = values
            .iter()
            .position(|(other, _)| other == key)
            .and_then(|at| values.remove(at));
        let slot = known.map_or_else(Slot::default, |(_, slot)| slot);
        values.push_front((key.clone(), Arc::clone(&slot)));
        values.truncate(self.most);
        slot
    }
}

#[cfg(test)]
mod tests;
