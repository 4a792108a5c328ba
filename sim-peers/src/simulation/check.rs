//! The invariants, and what is remembered to check them.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_agent::Node;
use pleiad_estimation::fact::{
    Absolute, Body, Entry, EntryId, Fingerprint, LogId, Quantity, Vote, WHOLE, length_of,
};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::joint::Joint;
use pleiad_estimation::reference::{facts_from_entries, halves_from_entries};
use pleiad_estimation::{BootIndex, RobotId, Timestamp};

use super::oracle;

/// An invariant that did not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// When, in virtual time.
    pub time: Timestamp,
    /// At which robot, if at one.
    pub robot: Option<RobotId>,
    /// What.
    pub what: String,
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.robot {
            Some(robot) => write!(f, "{}, robot {robot}: {}", self.time, self.what),
            None => write!(f, "{}: {}", self.time, self.what),
        }
    }
}

/// What the team has said and closed so far.
#[derive(Debug, Default)]
pub struct Checks {
    pub now: Timestamp,
    /// Size of the team.
    robots: u32,
    forgetful: bool,
    said: BTreeMap<EntryId, (Fingerprint, Entry)>,
    /// Estimates by the set of entries they rest on.
    estimates: BTreeMap<Fingerprint, Fingerprint>,
    /// Snapshots by cut; who made them in which of its lives.
    closed: BTreeMap<Timestamp, Vec<(RobotId, u32, Fingerprint)>>,
    /// How often a robot has been evicted.
    lives: BTreeMap<RobotId, u32>,
    /// Robots that may have lost facts they had said.
    damaged: BTreeSet<RobotId>,
    pub most_kept: usize,
    /// How many items a robot may keep, where that is limited.
    most_allowed: Option<usize>,
    pub cuts: u64,
}

impl Checks {
    /// With at most so many items in memory.
    pub fn keeping(self, most_allowed: Option<usize>) -> Self {
        Self { most_allowed, ..self }
    }

    /// Without what grows with time: identities and estimates ever seen are not kept.
    pub fn for_long(self) -> Self {
        Self { forgetful: true, ..self }
    }

    /// Nothing said yet by a team of `robots`.
    pub fn new(robots: u32) -> Self {
        Self { robots, ..Self::default() }
    }

    pub fn violation(&self, robot: Option<RobotId>, what: impl Into<String>) -> Violation {
        Violation { time: self.now, robot, what: what.into() }
    }

    /// An entry went to the disk of its author or to the others: its identity has one content for ever.
    pub fn says(&mut self, entry: &Entry) -> Result<(), Violation> {
        if self.forgetful {
            return Ok(());
        }
        let print = Fingerprint::of(entry);
        let (known, first) = self.said.entry(entry.id).or_insert_with(|| (print, entry.clone()));
        if *known != print {
            let what = format!("{} has two contents: {:?} and {:?}", entry.id, first.body, entry.body);
            return Err(self.violation(Some(entry.id.robot), what));
        }
        Ok(())
    }

    /// A robot has lost its disk: logs of its that reached nobody may begin again.
    pub fn unsaid(&mut self, robot: RobotId, heard: &BTreeSet<LogId>) {
        let last = heard.iter().map(|log| log.boot).max();
        self.said.retain(|id, _| id.robot != robot || last.is_some_and(|last| id.boot <= last));
    }

    pub fn closes(&mut self, robot: RobotId, cut: Timestamp, hash: Fingerprint) {
        let life = self.lives.get(&robot).copied().unwrap_or(0);
        self.cuts += 1;
        self.closed.entry(cut).or_default().push((robot, life, hash));
        while self.forgetful && self.closed.len() > 100 {
            self.closed.pop_first();
        }
    }

    /// What a robot has closed with words that it then lost, or that were not accepted, counts no more.
    pub fn damages(&mut self, robot: RobotId) {
        *self.lives.entry(robot).or_insert(0) += 1;
        self.damaged.insert(robot);
    }

