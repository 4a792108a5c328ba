//! The entries of a log.

use super::{Calibration, Seal, Sensitivity, Vote};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{BootIndex, LandmarkId, Pose2, RobotId, Sequence, Timestamp};

/// One log: everything one robot said during one boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LogId {
    /// Whose log.
    pub robot: RobotId,
    /// During which boot.
    pub boot: BootIndex,
}

/// Identity of an entry. It is inside the entry and signed with it; the key it arrived by is never believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EntryId {
    /// Whose log.
    pub robot: RobotId,
    /// During which boot.
    pub boot: BootIndex,
    /// Position in the log, from 0 without gaps.
    pub sequence: Sequence,
}

impl EntryId {
    /// The log this entry belongs to.
    pub fn log(self) -> LogId {
        LogId { robot: self.robot, boot: self.boot }
    }
}

impl std::fmt::Display for EntryId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "robot {} boot {} entry {}", self.robot, self.boot, self.sequence)
    }
}

/// One entry of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Who said it, and where in the log.
    pub id: EntryId,
    /// What was said.
    pub body: Body,
    /// What only some robots say ([`extension_of_state`](super::extension_of_state)), and room for later versions: kept and
    /// passed on verbatim, counted in the fingerprint.
    pub extension: Vec<u8>,
}

/// What an entry says.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// A boot begins; always sequence 0.
    Boot(Boot),
    /// A measurement noise that later entries of this log refer to by its index.
    Profile(Profile),
    /// How this boot's clock maps to team time.
    ClockMap(ClockMap),
    /// Something was observed.
    Observation(Observation),
    /// The answer to another robot's observation of this one.
    Half(Half),
    /// What is final.
    Seal(Seal),
    /// Who is to belong to the team.
    Vote(Vote),
}

/// A robot's nominal trajectory and accumulated process noise at one instant: all that anyone ever
/// needs to know of its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NominalState {
    /// `N(t)`: odometry integrated from the start of the boot, never corrected.
    pub nominal: Pose2,
    /// `C(t) = sum Ad_N Q dt Ad_N^T`: process noise accumulated since the start of the boot, in the
    /// frame of the nominal trajectory, tangent order (x, y, yaw): m^2, m rad, rad^2.
    pub noise_sum: Symmetric3,
    /// How it depends on what is calibrated; `None` if nothing is.
    pub sensitivity: Option<Sensitivity>,
}

impl NominalState {
    /// A state on which nothing that is calibrated has an influence.
    pub fn new(nominal: Pose2, noise_sum: Symmetric3) -> Self {
        Self { nominal, noise_sum, sensitivity: None }
    }
}

/// A boot begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boot {
    /// Start of this boot's nominal trajectory.
    pub time: Timestamp,
    /// Random, new for every start: two starts that claim one index are told apart by it.
    pub nonce: u64,
    /// Hash of the configuration that decides bits; logs folded under another are refused.
    pub configuration: u64,
    /// `N(time)`; the noise sum is zero there.
    pub nominal: Pose2,
    /// The journal was intact, and the previous boot is carried on.
    pub continuation: Option<Continuation>,
    /// What is uncertain about the robot besides its pose.
    pub calibration: Option<Calibration>,
}

/// What carries a robot's block over from one boot to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Continuation {
    /// The boot carried on from.
    pub previous: BootIndex,
    /// Its last odometry.
    pub time: Timestamp,
    /// Its nominal state then.
    pub last: NominalState,
    /// Variance of the unseen motion in the gap, body frame: the squared motion limits times the gap.
    pub gap: Symmetric3,
}

/// Covariance of a measurement of dimension 1 to 3, lower triangle by rows; what is beyond the
/// dimension is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// 1, 2 or 3.
    pub dimension: u8,
    /// `[r00, r10, r11, r20, r21, r22]`.
    pub lower: [f64; 6],
}

