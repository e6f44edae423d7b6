//! Words: the port records of traces and RTL implementations, each declared once with its fields by
//! name, in their order.
//!
//! A record of words and its layout in the stream are the same declaration with another `T`, so a
//! missing field does not compile.

/// Declares a record.
macro_rules! record {
    ($(#[$doc:meta])* $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[allow(missing_docs, reason = "a field's name is that of the port's wire")]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name<T = i64> {
            $(pub $field: T),*
        }

        impl $name {
            /// Names of its fields, from the most significant bits down.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];
            /// Number of words.
            pub const WORDS: usize = Self::NAMES.len();
        }

        impl<T> $name<T> {
            /// From its fields in their order.
            pub fn from_words([$($field),*]: [T; <$name>::WORDS]) -> Self {
                $name { $($field),* }
            }

            /// Its fields in their order.
            pub fn into_words(self) -> [T; <$name>::WORDS] {
                [$(self.$field),*]
            }

            /// Applies `of` to each field.
            pub fn map<U>(self, mut of: impl FnMut(T) -> U) -> $name<U> {
                $name { $($field: of(self.$field)),* }
            }
        }
    };
}

record! {
    /// `project.out`; for discs without [`TRANSPARENT`].
    ProjectOut {
        near, outside, transparent,
        forward, exponent, depth, inverse_depth, inverse_depth_exponent, slope_x, slope_y, pixel_x, pixel_y,
    }
}

record! {
    /// `ellipse.in` of a disc.
    DiscIn {
        normal_x, normal_y, normal_z, radius,
        forward, exponent, inverse_depth, inverse_depth_exponent, slope_x, slope_y, pixel_x, pixel_y,
    }
}

record! {
    /// `ellipse.in` of an ellipsoid.
    EllipsoidIn {
        normal_x, normal_y, normal_z, radius,
        quaternion_w, quaternion_x, quaternion_y, quaternion_z, scale_0, scale_1, scale_2, opacity,
        forward, exponent, inverse_depth, inverse_depth_exponent, slope_x, slope_y, pixel_x, pixel_y,
    }
}

record! {
    /// `ellipse.out`.
    EllipseOut {
        backface, faint, outside, normal_x, normal_y, normal_z, conic_xx, conic_xy, conic_yy, amplitude,
        first_column, last_column, first_row, last_row, depth_slope_x, depth_slope_y, depth_range,
    }
}

record! {
    /// `raster.in`, after its tag.
    RasterIn {
        pixel_x, pixel_y, conic_xx, conic_xy, conic_yy, depth, depth_slope_x, depth_slope_y, depth_range,
        first_column, last_column, first_row, last_row,
    }
}

record! {
    /// `raster.out`, after its tag.
    RasterOut { x, y, radial, depth }
}

record! {
    /// `gauss.in`.
    GaussIn { radial, amplitude }
}

record! {
    /// `fragment.in` where fragments are grouped by depth.
    FragmentIn { x, y, weight, depth, red, green, blue, opacity, normal_x, normal_y, normal_z, material }
}

record! {
    /// `fragment.in` where fragments are grouped by intervals or windows.
    WindowIn {
        x, y, weight, depth, red, green, blue, opacity, normal_x, normal_y, normal_z, material, light_r, light_g, light_b, density,
    }
}

record! {
    /// `fragment.in` where fragments are grouped by sheets.
    SheetIn { x, y, weight, sheet, red, green, blue }
}

/// Words of a record of `project.out`.
pub const PROJECTED: usize = ProjectOut::WORDS;
/// Flags of `project.out`, the first words of a record.
pub const PROJECT_FLAGS: usize = 3;
/// Index of the flag `transparent`, which discs do not have.
pub const TRANSPARENT: usize = 2;
/// Words of a record of `ellipse.out`.
pub const SET_UP: usize = EllipseOut::WORDS;
