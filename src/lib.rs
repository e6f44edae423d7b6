//! splatsim: the bench around the machine (`rtl_model`) and the exact renderers (`golden_model`). It
//! converts scenes into words, compares pictures, counts cycles, and has the command line.
//!
//! ```
//! use splatsim::hardware::machines;
//! use splatsim::run::{self, Options};
//! use splatsim::scene::{Overrides, Scene};
//! use std::path::Path;
//!
//! let text = r#"{"splats": [{"position": [0, 0, 0], "normal": [0, 0, 1], "radius": 1}]}"#;
//! let scene = Scene::from_text(text, "one splat", Path::new(""), &Overrides { size: Some((16, 16)) }, 0)?;
//! let machine = machines::load("tiny", &["gauss.weight=U0F10".into()])?;
//! let outcome = run::run(&scene, &machine, 0.0, &Options::default())?;
//! assert_eq!(outcome.fixed.rgba.len(), 16 * 16);
//! # Ok::<(), splatsim::error::Error>(())
//! ```
//!
//! From top to bottom; each layer names only those below it (`tests/layering.rs`).

pub mod cli;

pub mod view;

pub mod explore;

pub mod run;

pub mod cosim;

pub mod performance;

#[doc(inline)]
pub use comparison::{accuracy, hardware};
#[doc(inline)]
pub use golden_model::{error, golden, input, output, sampling, scene};
