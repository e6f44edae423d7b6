//! Cycles: the cycles of a machine for a frame, as part of `report.json`, as a table and as CSV.
//!
//! ```text
//! recorded work ─►( rtl_model::timing )─► [cycles of every unit, traffic] ─┬─► report.json
//!                                                                          ├─► table, 80 columns
//!                                                                          └─► cycles.csv, tiles.csv
//! ```

use crate::output::chart::{Axis, Bars, Mark, Panel, Series, Shape};
use crate::output::text::{aligned, plain_table, share, thousands, wrapped};
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::timing::{
    self, Cycles, Direction, Limit, Limited, REQUESTERS, RecordedFrame, Request, Requester, Share,
    TileCycles, Tiles, Wait,
};
use rtl_model::work::Work;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write;

/// A frame's time.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CyclesReport {
    /// Cycles from the first request to the last word written.
    pub total: u64,
    /// Cycles per second.
    pub clock_hz: u64,
    /// Frames per second.
    pub frames_per_second: f64,
    /// Bottleneck: the unit, or memory, without whose limit the frame takes the fewest cycles.
    pub bottleneck: &'static str,
    /// Kind of that limit, and the frame's cycles without it.
    pub limit: LimitReport,
    /// Every unit, in the order of the diagram; its four counts sum to `total`.
    pub units: Vec<UnitReport>,
    /// Traffic to memory and back.
    pub memory: MemoryReport,
    /// Stamps that the rasteriser tested, and those that kept a pixel.
    pub slots: [u64; 2],
    /// Lines that the cache looked up, and hits among them; none where there is no cache.
    pub lookups: Option<[u64; 2]>,
    /// Lines of the map of surroundings that its caches looked up, and hits among them; only where
    /// the map is in memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texels: Option<[u64; 2]>,
    /// Work that a binned machine skips because pixels have stopped; only for frames in which
    /// pixels stop.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early_termination: Option<EarlyTerminationReport>,
    /// Tests of tiles; only for machines whose `bin.test` is not `box`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tile_tests: Option<TileTestsReport>,
    /// Times of each tile of a binned machine, as in `tiles.csv`.
    #[serde(skip)]
    pub tiles: Option<Tiles>,
}

/// Limit of a frame: its name is [`CyclesReport::bottleneck`].
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct LimitReport {
    /// `work`: a unit's own cycles; `hazard`: a pixel that is still in flight in it; `memory`: the
    /// bandwidth.
    pub by: &'static str,
    /// Cycles of the frame with the unit infinitely fast, a hazard of one cycle, or ideal memory.
    pub cycles_without: u64,
}

/// Tests of tiles.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct TileTestsReport {
    /// Tiles of the boxes of all splats: each is tested.
    pub tiles: u64,
    /// Entries of all tile lists: tiles that are not rejected.
    pub entries: u64,
    /// Masks of the entries; only for machines with `bin.subtile_px` or `contribution`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masks: Option<MasksReport>,
}

/// Masks of subtiles in the entries of tile lists.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct MasksReport {
    /// Subtiles that were tested.
    pub subtiles_tested: u64,
    /// Bits that were set.
    pub subtiles_set: u64,
    /// Cycles in which `list` or `contribution` tested subtiles, in all engines; 0 if `bin` does.
    pub list_cycles: u64,
    /// Cycles in which raster seeded a run of subtiles, except the first of an entry.
    pub seeds: u64,
}

/// Savings by early termination, relative to the same machine without it.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct EarlyTerminationReport {
    /// Entries of tile lists that are not read.
    pub entries_skipped: u64,
    /// Entries of all tile lists.
    pub entries: u64,
    /// Contributions that do not reach `gauss`.
    pub contributions_left_out: u64,
    /// Contributions of the frame.
    pub contributions: u64,
}

/// A unit's time.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct UnitReport {
    /// Name; for parallel units, with a number.
    pub name: String,
    /// Items taken.
    pub items: u64,
    /// Cycles with an item.
    pub busy: u64,
    /// Cycles without one.
    pub starved: u64,
    /// Cycles in which an item had arrived and could not be taken.
    pub blocked: u64,
    /// Cycles in which it stalled on memory.
    pub memory: u64,
    /// The unit whose items were missing.
    pub starved_by: Option<&'static str>,
    /// Units that blocked it, with cycles: `hazard` is a pixel still in flight.
    pub blocked_by: Vec<Blocker>,
    /// Use over time.
    /// When it had items.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_time: Option<OverTime>,
    /// `occupancy[n]`: how often n results were queued behind it, or in flight, when it took one.
    pub occupancy: Vec<u64>,
}

