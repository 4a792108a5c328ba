//! The settings of one robot. Units are in the names; meanings and defaults are listed for users in
//! `docs/scenario.md`.

mod sensors;

use pleiad_physics::ActiveEffect;
use serde::{Deserialize, Serialize};

use super::declared::Declared;
use super::drive::DriveSettings;
use super::manoeuvre::ManoeuvreKind;

pub use sensors::{Gps, Gyro, Heading, RangeScan, RelativeKind, RelativeSensor, See};

/// Everything about one robot: body, motion, prior, sensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSettings {
    /// Where it starts; `None` places it at random.
    pub start: Option<Start>,
    /// Wheel radius, metres.
    pub wheel_radius_m: f64,
    /// Distance between the wheels, metres.
    pub track_width_m: f64,
    /// Encoder counts per turn of a wheel; 0 means no quantization.
    pub encoder_ticks_per_rev: u32,
    /// Rate of the velocity commands, Hz.
    pub command_rate_hz: f64,
    /// Time constant of the forward speed behind its command, seconds.
    pub servo_time_constant_s: f64,
    /// Time constant of the yaw rate behind its command, seconds.
    pub servo_time_constant_turn_s: f64,
    /// Commands take effect up to this much later than they are given, uniformly, seconds.
    pub command_jitter_s: f64,
    /// Change of the supply voltage, V/s; felt by `battery_sag` alone.
    pub voltage_rate_v_per_s: f64,
    /// How its wheels make it move.
    pub drive: DriveSettings,
    /// What `nominal.toml` says of it where that is not the truth.
    pub declared: Declared,
    /// What acts on it besides: written as `[[robots.effects]]` or `[[defaults.effects]]`.
    #[serde(skip)]
    pub effects: Vec<ActiveEffect<f64>>,
    /// What is known of the start.
    pub prior: PriorSettings,
    /// How it moves.
    pub motion: Motion,
    /// When it is carried off, and whereto; its odometry does not notice.
    pub kidnap: Vec<Kidnap>,
    /// Its odometry.
    pub odometry: Odometry,
    /// Its gyro.
    pub gyro: Gyro,
    /// Its GPS receiver.
    pub gps: Gps,
    /// Its absolute heading sensor.
    pub heading: Heading,
    /// What it sees of other robots and landmarks.
    pub relative: RelativeSensor,
    /// Its range scanner.
    pub scan: RangeScan,
    /// Slip, gyro, GPS and heading have noise of Student's distribution with so many degrees of freedom, above
    /// 2, and the standard deviations given; 0: normal.
    pub noise_degrees_of_freedom: f64,
}

impl Default for RobotSettings {
    fn default() -> Self {
        Self {
            start: None,
            wheel_radius_m: 0.08,
            track_width_m: 0.4,
            encoder_ticks_per_rev: 0,
            command_rate_hz: 25.0,
            servo_time_constant_s: 0.1,
            servo_time_constant_turn_s: 0.1,
            command_jitter_s: 0.0,
            voltage_rate_v_per_s: 0.0,
            drive: DriveSettings::default(),
            declared: Declared::default(),
            effects: Vec::new(),
            prior: PriorSettings::default(),
            motion: Motion::default(),
            kidnap: Vec::new(),
            odometry: Odometry::default(),
            gyro: Gyro::default(),
            gps: Gps::default(),
            heading: Heading::default(),
            relative: RelativeSensor::default(),
            scan: RangeScan::default(),
            noise_degrees_of_freedom: 0.0,
        }
    }
}

/// A start pose in the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Position along x, metres.
    pub x_m: f64,
    /// Position along y, metres.
    pub y_m: f64,
    /// Heading, radians.
    pub heading_rad: f64,
}

/// A robot is carried off: between two ticks of its odometry it comes to be elsewhere, and its wheels do not turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kidnap {
    /// When, seconds; it takes place at the first tick of the odometry from there on.
    pub time_s: f64,
    /// Whereto: position along x, metres.
    pub x_m: f64,
    /// Whereto: position along y, metres.
    pub y_m: f64,
    /// Whereto: heading, radians.
    pub heading_rad: f64,
}

