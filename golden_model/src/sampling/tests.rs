//! Sampling: counts, cut Gaussians.

use super::*;

#[test]
fn a_number_of_points_is_an_integer_within_the_limit() {
    assert_eq!(count(Amount::Density(10.0), 0.26), Ok(3));
    assert_eq!(count(Amount::Density(10.0), 0.001), Ok(1));
    assert_eq!(count(Amount::Points(7), 1.0), Ok(7));
    for amount in [
        Amount::Points(0),
        Amount::Density(1e300),
        Amount::Density(f64::INFINITY),
    ] {
        assert!(count(amount, 1.0).unwrap_err().starts_with("would have "));
    }
}

/// The second moment of e^(−r/2) over a disc of radial index up to the cutoff, integrated over
/// rings.
#[test]
fn a_cut_kernel_has_the_width_of_its_second_moment() {
    for cutoff in [0.5f64, 2.0, 4.0, 11.0] {
        let (mut weight, mut moment) = (0.0, 0.0);
        let rings = 20_000;
        for i in 0..rings {
            let distance = cutoff.sqrt() * (i as f64 + 0.5) / rings as f64;
            let ring = distance * (-0.5 * distance * distance).exp();
            weight += ring;
            moment += ring * distance * distance / 2.0;
        }
        assert!(
            (gaussian::cut(cutoff).powi(2) - moment / weight).abs() < 1e-6,
            "{cutoff}"
        );
    }
    assert_eq!(gaussian::cut(1e4), 1.0);
}

#[test]
fn a_checkerboard_begins_with_white() {
    let Picture::Texture(Texture { image, .. }) = Picture::checkerboard(3) else {
        panic!("a picture is made")
    };
    assert_eq!((image.width, image.height), (2049, 2049));
    let third = 683;
    for (x, y, code) in [
        (0, 0, 255),
        (third - 1, third - 1, 255),
        (third, 0, 0),
        (third, third, 255),
        (2048, 2048, 255),
        (2048, third, 0),
    ] {
        assert_eq!(
            image.texels[y * 2049 + x],
            [code, code, code, 255],
            "{x} {y}"
        );
    }
}
