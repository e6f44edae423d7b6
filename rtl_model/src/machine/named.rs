//! Named machines.

use super::{
    Colour, Ellipse, Ellipsoid, Fragment, FragmentDepth, FunctionUnit, Gauss, Group, Interpolation,
    Machine, Merge, Operators, Project, Raster, Resolve, Rows, Shade, Sheets, Sort, SortKind,
    Splat, TableShape, Window, published, timing,
};
use crate::num::{Format, Overflow, Rounding, Word};

impl Machine {
    /// A machine by its name.
    pub fn named(name: &str) -> Option<Machine> {
        match name {
            "reference" => Some(reference()),
            "lean" => Some(lean()),
            "tiny" => Some(tiny()),
            "window" => Some(window()),
            "volume" => Some(volume()),
            "gaussian" => Some(gaussian()),
            "fp16" => Some(fp16()),
            "mixed" => Some(mixed()),
            "weighted" => Some(weighted()),
            "gscore" => Some(published::gscore()),
            "neo" => Some(published::neo()),
            "flicker" => Some(published::flicker()),
            "nycu" => Some(published::nycu()),
            "cubed" => Some(published::cubed()),
            _ => None,
        }
    }

    /// Names of the machines for surfaces, the default first.
    pub const NAMES: [&str; 3] = ["reference", "lean", "tiny"];
    /// Names of the machines for surfaces that group fragments by windows.
    pub const WINDOW_NAMES: [&str; 1] = ["window"];
    /// Names of the machines for volumes and for Gaussians.
    pub const ELLIPSOID_NAMES: [&str; 5] = ["volume", "gaussian", "fp16", "mixed", "weighted"];

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> + Clone {
        Self::NAMES
            .into_iter()
            .chain(Self::WINDOW_NAMES)
            .chain(Self::ELLIPSOID_NAMES)
            .chain(Self::PUBLISHED_NAMES)
    }
}

pub(super) const fn signed(int_bits: i32, frac_bits: i32) -> Word {
    Word::new(Format::signed(int_bits, frac_bits))
}

pub(super) const fn unsigned(int_bits: i32, frac_bits: i32) -> Word {
    Word::new(Format::unsigned(int_bits, frac_bits))
}

