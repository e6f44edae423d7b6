//! Fields: lists the fields of `timing` that a search may change, and their values.
//!
//! Every improvement here costs area, or is limited by the clock. Fields without a cost are given:
//! the technology, the memory, how a cache compares its ways. Memory keeps its bytes per second and
//! its latency in nanoseconds at any clock.

use crate::error::{Error, Result};
use crate::hardware::{fixed, machines};
use crate::performance::given;
pub(super) use crate::performance::given::CLOCK;
use crate::scene::strict_json;
use rtl_model::Machine;
use rtl_model::machine::SortKind;
use rtl_model::machine::timing::{Memory, Organisation};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

/// A field of the machine, and values that it may have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchedField {
    /// Path, such as `timing.raster.lanes`.
    pub field: String,
    /// Values that are tried in addition to the machine's own.
    pub values: Vec<Value>,
}

/// Fields and values by default. Those that the machine's schema lacks are left out.
const FIELDS: [(&str, &str); 49] = [
    (
        CLOCK,
        "[50e6, 100e6, 150e6, 200e6, 250e6, 300e6, 350e6, 400e6, 450e6, 500e6, 550e6, 600e6, 800e6, 1000e6, 1200e6, 1600e6, 2000e6]",
    ),
    ("timing.fetch.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.fetch.splats", "[null, 2, 4]"),
    ("timing.project.units", "[1, 2, 4]"),
    ("timing.project.latency", "[1, 2, 3, 4, 5, 6, 8, 12, 16]"),
    ("timing.project.multipliers", "[null, 1]"),
    ("bin.test", "[\"box\", \"oriented-box\", \"ellipse\"]"),
    ("bin.subtile_px", "[null, 4, 8, 16]"),
    ("bin.masks", "[null, \"bin\", \"list\"]"),
    ("bin.mask_tests", "[null, 1, 2, 4, 8]"),
    ("bin.tiles_per_cycle", "[null, 2, 4, 8]"),
    ("sort.kind", "[\"radix\", \"tile\", \"hierarchical\"]"),
    ("timing.project.fifo", "[1, 2, 4, 8, 16]"),
    ("timing.ellipse.units", "[1, 2, 4]"),
    (
        "timing.ellipse.latency",
        "[1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32]",
    ),
    ("timing.ellipse.multipliers", "[null, 1]"),
    ("timing.ellipse.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.colour.units", "[1, 2, 4]"),
    ("timing.colour.multipliers", "[16, 1]"),
    ("timing.sort.units", "[1, 2, 4, 8]"),
    (
        "timing.sort.buffer_entries",
        "[16, 32, 64, 128, 256, 512, 1024]",
    ),
    ("timing.sort.network", "[1, 2, 4, 8, 16, 32]"),
    ("timing.sort.bucket_bits", "[2, 4, 6, 8]"),
    ("timing.sort.overlap", "[false, true]"),
    ("timing.contribution.blocks", "[1, 2, 4, 8, 16]"),
    ("timing.contribution.latency", "[1, 2, 3, 4, 6, 8, 12]"),
    (
        "timing.raster.lanes",
        "[[1, 1], [2, 1], [4, 1], [2, 2], [8, 1], [4, 2], [8, 2], [4, 4], [8, 4], [8, 8]]",
    ),
    ("timing.raster.latency", "[1, 2, 3, 4, 6]"),
    ("timing.raster.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.gauss.latency", "[1, 2, 3, 4]"),
    ("timing.gauss.fifo", "[1, 2, 4, 8, 16]"),
    (
        "timing.cache.line_px",
        "[[4, 1], [2, 2], [4, 4], [8, 4], [8, 8]]",
    ),
    (
        "timing.cache.lines",
        "[16, 32, 64, 128, 256, 512, 1024, 2048]",
    ),
    ("timing.cache.misses", "[1, 2, 4, 8, 16]"),
    ("timing.cache.fifo", "[1, 2, 4, 8, 16, 32, 64]"),
    ("timing.tile.side_px", "[16, 32, 48, 64]"),
    ("timing.tile.buffers", "[1, 2]"),
    ("timing.engines", "[1, 2, 4, 8, 16]"),
    ("timing.queue", "[\"order\", \"longest\"]"),
    ("timing.fragment.units", "[1, 2, 4]"),
    ("timing.fragment.merges_in_flight", "[1, 2, 4, 8, 16]"),
    ("timing.fragment.latency", "[1, 2, 3, 4]"),
    ("timing.fragment.hazard", "[null, 1, 2, 3, 4]"),
    ("timing.shade.units", "[1, 2, 4]"),
    ("timing.shade.latency", "[1, 2, 3, 4, 5, 6, 8, 12, 16]"),
    ("timing.shade.interval", "[1, 2, 4]"),
    ("timing.resolve.units", "[1, 2, 4]"),
    ("timing.resolve.interval", "[1, 2, 4]"),
    ("timing.memory.outstanding", "[1, 2, 4, 8, 16, 32, 64]"),
];

