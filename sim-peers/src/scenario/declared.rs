//! What `nominal.toml` says of a robot where that is not the truth.

use pleiad_recording::NominalRobot;
use serde::{Deserialize, Serialize};

/// Lists the keys of a robot in `nominal.toml` that can be mis-tuned.
macro_rules! declared {
    ($($(#[doc = $doc:literal])* $key:ident;)*) => {
        /// Values declared in `nominal.toml` in place of the true ones, by its own keys. The firmware turns
        /// commands into wheel speeds, and odometry into motion, with the declared wheels.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Declared {
            $($(#[doc = $doc])* pub $key: Option<f64>,)*
        }

        impl Declared {
            /// Every key with its value, if it has one.
            pub fn values(&self) -> impl Iterator<Item = (&'static str, f64)> {
                [$((stringify!($key), self.$key)),*]
                    .into_iter()
                    .filter_map(|(key, value)| value.map(|value| (key, value)))
            }

            /// One in which every key has a value.
            pub(super) fn example() -> Self {
                Self { $($key: Some(0.0)),* }
            }

            /// Puts the declared values over those of `robot`.
            pub fn apply(&self, robot: &mut NominalRobot) {
                $(if let Some(value) = self.$key {
                    robot.$key = value;
                })*
            }
        }
    };
}

declared! {
    /// Wheel radius, metres.
    wheel_radius;
    /// Distance between the wheels, metres.
    track_width;
    /// Encoder counts per turn of a wheel.
    encoder_ticks_per_rev;
    /// Time constant of the forward speed, seconds.
    servo_time_constant_s;
    /// Time constant of the yaw rate, seconds.
    servo_time_constant_turn_s;
    /// From a command to its taking effect, seconds.
    command_latency_s;
    /// Measured minus true range, metres.
    range_bias_m;
    /// Gyro bias, rad/s.
    gyro_bias_rad_s;
    /// Measured over true yaw rate.
    gyro_scale;
    /// GPS antenna forward of the axle, metres.
    gps_mount_x_m;
    /// GPS antenna left of the axle's middle, metres.
    gps_mount_y_m;
    /// Age of a GPS position at its stamp, seconds.
    gps_latency_s;
    /// Robot clock minus common time at time zero, seconds.
    clock_offset_s;
    /// Rate of the robot's clock against common time, parts per million.
    clock_drift_ppm;
}
