//! The stages joined into a robot that drives: the inner loop of a simulator.

use crate::chain::actuator::{ActuatorState, Scheduled, turn};
use crate::chain::body::{BodyState, advance};
use crate::context::{Chance, Context, Motion, Surroundings};
use crate::model::RobotModel;
use crate::pose::Pose;
use crate::scalar::Scalar;

/// A robot in motion.
#[derive(Clone, Debug)]
pub struct Robot<S> {
    /// Seconds since the start.
    pub time_s: f64,
    /// The true motion.
    pub motion: Motion<S>,
    /// What servo and transmission remember.
    pub actuator: ActuatorState<S>,
    /// What the body remembers.
    pub body: BodyState<S>,
}

impl<S: Scalar> Robot<S> {
    /// At rest at a pose, at time zero.
    pub fn at_rest(pose: Pose<S>) -> Self {
        Self {
            time_s: 0.0,
            motion: Motion::at_rest(pose),
            actuator: ActuatorState::default(),
            body: BodyState::default(),
        }
    }

    /// Drives for `step_s` (above 0) by the scheduled commands. Effects that depend on the state take it
    /// from the beginning of the step, so 1 ms is a fine step and 20 ms a coarse one.
    pub fn drive(
        &mut self,
        model: &RobotModel<S>,
        scheduled: &[Scheduled<S>],
        surroundings: Surroundings,
        step_s: f64,
    ) {
        let context = self.context(model, surroundings, Chance::EXPECTED).over(S::constant(step_s));
        let until_s = self.time_s + step_s;
        let turned = turn(model, &context, scheduled, (self.time_s, until_s), &mut self.actuator);
        let step = advance(model, &context, turned, &mut self.body);
        self.motion.pose = step.pose;
        self.motion.speed_m_s = step.speed_m_s;
        self.motion.yaw_rate_rad_s = step.yaw_rate_rad_s;
        self.motion.acceleration_m_s2 = step.acceleration_m_s2;
        for (angle, wheel) in self.motion.wheel_angle_rad.iter_mut().zip(turned) {
            *angle += wheel;
        }
        self.time_s = until_s;
    }

    /// The robot's instant as hooks and sensors see it.
    pub fn context<'a>(
        &self,
        model: &'a RobotModel<S>,
        surroundings: Surroundings,
        chance: Chance,
    ) -> Context<'a, S> {
        Context { surroundings, chance, ..Context::new(&model.nominal, self.time_s, self.motion) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::actuator::{Command, schedule};
    use crate::{Drive, Nominal};

    #[test]
    fn a_nominal_robot_drives_the_commanded_circle() {
        let model = RobotModel::nominal(Drive::Differential, Nominal::ideal(0.05, 0.3));
        let command = Command { time_s: 0.0, speed_m_s: 0.6, yaw_rate_rad_s: 0.3 };
        let scheduled = schedule(&model, &[command], |_| Chance::EXPECTED);
        let mut robot = Robot::at_rest(Pose::identity());
        for _ in 0..2000 {
            robot.drive(&model, &scheduled, Surroundings::default(), 0.001);
        }
        // Without lag: an arc of 0.6 rad on a circle of radius 2 m.
        let pose = robot.motion.pose;
        assert!((pose.x_m - 2.0 * 0.6_f64.sin()).abs() < 1e-9, "{pose:?}");
        assert!((pose.y_m - 2.0 * (1.0 - 0.6_f64.cos())).abs() < 1e-9);
        assert!((pose.yaw_rad - 0.6).abs() < 1e-9);
    }
}