/// Cycles with an item, window by window.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct OverTime {
    /// Cycles of a window.
    pub window: u64,
    /// Cycles with an item, per window.
    pub busy: Vec<u64>,
}

/// Unit that blocked another.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Blocker {
    by: &'static str,
    cycles: u64,
}

/// Traffic.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct MemoryReport {
    /// Cycles in which bytes moved.
    pub busy: u64,
    /// Bytes that moved.
    pub bytes: u64,
    /// Bytes per second, over the whole frame.
    pub bytes_per_second: f64,
    /// Peak bytes per second; none for ideal memory.
    pub peak_bytes_per_second: Option<f64>,
    /// Fraction of the requests that found their row open; none for ideal memory, or without
    /// requests.
    pub row_hit_share: Option<f64>,
    /// Traffic by requester.
    pub clients: Vec<ClientReport>,
    /// `read_latency_log2[n]`: reads of 2^n to 2^(n+1) − 1 cycles.
    pub read_latency_log2: Vec<u64>,
}

/// A requester's traffic.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ClientReport {
    /// Purpose of the traffic.
    pub name: &'static str,
    /// Bursts.
    pub requests: u64,
    /// Bytes from memory.
    pub bytes_read: u64,
    /// Bytes to memory.
    pub bytes_written: u64,
}

/// Frames per second; 0 for a frame of 0 cycles.
pub fn frames_per_second(timing: &Microarchitecture, cycles: &Cycles) -> f64 {
    if cycles.total == 0 {
        0.0
    } else {
        1.0 / (cycles.total as f64 / timing.timing.clock_hz as f64)
    }
}

impl CyclesReport {
    /// Report of a replay of this work.
    pub fn new(timing: &Microarchitecture, work: &Work, cycles: &Cycles) -> Self {
        CyclesReport::limited(timing, cycles, timing::limit(timing, work, cycles))
    }

    /// Report of a replay of a frame.
    pub fn on(timing: &Microarchitecture, frame: &RecordedFrame, cycles: &Cycles) -> Self {
        CyclesReport::limited(timing, cycles, frame.limit(timing, cycles))
    }

    /// Reports of replays of a frame on several machines.
    pub fn all(frames: &[(&Microarchitecture, &Cycles)], frame: &RecordedFrame) -> Vec<Self> {
        let limits = frame.limits(frames);
        frames
            .iter()
            .zip(limits)
            .map(|((timing, cycles), limit)| CyclesReport::limited(timing, cycles, limit))
            .collect()
    }

