//! What each stage passes on, and what a hook of that stage may change.

use crate::scalar::Scalar;

/// When and whether a command takes effect.
#[derive(Clone, Copy, Debug)]
pub struct CommandTiming<S> {
    /// From stamp to effect, seconds.
    pub delay_s: S,
    /// The command never arrived: the one before it holds.
    pub lost: bool,
}

/// What the velocity servo is asked for.
#[derive(Clone, Copy, Debug)]
pub struct SetPoint<S> {
    /// Forward speed, m/s.
    pub speed_m_s: S,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: S,
}

/// The same per wheel, after the firmware's nominal kinematics.
#[derive(Clone, Copy, Debug)]
pub struct WheelSetPoint<S> {
    /// Left and right, rad/s.
    pub speed_rad_s: [S; 2],
}

/// How the servo follows its set-point.
#[derive(Clone, Copy, Debug)]
pub struct Servo<S> {
    /// First-order time constant for the speed, seconds.
    pub time_constant_s: S,
    /// First-order time constant for the yaw rate, seconds.
    pub time_constant_turn_s: S,
    /// Greatest acceleration, m/s^2.
    pub acceleration_limit_m_s2: S,
    /// What loads add to the speed that is reached in the end, m/s.
    pub droop_m_s: S,
}

/// From motor shaft to wheel.
#[derive(Clone, Copy, Debug)]
pub struct Transmission<S> {
    /// Turned in this step, left and right: the shafts' angle, to be made the wheels', radians.
    pub turned_rad: [S; 2],
    /// Where in its play each shaft is, radians from the middle. Kept from step to step.
    pub play_rad: [S; 2],
}

/// The robot as its wheels see it.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<S> {
    /// Rolling radius, left and right, metres.
    pub wheel_radius_m: [S; 2],
    /// Effective track width, metres.
    pub track_width_m: S,
    /// Added to the steering angle, radians (car-like).
    pub steer_offset_rad: S,
    /// The curvature is divided by one plus this times the squared speed, s^2/m^2 (car-like).
    pub understeer_s2_per_m2: S,
}

/// The distance that wheels roll in a step.
#[derive(Clone, Copy, Debug)]
pub struct Rolling<S> {
    /// Turned in this step, left and right, radians.
    pub turned_rad: [S; 2],
    /// Rolled in this step, left and right, metres.
    pub rolled_m: [S; 2],
}

impl<S: Scalar> Rolling<S> {
    /// Adds one distance to both wheels, metres.
    pub fn add_to_both(&mut self, distance_m: S) {
        for rolled in &mut self.rolled_m {
            *rolled += distance_m;
        }
    }
}

/// What a swinging castor remembers.
#[derive(Clone, Copy, Debug)]
pub struct Castor<S> {
    /// 1 forward, -1 backward, 0 before the first motion.
    pub direction: i8,
    /// Rolled since the castor last began to swing round, metres: negative where it begins within the step;
    /// `None` before the first reversal.
    pub since_reversal_m: Option<S>,
    /// Rolled against the direction so far, metres; from the start on, rolled either way.
    pub against_m: f64,
}

/// The motion of the body in a step.
#[derive(Clone, Copy, Debug)]
pub struct BodyMotion<S> {
    /// Forward, metres.
    pub forward_m: S,
    /// To the left, metres.
    pub left_m: S,
    /// Counter-clockwise, radians.
    pub yaw_rad: S,
    /// The state of the castor at the beginning of the step.
    pub castor: Castor<S>,
}

/// What the surroundings add to the pose in a step.
#[derive(Clone, Copy, Debug)]
pub struct MapMotion<S> {
    /// Along x and y of the map, metres.
    pub shift_m: [S; 2],
    /// Counter-clockwise, radians.
    pub yaw_rad: S,
}

impl<S: Scalar> MapMotion<S> {
    /// A share of it.
    pub(crate) fn share(&self, share: S) -> Self {
        Self { shift_m: self.shift_m.map(|shift_m| shift_m * share), yaw_rad: self.yaw_rad * share }
    }
}

