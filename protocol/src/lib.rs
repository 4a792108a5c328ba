//! What travels between agents, and under which keys: messages, their bytes, and the checks between
//! the two. Nothing here knows a transport or a file.
//!
//! A [`Message`] is encoded as a version byte, a kind byte and a body. Decoding trusts nothing: sizes are
//! bounded, numbers finite and in range, covariances positive, trailing bytes refused; a refusal names
//! the field and what was found. What has been decoded can be used without a further check of its form;
//! whether it is *true* (who said it, whether it contradicts an earlier entry) is the ledger's business.

mod codec;
mod error;
pub mod keys;
pub mod limits;
mod message;
mod messages;
mod strategy;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
mod wire;

pub use error::{KeyError, ProtocolError};
pub use keys::{Key, Kind, SensorKind, TeamName};
pub use message::{
    Message, decode_checkpoint, decode_entries, decode_sample, encode_checkpoint, encode_entries,
    encode_sample,
};
pub use messages::{
    ClosureStatus, ControlReply, ControlRequest, Estimate, FactCounts, FactsRequest, LogRange, LogStatus,
    SampleCounts, SensorAck, SensorBatch, SnapshotPart, SnapshotRequest, Status,
};
// The names in keys and messages, for crates that must not know estimates.
pub use pleiad_estimation::{RobotId, Timestamp};
