use super::*;
use proptest::prelude::*;

fn covariance(steps: DMat3) -> DMat3 {
    steps * steps.transpose()
}

/// Largest difference of two matrices' entries.
fn apart(a: DMat3, b: DMat3) -> f64 {
    (a - b)
        .to_cols_array()
        .iter()
        .fold(0.0_f64, |most, entry| most.max(entry.abs()))
}

prop_compose! {
    fn vector()(x in -1.0_f64..1.0, y in -1.0_f64..1.0, z in -1.0_f64..1.0) -> DVec3 {
        DVec3::new(x, y, z)
    }
}

proptest! {
    /// The axes are a rotation, and with their squared lengths give J·Jᵀ; the volume is |det J|. At
    /// any scale.
    #[test]
    fn principal_axes_span_what_the_steps_span(x in vector(), y in vector(), z in vector(), power in -90_i32..90, thin in 0_i32..9) {
        let steps = DMat3::from_cols(x, y, z * 10.0_f64.powi(-thin));
        let scale = 10.0_f64.powi(power);
        let cell = Cell::new(steps * scale);
        prop_assume!(cell.has_volume());
        let axes = DMat3::from_quat(DQuat::from_mat3(&cell.axes));
        prop_assert!(apart(axes, cell.axes) < 1e-12 && (cell.axes.determinant() - 1.0).abs() < 1e-12);
        let lengths = cell.lengths / scale;
        let again = axes * DMat3::from_diagonal(lengths * lengths) * axes.transpose();
        prop_assert!(apart(again, covariance(steps)) < 1e-12);
        // Both have rounding errors relative to the box with these sides: if the steps are almost
        // in a plane, that is much more than the volume.
        let (volume, sides) = (steps.determinant().abs(), x.length() * y.length() * steps.z_axis.length());
        prop_assert!((cell.volume() / scale.powi(3) - volume).abs() <= 1e-14 * sides, "{volume:e} of {sides:e}");
    }

    #[test]
    fn a_variance_has_its_root(x in vector(), y in vector(), z in vector()) {
        let v = covariance(DMat3::from_cols(x, y, z)) + DMat3::from_diagonal(DVec3::splat(1e-3));
        let root = root([v.x_axis.x, v.y_axis.y, v.z_axis.z, v.x_axis.y, v.y_axis.z, v.x_axis.z]);
        prop_assert!(apart(covariance(root), v) < 1e-12);
    }
}

#[test]
fn steps_that_a_grid_lacks_are_at_right_angles() {
    let (x, y) = (DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 2.0, 0.0));
    let plane = completed([Some(x), None, Some(y)], 1.0);
    assert!(plane.y_axis.dot(x).abs() < 1e-12 && plane.y_axis.dot(y).abs() < 1e-12);
    assert!((plane.y_axis.length_squared() - 3.0 * 5.0_f64.sqrt()).abs() < 1e-12);
    let line = Cell::new(completed([None, Some(x), None], 1.0));
    assert!((line.volume() - 27.0).abs() < 1e-12, "{line:?}");
    assert!((Cell::new(completed([None; 3], 2.0)).volume() - 8.0).abs() < 1e-12);
}

#[test]
fn steps_in_a_plane_have_no_volume() {
    for steps in [
        DMat3::ZERO,
        DMat3::from_cols(DVec3::X, DVec3::ZERO, DVec3::Z),
        DMat3::from_diagonal(DVec3::new(1e-200, 1e-200, 0.0)),
    ] {
        assert!(!Cell::new(steps).has_volume(), "{steps}");
    }
    let field = Irregular {
        places: SamplePlaces::Curvilinear(
            [2, 2, 2],
            (0..8)
                .map(|i| DVec3::new(f64::from(i % 2), f64::from(i / 2 % 2), 0.0))
                .collect(),
        ),
        values: vec![1.0; 8],
        notes: Vec::new(),
    };
    let cells = Cells::new(&field, 0.7);
    assert_eq!(cells.default_layer(), None);
    let transfer = Classification::usual(&[0.0, 1.0], 4.0);
    let classification = Classification {
        transfer,
        gradient: Vec::new(),
        radius: 0.7,
        material: 0,
    };
    let (sampled, flat) = cells.samples(&classification, 1.0);
    assert_eq!((sampled.splats.len(), flat), (0, 8));
}

/// A linear field has its gradient everywhere: on a sheared grid, and at random points.
#[test]
fn a_linear_field_has_its_gradient() {
    let slope = DVec3::new(2.0, -1.0, 0.5);
    let size = [5, 4, 3];
    let at = |i: usize| [i % 5, i / 5 % 4, i / 20].map(|index| index as f64);
    let sheared = |i: usize| {
        let [x, y, z] = at(i);
        DVec3::new(x + 0.4 * y, 0.5 * y - 0.2 * z, 2.0 * z + 0.3 * x)
    };
    let wobbly = |i: usize| {
        let [x, y, z] = at(i);
        let wobble = |k: f64| 0.3 * libm::sin(k * i as f64);
        DVec3::new(x + wobble(12.9), y + wobble(78.2), z + wobble(37.7))
    };
    let of = |places: SamplePlaces, position: &dyn Fn(usize) -> DVec3| {
        let values = (0..60).map(|i| slope.dot(position(i)) as f32).collect();
        Irregular {
            places,
            values,
            notes: Vec::new(),
        }
    };
    // Also next to a NaN sample at a corner: the others keep a neighbour along each axis.
    let hole = |field: Irregular| {
        let values = field
            .values
            .iter()
            .enumerate()
            .map(|(i, value)| if i == 0 { f32::NAN } else { *value })
            .collect();
        Irregular { values, ..field }
    };
    let fields = [
        of(
            SamplePlaces::Curvilinear(size, (0..60).map(sheared).collect()),
            &sheared,
        ),
        of(
            SamplePlaces::Scattered((0..60).map(wobbly).collect(), None),
            &wobbly,
        ),
    ];
    for field in fields.clone().into_iter().chain(fields.map(hole)) {
        let cells = Cells::new(&field, 0.7);
        for index in (0..60).filter(|index| !field.values[*index].is_nan()) {
            let gradient = cells.gradient(index, &cells.cell(index));
            assert!((gradient - slope).length() < 1e-5, "{index}: {gradient}");
        }
    }
}
