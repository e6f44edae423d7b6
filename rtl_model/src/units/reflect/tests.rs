//! Reflect: laws.
