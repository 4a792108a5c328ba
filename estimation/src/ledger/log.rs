//! One gap-free log, and what waits for its gaps to be filled.

use std::collections::BTreeMap;

use super::checkpoint::LogBase;
use crate::Sequence;
use crate::fact::{Entry, Fingerprint, LogId};

/// Entries that may wait beyond the first missing one.
const MOST_WAITING: usize = 4096;
/// Earlier entries that are handed on together.
const PIECE: usize = 256;

/// A contiguous prefix of one robot's entries during one boot. What a cut has accounted for may be
/// forgotten from its front.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// Sequence of the first entry kept.
    first: u64,
    entries: Vec<Entry>,
    fingerprints: Vec<Fingerprint>,
    /// Chain over everything held.
    chain: Fingerprint,
    /// Chain over what came before `first`.
    first_chain: Fingerprint,
    /// The log ends there.
    pub(super) limit: Option<u64>,
    /// What the last cut has accounted for.
    pub(super) base: u64,
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
    /// The first of them that is still kept.
    pub first: u64,
    /// Entries that wait for a missing one.
    pub waiting: usize,
}

/// Entries of a log that are accounted for, and kept for peers that have not come as far.
#[derive(Clone, Debug, PartialEq)]
pub struct EarlierEntries {
    /// Which log.
    pub log: LogId,
    /// Chain over what came before them.
    pub chain: Fingerprint,
    /// Without a gap, up to where the last cut stands in this log.
    pub entries: Vec<Entry>,
}

impl Log {
    pub(super) fn from_base(base: &LogBase) -> Self {
        Self {
            first: base.start,
            chain: base.chain,
            first_chain: base.chain,
            limit: base.limit,
            base: base.start,
            ..Self::default()
        }
    }

    /// Number of entries held without a gap: the next sequence expected.
    pub fn held(&self) -> u64 {
        self.first + self.entries.len() as u64
    }

    /// Sequence of the first entry kept; those before it are accounted for.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// The entries kept, without a gap.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Those from sequence `from` on; none if that has been forgotten.
    pub fn entries_from(&self, from: u64) -> &[Entry] {
        let skip = from.checked_sub(self.first).and_then(|skip| usize::try_from(skip).ok());
        skip.and_then(|skip| self.entries.get(skip..)).unwrap_or(&[])
    }

    /// One entry, if it is kept.
    pub fn entry(&self, sequence: u64) -> Option<&Entry> {
        let index = usize::try_from(sequence.checked_sub(self.first)?).ok()?;
        self.entries.get(index)
    }

    /// Everything kept, what waits for a gap included.
    pub(super) fn all(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().chain(self.waiting.values().map(|(entry, _)| entry))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.held() == 0 && self.waiting.is_empty() && self.limit.is_none()
    }

    pub(super) fn digest(&self, log: LogId) -> LogDigest {
        LogDigest {
            log,
            held: self.held(),
            chain: self.chain,
            first: self.first,
            waiting: self.waiting.len(),
        }
    }

    /// Chain over the entries before `sequence`.
    pub(super) fn chain_before(&self, sequence: u64) -> Fingerprint {
        let count = usize::try_from(sequence.saturating_sub(self.first)).unwrap_or(usize::MAX);
        let start = self.first_chain;
        self.fingerprints.iter().take(count).fold(start, |chain, print| chain.chained(*print))
    }

    /// Fingerprint of an entry kept, whether in the prefix or waiting.
    pub(super) fn fingerprint(&self, sequence: Sequence) -> Option<Fingerprint> {
        let index = sequence.0.checked_sub(self.first).and_then(|index| usize::try_from(index).ok());
        let in_prefix = index.and_then(|index| self.fingerprints.get(index));
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

    /// Nothing is accepted from `limit` on; what waited there goes. `true` if entries of the prefix are
    /// beyond it too.
    pub(super) fn end_at(&mut self, limit: u64) -> bool {
        self.limit = Some(self.limit.map_or(limit, |known| known.min(limit)));
        self.waiting.retain(|sequence, _| *sequence < limit);
        // What a cut has accounted for stays.
        self.held() > limit.max(self.base)
    }

    /// Forgets entries before `sequence`.
    pub(super) fn forget_before(&mut self, sequence: u64) {
        self.first_chain = self.chain_before(sequence);
        let count = usize::try_from(sequence.saturating_sub(self.first)).unwrap_or(usize::MAX);
        let count = count.min(self.entries.len());
        self.entries.drain(..count);
        self.fingerprints.drain(..count);
        self.first += count as u64;
    }

    /// This log with what the last cut has accounted for alone.
    pub(super) fn before_base(&self) -> Self {
        let count = usize::try_from(self.base.saturating_sub(self.first)).unwrap_or(usize::MAX);
        let count = count.min(self.entries.len());
        Self {
            first: self.first,
            entries: self.entries[..count].to_vec(),
            fingerprints: self.fingerprints[..count].to_vec(),
            chain: self.chain_before(self.base),
            first_chain: self.first_chain,
            limit: self.limit,
            base: self.base,
            waiting: BTreeMap::new(),
        }
    }

    /// What is kept of the entries before sequence `until`, in pieces, the latest first.
    pub(super) fn earlier(&self, log: LogId, until: u64) -> impl Iterator<Item = EarlierEntries> + '_ {
        let count = until.checked_sub(self.first).and_then(|count| usize::try_from(count).ok());
        let entries = count.and_then(|count| self.entries.get(..count)).unwrap_or(&[]);
        entries.rchunks(PIECE).filter_map(move |piece| {
            let first = piece.first()?.id.sequence.0;
            Some(EarlierEntries { log, chain: self.chain_before(first), entries: piece.to_vec() })
        })
    }

    /// Keeps entries before those kept so far; not if they are others than those accounted for.
    pub(super) fn keep_earlier(&mut self, earlier: EarlierEntries) {
        let EarlierEntries { chain: first_chain, entries, .. } = earlier;
        let fingerprints: Vec<Fingerprint> = entries.iter().map(Fingerprint::of).collect();
        let chain = fingerprints.iter().fold(first_chain, |chain, print| chain.chained(*print));
        let adjoin = entries.last().is_some_and(|last| last.id.sequence.0 + 1 == self.first);
        if adjoin && chain == self.first_chain {
            self.first -= entries.len() as u64;
            self.first_chain = first_chain;
            self.entries.splice(..0, entries);
            self.fingerprints.splice(..0, fingerprints);
        }
    }

    /// How many entries wait for a missing one.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }
}
