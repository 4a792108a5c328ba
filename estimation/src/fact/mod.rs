//! Facts: immutable entries of gap-free logs, one log per (robot, boot). The estimate of the team is a
//! pure function of the set of entries; see `docs/theory.md`.

mod calibration;
mod entry;
mod fingerprint;
mod seal;

pub use calibration::{Calibration, Sensitivity, extension_of_boot, extension_of_state, read_extension};
pub use entry::{
    Absolute, Answer, Body, Boot, ClockMap, Continuation, Entry, EntryId, Half, LogId, Noise, NoiseRef,
    NominalState, Observation, Profile, Quantity, VoidReason,
};
pub use fingerprint::Fingerprint;
pub use seal::{Ballot, Seal, SealedLog, Vote, WHOLE, length_of};
