//! How a node takes part in closing the past: its seals and the cuts. The rules are in `docs/ledger.md`.

use std::collections::{BTreeMap, BTreeSet};

use pleiad_estimation::fact::{Body, EntryId, Fingerprint, LogId, Seal, SealedLog};
use pleiad_estimation::ledger::{Ledger, Log};
use pleiad_estimation::sample::SampleRefusal;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Timestamp};
use pleiad_protocol::{ClosureStatus, Status};

use super::transfer::Transfer;
use super::{Command, Node, Notice, Record};

/// Hashes of own snapshots kept to be compared with those of peers.
const MOST_HASHES: usize = 64;
/// Observations of one robot that may wait for its answer.
const MOST_UNANSWERED: usize = 4096;

/// A node's place in a team that closes its past.
#[derive(Debug, Default)]
pub(super) struct Membership {
    /// Not of the team; asks to be, from this boot on.
    pub joining: Option<BootIndex>,
    /// Robots an operator wants evicted.
    pub evict: BTreeSet<RobotId>,
    /// Robots that ask to be admitted.
    pub applicants: BTreeMap<RobotId, BootIndex>,
    /// The last snapshots of this node.
    hashes: BTreeMap<Timestamp, Fingerprint>,
    /// Statuses in a row in which a peer was in the epoch that this ledger has reached.
    pub same_epoch: BTreeMap<RobotId, usize>,
    /// How far the odometry of peers reaches, by their statuses.
    pub odometry: BTreeMap<RobotId, Timestamp>,
    /// The latest epoch that a peer has reached.
    pub latest_epoch: u32,
    /// Statuses of peers since a vote was last heard.
    pub quiet_statuses: usize,
    /// A peer closed the same time with another result.
    disagrees: bool,
    /// Peers that hold no more of this robot's older logs than it does itself.
    pub caught_up: BTreeSet<RobotId>,
    /// A boot began in this process without anything of the lives before: their disk was lost.
    pub lost_disk: bool,
    /// A snapshot on its way.
    pub transfer: Transfer,
}

impl Membership {
    /// What was closed with words that were not accepted is not compared with anyone's.
    pub(super) fn forget_cuts(&mut self) {
        self.hashes.clear();
        self.same_epoch.clear();
        self.disagrees = false;
    }
}

impl Node {
    /// What follows for seals, votes and cuts from whatever has just happened.
    pub(super) fn advance(&mut self) {
        if self.ledger.closure().is_none() || self.superseded {
            return;
        }
        // Every round promises, votes or closes something new; a few are always enough. What a vote decides may
        // leave nothing of what this robot rests on: that is checked before it promises or closes anything with it.
        for _ in 0..24 {
            self.check_membership();
            let moved = self.vote() || self.seal() || self.close();
            if !moved {
                break;
            }
        }
    }

    /// A boot may not begin in a time that is sealed.
    pub(super) fn check_begin(&self, time: Timestamp) -> Result<(), SampleRefusal> {
        let sealed = self.ledger.seal_of(self.config.robot).is_some_and(|seal| time <= seal.observed);
        if sealed { Err(SampleRefusal::Sealed { time }) } else { Ok(()) }
    }

    /// Whether an own observation at `time` may still be made, of `robot` if it is one.
    pub(super) fn check_observation(
        &self,
        time: Timestamp,
        robot: Option<RobotId>,
    ) -> Result<(), SampleRefusal> {
        self.check_begin(time)?;
        if self.is_full() {
            let (items, awaited) = (self.ledger.kept(), self.ledger.awaited());
            return Err(SampleRefusal::LedgerFull { time, items, awaited });
        }
        match robot {
            Some(robot) if self.ledger.pending_of(robot) >= MOST_UNANSWERED => {
                Err(SampleRefusal::Unanswered { robot })
            }
            _ => Ok(()),
        }
    }

    /// Whether so much is kept that nothing may be added that can be left unsaid.
    fn is_full(&self) -> bool {
        self.ledger.kept() >= self.config.closing.most_items
    }

