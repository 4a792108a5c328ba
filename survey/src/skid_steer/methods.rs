//! The three methods on one run.

use pleiad_estimation::linear::Gaussian;
use pleiad_estimation::motion::{
    DeadReckoning, DifferentialDrive, MotionModel, MotionNoise, OdometryRefusal, YawSource,
};
use pleiad_estimation::sample::Reading;
use pleiad_estimation::single::{Ekf, Measurement, PairOfWheels, RandomWalks, Sensor};
use pleiad_estimation::{Pose2, Timestamp};
use pleiad_sim_peers::{Scenario, SimulatedRun};

use super::drive::{Path, driven};
use super::{Effective, NAME};
use crate::error::SurveyError;
use crate::solo::{ROBOT, beliefs_at, error_of, in_order, pose_of, readings, rolled, values};

/// What the filter is told of the wander of its states, per root of a second: speeds that step at every command, and
/// a heading and a position that wander by what gyro and skid leave out.
const WALKS: RandomWalks = RandomWalks {
    position_m: 0.01,
    heading_rad: 0.004,
    speed_m_s: 0.3,
    yaw_rate_rad_s: 0.5,
    gyro_bias_rad_s: 0.0002,
};

/// How the robot is localized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Odometry with the radius and the track that the firmware believes.
    Raw,
    /// Odometry with those found on other runs.
    Calibrated,
    /// Wheel speeds, with the radius found on other runs, and gyro in the filter.
    Filter,
}

impl Method {
    /// All, in the order of the published table.
    pub const ALL: [Self; 3] = [Self::Raw, Self::Calibrated, Self::Filter];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Raw => "raw odometry",
            Self::Calibrated => "calibrated odometry",
            Self::Filter => "EKF",
        }
    }
}

/// Error at the end of a path over the distance driven, percent, by method in the order of [`Method::ALL`].
///
/// # Errors
/// [`SurveyError`] for a scenario that cannot be simulated or a measurement that cannot be used.
pub fn relative_errors(path: Path, seed: u64, calibrated: &Effective) -> Result<[f64; 3], SurveyError> {
    let (scenario, run) = driven(path, seed, &Vec::new())?;
    let end = run.tracks[&ROBOT].end();
    let distance_m = distance_m(&run);
    let mut errors = [0.0; 3];
    for (error, method) in errors.iter_mut().zip(Method::ALL) {
        let poses = poses(&scenario, &run, method, calibrated, &[end])?;
        let [x, y, _] = error_of(&poses[0], &run.tracks[&ROBOT].pose_at(end));
        *error = 100.0 * x.hypot(y) / distance_m;
    }
    Ok(errors)
}

/// Length of the true path, m.
pub(super) fn distance_m(run: &SimulatedRun) -> f64 {
    let truth = &run.recording.robots[&ROBOT].truth;
    let steps = truth.windows(2).map(|pair| (pair[1].pose.position() - pair[0].pose.position()).norm());
    steps.sum()
}

/// The poses of a method at `times`, which increase.
pub(super) fn poses(
    scenario: &Scenario,
    run: &SimulatedRun,
    method: Method,
    calibrated: &Effective,
    times: &[Timestamp],
) -> Result<Vec<Pose2>, SurveyError> {
    let settings = &scenario.robots[&ROBOT];
    let believed = DifferentialDrive {
        wheel_radius_m: settings.wheel_radius_m,
        track_width_m: settings.drive.effective_track_m(settings.track_width_m),
    };
    match method {
        Method::Raw => odometry(run, believed, times),
        Method::Calibrated => odometry(run, calibrated.drive, times),
        Method::Filter => {
            let beliefs = filtered(scenario, run, calibrated, Fixes::Ignored, times)?;
            Ok(beliefs.iter().map(pose_of).collect())
        }
    }
}

fn untold(run: &SimulatedRun) -> SurveyError {
    diverged(run, "the robot is not told its start".to_owned())
}

