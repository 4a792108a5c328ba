//! The message bus. This is the one crate that names zenoh; everything else speaks to [`Bus`], which an
//! in-memory network implements as well, so that the same test body runs on both.

mod traits;

pub use traits::{Bus, BusError, Incoming, Liveliness, Query};
