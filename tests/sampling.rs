//! Do the points of `sample` have the specified positions, number, widths and colours?

use crate::shared_input;
use crate::tier::{self, Tier};
use assert_cmd::Command;
use glam::{DMat2, DVec2, DVec3};
use serde_json::json;
use splatsim::golden::{Rules, render};
use splatsim::sampling::gaussian::{Gaussian, cut, inner_of_round};
use splatsim::sampling::{
    Acquisition, Amount, Pattern, Picture, Radii, Sampled, SamplingRequest, file, sample,
};
use splatsim::scene::mesh::Mesh;
use splatsim::scene::{Overrides, Scene, Splat};
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

const PATTERNS: [Pattern; 2] = [Pattern::BlueNoise, Pattern::Stratified];
const ACQUISITIONS: [Acquisition; 3] = [
    Acquisition::Nearest,
    Acquisition::Ewa,
    Acquisition::Optimised,
];

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn mesh(obj: &str) -> Mesh {
    let folder = folder();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, obj).unwrap();
    Mesh::load(path).unwrap()
}

fn request(points: usize) -> SamplingRequest {
    SamplingRequest {
        amount: Amount::Points(points),
        pattern: Pattern::BlueNoise,
        seed: 0,
        radii: Radii::Area,
        acquisition: Acquisition::Nearest,
        picture: Picture::Own,
        cutoff: 2.0,
    }
}

fn sampled(obj: &str, points: usize, pattern: Pattern) -> Sampled {
    sample(
        &mesh(obj),
        &SamplingRequest {
            pattern,
            ..request(points)
        },
    )
    .unwrap()
}

/// The unit square of the plane z = 0, with texture coordinates.
const SQUARE: &str =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