fn diverged(run: &SimulatedRun, what: String) -> SurveyError {
    SurveyError::Diverged { study: NAME, seed: run.seed, what }
}

/// Odometry from what the robot is told of its start; each pose is that of the last tick before its time.
fn odometry(
    run: &SimulatedRun,
    drive: DifferentialDrive,
    times: &[Timestamp],
) -> Result<Vec<Pose2>, SurveyError> {
    let mut reckoning = DeadReckoning::new(MotionModel {
        drive: Some(drive),
        noise: MotionNoise::default(),
        yaw: YawSource::Odometry,
        gyro_bias_rad_s: 0.0,
    });
    let mut pose = run.priors.get(&ROBOT).ok_or_else(|| untold(run))?.pose;
    let mut poses = Vec::with_capacity(times.len());
    for sample in &run.recording.robots[&ROBOT].odometry {
        while times.get(poses.len()).is_some_and(|time| *time < sample.time) {
            poses.push(pose);
        }
        let refused = |error: OdometryRefusal| diverged(run, error.to_string());
        if let Some(step) = reckoning.odometry(*sample).map_err(refused)? {
            pose = pose.compose(&Pose2::exp(step.motion));
        }
    }
    poses.resize(times.len(), pose);
    Ok(poses)
}

/// What is done with GPS fixes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fixes {
    /// Nothing.
    Ignored,
    /// They are taken with their sigma times this factor: 1 is the truth.
    Taken(f64),
}

/// The filter's beliefs at `times`.
pub(super) fn filtered(
    scenario: &Scenario,
    run: &SimulatedRun,
    calibrated: &Effective,
    fixes: Fixes,
    times: &[Timestamp],
) -> Result<Vec<Gaussian<7>>, SurveyError> {
    let (settings, recorded) = (&scenario.robots[&ROBOT], &run.recording.robots[&ROBOT]);
    let prior = run.priors.get(&ROBOT).ok_or_else(|| untold(run))?;
    let from = Timestamp::from_seconds(0.0);
    let belief = Gaussian::from_sigmas(
        [prior.pose.x_m(), prior.pose.y_m(), prior.pose.yaw_rad(), 0.0, 0.0, 0.0, 0.0],
        [prior.sigma_position_m, prior.sigma_position_m, prior.sigma_heading_rad, 0.01, 0.01, 0.01, 0.0005],
    );
    let mut filter = Ekf::new(PairOfWheels { walks: WALKS }, from, belief);
    let noise = &settings.odometry.wheel_noise;
    let sides =
        [(PairOfWheels::LEFT, noise.left_m_per_sqrt_s), (PairOfWheels::RIGHT, noise.right_m_per_sqrt_s)];
    let ticks = rolled(recorded, calibrated.drive.wheel_radius_m);
    let mut wheels = Vec::new();
    for tick in &ticks {
        for (side, (state, sigma)) in sides.into_iter().enumerate() {
            let variance = sigma * sigma / tick.seconds;
            let value = tick.speeds()[side];
            wheels.push(Measurement { time: tick.middle(), sensor: Sensor::of(state), value, variance });
        }
    }
    let yaw_rate = Sensor::sum(&[(PairOfWheels::YAW_RATE, 1.0), (PairOfWheels::GYRO_BIAS, 1.0)]);
    let gyro = readings(&values(&recorded.gyro), yaw_rate, settings.gyro.sigma_rad_s);
    let mut positions = Vec::new();
    if let Fixes::Taken(factor) = fixes {
        for fix in &recorded.gps {
            let Reading::Gps { x_m, y_m } = fix.reading else { continue };
            let variance = (factor * settings.gps.sigma_m).powi(2);
            for (state, value) in [(PairOfWheels::X, x_m), (PairOfWheels::Y, y_m)] {
                positions.push(Measurement { time: fix.time, sensor: Sensor::of(state), value, variance });
            }
        }
    }
    let taken = in_order([wheels, gyro, positions], from);
    beliefs_at(&mut filter, &taken, times, |what| diverged(run, what))
}
