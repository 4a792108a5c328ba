//! What the rows of the joint state stand for, three by three.

use super::component::{Anchor, Component};
use super::standing::Reputation;
use crate::fact::Calibration;
use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, LandmarkId, Pose2, RobotId, Timestamp};

/// One robot's part of the joint state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Who.
    pub robot: RobotId,
    /// On the trajectory of which boot.
    pub boot: BootIndex,
    /// `G`: the estimate at any time is `G N(t)`.
    pub correction: Pose2,
    /// The robot's nominal pose at its last event: there the additive form is linearized.
    pub nominal: Pose2,
    /// The noise sum already folded into the covariance.
    pub folded_noise: Symmetric3,
    /// The derivative by the parameters of the odometry already folded
    /// ([`Sensitivity::motion`](crate::fact::Sensitivity)).
    pub folded_motion: Matrix3,
    /// The frame it has a place in.
    pub component: Component,
    /// How far it is believed.
    pub reputation: Reputation,
    pub(super) placed: bool,
}

impl Member {
    /// A robot's part from its numbers, for [`Joint::from_parts`](super::Joint::from_parts).
    pub fn new(
        robot: RobotId,
        boot: BootIndex,
        correction: Pose2,
        nominal: Pose2,
        folded_noise: Symmetric3,
    ) -> Self {
        let folded_motion = Matrix3::zeros();
        let component = Component::MAP;
        Self {
            robot,
            boot,
            correction,
            nominal,
            folded_noise,
            folded_motion,
            component,
            reputation: Reputation::default(),
            placed: true,
        }
    }
}

/// What three parameters of a robot belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterKind {
    /// Of its odometry: forward scale, yaw scale, yaw-rate bias in rad/s. They move the robot between its events.
    Motion,
    /// Of where it sees from: forward m, left m, yaw rad.
    Mount,
    /// Of its clock: offset s, drift s/s; the third is nothing.
    Clock,
}

/// Three parameters of a robot: what it said was uncertain, as far as it is known by now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Whose.
    pub robot: RobotId,
    /// Which.
    pub kind: ParameterKind,
    /// The estimate; the errors add to it.
    pub value: Vector3,
    /// When the clock's offset is what it is without drift.
    pub since: Timestamp,
}

/// A landmark whose place only the team knows: a frame that never moves, turned as whoever saw it first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedLandmark {
    /// Which.
    pub landmark: LandmarkId,
    /// Its pose in its component; of its heading nothing is ever asked.
    pub pose: Pose2,
    /// The frame it has a place in.
    pub component: Component,
}

/// What three rows of the joint state stand for.
#[allow(clippy::large_enum_variant, reason = "most blocks are robots")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Block {
    /// A robot; the error of its correction.
    Robot(Member),
    /// Parameters of a robot.
    Parameters(Parameters),
    /// A landmark; the error of its pose, in the form of a robot's.
    Landmark(MappedLandmark),
    /// A robot or a landmark as it was when something was seen across two components; in the form of a robot's.
    Anchor(Anchor),
    /// Nothing any more.
    Free,
}

impl Block {
    /// The robot, if it is one that has a place in the map.
    pub(super) fn placed(&self) -> Option<&Member> {
        match self {
            Self::Robot(member) if member.placed => Some(member),
            _ => None,
        }
    }

    /// The bits of it, for comparing two estimates.
    pub(super) fn words(&self) -> Vec<u64> {
        let pose = |pose: &Pose2| [pose.x_m(), pose.y_m(), pose.yaw_rad()].map(f64::to_bits);
        match self {
            Self::Robot(member) => {
                let mut words =
                    vec![u64::from(member.robot.0), u64::from(member.boot.0), u64::from(member.placed)];
                words.extend(pose(&member.correction));
                words.extend(member.folded_noise.0.map(f64::to_bits));
                words.extend(outside(member.component));
                if member.folded_motion != Matrix3::zeros() {
                    words.extend(member.folded_motion.iter().map(|entry| entry.to_bits()));
                }
                words.extend(member.reputation.words());
                words
            }
            Self::Parameters(of) => {
                let mut words = vec![u64::from(of.robot.0), of.kind as u64, of.since.0.cast_unsigned()];
                words.extend(of.value.iter().map(|entry| entry.to_bits()));
                words
            }
            Self::Landmark(mapped) => {
                let mut words = vec![u64::from(mapped.landmark.0)];
                words.extend(pose(&mapped.pose));
                words.extend(outside(mapped.component));
                words
            }
            Self::Anchor(anchor) => pose(&anchor.pose).into_iter().chain(outside(anchor.component)).collect(),
            Self::Free => vec![0],
        }
    }
}

/// A component that is not the map.
fn outside(component: Component) -> Vec<u64> {
    let (since, robot) = component.origin();
    if component == Component::MAP { Vec::new() } else { vec![since.0.cast_unsigned(), u64::from(robot.0)] }
}

/// The groups of parameters that are uncertain, with their standard deviations.
pub(super) fn uncertain(calibration: &Calibration) -> impl Iterator<Item = (ParameterKind, [f64; 3])> {
    let [offset, drift] = calibration.clock;
    let groups = [
        (ParameterKind::Motion, calibration.motion),
        (ParameterKind::Mount, calibration.mount),
        (ParameterKind::Clock, [offset, drift, 0.0]),
    ];
    groups.into_iter().filter(|(_, sigmas)| sigmas.iter().any(|sigma| *sigma > 0.0))
}
