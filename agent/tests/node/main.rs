//! The node as a pure state machine: events in, commands and state out. One file per property.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests are tests")]

#[path = "../support/mod.rs"]
mod support;

mod anti_entropy;
mod boots;
mod clocks;
mod closing;
mod dead_reckoning;
mod exactness;
mod gaps;
mod halves;
mod lost_journal;
mod models;
mod observations;
mod recovery;
