//! Effects on ranges and bearings.

use pleiad_estimation::geometry::{Vector2, wrap_angle};
use pleiad_estimation::sample::{Reading, Relative, Target};
use pleiad_estimation::{LandmarkId, Pose2};
use pleiad_physics::Effect;
use pleiad_sim_peers::SimulatedRun;

use crate::{MIXED, ROBOT, channels, close, run};

/// Noise is 1e-9 of its unit, and so is the rounding of stamps at this speed.
const EXACT: f64 = 2e-8;

/// A sighting: who is said to be seen, and where; and the true place of who bears that name.
pub(crate) struct Seen {
    pub(crate) time_s: f64,
    pub(crate) target: Target,
    pub(crate) range_m: f64,
    pub(crate) bearing_rad: f64,
}

pub(crate) fn seen(run: &SimulatedRun) -> Vec<Seen> {
    let one = |sample: &pleiad_estimation::sample::Sample| match sample.reading {
        Reading::Sighting { target, relative: Relative::RangeBearing { range_m, bearing_rad } } => {
            Seen { time_s: sample.time.seconds(), target, range_m, bearing_rad }
        }
        other => panic!("{other:?}"),
    };
    channels(run).sightings.iter().map(one).collect()
}

/// Where a target truly is `late_s` before the sighting.
fn place(run: &SimulatedRun, seen: &Seen, late_s: f64) -> Vector2 {
    match seen.target {
        Target::Landmark(id) => Vector2::from(run.recording.landmarks[&id]),
        Target::Robot(id) => run.tracks[&id].pose_at(crate::at(seen.time_s - late_s)).position(),
    }
}

/// Range and bearing from a sensor at `robot_from_sensor`, `late_s` before the sighting.
pub(crate) fn geometry(run: &SimulatedRun, seen: &Seen, robot_from_sensor: Pose2, late_s: f64) -> (f64, f64) {
    let robot = run.tracks[&ROBOT].pose_at(crate::at(seen.time_s - late_s));
    let offset = robot.compose(&robot_from_sensor).inverse().act(place(run, seen, late_s));
    (offset.norm(), offset.y.atan2(offset.x))
}

/// Asserts what every sighting reads, as a function of the range and bearing from the sensor.
#[track_caller]
fn reads(
    effect: Effect,
    values: &[f64],
    robot_from_sensor: Pose2,
    late_s: f64,
    law: impl Fn(f64, f64) -> (f64, f64),
) {
    let run = run(MIXED, effect, values);
    let all = seen(&run);
    assert!(all.len() > 300, "{}", all.len());
    for seen in &all {
        let (range, bearing) = geometry(&run, seen, robot_from_sensor, late_s);
        let (expected_m, expected_rad) = law(range, bearing);
        close(seen.range_m, expected_m, EXACT);
        close(wrap_angle(seen.bearing_rad - expected_rad), 0.0, EXACT);
    }
}

#[test]
fn mounts_and_latency_move_the_sensor() {
    let home = Pose2::identity();
    let same = |range, bearing| (range, bearing);
    reads(Effect::SensorLeverArm, &[0.1, 0.05], Pose2::new(0.1, 0.05, 0.0), 0.0, same);
    reads(Effect::SensorYawMisalignment, &[0.04], Pose2::new(0.0, 0.0, 0.04), 0.0, same);
    reads(Effect::CameraLatency, &[0.05], home, 0.05, same);
}

#[test]
fn ranges_and_bearings_err_by_their_laws() {
    let home = Pose2::identity();
    reads(Effect::RangeBias, &[0.05], home, 0.0, |r, b| (r + 0.05, b));
    reads(Effect::RangeScale, &[0.02], home, 0.0, |r, b| (1.02 * r, b));
    reads(Effect::BearingDistortion, &[0.03, 0.05], home, 0.0, |r, b| (r, b + 0.03 * b + 0.05 * b * b * b));
    reads(Effect::BearingDependentRangeBias, &[0.05], home, 0.0, |r, b| (r + 0.05 * b * b, b));
}

#[test]
fn a_landmark_surveyed_wrongly_is_seen_where_it_stands() {
    let run = run(MIXED, Effect::LandmarkSurveyError, &[2.0, 0.05, -0.03]);
    for seen in seen(&run) {
        let offset = match seen.target {
            Target::Landmark(LandmarkId(2)) => Vector2::new(0.05, -0.03),
            _ => Vector2::zeros(),
        };
        let robot = run.tracks[&ROBOT].pose_at(crate::at(seen.time_s));
        let expected = robot.inverse().act(place(&run, &seen, 0.0) + offset);
        close(seen.range_m, expected.norm(), EXACT);
        close(wrap_angle(seen.bearing_rad - expected.y.atan2(expected.x)), 0.0, EXACT);
    }
}

#[test]
fn swapped_landmarks_bear_each_others_name_and_the_third_its_own() {
    let run = run(MIXED, Effect::LandmarkIdentitySwap, &[1.0, 2.0]);
    for mut seen in seen(&run) {
        if let Target::Landmark(id) = &mut seen.target {
            *id = LandmarkId([0, 2, 1, 3][id.0 as usize]);
        }
        let (range, bearing) = geometry(&run, &seen, Pose2::identity(), 0.0);
        close(seen.range_m, range, EXACT);
        close(wrap_angle(seen.bearing_rad - bearing), 0.0, EXACT);
    }
}
