//! Environment: directions and texels.

use super::*;

#[test]
fn a_place_is_that_of_its_direction() {
    for (x, y, z, at) in [
        (0.0, 0.0, -1.0, [0.5, 0.5]),
        (1.0, 0.0, 0.0, [0.75, 0.5]),
        (-1.0, 0.0, 0.0, [0.25, 0.5]),
        (0.0, 1.0, -1e-9, [0.5, 0.0]),
    ] {
        let found = place(DVec3::new(x, y, z) * 3.0);
        assert!(
            found
                .iter()
                .zip(at)
                .all(|(found, at)| (found - at).abs() < 1e-8),
            "{x} {y} {z}: {found:?}"
        );
    }
    for across in [0.01, 0.3, 0.77] {
        for down in [0.1, 0.5, 0.93] {
            let found = place(direction([across, down]));
            assert!(
                (found[0] - across).abs() < 1e-12 && (found[1] - down).abs() < 1e-12,
                "{found:?}"
            );
        }
    }
}

#[test]
fn texels_have_their_value_at_their_centres_and_rows_are_closed() {
    let texels: Vec<[f32; 3]> = (0..32).map(|i| [i as f32, 0.0, 1.0]).collect();
    let all = Environment::new(8, 4, texels).unwrap();
    for row in 0..4 {
        for column in 0..8 {
            let [light, ..] = all.light(direction([
                (column as f64 + 0.5) / 8.0,
                (row as f64 + 0.5) / 4.0,
            ]));
            assert!(
                (light - (row * 8 + column) as f64).abs() < 1e-9,
                "row {row}, column {column}: {light}"
            );
        }
    }
    // Between the last texel of a row and the first.
    assert!((all.light(direction([0.0, 0.375]))[0] - 11.5).abs() < 1e-9);
    assert!((all.light(DVec3::Y)[0] - 3.5).abs() < 4.0);
}

#[test]
fn one_row_of_two_texels_is_enough() {
    let all = Environment::new(2, 1, vec![[1.0; 3], [0.0; 3]]).unwrap();
    assert_eq!(all.light(direction([0.25, 0.9])), [1.0; 3]);
}
