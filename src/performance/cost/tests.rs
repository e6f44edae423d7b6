use super::technology::EnergyScale;
use super::*;
use crate::hardware::{fixed, machines};
use rtl_model::timing::{self, Detail};

fn built_with(settings: &[&str]) -> Elaborated {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    fixed::elaborate(&machines::load("reference", &settings).unwrap()).unwrap()
}

fn bits_of(machine: &Elaborated, unit: &str) -> Bits {
    built(machine, unit, &DEFAULT.gates).0
}

fn area(settings: &[&str]) -> f64 {
    Cost::new(&built_with(settings), &DEFAULT).area
}

/// An independent raster of one lane in SystemVerilog, with accumulators of 20, 28 and 36 bits,
/// took 242, 331 and 425 LUTs (Yosys 0.23, `synth_xilinx -family xc7 -nowidelut -flatten`), without
/// its seeds. The lane's own parts must grow in the same proportion.
#[test]
fn the_parts_of_a_raster_grow_as_synthesis_says() {
    let synthesised = [242.0, 331.0, 425.0];
    let modelled = [20, 28, 36].map(|bits: i32| {
        let frac_bits = bits - 6;
        let registers = ["radial", "first", "second", "depth"]
            .map(|word| format!("raster.{word}=I6F{frac_bits}"));
        let depths =
            ["project.depth", "ellipse.depth_range"].map(|word| format!("{word}=U1F{frac_bits}"));
        let rest = [
            "raster.cutoff=U4F12",
            "ellipse.depth_slope=I1F12",
            "timing.raster.lanes=[1,1]",
        ]
        .map(str::to_owned);
        let machine = built_with(
            &[&registers[..], &depths, &rest]
                .concat()
                .iter()
                .map(String::as_str)
                .collect::<Vec<_>>(),
        );
        let mut lane = Bits::default();
        for part in machine
            .parts
            .iter()
            .filter(|part| part.unit == "raster" && part.per_lane)
        {
            lane.add(part.operator, part.copies.into());
        }
        lane.weighted(
            &PerBit {
                register: 0.0,
                ..DEFAULT.area
            },
            0,
        )
    });
    let ratios: Vec<f64> = modelled
        .iter()
        .zip(synthesised)
        .map(|(model, luts)| model / luts)
        .collect();
    println!("a raster's lane, model over synthesis: {ratios:.3?}");
    let mean = ratios.iter().sum::<f64>() / 3.0;
    assert!(
        ratios.iter().all(|ratio| (ratio / mean - 1.0).abs() < 0.05),
        "{modelled:?}, {ratios:?}"
    );
}

#[test]
fn a_wider_word_costs_more_and_more_lanes_cost_lanes_alone() {
    let reference = area(&[]);
    for wider in [
        "gauss.weight=U-2F24",
        "ellipse.conic=U3F25",
        "timing.raster.fifo=64",
        "timing.tile.side_px=32",
        "timing.project.units=2",
    ] {
        assert!(area(&[wider]) > reference, "{wider}");
    }
    assert!(area(&["timing.ellipse.multipliers=1"]) < reference);
    let unit = |lanes: &str, name: &str| {
        let cost = Cost::new(&built_with(&[lanes]), &DEFAULT);
        cost.units
            .iter()
            .find(|unit| unit.name == name)
            .unwrap()
            .area
    };
    let [one, two] = ["timing.raster.lanes=[1,1]", "timing.raster.lanes=[2,1]"];
    // All except the pipeline registers of a splat's attributes, which both lanes share.
    let [lane, both] = [unit(one, "gauss"), unit(two, "gauss")];
    assert!(both < 2.0 * lane && both > 1.8 * lane, "{lane}, {both}");
    assert_eq!(unit(two, "shade"), unit(one, "shade"));
    assert!(
        unit(two, "raster") > unit(one, "raster")
            && unit(two, "raster") < 2.0 * unit(one, "raster")
    );
}

