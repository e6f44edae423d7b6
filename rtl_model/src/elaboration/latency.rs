//! Latency: cycles of operators, all pipelined. A unit's own is the sum of those on its longest way.

/// A product.
pub const PRODUCT: u32 = 2;
/// A sum.
pub const SUM: u32 = 1;
/// A table's word.
pub const TABLE: u32 = 1;
/// A normalisation: count zeros, shift.
pub const NORMALISE: u32 = 2;
