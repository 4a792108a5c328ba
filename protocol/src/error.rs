//! Why bytes or a key were refused.

use pleiad_estimation::fact::EntryId;

use crate::limits;

/// Why a message was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// Not even a version and a kind.
    #[error("a message of {bytes} bytes is too short for its version and kind")]
    TooShort {
        /// Its length.
        bytes: usize,
    },
    /// Longer than any message may be.
    #[error("a message of {bytes} bytes is longer than the limit of {limit}; send it in parts")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// Written by another version of this program.
    #[error("wire version {found}, expected {}; run the same release on all robots", limits::VERSION)]
    Version {
        /// What was found.
        found: u8,
    },
    /// The bytes are not those that were sent.
    #[error("checksum {found:08x}, expected {expected:08x}: the message was damaged on its way")]
    Checksum {
        /// At the end of the message.
        found: u32,
        /// Of the bytes before it.
        expected: u32,
    },
    /// A kind of message that does not exist.
    #[error("unknown message kind {found}")]
    Kind {
        /// The kind byte.
        found: u8,
    },
    /// A valid message, but not the one that belongs here.
    #[error("a message of kind {found} where {expected} was expected")]
    OtherKind {
        /// What came.
        found: &'static str,
        /// What should have come.
        expected: &'static str,
    },
    /// The bytes do not have the shape of this message.
    #[error("malformed {part}: {cause}")]
    Malformed {
        /// What was being read.
        part: &'static str,
        /// What the codec said.
        cause: String,
    },
    /// Something follows the end of the message.
    #[error("{bytes} bytes follow the end of the message")]
    Trailing {
        /// How many bytes.
        bytes: usize,
    },
    /// A list or text longer than allowed.
    #[error("{field}: {found} are more than the limit of {limit}")]
    TooMany {
        /// Which list or text.
        field: String,
        /// How many items or bytes it claims.
        found: u64,
        /// How many it may have.
        limit: u64,
    },
    /// A number that is not finite, too large or out of its range.
    #[error("{field}: found {found}, expected {expected}")]
    Number {
        /// Which field.
        field: String,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// A matrix that is not a covariance.
    #[error("{field}: the lower triangle {found:?} is not {expected}")]
    Covariance {
        /// Which field.
        field: String,
        /// Its lower triangle by rows.
        found: [f64; 6],
        /// What it should be.
        expected: &'static str,
    },
    /// A noise with the wrong number of components.
    #[error("{field}: a noise of dimension {found}, expected {expected}")]
    Dimension {
        /// Which field.
        field: String,
        /// Its dimension.
        found: u8,
        /// What fits the quantity.
        expected: &'static str,
    },
    /// A range that ends before it begins.
    #[error("{field}: the range from {from} to {to} ends before it begins")]
    Range {
        /// Which field.
        field: String,
        /// First sequence.
        from: u64,
        /// Sequence after the last.
        to: u64,
    },
    /// One item of a list was refused.
    #[error("{list}[{index}]: {cause}")]
    Item {
        /// Which list.
        list: &'static str,
        /// Position in the list, from 0.
        index: usize,
        /// Why.
        cause: Box<ProtocolError>,
    },
    /// An entry was refused.
    #[error("{id}: {cause}")]
    Entry {
        /// Who the entry claims to be.
        id: EntryId,
        /// Why.
        cause: Box<ProtocolError>,
    },
}

impl ProtocolError {
    /// The same refusal, its field seen from the structure around it.
    pub(crate) fn within(mut self, outer: &str) -> Self {
        if let Self::TooMany { field, .. }
        | Self::Number { field, .. }
        | Self::Covariance { field, .. }
        | Self::Dimension { field, .. }
        | Self::Range { field, .. } = &mut self
        {
            field.insert(0, '.');
            field.insert_str(0, outer);
        }
        self
    }
}

/// Why a team name or a key was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KeyError {
    /// Not a team name.
    #[error("team name {found:?}: expected 1 to 32 of the characters a-z, 0-9, _ and -")]
    Team {
        /// What was found.
        found: String,
    },
    /// Not a robot's number as it is written in keys.
    #[error("robot {found:?} in key {key:?}: expected a number from 0 to 4294967295 without leading zeros")]
    Robot {
        /// The key.
        key: String,
        /// Its robot segment.
        found: String,
    },
    /// Not one of the keys of the protocol.
    #[error("key {key:?}: expected {expected}")]
    Shape {
        /// The key.
        key: String,
        /// What should have been there.
        expected: &'static str,
    },
}