/// Timing features without operators take area too.
#[test]
fn speed_costs_area() {
    let reference = area(&[]);
    let forwarding = ["timing.fragment.latency=6", "timing.fragment.hazard=1"];
    assert!(area(&forwarding) > area(&forwarding[..1]) + 1.0);
    for faster in [
        "timing.tile.buffers=2",
        "timing.memory.outstanding=32",
        "timing.memory.burst_bytes=128",
    ] {
        assert!(area(&[faster]) > reference + 1.0, "{faster}");
    }
    // More stages hold more items.
    assert!(area(&["timing.shade.latency=60"]) > reference);
    let immediate = |more: &str| area(&["timing.organisation=immediate", more]);
    assert!(immediate("timing.cache.misses=16") > immediate("timing.cache.misses=8"));
    // With two tile buffers, a separate shade unit lights the fragments that a tile holds.
    let shade = |settings: &[&str]| {
        Cost::new(&built_with(settings), &DEFAULT)
            .units
            .iter()
            .find(|unit| unit.name == "shade")
            .unwrap()
            .area
    };
    // Except the logic that reads a fragment shaded before.
    let more = shade(&["timing.tile.buffers=2"]) / shade(&[]);
    assert!(more > 1.98 && more <= 2.0, "{more}");
}

/// Parallel instances are counted, and so is the logic between them. None of it is free, even where
/// it gains nothing.
#[test]
fn parallel_instances_cost_area() {
    let reference = area(&[]);
    let fields = [
        "timing.fragment.merges_in_flight=2",
        "timing.shade.units=2",
        "timing.fragment.units=2",
        "timing.fragment.units=16",
        "timing.resolve.units=2",
        "timing.engines=2",
        "timing.queue=longest",
    ];
    for field in fields {
        assert!(
            area(&[field]) > reference + 10.0,
            "{field}: {} is not more than {reference}",
            area(&[field])
        );
    }
    let unit = |settings: &[&str], name: &str| {
        let cost = Cost::new(&built_with(settings), &DEFAULT);
        cost.units
            .iter()
            .find(|unit| unit.name == name)
            .map_or(0.0, |unit| unit.area)
    };
    // An engine contains all units after the lists; setup exists once.
    for name in ["raster", "gauss", "fragment", "resolve"] {
        assert_eq!(
            unit(&["timing.engines=4"], name),
            4.0 * unit(&[], name),
            "{name}"
        );
    }
    assert_eq!(unit(&["timing.engines=4"], "project"), unit(&[], "project"));
    let storage = |settings: &[&str]| Cost::new(&built_with(settings), &DEFAULT).memory_bits;
    assert_eq!(storage(&["timing.engines=4"]), 4 * storage(&[]));
    // Units of one lane each have as many lanes as one unit of several, until there are more units
    // than lanes.
    let of_lanes =
        [1, 4, 16].map(|units| unit(&[&format!("timing.fragment.units={units}")], "fragment"));
    assert!(
        of_lanes[1] < 2.0 * of_lanes[0] && of_lanes[2] > 3.0 * of_lanes[1],
        "{of_lanes:?}"
    );
    // A merge in flight keeps both fragments of each lane in registers, in addition to those of the
    // stages.
    let bits = |merges: u32| {
        let cost = Cost::new(
            &built_with(&[&format!("timing.fragment.merges_in_flight={merges}")]),
            &DEFAULT,
        );
        cost.units
            .iter()
            .find(|unit| unit.name == "fragment")
            .unwrap()
            .bits
            .register
    };
    let fragment = built_with(&[]).machine.fragment_bits() as u64;
    assert_eq!(bits(5) - bits(1), 4 * 4 * (2 * fragment + 28));
}