impl Noise {
    /// Independent components from their standard deviations (1 to 3 of them; more are ignored).
    pub fn from_sigmas(sigmas: &[f64]) -> Self {
        let mut lower = [0.0; 6];
        for (slot, sigma) in [0, 2, 5].into_iter().zip(sigmas) {
            lower[slot] = sigma * sigma;
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most 3")]
        Self { dimension: sigmas.len().min(3) as u8, lower }
    }
}

/// Where an observation's noise is stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoiseRef {
    /// In the profile entry of the same log with this index.
    Profile(u16),
    /// Here, because it varies from one observation to the next.
    Explicit(Noise),
}

/// A measurement noise that later entries of this log refer to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Counts the profiles of this log from 0.
    pub index: u16,
    /// The noise.
    pub noise: Noise,
}

/// Team time = local time + `offset_ns` + `rate_ppb` 1e-9 (local time - `reference`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockMap {
    /// Local instant at which the offset holds.
    pub reference: Timestamp,
    /// Offset, nanoseconds.
    pub offset_ns: i64,
    /// Rate error, parts per billion.
    pub rate_ppb: i32,
}

impl ClockMap {
    /// Team time of a local instant, kept within what a stamp can hold.
    pub fn team_time(&self, local: Timestamp) -> Timestamp {
        let since = i128::from(local.0) - i128::from(self.reference.0);
        let drift = since * i128::from(self.rate_ppb) / 1_000_000_000;
        let team = i128::from(local.0) + i128::from(self.offset_ns) + drift;
        Timestamp(i64::try_from(team).unwrap_or(if team > 0 { i64::MAX } else { i64::MIN }))
    }
}

/// Something was observed by the robot whose log this is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// When.
    pub time: Timestamp,
    /// What.
    pub quantity: Quantity,
    /// How well.
    pub noise: NoiseRef,
    /// The observer's nominal state then.
    pub observer: NominalState,
}

/// What was observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// Another robot; a fact only once that robot has given its half.
    Robot {
        /// Who was seen.
        robot: RobotId,
        /// Where, in the observer's body frame.
        relative: Relative,
    },
    /// A landmark at a known place.
    Landmark {
        /// Which.
        landmark: LandmarkId,
        /// Its place in the map, metres.
        position_m: [f64; 2],
        /// Where, in the observer's body frame.
        relative: Relative,
    },
    /// A landmark whose place is not known; the team finds it.
    Feature {
        /// Which.
        landmark: LandmarkId,
        /// Where, in the observer's body frame.
        relative: Relative,
    },
    /// The observer itself, against the map.
    Absolute(Absolute),
}

/// A measurement of the observer against the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Absolute {
    /// Pose, with noise in the body frame (`z = X exp(n)`). The first one of a boot without
    /// continuation is the robot's prior: it places the robot in the map.
    Pose(Pose2),
    /// Position, metres, with noise in the map frame.
    Position([f64; 2]),
    /// Heading, radians.
    Heading(f64),
}

/// The answer of a robot that was seen: exactly one per (observation, named robot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Half {
    /// The observation answered.
    pub observation: EntryId,
    /// The answer.
    pub answer: Answer,
}

/// What the robot that was seen can say of itself at the time of the observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Its nominal state then, on the trajectory of this boot.
    State {
        /// The boot on whose trajectory the state lies (an old one if the robot has restarted since).
        boot: BootIndex,
        /// The state.
        state: NominalState,
    },
    /// It cannot say; the observation will never be used.
    Void(VoidReason),
}

/// Why a robot that was seen cannot say where its nominal trajectory was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum VoidReason {
    /// The observation is from before this robot's first odometry.
    BeforeBoot,
    /// The observation falls between two boots, or in a hole of the odometry.
    OdometryGap,
    /// The trajectory at that time is no longer kept.
    TrajectoryLost,
    /// The stamp is too far in this robot's future: somebody's clock is wrong.
    Clock,
}