/// Fields outside of `timing` that do not change a picture either.
const LISTS: [&str; 8] = [
    "bin.test",
    "bin.tiles_per_cycle",
    "bin.subtile_px",
    "bin.masks",
    "bin.mask_tests",
    "sort.kind",
    "sort.tile_bits",
    "sort.digit_bits",
];

/// The default fields that a machine has, with their values.
pub(super) fn default_fields(machine: &Machine) -> Vec<SearchedField> {
    let value = machines::value(machine);
    let unused: &[&str] = match machine.timing.organisation {
        Organisation::Binned => &["timing.cache"],
        Organisation::Immediate => &[
            "timing.tile",
            "timing.engines",
            "timing.queue",
            "bin",
            "sort",
        ],
    };
    // Another kind of sort would change the picture of sums.
    let is_summed = machine.sums_gaussians();
    let kind = machine.sort.map_or(SortKind::Radix, |sort| sort.kind);
    // The fields of a unit for colours, or of a sorter, may be absent even if the machine has the
    // unit.
    let place = |unit: &str| match unit {
        "timing.colour" => "/colour".to_owned(),
        "timing.contribution" => "/contribution".to_owned(),
        "timing.sort" if kind != SortKind::Radix => "/sort".to_owned(),
        "bin" => "/timing".to_owned(),
        _ => machines::pointer(unit),
    };
    let has = |unit: &str| {
        !(unused.contains(&unit) || is_summed && unit.ends_with("sort"))
            && value.pointer(&place(unit)).is_some_and(Value::is_object)
    };
    let is_used = |field: &str| {
        !unused.contains(&field)
            && (kind == SortKind::Hierarchical || field != "timing.sort.bucket_bits")
    };
    let there = FIELDS.iter().filter(|(field, _)| {
        is_used(field) && field.rsplit_once('.').is_some_and(|(unit, _)| has(unit))
    });
    let values = |field: &str, text: &str| {
        let listed = serde_json::from_str::<Vec<Value>>(text)
            .unwrap_or_default()
            .into_iter()
            .map(machines::whole);
        let shared = products(machine, field).map_or(Vec::new(), |products| {
            shared_by(products).into_iter().map(Value::from).collect()
        });
        let mut values: Vec<Value> = Vec::new();
        for value in listed.chain(shared) {
            if !values.contains(&value) {
                values.push(value);
            }
        }
        values
    };
    let fields = there.map(|(field, text)| SearchedField {
        field: (*field).to_owned(),
        values: values(field, text),
    });
    // A field that is not in this machine's description is left out.
    fields
        .filter(|field| {
            field.values.iter().any(|value| {
                machines::with(machine, &[(field.field.clone(), value.clone())], "").is_ok()
            })
        })
        .collect()
}

/// Number of products that share the multipliers of a field; None for other fields.
fn products(machine: &Machine, field: &str) -> Option<u32> {
    let unit = field.strip_suffix(".multipliers")?;
    if unit == "timing.colour" {
        return Some(
            fixed::elaborate(machine)
                .ok()?
                .timing
                .colour
                .last()?
                .products,
        );
    }
    // With one multiplier a splat occupies the unit for as many cycles as it has products.
    let alone = [
        ("multipliers", json!(1)),
        ("latency", Value::Null),
        ("interval", Value::Null),
    ];
    let changes = alone.map(|(name, value)| (format!("{unit}.{name}"), value));
    let built = fixed::elaborate(&machines::with(machine, &changes, "").ok()?).ok()?;
    match unit {
        "timing.project" => Some(built.timing.project.interval),
        "timing.ellipse" => Some(built.timing.ellipse.interval),
        _ => None,
    }
}

