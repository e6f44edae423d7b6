//! Irregular: reads a scalar field at arbitrary positions from VTK XML files: rectilinear grids
//! (`.vtr`), curvilinear ones (`.vts`), and points (`.vtu`, `.vtp`), whose cells are ignored.
//!
//! Samples are those at points. Positions keep the precision of the file.

use super::decode::{Parsed, SampleLayout, clip, number};
use super::vtk::{File, components};
use super::{ByteOrder, SampleType};
use glam::DVec3;

/// A scalar field at arbitrary positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Irregular {
    /// Positions of the samples.
    pub places: SamplePlaces,
    /// The samples, x fastest on a grid; finite, or NaN for a missing sample; at least 1.
    pub values: Vec<f32>,
    /// Notes of the reader for the summary, as in [`super::Volume`].
    pub notes: Vec<String>,
}

/// Positions of samples; all finite.
#[derive(Clone, Debug, PartialEq)]
pub enum SamplePlaces {
    /// Coordinates along x, y and z, each in ascending or descending order: one sample at each
    /// combination.
    Rectilinear([Vec<f64>; 3]),
    /// Samples along each axis of a grid, and the position of each, x fastest.
    Curvilinear([usize; 3], Vec<DVec3>),
    /// Points, and the variance of the kernel of each, if the file has it: xx, yy, zz, xy, yz and
    /// xz, world units².
    Scattered(Vec<DVec3>, Option<Vec<[f64; 6]>>),
}

/// Names of arrays that a scene selects.
#[derive(Clone, Copy, Debug, Default)]
pub struct Arrays<'a> {
    /// The samples; None: those that the file selects, else the first of one component.
    pub values: Option<&'a str>,
    /// Variances of points.
    pub variance: Option<&'a str>,
}

impl Arrays<'_> {
    /// Refuses variances for grids, whose kernels follow from their spacing.
    pub(super) fn without_variance(&self, kind: &str) -> Parsed<()> {
        self.variance.map_or(Ok(()), |_| {
            Err(format!(
                "is a {kind} grid, whose kernels come from its spacing; `variance` is of points"
            ))
        })
    }
}

pub(in crate::scene) fn read_rectilinear(bytes: &[u8], arrays: &Arrays) -> Parsed<Irregular> {
    arrays.without_variance("rectilinear")?;
    let file = File::scan(bytes, "RectilinearGrid")?;
    let (size, _) = file.extent()?;
    // Refuses a grid that is too large before anything is read.
    SampleLayout::new(size, SampleType::U8, ByteOrder::Little, "WholeExtent")?;
    let of_axes: Vec<_> = file.arrays("Coordinates").collect();
    let [x, y, z] = of_axes.as_slice() else {
        return Err(format!(
            "has {} arrays in <Coordinates>; there must be 3",
            of_axes.len()
        ));
    };
    let mut coordinates = [x, y, z].into_iter().zip(size).map(|(array, count)| {
        if components(array) != "1" {
            return Err("has an array in <Coordinates> of more than 1 component".to_string());
        }
        let along = file.places(array, [count, 1, 1], "Coordinates")?;
        let name = clip(array.get("Name").unwrap_or_default());
        let is_ascending = along.windows(2).all(|pair| pair[0] < pair[1])
            || along.windows(2).all(|pair| pair[0] > pair[1]);
        is_ascending.then_some(along).ok_or_else(|| {
            format!("array `{name}`: coordinates must ascend, or descend, from one to the next")
        })
    });
    let mut next = || {
        coordinates
            .next()
            .unwrap_or_else(|| Err("has no coordinates".into()))
    };
    let coordinates = [next()?, next()?, next()?];
    let (array, note) = file.active_array(arrays.values)?;
    let values = file.values(array, size, "WholeExtent")?;
    Ok(Irregular {
        places: SamplePlaces::Rectilinear(coordinates),
        values,
        notes: note.into_iter().collect(),
    })
}

pub(in crate::scene) fn read_curvilinear(bytes: &[u8], arrays: &Arrays) -> Parsed<Irregular> {
    arrays.without_variance("curvilinear")?;
    let file = File::scan(bytes, "StructuredGrid")?;
    let (size, _) = file.extent()?;
    SampleLayout::new(size, SampleType::U8, ByteOrder::Little, "WholeExtent")?;
    let points = read_points(&file, size.iter().product())?;
    let (array, note) = file.active_array(arrays.values)?;
    let values = file.values(array, size, "WholeExtent")?;
    Ok(Irregular {
        places: SamplePlaces::Curvilinear(size, points),
        values,
        notes: note.into_iter().collect(),
    })
}

