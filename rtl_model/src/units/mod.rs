//! Units: the blocks of the diagram, in its order. One file per block: ports, formats, losses,
//! function, laws.

pub mod bin;
pub mod colour;
pub mod contribution;
pub mod ellipse;
pub mod fragment;
pub mod gauss;
pub mod project;
pub mod raster;
pub mod resolve;
pub mod shade;
