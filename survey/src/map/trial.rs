//! One run, calibrated in several ways.

use pleiad_estimation::RobotId;
use pleiad_mismatch::calibration::map::{Drift, MapCalibration, MapOptions, calibrate};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_sim_peers::{Scenario, simulate};

use super::failed;
use crate::error::SurveyError;

/// Believed at first: far from both truths.
const WRONG: Drift = Drift { trans: -0.05, rot_rad_m: 0.05 };
/// Weights of what is believed that are shown.
pub(super) const GAMMAS: [f64; 4] = [0.0, 0.5, 0.9, 1.0];
/// The one that is judged: the default.
pub(super) const JUDGED: usize = 2;
/// Bounds on what has to be seen that are shown.
pub(super) const MU_MINS: [f64; 4] = [0.0, 1100.0, 1200.0, 1300.0];
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
    /// Per `MU_MINS`, with gamma 0, from no error: what single stretches say. `None` where nothing could be matched.
    pub by_mu: Vec<Option<MapCalibration>>,
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
        let by_mu = MU_MINS
            .map(|mu_min| with(MapOptions { gamma: 1.0, mu_min, ..MapOptions::default() }).ok())
            .into();
        let off = |poses: &MapCalibration| {
            let own = &run.tracks[&ROBOT];
            let far = |time_s: f64, [x, y, _]: [f64; 3]| {
                let truth = own.pose_at(pleiad_estimation::Timestamp::from_seconds(time_s));
                (truth.x_m() - x).hypot(truth.y_m() - y)
            };
            let all = poses.stretches.iter().map(|stretch| far(stretch.time_s, stretch.pose));
            all.sum::<f64>() / poses.stretches.len() as f64
        };
        // With nothing to search odometry is taken as it is.
        let blind = MapOptions { gamma: 1.0, reach: Drift::default(), ..MapOptions::default() };
        let off_m = [off(&by_gamma[JUDGED]), off(&with(blind).map_err(failed)?)];
        Ok(Self { windows, by_gamma, by_mu, off_m })
    }

    /// What is believed in the last part of a half, by the calibration with the judged gamma.
    pub fn estimate(&self, half: usize, gamma: usize) -> Option<Drift> {
        mean(&self.last(half, gamma, |stretch| Some(stretch.estimate)))
    }

    /// Values of the stretches in the last part of a half.
    pub(super) fn last(
        &self,
        half: usize,
        gamma: usize,
        of: fn(&pleiad_mismatch::calibration::map::Stretch) -> Option<Drift>,
    ) -> Vec<Drift> {
        let [from, until] = self.windows[half].time_s;
        let from = until - LAST * (until - from);
        let within = |time_s: f64| (from..until).contains(&time_s);
        self.by_gamma[gamma]
            .stretches
            .iter()
            .filter(|stretch| within(stretch.time_s))
            .filter_map(of)
            .collect()
    }
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
