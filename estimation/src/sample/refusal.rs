//! Why samples are refused, and how many were.

use std::collections::BTreeMap;

use crate::motion::OdometryRefusal;
use crate::{LandmarkId, RobotId, Timestamp};

/// Why a sample was not taken.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SampleRefusal {
    /// NaN, infinite, or a range that is not positive.
    #[error("the reading stamped {time} is not a finite number in its range")]
    BadValue {
        /// Its stamp.
        time: Timestamp,
    },
    /// Odometry that cannot be used.
    #[error(transparent)]
    Odometry(#[from] OdometryRefusal),
    /// From before this boot's first odometry.
    #[error("stamped {time}, before the first odometry of this boot")]
    BeforeBoot {
        /// Its stamp.
        time: Timestamp,
    },
    /// From so long ago that the trajectory is no longer kept.
    #[error("stamped {time}, longer ago than motion.history_samples reaches")]
    TooOld {
        /// Its stamp.
        time: Timestamp,
    },
    /// From after the last odometry there will be.
    #[error("stamped {time}, after the last odometry")]
    AfterLastOdometry {
        /// Its stamp.
        time: Timestamp,
    },
    /// Too many observations wait for odometry.
    #[error("stamped {time}: too many observations wait for odometry; is its driver running?")]
    TooManyWaiting {
        /// Its stamp.
        time: Timestamp,
    },
    /// From a time that this robot has promised not to observe in any more.
    #[error("stamped {time}, which is sealed: it came later than ledger.late_s allows")]
    Sealed {
        /// Its stamp.
        time: Timestamp,
    },
    /// Another agent runs as this robot.
    #[error("stamped {time}, but another agent runs as this robot")]
    Superseded {
        /// Its stamp.
        time: Timestamp,
    },
    /// This robot does not belong to the team at present.
    #[error("stamped {time}, while this robot does not belong to the team")]
    NotAMember {
        /// Its stamp.
        time: Timestamp,
    },
    /// The robot that was seen has not answered for long.
    #[error("robot {robot} has left too many observations of it unanswered")]
    Unanswered {
        /// Who was seen.
        robot: RobotId,
    },
    /// As much is kept in memory as the configuration allows.
    #[error("stamped {time}, when {items} items were kept, all that ledger.most_items allows; {}", remedy(*.awaited))]
    LedgerFull {
        /// Its stamp.
        time: Timestamp,
        /// Entries, facts and answers in memory.
        items: usize,
        /// Of a team that closes its past: whose promises reach least far.
        awaited: Option<RobotId>,
    },
    /// No noise is configured for the kind.
    #[error("no noise for {kind} in the configuration: add [sensors.{kind}]")]
    NoNoise {
        /// Kind of measurement.
        kind: &'static str,
    },
    /// The landmark is not in the map.
    #[error("landmark {0} is not in the map: add it to [[landmarks]]")]
    UnknownLandmark(LandmarkId),
    /// A robot saw itself.
    #[error("robot {0} was reported as seen by itself")]
    Itself(RobotId),
    /// A full pose of a landmark: a point has no heading.
    #[error("a full pose was reported of landmark {0}; a landmark has no heading")]
    LandmarkPose(LandmarkId),
}

fn remedy(awaited: Option<RobotId>) -> String {
    awaited.map_or_else(
        || "name the team in ledger.members, so that its past can be closed, or raise it".to_owned(),
        |robot| format!("nothing is closed without robot {robot}: bring it back or evict it"),
    )
}

/// How many samples were taken, and how many refused for which reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Taken.
    pub accepted: u64,
    /// Refused.
    pub refused: u64,
    /// Refused, by the name of the reason.
    pub reasons: BTreeMap<String, u64>,
    /// Why the last one was refused.
    pub last: Option<SampleRefusal>,
}

impl Tally {
    /// Counts a refusal; `true` for the first of its kind, which is worth a notice.
    pub fn refuse(&mut self, refusal: &SampleRefusal) -> bool {
        self.refused += 1;
        self.last = Some(*refusal);
        let debug = format!("{refusal:?}");
        let kind = debug.split([' ', '(', '{']).next().unwrap_or_default();
        let count = self.reasons.entry(kind.to_owned()).or_insert(0);
        *count += 1;
        *count == 1
    }

    /// The same for a sample that had been accepted to wait.
    pub fn refuse_accepted(&mut self, refusal: &SampleRefusal) -> bool {
        self.accepted = self.accepted.saturating_sub(1);
        self.refuse(refusal)
    }
}