/// Numbers of multipliers for shared use: for each initiation interval the fewest.
fn shared_by(products: u32) -> Vec<u32> {
    let mut counts: Vec<u32> = (1..=products)
        .map(|interval| products.div_ceil(interval))
        .collect();
    counts.dedup();
    counts.reverse();
    counts
}

/// Reads fields and values from a file: a JSON array.
///
/// # Errors
/// [`Error::Input`] if it cannot be read, or has another form.
pub fn read(path: &Path) -> Result<Vec<SearchedField>> {
    let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
    let value = strict_json::read(path).map_err(input_error)?;
    let fields: Vec<SearchedField> = serde_path_to_error::deserialize(&value).map_err(|e| {
        input_error(format!(
            "is not a list of fields and values, as [{{\"field\": \"timing.raster.fifo\", \"values\": [1, 2]}}]: {}",
            e.inner()
        ))
    })?;
    if fields.is_empty() {
        return Err(input_error("has no field".into()));
    }
    check(&fields).map_err(input_error)?;
    Ok(fields)
}

fn check(fields: &[SearchedField]) -> std::result::Result<(), String> {
    for (nth, SearchedField { field, values }) in fields.iter().enumerate() {
        if !(field.starts_with("timing.") || LISTS.contains(&field.as_str())) {
            return Err(format!(
                "{field} is not a field of timing; --target-psnr searches words"
            ));
        }
        if let Some(why) = given::reason(field) {
            return Err(format!(
                "{field} is given, and can be set with --set: {why}"
            ));
        }
        if fields[..nth].iter().any(|other| other.field == *field) {
            return Err(format!("{field} is there twice"));
        }
        if values.is_empty() {
            return Err(format!("{field} has no values"));
        }
        if field == "sort.kind" && values.contains(&json!(SortKind::Incremental)) {
            return Err("sort.kind incremental keeps lists from frame to frame, and a search draws each of its views alone: leave it out".into());
        }
        if field == "sort.kind" && values.contains(&json!(SortKind::None)) {
            return Err(
                "sort.kind none changes the picture: --machine weighted begins with it".into(),
            );
        }
    }
    Ok(())
}

/// A field and its values, the machine's own first.
#[derive(Clone, Debug)]
pub(super) struct Knob {
    pub field: String,
    pub values: Vec<Value>,
}

/// One knob per field.
///
/// # Errors
/// [`Error::Input`] if the machine lacks the field, or the value is invalid.
pub(super) fn knobs(machine: &Machine, fields: &[SearchedField]) -> Result<Vec<Knob>> {
    check(fields).map_err(Error::input)?;
    let value = machines::value(machine);
    let knob = |SearchedField { field, values }: &SearchedField| {
        let own = value
            .pointer(&machines::pointer(field))
            .cloned()
            .unwrap_or(Value::Null);
        if field == "sort.kind" && own == json!(SortKind::None) {
            return Err(Error::input(format!(
                "--fields: {field} is none, which sums Gaussians, and each other kind draws another picture: leave it out"
            )));
        }
        let mut knob = Knob {
            field: field.clone(),
            values: vec![own],
        };
        for value in values {
            let value = machines::whole(value.clone());
            machines::with(machine, &[(field.clone(), value.clone())], "--fields")?;
            if !knob.values.contains(&value) {
                knob.values.push(value);
            }
        }
        Ok(knob)
    };
    fields.iter().map(knob).collect()
}

/// The memory, which is given: it keeps its bytes per second and its nanoseconds at any clock.
#[derive(Clone, Copy, Debug)]
pub struct GivenMemory {
    clock_hz: u64,
    memory: Memory,
}

