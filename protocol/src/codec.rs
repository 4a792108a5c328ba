//! Structs to bytes and back. The one module that names bincode: it is no longer maintained
//! (RUSTSEC-2025-0141), small enough to be replaced, and its standard format is simple: integers as
//! varints (signed ones zigzagged), f64 as 8 little-endian bytes, a variant as its number, no names.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::ProtocolError;
use crate::limits;

fn config() -> impl bincode::config::Config {
    // The limit bounds what a claimed length may make the decoder allocate; it does not limit encoding.
    bincode::config::standard().with_limit::<{ limits::MESSAGE_BYTES }>()
}

/// Appends a value.
pub fn put<T: Serialize>(bytes: &mut Vec<u8>, value: &T) {
    let outcome = bincode::serde::encode_into_std_write(value, bytes, config());
    // Plain structs of numbers into memory: there is nothing that could fail but this crate itself.
    let Ok(_) = outcome else { unreachable!("a wire struct could not be encoded: {outcome:?}") };
}

/// Appends a list: its length, then its items.
pub fn put_list<T: Serialize>(bytes: &mut Vec<u8>, items: impl ExactSizeIterator<Item = T>) {
    put(bytes, &(items.len() as u64));
    items.for_each(|item| put(bytes, &item));
}

/// Appends bytes as they are, after their number.
pub fn put_bytes(bytes: &mut Vec<u8>, content: &[u8]) {
    put(bytes, &(content.len() as u64));
    bytes.extend_from_slice(content);
}

/// Reads values one after another.
#[derive(Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// From the first byte.
    pub fn new(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    /// The next value.
    pub fn take<T: DeserializeOwned>(&mut self, part: &'static str) -> Result<T, ProtocolError> {
        let (value, used) = bincode::serde::decode_from_slice(self.rest, config())
            .map_err(|cause| ProtocolError::Malformed { part, cause: cause.to_string() })?;
        self.rest = self.rest.get(used..).unwrap_or_default();
        Ok(value)
    }

    /// A list written by [`put_list`], each item checked and converted. The claimed length is checked
    /// first, so that memory is bounded by the limit and by the bytes really there.
    pub fn list<W: DeserializeOwned, T: TryFrom<W, Error = ProtocolError>>(
        &mut self,
        list: &'static str,
        limit: usize,
    ) -> Result<Vec<T>, ProtocolError> {
        let found: u64 = self.take(list)?;
        if found > limit as u64 {
            return Err(ProtocolError::TooMany { field: list.into(), found, limit: limit as u64 });
        }
        let mut items = Vec::new();
        for index in 0..found {
            let item: W = self.take(list)?;
            items.push(T::try_from(item).map_err(|cause| ProtocolError::Item {
                list,
                index: usize::try_from(index).unwrap_or(usize::MAX),
                cause: Box::new(cause),
            })?);
        }
        Ok(items)
    }

    /// Bytes as they are, written by [`put_bytes`].
    pub fn bytes(&mut self, field: &'static str, limit: usize) -> Result<Vec<u8>, ProtocolError> {
        let found: u64 = self.take(field)?;
        let count = usize::try_from(found).ok().filter(|count| *count <= limit);
        let Some(count) = count else {
            return Err(ProtocolError::TooMany { field: field.into(), found, limit: limit as u64 });
        };
        let Some((bytes, rest)) = self.rest.split_at_checked(count) else {
            let cause = format!("{found} bytes announced, {} there", self.rest.len());
            return Err(ProtocolError::Malformed { part: field, cause });
        };
        self.rest = rest;
        Ok(bytes.to_vec())
    }

    /// Nothing may follow.
    pub fn end(self) -> Result<(), ProtocolError> {
        match self.rest.len() {
            0 => Ok(()),
            bytes => Err(ProtocolError::Trailing { bytes }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_format_is_the_published_one() {
        // bincode specification, "varint encoding" and "zigzag": 250 is one byte, 251 three (marker 251
        // and two little-endian), -1 is zigzagged to 1; f64 is fixed.
        let mut bytes = Vec::new();
        put(&mut bytes, &(250_u64, 251_u64, -1_i64, 1.0_f64));
        assert_eq!(bytes, [250, 251, 251, 0, 1, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
    }

    #[test]
    fn a_claimed_length_beyond_the_bytes_is_refused_without_allocating_it() {
        // A byte vector of claimed length 2^40.
        let mut bytes = vec![253];
        bytes.extend_from_slice(&(1_u64 << 40).to_le_bytes());
        let refused = Reader::new(&bytes).take::<Vec<u8>>("extension");
        assert!(matches!(refused, Err(ProtocolError::Malformed { part: "extension", .. })), "{refused:?}");
    }
}