/// The default: its picture is accurate enough for engineers. No multiplier operand has more than
/// 27 bits. A fragment fits the paper's 38 bytes.
fn reference() -> Machine {
    let fine = FunctionUnit {
        table_bits: 8,
        newton_steps: 2,
        bits: 26,
    };
    Machine {
        name: "reference".into(),
        operators: Operators::Exact,
        splat: Splat {
            position: signed(1, 26),
            normal: signed(2, 22),
            radius: unsigned(0, 27),
            rgb: unsigned(1, 12),
            opacity: unsigned(1, 12),
        },
        project: Project {
            eye: signed(3, 26),
            relative: signed(1, 26).rounded(Rounding::Truncate),
            rotation: signed(2, 25),
            camera: signed(2, 25),
            depth: unsigned(1, 26),
            reciprocal: fine,
            slope: signed(4, 22),
            focal: unsigned(15, 12),
            pixel: signed(15, 14),
        },
        ellipse: Ellipse {
            normal: signed(2, 22),
            tilt: signed(4, 22),
            facing: signed(4, 22),
            scaled_radius: unsigned(1, 26).rounded(Rounding::Truncate),
            size: unsigned(0, 26),
            size_squared: unsigned(0, 27),
            aspect: Some(unsigned(1, 26)),
            shape: signed(6, 21),
            low_pass: unsigned(3, 24),
            variance: unsigned(5, 21),
            variance_cross: signed(6, 21),
            area: signed(4, 22),
            determinant: unsigned(8, 40),
            root: fine,
            inverse: unsigned(1, 26),
            conic: unsigned(2, 25),
            conic_cross: signed(2, 25),
            visibility: unsigned(1, 24),
            inverse_two_pi: unsigned(-2, 24),
            amplitude: unsigned(-2, 24),
            extent_root: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 18,
            },
            extent: unsigned(15, 4),
            slope_reciprocal: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 20,
            },
            inverse_focal: unsigned(1, 24),
            depth_step: unsigned(1, 25),
            depth_slope: signed(3, 24),
            root_cutoff: unsigned(3, 16),
            depth_range: unsigned(0, 26),
            ellipsoid: None,
        },
        colour: None,
        bin: None,
        sort: None,
        contribution: None,
        raster: Raster {
            rows: Rows::Differenced,
            cutoff: unsigned(5, 16),
            most_cutoff: None,
            offset: signed(15, 12),
            gradient: signed(12, 15),
            square: None,
            radial: signed(20, 27).overflowing(Overflow::Wrap),
            first: signed(16, 27),
            second: signed(4, 25),
            depth: signed(18, 26).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 18),
            table: TableShape {
                index_bits: 8,
                interpolation: Interpolation::Linear,
            },
            falloff: unsigned(1, 20),
            weight: unsigned(-2, 20),
        },
        fragment: Fragment {
            layers: 3,
            merge: Merge::FarthestPair,
            group: Group::First,
            evict_hidden: true,
            turn_normals: true,
            fragment_depth: FragmentDepth::First,
            opaque_permille: 999,
            opaque: unsigned(1, 12),
            depth: unsigned(1, 25),
            normal: signed(2, 12),
            weight_sum: unsigned(5, 20),
            colour_sum: unsigned(5, 20),
            opacity_sum: unsigned(5, 20),
            normal_sum: signed(6, 20),
            sheets: None,
            window: None,
        },
        shade: Shade {
            reciprocal: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 20,
            },
            root: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 20,
            },
            share: unsigned(2, 20),
            normal_share: signed(2, 20),
            rgb: unsigned(1, 18),
            opacity: unsigned(1, 18),
            normal: signed(2, 18),
            light: signed(2, 18),
            cosine: signed(2, 18),
            highlight_table: TableShape {
                index_bits: 10,
                interpolation: Interpolation::Linear,
            },
            highlight: unsigned(1, 18),
            reflectance: unsigned(4, 18),
            irradiance: unsigned(4, 18),
            colour: unsigned(1, 18),
            inverse_threshold: unsigned(1, 18),
            coverage: unsigned(1, 18),
            premultiplied: unsigned(1, 18),
        },
        reflect: None,
        resolve: Resolve {
            transmittance: unsigned(1, 18),
            frame: unsigned(1, 16),
        },
        timing: timing::DEFAULT,
    }
}

