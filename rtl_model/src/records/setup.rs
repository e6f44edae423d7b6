//! Setup's records: the fragments that raster and gauss send on.

/// Fields of `raster.out` and `gauss.out` for one fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weighed {
    /// Index of the splat in the frame.
    pub splat: u32,
    /// r (`raster.radial`), at least 0.
    pub radial: i64,
    /// z, clamped and exact ([`exact_depth`](crate::pipeline::ports::exact_depth)).
    pub depth: i64,
    /// w (`gauss.weight`), can be 0.
    pub weight: i64,
}
