//! Cases: the table of the catalogue. Each row drives one parameter of a small scene to its limit.
//!
//! Scenes look along +z from the origin, x to the right and y down, with [`FOCAL_PX`] pixels per
//! unit at depth 1. Values run from harmless to bad, so the first one that fails is the limit.

mod ellipsoids;

use crate::scene::{
    Builtin, Camera, Filter, Image, Kernel, Light, Material, Scene, Splat, Surface,
};
use glam::DVec3;
use libm::{atan, cos, sin, sqrt};
use std::f64::consts::SQRT_2;

/// One row of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Name.
    pub name: &'static str,
    /// Difficulty of the case, one line.
    pub trouble: &'static str,
    /// Parameter that is driven.
    pub parameter: &'static str,
    /// Its unit; empty for a number.
    pub unit: &'static str,
    /// Its values.
    pub values: &'static [f64],
    /// Whether the chart has a logarithmic axis.
    pub log: bool,
    /// The value and the machine that the gallery shows.
    pub telling: (f64, &'static str),
    /// The scene at a value.
    pub scene: fn(f64) -> Scene,
    /// A machine of this case, in addition to the named ones.
    pub variant: Option<CaseVariant>,
}

/// `reference`, or the machine for the scene's ellipsoids, with changes.
#[derive(Clone, Copy, Debug)]
pub struct CaseVariant {
    /// Name.
    pub name: &'static str,
    /// The changes at a value, as `--set` takes them.
    pub settings: fn(f64) -> Vec<String>,
}

/// Focal length: pixels per unit at depth 1.
pub const FOCAL_PX: f64 = 48.0;
/// Depth of most surfaces.
const DEPTH: f64 = 2.0;
/// One pixel at that depth, world units.
const PX: f64 = DEPTH / FOCAL_PX;
/// Side of most pictures, pixels.
const SIDE: usize = 48;

/// The case that is a sequence: each value is compared with the one before.
const SLOW_PAN: &str = "slow-pan";
/// Pixels per frame.
const PAN_STEP_PX: f64 = 1.0 / 16.0;
/// Splats of the check scene in that case.
const PAN_SPLATS: usize = 6000;
/// ε in that case: the check scene's, scaled with the splats.
const PAN_Z_THRESHOLD: f64 = 0.2;

const RED: [f64; 3] = [0.9, 0.15, 0.1];
const GREEN: [f64; 3] = [0.1, 0.7, 0.2];
const BLUE: [f64; 3] = [0.1, 0.25, 0.9];
const PALE: [f64; 3] = [0.9, 0.85, 0.7];
const COLOURS: [[f64; 3]; 4] = [RED, GREEN, BLUE, PALE];
const UNLIT: u32 = 0;
const LIT: u32 = 1;

/// The catalogue: surfaces, then volumes and Gaussians.
pub const CASES: [Case; 39] = {
    let mut all = [SURFACES[0]; 39];
    let mut nth = 0;
    while nth < all.len() {
        all[nth] = if nth < SURFACES.len() {
            SURFACES[nth]
        } else {
            ellipsoids::CASES[nth - SURFACES.len()]
        };
        nth += 1;
    }
    all
};

