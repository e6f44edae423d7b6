//! Functions: units built from tables that several other units use: reciprocal, square root, any
//! function of one argument, colours over a square.

pub mod map;
pub mod reciprocal;
pub mod square_root;
pub mod table;

pub use map::Map;
pub use reciprocal::Reciprocal;
pub use square_root::ReciprocalRoot;
pub use table::Table;
