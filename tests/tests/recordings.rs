//! The program on the published recordings: real robots (MRCLAM, Leung et al. 2011) and runs of a physics
//! engine. `PLEIAD_RECORDINGS` names the folder that holds `mrclam/` and `physics-engine/`;
//! `cargo test -p pleiad-tests --features recordings --test recordings`.
//!
//! Noise was chosen on dataset 2 alone (`docs/benchmarks/mrclam.md`).

#![cfg(feature = "recordings")]
#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(clippy::print_stdout, reason = "figures for the documentation")]

use std::path::{Path, PathBuf};
use std::process::Command;

use pleiad_estimation::RobotId;
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::DeclaredEffect;
use pleiad_tests::program;
use serde_json::Value;
use tempfile::TempDir;

/// The first ten minutes that all robots cover.
const TEN_MINUTES: [&str; 2] = ["--seconds", "600"];

fn recording(path: &str) -> PathBuf {
    let how = "set PLEIAD_RECORDINGS to the folder that holds mrclam/MRCLAM_Dataset2 and \
               mrclam/MRCLAM_Dataset6 (published by their authors at asrl.utias.utoronto.ca/datasets/mrclam) \
               and physics-engine/";
    let folder = std::env::var_os("PLEIAD_RECORDINGS").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| panic!("PLEIAD_RECORDINGS is not set; {how}"));
    let path = folder.join(path);
    assert!(path.is_dir(), "{} is not a folder; {how}", path.display());
    path
}

/// What a command prints as JSON.
fn json(arguments: &[&str]) -> Value {
    let output =
        Command::new(program::pleiad()).args(arguments).arg("--json").output().expect("pleiad can be run");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "pleiad {arguments:?}: {said}");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// A replay with its output folder, which goes when this goes.
struct Replay {
    summary: Value,
    out: TempDir,
}

fn replay(path: &str, options: &[&str]) -> Replay {
    let out = tempfile::tempdir().expect("a temporary folder");
    let (folder, target) = (recording(path), out.path().join("run"));
    let mut arguments = vec!["replay", text(&folder), "--out", text(&target)];
    arguments.extend(options);
    Replay { summary: json(&arguments), out }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path that is text")
}

fn mrclam(options: &[&str]) -> Replay {
    replay("mrclam/MRCLAM_Dataset6", &[&TEN_MINUTES[..], options].concat())
}

impl Replay {
    fn number(&self, pointer: &str) -> f64 {
        let value = self.summary.pointer(pointer).and_then(Value::as_f64);
        value.unwrap_or_else(|| panic!("no number at {pointer} of {}", self.summary))
    }

    fn count(&self, pointer: &str) -> u64 {
        let value = self.summary.pointer(pointer).and_then(Value::as_u64);
        value.unwrap_or_else(|| panic!("no count at {pointer} of {}", self.summary))
    }

    /// Mean over the robots of the root mean square error of the settled positions.
    fn error_m(&self) -> f64 {
        self.number("/mean_position_rmse_m")
    }

    fn dead_reckoning_m(&self) -> f64 {
        self.number("/dead_reckoning_mean_rmse_m")
    }

    /// The settled trajectories, one file per robot.
    fn trajectories(&self) -> Vec<Vec<u8>> {
        let folder = self.out.path().join("run/settled");
        let mut files: Vec<_> = std::fs::read_dir(&folder)
            .expect("settled trajectories")
            .map(|entry| entry.expect("an entry of a folder").path())
            .collect();
        files.sort();
        files.iter().map(|file| std::fs::read(file).expect("a trajectory")).collect()
    }
}

