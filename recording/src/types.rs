//! The recording in memory: per robot and channel, sorted by time.

use std::collections::BTreeMap;

use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_physics::Drive;

use crate::effect_spec::DeclaredEffect;

/// What a team of robots recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Name, for people: the folder's name.
    pub name: String,
    /// The map: landmark positions, metres.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Walls of the map, for range scans: segments `[x0, y0, x1, y1]`, metres.
    pub walls: Vec<[f64; 4]>,
    /// What the nominal simulation believes; `None` if the recording does not say.
    pub nominal: Option<Nominal>,
    /// One recording per robot.
    pub robots: BTreeMap<RobotId, RobotRecording>,
}

/// What one robot recorded: every channel sorted by time, without duplicates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RobotRecording {
    /// Commands received by the firmware.
    pub commands: Vec<Command>,
    /// Odometry of any kind: `Velocity`, `Wheels` or `Increment` readings.
    pub odometry: Vec<Sample>,
    /// `Gyro` readings.
    pub gyro: Vec<Sample>,
    /// `Gps` readings.
    pub gps: Vec<Sample>,
    /// `Heading` readings.
    pub heading: Vec<Sample>,
    /// `Sighting` readings; several may share one stamp.
    pub sightings: Vec<Sample>,
    /// Steering angles; empty unless the robot steers its wheels.
    pub steer: Vec<SteerSample>,
    /// Beams of range scans that met something; those of one scan share its stamp.
    pub scans: Vec<BeamSample>,
    /// Ground truth, for judging only: no estimator ever sees it.
    pub truth: Vec<TruthSample>,
}

/// A velocity command; it holds until the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// When it was received.
    pub time: Timestamp,
    /// Forward velocity, m/s.
    pub forward_m_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
}

/// How far the front wheels were steered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteerSample {
    /// When.
    pub time: Timestamp,
    /// Counter-clockwise from straight ahead, radians.
    pub angle_rad: f64,
}

/// One beam of a range scan that met something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamSample {
    /// When the scan was taken.
    pub time: Timestamp,
    /// Direction in the body frame, radians.
    pub bearing_rad: f64,
    /// How far, metres.
    pub range_m: f64,
}

/// Where the robot really was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthSample {
    /// When, by the clock of the ground truth.
    pub time: Timestamp,
    /// Where: `map_from_robot` of the axle midpoint.
    pub pose: Pose2,
}

/// What the nominal simulation believes (`nominal.toml`); keys as in the recording format, SI units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nominal {
    /// Declared noises and floors.
    pub noise: NominalNoise,
    /// The range-bearing sensor.
    pub range_sensor: NominalRangeSensor,
    /// Per robot.
    pub robots: BTreeMap<RobotId, NominalRobot>,
}

/// Declared one-sigma noises and the declared floors of real rolling contact.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "the names are the keys of nominal.toml and carry their units")]
pub struct NominalNoise {
    pub gyro_sigma_rad_s: f64,
    pub gps_sigma_m: f64,
    pub heading_sigma_rad: f64,
    pub range_sigma_m: f64,
    pub bearing_sigma_rad: f64,
    pub truth_sigma_m: f64,
    pub truth_sigma_rad: f64,
    pub odometry_floor_pos_sigma_m_per_1s: f64,
    pub odometry_floor_heading_sigma_rad_per_1s: f64,
    pub odometry_floor_lateral_slip_s: f64,
    pub gyro_floor_lag_s: f64,
    pub command_floor_lag_s: f64,
    pub command_floor_wheel_speed_offset_rad_s: f64,
    pub command_floor_wheel_angle_sigma_rad_per_0p2s: f64,
    pub clean_drift_fraction_of_distance: f64,
    pub command_jitter_s: f64,
}

/// The declared range-bearing sensor.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "the names are the keys of nominal.toml and carry their units")]
pub struct NominalRangeSensor {
    pub max_range_m: f64,
    pub min_range_m: f64,
    pub half_fov_rad: f64,
    pub detection_probability: f64,
    pub mount_x_m: f64,
    pub mount_y_m: f64,
    pub mount_yaw_rad: f64,
    pub latency_s: f64,
    pub range_scale: f64,
}

/// The declared parameters of one robot.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "the names are the keys of nominal.toml; lengths in metres, times in seconds")]
pub struct NominalRobot {
    pub wheel_radius: f64,
    pub track_width: f64,
    /// 0 where the encoder is believed to be exact.
    pub encoder_ticks_per_rev: f64,
    pub servo_time_constant_s: f64,
    pub servo_time_constant_turn_s: f64,
    pub command_latency_s: f64,
    pub range_bias_m: f64,
    pub gyro_bias_rad_s: f64,
    pub gyro_scale: f64,
    pub gps_mount_x_m: f64,
    pub gps_mount_y_m: f64,
    pub gps_latency_s: f64,
    pub clock_offset_s: f64,
    pub clock_drift_ppm: f64,
    /// Declared channel rates in Hz, by the key's name (`gps_rate_hz`); 0 where the channel is absent.
    pub rates_hz: BTreeMap<String, f64>,
    /// How the wheels make the robot move.
    pub drive: Drive,
    /// What acts on the robot besides: none in a nominal model, what was found in a corrected one.
    pub effects: Vec<DeclaredEffect>,
}

impl RobotRecording {
    /// Appends a sample to the channel it belongs to; it has to be later than what the channel holds.
    pub fn push(&mut self, sample: Sample) {
        let channel = match sample.reading {
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => &mut self.odometry,
            Reading::Gyro { .. } => &mut self.gyro,
            Reading::Gps { .. } => &mut self.gps,
            Reading::Heading { .. } => &mut self.heading,
            Reading::Sighting { .. } => &mut self.sightings,
        };
        channel.push(sample);
    }

    /// All samples an agent is fed, merged by time. At equal stamps odometry and gyro come before what
    /// was observed, so that an observation at the time of an odometry sample can be placed at once.
    pub fn samples(&self) -> Vec<Sample> {
        let mut all: Vec<Sample> = [&self.odometry, &self.gyro, &self.gps, &self.heading, &self.sightings]
            .into_iter()
            .flatten()
            .copied()
            .collect();
        all.sort_by_key(|sample| (sample.time, channel_rank(&sample.reading)));
        all
    }
}

fn channel_rank(reading: &Reading) -> u8 {
    match reading {
        Reading::Gyro { .. } => 0,
        Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => 1,
        Reading::Gps { .. } => 2,
        Reading::Heading { .. } => 3,
        Reading::Sighting { .. } => 4,
    }
}
