//! What goes into a node and what comes out.

use pleiad_estimation::fact::{Entry, EntryId, Fingerprint, LogId, NominalState};
use pleiad_estimation::joint::{Joint, Member};
use pleiad_estimation::ledger::{Checkpoint, EarlierEntries, Refusal};
use pleiad_estimation::sample::{Sample, SampleRefusal};
use pleiad_estimation::strategy;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Timestamp};
use pleiad_protocol::{Estimate, FactsRequest, SnapshotPart, SnapshotRequest, Status};

use super::SettledEstimate;

/// Something happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A sensor of this robot delivered, stamped by the robot's clock.
    Sample(Sample),
    /// Entries arrived, from whomever.
    Entries(Vec<Entry>),
    /// A peer said what it holds.
    Status(Status),
    /// There will be no more samples.
    InputEnded,
    /// A part of a snapshot that was asked for.
    SnapshotPart(RobotId, SnapshotPart),
    /// An operator wants a robot that will not come back evicted.
    Evict(RobotId),
    /// A peer said something of an approximate strategy.
    Said(RobotId, strategy::Message),
}

/// Something is to be done, in the order given.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Keep these; they belong together and go to the disk before anything after them is done.
    Journal(Vec<Record>),
    /// Send these entries of the own log to all peers.
    Publish(Vec<Entry>),
    /// Ask a peer for entries that are missing here.
    Ask {
        /// Whom.
        peer: RobotId,
        /// For what.
        request: FactsRequest,
    },
    /// Ask a peer for its snapshot, or for the next part of it.
    AskSnapshot {
        /// Whom.
        peer: RobotId,
        /// For what.
        request: SnapshotRequest,
    },
    /// The past is closed up to a cut: these estimates will not change any more. The journal may be
    /// replaced by what [`super::Node::compacted`] gives.
    Closed {
        /// The cut.
        cut: Timestamp,
        /// Hash of the snapshot there.
        hash: Fingerprint,
        /// The settled estimates since the last cut.
        settled: Vec<SettledEstimate>,
    },
    /// A new estimate of this robot, on the facts held now: the *online* view.
    Estimate(Estimate),
    /// Something an operator should know.
    Notice(Notice),
    /// Say something of an approximate strategy.
    Say {
        /// To whom; to everybody if `None`, as `factored` does in memory.
        to: Option<RobotId>,
        /// What.
        message: strategy::Message,
    },
}

/// What is kept of a run: from the records of a journal, in order, a node recovers.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "records are short-lived and mostly entries where they are many"
)]
pub enum Record {
    /// A sample of this robot, stamped in team time.
    Sample(Sample),
    /// An entry, own or received.
    Entry(Entry),
    /// A state of the nominal trajectory, of a robot that closes its past: what was computed once is not
    /// computed again from samples that may be gone.
    Tick {
        /// Of which boot.
        boot: BootIndex,
        /// When.
        time: Timestamp,
        /// The state.
        state: NominalState,
        /// `odom_from_nominal` of this boot.
        odom: Pose2,
    },
    /// The past was closed up to here.
    Closed(Timestamp),
    /// A snapshot, of this robot or taken over from a peer: what came before is in it.
    Checkpoint(Box<Checkpoint>),
    /// Entries that the snapshot before accounts for, kept for peers that have not come as far.
    Earlier(EarlierEntries),
    /// What a peer said, of an approximate strategy.
    Said(RobotId, strategy::Message),
}