/// How well the start is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PriorSettings {
    /// Whether the robot is told its start at all.
    pub known: bool,
    /// Standard deviation of the told position per axis, metres.
    pub sigma_position_m: f64,
    /// Standard deviation of the told heading, radians.
    pub sigma_heading_rad: f64,
}

impl Default for PriorSettings {
    fn default() -> Self {
        Self { known: true, sigma_position_m: 0.05, sigma_heading_rad: 0.01 }
    }
}

/// How a robot moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// Which rule.
    pub policy: Policy,
    /// Cruising speed (the fastest of `waypoints_random` and `manoeuvres`), m/s.
    pub speed_m_s: f64,
    /// Slowest cruising speed of `waypoints_random`, m/s.
    pub min_speed_m_s: f64,
    /// Largest commanded yaw rate, rad/s.
    pub max_yaw_rate_rad_s: f64,
    /// Sense of `circle` and `square`, first loop of `figure_eight`.
    pub direction: Direction,
    /// Radius of `circle` and of each loop of `figure_eight`, metres.
    pub radius_m: f64,
    /// Side of `square`, length of `line_back_and_forth`, metres.
    pub side_m: f64,
    /// Length of a turn to move under `portable_landmarks` and `one_mover`, seconds.
    pub move_s: f64,
    /// Where random waypoints lie, `[x_min, x_max, y_min, y_max]`; `None` means the whole arena, or under
    /// `manoeuvres` the robot's share of it.
    pub area_m: Option<[f64; 4]>,
    /// What `script` commands: `[forward m/s, yaw rate rad/s, seconds]`, one after the other.
    pub script: Vec<[f64; 3]>,
    /// Which manoeuvres are driven under `manoeuvres`; all if empty.
    pub manoeuvres: Vec<ManoeuvreKind>,
    /// Distance wandering robots try to keep from others, metres; 0 means they do not look.
    pub keep_away_m: f64,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            policy: Policy::WaypointsRandom,
            speed_m_s: 0.8,
            min_speed_m_s: 0.4,
            max_yaw_rate_rad_s: 1.0,
            direction: Direction::CounterClockwise,
            radius_m: 2.0,
            side_m: 4.0,
            move_s: 15.0,
            area_m: None,
            script: Vec::new(),
            manoeuvres: Vec::new(),
            keep_away_m: 0.5,
        }
    }
}

/// Rules of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// From one random point to the next.
    WaypointsRandom,
    /// A constant speed and yaw rate.
    Circle,
    /// Two circles in turn, in opposite senses.
    FigureEight,
    /// A square with turns on the spot, as UMBmark drives it.
    Square,
    /// Forth, about-turn, back, about-turn.
    LineBackAndForth,
    /// Standing still.
    Parked,
    /// Half of the robots under this rule stand while the other half wanders, in turn
    /// (Kurazume's portable landmarks).
    PortableLandmarks,
    /// One robot after the other wanders while the rest stand (millibots).
    OneMover,
    /// Everything that tells effects apart, in random order, within the robot's own area.
    Manoeuvres,
    /// The commands of [`Motion::script`], then standing still.
    Script,
}

/// A sense of turning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// To the left.
    CounterClockwise,
    /// To the right.
    Clockwise,
}

/// What a robot knows of its own motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Odometry {
    /// In which form.
    pub kind: OdometryKind,
    /// Rate, Hz; also the tick over which the body departs from the wheels.
    pub rate_hz: f64,
    /// How the body departs from what the wheels did.
    pub noise: MotionNoise,
    /// The same, from one instant to the next not at random.
    pub lasting: LastingSlip,
    /// How the wheels turn without the body noticing.
    pub wheel_noise: WheelNoise,
}

impl Default for Odometry {
    fn default() -> Self {
        Self {
            kind: OdometryKind::Velocity,
            rate_hz: 25.0,
            noise: MotionNoise::default(),
            wheel_noise: WheelNoise::default(),
            lasting: LastingSlip::default(),
        }
    }
}

