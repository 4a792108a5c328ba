//! What the joint holds of one robot, enough to give its estimate until its next event.

use super::{Component, ErrorForm, Joint, ParameterKind, Parameters};
use crate::fact::{NominalState, Sensitivity};
use crate::geometry::{Matrix3, Vector3};
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

/// A copy of the joint's view of one robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RobotView {
    form: ErrorForm,
    correction: Pose2,
    nominal: Pose2,
    folded_noise: Symmetric3,
    noise_level: f64,
    folded_motion: Matrix3,
    block: Matrix3,
    /// Of the robot's odometry and clock, if they are estimated.
    parameters: Vec<Uncertain>,
}

/// Parameters that the estimate at another time depends on.
#[derive(Clone, Debug, PartialEq)]
struct Uncertain {
    of: Parameters,
    /// Covariance with the robot, with the parameters before it, and of their own.
    with_robot: Matrix3,
    with_others: Vec<Matrix3>,
}

impl Joint {
    /// What is held of a robot; `None` if it has no place in the map.
    pub(crate) fn view(&self, robot: RobotId) -> Option<RobotView> {
        let index = self.index(robot)?;
        let member = self.part(index);
        if member.component != Component::MAP {
            return None;
        }
        let kinds = [ParameterKind::Motion, ParameterKind::Clock];
        let rows: Vec<usize> = kinds.iter().filter_map(|kind| self.parameter_index(robot, *kind)).collect();
        let parameters = rows.iter().enumerate().filter_map(|(place, row)| {
            let of = *self.parameters_at(*row)?;
            let with_robot = self.covariance().block(*row, index);
            let with_others = rows[..=place].iter().map(|other| self.covariance().block(*row, *other));
            Some(Uncertain { of, with_robot, with_others: with_others.collect() })
        });
        Some(RobotView {
            form: self.form(),
            correction: member.correction,
            nominal: member.nominal,
            folded_noise: member.folded_noise,
            noise_level: member.reputation.noise_level,
            folded_motion: member.folded_motion,
            block: self.covariance().block(index, index),
            parameters: parameters.collect(),
        })
    }
}

impl RobotView {
    /// The correction that holds at `state` of the nominal trajectory: `time` is what the robot's clock shows.
    pub(crate) fn correction_at(&self, time: Timestamp, state: &NominalState) -> Pose2 {
        let moved = self
            .influences(time, state)
            .iter()
            .fold(Vector3::zeros(), |sum, (uncertain, by)| sum + by * uncertain.of.value);
        if moved == Vector3::zeros() { self.correction } else { Pose2::exp(moved).compose(&self.correction) }
    }

    /// The estimate at `state` of the nominal trajectory, when the robot's clock shows `time`, and the covariance of position in
    /// the map and yaw.
    pub(crate) fn estimate(&self, time: Timestamp, state: &NominalState) -> (Pose2, Symmetric3) {
        let correction = self.correction_at(time, state);
        let pose = correction.compose(&state.nominal);
        let grown = state
            .noise_sum
            .minus(self.folded_noise)
            .congruence(&correction.adjoint())
            .scaled(self.noise_level);
        let published = pose.additive_from_invariant();
        let mut block = Symmetric3::from_lower(&self.block);
        let influences = self.influences(time, state);
        for (place, (uncertain, by)) in influences.iter().enumerate() {
            let with_robot = by * uncertain.with_robot;
            block = block.plus(Symmetric3::from_lower(&(with_robot + with_robot.transpose())));
            for ((_, other), between) in influences[..place].iter().zip(&uncertain.with_others) {
                let cross = by * between * other.transpose();
                block = block.plus(Symmetric3::from_lower(&(cross + cross.transpose())));
            }
            block = block.plus(Symmetric3::from_lower(&uncertain.with_others[place]).congruence(by));
        }
        let covariance = match self.form {
            ErrorForm::Invariant => block.plus(grown).congruence(&published),
            ErrorForm::Additive => {
                let phi = super::additive_transition(&self.correction.compose(&self.nominal), &pose);
                block.congruence(&phi).plus(grown.congruence(&published))
            }
        };
        (pose, covariance)
    }

    /// What each group of parameters moves the robot by.
    fn influences(&self, time: Timestamp, state: &NominalState) -> Vec<(&Uncertain, Matrix3)> {
        let Some(sensitivity) = &state.sensitivity else { return Vec::new() };
        let by = |uncertain: &Uncertain| match uncertain.of.kind {
            ParameterKind::Clock => {
                let pose = self.correction.compose(&state.nominal);
                clock_influence(&pose, sensitivity, &uncertain.of, time)
            }
            _ => self.correction.adjoint() * (sensitivity.motion - self.folded_motion),
        };
        self.parameters.iter().map(|uncertain| (uncertain, by(uncertain))).collect()
    }
}

/// What an error of a robot's clock moves its pose by, at the time the clock shows: a clock that is ahead shows it late.
pub(crate) fn clock_influence(
    pose: &Pose2,
    sensitivity: &Sensitivity,
    clock: &Parameters,
    time: Timestamp,
) -> Matrix3 {
    let moved = pose.adjoint() * sensitivity.twist;
    let seconds = time.seconds_since(clock.since);
    Matrix3::from_columns(&[moved, moved * seconds, Vector3::zeros()])
}
