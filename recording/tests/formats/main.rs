//! The forms of a recording, read and written on small folders.

#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

mod bag;
mod bag_refused;
mod common;
mod csv;
mod folder;
mod mcap;
mod mrclam;
mod round_trip;