/// The cases of surfaces.
const SURFACES: [Case; 32] = [
    Case {
        name: "grazing",
        trouble: "discs turned until they are seen edge-on: amplitude to 0, depth slope without limit",
        parameter: "short of edge-on",
        unit: "degrees",
        values: &[90.0, 60.0, 30.0, 10.0, 5.0, 2.0, 1.0, 0.3, 0.1, 0.01, 0.0],
        log: true,
        telling: (5.0, "lean"),
        scene: grazing,
        variant: None,
    },
    Case {
        name: "needles",
        trouble: "thin ellipses: the determinant is the difference of two large products",
        parameter: "aspect",
        unit: "",
        values: &[1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4],
        log: true,
        telling: (30.0, "lean"),
        scene: needles,
        variant: None,
    },
    Case {
        name: "turned",
        trouble: "the same ellipse turned in the picture: errors hidden along an axis show along a diagonal",
        parameter: "turned by",
        unit: "degrees",
        values: &[0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 120.0, 135.0, 150.0],
        log: false,
        telling: (30.0, "tiny"),
        scene: turned,
        variant: None,
    },
    Case {
        name: "low-pass-off",
        trouble: "no low-pass filter: nothing keeps the conic below 1, and small splats fall between pixels",
        parameter: "low-pass variance",
        unit: "px²",
        values: &[1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 0.0],
        log: true,
        telling: (0.0, "lean"),
        scene: low_pass_off,
        variant: None,
    },
    Case {
        name: "sub-pixel",
        trouble: "splats far smaller than a pixel: the amplitude runs out of bits",
        parameter: "radius",
        unit: "px",
        values: &[1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001],
        log: true,
        telling: (0.05, "lean"),
        scene: sub_pixel,
        variant: None,
    },
    Case {
        name: "huge",
        trouble: "splats wider than the frame: forward differences drift, more where they have too few guard bits",
        parameter: "footprint",
        unit: "frames wide",
        values: &[0.25, 0.5, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0],
        log: true,
        telling: (1.0, "12-bit"),
        scene: huge,
        variant: Some(CaseVariant {
            name: "12-bit",
            settings: |_| differences(12),
        }),
    },
    Case {
        name: "guard-bits",
        trouble: "the same splat, one frame wide, with fewer and fewer bits in its differences",
        parameter: "fraction bits of first and second difference",
        unit: "",
        values: &[24.0, 22.0, 20.0, 18.0, 16.0, 14.0, 12.0, 10.0, 8.0],
        log: false,
        telling: (14.0, "fewer bits"),
        scene: |_| huge(1.0),
        variant: Some(CaseVariant {
            name: "fewer bits",
            settings: |bits| differences(bits as i32),
        }),
    },
    Case {
        name: "wrap",
        trouble: "slanted ellipses in wide boxes: the radial index outruns its register and comes back inside the footprint",
        parameter: "aspect",
        unit: "",
        values: &[1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0],
        log: true,
        telling: (12.0, "6-bit r"),
        scene: wrap,
        variant: Some(CaseVariant {
            name: "6-bit r",
            settings: |_| vec![r#"raster.radial={"format":"I6F27","overflow":"wrap"}"#.into()],
        }),
    },
    Case {
        name: "negative-r",
        trouble: "long needles through pixel centres: r is almost 0 for a whole row and drifts below it",
        parameter: "length",
        unit: "frames",
        values: &[0.25, 0.5, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0],
        log: true,
        telling: (1.0, "12-bit"),
        scene: negative_r,
        variant: Some(CaseVariant {
            name: "12-bit",
            settings: |_| differences(12),
        }),
    },
    Case {
        name: "table-end",
        trouble: "pixels whose radial index lies just below the cutoff, which is where the table ends",
        parameter: "cutoff less r",
        unit: "",
        values: &[1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8],
        log: true,
        telling: (1e-4, "lean"),
        scene: table_end,
        variant: None,
    },
    Case {
        name: "rim",
        trouble: "rims where the accumulated weight goes to 0 and is divided by",
        parameter: "cutoff",
        unit: "",
        values: &[2.0, 4.0, 6.0, 9.0, 12.0, 16.0, 20.0, 24.0, 28.0],
        log: false,
        telling: (20.0, "wide table"),
        scene: rim,
        variant: Some(CaseVariant {
            name: "wide table",
            settings: |_| vec!["gauss.radial_index=U5F13".into()],
        }),
    },
    Case {
        name: "8-bit-offset",
        trouble: "pixel minus centre in a few bits: the blocky picture of low-precision accelerators",
        parameter: "bits of the offset",
        unit: "",
        values: &[16.0, 14.0, 12.0, 11.0, 10.0, 9.0, 8.0, 7.0],
        log: false,
        telling: (7.0, "fewer bits"),
        scene: |_| overlapping_discs(),
        variant: Some(CaseVariant {
            name: "fewer bits",
            settings: |bits| vec![format!("raster.offset=I7F{}", bits - 7.0)],
        }),
    },
    Case {
        name: "crowd",
        trouble: "more and more contributions on the same pixels: the sums saturate",
        parameter: "contributions on a pixel",
        unit: "",
        values: &[1.0, 10.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5],
        log: true,
        telling: (3e3, "lean"),
        scene: crowd,
        variant: None,
    },
    Case {
        name: "near-plane",
        trouble: "splats on both sides of the near plane, closer and closer to it",
        parameter: "distance to the near plane",
        unit: "of its depth",
        values: &[0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8],
        log: true,
        telling: (1e-5, "tiny"),
        scene: near_plane,
        variant: None,
    },
    Case {
        name: "depth-range",
        trouble: "a wall far behind two close surfaces: one depth format for all",
        parameter: "farthest depth",
        unit: "× the nearest",
        values: &[10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
        log: true,
        telling: (1e4, "lean"),
        scene: depth_range,
        variant: None,
    },
    Case {
        name: "far-origin",
        trouble: "the whole scene, eye included, far from the world's origin",
        parameter: "distance of the origin",
        unit: "units",
        values: &[1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12],
        log: true,
        telling: (1e6, "lean"),
        scene: far_origin,
        variant: None,
    },
    Case {
        name: "stray-point",
        trouble: "one stray point far behind the eye: the position format must reach it",
        parameter: "distance of the stray point",
        unit: "units",
        values: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
        log: true,
        telling: (1e3, "lean"),
        scene: stray_point,
        variant: None,
    },
    Case {
        name: "off-screen",
        trouble: "centres outside of the picture with footprints inside, out to the guard band at 0.5",
        parameter: "centre beyond the edge",
        unit: "half-widths",
        values: &[0.0, 0.1, 0.2, 0.3, 0.4, 0.49, 0.499, 0.4999, 0.5001, 0.6],
        log: false,
        telling: (0.4, "tiny"),
        scene: off_screen,
        variant: None,
    },
    Case {
        name: "coincident",
        trouble: "two parallel surfaces about ε apart: one fragment or two?",
        parameter: "gap",
        unit: "ε",
        values: &[
            0.1, 0.5, 0.9, 0.99, 0.9999, 1.0, 1.0001, 1.01, 1.1, 2.0, 10.0,
        ],
        log: true,
        telling: (1.0, "lean"),
        scene: coincident,
        variant: None,
    },
    Case {
        name: "small-epsilon",
        trouble: "two sloped surfaces and a small ε: each of them falls apart into fragments",
        parameter: "ε",
        unit: "radii",
        values: &[3.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.03, 0.01],
        log: true,
        telling: (0.5, "lean"),
        scene: epsilon,
        variant: None,
    },
    Case {
        name: "large-epsilon",
        trouble: "two sloped surfaces six radii apart and a large ε: they become one",
        parameter: "ε",
        unit: "radii",
        values: &[3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 12.0, 16.0],
        log: true,
        telling: (7.0, "lean"),
        scene: epsilon,
        variant: None,
    },
    Case {
        name: "intersecting",
        trouble: "two surfaces that cross: near the line they are one",
        parameter: "angle between them",
        unit: "degrees",
        values: &[90.0, 60.0, 30.0, 10.0, 5.0, 2.0, 1.0, 0.3, 0.1],
        log: true,
        telling: (30.0, "lean"),
        scene: intersecting,
        variant: None,
    },
    Case {
        name: "layers",
        trouble: "more surfaces than a pixel has slots",
        parameter: "surfaces",
        unit: "",
        values: &[1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0, 32.0, 64.0],
        log: true,
        telling: (8.0, "lean"),
        scene: layers,
        variant: None,
    },
    Case {
        name: "parallel",
        trouble: "discs that face the screen exactly: a depth slope of 0",
        parameter: "tilt",
        unit: "degrees",
        values: &[10.0, 1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 0.0],
        log: true,
        telling: (0.0, "tiny"),
        scene: parallel,
        variant: None,
    },
    Case {
        name: "opacity",
        trouble: "opacities at 1, at 0 and below one step of their format",
        parameter: "opacity",
        unit: "",
        values: &[
            1.0, 0.9999, 0.999, 0.99, 0.9, 0.5, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 0.0,
        ],
        log: true,
        telling: (0.999, "lean"),
        scene: opacity,
        variant: None,
    },
    Case {
        name: "cancel",
        trouble: "pairs of normals that cancel where setup does not turn them: the direction of almost nothing",
        parameter: "short of opposite",
        unit: "degrees",
        values: &[90.0, 30.0, 10.0, 3.0, 1.0, 0.1, 0.01, 1e-3, 0.0],
        log: true,
        telling: (0.1, "not turned"),
        scene: cancel,
        variant: Some(CaseVariant {
            name: "not turned",
            settings: |_| vec!["fragment.turn_normals=false".into()],
        }),
    },
    Case {
        name: "faint-merge",
        trouble: "many layers of almost nothing: the words of a merged slot are in fixed point",
        parameter: "opacity",
        unit: "",
        values: &[0.5, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4],
        log: true,
        telling: (0.03, "tiny"),
        scene: faint_merge,
        variant: None,
    },
    Case {
        name: "nested-shells",
        trouble: "translucent spheres around each other in random order, each with gaps: a closed slot is never complete",
        parameter: "spheres",
        unit: "",
        values: &[1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0],
        log: true,
        telling: (6.0, "window"),
        scene: nested_shells,
        variant: None,
    },
    Case {
        name: "noisy-scan",
        trouble: "a translucent scan whose depths scatter: the number of windows of ε in a surface determines its opacity",
        parameter: "scatter",
        unit: "ε",
        values: &[0.01, 0.1, 0.3, 0.5, 1.0, 2.0, 4.0, 8.0],
        log: true,
        telling: (1.0, "window"),
        scene: noisy_scan,
        variant: None,
    },
    Case {
        name: "lone-splats",
        trouble: "translucent discs of which each is a surface: nothing to gather, and late ones belong to no cluster",
        parameter: "discs on a pixel",
        unit: "",
        values: &[1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0, 32.0],
        log: true,
        telling: (8.0, "window"),
        scene: lone_splats,
        variant: None,
    },
    Case {
        name: "highlight",
        trouble: "a highlight ever sharper than its table: x to the power of s between two entries",
        parameter: "shininess",
        unit: "",
        values: &[1.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, 1e5],
        log: true,
        telling: (300.0, "lean"),
        scene: highlight,
        variant: None,
    },
    Case {
        name: SLOW_PAN,
        trouble: "the check scene, a sixteenth of a pixel farther in each frame: still objects flicker",
        parameter: "turned to the right by",
        unit: "px",
        values: &[0.0, 0.0625, 0.125, 0.1875, 0.25, 0.3125],
        log: false,
        telling: (0.0625, "tiny"),
        scene: slow_pan,
        variant: None,
    },
];

/// First and second differences with this number of fraction bits.
fn differences(bits: i32) -> Vec<String> {
    vec![
        format!("raster.first=I16F{bits}"),
        format!("raster.second=I4F{bits}"),
    ]
}

// ---- What scenes are made of ----

fn picture(width: usize, height: usize, splats: Vec<Splat>) -> Scene {
    Scene {
        name: "stress".into(),
        splats,
        camera: Camera {
            eye: DVec3::ZERO,
            target: DVec3::Z,
            up: DVec3::NEG_Y,
            fov_y_degrees: 2.0 * atan(height as f64 / 2.0 / FOCAL_PX).to_degrees(),
            near: 0.01,
            focal_px: None,
            centre_px: None,
            picture_px: None,
        },
        image: Image {
            width,
            height,
            background: [0.25, 0.25, 0.25, 1.0],
            encoded: false,
        },
        kernel: Kernel {
            cutoff: 2.0,
            low_pass: 1.0,
            guard: 1.5,
            jacobian: 1.3,
            filter: Filter::Ewa,
            compensate_opacity: false,
        },
        ellipsoids: None,
        sheets: None,
        surface: Surface {
            z_threshold: 0.05,
            coverage_threshold: 0.4,
            cull_backfaces: false,
        },
        lights: vec![Light {
            direction: DVec3::new(0.4, -0.6, -0.7).normalize(),
            rgb: [1.0; 3],
        }],
        materials: vec![
            Material::Unlit,
            Material::BlinnPhong {
                ambient: 0.15,
                diffuse: 0.8,
                specular: 0.3,
                shininess: 32.0,
            },
        ],
        environment: None,
        detail: None,
        path: None,
        notes: Vec::new(),
    }
}

fn square(splats: Vec<Splat>) -> Scene {
    picture(SIDE, SIDE, splats)
}

/// The point at a depth on the ray through pixel position (x, y), relative to the picture's centre.
fn at(x: f64, y: f64, depth: f64) -> DVec3 {
    DVec3::new(x * depth / FOCAL_PX, y * depth / FOCAL_PX, depth)
}

/// An opaque, unlit disc that faces the screen.
fn disc(position: DVec3, radius: f64, rgb: [f64; 3]) -> Splat {
    Splat {
        position,
        normal: DVec3::NEG_Z,
        radius,
        rgb,
        opacity: 1.0,
        material: UNLIT,
    }
}

/// A disc in the middle of the view whose footprint is an ellipse of this aspect, its short axis √2
/// pixels long and turned by `degrees` from the x axis. With `v = 1` and `k·c_n = 1` the variances
/// along the axes are `k² + 1` and 2.
fn needle([x, y]: [f64; 2], aspect: f64, degrees: f64, rgb: [f64; 3]) -> Splat {
    let k = sqrt(2.0 * aspect * aspect - 1.0);
    let (facing, turn) = (1.0 / k, degrees.to_radians());
    let lean = sqrt((1.0 - facing * facing).max(0.0));
    let ray = DVec3::new(x / FOCAL_PX, y / FOCAL_PX, 1.0).normalize();
    let across = DVec3::new(cos(turn), sin(turn), 0.0)
        .reject_from_normalized(ray)
        .normalize();
    Splat {
        normal: (lean * across - facing * ray).normalize(),
        ..disc(at(x, y, DEPTH), k * PX, rgb)
    }
}

/// A plane of `count` × `count` discs around a point, with the spacing as radius, coloured in
/// squares of four.
fn plane(
    centre: DVec3,
    [right, down]: [DVec3; 2],
    count: usize,
    spacing: f64,
    colours: [[f64; 3]; 2],
) -> Vec<Splat> {
    let normal = right.cross(down).normalize();
    let normal = if normal.z > 0.0 { -normal } else { normal };
    // Slightly off centre: in a symmetric grid many pixels would be exactly at the cutoff.
    let place = |i: usize| (i as f64 - (count as f64 - 1.0) / 2.0 + 0.043) * spacing;
    let cell = |i: usize| {
        let (column, row) = (i % count, i / count);
        let position = centre + place(column) * right + place(row) * down;
        Splat {
            normal,
            ..disc(position, spacing, colours[(column / 4 + row / 4) % 2])
        }
    };
    (0..count * count).map(cell).collect()
}

/// Axes of a plane tilted by this many degrees, its lower edge away from the eye.
fn leaning(degrees: f64) -> [DVec3; 2] {
    let lean = degrees.to_radians();
    [DVec3::X, DVec3::new(0.0, cos(lean), sin(lean))]
}

const FLAT: [DVec3; 2] = [DVec3::X, DVec3::Y];

fn with_opacity(mut splats: Vec<Splat>, opacity: f64) -> Vec<Splat> {
    splats.iter_mut().for_each(|splat| splat.opacity = opacity);
    splats
}

/// The same splats in a fixed random order (Fisher and Yates, with a linear congruential
/// generator).
fn shuffled(mut splats: Vec<Splat>) -> Vec<Splat> {
    let mut state = 1_u64;
    for last in (1..splats.len()).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        splats.swap(
            last,
            ((u128::from(state) * (last as u128 + 1)) >> 64) as usize,
        );
    }
    splats
}

/// Radius of a footprint of this width, pixels.
fn radius_of_width(width_px: f64) -> f64 {
    width_px / (2.0 * SQRT_2)
}

// ---- The scenes ----

/// Six by six discs, each turned away from its own ray about another axis.
fn grazing(short_of_edge_on: f64) -> Scene {
    let turn = (90.0 - short_of_edge_on).to_radians();
    let cell = |i: usize| {
        let place = |i: usize| (i as f64 - 2.5) * 8.0 + 0.3;
        let position = at(place(i % 6), place(i / 6), DEPTH);
        let (ray, azimuth) = (position.normalize(), 0.55 * i as f64);
        let across = DVec3::new(cos(azimuth), sin(azimuth), 0.0)
            .reject_from_normalized(ray)
            .normalize();
        // Exactly edge-on: f64's cosine of 90° is not 0.
        let facing = if short_of_edge_on == 0.0 {
            0.0
        } else {
            cos(turn)
        };
        Splat {
            normal: (sin(turn) * across - facing * ray).normalize(),
            ..disc(position, 3.0 * PX, COLOURS[i % 4])
        }
    };
    let mut scene = square((0..36).map(cell).collect());
    scene.surface.coverage_threshold = 0.1;
    scene
}

fn needles(aspect: f64) -> Scene {
    let fan = [(20.0, RED), (80.0, GREEN), (140.0, BLUE)];
    let splats: Vec<Splat> = fan
        .into_iter()
        .map(|(degrees, rgb)| needle([0.3, -0.4], aspect, degrees, rgb))
        .collect();
    let reach = splats[0].radius * SQRT_2;
    let mut scene = square(splats);
    // One surface at any radius: the case tests footprints.
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (DEPTH + 2.0 * reach, 0.1);
    scene
}

fn turned(degrees: f64) -> Scene {
    let places = [[-12.2, -12.4], [11.7, -11.9], [-11.6, 12.3], [12.4, 12.1]];
    let splats = places
        .into_iter()
        .zip(COLOURS)
        .map(|(place, rgb)| needle(place, 8.0, degrees, rgb));
    let mut scene = square(splats.collect());
    scene.surface.coverage_threshold = 0.1;
    scene
}

fn low_pass_off(low_pass: f64) -> Scene {
    let mut splats = plane(
        DVec3::new(0.0, 0.0, DEPTH),
        leaning(50.0),
        44,
        1.1 * PX,
        [RED, PALE],
    );
    splats.iter_mut().for_each(|splat| splat.radius = 0.5 * PX);
    let mut scene = square(splats);
    (scene.kernel.low_pass, scene.surface.z_threshold) = (low_pass, 0.15);
    scene
}

/// Constant density with smaller and smaller splats. The coverage threshold is scaled too, so that
/// the picture stays the same in exact arithmetic.
fn sub_pixel(radius_px: f64) -> Scene {
    let mut splats = plane(
        DVec3::new(0.0, 0.0, DEPTH),
        FLAT,
        60,
        0.71 * PX,
        [GREEN, PALE],
    );
    splats
        .iter_mut()
        .for_each(|splat| splat.radius = radius_px * PX);
    let mut scene = square(splats);
    scene.surface.coverage_threshold = 0.4 * radius_px * radius_px / (1.0 + radius_px * radius_px);
    scene
}

/// Size of the wide pictures, pixels.
const WIDE: usize = 72;
const HIGH: usize = 36;

fn huge(frames: f64) -> Scene {
    let radius = radius_of_width(frames * WIDE as f64) * PX;
    let place = |x: f64, y: f64, rgb| disc(at(x, y, DEPTH), radius, rgb);
    let mut scene = picture(
        WIDE,
        HIGH,
        vec![
            place(-38.3, 3.2, RED),
            place(-4.6, -2.7, GREEN),
            place(33.4, 0.6, BLUE),
        ],
    );
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (1.0, 0.1);
    scene
}

fn wrap(aspect: f64) -> Scene {
    let mut scene = square(vec![needle([0.2, -0.3], aspect, 45.0, PALE)]);
    scene.surface.coverage_threshold = 0.05;
    scene
}

/// Two horizontal needles, each through the centres of a row of pixels.
fn negative_r(frames: f64) -> Scene {
    let aspect = radius_of_width(frames * WIDE as f64) / SQRT_2;
    let splats = vec![
        needle([0.5, -7.5], aspect, 90.0, RED),
        needle([-11.5, 8.5], aspect, 90.0, BLUE),
    ];
    let reach = splats[0].radius * SQRT_2;
    let mut scene = picture(WIDE, HIGH, splats);
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (DEPTH + 2.0 * reach, 0.2);
    scene
}

/// Discs on pixel centres, with a size at which the fourth pixel to each side has `r = 4 − short`.
fn table_end(short: f64) -> Scene {
    let variance = 16.0 / (4.0 - short);
    let place = |i: usize| (i as f64 - 2.0) * 9.0 + 0.5;
    let cell = |i: usize| {
        disc(
            at(place(i % 5), place(i / 5), DEPTH),
            sqrt(variance - 1.0) * PX,
            COLOURS[i % 4],
        )
    };
    let mut scene = square((0..25).map(cell).collect());
    (scene.kernel.cutoff, scene.surface.coverage_threshold) = (4.0, 0.02);
    scene
}

/// Three discs whose colours are distinguished only by their weights; the coverage threshold is
/// almost 0.
fn rim(cutoff: f64) -> Scene {
    let place = |x: f64, y: f64, rgb| disc(at(x, y, DEPTH), 2.5 * PX, rgb);
    let mut scene = square(vec![
        place(-6.3, -4.2, RED),
        place(6.6, -3.7, GREEN),
        place(0.4, 6.2, BLUE),
    ]);
    (scene.kernel.cutoff, scene.surface.coverage_threshold) = (cutoff, 1e-6);
    scene
}

fn overlapping_discs() -> Scene {
    let mut splats = plane(
        DVec3::new(0.01, -0.007, DEPTH),
        FLAT,
        7,
        6.3 * PX,
        [RED, PALE],
    );
    splats
        .iter_mut()
        .enumerate()
        .for_each(|(i, splat)| splat.rgb = COLOURS[(i * 7 / 3) % 4]);
    square(splats)
}

fn crowd(count: f64) -> Scene {
    let splats = (0..count as usize).map(|i| disc(at(0.1, -0.2, DEPTH), 0.3 * PX, COLOURS[i % 3]));
    let mut scene = picture(12, 12, splats.collect());
    scene.surface.coverage_threshold = 0.01;
    scene
}

/// Two rows of discs: green ones beyond the near plane, red ones in front of it, and a wall behind.
fn near_plane(distance: f64) -> Scene {
    let near = 1.0;
    let mut splats = plane(
        DVec3::new(0.0, 0.0, 4.0),
        FLAT,
        14,
        4.0 * 4.0 / FOCAL_PX,
        [BLUE, PALE],
    );
    for column in 0..5 {
        let x = (column as f64 - 2.0) * 9.0 + 0.3;
        let radius = 3.0 * near / FOCAL_PX;
        splats.push(disc(at(x, -8.4, near * (1.0 + distance)), radius, GREEN));
        splats.push(disc(at(x, 8.2, near * (1.0 - distance)), radius, RED));
    }
    let mut scene = square(splats);
    (scene.camera.near, scene.surface.coverage_threshold) = (near, 0.1);
    scene
}

/// Two half-transparent surfaces at depth 1, two thresholds apart, and a wall at depth `farthest`.
fn depth_range(farthest: f64) -> Scene {
    let sheet = |depth: f64, pixels: f64, colours| {
        plane(
            DVec3::new(0.0, 0.0, depth),
            FLAT,
            12,
            pixels * depth / FOCAL_PX,
            colours,
        )
    };
    let mut splats = sheet(farthest, 4.0, [BLUE, PALE]);
    splats.extend(with_opacity(sheet(1.1, 3.0, [GREEN, PALE]), 0.5));
    splats.extend(with_opacity(sheet(1.0, 2.0, [RED, PALE]), 0.5));
    square(splats)
}

/// Two half-transparent surfaces, one of them tilted and lit.
fn two_sheets() -> Vec<Splat> {
    let mut splats = plane(
        DVec3::new(0.0, 0.1, DEPTH),
        leaning(35.0),
        20,
        2.0 * PX,
        [GREEN, PALE],
    );
    splats.iter_mut().for_each(|splat| splat.material = LIT);
    splats.extend(with_opacity(
        plane(
            DVec3::new(0.2, 0.0, 1.2),
            FLAT,
            12,
            2.0 * 1.2 / FOCAL_PX,
            [RED, BLUE],
        ),
        0.5,
    ));
    splats
}

fn far_origin(distance: f64) -> Scene {
    let mut scene = square(two_sheets());
    let shift = distance * DVec3::new(0.8, -0.48, 0.36);
    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.position += shift);
    scene.camera.eye += shift;
    scene.camera.target = scene.camera.eye + DVec3::Z;
    scene.surface.z_threshold = 0.15;
    scene
}

