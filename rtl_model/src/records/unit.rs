//! Unit: the names of the units. Signals, parts, ports and cycles use them.

/// Reads records from memory, and only those that a view needs if the scene is a tree.
pub const FETCH: &str = "fetch";
/// World point → camera → pixel.
pub const PROJECT: &str = "project";
/// Normal, radius → conic, box, depth slopes.
pub const ELLIPSE: &str = "ellipse";
/// Spherical harmonics → colour.
pub const COLOUR: &str = "colour";
/// Tests tiles and writes their lists.
pub const BIN: &str = "bin";
/// Reads the lists of tiles, and makes the masks of their entries if `bin` does not.
pub const LIST: &str = "list";
/// Sorts splats by depth.
pub const SORT: &str = "sort";
/// Tests blocks of pixels by r at a few of their pixels.
pub const CONTRIBUTION: &str = "contribution";
/// Ellipse → fragments.
pub const RASTER: &str = "raster";
/// Radial index → weight.
pub const GAUSS: &str = "gauss";
/// At most l fragments per pixel.
pub const FRAGMENT: &str = "fragment";
/// Normalise and light.
pub const SHADE: &str = "shade";
/// Reflect surroundings.
pub const REFLECT: &str = "reflect";
/// Blend into the frame.
pub const RESOLVE: &str = "resolve";

/// All units with words and ports, in the order of the diagram. Every list of units uses this one.
pub const ALL: [&str; 9] = [
    PROJECT, ELLIPSE, COLOUR, SORT, RASTER, GAUSS, FRAGMENT, SHADE, RESOLVE,
];

/// All units with parts. Fetch, where it walks trees, has no words; bin and list use those of
/// raster.
pub const BUILT: [&str; 14] = [
    FETCH,
    PROJECT,
    ELLIPSE,
    COLOUR,
    BIN,
    SORT,
    LIST,
    CONTRIBUTION,
    RASTER,
    GAUSS,
    FRAGMENT,
    SHADE,
    REFLECT,
    RESOLVE,
];

/// All units with words: those with ports; contribution, whose result is a mask; and reflect, which
/// is inside shade and shares its ports.
pub const WORDED: [&str; 11] = [
    PROJECT,
    ELLIPSE,
    COLOUR,
    SORT,
    CONTRIBUTION,
    RASTER,
    GAUSS,
    FRAGMENT,
    SHADE,
    REFLECT,
    RESOLVE,
];

/// `units`, with `first` in front.
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
