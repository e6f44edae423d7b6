//! Unit: the names of the units, once: signals, parts, ports and cycles are called by them.

/// Records out of memory, and of a tree those that a view needs.
pub const FETCH: &str = "fetch";
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

/// All of them that have words and ports, in the order of the diagram. Whoever lists units takes them from here.
pub const ALL: [&str; 8] = [PROJECT, ELLIPSE, SORT, RASTER, GAUSS, FRAGMENT, SHADE, RESOLVE];

/// All of them that are built of parts: colour too, and fetch where it walks trees, which have no words yet.
pub const BUILT: [&str; 10] = [FETCH, PROJECT, ELLIPSE, COLOUR, SORT, RASTER, GAUSS, FRAGMENT, SHADE, RESOLVE];

/// All of them behind one thing more: what comes before the first unit.
pub const fn all_after(first: &'static str) -> [&'static str; ALL.len() + 1] {
    let mut all = [first; ALL.len() + 1];
    let mut nth = 0;
    while nth < ALL.len() {
        all[nth + 1] = ALL[nth];
        nth += 1;
    }
    all
}
