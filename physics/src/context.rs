//! What a hook may look at: the instant, the nominal robot and its state.

use crate::nominal::Nominal;
use crate::pose::Pose;
use crate::scalar::Scalar;

/// The motion of a robot at an instant, measured or simulated.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S> {
    /// `map_from_robot`.
    pub pose: Pose<S>,
    /// Forward speed, m/s.
    pub speed_m_s: S,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: S,
    /// Forward acceleration, m/s^2.
    pub acceleration_m_s2: S,
    /// Angles of the left and right wheel since the start, radians.
    pub wheel_angle_rad: [S; 2],
}

impl<S: Scalar> Motion<S> {
    /// At rest at a pose.
    pub fn at_rest(pose: Pose<S>) -> Self {
        let zero = S::zero();
        Self {
            pose,
            speed_m_s: zero,
            yaw_rate_rad_s: zero,
            acceleration_m_s2: zero,
            wheel_angle_rad: [zero, zero],
        }
    }

    /// The pose `ahead_s` seconds later (earlier if negative), at the velocity of this instant.
    ///
    /// A true pose is carried over a latency by motion and never differentiated.
    pub fn carried(&self, ahead_s: S) -> Pose<S> {
        self.pose.compose(&Pose::exp(self.speed_m_s * ahead_s, S::zero(), self.yaw_rate_rad_s * ahead_s))
    }
}

impl Motion<f64> {
    /// The same motion as another scalar, depending on nothing.
    pub fn lift<S: Scalar>(&self) -> Motion<S> {
        Motion {
            pose: Pose::constant(self.pose.x_m, self.pose.y_m, self.pose.yaw_rad),
            speed_m_s: S::constant(self.speed_m_s),
            yaw_rate_rad_s: S::constant(self.yaw_rate_rad_s),
            acceleration_m_s2: S::constant(self.acceleration_m_s2),
            wheel_angle_rad: self.wheel_angle_rad.map(S::constant),
        }
    }
}

/// Channels that few robots have, and what is near.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surroundings {
    /// Steering angle, radians, left positive; 0 if the robot has none.
    pub steer_rad: f64,
    /// Supply voltage minus that at the start, volts.
    pub voltage_change_v: f64,
    /// The position of the nearest other robot in the map, metres.
    pub partner_m: Option<[f64; 2]>,
}

/// Draws for effects of chance, made by the caller: hooks have no randomness of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chance {
    /// Uniform in `[0, 1)`.
    pub uniform: f64,
    /// Another uniform, for a choice that follows the first.
    pub choice: f64,
    /// Standard normal.
    pub normal: f64,
}

impl Chance {
    /// The middle of every distribution: what a prediction uses.
    pub const EXPECTED: Self = Self { uniform: 0.5, choice: 0.5, normal: 0.0 };
}

/// Everything a hook may look at.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, S> {
    /// Seconds since the start of the recording.
    pub time_s: f64,
    /// The length of the step, seconds; 0 for an instant.
    pub step_s: S,
    /// What the nominal simulation believes.
    pub nominal: &'a Nominal<S>,
    /// The state at the beginning of the step.
    pub motion: Motion<S>,
    /// Channels that few robots have.
    pub surroundings: Surroundings,
    /// Draws for effects of chance.
    pub chance: Chance,
}

impl<'a, S: Scalar> Context<'a, S> {
    /// An instant of a prediction.
    pub fn new(nominal: &'a Nominal<S>, time_s: f64, motion: Motion<S>) -> Self {
        Self {
            time_s,
            step_s: S::zero(),
            nominal,
            motion,
            surroundings: Surroundings::default(),
            chance: Chance::EXPECTED,
        }
    }

    /// The same over a step of this length.
    pub fn over(self, step_s: S) -> Self {
        Self { step_s, ..self }
    }

    /// The heading as it is in the map, radians.
    pub fn heading_rad(&self) -> S {
        self.motion.pose.yaw_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_carried_along_its_arc() {
        let mut motion = Motion::at_rest(Pose::new(1.0, 0.0, std::f64::consts::FRAC_PI_2));
        (motion.speed_m_s, motion.yaw_rate_rad_s) = (2.0, 2.0);
        // On the unit circle about the origin, counter-clockwise: the angle on it is 2 t.
        let pose = motion.carried(-0.25);
        assert!((pose.x_m - 0.5_f64.cos()).abs() < 1e-15 && (pose.y_m + 0.5_f64.sin()).abs() < 1e-15);
        let lifted = motion.lift::<crate::Dual<1>>().carried(crate::Dual::variable(0.0, 0));
        assert!((lifted.y_m.derivatives()[0] - 2.0).abs() < 1e-12, "velocity is along the circle");
    }
}
