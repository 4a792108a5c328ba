//! One run of the rover, dead reckoned and filtered.

use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::linear::Gaussian;
use pleiad_estimation::single::{Ekf, Measurement, RandomWalks, Sensor, Unicycle};
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_recording::SteerSample;
use pleiad_sim_peers::scenario::RobotSettings;
use pleiad_sim_peers::{Scenario, SimulatedRun};

use super::NAME;
use crate::error::SurveyError;
use crate::solo::{
    ROBOT, beliefs_at, error_of, in_order, pose_of, readings, rolled, scenario, simulated, told, values,
};

const SCENARIO: &str = include_str!("../../../scenarios/rover.toml");
/// When the filter begins: the rover is up to speed.
pub(super) const FROM_S: f64 = 1.0;
/// The rover's speed, as it is told to drive.
const SPEED_M_S: f64 = 0.1;
/// One sun reading in so many is used where the sun sensor is slow.
pub(super) const SLOW: usize = 10;
/// When the estimates are judged.
pub const JUDGED_S: [f64; 18] = [
    11.0, 21.0, 31.0, 41.0, 51.0, 61.0, 71.0, 81.0, 91.0, 101.0, 111.0, 121.0, 131.0, 141.0, 151.0, 161.0,
    171.0, 181.0,
];

/// How the rover is localized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Encoders and steering angle, integrated.
    DeadReckoning,
    /// Encoders, steering angle and gyro in the filter.
    Filter,
    /// And the sun sensor, at a tenth of their rate.
    SlowSun,
    /// And the sun sensor, at their rate.
    FastSun,
}

impl Method {
    /// All, from the worst.
    pub const ALL: [Self; 4] = [Self::DeadReckoning, Self::Filter, Self::SlowSun, Self::FastSun];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead reckoning",
            Self::Filter => "EKF",
            Self::SlowSun => "EKF, sun 1:10",
            Self::FastSun => "EKF, sun 1:1",
        }
    }

    /// For names of numbers.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead_reckoning",
            Self::Filter => "ekf",
            Self::SlowSun => "ekf_sun_1_10",
            Self::FastSun => "ekf_sun_1_1",
        }
    }
}

/// What one method makes of one run at the times of judgement.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// East, north, heading: estimate minus truth.
    pub errors: Vec<[f64; 3]>,
    /// Standard deviation of the heading, as the filter has it; NaN for dead reckoning.
    pub sigma_heading_rad: Vec<f64>,
    /// The estimated path at the same times.
    pub path: Vec<Pose2>,
}

/// The recording of a seed.
pub(super) fn recorded(seed: u64) -> Result<(Scenario, SimulatedRun), SurveyError> {
    let scenario = scenario(NAME, SCENARIO)?;
    let run = simulated(NAME, &scenario, seed)?;
    Ok((scenario, run))
}

/// What the filter is told of the wander of its states: the sideways slip of the scenario as the white noise that
/// spreads a path as much, and speeds that may change from one second to the next by some cm/s and rad/s.
fn walks(settings: &RobotSettings) -> RandomWalks {
    let slip = &settings.odometry.lasting;
    RandomWalks {
        position_m: slip.lateral_m_s * (2.0 * slip.time_constant_s).sqrt(),
        heading_rad: 0.0,
        speed_m_s: 0.02,
        yaw_rate_rad_s: 0.03,
        gyro_bias_rad_s: 0.0,
    }
}

/// The channels of a method, each in its order of time; the sun sensor's last.
pub(super) fn channels(scenario: &Scenario, run: &SimulatedRun, method: Method) -> Vec<Vec<Measurement<5>>> {
    let (settings, recorded) = (&scenario.robots[&ROBOT], &run.recording.robots[&ROBOT]);
    let noise = &settings.odometry.wheel_noise;
    let spread_m = 0.5 * noise.left_m_per_sqrt_s.hypot(noise.right_m_per_sqrt_s);
    // The mean of the wheels is the speed; their difference says nothing on soil on which they slip.
    let speeds = rolled(recorded, settings.wheel_radius_m)
        .iter()
        .map(|tick| Measurement {
            time: tick.middle(),
            sensor: Sensor::of(Unicycle::SPEED),
            value: 0.5 * tick.speeds().iter().sum::<f64>(),
            variance: spread_m * spread_m / tick.seconds,
        })
        .collect();
    let gyro = readings(&values(&recorded.gyro), Sensor::of(Unicycle::YAW_RATE), settings.gyro.sigma_rad_s);
    let heading = values(&recorded.heading).into_iter();
    let sun: Vec<_> = match method {
        Method::FastSun => heading.collect(),
        Method::SlowSun => heading.step_by(SLOW).collect(),
        Method::Filter | Method::DeadReckoning => Vec::new(),
    };
    let sun = readings(&sun, Sensor::of_angle(Unicycle::HEADING), settings.heading.sigma_rad);
    vec![speeds, steering(settings, &recorded.steer), gyro, sun]
}

