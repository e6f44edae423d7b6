//! World: converts the grids of medical formats to one coordinate system, whose axes point right,
//! anterior and superior (RAS).
//!
//! RAS is the coordinate system of NIfTI, and it is right-handed. ITK writes NRRD and MetaImage in
//! left-posterior-superior (LPS) coordinates: there x and y are negated. Files without anatomical
//! directions (VTK's files, plain samples) are drawn unchanged.

/// Coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct World {
    /// Its name in sentences.
    pub name: &'static str,
    /// Coordinates that are negated in the conversion.
    negated: [bool; 3],
}

impl World {
    pub const LPS: World = World {
        name: "left-posterior-superior",
        negated: [true, true, false],
    };

    /// Those of NRRD headers, with their short names.
    const OF_NRRD: [(World, &str); 6] = [
        (
            World {
                name: "right-anterior-superior",
                negated: [false; 3],
            },
            "ras",
        ),
        (
            World {
                name: "left-anterior-superior",
                negated: [true, false, false],
            },
            "las",
        ),
        (World::LPS, "lps"),
        (
            World {
                name: "scanner-xyz",
                negated: [false; 3],
            },
            "",
        ),
        (
            World {
                name: "3D-right-handed",
                negated: [false; 3],
            },
            "",
        ),
        // Any one axis may be negated; one must be, or the picture is a mirror image.
        (
            World {
                name: "3D-left-handed",
                negated: [false, false, true],
            },
            "",
        ),
    ];

    /// The coordinate system in `space` of an NRRD header, in any spelling that teem reads, and
    /// whether its vectors have a fourth number, time.
    pub fn of_nrrd(space: &str) -> Option<(World, bool)> {
        let bare = |name: &str| name.to_lowercase().replace(['-', ' '], "");
        let named = bare(space);
        World::OF_NRRD.into_iter().find_map(|(world, short)| {
            let long = bare(world.name);
            let is = |name: &str| name == long || (!short.is_empty() && name == short);
            let timeless = named
                .strip_suffix("time")
                .or_else(|| named.strip_suffix('t').filter(|name| name.len() == 3));
            if is(&named) {
                Some((world, false))
            } else {
                timeless.is_some_and(is).then_some((world, true))
            }
        })
    }

    /// All long names, for a sentence.
    pub fn names() -> String {
        World::OF_NRRD.map(|(world, _)| world.name).join(", ")
    }

    /// Converts a grid to the common coordinate system.
    pub fn turned(&self, axes: [[f64; 3]; 3], origin: [f64; 3]) -> ([[f64; 3]; 3], [f64; 3]) {
        // A difference: zeros keep their sign.
        let turn = |vector: [f64; 3]| {
            [0, 1, 2].map(|i| {
                if self.negated[i] {
                    0.0 - vector[i]
                } else {
                    vector[i]
                }
            })
        };
        (axes.map(turn), turn(origin))
    }

    /// A note on the conversion; None if nothing changed.
    pub fn note(&self) -> Option<String> {
        let names = ["x", "y", "z"]
            .into_iter()
            .zip(self.negated)
            .filter(|(_, negated)| *negated)
            .map(|(name, _)| name);
        let names: Vec<&str> = names.collect();
        let are = if names.len() > 1 { "are" } else { "is" };
        let world = if self.name.starts_with("3D") {
            "nothing is mirrored"
        } else {
            "the world is right-anterior-superior"
        };
        (!names.is_empty()).then(|| {
            format!(
                "coordinates are {}: {} {are} negated, so that {world}",
                self.name,
                names.join(" and ")
            )
        })
    }
}

/// A note for a file without the directions of its axes.
pub(super) fn unoriented(what: &str) -> String {
    format!("{what}: coordinates are drawn as they are, x to the right, y anterior, z superior")
}