fn stray_point(distance: f64) -> Scene {
    let mut splats = two_sheets();
    splats.push(disc(DVec3::new(0.0, 0.0, -distance), 0.01, RED));
    let mut scene = square(splats);
    scene.surface.z_threshold = 0.15;
    scene
}

fn off_screen(beyond: f64) -> Scene {
    let middle = SIDE as f64 / 2.0 * (1.0 + beyond);
    let place = |x: f64, y: f64, rgb| disc(at(x, y, DEPTH), 13.0 * PX, rgb);
    let splats = vec![
        place(-middle, -3.3, RED),
        place(middle, 4.4, GREEN),
        place(1.2, -middle, BLUE),
        place(-2.1, middle, PALE),
    ];
    let mut scene = square(splats);
    scene.surface.coverage_threshold = 0.1;
    scene
}

fn coincident(gap: f64) -> Scene {
    let z_threshold = 0.05;
    let sheet =
        |depth: f64, colours| plane(DVec3::new(0.0, 0.0, depth), FLAT, 26, 2.3 * PX, colours);
    let mut splats = sheet(DEPTH + gap * z_threshold, [BLUE, PALE]);
    splats.extend(with_opacity(sheet(DEPTH, [RED, GREEN]), 0.6));
    let mut scene = square(shuffled(splats));
    scene.surface.z_threshold = z_threshold;
    scene
}

