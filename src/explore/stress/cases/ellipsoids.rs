//! Ellipsoids: the cases of volumes and Gaussians, on the machine for them.

use super::{
    BLUE, COLOURS, Case, CaseVariant, DEPTH, FLAT, FOCAL_PX, GREEN, PALE, PX, RED, SIDE, at, disc,
    leaning, picture, plane, shuffled,
};
use crate::scene::{
    Amplitude, Ellipsoids, Filter, Kernel, Opacity, Orientation, Scene, Sheet, Sheets, Splat,
    Surface,
};
use glam::{DQuat, DVec3};

/// The cases.
pub const CASES: [Case; 7] = [
    Case {
        name: "thin-kernels",
        trouble: "Gaussians long in one direction and thin in two: the determinant depends only on the low-pass filter",
        parameter: "aspect",
        unit: "",
        values: &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, 1e6],
        log: true,
        telling: (30.0, "coarse"),
        scene: thin_gaussians,
        variant: Some(CaseVariant {
            name: "coarse",
            settings: |_| set(&["ellipse.variance=U5F10", "ellipse.variance_cross=I6F10"]),
        }),
    },
    Case {
        name: "beside",
        trouble: "wide Gaussians outside the picture: the affine approximation is invalid there, and the Jacobian is clamped",
        parameter: "centre",
        unit: "half pictures",
        values: &[0.5, 1.0, 1.3, 2.0, 4.0, 8.0, 16.0, 50.0, 99.0],
        log: true,
        telling: (2.0, "gaussian"),
        scene: beside,
        variant: None,
    },
    Case {
        name: "one-depth",
        trouble: "Gaussians closer in depth than the LSB of the sort key: they stay in input order",
        parameter: "depth step",
        unit: "radii",
        values: &[1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0],
        log: true,
        telling: (1e-4, "12-bit key"),
        scene: one_depth,
        variant: Some(CaseVariant {
            name: "12-bit key",
            settings: |_| set(&["sort.key=U1F11"]),
        }),
    },
    Case {
        name: "faint-crowd",
        trouble: "more and more, fainter Gaussians on one pixel: the transmittance of each is rounded, finally to nothing",
        parameter: "Gaussians",
        unit: "",
        values: &[3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4],
        log: true,
        telling: (300.0, "12-bit sums"),
        scene: faint_gaussians,
        variant: Some(CaseVariant {
            name: "12-bit sums",
            settings: |_| narrow_sums(),
        }),
    },
    Case {
        name: "extinction",
        trouble: "voxels denser and denser: the optical depth leaves its word and the table of α/x",
        parameter: "optical depth of a voxel",
        unit: "",
        values: &[0.01, 0.1, 0.3, 1.0, 2.0, 4.0, 7.0, 10.0, 30.0],
        log: true,
        telling: (1.0, "8-step table"),
        scene: |depth| slab(8, depth),
        variant: Some(CaseVariant {
            name: "8-step table",
            settings: |_| {
                set(&[
                    "fragment.sheets.table.index_bits=3",
                    "fragment.sheets.table.interpolation=nearest",
                ])
            },
        }),
    },
    Case {
        name: "slices",
        trouble: "the same fog in more and more slices: a rounding at each, and slices below one LSB",
        parameter: "slices",
        unit: "",
        values: &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3],
        log: true,
        telling: (300.0, "12-bit sums"),
        scene: |slices| slab(slices as usize, 2.0 / slices),
        variant: Some(CaseVariant {
            name: "12-bit sums",
            settings: |_| narrow_sums(),
        }),
    },
    Case {
        name: "flattened",
        trouble: "kernels of a surface flattened until they are discs: one scale of three runs out of bits",
        parameter: "flattened by",
        unit: "",
        values: &[1.0, 3.0, 10.0, 100.0, 1e3, 1e4, 1e6, 1e9],
        log: true,
        telling: (3.0, "volume"),
        scene: flattened,
        variant: None,
    },
];

