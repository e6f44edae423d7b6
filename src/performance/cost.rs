//! Cost: estimates the area of a machine and the energy of a frame, for comparing machines.
//!
//! ```text
//! parts of the elaborated machine ─►( × copies, lanes )─► bits of every kind ─►( × unit costs )─► area, LUT equivalents
//!                                                                                            └──► gates, NAND2; SRAM, kbit
//! items of every unit, traffic    ─►( × parts )──────────────────────────────►( × unit costs )─► energy, joules per frame
//! ```
//! Unit costs are a table that can be replaced (`--unit-costs FILE`). The default ones:
//! - *Area* in six-input LUTs of a Xilinx 7, as Yosys 0.23 maps the RTL implementations of the
//!   units (`sh tests/programs/area.sh`). Alone (`sh tests/programs/operators.sh`) a multiplier
//!   takes 1.8 to 2.1 per product of operand bits, an adder 1 per bit, a comparator 0.67, a
//!   multiplexer 1, 0.5 to 0.6 in a shifter, a table 0.02 to 0.03. In a unit, multipliers are
//!   larger by the carries of their sums, and adders smaller: an adder that rounds a product, or
//!   adds to it, is a row of the multiplier's array. The unit costs are round numbers near the
//!   least squares over the units of `tiny` and `lean`. Two flip-flops count as one LUT. FIFOs and
//!   memories are assumed to be LUTs of 48 bits each.
//! - *The fit*: over 34 units of five machines, three of them not fitted to, LUTs are 1.00 times
//!   the model without registers in the geometric mean, 0.89 to 1.22 (docs/book/cost.md has the
//!   table). Not compared: parts of ellipsoids and sheets, parts shared by lanes, storage.
//! - *Gates*: NAND2 of standard cells, by the formulas of `gates.rs`.
//! - *Energy* from Horowitz, "Computing's energy problem" (ISSCC 2014, 45 nm): an adder 0.1 pJ and
//!   a multiplier 3.1 pJ for 32 bits, 64 bits from a small memory 10 pJ, from DRAM 1.3 nJ. Other
//!   values are assumed: a multiplexer or register bit takes as much as an adder bit, and leakage
//!   is a hundredth of an adder bit every 2.5 ns. Other technologies: `technology.rs`.
//!
//! Law: `the_parts_of_a_raster_grow_as_synthesis_says`.

use crate::error::{Error, Result};
use crate::output::text::{aligned, plain_table, share, thousands, wrapped};
use crate::scene::{strict_json, validate};
use rtl_model::elaboration::microarchitecture::{Fifo, Pace, Pipeline};
use rtl_model::elaboration::{Operator, Part, unit};
use rtl_model::machine::timing::Setup;
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::Cycles;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

mod gates;
pub mod technology;

use technology::Scales;

/// Unit cost of each kind of bit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerBit {
    /// A multiplier, per product of operand bits.
    #[schemars(range(min = 0))]
    pub multiplier: f64,
    /// An adder or comparator.
    #[schemars(range(min = 0))]
    pub adder: f64,
    /// A multiplexer of two words.
    #[schemars(range(min = 0))]
    pub multiplexer: f64,
    /// A word of the datapath.
    #[schemars(range(min = 0))]
    pub register: f64,
    /// A table: area per stored bit, energy per bit read.
    #[schemars(range(min = 0))]
    pub rom: f64,
    /// A FIFO.
    #[schemars(range(min = 0))]
    pub fifo: f64,
    /// Tiles or cache: area per bit, energy per bit read or written.
    #[schemars(range(min = 0))]
    pub memory: f64,
}

/// Unit costs; by default those in the head of this file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prices {
    /// LUT equivalents per bit.
    pub area: PerBit,
    /// Gate equivalents per bit, NAND2 of standard cells. A multiplier counts per product of
    /// operand bits, with one bit less in each operand, and an AND for each remaining bit. Rounding
    /// takes none.
    #[serde(default = "default_gates")]
    pub gates: PerBit,
    /// Picojoules per active bit, in 45 nm.
    pub energy_pj: PerBit,
    /// Picojoules per byte to or from off-chip memory, in every technology.
    #[schemars(range(min = 0))]
    pub dram_pj_per_byte: f64,
    /// Picojoules per LUT equivalent in 2.5 ns, one cycle at 400 MHz, active or not, in 45 nm.
    #[schemars(range(min = 0))]
    pub static_pj_per_area: f64,
    /// Energy in each technology, as a fraction of these values; if left out, it is the same in all
    /// technologies.
    #[serde(default = "Scales::none")]
    pub technology: Scales,
}