#[test]
fn mrclam_without_landmarks_the_team_is_three_times_better_than_dead_reckoning() {
    let run = mrclam(&["--landmarks", "none"]);
    assert!(run.error_m() <= 0.65, "{}", run.error_m());
    // The error of the commands integrated alone says that the recording was read as others read it.
    assert!((1.7..=2.1).contains(&run.dead_reckoning_m()), "{}", run.dead_reckoning_m());
    assert!(run.number("/online_mean_position_rmse_m") <= 0.65);
    assert!(run.number("/payload_bytes/per_relative_observation") <= 220.0);
    assert_eq!(run.count("/facts/relative"), 2706);
    assert_eq!(run.count("/facts/pending"), 0);
    // The noise chosen is too large rather than too small for robots that see robots.
    assert!((0.2..=1.0).contains(&run.number("/nis/mean")), "{}", run.number("/nis/mean"));
}

#[test]
fn mrclam_with_its_landmarks_is_known_to_a_fifth_of_a_metre() {
    let run = mrclam(&["--landmarks", "known"]);
    assert!(run.error_m() <= 0.22, "{}", run.error_m());
    // Heavy tails of the camera, measured in docs/benchmarks/mrclam.md: more than 1, and not by accident.
    assert!((1.0..=1.8).contains(&run.number("/nis/mean")), "{}", run.number("/nis/mean"));
    assert!(run.number("/nis/within_95") > 0.93);
}

#[test]
fn mrclam_robots_that_ignore_one_another_do_worse() {
    for (landmarks, least) in [("none", 3.0), ("known", 1.3)] {
        let team = mrclam(&["--landmarks", landmarks]);
        let alone = mrclam(&["--landmarks", landmarks, "--strategy", "independent"]);
        let ratio = alone.error_m() / team.error_m();
        assert!(ratio > least, "{landmarks}: alone {} m, together {} m", alone.error_m(), team.error_m());
    }
}

#[test]
fn mrclam_two_landmarks_or_one_receiver_bound_the_team() {
    let without = mrclam(&["--landmarks", "none"]).error_m();
    let two = mrclam(&["--landmarks", "6,7"]).error_m();
    let receiver = mrclam(&["--landmarks", "none", "--absolute", "1@1.0:0.3"]);
    assert!(two < without, "{two} m with two landmarks, {without} m without");
    assert!(receiver.error_m() < 0.6 * without, "{} m with a receiver", receiver.error_m());
    // Every robot gains from the receiver of robot 1, not robot 1 alone.
    for robot in 0..5 {
        let error_m = receiver.number(&format!("/robots/{robot}/position_rmse_m"));
        assert!(error_m < without, "robot {}: {error_m} m", robot + 1);
    }
}

#[test]
fn mrclam_runs_in_both_error_forms_and_the_additive_one_is_worse_without_landmarks() {
    let invariant = mrclam(&["--landmarks", "none"]).error_m();
    let additive = mrclam(&["--landmarks", "none", "--error", "additive"]).error_m();
    assert!(additive > 1.5 * invariant, "additive {additive} m, invariant {invariant} m");
    let known = mrclam(&["--landmarks", "known", "--error", "additive"]).error_m();
    assert!(known < 0.25, "{known}");
}

#[test]
fn mrclam_agent_processes_settle_on_the_same_bits_as_one_process() {
    let slice = ["--landmarks", "known", "--seconds", "60"];
    let together = replay("mrclam/MRCLAM_Dataset6", &slice);
    let apart = replay("mrclam/MRCLAM_Dataset6", &[&slice[..], &["--processes"]].concat());
    assert_eq!(apart.count("/processes"), 5);
    let (ours, theirs) = (together.trajectories(), apart.trajectories());
    assert_eq!(ours.len(), 5);
    assert!(ours.iter().all(|file| file.len() > 10_000));
    assert!(ours == theirs, "settled trajectories differ");
}

#[test]
fn mrclam_dataset_2_replays_with_the_numbers_its_noise_was_chosen_by() {
    let of = |landmarks| {
        replay("mrclam/MRCLAM_Dataset2", &[&TEN_MINUTES[..], &["--landmarks", landmarks]].concat())
    };
    for (run, expected_m) in [(of("none"), 0.559), (of("known"), 0.133)] {
        assert!((run.error_m() - expected_m).abs() < 0.002, "{} m, on record {expected_m} m", run.error_m());
        assert!(run.number("/nis/mean") <= 1.0);
    }
}

