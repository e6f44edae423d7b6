//! Given: fields of a machine that have no unit cost. What-if results mark a gain from these
//! fields, and a search does not change them.
//!
//! Law (tests/area.rs): `no_field_of_timing_gains_for_nothing_unless_it_is_marked_as_given`.

/// The clock of a machine.
pub const CLOCK: &str = "timing.clock_hz";

/// Fields without a unit cost, and why.
pub const GIVEN: [(&str, &str); 24] = [
    (
        "timing.technology",
        "a better one takes less energy, and manufacturing in it has no unit cost",
    ),
    ("timing.memory.ideal", MEMORY),
    ("timing.memory.bytes_per_cycle", MEMORY),
    ("timing.memory.hit_latency", MEMORY),
    ("timing.memory.miss_latency", MEMORY),
    ("timing.memory.burst_bytes", MEMORY),
    ("timing.memory.row_bytes", MEMORY),
    ("timing.memory.banks", MEMORY),
    ("timing.memory.preset", MEMORY),
    ("timing.memory.bytes_per_cycle_permille", MEMORY),
    ("timing.memory.channels", MEMORY),
    ("timing.memory.interleave_bytes", MEMORY),
    ("timing.memory.ranks", MEMORY),
    ("timing.memory.rank_switch_cycles", MEMORY),
    ("timing.memory.refresh_interval_cycles", MEMORY),
    ("timing.memory.refresh_cycles", MEMORY),
    ("timing.memory.turnaround_cycles", MEMORY),
    ("timing.memory.row_cycles", MEMORY),
    ("timing.memory.four_rows_cycles", MEMORY),
    (
        "timing.cache.ways",
        "comparing the ways of a set has no unit cost",
    ),
    (
        "timing.cache.latency",
        "its latency is that of a memory that is not modelled",
    ),
    ("timing.walk.stack", "it follows from a tree's depth"),
    ("timing.raster.row_cycles", SLOWER),
    ("timing.tile.clear_cycles", SLOWER),
];
const SLOWER: &str = "it only makes a machine slower, as one that others built";
const MEMORY: &str = "memory is bought and has no unit cost";
const BY_CLOCK: &str =
    "memory keeps its bytes per cycle, so another clock is another memory, which has no unit cost";

/// Why a field is given; `None` where its cost is counted.
pub fn reason(field: &str) -> Option<&'static str> {
    GIVEN
        .iter()
        .find(|(given, _)| *given == field)
        .map(|(_, why)| *why)
}

/// Why a field changed alone is given: a change of only the clock also changes the bandwidth of
/// memory.
pub fn reason_alone(field: &str) -> Option<&'static str> {
    if field == CLOCK {
        Some(BY_CLOCK)
    } else {
        reason(field)
    }
}

/// A line about the given fields among `fields`; `None` if there are none.
pub fn note<'a>(fields: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let notes: Vec<String> = fields
        .into_iter()
        .filter_map(|field| Some(format!("{field} ({})", reason_alone(field)?)))
        .collect();
    (!notes.is_empty()).then(|| format!("given, at no cost: {}", notes.join("; ")))
}