/// Period of `static_pj_per_area`, seconds.
const STATIC_SECONDS: f64 = 2.5e-9;

fn default_gates() -> PerBit {
    DEFAULT.gates
}

/// See the head of this file.
pub const DEFAULT: Prices = Prices {
    area: PerBit {
        multiplier: 2.4,
        adder: 0.5,
        multiplexer: 0.8,
        register: 0.5,
        rom: 0.03,
        fifo: 1.0 / 48.0,
        memory: 1.0 / 48.0,
    },
    gates: gates::DEFAULT,
    energy_pj: PerBit {
        multiplier: 0.003,
        adder: 0.003,
        multiplexer: 0.003,
        register: 0.003,
        rom: 0.16,
        fifo: 0.16,
        memory: 0.16,
    },
    dram_pj_per_byte: 162.5,
    static_pj_per_area: 0.00003,
    technology: technology::DEFAULT,
};

impl Default for Prices {
    fn default() -> Self {
        DEFAULT
    }
}

impl Prices {
    /// Unit costs from a file, or the default ones.
    ///
    /// # Errors
    /// As [`Prices::load`].
    pub fn load_or_default(path: Option<&Path>) -> Result<Self> {
        path.map_or(Ok(DEFAULT), Prices::load)
    }

    /// Unit costs from a JSON file with every field.
    ///
    /// # Errors
    /// [`Error::Input`] where it cannot be read or has other contents.
    pub fn load(path: &Path) -> Result<Self> {
        let input_error =
            |sentence: String| Error::input(format!("{}: {sentence}", path.display()));
        let value = strict_json::read(path).map_err(input_error)?;
        validate::check(&value, &schemars::schema_for!(Prices).to_value())
            .map_err(|error| input_error(error.to_string()))?;
        serde_json::from_value(value).map_err(|e| input_error(e.to_string()))
    }
}

/// Bits of every kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Bits {
    /// Products of the widths of all multipliers.
    pub multiplier: u64,
    /// 18×18 blocks for the multipliers.
    pub blocks_18: u64,
    /// Adders and comparators.
    pub adder: u64,
    /// Multiplexers.
    pub multiplexer: u64,
    /// Words.
    pub register: u64,
    /// Tables.
    pub rom: u64,
    /// Bits of one word of every table.
    pub rom_word: u64,
}

impl Bits {
    fn add(&mut self, operator: Operator, copies: u64) {
        let bits = |bits: i32| bits.max(0) as u64;
        match operator {
            Operator::Multiplier([a, b]) => {
                self.multiplier += copies * bits(a) * bits(b);
                self.blocks_18 += copies * bits(a).div_ceil(18) * bits(b).div_ceil(18);
            }
            Operator::Adder(width) | Operator::Rounder(width) => self.adder += copies * bits(width),
            Operator::Multiplexer(width) => self.multiplexer += copies * bits(width),
            // Multiplexers of two words each.
            Operator::Choice([words, width]) => {
                self.multiplexer += copies * bits(words - 1) * bits(width)
            }
            Operator::Hold(_) => {}
            Operator::Register(width) => self.register += copies * bits(width),
            Operator::Rom([words, width]) => {
                self.rom += copies * bits(words) * bits(width);
                self.rom_word += copies * bits(width);
            }
        }
    }

    fn weighted(&self, of: &PerBit, rom: u64) -> f64 {
        let Bits {
            multiplier,
            adder,
            multiplexer,
            register,
            ..
        } = *self;
        let kinds = [
            (multiplier, of.multiplier),
            (adder, of.adder),
            (multiplexer, of.multiplexer),
            (register, of.register),
            (rom, of.rom),
        ];
        kinds
            .into_iter()
            .map(|(bits, cost)| bits as f64 * cost)
            .sum()
    }
}

