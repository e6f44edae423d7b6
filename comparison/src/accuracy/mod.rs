//! Accuracy: the distance between pictures, the arithmetic that causes it, and bounds on it.

pub mod attribution;
mod error_picture;
pub mod flicker;
mod lockstep;
mod metrics;
pub mod partial;
pub mod proofs;
pub mod ranges;
pub mod screen;

pub use error_picture::{ErrorPicture, error_picture};
pub use lockstep::{
    BoundSummary, CheckedTiles, Flips, KINDS, Lockstep, Summary, lockstep, lockstep_in,
};
pub use metrics::db_text;
pub use metrics::{
    Distance, Fidelity, Metrics, PIXELS_PER_DEGREE, distance, fidelity, is_finite, metrics,
    pixel_error, pixel_errors,
};
