//! Light's records: inputs and outputs of shade and resolve.

/// Input port of shade: one fragment's sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShadeInput {
    /// Σw (`fragment.weight_sum`).
    pub weight: i64,
    /// Σw·rgb (`fragment.colour_sum`).
    pub colour: [i64; 3],
    /// Σw·α (`fragment.opacity_sum`).
    pub opacity: i64,
    /// Σw·n (`fragment.normal_sum`).
    pub normal: [i64; 3],
    /// Index into the frame's materials.
    pub material: u32,
    /// Column and row; 0 for a splat that is lit in setup.
    pub pixel: [i64; 2],
}

/// Output port of shade (`shade.premultiplied`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadeOutput {
    /// Colour times opacity.
    pub colour: [i64; 3],
    /// α'.
    pub opacity: i64,
}

/// Input port of resolve: one layer of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layer {
    /// Index of its slot.
    pub slot: usize,
    /// z (`fragment.depth`).
    pub depth: i64,
    /// Σw (`fragment.weight_sum`), 0 if it was merged.
    pub weight: i64,
    /// Whether it was merged, and is therefore shaded already.
    pub merged: bool,
    /// Colour times opacity (`shade.premultiplied`).
    pub colour: [i64; 3],
    /// α' (`shade.premultiplied`).
    pub opacity: i64,
}
