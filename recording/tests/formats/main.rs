//! The forms of a recording, read and written on small folders.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;
mod folder;
mod mrclam;
mod round_trip;