/// The cheapest machine with a good picture: no multiplier operand has more than 18 bits, no
/// accumulator more than 24.
fn lean() -> Machine {
    let unit = FunctionUnit {
        table_bits: 8,
        newton_steps: 1,
        bits: 17,
    };
    let base = reference();
    Machine {
        name: "lean".into(),
        operators: Operators::Exact,
        splat: Splat {
            position: signed(1, 22),
            normal: signed(2, 14),
            radius: unsigned(-3, 20),
            rgb: unsigned(1, 11),
            opacity: unsigned(1, 11),
        },
        project: Project {
            eye: signed(3, 22),
            relative: signed(1, 17).rounded(Rounding::Truncate),
            rotation: signed(2, 16),
            camera: signed(2, 16),
            depth: unsigned(1, 22),
            reciprocal: unit,
            slope: signed(2, 16),
            focal: unsigned(11, 7),
            pixel: signed(12, 8),
        },
        ellipse: Ellipse {
            normal: signed(2, 15),
            tilt: signed(3, 14),
            facing: signed(3, 15),
            scaled_radius: unsigned(1, 17).rounded(Rounding::Truncate),
            size: unsigned(0, 17),
            size_squared: unsigned(0, 18),
            aspect: None,
            shape: signed(4, 14),
            low_pass: unsigned(3, 15),
            variance: unsigned(4, 13),
            variance_cross: signed(4, 13),
            area: signed(3, 15),
            determinant: unsigned(7, 30),
            root: unit,
            inverse: unsigned(1, 17),
            conic: unsigned(2, 16),
            conic_cross: signed(2, 16),
            visibility: unsigned(1, 16),
            inverse_two_pi: unsigned(-2, 18),
            amplitude: unsigned(-2, 18),
            extent_root: FunctionUnit {
                table_bits: 8,
                newton_steps: 0,
                bits: 12,
            },
            extent: unsigned(12, 3),
            slope_reciprocal: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 14,
            },
            inverse_focal: unsigned(1, 16),
            depth_step: unsigned(1, 17),
            depth_slope: signed(1, 17),
            root_cutoff: unsigned(3, 10),
            depth_range: unsigned(-3, 20),
            ellipsoid: None,
        },
        colour: None,
        bin: None,
        sort: None,
        contribution: None,
        raster: Raster {
            rows: Rows::Seeded,
            cutoff: unsigned(5, 10),
            most_cutoff: None,
            offset: signed(10, 8),
            gradient: signed(8, 10),
            square: None,
            radial: signed(9, 15).overflowing(Overflow::Wrap),
            first: signed(8, 15),
            second: signed(3, 15),
            depth: signed(4, 20).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 12),
            table: TableShape {
                index_bits: 6,
                interpolation: Interpolation::Linear,
            },
            falloff: unsigned(1, 14),
            weight: unsigned(-2, 17),
        },
        fragment: Fragment {
            depth: unsigned(1, 20),
            opaque: unsigned(1, 12),
            normal: signed(2, 10),
            weight_sum: unsigned(4, 14),
            colour_sum: unsigned(4, 14),
            opacity_sum: unsigned(4, 14),
            normal_sum: signed(5, 13),
            ..base.fragment
        },
        shade: Shade {
            reciprocal: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 16,
            },
            root: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 16,
            },
            share: unsigned(2, 14),
            normal_share: signed(2, 14),
            rgb: unsigned(1, 14),
            opacity: unsigned(1, 14),
            normal: signed(2, 14),
            light: signed(2, 14),
            cosine: signed(2, 14),
            highlight_table: TableShape {
                index_bits: 8,
                interpolation: Interpolation::Linear,
            },
            highlight: unsigned(1, 14),
            reflectance: unsigned(3, 12),
            irradiance: unsigned(3, 12),
            colour: unsigned(1, 14),
            inverse_threshold: unsigned(1, 14),
            coverage: unsigned(1, 14),
            premultiplied: unsigned(1, 14),
        },
        reflect: None,
        resolve: Resolve {
            transmittance: unsigned(1, 14),
            frame: unsigned(1, 12),
        },
        timing: timing::DEFAULT,
    }
}