/// Registers of 37 stages of shade: half of a fragment and half of a light in each.
#[test]
fn a_pipeline_has_as_many_registers_as_stages_times_live_bits() {
    let machine = built_with(&["timing.shade.latency=37"]);
    let fragment = machine.machine.fragment_bits() as u64;
    let light = 4 * machine.machine.shade.premultiplied.format.width() as u64;
    assert_eq!(
        bits_of(&machine, "shade").register,
        (37 * (fragment + light)).div_ceil(2)
    );
    // A stage of a unit with initiation interval 2 holds an item in every second cycle.
    let slow = built_with(&["timing.project.interval=2", "timing.project.latency=200"]);
    let quick = built_with(&["timing.project.interval=1", "timing.project.latency=100"]);
    assert_eq!(
        bits_of(&slow, "project").register,
        bits_of(&quick, "project").register
    );
}

#[test]
fn a_shared_multiplier_is_as_wide_as_its_widest_product() {
    let shared = |count: u32| {
        bits_of(
            &built_with(&[&format!("timing.project.multipliers={count}")]),
            "project",
        )
        .multiplier
    };
    let all = bits_of(&built_with(&[]), "project").multiplier;
    // focal · slope, 27 × 26 bits; the rotation of 27 × 27 is wider.
    assert_eq!([shared(1), shared(2)], [27 * 27, 2 * 27 * 27]);
    assert_eq!(shared(1000), all);
}

#[test]
fn a_unit_cost_of_one_kind_counts_that_kind() {
    let machine = built_with(&[]);
    let nothing = PerBit {
        multiplier: 0.0,
        adder: 0.0,
        multiplexer: 0.0,
        register: 0.0,
        rom: 0.0,
        fifo: 0.0,
        memory: 0.0,
    };
    let of = |area: PerBit| Cost::new(&machine, &Prices { area, ..DEFAULT });
    let cost = of(PerBit {
        register: 1.0,
        ..nothing
    });
    assert_eq!(
        cost.area,
        cost.units
            .iter()
            .map(|unit| unit.bits.register as f64)
            .sum::<f64>()
    );
    let cost = of(PerBit {
        memory: 1.0,
        ..nothing
    });
    // 16 × 16 pixels of three fragments, and requests of 64 bytes, 16 each way.
    assert_eq!(
        cost.area,
        f64::from(16 * 16 * 3 * 8 * machine.timing.fragment_bytes + 2 * 16 * 64 * 8)
    );
}

#[test]
fn energy_is_the_sum_of_its_parts_and_grows_with_traffic() {
    let machine = built_with(&[]);
    let work = rtl_model::work::Work {
        width: 16,
        height: 16,
        ..Default::default()
    };
    let cycles = timing::replay(&machine.timing, &work, Detail::Accounts);
    let cost = Cost::new(&machine, &DEFAULT);
    let energy = Energy::new(&machine, &cost, &cycles, &DEFAULT);
    assert_eq!(
        energy.total,
        energy.units + energy.storage + energy.dram + energy.leakage
    );
    // An empty frame writes only background words.
    assert_eq!((energy.units, energy.storage), (0.0, 0.0));
    assert!(energy.dram > 0.0 && energy.leakage > 0.0);
    let dearer = Energy::new(
        &machine,
        &cost,
        &cycles,
        &Prices {
            dram_pj_per_byte: 2.0 * DEFAULT.dram_pj_per_byte,
            ..DEFAULT
        },
    );
    assert_eq!(dearer.dram, 2.0 * energy.dram);
}

