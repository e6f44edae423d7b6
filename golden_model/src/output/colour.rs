//! Colour: converts linear light to sRGB code values and back (IEC 61966-2-1), only for files of 8
//! bits.

use std::sync::LazyLock;

/// Code value in [0, 1] → linear light in [0, 1]. Values outside are clamped; NaN stays NaN.
pub fn srgb_decode(code: f64) -> f64 {
    let code = code.clamp(0.0, 1.0);
    if code <= 0.04045 {
        code / 12.92
    } else {
        libm::pow((code + 0.055) / 1.055, 2.4)
    }
}

/// Linear light in [0, 1] → code value in [0, 1]. Values outside are clamped; NaN stays NaN.
pub fn srgb_encode(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 {
        linear * 12.92
    } else {
        1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
    }
}

/// Linear light → code value of 8 bits: [`srgb_encode`] times 255, rounded. Values outside are
/// clamped; NaN becomes 0.
pub fn srgb_byte(linear: f64) -> u8 {
    // The function is monotonic, so the start of each code is computed once: a look-up takes a
    // tenth of the time of a power.
    static FIRST: LazyLock<[f64; 255]> =
        LazyLock::new(|| std::array::from_fn(|code| first_above(code as u8)));
    FIRST.partition_point(|first| *first <= linear) as u8
}

fn rounded(linear: f64) -> u8 {
    (255.0 * srgb_encode(linear)).round() as u8
}

/// The least light with a code above this one, which is not the greatest: floats from 0 on are
/// ordered like their bits.
fn first_above(code: u8) -> f64 {
    let (mut below, mut above) = (0, 1f64.to_bits());
    while above - below > 1 {
        let middle = below.midpoint(above);
        *(if rounded(f64::from_bits(middle)) > code {
            &mut above
        } else {
            &mut below
        }) = middle;
    }
    f64::from_bits(above)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each code's own light, values around the starts of codes, and many in between.
    #[test]
    fn a_code_of_8_bits_is_the_rounded_one() {
        let around = |code: u8| {
            (-3..=3).map(move |places: i64| {
                f64::from_bits(first_above(code).to_bits().wrapping_add_signed(places))
            })
        };
        let light = (0..=254)
            .flat_map(around)
            .chain((0..=100_000).map(|n| f64::from(n) / 100_000.0));
        let odd = [
            -1.0,
            -0.0,
            2.0,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            f64::MIN_POSITIVE,
            0.0031308,
        ];
        for linear in light.chain(odd) {
            assert_eq!(srgb_byte(linear), rounded(linear), "{linear:e}");
        }
        assert_eq!(
            (0..=255)
                .map(|code| srgb_byte(srgb_decode(f64::from(code) / 255.0)))
                .collect::<Vec<_>>(),
            (0..=255).collect::<Vec<_>>()
        );
    }

    #[test]
    fn every_8_bit_code_survives_decoding_and_encoding() {
        for code in 0..=255 {
            let back = srgb_encode(srgb_decode(code as f64 / 255.0)) * 255.0;
            assert!((back - code as f64).abs() < 1e-4, "{code} became {back}");
        }
    }

    #[test]
    fn middle_grey_equals_that_of_the_standard() {
        assert!((srgb_decode(0.5) - 0.214_041_14).abs() < 1e-8);
        assert_eq!((srgb_decode(-1.0), srgb_decode(2.0)), (0.0, 1.0));
        assert_eq!(srgb_encode(-1.0), 0.0);
        assert!((srgb_encode(2.0) - 1.0).abs() < 1e-15);
    }
}