/// Visibly coarse and fast: words of about eight bits, for tests and to make errors visible.
fn tiny() -> Machine {
    let unit = FunctionUnit {
        table_bits: 6,
        newton_steps: 0,
        bits: 9,
    };
    let base = reference();
    Machine {
        name: "tiny".into(),
        operators: Operators::Exact,
        splat: Splat {
            position: signed(1, 11),
            normal: signed(2, 6),
            radius: unsigned(-3, 14),
            rgb: unsigned(1, 7),
            opacity: unsigned(1, 7),
        },
        project: Project {
            eye: signed(3, 11),
            relative: signed(1, 9).rounded(Rounding::Truncate),
            rotation: signed(2, 8),
            camera: signed(2, 9),
            depth: unsigned(1, 12),
            reciprocal: unit,
            slope: signed(2, 9),
            focal: unsigned(11, 2),
            pixel: signed(12, 3),
        },
        ellipse: Ellipse {
            normal: signed(2, 7),
            tilt: signed(3, 7),
            facing: signed(3, 7),
            scaled_radius: unsigned(1, 8).rounded(Rounding::Truncate),
            size: unsigned(0, 8),
            size_squared: unsigned(0, 9),
            aspect: None,
            shape: signed(4, 6),
            low_pass: unsigned(3, 8),
            variance: unsigned(4, 6),
            variance_cross: signed(4, 6),
            area: signed(3, 7),
            determinant: unsigned(7, 14),
            root: unit,
            inverse: unsigned(1, 8),
            conic: unsigned(2, 8),
            conic_cross: signed(2, 8),
            visibility: unsigned(1, 8),
            inverse_two_pi: unsigned(-2, 10),
            amplitude: unsigned(-2, 10),
            extent_root: unit,
            extent: unsigned(12, 2),
            slope_reciprocal: unit,
            inverse_focal: unsigned(1, 8),
            depth_step: unsigned(1, 8),
            depth_slope: signed(1, 10),
            root_cutoff: unsigned(3, 6),
            depth_range: unsigned(-3, 11),
            ellipsoid: None,
        },
        colour: None,
        bin: None,
        sort: None,
        contribution: None,
        raster: Raster {
            rows: Rows::Seeded,
            cutoff: unsigned(5, 4),
            most_cutoff: None,
            offset: signed(10, 3),
            gradient: signed(8, 5),
            square: None,
            radial: signed(9, 8).overflowing(Overflow::Wrap),
            first: signed(8, 8),
            second: signed(3, 8),
            depth: signed(4, 12).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 6),
            table: TableShape {
                index_bits: 5,
                interpolation: Interpolation::Nearest,
            },
            falloff: unsigned(1, 8),
            weight: unsigned(-2, 10),
        },
        fragment: Fragment {
            depth: unsigned(1, 10),
            opaque: unsigned(1, 10),
            normal: signed(2, 6),
            weight_sum: unsigned(3, 8),
            colour_sum: unsigned(3, 8),
            opacity_sum: unsigned(3, 8),
            normal_sum: signed(4, 8),
            ..base.fragment
        },
        shade: Shade {
            reciprocal: FunctionUnit {
                table_bits: 6,
                newton_steps: 0,
                bits: 8,
            },
            root: FunctionUnit {
                table_bits: 6,
                newton_steps: 0,
                bits: 8,
            },
            share: unsigned(2, 8),
            normal_share: signed(2, 8),
            rgb: unsigned(1, 8),
            opacity: unsigned(1, 8),
            normal: signed(2, 8),
            light: signed(2, 8),
            cosine: signed(2, 8),
            highlight_table: TableShape {
                index_bits: 6,
                interpolation: Interpolation::Nearest,
            },
            highlight: unsigned(1, 8),
            reflectance: unsigned(3, 6),
            irradiance: unsigned(3, 6),
            colour: unsigned(1, 8),
            inverse_threshold: unsigned(1, 8),
            coverage: unsigned(1, 8),
            premultiplied: unsigned(1, 8),
        },
        reflect: None,
        resolve: Resolve {
            transmittance: unsigned(1, 8),
            frame: unsigned(1, 8),
        },
        timing: timing::DEFAULT,
    }
}

/// `reference` with four slots that are grouped into windows as late as possible. Four slots of 27
/// bytes take less than the paper's three.
fn window() -> Machine {
    let base = reference();
    Machine {
        name: "window".into(),
        fragment: Fragment {
            layers: 4,
            merge: Merge::Window,
            group: Group::Window,
            depth: unsigned(1, 18),
            normal: signed(2, 12),
            weight_sum: unsigned(3, 20),
            colour_sum: unsigned(3, 15),
            opacity_sum: unsigned(3, 16),
            normal_sum: signed(4, 12),
            window: Some(Window {
                join_permille: 0,
                late: true,
                inside: true,
                depth_sum: unsigned(4, 21),
                through: unsigned(1, 9),
                reciprocal: FunctionUnit {
                    table_bits: 8,
                    newton_steps: 1,
                    bits: 18,
                },
                share: unsigned(2, 18),
                part: unsigned(1, 18),
                density: unsigned(3, 12),
                density_table: TableShape {
                    index_bits: 8,
                    interpolation: Interpolation::Linear,
                },
                exponent: unsigned(1, 12),
                hidden_table: TableShape {
                    index_bits: 6,
                    interpolation: Interpolation::Linear,
                },
                hidden: unsigned(1, 14),
            }),
            ..base.fragment
        },
        timing: timing::Timing {
            fragment: timing::Fragment {
                merge: 23,
                ..timing::DEFAULT.fragment
            },
            ..timing::DEFAULT
        },
        ..base
    }
}

