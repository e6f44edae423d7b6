//! Setup's records: what project and ellipse make of a splat, and what raster and gauss make of its
//! fragments.

/// A fragment on its way: what `raster.out` and `gauss.out` carry of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weighed {
    /// Which splat of the frame.
    pub splat: u32,
    /// r (`raster.radial`), at least 0.
    pub radial: i64,
    /// z, clamped and exact ([`exact_depth`](crate::pipeline::ports::exact_depth)).
    pub depth: i64,
    /// w (`gauss.weight`), maybe 0.
    pub weight: i64,
}
