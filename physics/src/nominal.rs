//! What the nominal simulation believes of one robot.

use crate::scalar::Scalar;

/// Declares [`Nominal`] and [`NominalParameter`] from one list, so that neither can lack a field.
macro_rules! nominal {
    ($($(#[doc = $doc:literal])* $field:ident $Name:ident = $ideal:expr;)*) => {
        /// The nominal parameters of a robot, fields named as in `nominal.toml` (those of the range sensor
        /// begin with `sensor_`). Generic, because a fit may move them together with the effects.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Nominal<S> {
            $($(#[doc = $doc])* pub $field: S,)*
        }

        /// One field of [`Nominal`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum NominalParameter {
            $($(#[doc = $doc])* $Name,)*
        }

        impl NominalParameter {
            /// Every parameter, in the order of the fields.
            pub const ALL: &'static [Self] = &[$(Self::$Name),*];

            /// The name of the field.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Name => stringify!($field),)*
                }
            }
        }

        impl Nominal<f64> {
            /// A robot of the given wheels whose sensors are ideal: no bias, no latency, no noise.
            pub fn ideal(wheel_radius: f64, track_width: f64) -> Self {
                Self { wheel_radius, track_width, ..Self { $($field: $ideal,)* } }
            }

            /// The same numbers as another scalar, depending on nothing.
            pub fn lift<S: Scalar>(&self) -> Nominal<S> {
                Nominal { $($field: S::constant(self.$field),)* }
            }
        }

        impl<S: Scalar> Nominal<S> {
            /// The value of one parameter.
            pub fn get(&self, parameter: NominalParameter) -> S {
                match parameter {
                    $(NominalParameter::$Name => self.$field,)*
                }
            }

            /// Replaces the value of one parameter.
            pub fn set(&mut self, parameter: NominalParameter, value: S) {
                match parameter {
                    $(NominalParameter::$Name => self.$field = value,)*
                }
            }
        }
    };
}

nominal! {
    /// Loaded rolling radius of both wheels, metres.
    wheel_radius WheelRadius = 1.0;
    /// Distance between the contact points of the wheels, metres.
    track_width TrackWidth = 1.0;
    /// Encoder ticks per turn of a wheel; 0 if angles are not quantized.
    encoder_ticks_per_rev EncoderTicksPerRev = 0.0;
    /// First-order time constant of the servo for the speed, seconds.
    servo_time_constant_s ServoTimeConstant = 0.0;
    /// First-order time constant of the servo for the yaw rate, seconds.
    servo_time_constant_turn_s ServoTimeConstantTurn = 0.0;
    /// From a command's stamp to its taking effect, seconds.
    command_latency_s CommandLatency = 0.0;
    /// Measured minus true yaw rate at rest, rad/s.
    gyro_bias_rad_s GyroBias = 0.0;
    /// Measured over true yaw rate.
    gyro_scale GyroScale = 1.0;
    /// GPS antenna forward of the axle midpoint, metres.
    gps_mount_x_m GpsMountX = 0.0;
    /// GPS antenna left of the axle midpoint, metres.
    gps_mount_y_m GpsMountY = 0.0;
    /// Age of the position at its stamp, seconds.
    gps_latency_s GpsLatency = 0.0;
    /// Robot clock minus common time at time zero, seconds.
    clock_offset_s ClockOffset = 0.0;
    /// Rate of the robot's clock against common time, parts per million.
    clock_drift_ppm ClockDrift = 0.0;
    /// Measured minus true range, metres.
    range_bias_m RangeBias = 0.0;
    /// Range sensor forward of the axle midpoint, metres.
    sensor_mount_x_m SensorMountX = 0.0;
    /// Range sensor left of the axle midpoint, metres.
    sensor_mount_y_m SensorMountY = 0.0;
    /// Yaw of the range sensor in the body, radians.
    sensor_mount_yaw_rad SensorMountYaw = 0.0;
    /// Age of range and bearing at their stamp, seconds.
    sensor_latency_s SensorLatency = 0.0;
    /// Measured over true range.
    range_scale RangeScale = 1.0;
    /// Probability that what is in view is reported.
    detection_probability DetectionProbability = 1.0;
    /// One sigma of the gyro, rad/s.
    gyro_sigma_rad_s GyroSigma = 0.0;
    /// One sigma of a GPS axis, metres.
    gps_sigma_m GpsSigma = 0.0;
    /// One sigma of the heading sensor, radians.
    heading_sigma_rad HeadingSigma = 0.0;
    /// One sigma of range, metres.
    range_sigma_m RangeSigma = 0.0;
    /// One sigma of bearing, radians.
    bearing_sigma_rad BearingSigma = 0.0;
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values that are exact by construction")]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_reads_back_what_was_set() {
        let mut nominal = Nominal::ideal(0.05, 0.3);
        assert_eq!((nominal.wheel_radius, nominal.track_width), (0.05, 0.3));
        for (value, &parameter) in (7..).map(f64::from).zip(NominalParameter::ALL) {
            nominal.set(parameter, value);
        }
        for (value, &parameter) in (7..).map(f64::from).zip(NominalParameter::ALL) {
            assert_eq!(nominal.get(parameter), value, "{}", parameter.name());
        }
        assert_eq!(nominal.bearing_sigma_rad, 31.0);
    }
}