    /// Report of a replay with a known limit.
    fn limited(timing: &Microarchitecture, cycles: &Cycles, limit: Limit) -> Self {
        let clock_hz = timing.timing.clock_hz;
        let seconds = cycles.total as f64 / clock_hz as f64;
        let per_second = |amount: u64| {
            if cycles.total == 0 {
                0.0
            } else {
                amount as f64 / seconds
            }
        };
        let memory = &cycles.memory;
        let requests: u64 = memory.requests.iter().sum();
        let of_memory = &timing.timing.memory;
        let ideal = of_memory.ideal;
        let of_client = |client: Requester| {
            let [bytes_read, bytes_written] = memory.bytes[client as usize];
            ClientReport {
                name: client.name(),
                requests: memory.requests[client as usize],
                bytes_read,
                bytes_written,
            }
        };
        let last = memory
            .latencies
            .iter()
            .rposition(|count| *count > 0)
            .map_or(0, |last| last + 1);
        CyclesReport {
            total: cycles.total,
            clock_hz,
            frames_per_second: frames_per_second(timing, cycles),
            bottleneck: limit.name,
            limit: LimitReport {
                by: match limit.by {
                    Limited::Work => "work",
                    Limited::Hazard => "hazard",
                    Limited::Memory => "memory",
                },
                cycles_without: limit.without,
            },
            units: cycles
                .units
                .iter()
                .map(|unit| unit_report(unit, &cycles.units))
                .collect(),
            memory: MemoryReport {
                busy: memory.busy,
                bytes: memory.total_bytes(),
                bytes_per_second: per_second(memory.total_bytes()),
                peak_bytes_per_second: (!ideal)
                    .then(|| clock_hz as f64 * of_memory.bytes_per_1000_cycles() as f64 / 1000.0),
                row_hit_share: (requests > 0 && !ideal)
                    .then(|| memory.row_hits as f64 / requests as f64),
                clients: REQUESTERS
                    .into_iter()
                    .filter(|client| memory.requests[*client as usize] > 0)
                    .map(of_client)
                    .collect(),
                read_latency_log2: memory.latencies[..last].to_vec(),
            },
            slots: cycles.stamps,
            lookups: (cycles.lookups[0] > 0).then_some(cycles.lookups),
            texels: (cycles.texels[0] > 0).then_some(cycles.texels),
            early_termination: cycles
                .early_termination
                .map(|saved| EarlyTerminationReport {
                    entries_skipped: saved.entries_skipped,
                    entries: saved.entries,
                    contributions_left_out: saved.contributions_left_out,
                    contributions: saved.contributions,
                }),
            tile_tests: cycles.tile_tests.map(|tests| TileTestsReport {
                tiles: tests.tiles,
                entries: tests.entries,
                masks: tests.masks.map(|masks| MasksReport {
                    subtiles_tested: masks.tested,
                    subtiles_set: masks.set,
                    list_cycles: masks.list_cycles,
                    seeds: masks.seeds,
                }),
            }),
            tiles: cycles.tiles.clone(),
        }
    }

