//! Pareto: finds the points that no other point dominates.
//!
//! Law: `the_front_holds_what_nothing_dominates_and_nothing_else`.

/// Indices of the points, given as [cost, worth], on the front: no other point costs no more and is
/// worth no less while being better in one of the two. Sorted by cost; equal points are all
/// included. Points with NaN are excluded.
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|i| points[*i].iter().all(|value| !value.is_nan()))
        .collect();
    // −0 equals 0.
    let order_of = |a: f64, b: f64| (a + 0.0).total_cmp(&(b + 0.0));
    order.sort_by(|a, b| {
        order_of(points[*a][0], points[*b][0])
            .then(order_of(points[*b][1], points[*a][1]))
            .then(a.cmp(b))
    });
    let mut front: Vec<usize> = Vec::new();
    for i in order {
        let is_better = front
            .last()
            .is_none_or(|last| points[i][1] > points[*last][1] || points[i] == points[*last]);
        if is_better {
            front.push(i);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dominates(a: [f64; 2], b: [f64; 2]) -> bool {
        a[0] <= b[0] && a[1] >= b[1] && (a[0] < b[0] || a[1] > b[1])
    }

    proptest! {
        /// Small integers, so that many are equal in one or both.
        #[test]
        fn the_front_holds_what_nothing_dominates_and_nothing_else(points in prop::collection::vec((0i32..12, -6i32..6), 0..60)) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(cost, worth)| [f64::from(cost), f64::from(worth)]).collect();
            let front = front(&points);
            for (i, point) in points.iter().enumerate() {
                let is_beaten = points.iter().any(|other| dominates(*other, *point));
                prop_assert_eq!(front.contains(&i), !is_beaten, "{:?}", point);
            }
            prop_assert!(front.is_sorted_by(|a, b| points[*a][0] <= points[*b][0]));
        }
    }

    #[test]
    fn a_point_with_nan_is_on_no_front() {
        let points = [
            [f64::NAN, 9.0],
            [1.0, f64::NAN],
            [2.0, 3.0],
            [f64::INFINITY, 4.0],
            [0.0, f64::NEG_INFINITY],
            [-0.0, f64::NEG_INFINITY],
        ];
        assert_eq!(front(&points), [4, 5, 2, 3]);
    }
}
