//! Common Data Representation as ROS 2 uses it: version 1 of DDS-XTypes 1.3, clause 7.4.3 (plain CDR), behind an
//! encapsulation header of 4 bytes. Read in either byte order, written little endian.
//!
//! A value of `n` bytes begins at a multiple of `n`, counted from behind the header, up to 8.

use crate::error::{CdrError, Fault, Problem};
use crate::values::Message;

/// Identifier of the representation and two bytes of options.
const HEADER: usize = 4;
/// Little endian, plain.
const LITTLE: [u8; HEADER] = [0, 1, 0, 0];
/// What may stand behind the last field: the payload filled up to a multiple of 4.
const MOST_PADDING: usize = 3;

/// The bytes of `message`, header first.
///
/// # Errors
/// Text with a zero byte, or more than 2^32 - 1 elements: neither has a form in CDR.
pub fn to_cdr<M: Message>(message: &M) -> Result<Vec<u8>, CdrError> {
    let mut writer = Writer { bytes: LITTLE.to_vec() };
    message.write(&mut writer).map_err(|fault| fault.of(M::NAME))?;
    Ok(writer.bytes)
}

/// The message that `payload`, header first, holds.
///
/// # Errors
/// Another representation, values that are cut short or impossible, bytes left over; nothing is allocated that the
/// payload could not fill.
pub fn from_cdr<M: Message>(payload: &[u8]) -> Result<M, CdrError> {
    let read = || {
        let mut reader = Reader::new(payload)?;
        let message = M::read(&mut reader)?;
        reader.finish()?;
        Ok(message)
    };
    read().map_err(|fault: Fault| fault.of(M::NAME))
}

/// Takes values from a payload one after the other.
#[derive(Debug)]
pub struct Reader<'a> {
    payload: &'a [u8],
    /// From the beginning of the payload.
    position: usize,
    little: bool,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(payload: &'a [u8]) -> Result<Self, Fault> {
        let &[high, low, _, _, ..] = payload else {
            return Err(Fault::new(0, Problem::NoHeader { found: payload.len() }));
        };
        let found = u16::from_be_bytes([high, low]);
        let little = match found {
            0 => false,
            1 => true,
            _ => return Err(Fault::new(0, Problem::Representation { found, name: representation(found) })),
        };
        Ok(Self { payload, position: HEADER, little })
    }

    /// Bytes that are left.
    pub(crate) fn left(&self) -> usize {
        self.payload.len() - self.position
    }

    pub(crate) fn fault(&self, problem: Problem) -> Fault {
        Fault::new(self.position, problem)
    }

    /// The next `N` bytes behind the padding of a value of that size, in the order of the highest first.
    pub(crate) fn number<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let padding = (N - (self.position - HEADER) % N) % N;
        let begin = self.position + padding;
        let Some(bytes) = self.payload.get(begin..begin + N) else {
            return Err(self.fault(Problem::CutShort { needed: padding + N, left: self.left() }));
        };
        let mut value = [0; N];
        value.copy_from_slice(bytes);
        if self.little {
            value.reverse();
        }
        self.position = begin + N;
        Ok(value)
    }

    /// The next `count` bytes.
    pub(crate) fn bytes(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let Some(bytes) = self.payload.get(self.position..).and_then(|rest| rest.get(..count)) else {
            return Err(self.fault(Problem::CutShort { needed: count, left: self.left() }));
        };
        self.position += count;
        Ok(bytes)
    }

    /// A length of elements that take at least `least` bytes each; more than fit are refused.
    pub(crate) fn length(&mut self, least: usize) -> Result<usize, Fault> {
        let found = u32::from_be_bytes(self.number()?);
        let at = self.position - size_of_val(&found);
        let (left, most) = (self.left(), self.left() / least.max(1));
        match usize::try_from(found) {
            Ok(length) if length <= most => Ok(length),
            _ => Err(Fault::new(at, Problem::Length { found, left, most })),
        }
    }

    pub(crate) fn finish(self) -> Result<(), Fault> {
        match self.left() {
            0..=MOST_PADDING => Ok(()),
            left => Err(self.fault(Problem::LeftOver { left })),
        }
    }
}

/// Appends values to a payload.
#[derive(Debug)]
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(crate) fn fault(&self, problem: Problem) -> Fault {
        Fault::new(self.bytes.len(), problem)
    }

    /// Padding, then a number of which the highest byte comes first here.
    pub(crate) fn number<const N: usize>(&mut self, mut value: [u8; N]) {
        let padding = (N - (self.bytes.len() - HEADER) % N) % N;
        self.bytes.resize(self.bytes.len() + padding, 0);
        value.reverse();
        self.bytes.extend(value);
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    pub(crate) fn length(&mut self, length: usize) -> Result<(), Fault> {
        let Ok(told) = u32::try_from(length) else {
            return Err(self.fault(Problem::TooLong { found: length }));
        };
        self.number(told.to_be_bytes());
        Ok(())
    }
}

/// Names of the representations of DDS-XTypes 1.3, table 60.
fn representation(identifier: u16) -> &'static str {
    match identifier {
        0x0002 | 0x0003 => "parameter list CDR",
        0x0006 | 0x0007 => "CDR version 2",
        0x0008 | 0x0009 => "delimited CDR version 2",
        0x000a | 0x000b => "parameter list CDR version 2",
        0x0004 => "XML",
        _ => "unknown",
    }
}