    /// The summary, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let mut table = plain_table(&[
            "",
            "items",
            "busy",
            "starved",
            "blocked",
            "memory",
            "blocked by",
        ]);
        for unit in &self.units {
            let part = |cycles: u64| share(cycles, self.total);
            let longest = unit
                .blocked_by
                .iter()
                .max_by_key(|blocker| blocker.cycles)
                .map_or("", |blocker| blocker.by);
            let row = [
                thousands(unit.items),
                part(unit.busy),
                part(unit.starved),
                part(unit.blocked),
                part(unit.memory),
                longest.into(),
            ];
            table.add_row(std::iter::once(unit.name.clone()).chain(row));
        }
        let memory = &self.memory;
        let gigabytes = |bytes: f64| format!("{:.2} GB/s", bytes / 1e9);
        let why = self
            .why_not_the_busiest()
            .map_or(String::new(), |why| wrapped(&why) + "\n");
        let mut text = format!(
            "{} cycles at {:.0} MHz: {} frames/s; limited by: {}\n{why}{}\n",
            thousands(self.total),
            self.clock_hz as f64 / 1e6,
            rate(self.frames_per_second),
            self.limited_by(),
            aligned(table).trim_fmt()
        );
        let clients: Vec<String> = (memory.clients.iter())
            .map(|client| {
                format!(
                    "{} {}",
                    client.name.replace('_', " "),
                    megabytes(client.bytes_read + client.bytes_written)
                )
            })
            .collect();
        let of_peak = match memory.peak_bytes_per_second {
            Some(peak) => format!(
                "of {}, busy {}",
                gigabytes(peak),
                share(memory.busy, self.total)
            ),
            None => "of ideal memory".into(),
        };
        let [moved, clients, rate] = [
            megabytes(memory.bytes),
            clients.join(", "),
            gigabytes(memory.bytes_per_second),
        ];
        let traffic = format!("memory: {moved} ({clients}); {rate} {of_peak}");
        let _ = write!(text, "{}", wrapped(&traffic));
        for (cache, lookups) in [
            ("cache", self.lookups),
            ("cache of the surroundings", self.texels),
        ] {
            let Some([lookups, hits]) = lookups else {
                continue;
            };
            let _ = write!(
                text,
                "\n{cache}: {} look-ups, {} hits",
                thousands(lookups),
                share(hits, lookups)
            );
        }
        let _ = write!(
            text,
            "\nstamps: {} tested, {} kept a pixel",
            thousands(self.slots[0]),
            share(self.slots[1], self.slots[0])
        );
        if let Some(EarlyTerminationReport {
            entries_skipped,
            entries,
            contributions_left_out,
            contributions,
        }) = self.early_termination
        {
            let skipped = format!(
                "{} of {} list entries skipped",
                thousands(entries_skipped),
                thousands(entries)
            );
            let left_out = format!(
                "{} of {} contributions left out",
                thousands(contributions_left_out),
                thousands(contributions)
            );
            let _ = write!(
                text,
                "\n{}",
                wrapped(&format!("early termination: {skipped}, {left_out}"))
            );
        }
        if let Some(TileTestsReport {
            tiles,
            entries,
            masks,
        }) = self.tile_tests
        {
            // Kept lists, and masks of blocks, have every tile of a box.
            if entries < tiles || masks.is_none() {
                let listed = format!(
                    "tests of tiles: {} of {} tiles of boxes have an entry",
                    thousands(entries),
                    thousands(tiles)
                );
                let _ = write!(text, "\n{}", wrapped(&listed));
            }
            if let Some(masks) = masks {
                let set = format!(
                    "masks: {} subtiles are set, {} were tested; {} seeds of runs",
                    thousands(masks.subtiles_set),
                    thousands(masks.subtiles_tested),
                    thousands(masks.seeds)
                );
                let _ = write!(text, "\n{}", wrapped(&set));
            }
        }
        text
    }

    /// Why the frame is not limited by the unit with the most busy cycles; `None` where it is.
    fn why_not_the_busiest(&self) -> Option<String> {
        let busiest = self.units.iter().max_by_key(|unit| unit.busy)?;
        let own = busiest.name.split('.').next().unwrap_or_default();
        // A unit whose fragments are being shaded counts as busy.
        if own == self.bottleneck || self.memory.busy >= busiest.busy && self.bottleneck == "memory"
        {
            return None;
        }
        Some(format!(
            "{} is busy for {} of the cycles; but lifting the limit of {} gains most: {} cycles are left",
            busiest.name,
            share(busiest.busy, self.total),
            self.bottleneck,
            thousands(self.limit.cycles_without)
        ))
    }

    /// Limit, in words.
    pub fn limited_by(&self) -> String {
        if self.limit.by == "hazard" {
            format!("{} (hazard)", self.bottleneck)
        } else {
            self.bottleneck.into()
        }
    }

    /// Every unit's use over time, in per cent.
    pub fn charts(&self) -> Vec<Panel> {
        let panel = |(nth, unit, over_time): (usize, &UnitReport, &OverTime)| {
            let (name, whole) = (&unit.name, over_time.window as f64);
            let at = |window: usize| (window as u64 * over_time.window) as f64 / 1e6;
            // Drawn as steps.
            let steps = |(window, busy): (usize, &u64)| {
                [
                    [at(window), *busy as f64 * 100.0 / whole],
                    [at(window + 1), *busy as f64 * 100.0 / whole],
                ]
            };
            let points = over_time.busy.iter().enumerate().flat_map(steps).collect();
            Panel {
                title: format!("{name}: {}", share(unit.busy, self.total)),
                x: Axis::linear("million cycles").within(0.0, self.total as f64 / 1e6),
                y: Axis::linear("% of cycles").within(0.0, 100.0),
                series: vec![Series {
                    name: String::new(),
                    points,
                    mark: Mark::Line,
                    colour: nth,
                }],
                ..Panel::default()
            }
        };
        let timed = self
            .units
            .iter()
            .filter_map(|unit| unit.over_time.as_ref().map(|over_time| (unit, over_time)));
        timed
            .enumerate()
            .map(|(nth, (unit, over_time))| panel((nth % 6, unit, over_time)))
            .collect()
    }

    /// Shares of each unit's four counts in the frame's cycles.
    pub fn stacks(&self) -> Bars {
        let row = |unit: &UnitReport| {
            let counts = [unit.busy, unit.starved, unit.blocked, unit.memory];
            (
                unit.name.clone(),
                counts
                    .map(|count| count as f64 * 100.0 / self.total.max(1) as f64)
                    .to_vec(),
            )
        };
        Bars {
            shape: Shape::Stack,
            title: "what each unit does".into(),
            axis: Axis::linear("% of cycles").within(0.0, 100.0),
            legend: ["busy", "starved", "blocked", "memory"]
                .map(str::to_owned)
                .to_vec(),
            rows: self.units.iter().map(row).collect(),
        }
    }

    /// CSV with one line per unit.
    pub fn csv(&self) -> String {
        let mut text = String::from("unit,items,busy,starved,blocked,memory,total\n");
        for unit in &self.units {
            let UnitReport {
                name,
                items,
                busy,
                starved,
                blocked,
                memory,
                ..
            } = unit;
            let _ = writeln!(
                text,
                "{name},{items},{busy},{starved},{blocked},{memory},{}",
                self.total
            );
        }
        text
    }

    /// CSV with one line per listed tile, in the order in which engines take them; `None` for a
    /// machine without tiles.
    pub fn tiles_csv(&self) -> Option<String> {
        let Tiles {
            side_px,
            from,
            units,
            tiles,
            ..
        } = self.tiles.as_ref()?;
        let of_unit = |unit: &String| {
            ["until", "busy", "starved", "blocked", "memory"].map(|what| format!("{unit}_{what}"))
        };
        let heads: Vec<String> = units.iter().flat_map(of_unit).collect();
        let mut text = format!(
            "column,row,side_px,from,entries,done,cycles,engine,{}\n",
            heads.join(",")
        );
        for TileCycles {
            at: [column, row],
            engine,
            entries,
            done,
            cycles,
            shares,
        } in tiles
        {
            let _ = write!(
                text,
                "{column},{row},{side_px},{from},{entries},{done},{cycles},{engine}"
            );
            for Share {
                until,
                account:
                    timing::Account {
                        busy,
                        starved,
                        blocked,
                        memory,
                    },
            } in shares
            {
                let _ = write!(text, ",{until},{busy},{starved},{blocked},{memory}");
            }
            text.push('\n');
        }
        Some(text)
    }
}

