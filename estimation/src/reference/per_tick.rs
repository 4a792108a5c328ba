//! The textbook joint filter: every robot is stepped at every odometry tick.

use std::collections::BTreeMap;

use super::facts::noise_matrix;
use super::joint::JointCovariance;
use super::models::{ErrorForm, Outcome, SkipReason, blocks, error_from_body, linearize, quarter_turn};
use crate::fact::{Noise, Quantity};
use crate::geometry::{Matrix3, Vector3};
use crate::{Pose2, RobotId, Timestamp};

/// The motion of one robot from its previous tick to this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// End of the step.
    pub time: Timestamp,
    /// Motion in the body frame at the start of the step.
    pub increment: Pose2,
    /// Covariance of the error `w` in `increment exp(w)`: tangent order, m^2, m rad, rad^2.
    pub covariance: Matrix3,
}

/// A measurement at a time, without anything about trajectories.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedMeasurement {
    /// When.
    pub time: Timestamp,
    /// By whom.
    pub observer: RobotId,
    /// What.
    pub quantity: Quantity,
    /// Its covariance.
    pub noise: Noise,
}

/// A joint filter that steps every robot at every tick, in either error form.
///
/// In the additive form this is the filter of the literature, whose Jacobians are taken at estimates
/// that jump with every update; it gains information about directions nobody has observed.
#[derive(Clone, Debug)]
pub struct PerTickEkf {
    form: ErrorForm,
    gate: [f64; 3],
    members: BTreeMap<RobotId, Member>,
    covariance: JointCovariance,
}

/// One robot on its way.
#[derive(Clone, Debug)]
struct Member {
    pose: Pose2,
    time: Timestamp,
    /// Steps still to be made, the first of which may already be cut short.
    ticks: std::collections::VecDeque<Tick>,
}

impl PerTickEkf {
    /// An empty team.
    pub fn new(form: ErrorForm, gate: [f64; 3]) -> Self {
        Self { form, gate, members: BTreeMap::new(), covariance: JointCovariance::default() }
    }

    /// Adds a robot at `start`, where `pose` is known with `covariance` in its body frame
    /// (`pose = truth exp(n)`), and all its ticks in order of time.
    pub fn add_robot(
        &mut self,
        robot: RobotId,
        start: Timestamp,
        pose: Pose2,
        covariance: &Matrix3,
        ticks: impl IntoIterator<Item = Tick>,
    ) {
        let body = error_from_body(self.form, &pose);
        self.covariance.insert(robot, &(body * covariance * body.transpose()));
        let ticks = ticks.into_iter().filter(|tick| tick.time > start).collect();
        self.members.insert(robot, Member { pose, time: start, ticks });
    }

    /// The estimate of a robot.
    pub fn pose(&self, robot: RobotId) -> Option<Pose2> {
        self.members.get(&robot).map(|member| member.pose)
    }

    /// The joint covariance in the form's coordinates.
    pub fn covariance(&self) -> &JointCovariance {
        &self.covariance
    }

    /// Steps every robot to `time`. A tick that reaches beyond is split on the group, its covariance in
    /// proportion; after its last tick a robot stands still.
    pub fn advance_to(&mut self, time: Timestamp) {
        for (robot, member) in &mut self.members {
            while let Some(tick) = member.ticks.front_mut() {
                let (step, done) = if tick.time <= time {
                    (*tick, true)
                } else if member.time < time {
                    let share = time.seconds_since(member.time) / tick.time.seconds_since(member.time);
                    let whole = tick.increment.log();
                    let step = Tick {
                        time,
                        increment: Pose2::exp(whole * share),
                        covariance: tick.covariance * share,
                    };
                    tick.increment = Pose2::exp(whole * (1.0 - share));
                    tick.covariance *= 1.0 - share;
                    (step, false)
                } else {
                    break;
                };
                let stepped = member.pose.compose(&step.increment);
                if self.form == ErrorForm::Additive {
                    let displacement = stepped.position() - member.pose.position();
                    let transition = blocks(&nalgebra::Matrix2::identity(), &(quarter_turn() * displacement));
                    self.covariance.transform(*robot, &transition);
                }
                let body = error_from_body(self.form, &stepped);
                self.covariance.add(*robot, &(body * step.covariance * body.transpose()));
                member.pose = stepped;
                member.time = step.time;
                if done {
                    member.ticks.pop_front();
                } else {
                    break;
                }
            }
        }
    }

    /// Uses measurements in the order given, which is that of time; returns what became of each.
    pub fn run(&mut self, measurements: &[TimedMeasurement]) -> Vec<Outcome> {
        measurements.iter().map(|measurement| self.measure(measurement)).collect()
    }

    /// Steps every robot to the measurement and uses it.
    pub fn measure(&mut self, measurement: &TimedMeasurement) -> Outcome {
        self.advance_to(measurement.time);
        let observed = match measurement.quantity {
            Quantity::Robot { robot, .. } => Some(robot),
            Quantity::Landmark { .. } | Quantity::Feature { .. } | Quantity::Absolute(_) => None,
        };
        if observed == Some(measurement.observer) {
            return Outcome::Skipped(SkipReason::Malformed);
        }
        let Some(noise) = noise_matrix(&measurement.noise) else {
            return Outcome::Skipped(SkipReason::NoiseDimension);
        };
        let Some(from) = self.pose(measurement.observer) else {
            return Outcome::Skipped(SkipReason::Unplaced);
        };
        let to = observed.map(|robot| self.pose(robot));
        if to == Some(None) {
            return Outcome::Skipped(SkipReason::Unplaced);
        }
        let linearized = match linearize(self.form, &measurement.quantity, &from, to.flatten().as_ref()) {
            Ok(linearized) => linearized,
            Err(reason) => return Outcome::Skipped(reason),
        };
        let (outcome, corrections) =
            self.covariance.update(&linearized, measurement.observer, observed, &noise, &self.gate);
        for (robot, d) in corrections {
            if let Some(member) = self.members.get_mut(&robot) {
                member.pose = corrected(self.form, &member.pose, &d);
            }
        }
        outcome
    }
}

/// `exp(d) X`, or the sum of the coordinates.
fn corrected(form: ErrorForm, pose: &Pose2, d: &Vector3) -> Pose2 {
    match form {
        ErrorForm::Invariant => Pose2::exp(*d).compose(pose),
        ErrorForm::Additive => Pose2::new(pose.x_m() + d.x, pose.y_m() + d.y, pose.yaw_rad() + d.z),
    }
}

#[cfg(test)]
mod tests;
