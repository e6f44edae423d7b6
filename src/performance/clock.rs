//! Clock: the critical path of each unit of a machine, and the clock that its latency allows.
//!
//! Law: `a_machine_elaborates_at_the_clock_of_the_table_and_not_above_it`.

use crate::output::text::{aligned, plain_table, thousands, wrapped};
use rtl_model::elaboration::latency::{self, Path};
use rtl_model::machine::Merge;
use rtl_model::pipeline::Elaborated;
use rtl_model::units::fragment::window;

/// Critical path of a unit, and its cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CriticalPath {
    /// The unit, or a part of it.
    pub name: &'static str,
    /// Delay of the path, FO4.
    pub fo4: f64,
    /// Cycles of the machine.
    pub cycles: u32,
    /// Least cycles at its clock.
    pub least: u32,
    /// Highest clock with these cycles, Hz; `None` where there is no limit.
    pub highest_hz: Option<u64>,
}

/// Every critical path with cycles, in the order of the diagram.
pub fn critical_paths(machine: &Elaborated) -> Vec<CriticalPath> {
    let t = &machine.timing;
    let timing = &t.timing;
    let critical = |name, path: Path, cycles: u32| CriticalPath {
        name,
        fo4: f64::from(path.delay) / 10.0,
        cycles,
        least: path
            .least_cycles(timing.technology, timing.clock_hz)
            .unwrap_or(u32::MAX),
        highest_hz: path.highest_clock(timing.technology, cycles),
    };
    let [raster, fragment, layer] = t.paths.one_cycle.map(|(_, _, path)| path);
    // A pixel that is taken again before its decision is written.
    let pixel = (t.hazard < t.fragment.latency)
        .then(|| critical("fragment, a pixel", t.paths.fragment, t.hazard));
    let f = &machine.machine.fragment;
    let merges = f.sheets.is_none() && f.merge != Merge::Replace && timing.fragment.merge > 0;
    let merge = merges.then(|| critical("fragment, a merge", t.paths.over, timing.fragment.merge));
    // Windows are formed in sequential steps.
    let merge = merge.map(|critical| CriticalPath {
        least: critical
            .least
            .max(window::overflow_cycles(&machine.machine)),
        ..critical
    });
    let colour = t.colour.last().map(|of| {
        critical(
            "colour",
            t.paths.colour[t.colour.len().clamp(1, 3) - 1].path,
            of.pace.latency,
        )
    });
    let in_bin = t.bin.filter(|bin| bin.latency > 0);
    let bin = in_bin.map(|bin| critical("bin", bin.path(), bin.latency));
    let contribution = (t.contribution)
        .map(|blocks| critical("contribution", t.paths.contribution, blocks.latency));
    let list = t.bin.filter(|_| t.contribution.is_none()).and_then(|bin| {
        let (masks, latency) = t.masks_of_list()?;
        Some(critical("list, a mask", masks.path(bin.words), latency))
    });
    let sorter = t
        .sort
        .and_then(|sort| sort.sorter)
        .map(|sorter| critical("sort, an entry", sorter.merge_path(), 1));
    [
        ("project", t.paths.project, t.project.latency),
        ("ellipse", t.paths.ellipse, t.ellipse.latency),
    ]
    .map(|(name, path, cycles)| critical(name, path, cycles))
    .into_iter()
    .chain(colour)
    .chain(bin)
    .chain(list)
    .chain(contribution)
    .chain(sorter)
    .chain(
        [
            ("raster", t.paths.raster, t.raster.latency),
            ("raster, a stamp", raster, 1),
            ("gauss", t.paths.gauss, t.gauss.latency),
            ("fragment", t.paths.fragment, t.fragment.latency),
            ("fragment, a stamp", fragment, 1),
        ]
        .map(|(name, path, cycles)| critical(name, path, cycles)),
    )
    .chain(pixel)
    .chain(merge)
    .chain(
        [
            ("shade", t.paths.shade, t.shade.latency),
            ("resolve", t.paths.resolve, t.resolve.latency),
            ("resolve, a layer", layer, 1),
        ]
        .map(|(name, path, cycles)| critical(name, path, cycles)),
    )
    .collect()
}

