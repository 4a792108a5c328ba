//! What goes into a node and what comes out.

use pleiad_estimation::fact::{Entry, EntryId, LogId};
use pleiad_estimation::ledger::Refusal;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use pleiad_protocol::{Estimate, FactsRequest, Status};

use super::SampleRefusal;

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
    /// A new estimate of this robot, on the facts held now: the *online* view.
    Estimate(Estimate),
    /// Something an operator should know.
    Notice(Notice),
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
    /// The robot has no place in the map.
    #[error(
        "boot {boot} begins without a prior: the robot has no place in the map; \
         give [prior] with for_boot = {boot}"
    )]
    NoPrior {
        /// The boot.
        boot: BootIndex,
    },
}
