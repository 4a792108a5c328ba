//! Odometry as the motion of the body.

use super::Correction;
use crate::chain::actuator::{ActuatorState, Command, Scheduled, schedule_next, turn};
use crate::chain::body::{BodyStep, advance};
use crate::chain::robot::Robot;
use crate::context::{Chance, Context, Surroundings};
use crate::model::{Drive, RobotModel};
use crate::pose::Pose;
use crate::scalar::Scalar;

/// The longest step in which a state-dependent effect is taken from the beginning of the step, seconds.
const LONGEST_STEP_S: f64 = 0.02;
/// For how long the first command is taken to have held before it was given, seconds.
const SETTLING_S: f64 = 30.0;

/// Odometry of one of the kinds that robots have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OdometryReading {
    /// Cumulative angles of the left and right wheel, radians.
    Wheels([f64; 2]),
    /// A velocity command that holds until the next: m/s, rad/s. The robot follows it as its servo does.
    Commanded {
        /// Forward, m/s.
        speed_m_s: f64,
        /// Counter-clockwise, rad/s.
        yaw_rate_rad_s: f64,
    },
    /// A velocity that was measured and holds until the next, by the geometry that the estimator believes
    /// in.
    Measured {
        /// Forward, m/s.
        speed_m_s: f64,
        /// Counter-clockwise, rad/s.
        yaw_rate_rad_s: f64,
    },
    /// A measured body motion since the reading before, `exp` of forward (m), left (m) and yaw (rad), by
    /// the geometry that the estimator believes in.
    Motion([f64; 3]),
}

/// What a robot did between two odometry readings, step by step: servo, transmission, castors and
/// acceleration have a memory.
#[derive(Clone, Debug)]
pub struct OdometryCorrection {
    robot: Robot<f64>,
    scheduled: Vec<Scheduled<f64>>,
    last: Option<OdometryReading>,
}

impl Default for OdometryCorrection {
    fn default() -> Self {
        Self { robot: Robot::at_rest(Pose::identity()), scheduled: Vec::new(), last: None }
    }
}

impl OdometryCorrection {
    /// Begins, or begins anew after a gap, with a reading at `time_s` of common time. What led to it is not
    /// known: a command is taken to have been followed for long, a wheel to have stood still.
    pub fn restart(&mut self, correction: &Correction, time_s: f64, reading: OdometryReading) {
        *self = Self::default();
        self.robot.time_s = time_s;
        self.last = Some(reading);
        match reading {
            OdometryReading::Wheels(angles) => self.robot.motion.wheel_angle_rad = angles,
            OdometryReading::Commanded { speed_m_s, yaw_rate_rad_s } => {
                let model = &correction.model;
                let command = Command { time_s: time_s - SETTLING_S, speed_m_s, yaw_rate_rad_s };
                self.scheduled = vec![Scheduled { from_s: command.time_s, command }];
                let context = self.robot.context(model, Surroundings::default(), Chance::EXPECTED);
                let mut state = ActuatorState::default();
                turn(model, &context, &self.scheduled, (command.time_s, time_s), &mut state);
                self.robot.actuator = state;
            }
            OdometryReading::Measured { .. } | OdometryReading::Motion(_) => {}
        }
    }

