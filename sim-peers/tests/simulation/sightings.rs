//! What robots see of each other and of landmarks.

use std::f64::consts::PI;

use pleiad_estimation::geometry::{Vector2, wrap_angle};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{Pose2, RobotId};
use pleiad_sim_peers::SimulatedRun;

use crate::{assert_standard, run};

const RANGE_M: f64 = 0.1;
const BEARING_RAD: f64 = 0.03;
const POSITION_M: f64 = 0.2;
const YAW_RAD: f64 = 0.05;

fn text(kind: &str, limits: &str) -> String {
    format!(
        "name = \"seen\"\nduration_s = 120.0\nteam_size = 4\nrandom_landmarks = 5\n\
         [defaults.relative]\nrate_hz = 5.0\nsee = \"both\"\nkind = \"{kind}\"\n\
         sigma_range_m = {RANGE_M}\nsigma_bearing_rad = {BEARING_RAD}\n\
         sigma_position_m = {POSITION_M}\nsigma_yaw_rad = {YAW_RAD}\n{limits}\n"
    )
}

const EVERYTHING: &str = "min_range_m = 0.0\nmax_range_m = 100.0";

/// A sighting beside the truth of it: offset in the observer's frame, and relative pose if a robot.
struct Seen {
    sample: Sample,
    target: Target,
    relative: Relative,
    offset: Vector2,
    pose: Option<Pose2>,
}

fn seen(run: &SimulatedRun) -> Vec<Seen> {
    let mut all = Vec::new();
    for (observer, robot) in &run.recording.robots {
        for sample in &robot.sightings {
            let Reading::Sighting { target, relative } = sample.reading else { panic!("not a sighting") };
            let from = run.tracks[observer].pose_at(sample.time);
            let (offset, pose) = match target {
                Target::Robot(robot) => {
                    let pose = from.between(&run.tracks[&robot].pose_at(sample.time));
                    (pose.position(), Some(pose))
                }
                Target::Landmark(landmark) => {
                    let [x, y] = run.recording.landmarks[&landmark];
                    (from.inverse().act(Vector2::new(x, y)), None)
                }
            };
            all.push(Seen { sample: *sample, target, relative, offset, pose });
        }
    }
    all
}

#[test]
fn every_kind_of_sighting_is_truth_plus_the_declared_noise() {
    for kind in ["range_bearing", "pose", "position", "range", "bearing"] {
        let mut values = [const { Vec::new() }; 3];
        for seen in seen(&run(&text(kind, EVERYTHING), 31)) {
            let bearing = seen.offset.y.atan2(seen.offset.x);
            let error = match seen.relative {
                Relative::RangeBearing { range_m, bearing_rad } => vec![
                    (range_m - seen.offset.norm()) / RANGE_M,
                    wrap_angle(bearing_rad - bearing) / BEARING_RAD,
                ],
                Relative::Range { range_m } => vec![(range_m - seen.offset.norm()) / RANGE_M],
                Relative::Bearing { bearing_rad } => vec![wrap_angle(bearing_rad - bearing) / BEARING_RAD],
                Relative::Position { x_m, y_m } => {
                    vec![(x_m - seen.offset.x) / POSITION_M, (y_m - seen.offset.y) / POSITION_M]
                }
                Relative::Pose(pose) => {
                    let error = seen.pose.expect("a landmark has no pose").between(&pose).log();
                    vec![error.x / POSITION_M, error.y / POSITION_M, error.z / YAW_RAD]
                }
            };
            for (axis, error) in error.into_iter().enumerate() {
                assert!(error.abs() < 6.0, "{kind} axis {axis}: {error} sigma");
                values[axis].push(error);
            }
        }
        assert!(values[0].len() > 14_000, "{kind}: {} sightings", values[0].len());
        for (axis, values) in values.iter().enumerate().filter(|(_, values)| !values.is_empty()) {
            assert_standard(&format!("{kind} axis {axis}"), values);
        }
    }
}