fn set(settings: &[&str]) -> Vec<String> {
    settings.iter().map(|&setting| setting.to_owned()).collect()
}

/// Settings for twelve fraction bits in colour and opacity.
fn narrow_sums() -> Vec<String> {
    set(&["fragment.colour_sum=U5F12", "fragment.opacity_sum=U5F12"])
}

/// Discs as Gaussians with their own axes, by the conventions of training programs.
fn gaussians(all: Vec<(Splat, Orientation)>) -> Scene {
    let (splats, orientations) = all.into_iter().unzip();
    Scene {
        kernel: Kernel {
            cutoff: 9.0,
            low_pass: 0.3,
            guard: 100.0,
            jacobian: 1.3,
            filter: Filter::Ewa,
            compensate_opacity: false,
        },
        ellipsoids: Some(Ellipsoids {
            orientations,
            amplitude: Amplitude::Peak,
            preshaded: false,
            sorted: true,
            harmonics: None,
        }),
        sheets: Some(Sheets {
            of: Sheet::Splat,
            back_to_front: false,
            opacity: Opacity::Linear,
            stop: 1e-4,
            keeps_last: false,
            least_weight: 1.0 / 255.0,
            most_weight: 0.99,
            weight_distance: None,
        }),
        ..picture(SIDE, SIDE, splats)
    }
}

/// A pseudo-random rotation.
fn turned(nth: usize) -> DQuat {
    let nth = nth as f64;
    DQuat::from_euler(glam::EulerRot::XYZ, 0.7 * nth, 1.9 * nth, 2.3 * nth)
}

fn gaussian(
    position: DVec3,
    radius: f64,
    rgb: [f64; 3],
    opacity: f64,
    orientation: Orientation,
) -> (Splat, Orientation) {
    (
        Splat {
            opacity,
            ..disc(position, radius, rgb)
        },
        orientation,
    )
}

const ROUND: Orientation = Orientation {
    rotation: DQuat::IDENTITY,
    scales: DVec3::ONE,
};

fn thin_gaussians(aspect: f64) -> Scene {
    let all = (0..40).map(|nth| {
        let place = at(
            (nth % 8) as f64 * 6.1 - 21.3,
            (nth / 8) as f64 * 9.3 - 18.7,
            DEPTH + 0.01 * nth as f64,
        );
        let orientation = Orientation {
            rotation: turned(nth),
            scales: DVec3::new(1.0, 1.0 / aspect, 1.0 / aspect),
        };
        gaussian(place, 4.0 * PX, COLOURS[nth % 4], 0.9, orientation)
    });
    gaussians(all.collect())
}

fn beside(half_pictures: f64) -> Scene {
    let reach = half_pictures * SIDE as f64 / 2.0;
    let all = [(reach, 1.7), (-reach, -5.3)]
        .into_iter()
        .zip([RED, GREEN])
        .enumerate()
        .map(|(nth, ((x, y), rgb))| {
            let scales = DVec3::new(1.0, 0.3, 0.5);
            gaussian(
                at(x, y, DEPTH + 0.3 * nth as f64),
                0.5 * reach * PX,
                rgb,
                0.8,
                Orientation {
                    rotation: DQuat::IDENTITY,
                    scales,
                },
            )
        });
    let behind = gaussian(at(0.3, 0.2, 3.0), 12.0 * PX, PALE, 0.7, ROUND);
    gaussians(all.chain([behind]).collect())
}

fn one_depth(step: f64) -> Scene {
    let radius = 3.0 * PX;
    let splat = |nth: usize| {
        let place = at(
            (nth % 12) as f64 * 3.7 - 20.1,
            (nth / 12) as f64 * 3.7 - 20.3,
            DEPTH + step * radius * nth as f64,
        );
        Splat {
            opacity: 0.7,
            ..disc(place, radius, COLOURS[(nth + nth / 12) % 4])
        }
    };
    gaussians(
        shuffled((0..144).map(splat).collect())
            .into_iter()
            .map(|splat| (splat, ROUND))
            .collect(),
    )
}

