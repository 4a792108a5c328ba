//! The shapes of the bytes: private mirrors of the domain types and the checks on the way back.

pub mod check;
pub mod control;
mod entry;
mod estimate;
mod joint;
pub mod membership;
pub mod sample;
pub mod snapshot;
pub mod status;
pub mod transfer;

pub use entry::WireEntry;
pub use estimate::WireEstimate;
pub use sample::WireSample;
