//! All messages, and the way from bytes and to bytes.

use pleiad_estimation::fact::Entry;
use pleiad_estimation::ledger::Checkpoint;
use pleiad_estimation::sample::Sample;

use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::messages::{
    ControlReply, ControlRequest, Estimate, FactsRequest, SensorAck, SensorBatch, SnapshotPart,
    SnapshotRequest, Status,
};
use crate::wire::{WireEntry, WireEstimate, WireSample};
use crate::wire::{control, snapshot, status, transfer};

/// Anything that travels.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Entries of logs: published as they are made, and the answer to a request for facts.
    Entries(Vec<Entry>),
    /// What an agent holds and does.
    Status(Status),
    /// Asks for what is missing.
    FactsRequest(FactsRequest),
    /// A robot's estimate of itself.
    Estimate(Estimate),
    /// A single sample.
    Sample(Sample),
    /// Samples to be acknowledged.
    SensorBatch(SensorBatch),
    /// The answer to them.
    SensorAck(SensorAck),
    /// Asked of an agent's process.
    ControlRequest(ControlRequest),
    /// Its answer.
    ControlReply(ControlReply),
    /// Asks for a snapshot.
    SnapshotRequest(SnapshotRequest),
    /// A part of one.
    SnapshotPart(SnapshotPart),
}

/// The second byte of a message. Numbers are never reused.
mod kind {
    pub const ENTRIES: u8 = 1;
    pub const STATUS: u8 = 2;
    pub const FACTS_REQUEST: u8 = 3;
    pub const ESTIMATE: u8 = 4;
    pub const SAMPLE: u8 = 5;
    pub const SENSOR_BATCH: u8 = 6;
    pub const SENSOR_ACK: u8 = 7;
    pub const CONTROL_REQUEST: u8 = 8;
    pub const CONTROL_REPLY: u8 = 9;
    pub const SNAPSHOT_REQUEST: u8 = 20;
    pub const SNAPSHOT_PART: u8 = 21;
}

impl Message {
    /// The message in bytes. What is beyond [`limits`] is encoded too, and refused by every receiver;
    /// only texts are cut.
    pub fn encode(&self) -> Vec<u8> {
        match self {
            Self::Entries(entries) => encode_entries(entries),
            Self::Status(status) => {
                let mut bytes = begin(kind::STATUS);
                status::put_status(&mut bytes, status);
                bytes
            }
            Self::FactsRequest(request) => {
                let mut bytes = begin(kind::FACTS_REQUEST);
                transfer::put_request(&mut bytes, request);
                bytes
            }
            Self::Estimate(estimate) => {
                let mut bytes = begin(kind::ESTIMATE);
                codec::put(&mut bytes, &WireEstimate::from(estimate));
                bytes
            }
            Self::Sample(sample) => encode_sample(sample),
            Self::SensorBatch(batch) => {
                let mut bytes = begin(kind::SENSOR_BATCH);
                transfer::put_batch(&mut bytes, batch);
                bytes
            }
            Self::SensorAck(ack) => {
                let mut bytes = begin(kind::SENSOR_ACK);
                transfer::put_ack(&mut bytes, ack);
                bytes
            }
            Self::ControlRequest(request) => {
                let mut bytes = begin(kind::CONTROL_REQUEST);
                control::put_request(&mut bytes, *request);
                bytes
            }
            Self::ControlReply(reply) => {
                let mut bytes = begin(kind::CONTROL_REPLY);
                control::put_reply(&mut bytes, reply);
                bytes
            }
            Self::SnapshotRequest(request) => {
                let mut bytes = begin(kind::SNAPSHOT_REQUEST);
                snapshot::put_request(&mut bytes, *request);
                bytes
            }
            Self::SnapshotPart(part) => {
                let mut bytes = begin(kind::SNAPSHOT_PART);
                snapshot::put_part(&mut bytes, part);
                bytes
            }
        }
    }

