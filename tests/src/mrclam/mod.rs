//! The diagnosis of real robots, fitted on one MRCLAM dataset and judged on another: what
//! `docs/benchmarks/mrclam-diagnosis.md` reports and `tests/recordings_mrclam_diagnosis.rs` claims.

#![allow(
    clippy::panic,
    clippy::expect_used,
    clippy::missing_panics_doc,
    reason = "helpers of tests fail by panicking"
)]

mod differences;

use std::collections::BTreeMap;
use std::path::PathBuf;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{
    DiagnoseOptions, Diagnosis, Evidence, KnownFit, Rollout, diagnose, fit_known, models, rollouts,
};
use pleiad_physics::{ActiveEffect, Effect, RobotModel};
use pleiad_recording::{ReadOptions, Recording};

use crate::bootstrap::Pair;
pub use differences::{CHANGES, Change, Difference, differences};

/// What anyone would refit first: the scales of forward motion and of turns.
pub const REFITTED: [Effect; 2] = [Effect::WheelRadiusError, Effect::TrackWidthError];

/// The folder of a dataset.
pub fn folder(number: u32) -> PathBuf {
    let how = "set PLEIAD_RECORDINGS to the folder that holds mrclam/MRCLAM_Dataset2 and \
               mrclam/MRCLAM_Dataset6 (published by their authors at asrl.utias.utoronto.ca/datasets/mrclam)";
    let folder = std::env::var_os("PLEIAD_RECORDINGS").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| panic!("PLEIAD_RECORDINGS is not set; {how}"));
    let folder = folder.join(format!("mrclam/MRCLAM_Dataset{number}"));
    assert!(folder.is_dir(), "{} is not a folder; {how}", folder.display());
    folder
}

/// A dataset as a recording.
pub fn recording(number: u32) -> Recording {
    let (recording, _) =
        pleiad_recording::open(&folder(number), &ReadOptions::default()).expect("a dataset that can be read");
    recording
}

/// Diagnoses one recording and judges it on another.
pub fn fitted_and_tested(fit_on: &Recording, test_on: &Recording) -> Diagnosis {
    let options = DiagnoseOptions {
        fit_on: vec![fit_on.name.clone()],
        test_on: vec![test_on.name.clone()],
        ..DiagnoseOptions::default()
    };
    diagnose(&[fit_on.clone(), test_on.clone()], &options).expect("recordings that can be compared")
}

/// Effects as a model applies them.
pub fn active(fits: &[KnownFit]) -> Vec<ActiveEffect<f64>> {
    let one = |fit: &KnownFit| {
        let values: Vec<f64> = fit.parameters.iter().map(|parameter| parameter.value).collect();
        ActiveEffect::new(fit.effect, &values).expect("as many values as the effect has parameters")
    };
    fits.iter().map(one).collect()
}

/// The nominal models of a recording with what anyone would refit first, fitted on another.
pub fn refitted(fit_on: &Recording, test_on: &Recording) -> BTreeMap<RobotId, RobotModel<f64>> {
    let mut models = models(test_on).expect("models of a recording");
    for (&robot, model) in &mut models {
        let fits = fit_known(fit_on, robot, &REFITTED).expect("models of a recording");
        model.effects.extend(active(&fits));
    }
    models
}

/// What a robot's predictions are worth on a recording that neither model was fitted on.
pub struct Direction {
    /// Which robot.
    pub robot: RobotId,
    /// Errors of heading at the end of each prediction, radians: by the model to be beaten and by the other.
    pub heading: Vec<Pair>,
    /// Errors of position, metres.
    pub position: Vec<Pair>,
}

/// Compares predictions over `horizon_s` by two models of every robot.
pub fn directions(
    test_on: &Recording,
    before: &BTreeMap<RobotId, RobotModel<f64>>,
    after: &BTreeMap<RobotId, RobotModel<f64>>,
    horizon_s: f64,
) -> Vec<Direction> {
    let nominal = models(test_on).expect("models of a recording");
    let evidence = Evidence::new(test_on, &nominal);
    let rolled = |robot: RobotId, models: &BTreeMap<RobotId, RobotModel<f64>>| -> Vec<Rollout> {
        rollouts(&evidence, robot, &models[&robot], &[horizon_s]).remove(0)
    };
    let one = |&robot: &RobotId| {
        let (before, after) = (rolled(robot, before), rolled(robot, after));
        assert_eq!(before.len(), after.len(), "both models predict over the same windows");
        let pairs = |error: fn(&Rollout) -> f64| {
            let pair = |(before, after): (&Rollout, &Rollout)| Pair {
                time_s: before.time_s,
                before: error(before),
                after: error(after),
            };
            before.iter().zip(&after).map(pair).collect()
        };
        Direction {
            robot,
            heading: pairs(|rollout| rollout.heading_error_rad),
            position: pairs(|rollout| rollout.position_error_m),
        }
    };
    nominal.keys().map(one).collect()
}