    fn seal(&mut self) -> bool {
        let (Some(boot), Some(closure)) = (self.boot, self.ledger.closure()) else { return false };
        let Some((_, trajectory)) = self.segments.last() else { return false };
        let last = self.ledger.seal_of(self.config.robot);
        let observed = last.map_or(Timestamp::MIN, |seal| seal.observed);
        let answered = self.ledger.answered();
        let late_s = if self.input_ended { 0.0 } else { self.config.closing.late_s };
        let mut until = closure.floor(trajectory.end().0.plus_seconds(-late_s));
        // Whoever takes part in a ballot seals nothing before the epoch is decided.
        if let Some(from) = self.ledger.views().and_then(|views| views.held_back(self.config.robot)) {
            until = until.min(from);
        }
        // After a rebase the earlier part is of this life too.
        let earlier = self.rebased.and_then(|old| self.segments.of(old));
        if until < earlier.unwrap_or(trajectory).start() {
            until = Timestamp::MIN;
        }
        // A new life says at once how much there is of the earlier ones: before, nobody relies on those.
        let begun = last.is_none() || self.ledger.sealed_in(self.config.robot) == Some(boot);
        // Where another holds back every cut, a seal would be one more entry and close nothing.
        if begun && !self.input_ended && self.is_full() && !self.ledger.is_awaited(self.config.robot) {
            until = observed;
        }
        let until = until.max(observed);
        let answers = self.ledger.answerable().min(until).max(answered);
        if (until, answers) == (observed, answered) && begun {
            return false;
        }
        let logs = self.older_logs(boot, until);
        if !self.knows_its_past() {
            return false;
        }
        // Saying the same once more would not make it count.
        let same = |seal: &Seal| (seal.observed, seal.answered, &seal.logs) == (until, answers, &logs);
        if begun && last.is_some_and(same) {
            return false;
        }
        if logs.iter().any(|log| log.last && self.rebased == Some(log.boot)) {
            self.rebased = None;
        }
        let closed = self.ledger.cut().unwrap_or(Timestamp::MIN);
        self.say(boot, Body::Seal(Seal { observed: until, answered: answers, closed, logs }));
        true
    }

    /// Whether this robot may say how long its older logs are: before the first seal of this process everyone
    /// is asked whether it holds more of them. A journal may have lost its end with the power.
    pub(super) fn knows_its_past(&self) -> bool {
        let Some(views) = self.ledger.views() else { return true };
        let first = self.lived_boots.first().copied().unwrap_or_default();
        let mut others = views.active().filter(|term| term.robot != self.config.robot);
        first == BootIndex(0)
            || self.ledger.sealed_in(self.config.robot).is_some_and(|boot| boot >= first)
            || others.all(|term| self.membership.caught_up.contains(&term.robot))
    }

    /// This robot's logs before the current one that have not been said to have ended.
    fn older_logs(&self, boot: BootIndex, sealed: Timestamp) -> Vec<SealedLog> {
        let robot = self.config.robot;
        let ends = |old: BootIndex| {
            let end = self.segments.of(old).map(|trajectory| trajectory.end().0);
            self.rebased != Some(old) || end.is_none_or(|end| end <= sealed)
        };
        // A log of which nothing has reached anyone was lost with the disk.
        let lost = (self.first_of_stay().0..boot.0).map(|old| LogId { robot, boot: BootIndex(old) });
        let lost = lost.filter(|id| self.ledger.log(*id).is_none() && !self.ledger.is_forgotten(*id));
        let logs = self.ledger.open_logs(robot).filter(|(id, _)| id.boot < boot);
        let logs = logs.chain(lost.map(|id| (id, 0)));
        logs.map(|(id, length)| SealedLog { boot: id.boot, length, last: ends(id.boot) }).collect()
    }

