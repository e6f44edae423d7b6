//! Clock: the longest way through each unit of a machine, and the clock that its latency allows.
//!
//! Law: `at_the_clock_of_the_table_the_machine_is_built_and_a_little_above_it_is_refused`.

use crate::output::text::{aligned, plain_table, thousands, wrapped};
use rtl_model::elaboration::latency::{self, Path};
use rtl_model::machine::Merge;
use rtl_model::pipeline::Elaborated;
use rtl_model::units::fragment::window;

/// A unit by its way and the cycles that it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// The unit, or the part of it.
    pub name: &'static str,
    /// Longest way, FO4.
    pub fo4: f64,
    /// Cycles of the machine.
    pub cycles: u32,
    /// Least cycles at its clock.
    pub least: u32,
    /// Highest clock with these cycles, Hz; none where any will do.
    pub highest_hz: Option<u64>,
}

/// Every way that has cycles, in the order of the diagram.
pub fn ways(machine: &Elaborated) -> Vec<Way> {
    let t = &machine.timing;
    let timing = &t.timing;
    let way = |name, path: Path, cycles: u32| Way {
        name,
        fo4: f64::from(path.delay) / 10.0,
        cycles,
        least: path
            .least_cycles(timing.technology, timing.clock_hz)
            .unwrap_or(u32::MAX),
        highest_hz: path.highest_clock(timing.technology, cycles),
    };
    let [raster, fragment, layer] = t.paths.one_cycle.map(|(_, _, path)| path);
    // A pixel that is taken again sooner than its decision is out.
    let pixel = (t.hazard < t.fragment.latency)
        .then(|| way("fragment, a pixel", t.paths.fragment, t.hazard));
    let f = &machine.machine.fragment;
    let merges = f.sheets.is_none() && f.merge != Merge::Replace && timing.fragment.merge > 0;
    let merge = merges.then(|| way("fragment, a merge", t.paths.over, timing.fragment.merge));
    // Windows are formed step by step.
    let merge = merge.map(|way| Way {
        least: way.least.max(window::overflow_cycles(&machine.machine)),
        ..way
    });
    let colour = t.colour.last().map(|of| {
        way(
            "colour",
            t.paths.colour[t.colour.len().clamp(1, 3) - 1].path,
            of.pace.latency,
        )
    });
    let sorter = t
        .sort
        .and_then(|sort| sort.sorter)
        .map(|sorter| way("sort, an entry", sorter.merge_path(), 1));
    [
        ("project", t.paths.project, t.project.latency),
        ("ellipse", t.paths.ellipse, t.ellipse.latency),
    ]
    .map(|(name, path, cycles)| way(name, path, cycles))
    .into_iter()
    .chain(colour)
    .chain(sorter)
    .chain(
        [
            ("raster", t.paths.raster, t.raster.latency),
            ("raster, a stamp", raster, 1),
            ("gauss", t.paths.gauss, t.gauss.latency),
            ("fragment", t.paths.fragment, t.fragment.latency),
            ("fragment, a stamp", fragment, 1),
        ]
        .map(|(name, path, cycles)| way(name, path, cycles)),
    )
    .chain(pixel)
    .chain(merge)
    .chain(
        [
            ("shade", t.paths.shade, t.shade.latency),
            ("resolve", t.paths.resolve, t.resolve.latency),
            ("resolve, a layer", layer, 1),
        ]
        .map(|(name, path, cycles)| way(name, path, cycles)),
    )
    .collect()
}

/// From a splat to a word of its pixels, nanoseconds: the latencies of all units, one after the
/// other, where nothing waits.
pub fn latency_ns(machine: &Elaborated) -> f64 {
    let t = &machine.timing;
    let colour = t.colour.last().map(|of| of.pace.latency);
    let units = [
        t.project, t.ellipse, t.raster, t.gauss, t.fragment, t.shade, t.resolve,
    ]
    .map(|pace| pace.latency);
    let cycles: u64 = units.into_iter().chain(colour).map(u64::from).sum();
    cycles as f64 / t.timing.clock_hz as f64 * 1e9
}

