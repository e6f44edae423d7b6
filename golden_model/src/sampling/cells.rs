//! Cells: finds all points within a distance, by cubes of that width.

use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Points by the cube that contains them.
pub(super) struct Cells {
    width: f64,
    /// Indices of points; those of a cube are contiguous and in ascending order.
    order: Vec<u32>,
    of_cube: HashMap<[i64; 3], Range<usize>>,
}

impl Cells {
    /// Cells for distances up to `width`, above 0.
    pub fn new(points: &[DVec3], width: f64) -> Self {
        let cubes: Vec<[i64; 3]> = points.par_iter().map(|&point| cube(point, width)).collect();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.par_sort_unstable_by_key(|&i| (cubes[i as usize], i));
        let mut of_cube = HashMap::new();
        let mut start = 0;
        for cell in order.chunk_by(|&i, &j| cubes[i as usize] == cubes[j as usize]) {
            of_cube.insert(cubes[cell[0] as usize], start..start + cell.len());
            start += cell.len();
        }
        Cells {
            width,
            order,
            of_cube,
        }
    }

    /// Calls `each` for every point of the 27 cubes around a position, in an order that depends
    /// only on the points.
    pub fn around(&self, place: DVec3, mut each: impl FnMut(usize)) {
        let [x, y, z] = cube(place, self.width);
        for (i, j, k) in (0..27).map(|n| (n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1)) {
            if let Some(cell) = self.of_cube.get(&[x + i, y + j, z + k]) {
                self.order[cell.clone()]
                    .iter()
                    .for_each(|&point| each(point as usize));
            }
        }
    }
}

fn cube(place: DVec3, width: f64) -> [i64; 3] {
    (place / width).floor().to_array().map(|c| c as i64)
}
