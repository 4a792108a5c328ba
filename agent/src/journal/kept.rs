//! Records that only a journal holds: what never travels. A byte that begins no message, one that says which,
//! then numbers in little-endian order.

use pleiad_estimation::fact::{Fingerprint, LogId, NominalState};
use pleiad_estimation::ledger::EarlierEntries;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Timestamp};
use pleiad_protocol::{
    Message, ProtocolError, decode_checkpoint, decode_entries, encode_checkpoint, encode_entries,
};

use crate::node::Record;

/// No message begins with it: messages begin with the version of the wire.
const KEPT: u8 = 255;
const TICK: u8 = 1;
const CLOSED: u8 = 2;
const CHECKPOINT: u8 = 3;
const SAID: u8 = 4;
const EARLIER: u8 = 5;

pub(super) fn is_kept(bytes: &[u8]) -> bool {
    bytes.first() == Some(&KEPT)
}

pub(super) fn encode(record: &Record) -> Vec<u8> {
    let mut bytes = vec![KEPT];
    match record {
        Record::Tick { boot, time, state, odom } => {
            bytes.push(TICK);
            bytes.extend(boot.0.to_le_bytes());
            bytes.extend(time.0.to_le_bytes());
            for pose in [&state.nominal, odom] {
                for number in [pose.x_m(), pose.y_m(), pose.yaw_rad()] {
                    bytes.extend(number.to_le_bytes());
                }
            }
            state.noise_sum.0.iter().for_each(|entry| bytes.extend(entry.to_le_bytes()));
        }
        Record::Closed(cut) => {
            bytes.push(CLOSED);
            bytes.extend(cut.0.to_le_bytes());
        }
        Record::Checkpoint(checkpoint) => {
            bytes.push(CHECKPOINT);
            bytes.extend(encode_checkpoint(checkpoint));
        }
        Record::Earlier(earlier) => {
            bytes.push(EARLIER);
            bytes.extend(earlier.log.robot.0.to_le_bytes());
            bytes.extend(earlier.log.boot.0.to_le_bytes());
            bytes.extend(earlier.chain.0);
            bytes.extend(encode_entries(&earlier.entries));
        }
        Record::Said(from, message) => {
            bytes.push(SAID);
            bytes.extend(from.0.to_le_bytes());
            bytes.extend(Message::Strategy(message.clone()).encode());
        }
        Record::Sample(_) | Record::Entry(_) => {}
    }
    bytes
}

/// Takes numbers from the front.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ProtocolError> {
        let short = ProtocolError::TooShort { bytes: self.0.len() };
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or(short)?;
        self.0 = rest;
        Ok(*first)
    }

    fn time(&mut self) -> Result<Timestamp, ProtocolError> {
        Ok(Timestamp(i64::from_le_bytes(self.take()?)))
    }

    fn number(&mut self) -> Result<f64, ProtocolError> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn pose(&mut self) -> Result<Pose2, ProtocolError> {
        Ok(Pose2::new(self.number()?, self.number()?, self.number()?))
    }
}

pub(super) fn decode(bytes: &[u8]) -> Result<Record, ProtocolError> {
    let mut numbers = Numbers(bytes.get(1..).unwrap_or_default());
    let [kind] = numbers.take()?;
    Ok(match kind {
        TICK => {
            let boot = BootIndex(u32::from_le_bytes(numbers.take()?));
            let time = numbers.time()?;
            let (nominal, odom) = (numbers.pose()?, numbers.pose()?);
            let mut noise_sum = Symmetric3::zero();
            for entry in &mut noise_sum.0 {
                *entry = numbers.number()?;
            }
            Record::Tick { boot, time, state: NominalState::new(nominal, noise_sum), odom }
        }
        CLOSED => Record::Closed(numbers.time()?),
        CHECKPOINT => Record::Checkpoint(Box::new(decode_checkpoint(numbers.0)?)),
        SAID => {
            let from = RobotId(u32::from_le_bytes(numbers.take()?));
            match Message::decode(numbers.0)? {
                Message::Strategy(message) => Record::Said(from, message),
                other => return Err(ProtocolError::OtherKind { found: other.kind(), expected: "strategy" }),
            }
        }
        EARLIER => {
            let robot = RobotId(u32::from_le_bytes(numbers.take()?));
            let boot = BootIndex(u32::from_le_bytes(numbers.take()?));
            let chain = Fingerprint(numbers.take()?);
            let entries = decode_entries(numbers.0)?;
            Record::Earlier(EarlierEntries { log: LogId { robot, boot }, chain, entries })
        }
        found => return Err(ProtocolError::Kind { found }),
    })
}
