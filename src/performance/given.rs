//! Given: what a machine is described with and nothing here has a price for. A suggestion marks a
//! gain of these fields, and a search leaves them as they are.
//!
//! Law (tests/area.rs): `no_field_of_timing_gains_for_nothing_unless_it_is_marked_as_given`.

/// The clock of a machine.
pub const CLOCK: &str = "timing.clock_hz";

/// Fields without a price, and why.
pub const GIVEN: [(&str, &str); 22] = [
    (
        "timing.technology",
        "a better one takes less energy, and what it costs to build in it has no price",
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
        "what compares the ways of a set has no price",
    ),
    (
        "timing.cache.latency",
        "a look-up takes as long as its memory, which nothing here knows",
    ),
    ("timing.walk.stack", "a tree's depth asks for it"),
];
const MEMORY: &str = "memory is bought, and has no price";
const BY_CLOCK: &str =
    "memory keeps its bytes per cycle, so another clock is another memory, which has no price";

/// Why a field is given; none where what it costs is counted.
pub fn reason(field: &str) -> Option<&'static str> {
    GIVEN
        .iter()
        .find(|(given, _)| *given == field)
        .map(|(_, why)| *why)
}

/// The same where nothing else changes: a clock by itself takes the bandwidth of memory along.
pub fn reason_alone(field: &str) -> Option<&'static str> {
    if field == CLOCK {
        Some(BY_CLOCK)
    } else {
        reason(field)
    }
}

/// A line on the fields that are given among some; none where all have a price.
pub fn note<'a>(fields: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let told: Vec<String> = fields
        .into_iter()
        .filter_map(|field| Some(format!("{field} ({})", reason_alone(field)?)))
        .collect();
    (!told.is_empty()).then(|| format!("given, at no cost: {}", told.join("; ")))
}
