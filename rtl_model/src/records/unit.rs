//! Unit: the names of the units, once: signals, parts, ports and cycles are called by them.

/// World point → camera → pixel.
pub const PROJECT: &str = "project";
/// Normal, radius → conic, box, depth slopes.
pub const ELLIPSE: &str = "ellipse";
/// Spherical harmonics → colour.
pub const COLOUR: &str = "colour";
/// Splats into the order of their depths.
pub const SORT: &str = "sort";
/// Ellipse → fragments.
pub const RASTER: &str = "raster";
/// Radial index → weight.
pub const GAUSS: &str = "gauss";
/// At most l fragments a pixel.
pub const FRAGMENT: &str = "fragment";
/// Normalise and light.
pub const SHADE: &str = "shade";
/// Blend into the frame.
pub const RESOLVE: &str = "resolve";

/// All of them, in the order of the diagram.
pub const ALL: [&str; 9] = [PROJECT, ELLIPSE, COLOUR, SORT, RASTER, GAUSS, FRAGMENT, SHADE, RESOLVE];
