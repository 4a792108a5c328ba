//! A disk under a journal: what was written survives the process, what was synced survives the power, and
//! the last frame may be torn.

use std::path::Path;

use pleiad_agent::Record;
use pleiad_agent::journal::{self, JournalError};

/// A journal on a virtual disk.
#[derive(Debug, Default)]
pub struct Disk {
    frames: Vec<Vec<Record>>,
    synced: usize,
    /// Nothing can be written.
    pub full: bool,
    /// Records since the journal was replaced.
    pub records: usize,
}

impl Disk {
    /// Writes records as one frame; `false` if the disk is full.
    pub fn append(&mut self, records: Vec<Record>) -> bool {
        if !self.full {
            self.records += records.len();
            self.frames.push(records);
        }
        !self.full
    }

    pub fn sync(&mut self) {
        self.synced = self.frames.len();
    }

    /// The journal is replaced, all or nothing.
    pub fn replace(&mut self, records: Vec<Record>) {
        if !self.full {
            self.records = records.len();
            self.frames = vec![records];
            self.sync();
        }
    }

    /// The power goes: frames that were not synced are gone, the first of them perhaps in part.
    pub fn lose_power(&mut self) {
        self.frames.truncate(self.synced.max(1).min(self.frames.len()));
    }

    pub fn erase(&mut self) {
        *self = Self { full: self.full, ..Self::default() };
    }

    /// Size of the journal.
    pub fn bytes(&self) -> usize {
        journal::header().len() + self.frames.iter().map(|frame| journal::frame(frame).len()).sum::<usize>()
    }

    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// What is found after the process or the power went, read from bytes of which the last frame is cut
    /// off at `cut` of its length if that is less than 1.
    ///
    /// # Errors
    /// If the journal does not come back from its own bytes.
    pub fn found(&mut self, torn: Option<f64>) -> Result<Vec<Record>, JournalError> {
        let mut bytes = journal::header();
        let last = self.frames.len().saturating_sub(1);
        for (index, frame) in self.frames.iter().enumerate() {
            let frame = journal::frame(frame);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
            let kept = match torn {
                Some(share) if index == last && index >= self.synced => (frame.len() as f64 * share) as usize,
                _ => frame.len(),
            };
            bytes.extend(&frame[..kept]);
            if kept < frame.len() {
                self.frames.truncate(last);
                break;
            }
        }
        journal::parse_bytes(&bytes, Path::new("virtual disk")).map(|(records, _)| records)
    }
}