/// Requests to memory, burst by burst, in the formats of DRAM simulators.
#[derive(Clone, Debug)]
pub struct Requests {
    burst_bytes: u64,
    clock_hz: u64,
    requests: Vec<Request>,
    map: Vec<Segment>,
}

/// A format of traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trace {
    /// `LD ADDRESS` and `ST ADDRESS`: the front end LoadStoreTrace.
    Ramulator2,
    /// `ADDRESS READ CYCLE` and `ADDRESS WRITE CYCLE`.
    Dramsim3,
}

/// A range of addresses that stays contiguous in a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Segment {
    /// Its addresses in the model.
    model: std::ops::Range<u64>,
    /// Its first address in the trace.
    base: u64,
}

/// Names of the model's address regions of 2^40 bytes each (`rtl_model::timing`, memory).
const REGIONS: [&str; 7] = [
    "splats", "records", "lists", "lines", "words", "nodes", "map",
];
const REGION_LOG: u32 = 40;
/// Gaps of fewer bytes stay in a trace.
const GAP_BYTES: u64 = 1 << 16;

/// The used ranges of addresses, moved together row by row.
fn address_map(requests: &[Request], row_bytes: u64) -> Vec<Segment> {
    let row = row_bytes.max(1);
    let mut used: Vec<std::ops::Range<u64>> = requests
        .iter()
        .map(|request| {
            request.address / row * row..(request.address + request.bytes).div_ceil(row) * row
        })
        .collect();
    used.sort_unstable_by_key(|range| (range.start, range.end));
    let mut map: Vec<Segment> = Vec::new();
    for range in used {
        match map.last_mut().filter(|last| {
            range.start < last.model.end + GAP_BYTES
                && range.start >> REGION_LOG == last.model.start >> REGION_LOG
        }) {
            Some(last) => last.model.end = last.model.end.max(range.end),
            None => map.push(Segment {
                model: range,
                base: 0,
            }),
        }
    }
    let mut base = 0;
    for segment in &mut map {
        segment.base = base;
        base += segment.model.end - segment.model.start;
    }
    map
}