/// Area of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UnitCost {
    /// Its name.
    pub name: &'static str,
    /// LUT equivalents of all its instances.
    pub area: f64,
    /// Gate equivalents of all its instances: logic and flip-flops.
    pub gates: f64,
    /// Bits of its parts.
    #[serde(flatten)]
    pub bits: Bits,
}

/// Gate equivalents of a machine: its area in NAND2 of standard cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Gates {
    /// Logic, flip-flops, and FIFOs and memory at the unit costs of their bits: one figure, for
    /// comparing machines.
    pub total: f64,
    /// Operators of all units.
    pub logic: f64,
    /// Words and stages of all units.
    pub flip_flops: f64,
    /// FIFOs and on-chip memory, thousands of bits.
    pub sram_kbit: f64,
}

/// Area of a machine.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Cost {
    /// LUT equivalents: units, FIFOs, on-chip memory.
    pub area: f64,
    /// Gate equivalents, in standard cells.
    pub gates: Gates,
    /// Every unit, in the order of the diagram.
    pub units: Vec<UnitCost>,
    /// Bits of all FIFOs.
    pub fifo_bits: u64,
    /// Bits of tiles, or of the cache, and of the counters of the sort's digits, or of its buffers.
    pub memory_bits: u64,
    /// Bits per pixel of the frame buffer.
    pub frame_bits_per_pixel: u64,
}

impl Cost {
    /// Cost of a machine.
    pub fn new(machine: &Elaborated, prices: &Prices) -> Self {
        let storage = machine.timing.storage;
        // A machine without a sorter or a colour unit has no such row.
        let is_there = |name: &&str| machine.parts.iter().any(|part| part.unit == *name);
        let units: Vec<UnitCost> = unit::BUILT
            .into_iter()
            .filter(is_there)
            .map(|name| {
                let (bits, logic) = built(machine, name, &prices.gates);
                let gates = logic + bits.register as f64 * prices.gates.register;
                UnitCost {
                    name,
                    area: bits.weighted(&prices.area, bits.rom),
                    gates,
                    bits,
                }
            })
            .collect();
        let fifo_bits: u64 = storage
            .fifos
            .map(|fifo| u64::from(fifo.places) * u64::from(fifo.bits))
            .iter()
            .sum();
        let stored =
            fifo_bits as f64 * prices.area.fifo + storage.memory_bits as f64 * prices.area.memory;
        let stored_gates =
            fifo_bits as f64 * prices.gates.fifo + storage.memory_bits as f64 * prices.gates.memory;
        let gates = units.iter().map(|unit| unit.gates).sum::<f64>();
        let flip_flops =
            units.iter().map(|unit| unit.bits.register).sum::<u64>() as f64 * prices.gates.register;
        Cost {
            area: units.iter().map(|unit| unit.area).sum::<f64>() + stored,
            gates: Gates {
                total: gates + stored_gates,
                logic: gates - flip_flops,
                flip_flops,
                sram_kbit: fifo_bits.saturating_add(storage.memory_bits) as f64 / 1e3,
            },
            units,
            fifo_bits,
            memory_bits: storage.memory_bits,
            frame_bits_per_pixel: storage.frame_bits_per_pixel,
        }
    }

