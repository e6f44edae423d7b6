//! Vti: reads a volume from a VTK XML image file: the array of `PointData` that its `Scalars` attribute names, else the first of one
//! component.

use super::Volume;
use super::decode::{Parsed, check_grid, numbers, positive, triple};
use super::vtk::{File, Tag};

pub(in crate::scene) fn read(bytes: &[u8]) -> Parsed<Volume> {
    let file = File::scan(bytes, "ImageData")?;
    let (size, first) = file.extent()?;
    let (axes, origin) = read_grid(&file.set, first)?;
    let values = file.values(file.active_array(None)?, size, "WholeExtent")?;
    Ok(Volume { size, axes, origin, values })
}

/// Axes, and position of the sample whose index is `first`: the origin is where index 0 is.
fn read_grid(image: &Tag, first: [f64; 3]) -> Parsed<([[f64; 3]; 3], [f64; 3])> {
    let spacing = image.get("Spacing").map_or(Ok([1.0; 3]), |text| triple(text, "Spacing"))?;
    positive(spacing, "Spacing")?;
    let origin = image.get("Origin").map_or(Ok([0.0; 3]), |text| triple::<f64>(text, "Origin"))?;
    let direction: Vec<f64> = numbers(image.get("Direction").unwrap_or("1 0 0 0 1 0 0 0 1"), 9, "Direction")?;
    let axes = [0, 1, 2].map(|i| [0, 1, 2].map(|row| direction[3 * row + i] * spacing[i]));
    let origin = [0, 1, 2].map(|row| origin[row] + (0..3).map(|i| first[i] * axes[i][row]).sum::<f64>());
    check_grid(&axes, if image.get("Direction").is_some() { "Direction" } else { "Spacing" }, &origin, "Origin")?;
    Ok((axes, origin))
}