/// Work and its cycles are the same; only the duration of a cycle and the energy of a bit differ.
#[test]
fn a_technology_and_a_clock_show_in_energy() {
    let work = rtl_model::work::Work {
        width: 64,
        height: 64,
        ..Default::default()
    };
    let of = |settings: &[&str], prices: &Prices| {
        let machine = built_with(settings);
        let mut cycles = timing::replay(&machine.timing, &work, Detail::Accounts);
        cycles.units.iter_mut().for_each(|unit| unit.items = 1000);
        cycles.total = 1_000_000;
        Energy::new(&machine, &Cost::new(&machine, prices), &cycles, prices)
    };
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
    // Latencies valid in all technologies, because defaults depend on the clock.
    let latencies = [
        "project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve",
    ]
    .map(|unit| format!("timing.{unit}.latency=20"));
    let with_latencies = |settings: &[String], prices: &Prices| {
        of(
            &settings
                .iter()
                .chain(&latencies)
                .map(String::as_str)
                .collect::<Vec<_>>(),
            prices,
        )
    };
    let in_technology = |technology: &str, clock_hz: &str| {
        with_latencies(
            &[
                format!("timing.technology={technology}"),
                format!("timing.clock_hz={clock_hz}"),
            ],
            &DEFAULT,
        )
    };
    let [old, new] = ["180nm", "7nm"].map(|technology| in_technology(technology, "5e6"));
    let EnergyScale { dynamic, leakage } = DEFAULT.technology.nm180;
    assert!(
        close(
            old.units / new.units,
            dynamic / DEFAULT.technology.nm7.dynamic
        ) && new.units > 0.0,
        "{old:?} {new:?}"
    );
    assert!(
        close(
            old.storage / new.storage,
            dynamic / DEFAULT.technology.nm7.dynamic
        ) && old.dram == new.dram
    );
    assert!(
        close(
            old.leakage / new.leakage,
            leakage / DEFAULT.technology.nm7.leakage
        ) && new.leakage > 0.0
    );
    // Twice the clock: the same work, half the time.
    let faster = in_technology("7nm", "1e7");
    assert!(
        close(2.0 * faster.leakage, new.leakage)
            && faster.units == new.units
            && faster.storage == new.storage
    );
    // Without scales: at 400 MHz, the same in all technologies.
    let plain = Prices {
        technology: Scales::none(),
        ..DEFAULT
    };
    let [a, b] = ["28nm", "7nm"]
        .map(|technology| with_latencies(&[format!("timing.technology={technology}")], &plain));
    assert_eq!(a, b);
    let latencies: Vec<&str> = latencies.iter().map(String::as_str).collect();
    assert!(close(
        a.leakage,
        Cost::new(&built_with(&latencies), &plain).area * 1e6 * DEFAULT.static_pj_per_area * 1e-12
    ));
}

#[test]
fn unit_costs_are_read_completely_or_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("prices.json");
    let refused = |text: &str| {
        std::fs::write(&path, text).unwrap();
        match Prices::load(&path) {
            Err(Error::Input(sentence)) => sentence.replace(path.to_str().unwrap(), "prices.json"),
            other => panic!("{other:?}"),
        }
    };
    let mut value = serde_json::to_value(DEFAULT).unwrap();
    std::fs::write(&path, value.to_string()).unwrap();
    assert_eq!(Prices::load(&path).unwrap(), DEFAULT);
    value["area"]["adder"] = (-1).into();
    assert!(refused(&value.to_string()).starts_with("prices.json: area.adder"));
    assert!(refused("{}").starts_with("prices.json: "));
    assert!(refused("[").starts_with("prices.json: not JSON"));
    assert!(
        matches!(Prices::load(&folder.path().join("none.json")), Err(Error::Input(sentence)) if sentence.contains("cannot be read"))
    );
}

#[test]
fn a_shared_multiplier_costs_multiplexers_for_its_operands() {
    let bits = |setting: &str| bits_of(&built_with(&[setting]), "project");
    let whole = bits_of(&built_with(&[]), "project");
    let mut before = whole.multiplexer;
    for count in [64, 16, 4, 1] {
        let shared = bits(&format!("timing.project.multipliers={count}"));
        assert!(
            shared.multiplexer >= before && shared.multiplier <= whole.multiplier,
            "{count}"
        );
        before = shared.multiplexer;
    }
    assert!(before > whole.multiplexer);
}

