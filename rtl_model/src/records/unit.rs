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
/// Mirror surroundings.
pub const REFLECT: &str = "reflect";
/// Blend into the frame.
pub const RESOLVE: &str = "resolve";

/// All of them that have words and ports, in the order of the diagram. Whoever lists units takes
/// them from here.
pub const ALL: [&str; 8] = [
    PROJECT, ELLIPSE, SORT, RASTER, GAUSS, FRAGMENT, SHADE, RESOLVE,
];

/// All of them that are built of parts: colour too, and fetch where it walks trees, which have no
/// words yet.
pub const BUILT: [&str; 11] = [
    FETCH, PROJECT, ELLIPSE, COLOUR, SORT, RASTER, GAUSS, FRAGMENT, SHADE, REFLECT, RESOLVE,
];

/// All of them that have words: those that have ports, and reflect, which stands in shade and has
/// that one's.
pub const WORDED: [&str; 9] = [
    PROJECT, ELLIPSE, SORT, RASTER, GAUSS, FRAGMENT, SHADE, REFLECT, RESOLVE,
];

/// Some of them behind one thing more: what comes before the first unit.
pub const fn after<const N: usize, const M: usize>(
    first: &'static str,
    units: [&'static str; N],
) -> [&'static str; M] {
    assert!(M == N + 1);
    let mut all = [first; M];
    let mut nth = 0;
    while nth < N {
        all[nth + 1] = units[nth];
        nth += 1;
    }
    all
}
