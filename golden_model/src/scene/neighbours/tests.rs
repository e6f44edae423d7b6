use super::*;
use proptest::prelude::*;
use std::time::{Duration, Instant};

fn bare(position: DVec3) -> Splat {
    Splat {
        position,
        normal: DVec3::ZERO,
        radius: 0.0,
        rgb: [0.5; 3],
        opacity: 1.0,
        material: 0,
    }
}

fn cloud(points: impl IntoIterator<Item = [f64; 3]>) -> Vec<Splat> {
    points
        .into_iter()
        .map(|p| bare(DVec3::from_array(p)))
        .collect()
}

fn fitted(mut splats: Vec<Splat>, eye: DVec3) -> Vec<Splat> {
    fit(&mut splats, eye);
    splats
}

/// A floor of n × n points, 1 apart.
fn floor(n: usize) -> Vec<Splat> {
    cloud((0..n * n).map(|i| [(i % n) as f64, 0.0, (i / n) as f64]))
}

const ABOVE: DVec3 = DVec3::new(3.0, 50.0, 7.0);

#[test]
fn a_grid_point_has_four_neighbours_at_1_and_two_at_root_2() {
    let splats = fitted(floor(20), ABOVE);
    let inner = splats[10 * 20 + 10];
    assert!((inner.radius - (4.0 + 2.0 * 2f64.sqrt()) / 6.0).abs() < 1e-15);
    assert!(
        splats
            .iter()
            .all(|s| (s.normal - DVec3::Y).length() < 1e-12)
    );
}

#[test]
fn normals_turn_with_the_eye() {
    assert!(
        fitted(floor(8), -ABOVE)
            .iter()
            .all(|s| (s.normal + DVec3::Y).length() < 1e-12)
    );
}

#[test]
fn a_stray_point_has_a_radius_of_at_most_four_medians() {
    let mut splats = floor(10);
    splats.push(bare(DVec3::new(1e6, 0.0, 0.0)));
    let splats = fitted(splats, ABOVE);
    let median = median(splats.iter().map(|s| s.radius).collect()).unwrap();
    assert_eq!(splats[100].radius, 4.0 * median);
}

#[test]
fn given_radii_and_normals_stay() {
    let mut splats = floor(4);
    (splats[3].radius, splats[5].normal) = (7.0, DVec3::X);
    let splats = fitted(splats, ABOVE);
    assert_eq!((splats[3].radius, splats[5].normal), (7.0, DVec3::X));
    assert!(splats[3].normal.y > 0.99 && splats[5].radius > 0.0);
}

#[test]
fn a_lone_point_faces_the_eye_with_a_radius_of_1() {
    let splats = fitted(cloud([[0.0; 3]]), ABOVE);
    assert_eq!(splats[0].radius, 1.0);
    assert!((splats[0].normal - ABOVE.normalize()).length() < 1e-15);
    assert_eq!(fitted(cloud([[0.0, 3e9, 4e9]]), ABOVE)[0].radius, 5e3);
}

#[test]
fn a_point_at_the_eye_still_has_a_unit_normal() {
    assert!((fitted(cloud([[1.0; 3]]), DVec3::ONE)[0].normal.length() - 1.0).abs() < 1e-15);
}

#[test]
fn points_on_a_line_face_the_eye_as_closely_as_possible() {
    for n in [2, 3, 20] {
        let splats = fitted(
            cloud((0..n).map(|i| [i as f64, i as f64, 0.0])),
            DVec3::new(0.0, 0.0, 9.0),
        );
        let along = DVec3::new(1.0, 1.0, 0.0).normalize();
        assert!(
            splats
                .iter()
                .all(|s| s.normal.dot(along).abs() < 1e-6 && s.normal.z > 0.5),
            "{n}: {splats:?}"
        );
    }
}

#[test]
fn equal_points_are_quick_and_have_a_radius() {
    let start = Instant::now();
    let splats = fitted(cloud(vec![[0.5, -0.0, 2.0]; 200_000]), ABOVE);
    assert!(
        splats
            .iter()
            .all(|s| s.radius == 1.0 && s.normal.is_normalized())
    );
    // Much more than needed, and much less than for all pairs.
    assert!(
        start.elapsed() < Duration::from_secs(30),
        "{:?}",
        start.elapsed()
    );
}

#[test]
fn a_pile_of_points_is_as_large_as_the_points_around_it() {
    let mut splats = floor(10);
    splats.extend(cloud(vec![[4.0, 0.0, 4.0]; 200]));
    let splats = fitted(splats, ABOVE);
    assert!(
        (0.9..1.5).contains(&splats[299].radius),
        "{}",
        splats[299].radius
    );
    assert!((splats[299].normal - DVec3::Y).length() < 1e-12);
}