    /// The invariants of one node.
    pub fn node(&mut self, node: &mut Node) -> Result<(), Violation> {
        let robot = node.robot();
        let status = node.status();
        let ledger = node.ledger();
        self.most_kept = self.most_kept.max(ledger.kept());
        if let Some(allowed) = self.most_allowed.filter(|allowed| ledger.kept() > *allowed) {
            let what = format!("{} items are kept, {allowed} are allowed", ledger.kept());
            return Err(self.violation(Some(robot), what));
        }
        if let Some(problem) = not_a_covariance(ledger.joint()) {
            return Err(self.violation(Some(robot), problem));
        }
        let mut last = None;
        for (key, _) in ledger.facts() {
            if last == Some((key.time, key.id)) {
                return Err(self.violation(Some(robot), format!("{} is used twice", key.id)));
            }
            last = Some((key.time, key.id));
        }
        let held = ledger.digests().flat_map(|digest| {
            let LogId { robot, boot } = digest.log;
            let chain = digest.chain.0;
            let (high, low) = chain.split_at(8);
            let word = |bytes: &[u8]| bytes.iter().fold(0, |word, byte| word << 8 | u64::from(*byte));
            [u64::from(robot.0), u64::from(boot.0), digest.held, word(high), word(low)]
        });
        // A snapshot accounts for entries whose chain is in it. Who has been evicted may not know it yet.
        let views = ledger.views().map_or(0, |views| u64::from(views.epoch));
        let life = self.lives.get(&robot).copied().unwrap_or(0);
        let set = Fingerprint::of_words(held.chain([views, u64::from(life)]));
        if self.forgetful {
            self.estimates.clear();
        }
        let known = self.estimates.entry(set).or_insert(status.estimate);
        if *known != status.estimate {
            return Err(self.violation(Some(robot), "the same entries gave other bits before"));
        }
        Ok(())
    }

    /// Snapshots of one cut are the same on all robots that were not evicted afterwards.
    pub fn snapshots(&self) -> Result<(), Violation> {
        for (cut, made) in &self.closed {
            let lasting =
                made.iter().filter(|(robot, life, _)| self.lives.get(robot).copied().unwrap_or(0) == *life);
            let hashes: BTreeSet<Fingerprint> = lasting.clone().map(|(_, _, hash)| *hash).collect();
            if hashes.len() > 1 {
                let who: Vec<String> = lasting.map(|(robot, _, hash)| format!("{robot}: {hash}")).collect();
                return Err(self.violation(None, format!("snapshots at {cut} differ: {}", who.join(", "))));
            }
        }
        Ok(())
    }

    /// All that was said and is accepted by a team that agrees on the ledger of `node`.
    fn accepted(&self, node: &Node) -> Vec<Entry> {
        let held: BTreeMap<LogId, u64> =
            node.ledger().digests().map(|digest| (digest.log, digest.held)).collect();
        // Logs that a snapshot has forgotten ended where a change of the membership says, or else where an
        // accepted seal of their author does; later boots first, because their seals say it.
        let evicted = self.evicted_at(node.ledger().views().map_or(0, |views| views.epoch));
        let mut ends: BTreeMap<LogId, u64> = BTreeMap::new();
        let logs: BTreeSet<LogId> = self.said.keys().map(|id| id.log()).collect();
        for log in logs.into_iter().rev() {
            // An eviction accepts what someone held. The author may have said in what is accepted too that the
            // log is shorter, the rest being lost, when others had not heard that.
            let ended = evicted.get(&log).into_iter().chain(ends.get(&log)).min();
            let end = held.get(&log).or(ended).copied();
            let Some(end) = end else { continue };
            ends.insert(log, end);
            for (_, entry) in self.said.range(first_of(log)..).map(|(_, said)| said) {
                if entry.id.log() != log || entry.id.sequence.0 >= end {
                    break;
                }
                if let Body::Seal(seal) = &entry.body {
                    for older in seal.logs.iter().filter(|older| older.last) {
                        let id = LogId { robot: log.robot, boot: older.boot };
                        // Said again if nobody has heard that much of it.
                        let end = ends.entry(id).or_insert(older.length);
                        *end = (*end).min(older.length);
                    }
                }
            }
        }
        let inside = |id: &EntryId| ends.get(&id.log()).is_some_and(|end| id.sequence.0 < *end);
        self.said.iter().filter(|(id, _)| inside(id)).map(|(_, (_, entry))| entry.clone()).collect()
    }