#[test]
fn mrclam_is_observable_with_landmarks_and_lacks_three_directions_without() {
    let folder = recording("mrclam/MRCLAM_Dataset6");
    let of =
        |landmarks| json(&["observability", text(&folder), "--seconds", "120", "--landmarks", landmarks]);
    let without = of("none");
    assert_eq!((&without["rank"], &without["dimension"]), (&12.into(), &15.into()), "{without}");
    assert!(!without["unobservable"].as_array().expect("a list").is_empty());
    let with = of("known");
    assert_eq!((&with["rank"], &with["dimension"]), (&15.into(), &15.into()), "{with}");
    assert_eq!(with["unobservable"], Value::Array(Vec::new()));
}

/// Rolling contact without slip on a flat floor: dead reckoning from the exact start is good to
/// millimetres, and the team, which is told a start uncertain by 2 cm, cannot be better than its sensors.
/// What it can be is within a centimetre and consistent.
#[test]
fn a_clean_run_of_the_physics_engine_stays_within_a_centimetre() {
    let run = replay("physics-engine/p01_clean", &[]);
    assert!(run.error_m() < 0.010, "{}", run.error_m());
    check_consistent(&run);
}

#[test]
fn on_a_tilted_floor_the_team_is_better_than_dead_reckoning() {
    let run = replay("physics-engine/p05_floor_tilt", &[]);
    assert!(run.error_m() < 0.010, "{}", run.error_m());
    assert!(run.error_m() < 0.7 * run.dead_reckoning_m(), "{}", run.dead_reckoning_m());
    check_consistent(&run);
}

/// The engine's sensors have the noise that its nominal declares: innovations are close to chi-square.
fn check_consistent(run: &Replay) {
    assert!((0.9..=1.1).contains(&run.number("/nis/mean")), "{}", run.number("/nis/mean"));
    assert!((0.94..=0.97).contains(&run.number("/nis/within_95")));
    assert_eq!(run.count("/facts/pending") + run.count("/facts/skipped") + run.count("/facts/void"), 0);
}

/// Robot 2 has unequal wheels, and a track that was tuned to hide them on circles to the left. Driven to the
/// right it loses its way; with a model that says so it does as well as the others.
#[test]
fn the_true_model_of_masked_wheels_brings_a_robot_back_on_its_way() {
    let name = "physics-engine/p04_masked_cw_check";
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("corrected.toml");
    let mut warnings = Vec::new();
    let nominal = recording(name).join("nominal.toml");
    let mut model = pleiad_recording::read_model(&nominal, &mut warnings).expect("a nominal model");
    let robot = model.robots.get_mut(&RobotId(2)).expect("robot 2");
    for (effect, value) in [(Effect::UnequalWheelRadii, 0.01), (Effect::TrackWidthError, -0.039_19)] {
        let active = ActiveEffect::new(effect, &[value]).expect("one value");
        robot.effects.push(DeclaredEffect::new(active));
    }
    pleiad_recording::write_model(&path, &model, "").expect("a folder of its own");
    let (without, with) = (replay(name, &[]), replay(name, &["--model", text(&path)]));
    assert!(without.error_m() > 0.3, "{}", without.error_m());
    assert!(with.error_m() < 0.010, "{}", with.error_m());
    check_consistent(&with);
}