pub(in crate::scene) fn read_unstructured(bytes: &[u8], arrays: &Arrays) -> Parsed<Irregular> {
    read_scattered(bytes, "UnstructuredGrid", arrays)
}

pub(in crate::scene) fn read_poly_data(bytes: &[u8], arrays: &Arrays) -> Parsed<Irregular> {
    read_scattered(bytes, "PolyData", arrays)
}

fn read_scattered(bytes: &[u8], set: &str, arrays: &Arrays) -> Parsed<Irregular> {
    const FIELD: &str = "NumberOfPoints";
    let file = File::scan(bytes, set)?;
    if file.piece.name.is_empty() {
        return Err("has no <Piece>".into());
    }
    let count: usize = number(file.piece.need(FIELD)?, FIELD, "a whole number")?;
    let size = [count, 1, 1];
    SampleLayout::new(size, SampleType::U8, ByteOrder::Little, FIELD)?;
    let points = read_points(&file, count)?;
    let (array, note) = file.active_array(arrays.values)?;
    let values = file.values(array, size, FIELD)?;
    let variances = arrays
        .variance
        .map(|name| read_variances(&file, name, count))
        .transpose()?;
    Ok(Irregular {
        places: SamplePlaces::Scattered(points, variances),
        values,
        notes: note.into_iter().collect(),
    })
}

fn read_points(file: &File, count: usize) -> Parsed<Vec<DVec3>> {
    let array = file
        .arrays("Points")
        .next()
        .ok_or("has no <DataArray> in <Points>")?;
    if components(array) != "3" {
        return Err(format!(
            "`NumberOfComponents` of <Points> is `{}`; points have 3",
            clip(components(array))
        ));
    }
    let places = file.places(array, [3, count, 1], "Points")?;
    Ok(places
        .as_chunks()
        .0
        .iter()
        .copied()
        .map(DVec3::from_array)
        .collect())
}

/// Variances of 1 component (the same in all directions), 3 (along x, y and z) or 6 (xx, yy, zz,
/// xy, yz, xz, in VTK's order of a symmetric tensor).
fn read_variances(file: &File, name: &str, count: usize) -> Parsed<Vec<[f64; 6]>> {
    let array = file.named_array(name)?;
    let each = match components(array) {
        "1" => 1,
        "3" => 3,
        "6" => 6,
        other => {
            let right = "a variance has 1 (the same in all directions), 3 (along x, y, z) or 6 (xx, yy, zz, xy, yz, xz)";
            return Err(format!(
                "array `{}`: `NumberOfComponents` is `{}`; {right}",
                clip(name),
                clip(other)
            ));
        }
    };
    let all = file.places(array, [each, count, 1], "variance")?;
    let variance = |own: &[f64]| match *own {
        [all] => [all, all, all, 0.0, 0.0, 0.0],
        [x, y, z] => [x, y, z, 0.0, 0.0, 0.0],
        _ => std::array::from_fn(|i| own[i]),
    };
    let variances: Vec<[f64; 6]> = all.chunks_exact(each).map(variance).collect();
    match variances.iter().position(|variance| !is_positive(variance)) {
        None => Ok(variances),
        Some(i) => Err(format!(
            "array `{}`: the variance of point {i} is {:?}; every variance must be above 0 in all directions",
            clip(name),
            &all[i * each..][..each]
        )),
    }
}

/// Whether a symmetric matrix, scaled to about 1, is positive definite, by its leading minors.
fn is_positive(&[xx, yy, zz, xy, yz, xz]: &[f64; 6]) -> bool {
    let largest = xx.max(yy).max(zz);
    if largest.is_nan() || largest < f64::MIN_POSITIVE {
        return false;
    }
    let [xx, yy, zz, xy, yz, xz] = [xx, yy, zz, xy, yz, xz].map(|entry| entry / largest);
    let minor = xx * yy - xy * xy;
    let determinant = zz * minor - xx * yz * yz + 2.0 * xy * yz * xz - yy * xz * xz;
    xx > 0.0 && minor > 0.0 && determinant > 0.0
}

#[cfg(test)]
mod tests;
