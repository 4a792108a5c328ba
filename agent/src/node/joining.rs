//! Who belongs to the team, as a node sees it: its votes, what it does when it was evicted, and how it comes
//! back. The rules are in `docs/ledger.md`.

use std::collections::BTreeSet;

use pleiad_estimation::fact::{Body, Entry, LogId};
use pleiad_estimation::ledger::{Views, Wish, rules};
use pleiad_estimation::sample::{Sample, SampleRefusal};
use pleiad_estimation::{BootIndex, RobotId, Timestamp};

use super::{Node, Notice, Record};

/// Statuses of each member without a vote after which a ballot is given up.
const BALLOT_STATUSES: usize = 4;

/// Statuses of each other robot after which an eviction that none of them knows of is taken to be lost.
const UNAWARE_STATUSES: usize = 5;

impl Node {
    /// A robot that is not of the team asks to be.
    pub(super) fn check_membership(&mut self) {
        self.drop_contradicted();
        let robot = self.config.robot;
        let Some(views) = self.ledger.views() else { return };
        if views.is_active(robot) || self.membership.joining.is_some() {
            self.leave_ended_boot();
            return;
        }
        let boot = self.next_boot();
        let evicted = self.boot.take().is_some() || self.segments.last().is_some();
        self.membership.joining = Some(boot);
        for sample in std::mem::take(&mut self.waiting) {
            self.refuse_waiting(SampleRefusal::NotAMember { time: sample.time });
        }
        if evicted {
            // What this robot has closed with its own last words is not what the others close. The entries stay:
            // of what is accepted this may be the last copy.
            self.ledger.drop_base();
            self.out.records.extend(self.base_record());
            self.out.records.extend(self.ledger.entries_after_cut().cloned().map(Record::Entry));
            self.membership.forget_cuts();
            self.notice(Notice::Evicted { boot });
        }
    }

    /// Whoever was evicted and admitted again before it heard of either is in a boot whose log has ended, or is not
    /// accepted at all. To go on in it would give an identity a second content: a new boot begins, as after the loss
    /// of its disk.
    fn leave_ended_boot(&mut self) {
        let robot = self.config.robot;
        let Some(boot) = self.boot.filter(|_| !self.superseded) else { return };
        let goes_on =
            self.ledger.open_logs(robot).any(|(log, held)| log == LogId { robot, boot } && held > 0);
        if !goes_on {
            self.boot = None;
            self.forget_past();
            self.membership.forget_cuts();
            self.notice(Notice::Evicted { boot: self.next_boot() });
        }
    }

    /// Drops a peer's snapshot that rests on words that turn out not to be accepted. A member goes on as after the
    /// loss of its disk, with a new boot: that is how it came to take such a snapshot.
    pub(super) fn drop_contradicted(&mut self) {
        // What else follows for who learns that he is out himself is in `check_membership`.
        let member = self.ledger.views().is_some_and(|views| views.is_active(self.config.robot));
        if self.ledger.is_contradicted() && (member || self.membership.joining.is_some()) {
            self.membership.transfer.taken_from = None;
            self.ledger.drop_base();
            self.membership.forget_cuts();
            self.boot = None;
            self.forget_past();
        }
    }

    /// The others are asked again how much they hold of this robot's logs, before it says how long those are.
    pub(super) fn forget_past(&mut self) {
        self.lived_boots.clear();
        self.membership.caught_up.clear();
    }

    pub(super) fn next_boot(&self) -> BootIndex {
        self.known_boot.map_or(BootIndex(0), |known| BootIndex(known.0 + 1))
    }

    /// Whether odometry at `time` may begin a boot: as a member, in the latest epoch anyone is known to have
    /// reached, with the boot this robot was admitted with if it had asked to be.
    pub(super) fn may_begin(&self, time: Timestamp) -> bool {
        let Some(views) = self.ledger.views() else { return true };
        let wanted = self.membership.joining.unwrap_or_default();
        let mut terms = views.active().filter(|term| term.robot == self.config.robot);
        if self.decisions_are_lost() {
            return terms.any(|term| time > term.from);
        }
        views.epoch >= self.membership.latest_epoch
            && terms.any(|term| term.boot >= wanted && time > term.from)
    }

    pub(super) fn hear_epoch(&mut self, peer: RobotId, epoch: u32) {
        let same = self.ledger.views().is_some_and(|views| views.epoch == epoch);
        let heard = self.membership.same_epoch.entry(peer).or_insert(0);
        *heard = if same { *heard + 1 } else { 0 };
    }

    /// Whether nobody knows any more what was decided, such as that this robot was evicted: all others, and this
    /// ledger after hearing all of theirs, are in an epoch in which it is a member. They have lost their disks.
    /// It begins then as one that has lost its own; if someone knows after all, it is evicted once more.
    fn decisions_are_lost(&self) -> bool {
        let Some(views) = self.ledger.views() else { return false };
        let unaware = |robot| self.membership.same_epoch.get(&robot).is_some_and(|n| *n > UNAWARE_STATUSES);
        let (own, others): (Vec<RobotId>, Vec<RobotId>) =
            views.active().map(|term| term.robot).partition(|robot| *robot == self.config.robot);
        !own.is_empty() && !others.is_empty() && others.into_iter().all(unaware)
    }