fn epsilon(radii: f64) -> Scene {
    let spacing = 2.0 * PX;
    let sheet = |depth: f64, colours| {
        plane(
            DVec3::new(0.0, 0.5, depth),
            leaning(45.0),
            40,
            spacing,
            colours,
        )
    };
    let mut splats = sheet(DEPTH + 6.0 * spacing, [BLUE, PALE]);
    splats.extend(with_opacity(sheet(DEPTH, [RED, GREEN]), 0.6));
    let mut scene = square(shuffled(splats));
    scene.surface.z_threshold = radii * spacing;
    scene
}

fn intersecting(degrees: f64) -> Scene {
    let leaning = |degrees: f64| {
        let lean = degrees.to_radians();
        [DVec3::new(cos(lean), 0.0, sin(lean)), DVec3::Y]
    };
    let sheet = |degrees: f64, colours| {
        plane(
            DVec3::new(0.0, 0.0, DEPTH),
            leaning(degrees),
            32,
            2.0 * PX,
            colours,
        )
    };
    let mut splats = with_opacity(sheet(degrees / 2.0, [BLUE, PALE]), 0.7);
    splats.extend(with_opacity(sheet(-degrees / 2.0, [RED, GREEN]), 0.7));
    square(shuffled(splats))
}

/// Sheets of low opacity, one behind another, in random order.
fn stacked(sheets: usize, opacity: f64) -> Scene {
    let sheet = |i: usize| {
        let depth = DEPTH + 0.1 * i as f64;
        plane(
            DVec3::new(0.002 * i as f64, 0.0, depth),
            FLAT,
            9,
            3.0 * depth / FOCAL_PX,
            [COLOURS[i % 4], COLOURS[(i + 1) % 4]],
        )
    };
    picture(
        24,
        24,
        shuffled(with_opacity((0..sheets).flat_map(sheet).collect(), opacity)),
    )
}

