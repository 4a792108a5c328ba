//! One gap-free log, and what waits for its gaps to be filled.

use std::collections::BTreeMap;

use crate::Sequence;
use crate::fact::{Entry, Fingerprint, LogId};

/// Entries that may wait beyond the first missing one.
const MOST_WAITING: usize = 4096;

/// A contiguous prefix of one robot's entries during one boot.
#[derive(Clone, Debug, Default)]
pub struct Log {
    entries: Vec<Entry>,
    fingerprints: Vec<Fingerprint>,
    chain: Fingerprint,
    waiting: BTreeMap<u64, (Entry, Fingerprint)>,
}

/// What is held of a log: enough to see whether two robots hold the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogDigest {
    /// Which log.
    pub log: LogId,
    /// Entries held without a gap, from sequence 0.
    pub held: u64,
    /// Hash chained over their fingerprints.
    pub chain: Fingerprint,
}

impl Log {
    /// Number of entries held without a gap: the next sequence expected.
    pub fn held(&self) -> u64 {
        self.entries.len() as u64
    }

    /// The entries held without a gap.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Those from sequence `from` on.
    pub fn entries_from(&self, from: u64) -> &[Entry] {
        usize::try_from(from).ok().and_then(|from| self.entries.get(from..)).unwrap_or(&[])
    }

    /// Everything held, what waits for a gap included.
    pub(super) fn all(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().chain(self.waiting.values().map(|(entry, _)| entry))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.waiting.is_empty()
    }

    pub(super) fn digest(&self, log: LogId) -> LogDigest {
        LogDigest { log, held: self.held(), chain: self.chain }
    }

    /// Fingerprint of an entry, whether in the prefix or waiting.
    pub(super) fn fingerprint(&self, sequence: Sequence) -> Option<Fingerprint> {
        let in_prefix = usize::try_from(sequence.0).ok().and_then(|index| self.fingerprints.get(index));
        in_prefix.copied().or_else(|| self.waiting.get(&sequence.0).map(|(_, fingerprint)| *fingerprint))
    }

    pub(super) fn push(&mut self, entry: Entry, fingerprint: Fingerprint) {
        self.entries.push(entry);
        self.fingerprints.push(fingerprint);
        self.chain = self.chain.chained(fingerprint);
    }

    /// Keeps an entry that came too early; `false` if there is no room.
    pub(super) fn buffer(&mut self, entry: Entry, fingerprint: Fingerprint) -> bool {
        let room = self.waiting.len() < MOST_WAITING;
        if room {
            self.waiting.insert(entry.id.sequence.0, (entry, fingerprint));
        }
        room
    }

    /// The waiting entry that continues the prefix.
    pub(super) fn take_buffered(&mut self) -> Option<(Entry, Fingerprint)> {
        self.waiting.remove(&self.held())
    }
}