    /// The table, at most 80 columns wide.
    pub fn table(&self) -> String {
        let mut table = plain_table(&[
            "",
            "area",
            "",
            "gates",
            "18×18",
            "adders",
            "choices",
            "registers",
            "tables",
        ]);
        let percent = |area: f64| share(area as u64, self.area as u64);
        for UnitCost {
            name,
            area,
            gates,
            bits,
        } in &self.units
        {
            let bits = [
                bits.blocks_18,
                bits.adder,
                bits.multiplexer,
                bits.register,
                bits.rom,
            ]
            .map(thousands);
            let areas = [
                thousands(*area as u64),
                percent(*area),
                thousands(*gates as u64),
            ];
            table.add_row([(*name).to_owned()].into_iter().chain(areas).chain(bits));
        }
        let units: f64 = self.units.iter().map(|unit| unit.area).sum();
        let stored = self.area - units;
        let Gates {
            total,
            logic,
            flip_flops,
            sram_kbit,
        } = self.gates;
        table.add_row([
            "storage".into(),
            thousands(stored as u64),
            percent(stored),
            thousands((total - logic - flip_flops) as u64),
        ]);
        let stored = format!(
            "FIFOs {} bits, memory {} bits; a pixel of the frame buffer {} bits",
            thousands(self.fifo_bits),
            thousands(self.memory_bits),
            thousands(self.frame_bits_per_pixel)
        );
        let [logic, flip_flops, kilobits] =
            [logic, flip_flops, sram_kbit].map(|count| thousands(count as u64));
        let gates = format!(
            "gates {logic} NAND2 of logic, {flip_flops} of flip-flops; SRAM {kilobits} kbit"
        );
        format!(
            "area {} LUT equivalents; blocks counted, all else in bits\n{}\n{}\n{}",
            thousands(self.area as u64),
            wrapped(&gates),
            aligned(table).trim_fmt(),
            wrapped(&stored)
        )
    }
}

/// Number of parallel instances of a unit, and number of multipliers that they share.
fn instances_and_multipliers(machine: &Elaborated, unit: &str) -> (u64, Option<u64>) {
    let of = |setup: Setup| (u64::from(setup.units), setup.multipliers.map(u64::from));
    match unit {
        "project" => of(machine.timing.timing.project),
        "ellipse" => of(machine.timing.timing.ellipse),
        "colour" => {
            let colour = machine.timing.timing.colour.unwrap_or_default();
            (colour.units.into(), Some(colour.multipliers.into()))
        }
        "raster" | "gauss" => (machine.timing.engines.into(), None),
        "fragment" => (
            u64::from(machine.timing.engines * machine.timing.fragment.units),
            None,
        ),
        "resolve" => (
            u64::from(machine.timing.engines * machine.timing.resolve.units),
            None,
        ),
        _ => (1, None),
    }
}

/// Copies of a per-lane part in one unit. Fragment units share the lanes of the rasteriser.
fn lanes(machine: &Elaborated, part: &Part) -> u64 {
    match part.unit {
        _ if !part.per_lane => 1,
        "fragment" => machine.timing.lanes_of_fragment().into(),
        _ => machine
            .timing
            .timing
            .raster
            .lanes
            .map(u64::from)
            .iter()
            .product(),
    }
}

/// Register bits of a unit.
fn registers(machine: &Elaborated, unit: &str) -> u64 {
    let parts = machine.parts.iter().filter(|part| part.unit == unit);
    let bits = |part: &Part| match part.operator {
        Operator::Register(bits) => {
            u64::from(part.copies) * bits.max(0) as u64 * lanes(machine, part)
        }
        _ => 0,
    };
    parts.map(bits).sum()
}

/// Parts of the units with a name, and gate equivalents of their logic.
fn built(machine: &Elaborated, name: &str, prices: &PerBit) -> (Bits, f64) {
    let (units, shared) = instances_and_multipliers(machine, name);
    let parts = machine.parts.iter().filter(|part| part.unit == name);
    let (mut bits, mut logic) = (Bits::default(), 0.0);
    let mut add = |operator: Operator, copies: u64| {
        bits.add(operator, copies);
        logic += copies as f64 * gates::of(prices, operator);
    };
    let mut multipliers = Vec::new();
    for part in parts {
        let copies = u64::from(part.copies) * lanes(machine, part);
        match part.operator {
            Operator::Multiplier([a, b]) => multipliers.push((a.max(b), a.min(b), copies)),
            operator => add(operator, units * copies),
        }
    }
    // A shared multiplier is as wide as the widest of its products.
    multipliers.sort_unstable_by(|one, other| other.cmp(one));
    let mut left = shared.unwrap_or(u64::MAX);
    for (a, b, copies) in multipliers {
        let own = copies.min(left);
        add(Operator::Multiplier([a, b]), units * own);
        // Each product on a shared multiplier needs a multiplexer for its operands. The unit of
        // colours has unit costs without a datapath.
        if name != unit::COLOUR {
            add(Operator::Multiplexer(a + b), units * (copies - own));
        }
        left -= own;
    }
    // Each word has a register, and each stage registers for its live bits.
    let stages = machine
        .timing
        .pipelines
        .iter()
        .find(|pipeline| pipeline.unit == name);
    let of_all =
        |of: fn(&Pipeline) -> u64| stages.map_or(0, |stages| of(stages) * u64::from(stages.units));
    bits.register = bits.register.max(of_all(|of| of.bits)) + of_all(|of| of.merge_bits);
    (bits, logic)
}