    /// The motion from the reading before to this one at `time_s`, in the frame of its beginning, which is
    /// at `start` in the map. A reading of another kind than before, or not after it, gives no motion and
    /// begins anew.
    pub fn step(
        &mut self,
        correction: &Correction,
        start: Pose<f64>,
        time_s: f64,
        reading: OdometryReading,
    ) -> Pose<f64> {
        let step_s = time_s - self.robot.time_s;
        if !step_s.is_finite() || step_s <= 0.0 {
            self.restart(correction, time_s, reading);
            return Pose::identity();
        }
        self.robot.motion.pose = start;
        let model = &correction.model;
        let aside = match (self.last, reading) {
            (Some(OdometryReading::Wheels(before)), OdometryReading::Wheels(now)) => {
                self.robot.motion.wheel_angle_rad = before;
                self.roll(correction, [now[0] - before[0], now[1] - before[1]], step_s);
                Pose::identity()
            }
            (
                Some(OdometryReading::Measured { speed_m_s, yaw_rate_rad_s }),
                OdometryReading::Measured { .. },
            ) => {
                let wheels = turned(correction, speed_m_s * step_s, yaw_rate_rad_s * step_s);
                self.roll(correction, wheels, step_s);
                Pose::identity()
            }
            (Some(OdometryReading::Motion(_)), OdometryReading::Motion([forward_m, left_m, yaw_rad])) => {
                self.roll(correction, turned(correction, forward_m, yaw_rad), step_s);
                // What the wheels cannot have done is added behind what they did.
                Pose::exp(forward_m, 0.0, yaw_rad).between(&Pose::exp(forward_m, left_m, yaw_rad))
            }
            (
                Some(OdometryReading::Commanded { .. }),
                OdometryReading::Commanded { speed_m_s, yaw_rate_rad_s },
            ) => {
                let command = Command { time_s, speed_m_s, yaw_rate_rad_s };
                let context = Context {
                    time_s,
                    ..self.robot.context(model, Surroundings::default(), Chance::EXPECTED)
                };
                schedule_next(model, &context, command, &mut self.scheduled);
                self.drive(model, time_s);
                Pose::identity()
            }
            _ => {
                self.restart(correction, time_s, reading);
                return Pose::identity();
            }
        };
        self.robot.time_s = time_s;
        self.last = Some(reading);
        start.between(&self.robot.motion.pose).compose(&aside)
    }

    /// Rolls wheels that turned by these angles.
    fn roll(&mut self, correction: &Correction, turned_rad: [f64; 2], step_s: f64) {
        let model = &correction.model;
        let nominal = &correction.nominal.nominal;
        let [left, right] = turned_rad.map(|angle| angle * nominal.wheel_radius);
        let yaw_rad = (right - left) / nominal.track_width;
        let surroundings = steered(model, f64::midpoint(left, right), yaw_rad);
        let context = Context { step_s, ..self.robot.context(model, surroundings, Chance::EXPECTED) };
        let BodyStep { pose, speed_m_s, yaw_rate_rad_s, acceleration_m_s2 } =
            advance(model, &context, turned_rad, &mut self.robot.body);
        let motion = &mut self.robot.motion;
        (motion.pose, motion.speed_m_s, motion.yaw_rate_rad_s) = (pose, speed_m_s, yaw_rate_rad_s);
        motion.acceleration_m_s2 = acceleration_m_s2;
        for (angle, turned) in motion.wheel_angle_rad.iter_mut().zip(turned_rad) {
            *angle += turned;
        }
    }

    /// Drives by the scheduled commands until `until_s`, and forgets those that have ended.
    fn drive(&mut self, model: &RobotModel<f64>, until_s: f64) {
        let from_s = self.robot.time_s;
        let steps = libm::ceil((until_s - from_s) / LONGEST_STEP_S).max(1.0);
        let step_s = (until_s - from_s) / steps;
        // The cast saturates: an agent's gap is never that long.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        for step in 0..steps as u32 {
            // From the number of the step, so that rounding does not add up.
            self.robot.time_s = from_s + step_s * f64::from(step);
            let begun = self.scheduled.partition_point(|next| next.from_s <= self.robot.time_s);
            let surroundings = begun.checked_sub(1).map_or(Surroundings::default(), |held| {
                let command = self.scheduled[held].command;
                steered(model, command.speed_m_s, command.yaw_rate_rad_s)
            });
            self.robot.drive(model, &self.scheduled, surroundings, step_s);
        }
        let ended = self.scheduled.partition_point(|next| next.from_s <= until_s).saturating_sub(1);
        self.scheduled.drain(..ended);
    }
}

/// The angles by which the wheels turn in a motion, by the believed geometry.
fn turned(correction: &Correction, forward_m: f64, yaw_rad: f64) -> [f64; 2] {
    let nominal = &correction.nominal.nominal;
    let turn_m = yaw_rad * (0.5 * nominal.track_width);
    [(forward_m - turn_m) / nominal.wheel_radius, (forward_m + turn_m) / nominal.wheel_radius]
}

/// The steering angle of a car that was measured or told to move so: `tan(steer) = L yaw / forward`. A robot
/// that records no steering angle was steered as its odometry says.
fn steered(model: &RobotModel<f64>, forward: f64, yaw: f64) -> Surroundings {
    let steer_rad = match model.drive {
        Drive::CarLike { wheelbase_m } if forward != 0.0 => Scalar::atan(wheelbase_m * yaw / forward),
        _ => 0.0,
    };
    Surroundings { steer_rad, ..Surroundings::default() }
}