#[test]
fn a_bit_more_never_takes_fewer_gates() {
    let of = |operator: Operator| gates::of(&DEFAULT.gates, operator);
    for a in -2..40 {
        let each = [
            Operator::Adder,
            Operator::Multiplexer,
            Operator::Hold,
            Operator::Rounder,
        ]
        .map(|operator| [operator(a), operator(a + 1)]);
        for [narrow, wide] in each {
            assert!(of(wide) >= of(narrow) && of(narrow) >= 0.0, "{narrow:?}");
        }
        for b in -2..40 {
            let narrow = of(Operator::Multiplier([a, b]));
            for wide in [[a + 1, b], [a, b + 1]] {
                assert!(
                    of(Operator::Multiplier(wide)) >= narrow && narrow >= 0.0,
                    "{a} {b}"
                );
            }
            for wide in [[a + 1, b], [a, b + 1]] {
                assert!(
                    of(Operator::Rom(wide)) >= of(Operator::Rom([a, b])),
                    "{a} {b}"
                );
                assert!(
                    of(Operator::Choice(wide)) >= of(Operator::Choice([a, b])),
                    "{a} {b}"
                );
            }
        }
    }
    assert!(of(Operator::Choice([3, 8])) > of(Operator::Multiplexer(8)));
    // One bit times a word takes one AND per bit.
    assert_eq!(of(Operator::Multiplier([1, 12])), 12.0 * 32.0 / 24.0);
    let gates = |setting: &str| Cost::new(&built_with(&[setting]), &DEFAULT).gates;
    let reference = gates("timing.engines=1");
    for wider in [
        "gauss.weight=U-2F24",
        "ellipse.conic=U3F25",
        "timing.shade.latency=60",
        "timing.tile.side_px=32",
        "timing.engines=2",
    ] {
        assert!(gates(wider).total > reference.total, "{wider}");
    }
    assert!(
        gates("timing.shade.latency=60").logic == reference.logic
            && gates("timing.tile.side_px=32").sram_kbit > reference.sram_kbit
    );
}

#[test]
fn gates_are_the_sum_of_units_and_storage() {
    let prices = Prices {
        gates: PerBit {
            memory: 0.5,
            ..DEFAULT.gates
        },
        ..DEFAULT
    };
    let cost = Cost::new(&built_with(&[]), &prices);
    let Gates {
        total,
        logic,
        flip_flops,
        sram_kbit,
    } = cost.gates;
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a}, {b}");
    close(
        logic + flip_flops,
        cost.units.iter().map(|unit| unit.gates).sum(),
    );
    close(
        flip_flops,
        cost.units
            .iter()
            .map(|unit| unit.bits.register)
            .sum::<u64>() as f64
            * prices.gates.register,
    );
    close(
        total - logic - flip_flops,
        cost.fifo_bits as f64 + 0.5 * cost.memory_bits as f64,
    );
    close(
        sram_kbit,
        (cost.fifo_bits + cost.memory_bits) as f64 / 1000.0,
    );
}

#[test]
fn an_older_file_of_unit_costs_without_gates_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("prices.json");
    let load = |value: &serde_json::Value| {
        std::fs::write(&path, value.to_string()).unwrap();
        Prices::load(&path)
    };
    let mut value = serde_json::to_value(DEFAULT).unwrap();
    value.as_object_mut().unwrap().remove("gates");
    assert_eq!(load(&value).unwrap(), DEFAULT);
    // Its values are used unchanged.
    value["gates"] = serde_json::to_value(PerBit {
        adder: 1.0,
        ..DEFAULT.gates
    })
    .unwrap();
    assert_eq!(load(&value).unwrap().gates.adder, 1.0);
    value["gates"].as_object_mut().unwrap().remove("rom");
    assert!(
        matches!(load(&value), Err(Error::Input(sentence)) if sentence.contains("gates") && sentence.contains("rom"))
    );
}

