//! What can be wrong with a serialized message, told with type, field and place.

use std::fmt;

/// Why bytes are not a message, or a message has no bytes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}{}, byte {offset}: {problem}", Path(field))]
pub struct CdrError {
    /// The type that was asked for, as in `nav_msgs/msg/Odometry`.
    pub message: &'static str,
    /// The field with its parents, as in `pose.pose.position.x`; empty for the message as a whole.
    pub field: String,
    /// Where in the payload, its 4 bytes of header included.
    pub offset: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What is wrong at one place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The payload is shorter than its header.
    #[error("found {found} bytes, expected at least the 4 of the encapsulation header")]
    NoHeader {
        /// Bytes in all.
        found: usize,
    },
    /// A representation other than plain CDR.
    #[error(
        "found representation {found:#06x} ({name}), expected plain CDR: 0x0000 (big endian) or 0x0001 (little endian)"
    )]
    Representation {
        /// The identifier.
        found: u16,
        /// What it stands for.
        name: &'static str,
    },
    /// The payload ends within a value.
    #[error("{needed} bytes needed, {left} left; the payload is cut short or of another type")]
    CutShort {
        /// Bytes of the value.
        needed: usize,
        /// Bytes that there are.
        left: usize,
    },
    /// A length that the rest of the payload cannot hold.
    #[error(
        "found a length of {found}, of which {left} more bytes hold at most {most}; the payload is damaged or of another type"
    )]
    Length {
        /// The length read.
        found: u32,
        /// Bytes that there are.
        left: usize,
        /// Elements that fit in them.
        most: usize,
    },
    /// Text without its terminating zero.
    #[error("found text that does not end with a zero byte")]
    Unterminated,
    /// Text that is not UTF-8, or has a zero byte within.
    #[error("found text that is not UTF-8 without zero bytes")]
    Text,
    /// A truth value other than 0 and 1.
    #[error("found the truth value {found}, expected 0 or 1")]
    Truth {
        /// The byte.
        found: u8,
    },
    /// More bytes than the type has, and more than padding.
    #[error("{left} bytes are left over, expected at most 3 of padding; the payload is of another type")]
    LeftOver {
        /// How many.
        left: usize,
    },
    /// More elements than a length can tell.
    #[error("{found} elements or bytes are more than a message can hold")]
    TooLong {
        /// How many.
        found: usize,
    },
}

struct Path<'a>(&'a str);

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, ", field {}", self.0) }
    }
}

/// A problem on its way out of nested fields; each level puts its name in front.
#[derive(Debug)]
pub struct Fault {
    pub(crate) field: String,
    pub(crate) offset: usize,
    pub(crate) problem: Problem,
}

impl Fault {
    pub(crate) fn new(offset: usize, problem: Problem) -> Self {
        Self { field: String::new(), offset, problem }
    }

    /// The same, within `name`.
    pub(crate) fn within(mut self, name: &str) -> Self {
        let joint = if self.field.is_empty() || self.field.starts_with('[') { "" } else { "." };
        self.field = format!("{name}{joint}{}", self.field);
        self
    }

    /// The same, within element `index`.
    pub(crate) fn at(self, index: usize) -> Self {
        self.within(&format!("[{index}]"))
    }

    pub(crate) fn of(self, message: &'static str) -> CdrError {
        CdrError { message, field: self.field, offset: self.offset, problem: self.problem }
    }
}
