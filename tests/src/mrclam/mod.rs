//! The diagnosis of real robots, fitted on one MRCLAM dataset and judged on another: what
//! `docs/benchmarks/mrclam-diagnosis.md` reports and `tests/recordings_mrclam_diagnosis.rs` claims.

#![allow(
    clippy::panic,
    clippy::expect_used,
    clippy::missing_panics_doc,
    reason = "helpers of tests fail by panicking"
)]

mod differences;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use pleiad_estimation::RobotId;
use pleiad_mismatch::{
    DiagnoseOptions, Diagnosis, Evidence, Finding, KnownFit, Rollout, Verdict, diagnose, fit_known, models,
    rollouts,
};
use pleiad_physics::{ActiveEffect, Effect, RobotModel};
use pleiad_recording::{ReadOptions, Recording};

use crate::bootstrap::{Pair, Reduction, mean_reduction};
use crate::changed::{commands_permuted, commands_reversed};
use crate::program;
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

/// Blocks of commands that are permuted, seconds: many times the lag of a robot.
const PERMUTED_S: f64 = 20.0;

/// A change after which commands and motion have nothing to do with each other.
pub type Control = fn(Recording) -> Recording;

/// The negative controls, by name.
pub const CONTROLS: [(&str, Control); 2] = [
    ("commands permuted in blocks of 20 s", |recording| commands_permuted(recording, PERMUTED_S, 1)),
    ("commands in the opposite order", commands_reversed),
];

/// The effects that a diagnosis names, robot by robot.
pub fn named(diagnosis: &Diagnosis) -> BTreeSet<(u32, String)> {
    let is_name = |own: &&Finding| matches!(own.verdict, Verdict::Named | Verdict::BadData);
    let names = |own: &Finding| -> Vec<(u32, String)> {
        let effect = own.effect.clone().unwrap_or_default();
        own.robots.iter().map(|&robot| (robot, effect.clone())).collect()
    };
    diagnosis.findings.findings.iter().filter(is_name).flat_map(names).collect()
}

/// The effects that a diagnosis shows, robot by robot: named, or in a set of which one is there.
pub fn shown(diagnosis: &Diagnosis) -> BTreeSet<(u32, String)> {
    let sets = |own: &Finding| -> Vec<(u32, String)> {
        let pairs = |&robot: &u32| own.support_set.iter().map(move |effect| (robot, effect.clone()));
        own.robots.iter().flat_map(pairs).collect()
    };
    diagnosis.findings.findings.iter().flat_map(sets).collect()
}

/// The mean position error of a team of agents, metres, over the first ten minutes of a dataset, by
/// `pleiad replay`.
pub fn agents_error_m(number: u32, landmarks: &str, model: Option<&Path>) -> f64 {
    let out = tempfile::tempdir().expect("a temporary folder");
    let mut command = Command::new(program::pleiad());
    command.arg("replay").arg(folder(number)).args(["--seconds", "600", "--landmarks", landmarks, "--json"]);
    command.arg("--out").arg(out.path().join("run"));
    if let Some(model) = model {
        command.arg("--model").arg(model);
    }
    let output = command.output().expect("pleiad can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    summary["mean_position_rmse_m"].as_f64().expect("an error where there is truth")
}

/// Writes what `pleiad diagnose` writes as `corrected.toml`.
pub fn write_corrected(diagnosis: &Diagnosis, recording: &Recording, path: &Path) {
    let model = &diagnosis.corrected[&recording.name];
    pleiad_recording::write_model(path, model, "").expect("a model that can be written");
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

/// The models that a diagnosis gives to a recording.
pub fn corrected(diagnosis: &Diagnosis, recording: &Recording) -> BTreeMap<RobotId, RobotModel<f64>> {
    let nominal = &diagnosis.corrected[&recording.name];
    let model = |&robot: &RobotId| (robot, nominal.model(robot).expect("a model of every robot"));
    recording.robots.keys().map(model).collect()
}

/// The models of the robots of a recording, from a file such as a `corrected.toml`.
pub fn read(path: &Path, recording: &Recording) -> BTreeMap<RobotId, RobotModel<f64>> {
    let nominal = pleiad_recording::read_model(path, &mut Vec::new()).expect("a model that can be read");
    let model = |&robot: &RobotId| (robot, nominal.model(robot).expect("a model of every robot"));
    recording.robots.keys().map(model).collect()
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

/// Blocks of the bootstrap, seconds: longer than any stretch of driving in one way.
pub const BLOCK_S: f64 = 60.0;
/// How often blocks are drawn.
pub const RESAMPLES: usize = 2000;
/// From which seed.
pub const SEED: u64 = 1;

/// Which error.
#[derive(Clone, Copy, Debug)]
pub enum Of {
    /// Of heading.
    Heading,
    /// Of position.
    Position,
}

/// The mean over robots and directions of the share by which the root mean square error falls.
pub fn mean_of(directions: &[Direction], of: Of) -> Reduction {
    let pairs = |own: &Direction| match of {
        Of::Heading => own.heading.clone(),
        Of::Position => own.position.clone(),
    };
    let groups: Vec<Vec<Pair>> = directions.iter().map(pairs).collect();
    mean_reduction(&groups, BLOCK_S, RESAMPLES, SEED)
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
