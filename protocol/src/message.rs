//! All messages, and the way from bytes and to bytes.

use pleiad_estimation::fact::Entry;
use pleiad_estimation::ledger::Checkpoint;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::strategy;

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
    /// What an approximate strategy says.
    Strategy(strategy::Message),
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
    pub const STRATEGY: u8 = 10;
    pub const SNAPSHOT_REQUEST: u8 = 20;
    pub const SNAPSHOT_PART: u8 = 21;
}

impl Message {
    /// The message in bytes. What is beyond [`limits`] is encoded too, and refused by every receiver;
    /// only texts are cut.
    pub fn encode(&self) -> Vec<u8> {
        match self {
            Self::Entries(entries) => encode_entries(entries),
            Self::Status(status) => sealed(kind::STATUS, |bytes| status::put_status(bytes, status)),
            Self::FactsRequest(request) => {
                sealed(kind::FACTS_REQUEST, |bytes| transfer::put_request(bytes, request))
            }
            Self::Estimate(estimate) => {
                sealed(kind::ESTIMATE, |bytes| codec::put(bytes, &WireEstimate::from(estimate)))
            }
            Self::Sample(sample) => encode_sample(sample),
            Self::SensorBatch(batch) => sealed(kind::SENSOR_BATCH, |bytes| transfer::put_batch(bytes, batch)),
            Self::SensorAck(ack) => sealed(kind::SENSOR_ACK, |bytes| transfer::put_ack(bytes, ack)),
            Self::ControlRequest(request) => {
                sealed(kind::CONTROL_REQUEST, |bytes| control::put_request(bytes, *request))
            }
            Self::ControlReply(reply) => {
                sealed(kind::CONTROL_REPLY, |bytes| control::put_reply(bytes, reply))
            }
            Self::Strategy(said) => sealed(kind::STRATEGY, |bytes| crate::strategy::put(bytes, said)),
            Self::SnapshotRequest(request) => {
                sealed(kind::SNAPSHOT_REQUEST, |bytes| snapshot::put_request(bytes, *request))
            }
            Self::SnapshotPart(part) => sealed(kind::SNAPSHOT_PART, |bytes| snapshot::put_part(bytes, part)),
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
        let Some((body, checksum)) = body.split_last_chunk::<{ limits::CHECKSUM_BYTES }>() else {
            return Err(ProtocolError::TooShort { bytes: bytes.len() });
        };
        let (found, expected) = (u32::from_le_bytes(*checksum), checksum_of(kind, body));
        if found != expected {
            return Err(ProtocolError::Checksum { found, expected });
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
            kind::STRATEGY => Self::Strategy(crate::strategy::take(&mut reader)?),
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
            Self::Strategy(_) => "strategy",
            Self::SnapshotRequest(_) => "snapshot request",
            Self::SnapshotPart(_) => "snapshot part",
        }
    }

    /// The kind of the message in `bytes` in words, as [`Message::kind`], from its second byte alone; `None`
    /// if there is no such kind.
    pub fn kind_of(bytes: &[u8]) -> Option<&'static str> {
        Some(match *bytes.get(1)? {
            kind::ENTRIES => "entries",
            kind::STATUS => "status",
            kind::FACTS_REQUEST => "facts request",
            kind::ESTIMATE => "estimate",
            kind::SAMPLE => "sample",
            kind::SENSOR_BATCH => "sensor batch",
            kind::SENSOR_ACK => "sensor ack",
            kind::CONTROL_REQUEST => "control request",
            kind::CONTROL_REPLY => "control reply",
            kind::STRATEGY => "strategy",
            kind::SNAPSHOT_REQUEST => "snapshot request",
            kind::SNAPSHOT_PART => "snapshot part",
            _ => return None,
        })
    }

    /// All kinds, in words.
    pub const KINDS: [&str; 12] = [
        "entries",
        "status",
        "facts request",
        "estimate",
        "sample",
        "sensor batch",
        "sensor ack",
        "control request",
        "control reply",
        "strategy",
        "snapshot request",
        "snapshot part",
    ];
}

/// A message of entries; at most [`limits::ENTRIES`], longer lists are sent in chunks.
pub fn encode_entries(entries: &[Entry]) -> Vec<u8> {
    sealed(kind::ENTRIES, |bytes| codec::put_list(bytes, entries.iter().map(WireEntry::from)))
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
    sealed(kind::SAMPLE, |bytes| codec::put(bytes, &WireSample::from(sample)))
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

/// Version and kind, what `body` writes, and the checksum.
fn sealed(kind: u8, body: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = vec![limits::VERSION, kind];
    body(&mut bytes);
    let checksum = checksum_of(kind, &bytes[2..]);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes
}

/// CRC-32 of kind and body: finds every damage of up to 32 bits in a row, and all but one in four thousand
/// million of any other. The version is checked by itself.
fn checksum_of(kind: u8, body: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&[kind]);
    hasher.update(body);
    hasher.finalize()
}

#[cfg(test)]
mod tests;
