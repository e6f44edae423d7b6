//! Vti: reads a volume from a VTK XML image file: the array of `PointData` that a scene or its own
//! `Scalars` attribute selects, else the first of one component.

use super::decode::{Parsed, check_grid, numbers, positive, triple};
use super::vtk::{File, Tag};
use super::{Arrays, Volume};

pub(in crate::scene) fn read(bytes: &[u8], arrays: &Arrays) -> Parsed<Volume> {
    arrays.without_variance("regular")?;
    let file = File::scan(bytes, "ImageData")?;
    let (size, first) = file.extent()?;
    let (axes, origin) = read_grid(&file.set, first)?;
    let (array, note) = file.active_array(arrays.values)?;
    let values = file.values(array, size, "WholeExtent")?;
    Ok(Volume {
        size,
        axes,
        origin,
        values,
        notes: note.into_iter().collect(),
    })
}

/// Axes, and the position of the sample with index `first`: index 0 is at the origin.
fn read_grid(image: &Tag, first: [f64; 3]) -> Parsed<([[f64; 3]; 3], [f64; 3])> {
    let spacing = image
        .get("Spacing")
        .map_or(Ok([1.0; 3]), |text| triple(text, "Spacing"))?;
    positive(spacing, "Spacing")?;
    let origin = image
        .get("Origin")
        .map_or(Ok([0.0; 3]), |text| triple::<f64>(text, "Origin"))?;
    let direction: Vec<f64> = numbers(
        image.get("Direction").unwrap_or("1 0 0 0 1 0 0 0 1"),
        9,
        "Direction",
    )?;
    let axes = [0, 1, 2].map(|i| [0, 1, 2].map(|row| direction[3 * row + i] * spacing[i]));
    let origin =
        [0, 1, 2].map(|row| origin[row] + (0..3).map(|i| first[i] * axes[i][row]).sum::<f64>());
    check_grid(
        &axes,
        if image.get("Direction").is_some() {
            "Direction"
        } else {
            "Spacing"
        },
        &origin,
        "Origin",
    )?;
    Ok((axes, origin))
}