/// For volumes: setup for ellipsoids, grouping by sheets. The rest is `reference`, except that
/// optical depths may exceed 1/2π.
fn volume() -> Machine {
    let base = reference();
    Machine {
        name: "volume".into(),
        splat: Splat {
            opacity: unsigned(3, 20),
            ..base.splat
        },
        ellipse: Ellipse {
            visibility: unsigned(3, 22),
            amplitude: unsigned(3, 22),
            ellipsoid: Some(Ellipsoid {
                quaternion: signed(2, 22),
                scale: unsigned(1, 24),
                stretch: signed(4, 22),
                ray: unsigned(4, 20),
                ray_root: FunctionUnit {
                    table_bits: 8,
                    newton_steps: 1,
                    bits: 20,
                },
                compensation_root: Some(FunctionUnit {
                    table_bits: 8,
                    newton_steps: 1,
                    bits: 20,
                }),
                reach_bits: None,
            }),
            ..base.ellipse
        },
        gauss: Gauss {
            weight: unsigned(3, 20),
            ..base.gauss
        },
        fragment: Fragment {
            sheets: Some(Sheets {
                depth_index: unsigned(3, 16),
                table: TableShape {
                    index_bits: 10,
                    interpolation: Interpolation::Linear,
                },
                ratio: unsigned(1, 20),
                composite: None,
            }),
            ..base.fragment
        },
        ..base
    }
}

/// For trained Gaussians: `volume` with a sort by depth, the cutoff of Gaussians, and smaller boxes
/// for low opacities.
pub(super) fn gaussian() -> Machine {
    let base = volume();
    let ellipsoid = base.ellipse.ellipsoid.map(|ellipsoid| Ellipsoid {
        reach_bits: Some(7),
        ..ellipsoid
    });
    Machine {
        name: "gaussian".into(),
        splat: Splat {
            rgb: unsigned(3, 14),
            ..base.splat
        },
        // Centres far outside the picture contribute too.
        project: Project {
            slope: signed(6, 22),
            ..base.project
        },
        ellipse: Ellipse {
            ellipsoid,
            ..base.ellipse
        },
        colour: Some(Colour::default()),
        sort: Some(Sort {
            kind: SortKind::Radix,
            key: unsigned(1, 23),
            tile_bits: None,
            digit_bits: 8,
            incremental: None,
            depth_weight: None,
        }),
        gauss: Gauss {
            radial_index: unsigned(4, 16),
            table: TableShape {
                index_bits: 10,
                interpolation: Interpolation::Linear,
            },
            ..base.gauss
        },
        shade: Shade {
            premultiplied: unsigned(3, 18),
            ..base.shade
        },
        ..base
    }
}

/// Bits of the magnitudes of FP16: 11 significant ones, and 30 exponents.
const HALF_BITS: i32 = 40;

/// A word with the significant bits of FP16, and those of its exponents that reach the word.
const fn half(word: Word) -> Word {
    let format = word.format;
    let most = HALF_BITS - format.magnitude_bits();
    let frac_bits = format.frac_bits + if most < 0 { most } else { 0 };
    Word::new(Format {
        frac_bits,
        significant_bits: 11,
        ..format
    })
}

/// `fp16` with a contribution test: differences in half precision, the test in words of 8 bits.
fn mixed() -> Machine {
    Machine {
        name: "mixed".into(),
        contribution: Some(published::TEST_IN_8_BITS),
        ..fp16()
    }
}

/// `gaussian` without a sort: the Gaussians of a pixel are summed, in words for sums up to 512.
fn weighted() -> Machine {
    let base = gaussian();
    let sheets = base.fragment.sheets.map(|sheets| Sheets {
        depth_index: unsigned(9, 14),
        table: TableShape {
            index_bits: 12,
            ..sheets.table
        },
        ..sheets
    });
    Machine {
        name: "weighted".into(),
        sort: base.sort.map(|sort| Sort {
            kind: SortKind::None,
            ..sort
        }),
        fragment: Fragment {
            weight_sum: unsigned(9, 14),
            colour_sum: unsigned(9, 14),
            opacity_sum: unsigned(9, 14),
            normal_sum: signed(10, 14),
            sheets,
            ..base.fragment
        },
        ..base
    }
}