/// A reading of wheel angles.
#[derive(Clone, Copy, Debug)]
pub struct EncoderReading<S> {
    /// Left and right, radians.
    pub angle_rad: [S; 2],
    /// Ticks per turn; 0 if not quantized.
    pub ticks_per_rev: S,
}

/// A reading of yaw rate.
#[derive(Clone, Copy, Debug)]
pub struct GyroReading<S> {
    /// Yaw rate, rad/s.
    pub rate_rad_s: S,
    /// The part of the bias that walks, rad/s. Kept from reading to reading.
    pub walk_rad_s: S,
}

/// How GPS sees the robot.
#[derive(Clone, Copy, Debug)]
pub struct GpsReading<S> {
    /// Antenna in the body, forward and left, metres.
    pub lever_m: [S; 2],
    /// Age at the stamp, seconds.
    pub latency_s: S,
    /// Error in the map, metres.
    pub error_m: [S; 2],
}

/// A reading of absolute heading.
#[derive(Clone, Copy, Debug)]
pub struct HeadingReading<S> {
    /// Heading, radians, not wrapped.
    pub heading_rad: S,
}

/// What is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// A landmark, by its number in the map.
    Landmark(u32),
    /// A robot, by its number.
    Robot(u32),
}

/// From where, when and at what the range sensor looks.
#[derive(Clone, Copy, Debug)]
pub struct SightingGeometry<S> {
    /// What is seen.
    pub target: Target,
    /// Where it is in the map, metres.
    pub target_m: [S; 2],
    /// Sensor in the body, forward and left, metres.
    pub lever_m: [S; 2],
    /// Yaw of the sensor in the body, radians.
    pub yaw_rad: S,
    /// Age at the stamp, seconds.
    pub latency_s: S,
}

/// A reading of range and bearing.
#[derive(Clone, Copy, Debug)]
pub struct Sighting<S> {
    /// Range, metres.
    pub range_m: S,
    /// Bearing from the sensor's forward direction, radians, left positive.
    pub bearing_rad: S,
    /// Probability that it is reported at all.
    pub detection_probability: S,
}

/// How the reference system sees the robot.
#[derive(Clone, Copy, Debug)]
pub struct TruthReading<S> {
    /// The marker in the body, forward and left, metres.
    pub lever_m: [S; 2],
    /// Yaw of the marker in the body, radians.
    pub yaw_rad: S,
    /// Age at the stamp, seconds.
    pub latency_s: S,
}

/// The stamp of the robot's clock.
#[derive(Clone, Copy, Debug)]
pub struct Stamp<S> {
    /// Seconds.
    pub stamp_s: S,
}

/// The name that a sighting is given.
#[derive(Clone, Copy, Debug)]
pub struct Identity<'a> {
    /// The target as named so far.
    pub target: Target,
    /// Whatever else could be in view.
    pub others: &'a [Target],
}

/// The spread of readings. Variance effects act here, as additions to a standard deviation, so that the
/// likelihood has a slope where they are off.
#[derive(Clone, Copy, Debug)]
pub struct Noise<S> {
    /// Range of the sighting, metres: an input.
    pub range_m: S,
    /// Bearing of the sighting, radians: an input.
    pub bearing_rad: S,
    /// One sigma of a wheel angle, radians.
    pub encoder_sigma_rad: S,
    /// One sigma of a command's delay, seconds.
    pub command_delay_sigma_s: S,
    /// Probability that a command is lost.
    pub command_loss_probability: S,
    /// One sigma of yaw rate, rad/s.
    pub gyro_sigma_rad_s: S,
    /// Variance that a gyro's bias gains in a second, rad^2/s^3.
    pub gyro_walk_variance: S,
    /// One sigma of range, metres.
    pub range_sigma_m: S,
    /// One sigma of bearing, radians.
    pub bearing_sigma_rad: S,
    /// Degrees of freedom of range and bearing noise; infinite if Gaussian.
    pub degrees_of_freedom: S,
    /// Probability that a sighting bears another's name.
    pub wrong_identity_probability: S,
}
