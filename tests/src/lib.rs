//! Tests across crates and processes. What lives here is what they share.

pub mod architecture;
pub mod bootstrap;
pub mod changed;
pub mod clean;
pub mod feeder;
pub mod folded;
pub mod known_effects;
pub mod mrclam;
pub mod naming;
pub mod page;
pub mod program;
pub mod stage;
pub mod team;
