//! GPS outdoors, dead reckoning indoors.

use pleiad_estimation::Timestamp;
use pleiad_sim_peers::SimulatedRun;

use super::Effective;
use super::drive::{Path, driven};
use super::methods::{Fixes, filtered};
use crate::error::SurveyError;
use crate::solo::{ROBOT, error_of, pose_of};

/// Reception on the long run: outdoors, indoors, outdoors again.
pub(super) const OUTDOORS_S: [[f64; 2]; 2] = [[0.0, 120.0], [240.0, 1e4]];
/// What a fix is trusted for by a filter that takes it for nearly exact: its sigma times this.
const OVERTRUSTED: f64 = 0.1;

/// Squared position errors of the filter on one run, m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixOutcome {
    /// Without fixes.
    pub without: f64,
    /// With fixes of their sigma.
    pub with: f64,
    /// With fixes taken for ten times as good as they are: a planted fault.
    pub overtrusted: f64,
}

/// A square of 20 m with a fix a second: dead reckoning errs by a fraction of the fixes' sigma, mean over the run.
///
/// # Errors
/// [`SurveyError`] for a scenario that cannot be simulated or a measurement that cannot be used.
pub fn short_run(seed: u64, calibrated: &Effective) -> Result<FixOutcome, SurveyError> {
    let (scenario, run) = driven(Path::Square, seed, &vec![[0.0, 1e4]])?;
    let times = every_second(&run);
    let mean = |fixes| -> Result<f64, SurveyError> {
        let beliefs = filtered(&scenario, &run, calibrated, fixes, &times)?;
        let squares = beliefs.iter().zip(&times).map(|(own, time)| squared(&run, &pose_of(own), *time));
        Ok(squares.sum::<f64>() / times.len() as f64)
    };
    Ok(FixOutcome {
        without: mean(Fixes::Ignored)?,
        with: mean(Fixes::Taken(1.0))?,
        overtrusted: mean(Fixes::Taken(OVERTRUSTED))?,
    })
}

/// The filter on four laps of a square of 8 m, of which one and a bit are driven indoors.
#[derive(Clone, Debug)]
pub struct Laps {
    /// Seconds.
    pub times_s: Vec<f64>,
    /// Squared position error without fixes, m^2.
    pub without: Vec<f64>,
    /// With them.
    pub with: Vec<f64>,
    /// Standard deviation of the position with them (root of the mean of both axes' variances), m.
    pub sigma_m: Vec<f64>,
}

/// The long run of a seed.
///
/// # Errors
/// As [`short_run`].
pub fn laps(seed: u64, calibrated: &Effective) -> Result<Laps, SurveyError> {
    let (scenario, run) = driven(Path::Laps, seed, &OUTDOORS_S.to_vec())?;
    let times = every_second(&run);
    let without = filtered(&scenario, &run, calibrated, Fixes::Ignored, &times)?;
    let with = filtered(&scenario, &run, calibrated, Fixes::Taken(1.0), &times)?;
    let errors = |beliefs: &[pleiad_estimation::linear::Gaussian<7>]| -> Vec<f64> {
        beliefs.iter().zip(&times).map(|(own, time)| squared(&run, &pose_of(own), *time)).collect()
    };
    Ok(Laps {
        times_s: times.iter().map(|time| time.seconds()).collect(),
        without: errors(&without),
        with: errors(&with),
        sigma_m: with.iter().map(|own| own.sigma(0).hypot(own.sigma(1)) / std::f64::consts::SQRT_2).collect(),
    })
}

fn squared(run: &SimulatedRun, pose: &pleiad_estimation::Pose2, time: Timestamp) -> f64 {
    let [x, y, _] = error_of(pose, &run.tracks[&ROBOT].pose_at(time));
    x * x + y * y
}

#[allow(clippy::cast_possible_truncation, reason = "runs last minutes")]
fn every_second(run: &SimulatedRun) -> Vec<Timestamp> {
    let last = run.tracks[&ROBOT].end().seconds().floor() as i32;
    (1..=last).map(|second| Timestamp::from_seconds(f64::from(second))).collect()
}