    fn close(&mut self) -> bool {
        // Whoever is not of the team has said nobody what he relies on: he takes over snapshots of others.
        if self.membership.disagrees || self.membership.joining.is_some() {
            return false;
        }
        let Some(cut) = self.ledger.closable() else { return false };
        let settled = self.settled_until(cut);
        let Some(hash) = self.ledger.close(cut) else { return false };
        self.remember_hash(cut, hash);
        self.segments.forget_until(cut);
        self.out.records.push(Record::Closed(cut));
        self.out.rest.push(Command::Closed { cut, hash, settled });
        true
    }

    pub(super) fn remember_hash(&mut self, cut: Timestamp, hash: Fingerprint) {
        self.membership.hashes.insert(cut, hash);
        while self.membership.hashes.len() > MOST_HASHES {
            self.membership.hashes.pop_first();
        }
    }

    pub(super) fn closure_status(&self) -> Option<ClosureStatus> {
        self.ledger.closure()?;
        let hash = |cut| self.membership.hashes.get(&cut).copied();
        let firsts = self.ledger.digests().filter(|digest| digest.first > 0);
        Some(ClosureStatus {
            cut: self.ledger.cut().and_then(|cut| Some((cut, hash(cut)?))),
            epoch: self.ledger.views().map_or(0, |views| views.epoch),
            joining: self.membership.joining,
            firsts: firsts.map(|digest| (digest.log, digest.first)).collect(),
            expired: self.ledger.counts().expired as u64,
        })
    }

    /// What a peer's status says about cuts and membership.
    pub(super) fn peer_closure(&mut self, status: &Status) {
        let Some(theirs) = &status.closure else { return };
        let peer = status.robot;
        self.membership.quiet_statuses += 1;
        self.membership.latest_epoch = self.membership.latest_epoch.max(theirs.epoch);
        self.hear_epoch(peer, theirs.epoch);
        if let Some(until) = status.odometry_until {
            self.membership.odometry.insert(peer, until);
        }
        // Whoever has been evicted without knowing yet may have closed with its own last words.
        let epoch = self.ledger.views().map_or(0, |views| views.epoch);
        if let Some((cut, hash)) = theirs.cut
            && theirs.epoch == epoch
            && let Some(ours) = self.membership.hashes.get(&cut)
            && *ours != hash
            && !self.membership.disagrees
        {
            let ours = *ours;
            self.membership.disagrees = true;
            self.notice(Notice::SnapshotDisagreement { peer, cut, theirs: hash, ours });
        }
        // What it has said to have ended is over, though a peer that has given it up may not have taken that in.
        let own = status.logs.iter().filter(|log| log.log.robot == self.config.robot);
        let more = own.filter(|log| {
            self.ledger.log(log.log).map_or(0, Log::held) < log.held && !self.ledger.is_complete(log.log)
        });
        let later = theirs.cut.is_some_and(|(cut, _)| self.ledger.cut().is_none_or(|ours| cut > ours));
        let forgotten = theirs.firsts.iter().any(|(log, first)| {
            log.robot == self.config.robot
                && self.ledger.log(*log).map_or(0, Log::held) < *first
                && !self.ledger.is_forgotten(*log)
        }) || self.misses_forgotten(status, Some(self.config.robot));
        // From then on the peer relies on nothing of the earlier lives that it had not told by then.
        let first = self.lived_boots.first();
        let knows = status.logs.iter().any(|log| {
            log.log.robot == self.config.robot
                && log.held > 0
                && first.is_some_and(|first| log.log.boot >= *first)
        });
        if knows && more.count() == 0 && !(forgotten && later) {
            self.membership.caught_up.insert(peer);
        } else {
            self.membership.caught_up.remove(&peer);
        }
        match theirs.joining {
            Some(boot) => {
                self.membership.applicants.insert(peer, boot);
            }
            None => {
                self.membership.applicants.remove(&peer);
            }
        }
        // What this robot misses is not kept there any more: only the snapshot helps.
        let held: BTreeMap<LogId, u64> =
            self.ledger.digests().map(|digest| (digest.log, digest.held)).collect();
        let missing = theirs.firsts.iter().any(|(log, first)| {
            held.get(log).copied().unwrap_or(0) < *first && !self.ledger.is_forgotten(*log)
        }) || self.misses_forgotten(status, None)
            || self.ledger.lacks_accepted();
        if missing && later {
            self.ask_for_snapshot(peer);
        }
    }