/// Area of a machine, and energy of a frame on it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CostReport {
    /// Area.
    #[serde(flatten)]
    pub cost: Cost,
    /// Energy, joules per frame.
    pub energy: Energy,
}

impl CostReport {
    /// Report for a machine and the cycles of a frame on it.
    pub fn new(machine: &Elaborated, cycles: &Cycles, prices: &Prices) -> Self {
        let cost = Cost::new(machine, prices);
        CostReport {
            energy: Energy::new(machine, &cost, cycles, prices),
            cost,
        }
    }

    /// Two lines, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let Energy {
            total,
            units,
            storage,
            dram,
            leakage,
        } = self.energy;
        let parts = [
            ("units", units),
            ("storage", storage),
            ("DRAM", dram),
            ("leakage", leakage),
        ];
        let femtojoules = |joules: f64| (joules * 1e15) as u64;
        let parts = parts
            .map(|(name, joules)| {
                format!("{name} {}", share(femtojoules(joules), femtojoules(total)))
            })
            .join(", ");
        let area = thousands(self.cost.area as u64);
        format!(
            "area: {area} LUT equivalents\nenergy: {:.2} mJ a frame ({parts})",
            total * 1e3
        )
    }
}

/// Energy of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Energy {
    /// Joules: the sum of the following.
    pub total: f64,
    /// Units at work.
    pub units: f64,
    /// Tiles or cache, and FIFOs.
    pub storage: f64,
    /// Bytes to and from off-chip memory.
    pub dram: f64,
    /// Leakage over the frame's time.
    pub leakage: f64,
}

