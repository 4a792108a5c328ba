//! The journal: an append-only file of records in frames. What follows from one event is one frame, so
//! that it is found whole or not at all.
//!
//! File: the magic `PLEIADJ1`, then frames of `length u32 | crc32 u32 | payload`, little-endian. A payload
//! is a list of `length u32 | message`, a message being one encoded sample or entry of the protocol, or
//! what only journals hold (`kept`).

mod kept;

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Body, Entry};
use pleiad_protocol::{Message, ProtocolError, encode_entries, encode_sample};

use crate::node::Record;

const MAGIC: &[u8; 8] = b"PLEIADJ1";
const HEADER_BYTES: usize = 8;
/// Longer than any frame: a length beyond it is damage, not a frame cut off.
const LONGEST_FRAME_BYTES: usize = 1 << 24;

/// Why a journal cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The file system refused.
    #[error("{operation} {path}: {cause}")]
    Io {
        /// What was tried.
        operation: &'static str,
        /// On which file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file is something else.
    #[error("{path} is not a journal of this version; move it away to start without one")]
    NotAJournal {
        /// Which file.
        path: PathBuf,
    },
    /// A frame in the middle is damaged.
    #[error(
        "{path} is damaged at byte {offset} with {after} bytes after it; restore it from a copy, or move it \
         away to start without it (the robot then needs a new prior)"
    )]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Where the damaged frame starts.
        offset: u64,
        /// Bytes after that frame.
        after: u64,
    },
    /// A frame is whole but holds something unknown.
    #[error("{path} at byte {offset}: {cause}; was it written by a later version?")]
    Content {
        /// Which file.
        path: PathBuf,
        /// Where the frame starts.
        offset: u64,
        /// What is wrong with it.
        cause: ProtocolError,
    },
}

/// An open journal, positioned at its end.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
    unsynced: bool,
    bytes: u64,
}

/// What was found in a journal.
#[derive(Debug, Default)]
pub struct Found {
    /// The records, in order.
    pub records: Vec<Record>,
    /// Bytes of a last frame that was cut off when the process or the power went, and are dropped now.
    pub torn_bytes: u64,
}

impl Journal {
    /// Opens or creates a journal and reads what it holds.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn open(path: &Path) -> Result<(Self, Found), JournalError> {
        let io = |operation| move |cause| JournalError::Io { operation, path: path.to_owned(), cause };
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(io("create the folder of"))?;
        }
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(io("open"))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io("read"))?;
        let (records, good) = parse(&bytes, path)?;
        let torn_bytes = bytes.len() as u64 - good;
        file.set_len(good).map_err(io("truncate"))?;
        file.seek(SeekFrom::End(0)).map_err(io("seek in"))?;
        if good == 0 {
            file.write_all(MAGIC).map_err(io("write"))?;
        }
        let written = good.max(MAGIC.len() as u64);
        let journal = Self { file, path: path.to_owned(), unsynced: true, bytes: written };
        Ok((journal, Found { records, torn_bytes }))
    }

    /// Reads a journal without changing it; a last frame cut off is left out.
    ///
    /// # Errors
    /// [`JournalError`].
    pub fn read(path: &Path) -> Result<Vec<Record>, JournalError> {
        let bytes = std::fs::read(path).map_err(|cause| JournalError::Io {
            operation: "read",
            path: path.to_owned(),
            cause,
        })?;
        parse(&bytes, path).map(|(records, _)| records)
    }

    /// Appends records as one frame. When this returns they survive the end of the process; for a loss of
    /// power see [`Journal::sync`].
    ///
    /// # Errors
    /// [`JournalError::Io`]: nothing that follows from the records may be published then.
    pub fn append(&mut self, records: &[Record]) -> Result<(), JournalError> {
        let frame = frame(records);
        self.unsynced = true;
        self.bytes += frame.len() as u64;
        self.file.write_all(&frame).map_err(|cause| self.error("write", cause))
    }

    /// Bytes written so far, the file's header included.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Replaces the journal by one with these records: the new one is complete on the disk before the old
    /// one goes, so that one of them is found whatever happens.
    ///
    /// # Errors
    /// [`JournalError::Io`]; the old journal is then still in use.
    pub fn replace(&mut self, records: &[Record]) -> Result<(), JournalError> {
        let fresh = self.path.with_extension("new");
        let path = self.path.clone();
        let io = |operation| {
            let path = path.clone();
            move |cause| JournalError::Io { operation, path, cause }
        };
        match std::fs::remove_file(&fresh) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => return Err(io("replace")(cause)),
            _ => {}
        }
        let (mut journal, _) = Self::open(&fresh)?;
        // A few at a time: a frame is found whole or not at all, but need not be everything.
        for records in records.chunks(256) {
            journal.append(records)?;
        }
        journal.sync()?;
        std::fs::rename(&fresh, &self.path).map_err(io("replace"))?;
        if let Some(folder) = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            File::open(folder).and_then(|folder| folder.sync_all()).map_err(io("sync the folder of"))?;
        }
        self.file = journal.file;
        self.bytes = journal.bytes;
        self.unsynced = false;
        Ok(())
    }

    /// Puts what was appended on the disk itself.
    ///
    /// # Errors
    /// [`JournalError::Io`].
    pub fn sync(&mut self) -> Result<(), JournalError> {
        if std::mem::take(&mut self.unsynced) {
            self.file.sync_data().map_err(|cause| self.error("sync", cause))?;
        }
        Ok(())
    }

    fn error(&self, operation: &'static str, cause: std::io::Error) -> JournalError {
        JournalError::Io { operation, path: self.path.clone(), cause }
    }
}