/// White noise of the wheels' readings: over a tick of `dt` seconds in which it turns, the tread of a wheel moves by
/// `n ~ N(0, sigma^2 dt)` more than the ground under it. The body does not notice: it moves by what was rolled. So the
/// mean speed of a wheel over a tick is read with the variance `sigma^2 / dt`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WheelNoise {
    /// Of the left wheel, m/sqrt(s).
    pub left_m_per_sqrt_s: f64,
    /// Of the right wheel, m/sqrt(s).
    pub right_m_per_sqrt_s: f64,
}

/// Coloured slip: velocities of the body besides those of its wheels, each an Ornstein-Uhlenbeck process
/// (`uhlenbeck1930`) with this standard deviation and one time constant; the autocovariance is
/// `sigma^2 exp(-|t| / time_constant_s)`. While the wheels stand still so does the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LastingSlip {
    /// Forward, m/s.
    pub speed_m_s: f64,
    /// Sideways, m/s.
    pub lateral_m_s: f64,
    /// Yaw, rad/s.
    pub yaw_rad_s: f64,
    /// Time over which it is forgotten, seconds.
    pub time_constant_s: f64,
}

impl Default for LastingSlip {
    fn default() -> Self {
        Self { speed_m_s: 0.0, lateral_m_s: 0.0, yaw_rad_s: 0.0, time_constant_s: 1.0 }
    }
}

impl LastingSlip {
    /// Variances of the displacement `(x, y, yaw)` over `duration_s` seconds, m^2, m^2, rad^2.
    pub fn variance(&self, duration_s: f64) -> [f64; 3] {
        let spans = duration_s / self.time_constant_s;
        let factor = 2.0 * self.time_constant_s.powi(2) * (spans - 1.0 + (-spans).exp());
        [self.speed_m_s, self.lateral_m_s, self.yaw_rad_s].map(|sigma| sigma * sigma * factor)
    }
}

/// Forms of odometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OdometryKind {
    /// Forward speed and yaw rate that hold until the next sample.
    Velocity,
    /// Cumulative wheel angles.
    Wheels,
    /// Motion since the previous sample.
    Increment,
}

/// White process noise in the body frame.
///
/// Over a tick of `dt` seconds in which the wheels say `U = exp((v dt, 0, w dt))` the body moves by
/// `U exp(n)`, `n ~ N(0, diag(`[`MotionNoise::variance`]`))`: exactly the law of a filter that propagates
/// with `U` and adds this variance in the frame of the pose after the step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionNoise {
    /// Forward, per square root of time, m/sqrt(s).
    pub speed_m_per_sqrt_s: f64,
    /// Sideways, per square root of time, m/sqrt(s).
    pub lateral_m_per_sqrt_s: f64,
    /// Yaw, per square root of time, rad/sqrt(s).
    pub yaw_rad_per_sqrt_s: f64,
    /// Forward, per square root of distance driven, m/sqrt(m).
    pub speed_m_per_sqrt_m: f64,
    /// Yaw, per square root of angle turned, rad/sqrt(rad).
    pub yaw_rad_per_sqrt_rad: f64,
    /// No noise over ticks in which the wheels stand still.
    pub quiet_at_standstill: bool,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self {
            speed_m_per_sqrt_s: 0.02,
            lateral_m_per_sqrt_s: 0.002,
            yaw_rad_per_sqrt_s: 0.01,
            speed_m_per_sqrt_m: 0.0,
            yaw_rad_per_sqrt_rad: 0.0,
            quiet_at_standstill: true,
        }
    }
}

impl MotionNoise {
    /// Variances of `(x, y, yaw)` in m^2, m^2, rad^2 over a tick of `dt_s` seconds in which the wheels
    /// say `forward_m` and `turn_rad`.
    pub fn variance(&self, forward_m: f64, turn_rad: f64, dt_s: f64) -> [f64; 3] {
        if self.quiet_at_standstill && forward_m == 0.0 && turn_rad == 0.0 {
            return [0.0; 3];
        }
        [
            self.speed_m_per_sqrt_s.powi(2) * dt_s + self.speed_m_per_sqrt_m.powi(2) * forward_m.abs(),
            self.lateral_m_per_sqrt_s.powi(2) * dt_s,
            self.yaw_rad_per_sqrt_s.powi(2) * dt_s + self.yaw_rad_per_sqrt_rad.powi(2) * turn_rad.abs(),
        ]
    }
}