/// Something an operator should know.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Notice {
    /// A sample was not taken.
    #[error("sample refused: {0}")]
    SampleRefused(SampleRefusal),
    /// An entry was not taken.
    #[error("entry refused ({id}): {refusal}")]
    EntryRefused {
        /// Which.
        id: EntryId,
        /// Why.
        refusal: Refusal,
    },
    /// A robot published two different entries under one identity.
    #[error("{id} exists in two different versions: its robot is quarantined, its later entries are refused")]
    Equivocation {
        /// The identity.
        id: EntryId,
    },
    /// A peer holds another version of a log.
    #[error("robot {peer} holds another version of the log of robot {} boot {}", log.robot, log.boot)]
    Fork {
        /// The log.
        log: LogId,
        /// Who holds the other version.
        peer: RobotId,
    },
    /// A peer claims entries of this robot's current boot that it never wrote.
    #[error("{id} is claimed by a peer but was never written here: is another agent running as this robot?")]
    OwnLogAhead {
        /// The identity.
        id: EntryId,
    },
    /// A peer is configured differently.
    #[error(
        "robot {robot} runs another filter configuration ({theirs:016x}, here {ours:016x}): \
         nothing is exchanged with it; give all robots the same [filter] section and version"
    )]
    OtherConfiguration {
        /// Who.
        robot: RobotId,
        /// Its hash.
        theirs: u64,
        /// The hash here.
        ours: u64,
    },
    /// The odometry was silent for too long; what happened in between counts as unknown motion.
    #[error("no odometry from {from} to {to}: boot {boot} begins, with the gap as unknown motion")]
    OdometryGap {
        /// Last odometry.
        from: Timestamp,
        /// Next odometry.
        to: Timestamp,
        /// The boot that begins.
        boot: BootIndex,
    },
    /// A later life of this robot is heard of while this one runs.
    #[error(
        "robot {robot} runs a second time, as boot {boot}: this agent says nothing any more; \
         stop one of the two and restart the other"
    )]
    Superseded {
        /// This robot.
        robot: RobotId,
        /// The boot of the other agent.
        boot: BootIndex,
    },
    /// Two robots closed the same time with different results.
    #[error(
        "robot {peer} has closed {cut} with another result ({theirs}, here {ours}): nothing is closed any \
         more; the two logs contradict each other, restart the team with new journals"
    )]
    SnapshotDisagreement {
        /// Who.
        peer: RobotId,
        /// Which cut.
        cut: Timestamp,
        /// Its hash.
        theirs: Fingerprint,
        /// The hash here.
        ours: Fingerprint,
    },
    /// A snapshot that was asked for cannot be used.
    #[error("the snapshot of robot {peer} was refused: {cause}")]
    SnapshotRefused {
        /// Whose.
        peer: RobotId,
        /// Why.
        cause: String,
    },
    /// This robot was evicted.
    #[error("this robot was evicted from the team while it was away; it comes back with boot {boot}")]
    Evicted {
        /// The boot it will come back with.
        boot: BootIndex,
    },
    /// A peer's snapshot was taken over.
    #[error("took over the snapshot of robot {peer} at {cut}")]
    SnapshotTaken {
        /// Whose.
        peer: RobotId,
        /// Its cut.
        cut: Timestamp,
    },
    /// The robot has no place in the map.
    #[error(
        "boot {boot} begins without a prior: the robot has no place in the map; \
         give [prior] with for_boot = {boot}"
    )]
    NoPrior {
        /// The boot.
        boot: BootIndex,
    },
    /// The robot has no place in the map yet, and finds out.
    #[error(
        "boot {boot} begins without a prior: the robot has a place in the map, and publishes estimates, once what is seen \
         tells where it is"
    )]
    Searching {
        /// The boot.
        boot: BootIndex,
    },
    /// A robot is believed less, or more again. As long as facts can come late, this can change.
    #[error("robot {robot}: {standing}")]
    Standing {
        /// Which.
        robot: RobotId,
        /// How far it is believed now.
        standing: Standing,
    },
}

/// How far a robot is believed (`[filter.quarantine]`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Standing {
    /// In everything.
    #[error("contradicts nobody any more")]
    Sound,
    /// It is in a frame of its own until what is seen agrees on where it is.
    #[error(
        "contradicts the others: it was lost, or does not say what is; it is placed anew once what is seen agrees"
    )]
    Detached,
    /// Not on where it is in the map.
    #[error(
        "contradicts the map alone: its fixes and landmarks are not used until it starts again; look at its receiver"
    )]
    NotOnTheMap,
    /// Not at all.
    #[error(
        "contradicts the others: nothing that it says is used until it starts again; look at its sensors, odometry, \
         and who sends in its name"
    )]
    Distrusted,
}

impl Standing {
    /// Of a member.
    pub(super) fn of(joint: &Joint, member: &Member) -> Self {
        match member.reputation.distrust {
            Some(distrust) if distrust.whole => Self::Distrusted,
            Some(_) => Self::NotOnTheMap,
            None if member.reputation.detached.is_some() && !joint.is_in_map(member.robot) => Self::Detached,
            None => Self::Sound,
        }
    }
}
