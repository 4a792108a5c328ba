//! From the settings of a robot to its true model, and to what its firmware believes.

use pleiad_physics::{Nominal, RobotModel};

use super::policy::Twist;
use crate::scenario::{DriveKind, RobotSettings};

/// The robot as it is: its true parameters, and the effects that act on it.
pub(super) fn true_model(settings: &RobotSettings) -> RobotModel<f64> {
    let relative = &settings.relative;
    let nominal = Nominal {
        encoder_ticks_per_rev: f64::from(settings.encoder_ticks_per_rev),
        servo_time_constant_s: settings.servo_time_constant_s,
        servo_time_constant_turn_s: settings.servo_time_constant_turn_s,
        gyro_bias_rad_s: settings.gyro.bias_rad_s,
        detection_probability: 1.0 - relative.drop_out,
        gyro_sigma_rad_s: settings.gyro.sigma_rad_s,
        gps_sigma_m: settings.gps.sigma_m,
        heading_sigma_rad: settings.heading.sigma_rad,
        range_sigma_m: relative.sigma_range_m,
        bearing_sigma_rad: relative.sigma_bearing_rad,
        ..Nominal::ideal(settings.wheel_radius_m, settings.track_width_m)
    };
    RobotModel { drive: settings.drive.drive(), nominal, effects: settings.effects.clone() }
}

/// What the firmware believes of its wheels: what `nominal.toml` declares.
#[derive(Clone, Copy, Debug)]
pub(super) struct Firmware {
    radius_m: f64,
    /// Effective.
    track_m: f64,
    /// Of a car.
    wheelbase_m: Option<f64>,
    /// True over declared.
    radius_ratio: f64,
    track_ratio: f64,
}

impl Firmware {
    pub(super) fn of(settings: &RobotSettings) -> Self {
        let (true_radius_m, true_track_m) = (settings.wheel_radius_m, settings.track_width_m);
        let radius_m = settings.declared.wheel_radius.unwrap_or(true_radius_m);
        let track_m = settings.declared.track_width.unwrap_or(true_track_m);
        let car = settings.drive.kind == DriveKind::CarLike;
        Self {
            radius_m,
            track_m: settings.drive.effective_track_m(track_m),
            wheelbase_m: car.then_some(settings.drive.steered_ahead_m()),
            radius_ratio: true_radius_m / radius_m,
            track_ratio: true_track_m / track_m,
        }
    }

    /// The command with which the chain's own firmware, which knows the true wheels, turns them as fast as
    /// this one does by `given`.
    pub(super) fn executed(&self, given: Twist) -> Twist {
        Twist {
            forward_m_s: given.forward_m_s * self.radius_ratio,
            yaw_rate_rad_s: given.yaw_rate_rad_s * self.radius_ratio / self.track_ratio,
        }
    }

    /// The inverse of [`Firmware::executed`].
    pub(super) fn given(&self, executed: Twist) -> Twist {
        Twist {
            forward_m_s: executed.forward_m_s / self.radius_ratio,
            yaw_rate_rad_s: executed.yaw_rate_rad_s * self.track_ratio / self.radius_ratio,
        }
    }

    /// How far the robot went forward (metres) and turned (radians) for all it knows, when its wheels turned
    /// by these angles.
    pub(super) fn moved(&self, [left, right]: [f64; 2], steer_rad: f64) -> (f64, f64) {
        let forward_m = 0.5 * (left + right) * self.radius_m;
        let turn_rad = match self.wheelbase_m {
            None => (right - left) * self.radius_m / self.track_m,
            Some(wheelbase_m) => forward_m * steer_rad.tan() / wheelbase_m,
        };
        (forward_m, turn_rad)
    }
}
