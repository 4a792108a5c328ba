//! The steered wheels of a car.

use super::policy::Twist;
use crate::scenario::{DriveKind, RobotSettings};

/// Slower than this a car keeps its steering angle, m/s.
const STEERABLE_M_S: f64 = 1e-3;

/// The steering servo of a car; idle in any other robot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steering {
    car: bool,
    /// Negative for rear steering.
    wheelbase_m: f64,
    max_steer_rad: f64,
    time_constant_s: f64,
    target_rad: f64,
    angle_rad: f64,
}

impl Steering {
    pub(super) fn new(settings: &RobotSettings) -> Self {
        Self {
            car: settings.drive.kind == DriveKind::CarLike,
            wheelbase_m: settings.drive.steered_ahead_m(),
            max_steer_rad: settings.drive.max_steer_rad,
            time_constant_s: settings.servo_time_constant_turn_s,
            target_rad: 0.0,
            angle_rad: 0.0,
        }
    }

    /// The steering angle as the servo holds it, radians, left positive; 0 unless car-like.
    pub(super) fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// The command nearest to `wanted` that the robot can follow: a car turns only while it drives.
    pub(super) fn feasible(&self, wanted: Twist) -> Twist {
        if !self.car {
            return wanted;
        }
        let most = wanted.forward_m_s.abs() * self.max_steer_rad.tan() / self.wheelbase_m.abs();
        Twist { yaw_rate_rad_s: wanted.yaw_rate_rad_s.clamp(-most, most), ..wanted }
    }

    /// Turns the wheels for a step towards the angle that the command asks for, `atan(w L / v)`.
    pub(super) fn follow(&mut self, command: Twist, step_s: f64) {
        if !self.car {
            return;
        }
        if command.forward_m_s.abs() > STEERABLE_M_S {
            let curvature = command.yaw_rate_rad_s / command.forward_m_s;
            self.target_rad =
                (curvature * self.wheelbase_m).atan().clamp(-self.max_steer_rad, self.max_steer_rad);
        }
        let behind = self.angle_rad - self.target_rad;
        self.angle_rad = self.target_rad + behind * (-step_s / self.time_constant_s).exp();
    }
}