/// The table, at most 80 columns wide.
pub fn table(machine: &Elaborated) -> String {
    let timing = &machine.timing.timing;
    let mut table = plain_table(&["", "way, FO4", "cycles", "at least", "up to MHz"]);
    let ways = ways(machine);
    for way in &ways {
        let highest = way
            .highest_hz
            .map_or("any".into(), |hz| thousands(hz / 1_000_000));
        table.add_row([
            way.name.to_owned(),
            format!("{:.1}", way.fo4),
            way.cycles.to_string(),
            way.least.to_string(),
            highest,
        ]);
    }
    let megahertz = timing.clock_hz as f64 / 1e6;
    let highest = ways
        .iter()
        .filter_map(|way| way.highest_hz.map(|hz| (hz, way.name)))
        .min();
    let period = timing
        .technology
        .fo4_fs()
        .map(|fs| 1e15 / timing.clock_hz as f64 / fs as f64);
    let first = match (period, highest) {
        (Some(period), Some((hz, name))) => format!(
            "{megahertz} MHz in {}: a period is {period:.1} FO4, a register takes {} of it; with these cycles up to {} MHz, for {name}",
            timing.technology.name(),
            latency::REGISTER / 10,
            thousands(hz / 1_000_000)
        ),
        _ => format!(
            "{megahertz} MHz with {}: nothing takes time",
            timing.technology.name()
        ),
    };
    format!("{}\n{}", wrapped(&first), aligned(table).trim_fmt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::{fixed, machines};
    use rtl_model::machine::timing::Technology;

    /// So that no gain over a named machine is a latency that its clock does not ask for.
    #[test]
    fn a_named_machine_has_the_latencies_that_its_clock_asks_for() {
        for name in rtl_model::Machine::names() {
            let machine = machines::load(name, &[]).unwrap();
            let built = fixed::elaborate(&machine).unwrap();
            for way in ways(&built) {
                // Products that share multipliers take turns.
                let multipliers = machine.timing.colour.unwrap_or_default().multipliers;
                let shared = built.timing.colour.last().filter(|_| way.name == "colour");
                let turns = shared.map_or(1, |of| of.products.div_ceil(multipliers));
                assert_eq!(way.cycles, way.least.max(turns), "{} of {name}", way.name);
            }
            // Ideal gates take no time: there each operator has its registers.
            let ideal = machines::load(name, &["timing.technology=ideal".into()]).unwrap();
            assert!(
                ways(&fixed::elaborate(&ideal).unwrap())
                    .iter()
                    .any(|way| way.cycles > 10),
                "{name}"
            );
        }
    }

    #[test]
    fn at_the_clock_of_the_table_the_machine_is_built_and_a_little_above_it_is_refused() {
        for name in ["reference", "lean", "tiny", "window", "volume"] {
            for technology in [Technology::Nm65, Technology::Nm28, Technology::Nm7] {
                let mut machine = machines::load(name, &[]).unwrap();
                (machine.timing.technology, machine.timing.clock_hz) = (technology, 50_000_000);
                let built = fixed::elaborate(&machine).unwrap();
                let t = &built.timing;
                // All said, so that a faster clock cannot ask for more.
                machine.timing.project.latency = Some(t.project.latency);
                machine.timing.ellipse.latency = Some(t.ellipse.latency);
                machine.timing.raster.latency = Some(t.raster.latency);
                machine.timing.gauss.latency = Some(t.gauss.latency);
                machine.timing.fragment.latency = Some(t.fragment.latency);
                machine.timing.shade.latency = Some(t.shade.latency);
                machine.timing.resolve.latency = Some(t.resolve.latency);
                let of_those = |way: &Way| way.highest_hz.filter(|_| way.name != "colour");
                let highest = ways(&built).iter().filter_map(of_those).min().unwrap();
                machine.timing.clock_hz = highest - highest / 1000;
                let built = machine.elaborate();
                assert!(built.is_ok(), "{name} in {technology:?} at {highest}");
                // The least cycles of the table are the least that will do.
                for way in ways(&built.unwrap())
                    .iter()
                    .filter(|way| ["project", "ellipse", "shade"].contains(&way.name))
                {
                    let with = |cycles: u32| {
                        let mut machine = machine.clone();
                        let t = &mut machine.timing;
                        match way.name {
                            "project" => t.project.latency = Some(cycles),
                            "ellipse" => t.ellipse.latency = Some(cycles),
                            _ => t.shade.latency = Some(cycles),
                        }
                        machine.elaborate().map(|_| ())
                    };
                    assert_eq!(with(way.least), Ok(()));
                    if way.least > 1 {
                        let misfits = with(way.least - 1).unwrap_err();
                        assert!(
                            misfits.len() == 1
                                && misfits[0].starts_with(&format!("timing.{}.latency", way.name)),
                            "{misfits:?}"
                        );
                    }
                }
                machine.timing.clock_hz = highest + highest / 50;
                let misfits = machine.elaborate().unwrap_err();
                assert!(
                    misfits.iter().all(|misfit| misfit.contains("FO4")),
                    "{misfits:?}"
                );
            }
        }
    }

    #[test]
    fn in_ideal_gates_any_clock_will_do() {
        let settings = [
            "timing.technology=ideal",
            "timing.clock_hz=1e12",
            "timing.shade.latency=1",
        ]
        .map(str::to_owned);
        let built = fixed::elaborate(&machines::load("reference", &settings).unwrap()).unwrap();
        assert!(
            ways(&built)
                .iter()
                .all(|way| way.highest_hz.is_none() && way.least == 1)
        );
        assert!(table(&built).contains("nothing takes time"));
    }
}