fn layers(surfaces: f64) -> Scene {
    stacked(surfaces as usize, 0.35)
}

fn faint_merge(opacity: f64) -> Scene {
    stacked(16, opacity)
}

/// Half of each sphere faces away; a disc just reaches its neighbours.
fn nested_shells(spheres: f64) -> Scene {
    let golden_angle = std::f64::consts::PI * (1.0 + sqrt(5.0));
    let sphere = |i: usize| {
        let size = 0.8 * (1.0 - 0.07 * i as f64);
        let count = (3200.0 * size * size) as usize;
        let spacing = size * sqrt(4.0 * std::f64::consts::PI / count as f64);
        (0..count).map(move |point| {
            let (z, turn) = (
                1.0 - (2.0 * point as f64 + 1.0) / count as f64,
                golden_angle * point as f64,
            );
            let ring = sqrt(1.0 - z * z);
            let normal = DVec3::new(ring * cos(turn), ring * sin(turn), z);
            let place = DVec3::new(0.0, 0.0, DEPTH) + size * normal;
            Splat {
                normal,
                material: LIT,
                opacity: 0.3,
                ..disc(place, 0.8 * spacing, COLOURS[i % 4])
            }
        })
    };
    let mut scene = square(shuffled((0..spheres as usize).flat_map(sphere).collect()));
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (0.04, 0.4);
    scene
}