#[test]
fn exactly_the_targets_within_range_and_field_of_view_are_seen_with_unchanged_noise() {
    let limits = "min_range_m = 2.0\nmax_range_m = 8.0\nhalf_fov_rad = 1.0";
    let limited: Vec<Sample> =
        seen(&run(&text("range_bearing", limits), 32)).iter().map(|seen| seen.sample).collect();
    let in_view = |seen: &Seen| {
        let (range_m, bearing_rad) = (seen.offset.norm(), seen.offset.y.atan2(seen.offset.x));
        (2.0..=8.0).contains(&range_m) && bearing_rad.abs() <= 1.0
    };
    let expected: Vec<Sample> = seen(&run(&text("range_bearing", EVERYTHING), 32))
        .iter()
        .filter(|seen| in_view(seen))
        .map(|seen| seen.sample)
        .collect();
    assert!(expected.len() > 1000);
    assert_eq!(limited, expected);
}

#[test]
fn a_field_of_view_of_pi_sees_all_around() {
    let run = run(&text("bearing", EVERYTHING), 33);
    let behind = seen(&run).iter().filter(|seen| seen.offset.x < 0.0 && seen.offset.y.abs() < 1.0).count();
    assert!(behind > 100, "{behind}");
    let scans = 120 * 5 - 1;
    assert!(seen(&run).len() >= 4 * 8 * (scans - 2));
    assert!(PI >= run.recording.nominal.unwrap().range_sensor.half_fov_rad);
}

#[test]
fn drop_outs_miss_their_share_and_nothing_else() {
    let all = seen(&run(&text("position", EVERYTHING), 34));
    let most = seen(&run(&text("position", &format!("{EVERYTHING}\ndrop_out = 0.2")), 34));
    let (trials, missed) = (all.len() as f64, (all.len() - most.len()) as f64);
    let bound = 4.5 * (trials * 0.2 * 0.8).sqrt();
    assert!((missed - 0.2 * trials).abs() < bound, "{missed} of {trials} missed");
    let mut rest = all.iter();
    for seen in &most {
        assert!(rest.any(|other| other.sample == seen.sample), "a drop-out changes no other sighting");
    }
}

#[test]
fn only_whom_the_sensor_is_for_is_seen() {
    let only = |see: &str| {
        let text = text("range", EVERYTHING).replace("\"both\"", &format!("\"{see}\""));
        seen(&run(&text, 35))
    };
    assert!(only("robots").iter().all(|seen| matches!(seen.target, Target::Robot(_))));
    assert!(only("landmarks").iter().all(|seen| matches!(seen.target, Target::Landmark(_))));
}

#[test]
fn nobody_sees_itself() {
    let run = run(&text("range", EVERYTHING), 36);
    for (observer, robot) in &run.recording.robots {
        let own = |sample: &Sample| matches!(sample.reading, Reading::Sighting { target: Target::Robot(RobotId(id)), .. } if id == observer.0);
        assert!(!robot.sightings.iter().any(own));
    }
}

#[test]
fn a_range_that_noise_takes_below_zero_is_not_reported() {
    let text = "name = \"near\"\nduration_s = 120.0\n\
        [defaults]\nmotion.policy = \"parked\"\n\
        relative = { rate_hz = 10.0, kind = \"range\", min_range_m = 0.0, sigma_range_m = 0.5 }\n\
        [[robots]]\nid = 1\nstart = { x_m = 0.0, y_m = 0.0, heading_rad = 0.0 }\n\
        [[robots]]\nid = 2\nstart = { x_m = 0.1, y_m = 0.0, heading_rad = 0.0 }\n";
    let seen = seen(&run(text, 37));
    assert!(seen.iter().all(|seen| matches!(seen.relative, Relative::Range { range_m } if range_m > 0.0)));
    // P(0.1 + 0.5 n > 0) = Phi(0.2) = 0.5793.
    let scans = 2.0 * 1197.0;
    let bound = 4.5 * (scans * 0.5793_f64 * 0.4207).sqrt() + 4.0;
    assert!((seen.len() as f64 - 0.5793 * scans).abs() < bound, "{} of {scans}", seen.len());
}