    /// The message in `bytes`, checked.
    ///
    /// # Errors
    /// Whatever is wrong with it first, named.
    pub fn decode(bytes: &[u8]) -> Result<Self, ProtocolError> {
        if bytes.len() > limits::MESSAGE_BYTES {
            return Err(ProtocolError::TooLong { bytes: bytes.len(), limit: limits::MESSAGE_BYTES });
        }
        let &[version, kind, ref body @ ..] = bytes else {
            return Err(ProtocolError::TooShort { bytes: bytes.len() });
        };
        if version != limits::VERSION {
            return Err(ProtocolError::Version { found: version });
        }
        let mut reader = Reader::new(body);
        let message = match kind {
            kind::ENTRIES => Self::Entries(reader.list::<WireEntry, _>("entries", limits::ENTRIES)?),
            kind::STATUS => Self::Status(status::take_status(&mut reader)?),
            kind::FACTS_REQUEST => Self::FactsRequest(transfer::take_request(&mut reader)?),
            kind::ESTIMATE => Self::Estimate(reader.take::<WireEstimate>("estimate")?.try_into()?),
            kind::SAMPLE => Self::Sample(reader.take::<WireSample>("sample")?.try_into()?),
            kind::SENSOR_BATCH => Self::SensorBatch(transfer::take_batch(&mut reader)?),
            kind::SENSOR_ACK => Self::SensorAck(transfer::take_ack(&mut reader)?),
            kind::CONTROL_REQUEST => Self::ControlRequest(control::take_request(&mut reader)?),
            kind::CONTROL_REPLY => Self::ControlReply(control::take_reply(&mut reader)?),
            kind::SNAPSHOT_REQUEST => Self::SnapshotRequest(snapshot::take_request(&mut reader)?),
            kind::SNAPSHOT_PART => Self::SnapshotPart(snapshot::take_part(&mut reader)?),
            found => return Err(ProtocolError::Kind { found }),
        };
        reader.end()?;
        Ok(message)
    }

    /// Its kind in words.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Entries(_) => "entries",
            Self::Status(_) => "status",
            Self::FactsRequest(_) => "facts request",
            Self::Estimate(_) => "estimate",
            Self::Sample(_) => "sample",
            Self::SensorBatch(_) => "sensor batch",
            Self::SensorAck(_) => "sensor ack",
            Self::ControlRequest(_) => "control request",
            Self::ControlReply(_) => "control reply",
            Self::SnapshotRequest(_) => "snapshot request",
            Self::SnapshotPart(_) => "snapshot part",
        }
    }
}

/// A message of entries; at most [`limits::ENTRIES`], longer lists are sent in chunks.
pub fn encode_entries(entries: &[Entry]) -> Vec<u8> {
    let mut bytes = begin(kind::ENTRIES);
    codec::put_list(&mut bytes, entries.iter().map(WireEntry::from));
    bytes
}

/// The entries of a message of entries.
///
/// # Errors
/// Whatever is wrong with it first, including a message of another kind.
pub fn decode_entries(bytes: &[u8]) -> Result<Vec<Entry>, ProtocolError> {
    match Message::decode(bytes)? {
        Message::Entries(entries) => Ok(entries),
        other => Err(ProtocolError::OtherKind { found: other.kind(), expected: "entries" }),
    }
}

/// A message of one sample.
pub fn encode_sample(sample: &Sample) -> Vec<u8> {
    let mut bytes = begin(kind::SAMPLE);
    codec::put(&mut bytes, &WireSample::from(sample));
    bytes
}

/// The sample of a message of one sample.
///
/// # Errors
/// Whatever is wrong with it first, including a message of another kind.
pub fn decode_sample(bytes: &[u8]) -> Result<Sample, ProtocolError> {
    match Message::decode(bytes)? {
        Message::Sample(sample) => Ok(sample),
        other => Err(ProtocolError::OtherKind { found: other.kind(), expected: "sample" }),
    }
}

/// A snapshot in bytes, to be sent in parts or kept.
pub fn encode_checkpoint(checkpoint: &Checkpoint) -> Vec<u8> {
    snapshot::encode(checkpoint)
}

/// The snapshot in `bytes`, checked.
///
/// # Errors
/// Whatever is wrong with it first, named.
pub fn decode_checkpoint(bytes: &[u8]) -> Result<Checkpoint, ProtocolError> {
    snapshot::decode(bytes)
}

fn begin(kind: u8) -> Vec<u8> {
    vec![limits::VERSION, kind]
}

#[cfg(test)]
mod tests;