    /// Whether a peer has forgotten a log that is not complete here, of one robot or of any.
    fn misses_forgotten(&self, status: &Status, of: Option<RobotId>) -> bool {
        let mut lowest: BTreeMap<RobotId, BootIndex> = BTreeMap::new();
        for log in status.logs.iter().filter(|log| of.is_none_or(|of| log.log.robot == of)) {
            let slot = lowest.entry(log.log.robot).or_insert(log.log.boot);
            *slot = (*slot).min(log.log.boot);
        }
        lowest.into_iter().any(|(robot, boot)| {
            let before = boot.0.checked_sub(1).map(|before| LogId { robot, boot: BootIndex(before) });
            let known = self.ledger.digests().map(|digest| digest.log);
            let known = known.filter(|log| log.robot == robot && log.boot < boot);
            before.into_iter().chain(known).any(|log| !self.ledger.is_complete(log))
        })
    }

    /// A later life of this robot speaks while this one runs.
    pub(super) fn is_superseded_by(&mut self, id: EntryId) -> bool {
        let later = self.boot.is_some_and(|own| id.boot > own);
        if later && !self.superseded {
            self.superseded = true;
            self.notice(Notice::Superseded { robot: self.config.robot, boot: id.boot });
        }
        later
    }

    /// The nominal trajectory begins anew where its numbers would lose precision, within its boot's motion:
    /// the next boot carries on without a gap, and the published frame without a jump.
    pub(super) fn rebase(&mut self) {
        let (Some(_), Some((_, trajectory))) = (self.boot, self.segments.last()) else { return };
        let (end, state) = trajectory.end();
        let far = state.nominal.position().norm() > self.config.closing.rebase_m;
        let old = end.seconds_since(trajectory.start()) > self.config.closing.rebase_s;
        // A log that may still be extended is not left behind.
        let begun = trajectory.start() < end && self.rebased.is_none_or(|_| self.ledger.closure().is_none());
        if (far || old) && begun && !self.input_ended {
            let previous = self.boot;
            self.begin_boot_at(Timestamp(end.0 + 1), Some(Pose2::new(0.0, 0.0, state.nominal.yaw_rad())));
            self.rebased = previous;
        }
    }

    /// Keeps the last state of the nominal trajectory, if it will be needed without its samples.
    pub(super) fn keep_tick(&mut self) {
        if self.ledger.closure().is_none() {
            return;
        }
        if let Some((boot, trajectory)) = self.segments.last() {
            let (time, state) = trajectory.end();
            self.out.records.push(Record::Tick { boot, time, state, odom: self.segments.odom() });
        }
    }

    pub(super) fn base_record(&self) -> Option<Record> {
        self.ledger.base().map(|base| Record::Checkpoint(Box::new(base.clone())))
    }

    /// A new journal: what this node would recover from if the old one were thrown away.
    pub fn compacted(&self) -> Vec<Record> {
        let mut records = Vec::new();
        if let (Some(_), Some(closure)) = (self.membership.joining, self.ledger.closure()) {
            let empty = Ledger::closing(self.config.fold, closure.clone(), self.config.robot);
            records.extend(empty.base().map(|base| Record::Checkpoint(Box::new(base.clone()))));
        }
        records.extend(self.base_record());
        records.extend(self.ledger.earlier_entries().map(Record::Earlier));
        records.extend(self.ledger.entries_after_cut().cloned().map(Record::Entry));
        for segment in self.segments.iter() {
            let (boot, odom) = (segment.boot, segment.odom);
            records.extend(segment.trajectory.ticks().map(|(time, state)| Record::Tick {
                boot,
                time,
                state,
                odom,
            }));
        }
        records
    }
}