impl Requests {
    /// File names.
    pub const FORMATS: [(&'static str, Trace); 2] = [
        ("requests.ramulator2", Trace::Ramulator2),
        ("requests.dramsim3", Trace::Dramsim3),
    ];
    /// File that describes the addresses and cycles.
    pub const MAP: &'static str = "requests.json";

    /// Requests in order of cycles; those of one cycle in order of issue.
    pub fn new(timing: &Microarchitecture, mut requests: Vec<Request>) -> Self {
        requests.sort_by_key(|request| request.cycle);
        let memory = &timing.timing.memory;
        let map = address_map(&requests, memory.row_bytes.into());
        Requests {
            burst_bytes: memory.burst_bytes.into(),
            clock_hz: timing.timing.clock_hz,
            requests,
            map,
        }
    }

    /// Address in the trace of a byte of the model's memory.
    fn mapped(&self, address: u64) -> u64 {
        let after = self
            .map
            .partition_point(|segment| segment.model.start <= address);
        let segment = after.checked_sub(1).map(|place| &self.map[place]);
        segment.map_or(address, |segment| {
            segment.base + (address - segment.model.start)
        })
    }

    /// Every burst, with addresses of the trace.
    pub fn in_trace(&self) -> impl Iterator<Item = Request> {
        self.requests.iter().flat_map(|request| {
            let first = self.mapped(request.address);
            let at = (first..first + request.bytes).step_by(self.burst_bytes as usize);
            at.map(|address| Request {
                address,
                bytes: self.burst_bytes,
                ..*request
            })
        })
    }

    /// Writes a trace, one burst per line.
    ///
    /// # Errors
    /// Errors of the file.
    pub fn write(&self, format: Trace, file: &mut impl std::io::Write) -> std::io::Result<()> {
        for Request {
            cycle,
            address: at,
            direction,
            ..
        } in self.in_trace()
        {
            match (format, direction) {
                (Trace::Ramulator2, Direction::Read) => writeln!(file, "LD 0x{at:x}")?,
                (Trace::Ramulator2, Direction::Write) => writeln!(file, "ST 0x{at:x}")?,
                (Trace::Dramsim3, Direction::Read) => writeln!(file, "0x{at:x} READ {cycle}")?,
                (Trace::Dramsim3, Direction::Write) => writeln!(file, "0x{at:x} WRITE {cycle}")?,
            }
        }
        Ok(())
    }

    /// Description of addresses and cycles: the map, the unit of time, and the size of a device for
    /// all addresses.
    pub fn map(&self) -> serde_json::Value {
        let bytes = self
            .map
            .last()
            .map_or(0, |last| last.base + (last.model.end - last.model.start));
        let region = |number: u64, segments: Vec<&Segment>| {
            let (first, last) = (segments[0], segments[segments.len() - 1]);
            let segments: Vec<serde_json::Value> = segments
                .iter()
                .map(|segment| {
                    serde_json::json!({
                        "base": segment.base, "bytes": segment.model.end - segment.model.start,
                        "model_offset": segment.model.start - (number << REGION_LOG),
                    })
                })
                .collect();
            serde_json::json!({
                "name": REGIONS.get(number as usize), "base": first.base,
                "bytes": last.base + (last.model.end - last.model.start) - first.base, "segments": segments,
            })
        };
        let numbers: std::collections::BTreeSet<u64> = self
            .map
            .iter()
            .map(|segment| segment.model.start >> REGION_LOG)
            .collect();
        let of = |number: u64| {
            self.map
                .iter()
                .filter(|segment| segment.model.start >> REGION_LOG == number)
                .collect()
        };
        serde_json::json!({
            "format": "splatsim-requests-1",
            "clock_hz": self.clock_hz,
            "cycle_ns": 1e9 / self.clock_hz as f64,
            "burst_bytes": self.burst_bytes,
            "bursts": self.requests.iter().map(|request| request.bytes.div_ceil(self.burst_bytes.max(1))).sum::<u64>(),
            "address_bytes": bytes,
            "device_bytes": bytes.next_power_of_two(),
            "regions": numbers.into_iter().map(|number| region(number, of(number))).collect::<Vec<_>>(),
        })
    }
}

fn unit_report(unit: &timing::UnitCycles, all: &[timing::UnitCycles]) -> UnitReport {
    let several = all.iter().filter(|other| other.name == unit.name).count() > 1;
    let timing::Account {
        busy,
        starved,
        blocked,
        memory,
    } = unit.account;
    UnitReport {
        name: if several {
            format!("{}.{}", unit.name, unit.index)
        } else {
            unit.name.into()
        },
        items: unit.items,
        busy,
        starved,
        blocked,
        memory,
        starved_by: unit.starved_by,
        blocked_by: (unit.blocked_by.iter())
            .map(|(wait, cycles)| Blocker {
                by: match wait {
                    Wait::Unit(name) => name,
                    Wait::Hazard => "hazard",
                },
                cycles: *cycles,
            })
            .collect(),
        over_time: unit.timeline.as_ref().map(|timeline| OverTime {
            window: timeline.window,
            busy: timeline.busy.clone(),
        }),
        occupancy: unit.occupancy[..unit
            .occupancy
            .iter()
            .rposition(|count| *count > 0)
            .map_or(0, |last| last + 1)]
            .to_vec(),
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

fn rate(per_second: f64) -> String {
    if per_second < 100.0 {
        format!("{per_second:.1}")
    } else {
        format!("{per_second:.0}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtl_model::Machine;

    #[test]
    fn ideal_memory_has_traffic_but_no_peak() {
        let machine = Machine::named("tiny").unwrap();
        let of = |ideal: bool| {
            let mut machine = machine.clone();
            machine.timing.memory.ideal = ideal;
            let timing = machine.elaborate().unwrap().timing;
            let work = Work {
                width: 32,
                height: 16,
                ..Work::default()
            };
            CyclesReport::new(
                &timing,
                &work,
                &timing::replay(&timing, &work, timing::Detail::Histograms),
            )
        };
        let [finite, ideal] = [of(false), of(true)];
        assert!(ideal.memory.bytes > 0 && ideal.memory.bytes == finite.memory.bytes);
        let figures = |report: &CyclesReport| {
            (
                report.memory.busy > 0,
                report.memory.peak_bytes_per_second.is_some(),
                report.memory.row_hit_share.is_some(),
            )
        };
        assert_eq!(
            [figures(&finite), figures(&ideal)],
            [(true, true, true), (false, false, false)]
        );
        assert!(
            ideal.summary().contains("GB/s of ideal memory\n")
                && finite.summary().contains("of 6.40 GB/s, busy")
        );
    }

    #[test]
    fn requests_are_written_burst_by_burst_in_the_order_of_cycles() {
        let timing = Machine::named("tiny").unwrap().elaborate().unwrap().timing;
        let request = |cycle, address, bytes, direction| Request {
            cycle,
            address,
            bytes,
            direction,
        };
        let requests = Requests::new(
            &timing,
            vec![
                request(9, 256, 128, Direction::Write),
                request(3, 64, 64, Direction::Read),
            ],
        );
        let trace = |format| {
            let mut text = Vec::new();
            requests.write(format, &mut text).unwrap();
            String::from_utf8(text).unwrap()
        };
        assert_eq!(
            trace(Trace::Dramsim3),
            "0x40 READ 3\n0x100 WRITE 9\n0x140 WRITE 9\n"
        );
        assert_eq!(trace(Trace::Ramulator2), "LD 0x40\nST 0x100\nST 0x140\n");
    }

    #[test]
    fn distant_regions_are_moved_together_and_share_no_row() {
        let timing = Machine::named("tiny").unwrap().elaborate().unwrap().timing;
        let row = u64::from(timing.timing.memory.row_bytes);
        let request = |cycle, address, bytes| Request {
            cycle,
            address,
            bytes,
            direction: Direction::Read,
        };
        let far = [
            64,
            (1 << 40) + 128,
            (2 << 40) + 64,
            (2 << 40) + (1 << 22),
            (4 << 40) + 64,
        ];
        let requests = Requests::new(
            &timing,
            far.iter()
                .zip(0..)
                .map(|(&address, cycle)| request(cycle, address, 64))
                .collect(),
        );
        let mut text = Vec::new();
        requests.write(Trace::Dramsim3, &mut text).unwrap();
        let addresses: Vec<u64> = String::from_utf8(text)
            .unwrap()
            .lines()
            .map(|line| u64::from_str_radix(line[2..].split(' ').next().unwrap(), 16).unwrap())
            .collect();
        // One row each, consecutive, each address at its place in the row.
        assert_eq!(
            addresses,
            [64, row + 128, 2 * row + 64, 3 * row, 4 * row + 64]
        );
        let map = requests.map();
        assert_eq!(
            (&map["address_bytes"], &map["device_bytes"]),
            (&(5 * row).into(), &(8 * row).into())
        );
        let names: Vec<&str> = map["regions"]
            .as_array()
            .unwrap()
            .iter()
            .map(|region| region["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["splats", "records", "lists", "words"]);
        assert_eq!(map["regions"][2]["segments"].as_array().unwrap().len(), 2);
    }
}