impl GivenMemory {
    /// The memory of a machine.
    pub fn of(machine: &Machine) -> Self {
        GivenMemory {
            clock_hz: machine.timing.clock_hz,
            memory: machine.timing.memory,
        }
    }

    /// Memory fields for the clock in `changes`, if there is one. Bytes and cycles are integers,
    /// rounded to the worse.
    pub(super) fn fields_at(&self, changes: &[(String, Value)]) -> Vec<(String, Value)> {
        let clock = changes
            .iter()
            .find(|(field, _)| field == CLOCK)
            .and_then(|(_, value)| value.as_u64());
        let Some(clock) = clock.filter(|clock| *clock > 0) else {
            return Vec::new();
        };
        let [own, clock] = [self.clock_hz, clock].map(u128::from);
        let slower = |cycles: u32| (u128::from(cycles) * clock).div_ceil(own.max(1));
        let m = self.memory;
        let thousandths = (u128::from(m.bytes_per_cycle) * 1000
            + u128::from(m.bytes_per_cycle_permille.unwrap_or(0)))
            * own
            / clock;
        // A field that is left out has the value of the preset at any clock, or none.
        let filled = |name, value: u32, number| (value > 0).then_some((name, number));
        let given = |name, value: Option<u32>| value.map(|cycles| (name, slower(cycles)));
        let fields = [
            filled("bytes_per_cycle", m.bytes_per_cycle, thousandths / 1000),
            m.bytes_per_cycle_permille
                .map(|_| ("bytes_per_cycle_permille", thousandths % 1000)),
            filled("hit_latency", m.hit_latency, slower(m.hit_latency)),
            filled("miss_latency", m.miss_latency, slower(m.miss_latency)),
            given("rank_switch_cycles", m.rank_switch_cycles),
            // The same rate per second, rounded to the worse.
            m.refresh_interval_cycles.map(|cycles| {
                (
                    "refresh_interval_cycles",
                    u128::from(cycles) * clock / own.max(1),
                )
            }),
            given("refresh_cycles", m.refresh_cycles),
            given("turnaround_cycles", m.turnaround_cycles),
            given("row_cycles", m.row_cycles),
            given("four_rows_cycles", m.four_rows_cycles),
        ];
        // A value outside the field's range cannot be built: the largest value is refused.
        let value = |number: u128| json!(u32::try_from(number).unwrap_or(u32::MAX));
        fields
            .into_iter()
            .flatten()
            .map(|(name, number)| (format!("timing.memory.{name}"), value(number)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sizes of sorters are searched if the machine has any.
    #[test]
    fn sorters_are_searched_where_there_are_some() {
        let of = |kind: &str| {
            let machine = machines::load("gaussian", &[format!("sort.kind={kind}")]).unwrap();
            let fields = default_fields(&machine)
                .into_iter()
                .map(|field| field.field);
            fields
                .filter_map(|field| field.strip_prefix("timing.sort.").map(str::to_owned))
                .collect::<Vec<_>>()
                .join(" ")
        };
        let sizes = "units buffer_entries network";
        assert_eq!(
            ["radix", "tile", "hierarchical"].map(of),
            [
                "".to_owned(),
                format!("{sizes} overlap"),
                format!("{sizes} bucket_bits overlap")
            ]
        );
    }

    #[test]
    fn memory_is_equally_fast_at_any_clock() {
        let machine = Machine::named("reference").unwrap();
        let bought = GivenMemory::of(&machine);
        for clock_hz in [50_000_000_u64, 400_000_000, 550_000_000, 1_000_000_000] {
            let fields = bought.fields_at(&[(CLOCK.into(), json!(clock_hz))]);
            let [bytes, hit, miss] = [0, 1, 2].map(|nth| fields[nth].1.as_u64().unwrap());
            assert!(
                bytes * clock_hz <= 16 * 400_000_000 && (bytes + 1) * clock_hz > 16 * 400_000_000,
                "{clock_hz}: {bytes}"
            );
            for (cycles, own) in [(hit, 20), (miss, 50)] {
                assert!(
                    cycles * 400_000_000 >= own * clock_hz
                        && (cycles - 1) * 400_000_000 < own * clock_hz,
                    "{clock_hz}: {cycles}"
                );
            }
        }
        assert!(
            bought
                .fields_at(&[("timing.raster.fifo".into(), json!(4))])
                .is_empty()
        );
    }

    /// Memory of a preset follows its data sheet at any clock; additional fields keep their
    /// nanoseconds.
    #[test]
    fn memory_of_a_preset_is_equally_fast_at_any_clock() {
        let settings = [
            "timing.memory.preset=lpddr4-3200-x4",
            "timing.memory.turnaround_cycles=20",
            "timing.memory.refresh_interval_cycles=1000",
        ];
        let machine = machines::load("reference", &settings.map(String::from)).unwrap();
        let bought = GivenMemory::of(&machine);
        for clock_hz in [100_000_000_u64, 1_000_000_000] {
            let changes = [(CLOCK.to_owned(), json!(clock_hz))];
            let fields: Vec<_> = changes
                .iter()
                .cloned()
                .chain(bought.fields_at(&changes))
                .collect();
            let memory = fixed::elaborate(&machines::with(&machine, &fields, "").unwrap())
                .unwrap()
                .timing
                .timing
                .memory;
            assert_eq!(
                memory.bytes_per_1000_cycles(),
                51_200_000_000_000 / clock_hz,
                "{clock_hz}"
            );
            let value = [memory.turnaround_cycles, memory.refresh_interval_cycles]
                .map(|cycles| u64::from(cycles.unwrap()));
            assert_eq!(
                value,
                [20, 1000].map(|cycles| cycles * clock_hz / 400_000_000),
                "{clock_hz}"
            );
            assert_eq!(
                u64::from(memory.row_cycles.unwrap()),
                60 * clock_hz / 1_000_000_000,
                "tRC is 60 ns"
            );
        }
    }

    #[test]
    fn multipliers_are_searched_over_every_interval_with_the_fewest_of_each() {
        for machine in ["reference", "gaussian"].map(|name| Machine::named(name).unwrap()) {
            let default_fields = default_fields(&machine);
            for unit in ["project", "ellipse"] {
                let interval = |multipliers: u64| {
                    let change = (format!("timing.{unit}.multipliers"), json!(multipliers));
                    let built = fixed::elaborate(&machines::with(&machine, &[change], "").unwrap())
                        .unwrap();
                    if unit == "project" {
                        built.timing.project.interval
                    } else {
                        built.timing.ellipse.interval
                    }
                };
                let field = default_fields
                    .iter()
                    .find(|field| field.field == format!("timing.{unit}.multipliers"))
                    .unwrap();
                let listed: Vec<u64> = field.values.iter().filter_map(Value::as_u64).collect();
                // By trying every number: those that take less time per splat than one multiplier
                // less.
                let changing: Vec<u64> = (1..=200)
                    .filter(|many| *many == 1 || interval(*many) < interval(*many - 1))
                    .collect();
                assert_eq!(listed, changing, "{unit} of {}", machine.name);
                assert!(listed.len() > 7 && field.values[0].is_null(), "{listed:?}");
            }
        }
    }

    #[test]
    fn every_usual_field_is_one_of_a_machine() {
        let machine = Machine::named("gaussian").unwrap();
        let immediate = machines::changed(
            &Machine::named("reference").unwrap(),
            "timing.organisation=immediate",
            "",
        )
        .unwrap();
        let sorting = machines::load("gaussian", &["sort.kind=hierarchical".into()]).unwrap();
        let tested = Machine::named("mixed").unwrap();
        let of_some: Vec<String> = [&machine, &immediate, &sorting, &tested]
            .into_iter()
            .flat_map(default_fields)
            .map(|field| field.field)
            .collect();
        for (field, text) in FIELDS {
            assert!(of_some.iter().any(|other| other == field), "{field}");
            assert!(
                serde_json::from_str::<Vec<Value>>(text).is_ok_and(|values| values.len() > 1),
                "{field}"
            );
            assert_eq!(given::reason(field), None, "{field}");
        }
        for machine in [&machine, &immediate, &sorting, &tested] {
            knobs(machine, &default_fields(machine)).unwrap();
        }
    }
}
