//! One run, calibrated in several ways.

use pleiad_estimation::{RobotId, Timestamp};
use pleiad_mismatch::calibration::map::{Drift, MapCalibration, MapOptions, Stretch, calibrate};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_sim_peers::{Scenario, SimulatedRun, simulate};

use super::failed;
use crate::error::SurveyError;

/// Believed at first: far from both truths.
const WRONG: Drift = Drift { trans: -0.05, rot_rad_m: 0.05 };
/// Weights of what is believed that are shown.
pub(super) const GAMMAS: [f64; 4] = [0.0, 0.5, 0.9, 1.0];
/// The one that is judged: the default.
pub(super) const JUDGED: usize = 2;
/// Bounds on what has to be seen that are shown.
pub(super) const MU_MINS: [f64; 4] = [0.0, 10.0, 30.0, 100.0];
/// The default of them.
pub(super) const DEFAULT_MU: usize = 1;
/// Of a scanner that sees little in this room, metres: `mu_min` is tried with it.
pub(super) const SHORT_M: f64 = 4.0;
const ROBOT: RobotId = RobotId(1);
/// The estimate of a half is its mean over the last part of it, so long as a share of the half.
const LAST: f64 = 0.4;

/// A part of a run with what acted in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// From and until, seconds.
    pub time_s: [f64; 2],
    /// Injected.
    pub injected: Drift,
}

/// One run.
pub struct Trial {
    /// Both halves.
    pub windows: [Window; 2],
    /// Per `GAMMAS`, from wrong parameters.
    pub by_gamma: Vec<MapCalibration>,
    /// Per `MU_MINS`, from no error, with a scanner of `SHORT_M`; and the mean distance from the truth at the ends of
    /// stretches, metres. `None` where nothing could be matched.
    pub by_mu: Vec<Option<(MapCalibration, f64)>>,
    /// Mean distance from the truth at the ends of stretches, metres: with matching, and by odometry alone.
    pub off_m: [f64; 2],
}

impl Trial {
    pub(super) fn run(scenario: &Scenario, seed: u64) -> Result<Self, SurveyError> {
        let windows = windows(scenario)?;
        let run = simulate(scenario, seed).map_err(failed)?;
        let with = |options: MapOptions| calibrate(&run.recording, ROBOT, &options);
        let mut by_gamma = Vec::new();
        for gamma in GAMMAS {
            by_gamma.push(with(MapOptions { gamma, start: WRONG, ..wide() }).map_err(failed)?);
        }
        let mut short = scenario.clone();
        if let Some(settings) = short.robots.get_mut(&ROBOT) {
            settings.scan.max_range_m = SHORT_M;
        }
        let short = simulate(&short, seed).map_err(failed)?;
        let by_mu = MU_MINS.map(|mu_min| {
            let options = MapOptions { mu_min, ..MapOptions::default() };
            let found = calibrate(&short.recording, ROBOT, &options).ok()?;
            let off_m = off_m(&short, &found);
            Some((found, off_m))
        });
        // With nothing to search odometry is taken as it is.
        let blind = MapOptions { gamma: 1.0, reach: Drift::default(), ..MapOptions::default() };
        let off_m = [off_m(&run, &by_gamma[JUDGED]), off_m(&run, &with(blind).map_err(failed)?)];
        Ok(Self { windows, by_gamma, by_mu: by_mu.into(), off_m })
    }

    /// What is believed in the last part of a half, by the calibration with the judged gamma.
    pub fn estimate(&self, half: usize, gamma: usize) -> Option<Drift> {
        mean(&self.last(half, gamma, |stretch| Some(stretch.estimate)))
    }

    /// Values of the stretches in the last part of a half.
    pub(super) fn last(&self, half: usize, gamma: usize, of: fn(&Stretch) -> Option<Drift>) -> Vec<Drift> {
        self.settled(half, &self.by_gamma[gamma]).filter_map(of).collect()
    }

    /// The stretches in the last part of a half.
    pub(super) fn settled<'a>(
        &self,
        half: usize,
        found: &'a MapCalibration,
    ) -> impl Iterator<Item = &'a Stretch> + use<'a> {
        let [from, until] = self.windows[half].time_s;
        let from = until - LAST * (until - from);
        found.stretches.iter().filter(move |stretch| (from..until).contains(&stretch.time_s))
    }
}

/// Mean distance from the truth at the ends of stretches, metres.
fn off_m(run: &SimulatedRun, found: &MapCalibration) -> f64 {
    let far = |stretch: &Stretch| {
        let truth = run.tracks[&ROBOT].pose_at(Timestamp::from_seconds(stretch.time_s));
        (truth.x_m() - stretch.pose[0]).hypot(truth.y_m() - stretch.pose[1])
    };
    found.stretches.iter().map(far).sum::<f64>() / found.stretches.len() as f64
}

/// A search that reaches the truth from wrong parameters.
fn wide() -> MapOptions {
    MapOptions { reach: Drift { trans: 0.12, rot_rad_m: 0.12 }, ..MapOptions::default() }
}

fn mean(drifts: &[Drift]) -> Option<Drift> {
    let count = drifts.len() as f64;
    let sum = |of: fn(&Drift) -> f64| drifts.iter().map(of).sum::<f64>() / count;
    (!drifts.is_empty())
        .then(|| Drift { trans: sum(|drift| drift.trans), rot_rad_m: sum(|drift| drift.rot_rad_m) })
}

/// The halves of a scenario, by the windows of its effects.
fn windows(scenario: &Scenario) -> Result<[Window; 2], SurveyError> {
    let settings = scenario.robots.get(&ROBOT).ok_or_else(|| failed("robot 1 is missing"))?;
    let change_s = settings
        .effects
        .iter()
        .filter_map(|active| active.scope.window_s)
        .map(|(from, _)| from)
        .fold(0.0, f64::max);
    let injected = |time_s: f64| {
        let acts = |active: &&ActiveEffect<f64>| {
            active.scope.window_s.is_none_or(|(from, until)| (from..until).contains(&time_s))
        };
        let mut drift = Drift::default();
        for active in settings.effects.iter().filter(acts) {
            match active.effect() {
                Effect::WheelRadiusError => drift.trans += active.values()[0],
                Effect::UnequalWheelRadii => drift.rot_rad_m -= active.values()[0] / settings.track_width_m,
                _ => {}
            }
        }
        drift
    };
    Ok([[0.0, change_s], [change_s, scenario.duration_s]].map(|[from, until]| Window {
        time_s: [from, until],
        injected: injected(f64::midpoint(from, until)),
    }))
}