    /// The first boot of this robot's present stay in the team.
    pub(super) fn first_of_stay(&self) -> BootIndex {
        let mut terms = self.ledger.views().into_iter().flat_map(Views::active);
        terms.find(|term| term.robot == self.config.robot).map_or(BootIndex(0), |term| term.boot)
    }

    /// This robot takes part in what is after this, if it is of the team.
    pub(super) fn stay_from(&self) -> Timestamp {
        let mut terms = self.ledger.views().into_iter().flat_map(Views::active);
        terms.find(|term| term.robot == self.config.robot).map_or(Timestamp::MIN, |term| term.from)
    }

    /// Odometry of a robot that is not of the team: it goes on by itself, so that nothing of its motion is
    /// unknown when it is admitted.
    pub(super) fn reckon_alone(&mut self, sample: Sample, gap: bool) -> Result<(), SampleRefusal> {
        if self.lived && !gap {
            self.reckon(sample)?;
            self.emit_estimate();
        } else {
            self.lived = false;
        }
        Ok(())
    }

    /// Of the team again, having gone on alone without a gap.
    pub(super) fn carry_on_joined(&mut self) {
        let end = self.segments.last().map(|(_, trajectory)| trajectory.end());
        if let Some((end, state)) = end {
            self.begin_boot_at(Timestamp(end.0 + 1), Some(state.nominal));
        }
    }

    pub(super) fn vote(&mut self) -> bool {
        let Some(boot) = self.boot else { return false };
        let Some(views) = self.ledger.views() else { return false };
        self.membership.applicants.retain(|robot, _| !views.is_active(*robot));
        self.membership.evict.retain(|robot| views.is_active(*robot));
        let wish = self.wish();
        let quiet = wish.evict.is_empty() && wish.admit.is_empty() && views.votes.is_empty();
        // The first seal of a boot names the earlier logs, and so the votes in them.
        if quiet || !self.knows_its_past() || self.ledger.sealed_in(self.config.robot) != Some(boot) {
            return false;
        }
        match self.ledger.proposal(&wish) {
            Some(vote) => {
                self.membership.quiet_statuses = 0;
                self.say(boot, Body::Vote(vote));
                true
            }
            None => false,
        }
    }

    fn wish(&self) -> Wish {
        let mut wish = Wish {
            evict: self.membership.evict.clone(),
            absent: BTreeSet::new(),
            admit: self.membership.applicants.clone(),
            operator: !self.membership.evict.is_empty(),
            impatient: self.is_impatient(),
        };
        let (Some(limit_s), Some(views), Some((_, trajectory))) =
            (self.config.closing.evict_after_s, self.ledger.views(), self.segments.last())
        else {
            return wish;
        };
        let mut long_absent = BTreeSet::new();
        for term in views.active().filter(|term| term.robot != self.config.robot) {
            let sealed = self.ledger.seal_of(term.robot).map_or(Timestamp::MIN, |seal| seal.observed);
            // Whoever takes part in a ballot seals nothing before it ends, but is not silent.
            let waits = views.held_back(term.robot).and_then(|_| self.membership.odometry.get(&term.robot));
            let heard = sealed.max(term.from).max(waits.copied().unwrap_or(Timestamp::MIN));
            let heard = heard.max(self.first_odometry.unwrap_or(Timestamp::MIN));
            let silent_s = trajectory.end().0.seconds_since(heard);
            if silent_s > limit_s {
                long_absent.insert(term.robot);
            }
            if silent_s > limit_s / 2.0 {
                wish.absent.insert(term.robot);
            }
        }
        let members = views.active().count();
        if !wish.operator
            && !long_absent.is_empty()
            && rules::may_decide(members, members - long_absent.len(), false)
        {
            wish.evict.extend(long_absent);
        }
        wish
    }

    /// A vote of another: the ballot goes on.
    pub(super) fn hear_vote(&mut self, entry: &Entry) {
        if matches!(entry.body, Body::Vote(_)) {
            self.membership.quiet_statuses = 0;
        }
    }

    /// Whether a ballot has led to nothing for so long that this robot tries its own: the members one after
    /// the other.
    fn is_impatient(&self) -> bool {
        let Some(views) = self.ledger.views() else { return false };
        let rank = views.active().position(|term| term.robot == self.config.robot).unwrap_or(0);
        self.membership.quiet_statuses > (BALLOT_STATUSES + 2 * rank) * views.active().count()
    }

    pub(super) fn evict(&mut self, robot: RobotId) {
        if robot != self.config.robot {
            self.membership.evict.insert(robot);
        }
    }
}
