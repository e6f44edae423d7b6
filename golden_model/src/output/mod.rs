//! Output: pictures, charts, text and files.

pub mod chart;
pub mod colour;
pub mod files;
pub mod picture;
pub mod progress;
pub mod text;
pub mod video;