/// Latency from a splat to a word of its pixels, nanoseconds: the sum of all units' latencies,
/// without stalls.
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
    let critical_paths = critical_paths(machine);
    for critical in &critical_paths {
        let highest = critical
            .highest_hz
            .map_or("any".into(), |hz| thousands(hz / 1_000_000));
        table.add_row([
            critical.name.to_owned(),
            format!("{:.1}", critical.fo4),
            critical.cycles.to_string(),
            critical.least.to_string(),
            highest,
        ]);
    }
    let megahertz = timing.clock_hz as f64 / 1e6;
    let highest = critical_paths
        .iter()
        .filter_map(|critical| critical.highest_hz.map(|hz| (hz, critical.name)))
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
            "{megahertz} MHz with {}: operators have no delay",
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

    /// The default latencies are the least for the clock, so that a shorter latency is never a
    /// gain.
    #[test]
    fn a_named_machine_has_the_latencies_that_its_clock_requires() {
        for name in rtl_model::Machine::names() {
            let machine = machines::load(name, &[]).unwrap();
            let built = fixed::elaborate(&machine).unwrap();
            for critical in critical_paths(&built) {
                // Products that share multipliers take several cycles.
                let multipliers = machine.timing.colour.unwrap_or_default().multipliers;
                let shared = built
                    .timing
                    .colour
                    .last()
                    .filter(|_| critical.name == "colour");
                let turns = shared.map_or(1, |of| of.products.div_ceil(multipliers));
                assert_eq!(
                    critical.cycles,
                    critical.least.max(turns),
                    "{} of {name}",
                    critical.name
                );
            }
            // Ideal gates have no delay: each operator still has its registers.
            let ideal = machines::load(name, &["timing.technology=ideal".into()]).unwrap();
            assert!(
                critical_paths(&fixed::elaborate(&ideal).unwrap())
                    .iter()
                    .any(|critical| critical.cycles > 10),
                "{name}"
            );
        }
    }

    #[test]
    fn a_machine_elaborates_at_the_clock_of_the_table_and_not_above_it() {
        for name in ["reference", "lean", "tiny", "window", "volume"] {
            for technology in [Technology::Nm65, Technology::Nm28, Technology::Nm7] {
                let mut machine = machines::load(name, &[]).unwrap();
                (machine.timing.technology, machine.timing.clock_hz) = (technology, 50_000_000);
                let built = fixed::elaborate(&machine).unwrap();
                let t = &built.timing;
                // All latencies are given, so that they do not change with the clock.
                machine.timing.project.latency = Some(t.project.latency);
                machine.timing.ellipse.latency = Some(t.ellipse.latency);
                machine.timing.raster.latency = Some(t.raster.latency);
                machine.timing.gauss.latency = Some(t.gauss.latency);
                machine.timing.fragment.latency = Some(t.fragment.latency);
                machine.timing.shade.latency = Some(t.shade.latency);
                machine.timing.resolve.latency = Some(t.resolve.latency);
                let highest_of = |critical: &CriticalPath| {
                    critical.highest_hz.filter(|_| critical.name != "colour")
                };
                let highest = critical_paths(&built)
                    .iter()
                    .filter_map(highest_of)
                    .min()
                    .unwrap();
                machine.timing.clock_hz = highest - highest / 1000;
                let built = machine.elaborate();
                assert!(built.is_ok(), "{name} in {technology:?} at {highest}");
                // The least cycles in the table are really the least.
                for critical in critical_paths(&built.unwrap())
                    .iter()
                    .filter(|critical| ["project", "ellipse", "shade"].contains(&critical.name))
                {
                    let with = |cycles: u32| {
                        let mut machine = machine.clone();
                        let t = &mut machine.timing;
                        match critical.name {
                            "project" => t.project.latency = Some(cycles),
                            "ellipse" => t.ellipse.latency = Some(cycles),
                            _ => t.shade.latency = Some(cycles),
                        }
                        machine.elaborate().map(|_| ())
                    };
                    assert_eq!(with(critical.least), Ok(()));
                    if critical.least > 1 {
                        let errors = with(critical.least - 1).unwrap_err();
                        assert!(
                            errors.len() == 1
                                && errors[0]
                                    .starts_with(&format!("timing.{}.latency", critical.name)),
                            "{errors:?}"
                        );
                    }
                }
                machine.timing.clock_hz = highest + highest / 50;
                let errors = machine.elaborate().unwrap_err();
                assert!(
                    errors.iter().all(|error| error.contains("FO4")),
                    "{errors:?}"
                );
            }
        }
    }

    #[test]
    fn ideal_gates_allow_any_clock() {
        let settings = [
            "timing.technology=ideal",
            "timing.clock_hz=1e12",
            "timing.shade.latency=1",
        ]
        .map(str::to_owned);
        let built = fixed::elaborate(&machines::load("reference", &settings).unwrap()).unwrap();
        assert!(
            critical_paths(&built)
                .iter()
                .all(|critical| critical.highest_hz.is_none() && critical.least == 1)
        );
        assert!(table(&built).contains("operators have no delay"));
    }
}