fn faint_gaussians(count: f64) -> Scene {
    let opacity = 3.0 / (count + 3.0);
    let all = (0..count as usize).map(|nth| {
        let position = DVec3::new(0.1 * PX, -0.2 * PX, DEPTH + nth as f64 / count);
        gaussian(position, 2.5 * PX, COLOURS[nth % 4], opacity, ROUND)
    });
    let mut scene = gaussians(all.collect());
    (scene.image.width, scene.image.height) = (12, 12);
    scene.camera.fov_y_degrees = 2.0 * libm::atan(6.0 / FOCAL_PX).to_degrees();
    scene
        .sheets
        .iter_mut()
        .for_each(|sheets| sheets.least_weight = 0.0);
    scene
}

/// A block of voxels of this optical depth each, with N slices, the nearest first.
fn slab(slices: usize, optical_depth: f64) -> Scene {
    let (across, spacing) = (9, 3.0 * PX);
    let (mut splats, mut numbers) = (Vec::new(), Vec::new());
    for slice in 0..slices {
        let depth = DEPTH + slice as f64 / slices as f64;
        for cell in 0..across * across {
            let [x, y] = [cell % across, cell / across].map(|i| (i as f64 - 3.9) * spacing);
            let rgb = if (cell / 3 + cell / 27) % 2 == 0 {
                BLUE
            } else {
                PALE
            };
            let rgb = if slice % 2 == 0 { rgb } else { RED };
            splats.push(Splat {
                opacity: optical_depth,
                ..disc(DVec3::new(x, y, depth), 0.7 * spacing, rgb)
            });
            numbers.push(slice as u32);
        }
    }
    Scene {
        kernel: Kernel {
            cutoff: 4.0,
            low_pass: 1.0,
            guard: 1.5,
            jacobian: 1.3,
            filter: Filter::Ewa,
            compensate_opacity: false,
        },
        ellipsoids: Some(Ellipsoids {
            orientations: vec![Orientation {
                rotation: DQuat::IDENTITY,
                scales: DVec3::new(1.0, 1.0, 0.5),
            }],
            amplitude: Amplitude::LineIntegral,
            preshaded: true,
            sorted: false,
            harmonics: None,
        }),
        sheets: Some(Sheets {
            of: Sheet::Slice(numbers),
            back_to_front: false,
            opacity: Opacity::Exponential,
            stop: 1.0 / 1024.0,
            keeps_last: true,
            least_weight: 0.0,
            most_weight: 1.0,
            weight_distance: None,
        }),
        ..picture(32, 32, splats)
    }
}

fn flattened(by: f64) -> Scene {
    let splats = [
        (DEPTH, FLAT, [GREEN, PALE]),
        (DEPTH + 0.7, leaning(70.0), [RED, BLUE]),
    ]
    .into_iter()
    .flat_map(|(depth, axes, colours)| {
        plane(
            DVec3::new(0.1, 0.0, depth),
            axes,
            if depth > DEPTH { 30 } else { 9 },
            2.0 * PX,
            colours,
        )
    });
    let splats: Vec<Splat> = splats.collect();
    let flat = |splat: &Splat| Orientation {
        rotation: DQuat::from_rotation_arc(DVec3::Z, splat.normal),
        scales: DVec3::new(1.0, 1.0, 1.0 / by),
    };
    let orientations = splats.iter().map(flat).collect();
    let scene = picture(SIDE, SIDE, splats);
    Scene {
        // Neighbours in the tilted plane are two pixels apart in the picture and six in depth.
        surface: Surface {
            z_threshold: 12.0 * PX,
            ..scene.surface
        },
        kernel: Kernel {
            cutoff: 4.0,
            low_pass: 1.0,
            guard: 1.5,
            jacobian: 1.3,
            filter: Filter::Ewa,
            compensate_opacity: false,
        },
        ellipsoids: Some(Ellipsoids {
            orientations,
            amplitude: Amplitude::Disc,
            preshaded: false,
            sorted: false,
            harmonics: None,
        }),
        ..scene
    }
}