/// `gaussian` in half precision. Pixels, depths of fragments, keys, boxes, the registers of the
/// raster and indices of tables are in fixed point.
pub(super) fn fp16() -> Machine {
    let base = gaussian();
    let Machine {
        splat,
        project,
        ellipse,
        raster,
        gauss,
        fragment,
        shade,
        resolve,
        ..
    } = base;
    let ellipsoid = ellipse.ellipsoid.map(|ellipsoid| Ellipsoid {
        quaternion: half(ellipsoid.quaternion),
        scale: half(ellipsoid.scale),
        stretch: half(ellipsoid.stretch),
        ray: half(ellipsoid.ray),
        ..ellipsoid
    });
    let colour = base.colour.map(|colour| Colour {
        coefficient: half(colour.coefficient),
        relative: half(colour.relative),
        direction: half(colour.direction),
        monomial: half(colour.monomial),
        basis: half(colour.basis),
        ..colour
    });
    Machine {
        name: "fp16".into(),
        splat: Splat {
            position: half(splat.position),
            normal: half(splat.normal),
            radius: half(splat.radius),
            rgb: half(splat.rgb),
            opacity: half(splat.opacity),
        },
        project: Project {
            eye: half(project.eye),
            relative: half(project.relative),
            rotation: half(project.rotation),
            camera: half(project.camera),
            depth: half(project.depth),
            slope: half(project.slope),
            focal: half(project.focal),
            ..project
        },
        ellipse: Ellipse {
            normal: half(ellipse.normal),
            tilt: half(ellipse.tilt),
            facing: half(ellipse.facing),
            scaled_radius: half(ellipse.scaled_radius),
            size: half(ellipse.size),
            size_squared: half(ellipse.size_squared),
            aspect: ellipse.aspect.map(half),
            shape: half(ellipse.shape),
            low_pass: half(ellipse.low_pass),
            variance: half(ellipse.variance),
            variance_cross: half(ellipse.variance_cross),
            area: half(ellipse.area),
            determinant: half(ellipse.determinant),
            inverse: half(ellipse.inverse),
            conic: half(ellipse.conic),
            conic_cross: half(ellipse.conic_cross),
            visibility: half(ellipse.visibility),
            inverse_two_pi: half(ellipse.inverse_two_pi),
            amplitude: half(ellipse.amplitude),
            inverse_focal: half(ellipse.inverse_focal),
            depth_step: half(ellipse.depth_step),
            depth_slope: half(ellipse.depth_slope),
            root_cutoff: half(ellipse.root_cutoff),
            depth_range: half(ellipse.depth_range),
            ellipsoid,
            ..ellipse
        },
        colour,
        raster: Raster {
            offset: half(raster.offset),
            gradient: half(raster.gradient),
            ..raster
        },
        gauss: Gauss {
            falloff: half(gauss.falloff),
            weight: half(gauss.weight),
            ..gauss
        },
        fragment: Fragment {
            normal: half(fragment.normal),
            weight_sum: half(fragment.weight_sum),
            colour_sum: half(fragment.colour_sum),
            opacity_sum: half(fragment.opacity_sum),
            normal_sum: half(fragment.normal_sum),
            ..fragment
        },
        shade: Shade {
            share: half(shade.share),
            normal_share: half(shade.normal_share),
            rgb: half(shade.rgb),
            opacity: half(shade.opacity),
            normal: half(shade.normal),
            light: half(shade.light),
            reflectance: half(shade.reflectance),
            irradiance: half(shade.irradiance),
            colour: half(shade.colour),
            inverse_threshold: half(shade.inverse_threshold),
            coverage: half(shade.coverage),
            premultiplied: half(shade.premultiplied),
            ..shade
        },
        resolve: Resolve {
            transmittance: half(resolve.transmittance),
            frame: half(resolve.frame),
        },
        ..base
    }
}
