//! Technology: scales energy to other technologies than that of the unit costs.
//!
//! *Dynamic*: the energy factors of Stillmaker and Baas, "Scaling equations for the accurate
//! prediction of CMOS device performance from 180 nm to 7 nm" (Integration 58, 2017, table 5 and
//! corrigendum, high performance), at the nominal voltage of each, relative to 45 nm at 0.9 V, the
//! technology of Horowitz' figures:
//!
//! | | V | energy factor | relative to 45 nm |
//! |---|---|---|---|
//! | 180 nm | 1.8 | 24.64·V² − 17.98·V = 47.47 | 68 |
//! | 65 nm | 1.1 | 3.755·V² − 4.398·V + 1.975 = 1.681 | 2.4 |
//! | 45 nm | 0.9 | 1.018·V² − 0.3107·V + 0.1539 = 0.6989 | 1 |
//! | 28 nm | 0.9 | 0.362, on a power law between 0.4571 at 32 nm and 0.2008 at 20 nm | 0.52 |
//! | 7 nm | 0.7 | 0.1776·V² − 0.09097·V + 0.02447 = 0.0478 | 0.068 |
//!
//! *Leakage*, in the same time: assumed. It is proportional to a gate's width and voltage. The off
//! current per width is assumed to be the same from 65 nm on, as roadmaps require for fast logic,
//! and a twentieth of that in 180 nm. A fin counts as if it were flat.
//!
//! *An FPGA* of 28 nm takes 14 times the energy of standard cells, and has 35 times their leakage,
//! the ratio of the areas (Kuon and Rose, "Measuring the gap between FPGAs and ASICs", 2007; that
//! leakage is proportional to area is assumed).
//!
//! Off-chip memory is not scaled.

use rtl_model::machine::timing::Technology;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Energy in a technology, as a fraction of the unit costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnergyScale {
    /// Dynamic energy.
    #[schemars(range(min = 0))]
    pub dynamic: f64,
    /// Leakage in the same time.
    #[schemars(range(min = 0))]
    pub leakage: f64,
}

/// Scale of each technology; `ideal` uses that of 28 nm, the default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scales {
    /// 180 nm.
    #[serde(rename = "180nm")]
    pub nm180: EnergyScale,
    /// 65 nm.
    #[serde(rename = "65nm")]
    pub nm65: EnergyScale,
    /// 28 nm.
    #[serde(rename = "28nm")]
    pub nm28: EnergyScale,
    /// 7 nm.
    #[serde(rename = "7nm")]
    pub nm7: EnergyScale,
    /// An FPGA.
    pub fpga: EnergyScale,
}

/// See the head of this file.
pub const DEFAULT: Scales = Scales {
    nm180: EnergyScale {
        dynamic: 68.0,
        leakage: 0.4,
    },
    nm65: EnergyScale {
        dynamic: 2.4,
        leakage: 1.8,
    },
    nm28: EnergyScale {
        dynamic: 0.52,
        leakage: 0.62,
    },
    nm7: EnergyScale {
        dynamic: 0.068,
        leakage: 0.12,
    },
    fpga: EnergyScale {
        dynamic: 7.3,
        leakage: 22.0,
    },
};

impl Scales {
    /// Unit costs without scales: the same in every technology, as for a file without `scales`.
    pub fn none() -> Self {
        let one = EnergyScale {
            dynamic: 1.0,
            leakage: 1.0,
        };
        Scales {
            nm180: one,
            nm65: one,
            nm28: one,
            nm7: one,
            fpga: one,
        }
    }

    /// Scale of a technology.
    pub fn of(&self, technology: Technology) -> EnergyScale {
        match technology {
            Technology::Nm180 => self.nm180,
            Technology::Nm65 => self.nm65,
            Technology::Nm28 | Technology::Ideal => self.nm28,
            Technology::Nm7 => self.nm7,
            Technology::Fpga => self.fpga,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quadratic of a node: its coefficients and voltage.
    fn factor([square, linear, constant]: [f64; 3], volts: f64) -> f64 {
        (square * volts + linear) * volts + constant
    }

    #[test]
    fn the_scales_are_those_of_the_published_equations() {
        let base = factor([1.018, -0.3107, 0.1539], 0.9);
        let [at_32, at_20] = [
            factor([0.8367, -0.4341, 0.1701], 0.9),
            factor([0.373, -0.1582, 0.04104], 0.9),
        ];
        // The corrigendum gives this value.
        assert!((at_32 - 0.4571).abs() < 5e-5, "{at_32}");
        let power = (at_32 / at_20).ln() / (32.0f64 / 20.0).ln();
        let at_28 = at_32 * (28.0f64 / 32.0).powf(power);
        let nodes = [
            (
                DEFAULT.nm180,
                factor([24.64, -17.98, 0.0], 1.8),
                180.0,
                1.8,
                0.05,
            ),
            (
                DEFAULT.nm65,
                factor([3.755, -4.398, 1.975], 1.1),
                65.0,
                1.1,
                1.0,
            ),
            (DEFAULT.nm28, at_28, 28.0, 0.9, 1.0),
            (
                DEFAULT.nm7,
                factor([0.1776, -0.09097, 0.02447], 0.7),
                7.0,
                0.7,
                1.0,
            ),
        ];
        for (scale, energy, nanometres, volts, off_current) in nodes {
            let leakage = off_current * nanometres / 45.0 * volts / 0.9;
            for (ratio, exact) in [(scale.dynamic, energy / base), (scale.leakage, leakage)] {
                assert!(
                    (ratio / exact - 1.0).abs() < 0.03,
                    "{nanometres} nm: {ratio}, {exact}"
                );
            }
        }
        for (ratio, times) in [
            (DEFAULT.fpga.dynamic / DEFAULT.nm28.dynamic, 14.0),
            (DEFAULT.fpga.leakage / DEFAULT.nm28.leakage, 35.0),
        ] {
            assert!((ratio / times - 1.0).abs() < 0.03, "{ratio}");
        }
    }
}
