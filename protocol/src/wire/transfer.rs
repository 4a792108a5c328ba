//! Requests for facts, batches of samples and their acknowledgements.

use serde::{Deserialize, Serialize};

use super::check;
use super::entry::WireLog;
use super::sample::WireSample;
use crate::codec::{self, Reader};
use crate::error::ProtocolError;
use crate::limits;
use crate::messages::{FactsRequest, LogRange, SensorAck, SensorBatch};

#[derive(Serialize, Deserialize)]
struct WireRange {
    log: WireLog,
    from: u64,
    to: u64,
}

/// Everything but the samples, which follow as a list.
#[derive(Serialize, Deserialize)]
struct WireBatch {
    number: u64,
    end: bool,
}

#[derive(Serialize, Deserialize)]
struct WireAck {
    number: u64,
    accepted: u32,
    refused: u32,
    first_refusal: Option<String>,
}

impl TryFrom<WireRange> for LogRange {
    type Error = ProtocolError;

    fn try_from(WireRange { log, from, to }: WireRange) -> Result<Self, ProtocolError> {
        if from > to {
            return Err(ProtocolError::Range { field: "range".into(), from, to });
        }
        Ok(Self { log: log.into(), from, to })
    }
}

/// Appends a request for facts.
pub fn put_request(bytes: &mut Vec<u8>, request: &FactsRequest) {
    let ranges = request.ranges.iter();
    codec::put_list(
        bytes,
        ranges.map(|range| WireRange { log: range.log.into(), from: range.from, to: range.to }),
    );
}

/// The next request for facts.
pub fn take_request(reader: &mut Reader<'_>) -> Result<FactsRequest, ProtocolError> {
    Ok(FactsRequest { ranges: reader.list::<WireRange, _>("ranges", limits::RANGES)? })
}

/// Appends a batch.
pub fn put_batch(bytes: &mut Vec<u8>, batch: &SensorBatch) {
    codec::put(bytes, &WireBatch { number: batch.number, end: batch.end });
    codec::put_list(bytes, batch.samples.iter().map(WireSample::from));
}

/// The next batch.
pub fn take_batch(reader: &mut Reader<'_>) -> Result<SensorBatch, ProtocolError> {
    let WireBatch { number, end } = reader.take("sensor batch")?;
    let samples = reader.list::<WireSample, _>("samples", limits::SAMPLES)?;
    Ok(SensorBatch { number, samples, end })
}

/// Appends an acknowledgement.
pub fn put_ack(bytes: &mut Vec<u8>, ack: &SensorAck) {
    let wire = WireAck {
        number: ack.number,
        accepted: ack.accepted,
        refused: ack.refused,
        first_refusal: ack.first_refusal.as_deref().map(|text| check::cut(text).to_owned()),
    };
    codec::put(bytes, &wire);
}

/// The next acknowledgement.
pub fn take_ack(reader: &mut Reader<'_>) -> Result<SensorAck, ProtocolError> {
    let WireAck { number, accepted, refused, first_refusal } = reader.take("sensor ack")?;
    let first_refusal = first_refusal.map(|text| check::text("first_refusal", text)).transpose()?;
    Ok(SensorAck { number, accepted, refused, first_refusal })
}
