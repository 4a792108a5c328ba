//! What a measurement is of: who takes part, where they are thought to be, and how its prediction depends on that.

use super::{FactKey, SkipReason};
use crate::fact::{Noise, NominalState, Quantity};
use crate::geometry::{Matrix3, Vector2};
use crate::joint::{Joint, ParameterKind, Participant, clock_influence};
use crate::measurement::{self, Linearization, Unusable};
use crate::{BootIndex, Pose2, RobotId, Timestamp};

/// What besides a robot's own error moves its pose as a measurement sees it: the block, which pose of those in the order of
/// [`taken`], and the derivative of that pose's error.
pub(super) type Influence = (usize, usize, Matrix3);

/// A block that takes part, and the nominal state of the robot in it; a landmark has none.
pub(super) type Taken = (usize, Option<NominalState>);

/// The poses of those who take part as the measurement sees them, in the order of [`taken`]: of the observer the frame it sees
/// from, and of the robot that was seen the pose at the observer's time, whose clock may differ.
pub(super) fn seen_poses(
    joint: &Joint,
    time: Timestamp,
    quantity: &Quantity,
    taken: &[Taken],
) -> (Vec<Pose2>, Vec<Influence>) {
    let own = |(index, state): &Taken| {
        let frame = *joint.frame(*index);
        state.as_ref().map_or(frame, |state| frame.compose(&state.nominal))
    };
    let mut poses: Vec<Pose2> = taken.iter().map(own).collect();
    let mut influences = Vec::new();
    if matches!(quantity, Quantity::Absolute(_)) {
        return (poses, influences);
    }
    let parameters = |robot, kind| {
        let index = joint.parameter_index(robot, kind)?;
        joint.parameters_at(index).map(|of| (index, of))
    };
    let observer = joint.part(taken[0].0).robot;
    if let Some((index, mount)) = parameters(observer, ParameterKind::Mount) {
        let frame = Pose2::new(mount.value.x, mount.value.y, mount.value.z);
        poses[0] = poses[0].compose(&frame);
        let turned = Pose2::new(0.0, 0.0, -frame.yaw_rad()).adjoint();
        influences.push((index, 0, poses[0].adjoint() * turned));
    }
    let Some((index, Some(NominalState { sensitivity: Some(sensitivity), .. }))) = taken.get(1) else {
        return (poses, influences);
    };
    let clocks = [(joint.part(*index).robot, 1.0), (observer, -1.0)].map(|(robot, sign)| {
        parameters(robot, ParameterKind::Clock).map(|(index, clock)| (index, clock, sign))
    });
    let late_s = clocks.iter().flatten().fold(0.0, |sum, (_, clock, sign)| {
        sum + sign * (clock.value.x + clock.value.y * time.seconds_since(clock.since))
    });
    if late_s != 0.0 {
        poses[1] = poses[1].compose(&Pose2::exp(sensitivity.twist * late_s));
    }
    for (index, clock, sign) in clocks.into_iter().flatten() {
        influences.push((index, 1, clock_influence(&poses[1], sensitivity, clock, time) * sign));
    }
    (poses, influences)
}

/// The blocks that the prediction depends on, and how.
pub(super) fn participants(
    quantity: &Quantity,
    taken: &[Taken],
    influences: &[Influence],
    at: &Linearization,
) -> Vec<Participant> {
    let signs = signs(quantity);
    let robots = taken.iter().zip(signs);
    let mut participants: Vec<Participant> = robots
        .map(|((index, _), sign)| Participant { index: *index, jacobian: at.jacobian * *sign })
        .collect();
    participants.extend(influences.iter().map(|(index, which, by)| Participant {
        index: *index,
        jacobian: at.jacobian * *by * signs[*which],
    }));
    participants
}

/// The noise, if it fits what was measured.
pub(super) fn usable(quantity: &Quantity, noise: Option<&Noise>) -> Result<Noise, SkipReason> {
    let fits = |noise: &&Noise| usize::from(noise.dimension) == dimension(quantity);
    noise.filter(fits).copied().ok_or(SkipReason::Noise)
}

/// Who takes part in a measurement, the observer first, and their nominal states at its time. A landmark that is not in the
/// team's map yet does not.
pub(super) fn taken(
    joint: &Joint,
    key: &FactKey,
    quantity: &Quantity,
    observer: &NominalState,
    other: Option<&(BootIndex, NominalState)>,
) -> Result<Vec<Taken>, SkipReason> {
    let a = key.id.robot;
    let mut taken = Vec::with_capacity(2);
    taken.push((participant(joint, a, key.id.boot)?, Some(*observer)));
    if let Quantity::Robot { robot: b, .. } = quantity {
        if *b == a {
            return Err(SkipReason::Itself);
        }
        let (boot, state) = other.ok_or(SkipReason::NotPlaced(*b))?;
        taken.push((participant(joint, *b, *boot)?, Some(*state)));
    }
    if let Quantity::Feature { landmark, .. } = quantity {
        taken.extend(joint.landmark_index(*landmark).map(|index| (index, None)));
    }
    Ok(taken)
}

/// A measurement at the poses of those who take part, in the order of [`taken`].
pub(super) fn linearize(quantity: &Quantity, poses: &[Pose2]) -> Result<Linearization, SkipReason> {
    let linearized = match (quantity, poses) {
        (Quantity::Robot { relative, .. }, [a, b]) => measurement::of_robot(relative, a, b),
        (Quantity::Landmark { position_m: [x, y], relative, .. }, [a]) => {
            measurement::of_point(relative, a, Vector2::new(*x, *y))
        }
        (Quantity::Feature { relative, .. }, [a, landmark]) => {
            measurement::of_point(relative, a, landmark.position())
        }
        (Quantity::Absolute(absolute), [a]) => Ok(measurement::of_map(absolute, a)),
        _ => return Err(SkipReason::Noise),
    };
    linearized.map_err(|unusable| match unusable {
        Unusable::TooClose { .. } => SkipReason::TooClose,
        Unusable::PointHasNoHeading => SkipReason::PointHasNoHeading,
    })
}

/// What the derivative with respect to the error of each who takes part is multiplied by, in the order of [`taken`]: a
/// relative measurement moves with the observer the other way.
fn signs(quantity: &Quantity) -> &'static [f64] {
    match quantity {
        Quantity::Robot { .. } | Quantity::Feature { .. } => &[-1.0, 1.0],
        Quantity::Landmark { .. } => &[-1.0],
        Quantity::Absolute(_) => &[1.0],
    }
}

pub(super) fn dimension(quantity: &Quantity) -> usize {
    match quantity {
        Quantity::Robot { relative, .. }
        | Quantity::Landmark { relative, .. }
        | Quantity::Feature { relative, .. } => measurement::dimension(relative),
        Quantity::Absolute(absolute) => measurement::absolute_dimension(absolute),
    }
}

fn participant(joint: &Joint, robot: RobotId, boot: BootIndex) -> Result<usize, SkipReason> {
    let index = joint.index(robot).ok_or(SkipReason::NotPlaced(robot))?;
    match joint.member(robot) {
        Some(member) if member.boot == boot => Ok(index),
        _ => Err(SkipReason::OtherBoot(robot)),
    }
}