/// Steering angles. Their noise is that of the reading and, as the white noise that spreads a heading as much, the
/// slip by which the rover turns more or less than it is steered.
fn steering(settings: &RobotSettings, steer: &[SteerSample]) -> Vec<Measurement<5>> {
    let (drive, slip) = (&settings.drive, &settings.odometry.lasting);
    let sensor = Sensor::Steering {
        wheelbase_m: drive.steered_ahead_m(),
        speed: Unicycle::SPEED,
        yaw_rate: Unicycle::YAW_RATE,
    };
    let yaw = slip.yaw_rad_s * (2.0 * slip.time_constant_s * settings.odometry.rate_hz).sqrt();
    let sigma_rad = drive.steer_sigma_rad.hypot(yaw * drive.wheelbase_m / SPEED_M_S);
    let values: Vec<(Timestamp, f64)> = steer.iter().map(|own| (own.time, own.angle_rad)).collect();
    readings(&values, sensor, sigma_rad)
}

/// The filter as it begins.
pub(super) fn begun(settings: &RobotSettings, run: &SimulatedRun) -> Option<Ekf<Unicycle, 5>> {
    let from = Timestamp::from_seconds(FROM_S);
    let prior = told(run, from)?;
    let belief = Gaussian::from_sigmas(
        [prior.pose.x_m(), prior.pose.y_m(), prior.pose.yaw_rad(), SPEED_M_S, 0.0],
        [prior.sigma_position_m, prior.sigma_position_m, prior.sigma_heading_rad, 0.02, 0.01],
    );
    Some(Ekf::new(Unicycle { walks: walks(settings) }, from, belief))
}

/// Encoders and steering angle, integrated from what the rover is told of its start; the poses at `times`.
fn dead_reckoned(settings: &RobotSettings, run: &SimulatedRun, times: &[Timestamp]) -> Option<Vec<Pose2>> {
    let recorded = &run.recording.robots[&ROBOT];
    let from = Timestamp::from_seconds(FROM_S);
    let mut pose = told(run, from)?.pose;
    let mut now = from;
    let mut poses = Vec::with_capacity(times.len());
    // Odometry and steering are read at the same ticks.
    for (tick, steer) in rolled(recorded, settings.wheel_radius_m).iter().zip(recorded.steer.windows(2)) {
        let until = tick.from.plus_seconds(tick.seconds);
        if until <= from {
            continue;
        }
        let speed = 0.5 * tick.speeds().iter().sum::<f64>();
        let angle = f64::midpoint(steer[0].angle_rad, steer[1].angle_rad);
        let rate = speed * angle.tan() / settings.drive.steered_ahead_m();
        let carried = |seconds: f64| pose.compose(&Pose2::exp(Vector3::new(speed, 0.0, rate) * seconds));
        while times.get(poses.len()).is_some_and(|time| *time < until) {
            poses.push(carried(times[poses.len()].seconds_since(now)));
        }
        pose = carried(until.seconds_since(now));
        now = until;
    }
    poses.resize(times.len(), pose);
    Some(poses)
}

/// A method on the recording of a seed.
pub(super) fn on(
    scenario: &Scenario,
    run: &SimulatedRun,
    method: Method,
    judged_s: &[f64],
) -> Result<Outcome, SurveyError> {
    let failed = |what: String| SurveyError::Diverged { study: NAME, seed: run.seed, what };
    let untold = || failed("the rover is not told its start".to_owned());
    let settings = &scenario.robots[&ROBOT];
    let times: Vec<Timestamp> = judged_s.iter().map(|own| Timestamp::from_seconds(*own)).collect();
    let (path, sigma_heading_rad) = if method == Method::DeadReckoning {
        (dead_reckoned(settings, run, &times).ok_or_else(untold)?, vec![f64::NAN; times.len()])
    } else {
        let mut filter = begun(settings, run).ok_or_else(untold)?;
        let taken = in_order(channels(scenario, run, method), filter.time());
        let beliefs = beliefs_at(&mut filter, &taken, &times, failed)?;
        let sigmas = beliefs.iter().map(|own| own.sigma(Unicycle::HEADING)).collect();
        (beliefs.iter().map(pose_of).collect(), sigmas)
    };
    let track = &run.tracks[&ROBOT];
    let errors = times.iter().zip(&path).map(|(time, pose)| error_of(pose, &track.pose_at(*time))).collect();
    Ok(Outcome { errors, sigma_heading_rad, path })
}

/// All methods on the recording of a seed, in the order of [`Method::ALL`].
///
/// # Errors
/// [`SurveyError`] for a scenario that cannot be simulated or a measurement that cannot be used.
pub fn outcome(seed: u64) -> Result<Vec<Outcome>, SurveyError> {
    let (scenario, run) = recorded(seed)?;
    Method::ALL.iter().map(|method| on(&scenario, &run, *method, &JUDGED_S)).collect()
}