/// Two tilted sheets, much more than ε apart; each splat is displaced along its ray.
fn noisy_scan(scatter: f64) -> Scene {
    let z_threshold = 0.05;
    let sheet = |depth: f64, colours| {
        plane(
            DVec3::new(0.0, 0.0, depth),
            leaning(20.0),
            26,
            2.0 * PX,
            colours,
        )
    };
    let mut splats = sheet(DEPTH + 1.0, [BLUE, PALE]);
    splats.extend(sheet(DEPTH, [RED, GREEN]));
    // The index in the shuffled list serves as a fixed random number.
    let mut splats = shuffled(with_opacity(splats, 0.5));
    let count = splats.len() as f64;
    for (i, splat) in splats.iter_mut().enumerate() {
        let off = ((i as f64 * 0.618_033_988_749_895).fract() + i as f64 / count).fract() - 0.5;
        splat.position *= 1.0 + scatter * z_threshold * off / splat.position.z;
        splat.material = LIT;
    }
    let mut scene = square(splats);
    scene.surface.z_threshold = z_threshold;
    scene
}

/// A pan over the check scene, with fewer and wider splats, turned right by this many pixels.
fn slow_pan(pixels: f64) -> Scene {
    let side = 2 * SIDE;
    let image = Image {
        width: side,
        height: side,
        background: [1.0; 4],
        encoded: false,
    };
    let (eye, target) = (DVec3::new(0.0, 1.2, 4.5), DVec3::new(0.0, -0.2, 0.0));
    let camera = Camera {
        eye,
        target,
        up: DVec3::Y,
        fov_y_degrees: 45.0,
        near: 0.05,
        focal_px: None,
        centre_px: None,
        picture_px: None,
    };
    let light = DVec3::new(0.4, 0.8, 0.5).normalize();
    let mut scene = square(Builtin::GlassSpheres.splats(Some(PAN_SPLATS)));
    scene.camera = if pixels > 0.0 {
        camera.panned(&image, pixels)
    } else {
        camera
    };
    scene.image = image;
    scene.lights = vec![Light {
        direction: light,
        rgb: [1.0; 3],
    }];
    scene.surface.z_threshold = PAN_Z_THRESHOLD;
    scene
}