    /// How much of the logs of evicted robots those who stayed agreed on: what more than half of the members of
    /// an epoch accepted in one ballot, or all who would stay if an operator wants it. Only `epochs` that the
    /// team knows of in the end: what one robot of two has decided, and lost with its disk before the other
    /// heard of it, was never decided.
    fn evicted_at(&self, epochs: u32) -> BTreeMap<LogId, u64> {
        let votes: Vec<(RobotId, &Vote)> = self
            .said
            .values()
            .filter_map(|(_, entry)| match &entry.body {
                Body::Vote(vote) if vote.accepted => Some((entry.id.robot, vote)),
                _ => None,
            })
            .collect();
        let mut members: BTreeSet<RobotId> = (1..=self.robots).map(RobotId).collect();
        let mut ends = BTreeMap::new();
        let mut first_boots: BTreeMap<RobotId, BootIndex> = BTreeMap::new();
        for epoch in 0..epochs {
            let of_epoch = || votes.iter().filter(|(_, vote)| vote.epoch == epoch);
            let decided = of_epoch().find(|(_, vote)| {
                let staying = || members.iter().filter(|robot| !vote.removed.contains(robot));
                let accepting = staying()
                    .filter(|robot| of_epoch().any(|(by, given)| by == *robot && given == vote))
                    .count();
                2 * accepting > members.len() || (vote.operator && accepting == staying().count())
            });
            let Some((_, vote)) = decided else { break };
            // Of a log that nobody vouches for nothing is accepted; of one that someone had forgotten, all.
            for log in self.said.keys().map(|id| id.log()).filter(|log| vote.removed.contains(&log.robot)) {
                match length_of(&vote.held, log) {
                    Some(WHOLE) => {}
                    Some(held) => drop(ends.insert(log, held)),
                    None if first_boots.get(&log.robot).is_none_or(|first| log.boot >= *first) => {
                        ends.entry(log).or_insert(0);
                    }
                    None => {}
                }
            }
            for (robot, boot) in &vote.added {
                // An older request may name a boot of which an eviction has accepted something since: that log is
                // over all the same.
                ends.retain(|log, end| log.robot != *robot || log.boot < *boot || *end > 0);
                first_boots.insert(*robot, *boot);
            }
            members.retain(|robot| !vote.removed.contains(robot));
            members.extend(vote.added.iter().map(|(robot, _)| *robot));
        }
        ends
    }

    /// After healing: the estimate is the oracle's over what is accepted, nothing of it is missing, and what
    /// is not accepted was lost by someone who lost a disk, the power or his place.
    pub fn settled(&self, node: &mut Node, fold: &FoldConfig) -> Result<(), Violation> {
        let robot = Some(node.robot());
        node.status();
        let entries = self.accepted(node);
        let accepted: BTreeSet<EntryId> = entries.iter().map(|entry| entry.id).collect();
        let lost = self.said.iter().find(|(id, (_, entry))| {
            matches!(entry.body, Body::Observation(_))
                && !accepted.contains(id)
                && !self.damaged.contains(&id.robot)
        });
        if let Some((id, _)) = lost {
            return Err(self.violation(robot, format!("observation {id} is lost")));
        }
        let ledger = node.ledger();
        let counts = ledger.counts();
        let observed = entries.iter().filter(|entry| match &entry.body {
            Body::Observation(seen) => !matches!(seen.quantity, Quantity::Absolute(Absolute::Pose(_))),
            _ => false,
        });
        let (observed, counted) =
            (observed.count(), counts.relative + counts.absolute + counts.void + counts.pending);
        if self.damaged.is_empty() && (observed != counted || counts.expired > 0) {
            let what = format!("{observed} observations were made, {counted} are counted: {counts:?}");
            return Err(self.violation(robot, what));
        }
        let halves = halves_from_entries(&entries);
        let others = |id, robot| halves.get(&(id, robot)).copied();
        oracle::agrees(ledger.joint(), &facts_from_entries(&entries), &others, fold)
            .map_err(|what| self.violation(robot, what))
    }
}

fn first_of(log: LogId) -> EntryId {
    EntryId { robot: log.robot, boot: log.boot, sequence: pleiad_estimation::Sequence(0) }
}

/// Says if `P + 1e-12 max(diag) I` is not positive definite; then `eig_min < -1e-12 eig_max` may hold.
fn not_a_covariance(joint: &Joint) -> Option<String> {
    let covariance = joint.covariance();
    let size = covariance.size();
    let largest = (0..size).map(|row| covariance.entry(row, row)).fold(0.0, f64::max);
    if largest.is_nan() {
        return Some("a variance is not a number".to_owned());
    }
    let mut factor = vec![vec![0.0; size]; size];
    for row in 0..size {
        for column in 0..=row {
            let known: f64 = (0..column).map(|k| factor[row][k] * factor[column][k]).sum();
            let rest = covariance.entry(row, column) - known;
            if row != column {
                factor[row][column] =
                    if factor[column][column] > 0.0 { rest / factor[column][column] } else { 0.0 };
            } else if rest + 1e-12 * largest > 0.0 || largest == 0.0 {
                factor[row][row] = (rest + 1e-12 * largest).max(0.0).sqrt();
            } else {
                return Some(format!("the joint covariance is indefinite: pivot {rest:e} of {largest:e}"));
            }
        }
    }
    None
}
