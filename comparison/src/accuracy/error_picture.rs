//! Error picture: shows |a − b|, enlarged by a power of two so that small errors can be seen.

use super::metrics::difference;
use crate::output::picture::Picture;
use rayon::prelude::*;

/// Greatest scale.
const MOST: f64 = 65536.0;
/// One pixel in this many may exceed what the picture can show, so that a few flips do not darken
/// everything else.
const ONE_CLIPPED_IN: usize = 1000;

/// |a − b| as a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPicture {
    /// Opaque; linear light is `scale · |a − b|`, at most 1.
    pub picture: Picture,
    /// A power of two from 1 to 65536.
    pub scale: f64,
}

/// The error picture of two pictures of the same size. Its scale is the greatest power of two at
/// which at most one pixel in 1000 clips. If fewer pixels differ, it is the greatest at which none
/// clips. It is 1 for equal pictures.
pub fn error_picture(a: &Picture, b: &Picture) -> ErrorPicture {
    let errors: Vec<[f64; 3]> = (0..a.rgba.len())
        .into_par_iter()
        .map(|index| difference(a, b, index))
        .collect();
    let scale = scale(
        errors
            .iter()
            .map(|error| error.iter().copied().fold(0.0, f64::max))
            .collect(),
    );
    let show = |error: &[f64; 3]| {
        let [r, g, b] = error.map(|channel| (scale * channel).min(1.0));
        [r, g, b, 1.0]
    };
    let covered = a
        .covered
        .iter()
        .zip(&b.covered)
        .map(|(a, b)| a | b)
        .collect();
    let rgba = errors.iter().map(show).collect();
    ErrorPicture {
        picture: Picture {
            width: a.width,
            height: a.height,
            rgba,
            covered,
        },
        scale,
    }
}

fn scale(mut worst: Vec<f64>) -> f64 {
    let unclipped = worst.len() - 1 - worst.len() / ONE_CLIPPED_IN;
    let (_, &mut shown, above) = worst.select_nth_unstable_by(unclipped, f64::total_cmp);
    let greatest = above.iter().copied().fold(shown, f64::max);
    let shown = if shown > 0.0 { shown } else { greatest };
    let mut scale = 1.0;
    while shown > 0.0 && scale < MOST && 2.0 * scale * shown <= 1.0 {
        scale *= 2.0;
    }
    scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn black(pixels: usize) -> Picture {
        Picture {
            width: pixels,
            height: 1,
            rgba: vec![[0.0, 0.0, 0.0, 1.0]; pixels],
            covered: vec![false; pixels],
        }
    }

    fn with(mut picture: Picture, first: usize, pixels: usize, error: f64) -> Picture {
        picture.rgba[first..first + pixels].fill([0.0, error, 0.0, 1.0]);
        picture
    }

    #[test]
    fn the_greatest_error_almost_clips() {
        let error = error_picture(&black(10), &with(black(10), 3, 1, 0.03));
        assert_eq!(error.scale, 32.0);
        assert_eq!(
            (error.picture.rgba[3], error.picture.rgba[4]),
            ([0.0, 0.96, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0])
        );
    }

    #[test]
    fn a_few_flips_do_not_darken_the_rest() {
        let few = with(with(black(2000), 0, 2000, 0.001), 0, 2, 0.5);
        assert_eq!(error_picture(&black(2000), &few).scale, 512.0);
        assert_eq!(
            error_picture(&black(2000), &few).picture.rgba[0],
            [0.0, 1.0, 0.0, 1.0]
        );
        let more = with(few, 0, 3, 0.5);
        assert_eq!(error_picture(&black(2000), &more).scale, 2.0);
    }

    #[test]
    fn a_single_difference_does_not_clip() {
        assert_eq!(
            error_picture(&black(2000), &with(black(2000), 7, 1, 0.25)).scale,
            4.0
        );
    }

    #[test]
    fn the_scale_is_limited() {
        assert_eq!(error_picture(&black(5), &black(5)).scale, 1.0);
        assert_eq!(
            error_picture(&black(5), &with(black(5), 0, 1, 1e-12)).scale,
            65536.0
        );
        assert_eq!(
            error_picture(&black(5), &with(black(5), 0, 1, 1.0)).scale,
            1.0
        );
    }
}
