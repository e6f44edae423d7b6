//! Colour: turns linear light into sRGB code values and back (IEC 61966-2-1), for 8-bit files and nothing else.

/// Code value in [0, 1] → linear light in [0, 1]. Values outside are clamped; NaN stays NaN.
pub fn srgb_decode(code: f64) -> f64 {
    let code = code.clamp(0.0, 1.0);
    if code <= 0.04045 { code / 12.92 } else { libm::pow((code + 0.055) / 1.055, 2.4) }
}

/// Linear light in [0, 1] → code value in [0, 1]. Values outside are clamped; NaN stays NaN.
pub fn srgb_encode(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_8_bit_code_survives_decoding_and_encoding() {
        for code in 0..=255 {
            let back = srgb_encode(srgb_decode(code as f64 / 255.0)) * 255.0;
            assert!((back - code as f64).abs() < 1e-4, "{code} became {back}");
        }
    }

    #[test]
    fn middle_grey_is_what_the_standard_says() {
        assert!((srgb_decode(0.5) - 0.214_041_14).abs() < 1e-8);
        assert_eq!((srgb_decode(-1.0), srgb_decode(2.0)), (0.0, 1.0));
        assert_eq!(srgb_encode(-1.0), 0.0);
        assert!((srgb_encode(2.0) - 1.0).abs() < 1e-15);
    }
}