/// The previous frame, if the case is a sequence.
pub fn before(case: &Case, pixels: f64) -> Option<Scene> {
    (case.name == SLOW_PAN && pixels > 0.0).then(|| slow_pan(pixels - PAN_STEP_PX))
}

fn lone_splats(on_a_pixel: f64) -> Scene {
    let (radius, step) = (3.0 * PX, 0.618_033_988_749_895);
    // With all orientations, and partly outside, a disc covers 24 pixels of the picture on average.
    let count = (on_a_pixel * (SIDE * SIDE) as f64 / 24.0).ceil() as usize;
    let splat = |i: usize| {
        let part = |of: f64| (i as f64 * of).fract();
        let place = |of: f64| (part(of) - 0.5) * (SIDE as f64 + 6.0);
        let (z, turn) = (
            -0.2 - 0.8 * part(0.754_877_666_246_693),
            std::f64::consts::TAU * part(0.569_840_290_998_053),
        );
        let ring = sqrt(1.0 - z * z);
        let normal = DVec3::new(ring * cos(turn), ring * sin(turn), z);
        let depth = DEPTH + part(0.819_172_513_396_164);
        let flat = disc(
            at(place(step), place(0.324_717_957_244_746), depth),
            radius,
            COLOURS[i % 4],
        );
        Splat {
            normal,
            material: LIT,
            opacity: 0.6,
            ..flat
        }
    };
    let mut scene = square(shuffled((0..count).map(splat).collect()));
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (0.002, 0.1);
    scene
}