#[test]
fn copies_of_a_point_do_not_change_its_surroundings() {
    let points: Vec<DVec3> = floor(6)
        .iter()
        .map(|splat| splat.position + DVec3::Y * (splat.position.x * 0.3).sin())
        .collect();
    let alone = surroundings(&points);
    // Some points twice, some nine times.
    let copied: Vec<DVec3> = points
        .iter()
        .enumerate()
        .flat_map(|(i, point)| vec![*point; if i % 5 == 0 { 9 } else { 2 }])
        .collect();
    let number = |point: DVec3| points.iter().position(|other| *other == point).unwrap();
    for (point, around) in copied.iter().zip(surroundings(&copied)) {
        assert_eq!(around.spacing, alone[number(*point)].spacing);
        assert_eq!(
            around
                .nearest
                .map(|other| number(copied[other as usize]) as u32),
            alone[number(*point)].nearest
        );
    }
    assert_eq!(surroundings(&[DVec3::X; 3])[0].spacing, 1.0);
}

#[test]
fn minus_zero_is_the_same_place_as_zero() {
    let splats = fitted(
        cloud([[0.0, 0.0, 1.0], [-0.0, 0.0, 1.0], [-0.0, 3.0, 1.0]]),
        ABOVE,
    );
    assert_eq!((splats[0].radius, splats[1].radius), (1.5, 1.5));
}

/// Copies of a place are adjacent: points within one step of the curve are sorted by coordinates.
#[test]
fn minus_zero_is_the_same_place_as_zero_with_others_between() {
    let points = |zero: f64| {
        [
            [0.0, 0.0, 0.0],
            [0.0, zero, 2.0],
            [0.0, 0.0, 1.0],
            [0.0, zero, 0.0],
            [1e9, 0.0, 0.0],
        ]
        .map(DVec3::from_array)
    };
    let [with_minus, without] = [-0.0, 0.0].map(|zero| surroundings(&points(zero)));
    for (one, other) in with_minus.iter().zip(&without) {
        assert_eq!((one.spacing, one.nearest), (other.spacing, other.nearest));
    }
    assert_eq!(with_minus[0].nearest, with_minus[3].nearest);
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    // Enough points for a tree that is built by several threads.
    let splats = super::super::builtin::Builtin::Terrain.splats(Some(300_000));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            fitted(
                splats.iter().map(|splat| bare(splat.position)).collect(),
                ABOVE,
            )
        })
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn very_large_and_very_small_clouds_have_finite_radii_and_unit_normals() {
    for scale in [1e-320, 1e-200, 1e-30, 1e30] {
        let splats = fitted(
            floor(5)
                .into_iter()
                .map(|s| bare(s.position * scale))
                .collect(),
            DVec3::Y * 1e30,
        );
        assert!(
            splats
                .iter()
                .all(|s| s.radius > 0.0 && s.radius.is_finite()),
            "{scale}"
        );
        assert!(
            splats
                .iter()
                .all(|s| (s.normal.length() - 1.0).abs() < 1e-12),
            "{scale}"
        );
    }
}

/// The mean distance to the 6 nearest others, by exhaustive search.
fn spacing_by_exhaustion(splats: &[Splat], i: usize) -> f64 {
    let others = splats.iter().enumerate().filter(|(j, _)| *j != i);
    let mut distances: Vec<f64> = others
        .map(|(_, s)| (s.position - splats[i].position).length())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate(6);
    distances.iter().sum::<f64>() / distances.len() as f64
}

proptest! {
    /// On a coarse lattice, with many equal places, ties and planes.
    #[test]
    fn radii_are_those_of_an_exhaustive_search(points in prop::collection::vec(prop::array::uniform3(0..5i8), 2..90)) {
        let splats = fitted(cloud(points.iter().map(|p| p.map(f64::from))), ABOVE);
        let spacings: Vec<f64> = (0..splats.len()).map(|i| spacing_by_exhaustion(&splats, i)).collect();
        let typical = median(spacings.iter().copied().filter(|&spacing| spacing > 0.0).collect());
        for (splat, spacing) in splats.iter().zip(spacings) {
            let expected = match typical {
                Some(_) if spacing > 0.0 => spacing.min(4.0 * typical.unwrap()),
                Some(median) => median,
                None => 1.0,
            };
            prop_assert!((splat.radius - expected).abs() < 1e-12, "{} against {expected}", splat.radius);
            prop_assert!((splat.normal.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn eigenvectors_rebuild_their_matrix(v in prop::array::uniform6(-1.0..1.0f64)) {
        let m = DMat3::from_cols(DVec3::new(v[0], v[1], v[2]), DVec3::new(v[1], v[3], v[4]), DVec3::new(v[2], v[4], v[5]));
        let pairs = eigen(&m);
        prop_assert!(pairs[0].0 <= pairs[1].0 && pairs[1].0 <= pairs[2].0);
        for (value, vector) in pairs {
            prop_assert!((m * vector - value * vector).length() < 1e-13);
        }
    }
}
