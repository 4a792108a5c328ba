//! Tests across crates and processes. What lives here is what they share.

pub mod architecture;
pub mod team;