fn parallel(tilt: f64) -> Scene {
    let mut splats = plane(
        DVec3::new(0.0, 0.0, DEPTH),
        leaning(tilt),
        16,
        3.0 * PX,
        [RED, PALE],
    );
    splats.iter_mut().for_each(|splat| splat.material = LIT);
    // Exactly parallel: the computed axes have rounding errors at angle 0.
    splats
        .iter_mut()
        .filter(|_| tilt == 0.0)
        .for_each(|splat| splat.normal = DVec3::NEG_Z);
    square(splats)
}

fn opacity(opacity: f64) -> Scene {
    let sheet = |depth: f64, colours| {
        plane(
            DVec3::new(0.0, 0.0, depth),
            FLAT,
            13,
            3.6 * depth / FOCAL_PX,
            colours,
        )
    };
    let mut splats: Vec<Splat> = vec![];
    for (depth, colours) in [
        (2.6, [BLUE, PALE]),
        (2.4, [GREEN, RED]),
        (2.2, [PALE, BLUE]),
        (2.0, [RED, GREEN]),
    ] {
        splats.extend(with_opacity(sheet(depth, colours), opacity));
    }
    square(splats)
}

/// Pairs of discs at one place whose normals are almost opposite; they are lit by the sum of both.
fn cancel(short_of_opposite: f64) -> Scene {
    let half = short_of_opposite.to_radians() / 2.0;
    let mut splats = Vec::new();
    for i in 0..36 {
        let azimuth = 0.7 * i as f64;
        let across = DVec3::new(cos(azimuth), sin(azimuth), 0.0);
        let slanted = (across - DVec3::Z).normalize();
        let rest = (across + DVec3::Z).normalize();
        let place = |i: usize| (i as f64 - 2.5) * 7.5 + 0.2;
        let one = disc(at(place(i % 6), place(i / 6), DEPTH), 3.0 * PX, PALE);
        splats.push(Splat {
            normal: cos(half) * slanted + sin(half) * rest,
            material: LIT,
            ..one
        });
        splats.push(Splat {
            normal: sin(half) * rest - cos(half) * slanted,
            material: LIT,
            ..one
        });
    }
    let mut scene = square(splats);
    scene.surface.z_threshold = 1.0;
    scene
}

/// A lit ball, seen from the front.
fn highlight(shininess: f64) -> Scene {
    let (count, size) = (1500, 0.75);
    let golden_angle = std::f64::consts::PI * (1.0 + sqrt(5.0));
    let point = |i: usize| {
        // The half facing the eye.
        let (z, turn) = (-(i as f64 + 0.5) / count as f64, golden_angle * i as f64);
        let ring = sqrt(1.0 - z * z);
        let normal = DVec3::new(ring * cos(turn), ring * sin(turn), z);
        Splat {
            normal,
            material: LIT,
            ..disc(DVec3::new(0.0, 0.0, 2.3) + size * normal, 1.8 * PX, BLUE)
        }
    };
    let mut scene = square((0..count).map(point).collect());
    scene.materials[LIT as usize] = Material::BlinnPhong {
        ambient: 0.1,
        diffuse: 0.4,
        specular: 0.9,
        shininess,
    };
    scene.surface.z_threshold = 0.3;
    scene
}