/// Tiles that are listed side by side have parts of their own, and tests, if there are tests.
#[test]
fn tiles_listed_per_cycle_are_never_free() {
    let of = |more: &[&str]| Cost::new(&built_with(more), &DEFAULT);
    let multipliers = |cost: &Cost| {
        let unit = cost.units.iter().find(|unit| unit.name == "bin");
        unit.map_or(0, |unit| unit.bits.multiplier)
    };
    for test in ["box", "ellipse"] {
        let test = format!("bin.test={test}");
        let [one, explicit, two, four] = ["null", "1", "2", "4"]
            .map(|tiles| of(&[&test, &format!("bin.tiles_per_cycle={tiles}")]));
        assert_eq!(one.area, explicit.area, "{test}");
        assert!(two.area > one.area && four.area > two.area, "{test}");
        // What is computed once per splat exists once.
        let [one, two, four] = [&one, &two, &four].map(multipliers);
        assert_eq!(four - two, 2 * (two - one), "{test}");
        assert!(two < 2 * one || test.ends_with("box"), "{test}");
    }
}

/// Masks take area in the unit that makes them, in raster and in FIFOs, and energy where they are
/// made.
#[test]
fn masks_are_never_free() {
    let built = |more: &[&str]| {
        let own = ["bin.test=ellipse", "timing.tile.side_px=32"];
        built_with(&[&own[..], more].concat())
    };
    let of = |machine: &Elaborated| Cost::new(machine, &DEFAULT);
    let unit = |cost: &Cost, name: &str| {
        let unit = cost.units.iter().find(|unit| unit.name == name);
        unit.map_or(0.0, |unit| unit.area)
    };
    let plain = of(&built(&[]));
    let (eight, list) = ("bin.subtile_px=8", "bin.masks=list");
    let [in_bin, in_list, finer, four, four_of_list, engines] = [
        &[eight][..],
        &[eight, list],
        &["bin.subtile_px=4"],
        &[eight, "bin.mask_tests=4"],
        &[eight, list, "bin.mask_tests=4"],
        &[eight, list, "timing.engines=2"],
    ]
    .map(|more| of(&built(more)));
    for masked in [&in_bin, &in_list] {
        assert!(unit(masked, "raster") > unit(&plain, "raster"));
        assert!(masked.fifo_bits > plain.fifo_bits && masked.area > plain.area);
    }
    // Every engine has tests of its own.
    let [one, two] = [&in_list, &engines].map(|cost| unit(cost, "list"));
    assert!(unit(&plain, "list") == 0.0 && unit(&in_bin, "list") == 0.0 && one > 0.0);
    assert!((two / one - 2.0).abs() < 1e-9, "{one}, {two}");
    assert!(unit(&in_bin, "bin") > unit(&plain, "bin"));
    assert_eq!(unit(&in_list, "bin"), unit(&plain, "bin"));
    assert!(finer.area > in_bin.area && finer.fifo_bits > in_bin.fifo_bits);
    // Four tests have four times the multipliers of one, for tiles.
    let blocks = |cost: &Cost, name: &str| {
        let unit = cost.units.iter().find(|unit| unit.name == name).unwrap();
        unit.bits.multiplier
    };
    for (few, many, name) in [(&in_bin, &four, "bin"), (&in_list, &four_of_list, "list")] {
        let [few, many] = [few, many].map(|cost| blocks(cost, name));
        assert!(many > 2 * few && many < 4 * few, "{few}, {many}");
    }
    // Energy of the parts of `list` follows its cycles.
    let machine = built(&[eight, list]);
    let cost = of(&machine);
    let cycles = |list_cycles: u64| {
        let work = rtl_model::work::Work {
            width: 16,
            height: 16,
            ..Default::default()
        };
        let mut cycles = timing::replay(&machine.timing, &work, Detail::Accounts);
        cycles.tile_tests = Some(timing::TileTests {
            tiles: 0,
            entries: 0,
            masks: Some(timing::MaskCounts {
                tested: 0,
                set: 0,
                list_cycles,
                seeds: 0,
            }),
        });
        Energy::new(&machine, &cost, &cycles, &DEFAULT).units
    };
    let [none, some, more] = [0, 1000, 2000].map(cycles);
    assert!(some > none && ((more - none) / (some - none) - 2.0).abs() < 1e-9);
}