/// Whether records have to be on the disk itself before anything that follows from them is published or
/// done: a boot said to others and forgotten here would be said again with other words, and a promise that
/// others, or this robot itself, have relied on must outlast the power.
pub fn must_sync(records: &[Record], robot: RobotId) -> bool {
    records.iter().any(|record| match record {
        Record::Entry(Entry { id, body: Body::Boot(_) | Body::Seal(_) | Body::Vote(_), .. }) => {
            id.robot == robot
        }
        _ => false,
    })
}

/// What begins a journal.
pub fn header() -> Vec<u8> {
    MAGIC.to_vec()
}

/// Records as one frame.
pub fn frame(records: &[Record]) -> Vec<u8> {
    let mut frame = vec![0; HEADER_BYTES];
    for record in records {
        let message = match record {
            Record::Sample(sample) => encode_sample(sample),
            Record::Entry(entry) => encode_entries(std::slice::from_ref(entry)),
            Record::Tick { .. }
            | Record::Closed(_)
            | Record::Checkpoint(_)
            | Record::Earlier(_)
            | Record::Said(..) => kept::encode(record),
        };
        frame.extend_from_slice(&length(message.len()));
        frame.extend_from_slice(&message);
    }
    let payload = length(frame.len() - HEADER_BYTES);
    let checksum = crc32fast::hash(&frame[HEADER_BYTES..]).to_le_bytes();
    frame[..4].copy_from_slice(&payload);
    frame[4..8].copy_from_slice(&checksum);
    frame
}

/// The records in the bytes of a journal, and how many bytes of whole frames there are.
///
/// # Errors
/// [`JournalError`], naming `path`.
pub fn parse_bytes(bytes: &[u8], path: &Path) -> Result<(Vec<Record>, u64), JournalError> {
    parse(bytes, path)
}

#[allow(clippy::cast_possible_truncation, reason = "frames are far below 4 GiB: one event's records")]
fn length(length: usize) -> [u8; 4] {
    (length as u32).to_le_bytes()
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]) as usize)
}

/// The records of all whole frames, and how far these reach.
fn parse(bytes: &[u8], path: &Path) -> Result<(Vec<Record>, u64), JournalError> {
    if bytes.len() < MAGIC.len() && MAGIC.starts_with(bytes) {
        return Ok((Vec::new(), 0));
    }
    if !bytes.starts_with(MAGIC) {
        return Err(JournalError::NotAJournal { path: path.to_owned() });
    }
    let mut records = Vec::new();
    let mut at = MAGIC.len();
    while let (Some(size), Some(checksum)) = (word(bytes, at), word(bytes, at + 4)) {
        let start = at + HEADER_BYTES;
        let damaged = |after: usize| JournalError::Damaged {
            path: path.to_owned(),
            offset: at as u64,
            after: after as u64,
        };
        if size > LONGEST_FRAME_BYTES {
            return Err(damaged(bytes.len() - start));
        }
        let Some(payload) = bytes.get(start..start + size) else { break };
        if crc32fast::hash(payload) as usize != checksum {
            let after = bytes.len() - start - size;
            if after == 0 {
                break;
            }
            return Err(damaged(after));
        }
        parse_payload(payload, &mut records).map_err(|cause| JournalError::Content {
            path: path.to_owned(),
            offset: at as u64,
            cause,
        })?;
        at = start + size;
    }
    Ok((records, at as u64))
}

fn parse_payload(payload: &[u8], records: &mut Vec<Record>) -> Result<(), ProtocolError> {
    let mut at = 0;
    while let Some(size) = word(payload, at) {
        let message = payload.get(at + 4..at + 4 + size).unwrap_or_default();
        if kept::is_kept(message) {
            records.push(kept::decode(message)?);
            at += 4 + size;
            continue;
        }
        match Message::decode(message)? {
            Message::Sample(sample) => records.push(Record::Sample(sample)),
            Message::Entries(entries) => records.extend(entries.into_iter().map(Record::Entry)),
            other => {
                return Err(ProtocolError::OtherKind { found: other.kind(), expected: "sample or entries" });
            }
        }
        at += 4 + size;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