impl Energy {
    /// Energy of a frame that took these cycles on a machine of that cost. Every lane of a slot
    /// counts, whether it keeps a pixel or not.
    pub fn new(machine: &Elaborated, cost: &Cost, cycles: &Cycles, prices: &Prices) -> Self {
        let counted = |name: &str| {
            cycles
                .units
                .iter()
                .filter(|unit| unit.name == name)
                .map(|unit| unit.items)
                .sum::<u64>() as f64
        };
        let sorters = machine.timing.sorters();
        // A sorter handles one entry per cycle.
        let sorted: f64 = cycles
            .units
            .iter()
            .filter(|unit| unit.name == unit::SORT && sorters > 0)
            .map(|unit| unit.account.busy as f64)
            .sum();
        // A test of tiles works in every cycle of its unit: on a splat, or on tiles.
        let tested: f64 = cycles
            .units
            .iter()
            .filter(|unit| unit.name == unit::BIN)
            .map(|unit| unit.account.busy as f64)
            .sum();
        let masks = cycles.tile_tests.and_then(|tests| tests.masks);
        let items = |name: &str| match name {
            unit::SORT if sorters > 0 => sorted,
            unit::BIN if machine.timing.bin.is_some() || machine.timing.tiles_per_cycle > 1 => {
                tested
            }
            // Each entry of a kept list is written back.
            unit::LIST if machine.timing.keeps_lists() => {
                counted(unit::LIST).max(masks.map_or(0, |masks| masks.list_cycles) as f64)
            }
            // The parts of list are those of its masks, in all engines.
            unit::LIST | unit::CONTRIBUTION => masks.map_or(0, |masks| masks.list_cycles) as f64,
            // Each shaded fragment may be reflected.
            "shade" | "reflect" => {
                counted("shade") + counted("resolve-shade") + counted("setup-shade")
            }
            name => counted(name),
        };
        let of = &prices.energy_pj;
        // Harmonics of a degree below the greatest take fewer products and hold fewer bits.
        let (most, own) = (
            machine.timing.colour.last(),
            machine.timing.colour_of(cycles.harmonics),
        );
        let colour_at_work = most.zip(own).map_or(0.0, |(most, own)| {
            f64::from(own.products) / f64::from(most.products)
        });
        let idle_bits = most.map_or(0, |most| {
            most.more_bits - own.map_or(0, |own| own.more_bits)
        });
        let units: f64 = (machine.parts.iter())
            .map(|part| {
                let mut bits = Bits::default();
                bits.add(part.operator, lanes(machine, part) * u64::from(part.copies));
                // Parts are those of all shade units, or of all sorters; an item passes through one
                // of them.
                let instances = match part.unit {
                    "shade" | "reflect" => f64::from(machine.timing.shade_units),
                    unit::LIST | unit::CONTRIBUTION => f64::from(machine.timing.engines),
                    unit::SORT => f64::from(sorters.max(1)),
                    _ => 1.0,
                };
                let at_work = if part.unit == "colour" {
                    colour_at_work
                } else {
                    1.0
                };
                items(part.unit) / instances * at_work * bits.weighted(of, bits.rom_word)
            })
            .sum();
        // An item passes through every stage.
        let stages: f64 = (machine.timing.pipelines.iter())
            .filter(|stages| stages.units > 0)
            .map(|stages| {
                let own = registers(machine, stages.unit)
                    / u64::from(if stages.unit == "shade" {
                        stages.units
                    } else {
                        1
                    });
                // Coefficients that a frame does not have are not carried.
                let held = |pace: &Pace| {
                    u64::from(pace.latency.div_ceil(pace.interval)) * u64::from(idle_bits)
                };
                let idle = match stages.unit {
                    "project" => held(&machine.timing.project),
                    "ellipse" => held(&machine.timing.ellipse),
                    "colour" => most.map_or(0, |most| held(&most.pace) / 2),
                    _ => 0,
                };
                items(stages.unit) * stages.bits.saturating_sub(own + idle) as f64 * of.register
            })
            .sum();
        let units = units + stages;
        let lanes = machine.timing.lanes_of_fragment();
        let read_and_written =
            items("fragment") * f64::from(2 * lanes * 8 * machine.timing.fragment_bytes);
        let moved = |fifo: Fifo| {
            let idle = if ["project", "ellipse", "colour"].contains(&fifo.to) {
                idle_bits
            } else {
                0
            };
            // Each fragment unit takes its own share of a stamp.
            let sharers = if fifo.to == "fragment" {
                machine.timing.fragment.units
            } else {
                1
            };
            fifo.bits
                .min(1 << 20)
                .saturating_sub(idle)
                .div_ceil(sharers)
        };
        let queued: f64 = machine
            .timing
            .storage
            .fifos
            .map(|fifo| {
                // A splat leaves its FIFO once, however many tiles are tested.
                let items = match fifo.to {
                    unit::BIN => counted(unit::BIN),
                    name => items(name),
                };
                items * f64::from(2 * moved(fifo))
            })
            .iter()
            .sum();
        let of_sorters = sorted
            * machine
                .timing
                .sort
                .map_or(0.0, |sort| f64::from(2 * 8 * sort.entry_bytes));
        let storage = (read_and_written + of_sorters) * of.memory + queued * of.fifo;
        let dram = cycles.memory.total_bytes() as f64 * prices.dram_pj_per_byte;
        let timing = &machine.timing.timing;
        let seconds = cycles.total as f64 / timing.clock_hz as f64;
        let leakage = cost.area * seconds / STATIC_SECONDS * prices.static_pj_per_area;
        let scale = prices.technology.of(timing.technology);
        let [units, storage, dram, leakage] = [
            units * scale.dynamic,
            storage * scale.dynamic,
            dram,
            leakage * scale.leakage,
        ]
        .map(|picojoules| picojoules * 1e-12);
        Energy {
            total: units + storage + dram + leakage,
            units,
            storage,
            dram,
            leakage,
        }
    }
}

#[cfg(test)]
mod tests;
