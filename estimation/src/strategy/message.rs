//! What the approximate strategies say to one another. `protocol` turns it into bytes.

use crate::fact::Noise;
use crate::geometry::{Matrix3, Vector3};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

/// One observation of a robot by a robot: who made it, counted from 0. Doubles as the version of what the
/// two then agree on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MeetingId {
    /// Who observed.
    pub observer: RobotId,
    /// Their how-manieth observation.
    pub number: u64,
}

/// Anything the approximate strategies say.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Observer to observed, one way: `intersection`, `split_intersection`, `naive`.
    Sighting(Sighting),
    /// Observer to observed: what do you know of yourself at this time? `pairwise`, `factored`.
    Question(Question),
    /// Observed to observer: `pairwise`.
    Answer(Answer),
    /// Observer to observed: `pairwise`.
    Verdict(Verdict),
    /// Observed to observer: `factored`.
    RowAnswer(RowAnswer),
    /// Participants to all: `factored`.
    TeamUpdate(TeamUpdate),
}

/// "I saw you, and this is what I believe of myself."
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// Which observation.
    pub id: MeetingId,
    /// When.
    pub time: Timestamp,
    /// What was measured, in the observer's body frame.
    pub relative: Relative,
    /// Its covariance.
    pub noise: Noise,
    /// The observer's estimate then.
    pub pose: Pose2,
    /// The part of its covariance that may be correlated with anybody; all of it but in
    /// `split_intersection`. Invariant error.
    pub correlated: Symmetric3,
    /// The part that nobody else has been told. Invariant error.
    pub independent: Symmetric3,
}

/// "Where were you?"
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question {
    /// Which observation.
    pub id: MeetingId,
    /// When.
    pub time: Timestamp,
}

/// "Here, and this is my factor of our correlation."
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Which observation.
    pub id: MeetingId,
    /// The estimate of the robot that was seen, at the time asked for.
    pub pose: Pose2,
    /// Its covariance, invariant error.
    pub covariance: Symmetric3,
    /// `s_ba` and the meeting at which it was agreed on; `None` if the two never met.
    pub factor: Option<(MeetingId, Matrix3)>,
}

/// "Then this is what we know now."
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Which observation.
    pub id: MeetingId,
    /// What changes; `None` if the observation was not used.
    pub change: Option<Change>,
}

/// What a verdict changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Correction of the estimate that was answered, invariant error.
    pub correction: Vector3,
    /// Covariance after it.
    pub covariance: Symmetric3,
    /// Whether the two now agree on their factors: that of the robot that was seen is then the identity, of
    /// this meeting's version.
    pub agreed: bool,
}

/// "Here, and this is my whole row."
#[derive(Clone, Debug, PartialEq)]
pub struct RowAnswer {
    /// Which observation.
    pub id: MeetingId,
    /// The estimate of the robot that was seen, at the time asked for.
    pub pose: Pose2,
    /// Its covariance, additive error.
    pub covariance: Symmetric3,
    /// The product of its transitions.
    pub motion: Matrix3,
    /// `Pi_bj` for every robot it is correlated with.
    pub row: Vec<(RobotId, Matrix3)>,
}

/// What everybody has to apply, in order and once.
#[derive(Clone, Debug, PartialEq)]
pub struct TeamUpdate {
    /// Which observation; measurements against the map are counted with them.
    pub id: MeetingId,
    /// 1, 2 or 3: components beyond it are zero.
    pub dimension: u8,
    /// Measured less predicted.
    pub innovation: Vector3,
    /// Its covariance, in the leading block.
    pub innovation_covariance: Symmetric3,
    /// One for every robot that is correlated with a participant.
    pub gains: Vec<Gain>,
}

/// One robot's gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Whose.
    pub robot: RobotId,
    /// `Phi_i^-1 K_i`; columns beyond the dimension are zero.
    pub without_motion: Matrix3,
}