#[test]
fn with_landmarks_and_noise_from_the_other_dataset_errors_are_a_decimetre() {
    // Outside: a full-pose EKF with its noise from the truth of the same data reaches 0.234 and 0.161 m. Asked for: 0.12, 0.10.
    for (dataset, chosen_on, most) in [(6, 2, 0.12), (2, 6, 0.10)] {
        let noise =
            format!("{}/../pleiad/noise/mrclam_landmarks_from_{chosen_on}.toml", env!("CARGO_MANIFEST_DIR"));
        let options = [&TEN_MINUTES[..], &["--landmarks", "known", "--noise", &noise]].concat();
        let error_m = replay(&format!("mrclam/MRCLAM_Dataset{dataset}"), &options).error_m();
        assert!(error_m <= most, "dataset {dataset}: {error_m} m");
    }
}

/// Two robots whose barcodes are swapped, and no landmark: with names taken for right the team is lost, with names that may be
/// wrong it is where it would be with the right ones (0.55 m).
#[test]
fn robots_whose_barcodes_are_swapped_are_told_apart() {
    let published = recording("mrclam/MRCLAM_Dataset6");
    let folder = tempfile::tempdir().expect("a temporary folder");
    for file in std::fs::read_dir(&published).expect("a folder").map(|file| file.expect("a file")) {
        let target = folder.path().join(file.file_name());
        if file.file_name() == "Barcodes.dat" {
            let codes = std::fs::read_to_string(file.path()).expect("text");
            let fields = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
            let of = |subject: &str| {
                let line =
                    codes.lines().map(fields).find(|line| line.first().is_some_and(|of| of == subject));
                line.expect("a subject")[1].clone()
            };
            let (second, third) = (of("2"), of("3"));
            let swapped = codes.lines().map(|line| match fields(line).first().map(String::as_str) {
                Some("2") => format!("2 {third}\n"),
                Some("3") => format!("3 {second}\n"),
                _ => format!("{line}\n"),
            });
            std::fs::write(target, swapped.collect::<String>()).expect("written");
        } else {
            std::fs::copy(file.path(), target).expect("copied");
        }
    }
    let noise = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pleiad/noise/mrclam_landmarks_from_2.toml");
    let replay = |more: &[&str], out: &str| {
        let target = folder.path().join(out);
        // A robot that sees its own barcode sees another.
        let given = ["replay", text(folder.path()), "--out", text(&target), "--noise", text(&noise)];
        let given = [&given, &TEN_MINUTES[..], &["--landmarks", "none", "--skip-bad-rows"], more].concat();
        json(&given)["mean_position_rmse_m"].as_f64().expect("a number")
    };
    let (believed, asked) = (replay(&[], "believed"), replay(&["--clutter", "0.02:8:0.3"], "asked"));
    println!("{believed} {asked}");
    assert!(believed > 0.85 && asked < 0.6, "{believed} {asked}");
}

/// Honest robots where liars are feared: nobody ends as one, and the error is what it was. On dataset 6 sightings that are wrong for
/// seconds take some out of the map for a while.
#[test]
fn honest_robots_end_as_such_where_liars_are_feared() {
    for (dataset, noise) in [("2", "6"), ("6", "2")] {
        let noise = format!("../pleiad/noise/mrclam_landmarks_from_{noise}.toml");
        let noise = Path::new(env!("CARGO_MANIFEST_DIR")).join(noise);
        let options = [&TEN_MINUTES[..], &["--noise", text(&noise)]].concat();
        let folder = format!("mrclam/MRCLAM_Dataset{dataset}");
        let trusting = replay(&folder, &options).summary;
        let wary = replay(&folder, &[&options[..], &["--quarantine", "15:30"]].concat()).summary;
        let error = |summary: &Value| summary["mean_position_rmse_m"].as_f64().expect("a number");
        println!("{dataset}: {} {} {}", error(&trusting), error(&wary), wary["found"]["robots"]);
        assert!(error(&wary) < 1.02 * error(&trusting), "{} {}", error(&wary), error(&trusting));
        let suspects = wary["found"]["robots"].as_array().map_or(&[][..], Vec::as_slice);
        assert!(suspects.iter().all(|robot| robot["distrusted_s"].is_null()), "{suspects:?}");
    }
}
