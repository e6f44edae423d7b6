//! Project: checked against f64, whose own error is below 2⁻⁴⁰.

use super::*;
use crate::frame::Aspect;
use crate::num::Word;
use crate::probe::{NoProbe, Tap};
use proptest::prelude::*;

fn quantised(word: Word, value: f64) -> i64 {
    let format = word.format;
    ((value * f64::from(format.frac_bits).exp2()).round() as i64).clamp(format.min(), format.max())
}

/// A view from `eye` turned by `angle` about the vertical.
fn view(machine: &Machine, eye: [f64; 3], angle: f64, focal: [f64; 2], centre: [f64; 2]) -> View {
    let (sin, cos) = angle.sin_cos();
    let p = &machine.project;
    View {
        rotation: [[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]]
            .map(|row| row.map(|x| quantised(p.rotation, x))),
        eye: eye.map(|x| quantised(p.eye, x)),
        near: 1,
        guard: [quantised(p.slope, 1.0); 2],
        centre: centre.map(|off| quantised(p.pixel, off)),
        aspect: Some(Aspect {
            focal: focal.map(|focal| quantised(p.focal, focal)),
            ..Aspect::default()
        }),
        ..View::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// ulp(x) is the ulp of word x. t is relative to a power of two that puts its largest part in
    /// [½, 1) before the rotation. `relative` is truncated by up to one ulp; three such errors are
    /// multiplied by matrix elements of at most 1. `camera` is rounded by half an ulp.
    /// a = t_x/t_z has the errors of both parts over t_z, the reciprocal's relative error, and half
    /// an ulp of `slope`. `pixel` has s times that, and half an ulp of its own.
    #[test]
    fn a_projected_point_is_within_its_ulps(
        name in prop::sample::select(Machine::NAMES.to_vec()),
        position in prop::array::uniform3(-0.45..0.45), eye in prop::array::uniform3(-1.0..1.0), angle in -3.0..3.0,
        focal in prop::array::uniform2(100.0..1000.0), centre in prop::array::uniform2(-100.0..100.0),
    ) {
        let machine = Machine::named(name).unwrap();
        let unit = machine.elaborate().unwrap().project;
        let p = &machine.project;
        let view = view(&machine, eye, angle, focal, centre);
        let words: [i64; 3] = position.map(|x| quantised(machine.splat.position, x));
        let inputs: Vec<i64> = words.into_iter().chain([0]).chain(registers(&view)).collect();
        let own = unit.graph().one(&inputs, &mut Tap::new(&mut NoProbe));
        let [x, y, forward, exponent, own_depth, _, _, slope_x, slope_y, pixel_x, pixel_y, near, outside] = own;

        let (near, outside) = (near != 0, outside != 0);
        let relative: [f64; 3] = std::array::from_fn(|i| machine.splat.position.format.value(words[i]) - p.eye.format.value(view.eye[i]));
        let t = view.rotation.map(|row| (0..3).map(|i| p.rotation.format.value(row[i]) * relative[i]).sum::<f64>());
        let place = |word: Word| word.format.value(1);
        let power = (exponent as f64).exp2();
        let of_camera = 2.0 * place(p.relative) + place(p.camera) / 2.0;
        for (axis, exact) in t.into_iter().enumerate() {
            let word = p.camera.format.value([x, y, forward][axis]);
            // The third part is the divisor of the quotients: at least one ulp, and 1 where the splat
            // is culled.
            let culled = axis == 2 && (near || outside);
            prop_assert!(culled || (word - exact / power).abs() <= of_camera, "camera {axis}");
        }
        let depth = p.depth.format.value(own_depth);
        let most = p.depth.format.value(p.depth.format.max());
        prop_assert!((depth - t[2].clamp(0.0, most)).abs() <= of_camera * power + place(p.depth) / 2.0, "depth {depth}, exactly {}", t[2]);
        prop_assert!(!near || t[2] <= place(p.depth) * 1.5 + of_camera * power);
        if !near && !outside && t[2] / power > 8.0 * of_camera {
            let unit = p.reciprocal;
            let table = f64::from((unit.table_bits + 1) * (1 << unit.newton_steps)).exp2().recip();
            let reciprocal = table + 4.0 * f64::from(unit.bits).exp2().recip();
            for axis in 0..2 {
                let exact = t[axis] / t[2];
                let quotient = of_camera * (1.0 + exact.abs()) / (t[2] / power - of_camera);
                let of_slope = quotient + (exact.abs() + quotient) * reciprocal + place(p.slope) / 2.0;
                let slope = p.slope.format.value([slope_x, slope_y][axis]);
                prop_assert!((slope - exact).abs() <= of_slope, "slope {slope}, exactly {exact}, bound {of_slope}");
                prop_assert!(slope.abs() <= 1.0 + of_slope, "beyond the guard band");
                let pixel = p.pixel.format.value([pixel_x, pixel_y][axis]);
                let scale = p.focal.format.value(view.focals()[axis]);
                let exact = scale * exact + p.pixel.format.value(view.centre[axis]);
                prop_assert!((pixel - exact).abs() <= scale * of_slope + place(p.pixel) / 2.0, "pixel {pixel}, exactly {exact}");
            }
        }
    }
}
