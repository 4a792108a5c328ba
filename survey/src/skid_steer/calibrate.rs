//! Effective radius and effective track width, from runs of their own.

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::motion::DifferentialDrive;
use pleiad_sim_peers::SimulatedRun;

use super::drive::{Path, driven};
use crate::error::SurveyError;
use crate::monte_carlo::over_seeds;
use crate::solo::{ROBOT, rolled};

/// Slower than this, a robot turns on the spot rather than drives, m/s against rad/s times its track.
const SPINNING: f64 = 0.5;

/// What the wheels act as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effective {
    /// Radius and track.
    pub drive: DifferentialDrive,
    /// Runs it was found from.
    pub runs: usize,
}

/// What one run says: distance driven and the angle that the wheels turned meanwhile; angle turned and the difference
/// of the treads meanwhile.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    driven_m: f64,
    rolled_rad: f64,
    turned_rad: f64,
    across_rad: f64,
}

/// From the calibration runs of these seeds: the radius is distance over wheel angle on straights, the track is the
/// difference of the treads over the angle turned on the spot, both summed over all runs. Truth stands for the tape
/// and the protractor.
///
/// # Errors
/// [`SurveyError::Scenario`] if a run cannot be simulated.
pub fn calibrate(first_seed: u64, runs: u64) -> Result<Effective, SurveyError> {
    let seeds: Vec<u64> = (first_seed..first_seed + runs).collect();
    let all = over_seeds(&seeds, |seed| {
        let (_, run) = driven(Path::Calibration, seed, &Vec::new())?;
        Ok::<Sums, SurveyError>(sums(&run))
    })?;
    let total = |pick: fn(&Sums) -> f64| all.iter().map(pick).sum::<f64>();
    let wheel_radius_m = total(|own| own.driven_m) / total(|own| own.rolled_rad);
    let track_width_m = wheel_radius_m * total(|own| own.across_rad) / total(|own| own.turned_rad);
    Ok(Effective { drive: DifferentialDrive { wheel_radius_m, track_width_m }, runs: all.len() })
}

fn sums(run: &SimulatedRun) -> Sums {
    let track = &run.tracks[&ROBOT];
    let mut sums = Sums::default();
    for tick in rolled(&run.recording.robots[&ROBOT], 1.0) {
        let [left, right] = tick.tread_m;
        let until = tick.from.plus_seconds(tick.seconds);
        let (before, after) = (track.pose_at(tick.from), track.pose_at(until));
        let (mean, across) = (0.5 * (left + right), right - left);
        if across.abs() > SPINNING * mean.abs() {
            // Both ways on the spot: absolute values, that they do not cancel.
            let sign = across.signum();
            sums.turned_rad += sign * wrap_angle(after.yaw_rad() - before.yaw_rad());
            sums.across_rad += sign * across;
        } else {
            sums.driven_m += before.between(&after).x_m();
            sums.rolled_rad += mean;
        }
    }
    sums
}
