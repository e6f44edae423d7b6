use super::*;

/// Few items are all in the sample. Of many items the sample has its share, at any position: of
/// each row of a picture, whatever its width.
#[test]
fn a_sample_is_spread_evenly() {
    for of in 1..FEW {
        assert!((0..of).all(|item| is_sampled(item, of)));
    }
    for (of, apart) in [
        (3 * FEW, 3),
        (MOST_APART * FEW, MOST_APART),
        (1_000_000, MOST_APART),
    ] {
        let share = (0..of).filter(|item| is_sampled(*item, of)).count();
        assert!(
            share.abs_diff(of / apart) <= of / apart / 20 + 2,
            "{share} of {of}"
        );
    }
    for width in [30, 32, 55, 64, 120, 128, 256] {
        let of = width * width;
        let columns = (0..width)
            .filter(|column| (0..width).any(|row| is_sampled(row * width + column, of)))
            .count();
        let most = (0..of)
            .filter(|item| is_sampled(*item, of))
            .count()
            .min(width);
        assert!(columns > most / 2, "{columns} columns of {most}");
    }
}