/// The cube from −1 to 1.
fn cube() -> String {
    let corners: String = (0..8)
        .map(|i| {
            format!(
                "v {} {} {}\n",
                2 * (i & 1) - 1,
                (i & 2) - 1,
                (i & 4) / 2 - 1
            )
        })
        .collect();
    corners + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

// ---- Where ----

#[test]
fn there_are_exactly_as_many_points_as_asked_for() {
    for pattern in PATTERNS {
        for points in [1, 2, 3, 100, 4321] {
            let sampled = sampled(&cube(), points, pattern);
            assert_eq!(sampled.splats.len(), points);
            assert_eq!(sampled.area, 24.0);
        }
        let dense = sample(
            &mesh(&cube()),
            &SamplingRequest {
                amount: Amount::Density(10.0),
                pattern,
                ..request(1)
            },
        )
        .unwrap();
        assert_eq!(dense.splats.len(), 240);
    }
}

#[test]
fn points_lie_on_the_mesh_and_look_out_of_it() {
    for pattern in PATTERNS {
        for splat in sampled(&cube(), 3000, pattern).splats {
            let distance = splat.position.abs().max_element();
            assert!((distance - 1.0).abs() < 1e-14, "{splat:?}");
            assert!(
                (splat.normal.dot(splat.position) - 1.0).abs() < 1e-6,
                "{splat:?}"
            );
        }
    }
}

/// A large square, a small one, and a sliver to which most triangles belong.
#[test]
fn areas_have_points_in_proportion() {
    let mut obj = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nv 10 0 0\nv 11 0 0\nv 11 1 0\nv 10 1 0\nf 1 2 3 4\nf 5 6 7 8\nv 20 0 0\n".to_owned();
    obj += "v 20 2 0\n";
    for i in 0..500 {
        let x = 20.0 + (i + 1) as f64 / 250.0;
        obj += &format!("v {x} 0 0\nv {x} 2 0\nf -4 -2 -1 -3\n");
    }
    // Blue noise has more points along borders, on one side of which there are no neighbours.
    for (pattern, share) in [(Pattern::Stratified, 0.0), (Pattern::BlueNoise, 0.08)] {
        let Sampled { splats, area, .. } = sampled(&obj, 6000, pattern);
        for (from, own) in [(0.0, 9.0), (10.0, 1.0), (19.9, 4.0)] {
            let count = splats
                .iter()
                .filter(|s| (from..from + 9.9).contains(&s.position.x))
                .count() as f64;
            let expected = 6000.0 * own / area;
            assert!(
                (count - expected).abs() <= 1.0 + share * expected,
                "{pattern:?} at {from}: {count} instead of {expected}"
            );
        }
    }
}

#[test]
fn no_two_points_of_blue_noise_are_nearer_than_the_limit() {
    let Sampled {
        splats,
        spacing,
        area,
        ..
    } = sampled(&cube(), 3000, Pattern::BlueNoise);
    let told = spacing.unwrap();
    let faces: Vec<DVec3> = splats.iter().map(|s| s.normal.round()).collect();
    let mut least = f64::INFINITY;
    for i in 0..splats.len() {
        for j in 0..i {
            // Faces at a right angle are independent: the product of their normals is 0.
            if faces[i].dot(faces[j]) > 0.0 {
                least = least.min(splats[i].position.distance(splats[j].position));
            }
        }
    }
    assert!(least >= told, "{least} < {told}");
    // Discs at this distance in a hexagonal lattice would be 1.07 apart.
    assert!(told > 0.74 * (area / 3000.0).sqrt(), "{told}");
}

#[test]
fn strata_have_one_point_each() {
    let splats = sampled(SQUARE, 4096, Pattern::Stratified).splats;
    // If 4^k points are on one triangle, or two, each of its 4^k similar parts has one point; rows
    // of the square are diagonals of such parts.
    let mut cells = [0; 16 * 16];
    splats.iter().for_each(|s| {
        cells[(s.position.y * 16.0) as usize * 16 + (s.position.x * 16.0) as usize] += 1
    });
    assert!(
        cells.iter().all(|count| (8..=24).contains(count)),
        "{cells:?}"
    );
}

/// The two sides of an infinitely thin sheet each have as many points as a single side would.
#[test]
fn two_sides_of_a_sheet_are_two_surfaces() {
    let both = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 4 3 2 1\n";
    let Sampled {
        splats, spacing, ..
    } = sample(
        &mesh(both),
        &SamplingRequest {
            radii: Radii::Neighbours,
            ..request(2000)
        },
    )
    .unwrap();
    let front = splats.iter().filter(|s| s.normal.z > 0.0).count();
    assert!((900..1100).contains(&front), "{front}");
    assert!(spacing.unwrap() > 0.74 * (1.0f64 / 1000.0).sqrt());
    let mean = splats.iter().map(|s| s.radius).sum::<f64>() / 2000.0;
    assert!(
        (mean / (1.0f64 / 1000.0).sqrt() - 1.21).abs() < 0.06,
        "{mean}"
    );
}

// ---- The same again ----

fn run(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splatsim"));
    command
        .current_dir(folder)
        .arg("sample")
        .args(arguments)
        .timeout(Duration::from_secs(120))
        .output()
        .unwrap()
}

fn says(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert_eq!(
        (
            output.status.code(),
            String::from_utf8(output.stderr).unwrap().as_str()
        ),
        (Some(0), ""),
        "{arguments:?}"
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_same_seed_makes_the_same_bytes_at_any_number_of_threads() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = folder();
    std::fs::write(folder.path().join("a.obj"), SQUARE).unwrap();
    for pattern in ["blue-noise", "stratified"] {
        let bytes = |threads: &str, seed: &str| {
            let mut all = vec![
                "a.obj",
                "--points",
                "3000",
                "--out",
                "a.ply",
                "--pattern",
                pattern,
                "--texture",
                "optimised",
            ];
            all.extend([
                "--checkerboard",
                "4",
                "--radii",
                "neighbours",
                "--threads",
                threads,
                "--seed",
                seed,
                "--quiet",
            ]);
            assert_eq!(says(folder.path(), &all), "");
            std::fs::read(folder.path().join("a.ply")).unwrap()
        };
        let first = bytes("1", "7");
        assert!(first == bytes("1", "7") && first == bytes("2", "7") && first == bytes("5", "7"));
        assert!(first != bytes("1", "8"));
    }
}

#[test]
fn a_scene_reads_the_points_that_were_written() {
    let folder = folder();
    let splats = sampled(&cube(), 500, Pattern::BlueNoise).splats;
    let path = folder.path().join("a.ply");
    file::write(&path, &splats).unwrap();
    let scene = Scene::load(&path, &Overrides::default()).unwrap();
    assert_eq!(scene.splats.len(), 500);
    for (read, made) in scene.splats.iter().zip(&splats) {
        assert_eq!(read.position, made.position);
        assert!(
            read.normal.distance(made.normal) < 1e-6
                && (read.radius / made.radius - 1.0).abs() < 1e-6
        );
        assert!(
            read.rgb
                .iter()
                .zip(made.rgb)
                .all(|(a, b)| (a - b).abs() < 1e-6)
                && (read.opacity - made.opacity).abs() < 1e-6
        );
    }
    assert_eq!(scene.notes, Vec::<String>::new());
}

#[test]
fn the_sampling_is_summarised() {
    let folder = folder();
    std::fs::write(folder.path().join("a.obj"), SQUARE.to_owned() + "f 1 1 2\n").unwrap();
    let told = says(
        folder.path(),
        &[
            "a.obj",
            "--points",
            "2000",
            "--out",
            "a.ply",
            "--checkerboard",
            "4",
            "--texture",
            "optimised",
        ],
    );
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(
        lines[0], "2 triangles (1 without an area left out), area 1.000000",
        "{told}"
    );
    assert!(
        lines[1].starts_with("2,000 points, at least 1.")
            && lines[1].ends_with("of radii 2.683e-2 to 2.683e-2"),
        "{told}"
    );
    assert!(
        lines[2].starts_with("colours solved for: residual ") && lines[2].ends_with(" steps"),
        "{told}"
    );
    assert!(
        lines[3].contains(" of 2,000 colours leave [0, 1], by at most ")
            && lines[3].ends_with("; scenes clamp them"),
        "{told}"
    );
    assert_eq!(lines[4], "written to a.ply: 112,349 bytes");
}

#[test]
fn wrong_arguments_are_one_sentence_and_nothing_is_written() {
    let folder = folder();
    std::fs::write(folder.path().join("a.obj"), SQUARE).unwrap();
    std::fs::write(folder.path().join("bare.obj"), cube()).unwrap();
    std::fs::write(
        folder.path().join("far.obj"),
        "v 1e29 0 0\nv 1.00000000001e29 0 0\nv 1e29 1e10 0\nf 1 2 3\n",
    )
    .unwrap();
    std::fs::write(folder.path().join("text.jpg"), "text").unwrap();
    for (arguments, sentence) in [
        (&["a.obj", "--out", "b.ply"][..], "--points"),
        (
            &["a.obj", "--points", "0", "--out", "b.ply"],
            "would have 0 points; from 1 to 4294967295 can be made",
        ),
        (
            &["a.obj", "--points", "4000000000", "--out", "b.ply"],
            "points would take about",
        ),
        (&["a.obj", "--points", "-1", "--out", "b.ply"], "-1"),
        (
            &["a.obj", "--points", "9", "--density", "9", "--out", "b.ply"],
            "cannot be used with",
        ),
        (
            &["a.obj", "--density", "0", "--out", "b.ply"],
            "--density 0: it must be above 0",
        ),
        (
            &["a.obj", "--density", "nan", "--out", "b.ply"],
            "--density NaN: it must be above 0",
        ),
        (
            &["a.obj", "--density", "1e300", "--out", "b.ply"],
            "from 1 to 4294967295 can be made",
        ),
        (
            &["a.obj", "--points", "9", "--out", "b.obj"],
            "--out b.obj: points are written as .ply",
        ),
        (
            &["a.obj", "--points", "9", "--out", "no/b.ply"],
            "--out no/b.ply: there is no such folder",
        ),
        (
            &["a.obj", "--points", "9", "--out", "b.ply", "--cutoff", "0"],
            "--cutoff 0: it must be from 0.01 to 100",
        ),
        (
            &[
                "a.obj",
                "--points",
                "9",
                "--out",
                "b.ply",
                "--checkerboard",
                "0",
            ],
            "--checkerboard",
        ),
        (
            &[
                "a.obj",
                "--points",
                "9",
                "--out",
                "b.ply",
                "--texture-image",
                "none.png",
            ],
            "none.png: cannot be read",
        ),
        (
            &[
                "a.obj",
                "--points",
                "9",
                "--out",
                "b.ply",
                "--texture-image",
                "text.jpg",
            ],
            "text.jpg: is not a PNG or JPEG picture",
        ),
        (
            &[
                "bare.obj",
                "--points",
                "9",
                "--out",
                "b.ply",
                "--checkerboard",
                "2",
            ],
            "bare.obj: has no texture coordinates",
        ),
        (
            &["far.obj", "--points", "9", "--out", "b.ply"],
            "which cannot be resolved at 1.000e29 from the origin",
        ),
        (
            &["none.obj", "--points", "9", "--out", "b.ply"],
            "none.obj: cannot be read",
        ),
    ] {
        let output = run(folder.path(), arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && told.contains(sentence) && told.lines().count() == 1,
            "{arguments:?}: {told}"
        );
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            4,
            "{arguments:?}"
        );
    }
}

// ---- Which colour ----

/// ∫ a b over a square around both, by the midpoint rule.
fn integrated(a: &Gaussian, b: &Gaussian, half: f64, steps: usize) -> f64 {
    let step = 2.0 * half / steps as f64;
    let place = |i: usize| -half + (i as f64 + 0.5) * step;
    let point = |i: usize| DVec2::new(place(i % steps), place(i / steps));
    (0..steps * steps)
        .map(point)
        .map(|x| a.at(x) * b.at(x))
        .sum::<f64>()
        * step
        * step
}

#[test]
fn inner_products_are_what_integration_finds() {
    let tilted = |long: f64, short: f64, angle: f64| {
        let turn = DMat2::from_angle(angle);
        turn * DMat2::from_diagonal(DVec2::new(long * long, short * short)) * turn.transpose()
    };
    for (a, b) in [
        (
            Gaussian::round(DVec2::ZERO, 1.0),
            Gaussian::round(DVec2::ZERO, 1.0),
        ),
        (
            Gaussian::round(DVec2::new(0.5, -0.2), 0.7),
            Gaussian::round(DVec2::new(-1.0, 0.4), 1.3),
        ),
        (
            Gaussian {
                middle: DVec2::new(1.0, 0.0),
                variance: tilted(2.0, 0.5, 0.3),
            },
            Gaussian {
                middle: DVec2::new(-0.5, 1.0),
                variance: tilted(1.0, 0.4, -1.2),
            },
        ),
    ] {
        let (closed, numeric) = (a.inner(&b), integrated(&a, &b, 12.0, 600));
        assert!((closed / numeric - 1.0).abs() < 1e-9, "{closed} {numeric}");
        assert_eq!(a.inner(&b), b.inner(&a));
    }
    let (a, b) = (
        Gaussian::round(DVec2::new(0.5, -0.2), 0.7),
        Gaussian::round(DVec2::new(-1.0, 0.4), 1.3),
    );
    assert!(
        (inner_of_round(0.7, 1.3, a.middle.distance_squared(b.middle))
            / integrated(&a, &b, 12.0, 600)
            - 1.0)
            .abs()
            < 1e-9
    );
}

/// n∘t⁻¹ of a Gaussian n equals n at the preimage of every point.
#[test]
fn a_mapped_gaussian_is_the_gaussian_at_the_place_that_was_mapped() {
    let gaussian = Gaussian {
        middle: DVec2::new(0.3, -0.7),
        variance: DMat2::from_cols_array(&[1.0, 0.3, 0.3, 0.5]),
    };
    let (linear, offset) = (
        DMat2::from_cols_array(&[2.0, 0.5, -1.0, 1.5]),
        DVec2::new(3.0, -2.0),
    );
    let mapped = gaussian.mapped(linear, offset);
    for x in [DVec2::ZERO, DVec2::new(1.0, -0.5), DVec2::new(-2.0, 0.3)] {
        assert!((mapped.at(linear * x + offset) - gaussian.at(x)).abs() < 1e-12);
    }
}

fn checks(points: usize, acquisition: Acquisition, cutoff: f64, checks: usize) -> Sampled {
    sample(
        &mesh(SQUARE),
        &SamplingRequest {
            acquisition,
            cutoff,
            picture: Picture::checkerboard(checks),
            ..request(points)
        },
    )
    .unwrap()
}

/// Mean square difference of a checkerboard from the sum of drawn kernels with their colours,
/// divided by the sum of weights. The border, where kernels are missing, is left out.
fn missing(splats: &[Splat], width: f64, checks: usize) -> f64 {
    let steps = 120;
    let mut sum = 0.0;
    for place in 0..steps * steps {
        let x = DVec2::new((place % steps) as f64 + 0.5, (place / steps) as f64 + 0.5)
            / steps as f64
            * 0.8
            + 0.1;
        let (mut weights, mut colours) = (0.0, 0.0);
        for splat in splats {
            let squared =
                splat.position.truncate().distance_squared(x) / (width * splat.radius).powi(2);
            if squared < 40.0 {
                let weight = (-0.5 * squared).exp();
                weights += weight;
                colours += weight * splat.rgb[0];
            }
        }
        let (column, row) = (
            (x.x * checks as f64) as usize,
            ((1.0 - x.y) * checks as f64) as usize,
        );
        sum += (colours / weights - f64::from((column + row).is_multiple_of(2))).powi(2);
    }
    sum / (steps * steps) as f64
}

#[test]
fn solved_colours_reconstruct_a_picture_better_than_averages_and_samples() {
    for cutoff in [2.0, 8.0] {
        let [nearest, ewa, optimised] = ACQUISITIONS.map(|acquisition| {
            let sampled = checks(1500, acquisition, cutoff, 8);
            assert_eq!(
                sampled.solution.is_some(),
                acquisition == Acquisition::Optimised
            );
            if let Some(solution) = sampled.solution {
                assert!(
                    solution.damped_residual <= 1e-6 && solution.steps > 3,
                    "{solution:?}"
                );
            }
            assert_eq!(sampled.beyond > 0, acquisition == Acquisition::Optimised);
            missing(&sampled.splats, cut(cutoff), 8)
        });
        assert!(
            optimised < 0.9 * nearest && nearest < ewa,
            "{cutoff}: {nearest} {ewa} {optimised}"
        );
    }
}

/// From the book only: e are the colours of `ewa`, R the products of round kernels, c = e times its
/// row sums, s 3 % of their mean.
#[test]
fn residuals_are_those_of_the_equations_and_of_the_damped_ones() {
    let (cutoff, count) = (2.0, 400);
    let optimised = checks(count, Acquisition::Optimised, cutoff, 4);
    let ewa = checks(count, Acquisition::Ewa, cutoff, 4);
    let half = cutoff / 2.0;
    let drawn = (1.0 - half / (half.exp() - 1.0)).sqrt();
    let product = |a: &Splat, b: &Splat| {
        let [p, q] = [a, b].map(|splat| (drawn * splat.radius).powi(2));
        let index = a.position.distance_squared(b.position) / (2.0 * (p + q));
        if (-index).exp() < 1e-3 {
            0.0
        } else {
            p * q / (p + q) * (-index).exp()
        }
    };
    let rows: Vec<Vec<f64>> = ewa
        .splats
        .iter()
        .map(|a| ewa.splats.iter().map(|b| product(a, b)).collect())
        .collect();
    let sums: Vec<f64> = rows.iter().map(|row| row.iter().sum()).collect();
    let stay = 0.03 * sums.iter().sum::<f64>() / count as f64;
    // All channels of a checkerboard are equal.
    let [e, w] = [&ewa, &optimised].map(|sampled| {
        sampled
            .splats
            .iter()
            .map(|splat| splat.rgb[0])
            .collect::<Vec<f64>>()
    });
    let norm = |vector: &[f64]| vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    let of = |damping: f64| {
        let right: Vec<f64> = (0..count).map(|k| e[k] * (sums[k] + damping)).collect();
        let left: Vec<f64> = (0..count)
            .map(|k| right[k] - damping * w[k] - (0..count).map(|j| rows[k][j] * w[j]).sum::<f64>())
            .collect();
        norm(&left) / norm(&right)
    };
    let solution = optimised.solution.unwrap();
    assert!(
        (solution.residual / of(0.0) - 1.0).abs() < 1e-3 && solution.residual > 1e-3,
        "{solution:?} for {}",
        of(0.0)
    );
    assert!(
        of(stay) < 1e-5 && solution.damped_residual <= 1e-6,
        "{solution:?} for {}",
        of(stay)
    );
}

/// A picture of one colour needs no optimisation.
#[test]
fn one_colour_stays_that_colour_in_all_three_ways() {
    for acquisition in ACQUISITIONS {
        let sampled = sample(
            &mesh(SQUARE),
            &SamplingRequest {
                acquisition,
                ..request(500)
            },
        )
        .unwrap();
        assert!(
            sampled
                .splats
                .iter()
                .flat_map(|s| s.rgb)
                .all(|c| (c - 0.5).abs() < 1e-5),
            "{acquisition:?}"
        );
        let white = checks(500, acquisition, 2.0, 1);
        assert!(
            white
                .splats
                .iter()
                .flat_map(|s| s.rgb)
                .all(|c| (c - 1.0).abs() < 1e-5),
            "{acquisition:?}"
        );
    }
}

/// If a check is much smaller than a kernel, an average is grey and a sample is black or white.
#[test]
fn averages_of_small_checks_are_grey() {
    let grey = checks(100, Acquisition::Ewa, 2.0, 512).splats;
    assert!(
        grey.iter().all(|s| (s.rgb[0] - 0.5).abs() < 0.02),
        "{:?}",
        grey.iter().map(|s| s.rgb[0]).fold(0.0, f64::max)
    );
    let hard = checks(100, Acquisition::Nearest, 2.0, 512).splats;
    assert!(hard.iter().all(|s| s.rgb[0] == 0.0 || s.rgb[0] == 1.0));
}

#[test]
fn a_picture_lies_upright_and_keeps_its_opacity() {
    let folder = folder();
    // Red at the top, green at the bottom, the left half of glass.
    let texel = |x: u32, y: u32| {
        image::Rgba([
            if y == 0 { 255 } else { 0 },
            if y == 1 { 255 } else { 0 },
            0,
            if x == 0 { 51 } else { 255 },
        ])
    };
    image::RgbaImage::from_fn(2, 2, texel)
        .save(folder.path().join("a.png"))
        .unwrap();
    std::fs::write(
        folder.path().join("a.mtl"),
        "newmtl a\nmap_Kd a.png\nd 0.5\n",
    )
    .unwrap();
    std::fs::write(
        folder.path().join("a.obj"),
        "mtllib a.mtl\nusemtl a\n".to_owned() + SQUARE,
    )
    .unwrap();
    let mesh = Mesh::load(folder.path().join("a.obj")).unwrap();
    for acquisition in ACQUISITIONS {
        let splats = sample(
            &mesh,
            &SamplingRequest {
                acquisition,
                ..request(400)
            },
        )
        .unwrap()
        .splats;
        let inside = splats.iter().filter(|s| {
            [s.position.x, s.position.y]
                .iter()
                .all(|c| (0.15..0.3).contains(c) || (0.7..0.85).contains(c))
        });
        let mut seen = 0;
        for splat in inside {
            let is_red = splat.position.y > 0.5;
            let opacity = if splat.position.x < 0.5 { 0.1 } else { 0.5 };
            assert!(
                if is_red {
                    splat.rgb[0] > 0.8
                } else {
                    splat.rgb[1] > 0.8
                },
                "{acquisition:?} {splat:?}"
            );
            assert!(
                (splat.opacity - opacity).abs() < 0.1,
                "{acquisition:?} {splat:?}"
            );
            seen += 1;
        }
        assert!(seen > 10);
    }
}

// ---- How wide ----

/// Alpha of golden's picture of a square that is larger than the picture.
fn least_alpha(splats: &[Splat], eye: [f64; 3]) -> f64 {
    let folder = folder();
    file::write(&folder.path().join("a.ply"), splats).unwrap();
    let scene = json!({
        "splats": {"file": "a.ply"},
        "materials": [{"unlit": true}],
        "camera": {"eye": eye, "target": [0.5, 0.5, 0], "up": [0, 1, 0], "fov_y_degrees": 30},
        "image": {"width": 160, "height": 160},
    });
    std::fs::write(folder.path().join("a.json"), scene.to_string()).unwrap();
    let scene = Scene::load(folder.path().join("a.json"), &Overrides::default()).unwrap();
    render(&scene, &Rules::default())
        .picture
        .rgba
        .iter()
        .map(|pixel| pixel[3])
        .fold(1.0, f64::min)
}

#[test]
fn a_sampled_plane_has_no_hole() {
    for pattern in PATTERNS {
        for radii in [Radii::Area, Radii::Neighbours] {
            for seed in 0..3 {
                let splats = sample(
                    &mesh(SQUARE),
                    &SamplingRequest {
                        pattern,
                        radii,
                        seed,
                        ..request(3000)
                    },
                )
                .unwrap()
                .splats;
                for eye in [[0.5, 0.5, 1.0], [0.5, 0.1, 0.3], [0.8, 0.6, 0.4]] {
                    let least = least_alpha(&splats, eye);
                    assert!(
                        least > 0.999,
                        "{pattern:?} {radii:?} {seed} from {eye:?}: {least}"
                    );
                }
            }
        }
    }
}

#[test]
fn real_meshes_are_sampled_all_over() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for name in [
        "scans/bun_zipper.ply",
        "models/CesiumMilkTruck.glb",
        "models/space-shuttle-orbiter/space-shuttle-orbiter.obj",
    ] {
        let Some(path) = shared_input::find(name) else {
            return;
        };
        let mesh = Mesh::load(&path).unwrap();
        let Sampled { splats, notes, .. } = sample(
            &mesh,
            &SamplingRequest {
                acquisition: Acquisition::Ewa,
                ..request(20_000)
            },
        )
        .unwrap();
        assert!(splats.len() == 20_000 && notes.is_empty(), "{name}");
        let colours = splats
            .iter()
            .all(|s| s.rgb.iter().all(|c| (0.0..=1.0).contains(c)));
        assert!(
            colours
                && splats
                    .iter()
                    .all(|s| s.position.is_finite() && (s.normal.length() - 1.0).abs() < 1e-6),
            "{name}"
        );
    }
}
