//! Every effect of the catalogue in the simulator: on which channels it acts, and by how much, against
//! closed forms.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests are tests")]

mod actuators;
mod bodies;
mod chance;
mod channels;
mod drives;
mod sensors;
mod sightings;

use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_physics::{ActiveEffect, Effect};
use pleiad_recording::RobotRecording;
use pleiad_sim_peers::{Scenario, SimulatedRun, simulate};

/// The robot on which effects act.
const ROBOT: RobotId = RobotId(1);
const RADIUS_M: f64 = 0.05;
const TRACK_M: f64 = 0.4;
const TAU_S: f64 = 0.06;
const TAU_TURN_S: f64 = 0.05;

/// Two robots, the second parked, with every sensor and hardly any noise; the first drives a script.
fn scenario(script: &str) -> Scenario {
    let text = format!(
        "name = \"effects\"\nduration_s = 20.0\nteam_size = 2\n\
         arena = {{ width_m = 60.0, height_m = 60.0 }}\n\
         [[landmarks]]\nid = 1\nx_m = 4.0\ny_m = 3.0\n[[landmarks]]\nid = 2\nx_m = -3.0\ny_m = 5.0\n\
         [[landmarks]]\nid = 3\nx_m = 1.0\ny_m = -6.0\n\
         [defaults]\nwheel_radius_m = {RADIUS_M}\ntrack_width_m = {TRACK_M}\n\
         servo_time_constant_s = {TAU_S}\nservo_time_constant_turn_s = {TAU_TURN_S}\n\
         voltage_rate_v_per_s = -0.01\n\
         [defaults.odometry]\nkind = \"wheels\"\nrate_hz = 50.0\n\
         noise = {{ speed_m_per_sqrt_s = 0.0, lateral_m_per_sqrt_s = 0.0, yaw_rad_per_sqrt_s = 0.0 }}\n\
         [defaults.gyro]\nrate_hz = 50.0\nsigma_rad_s = 1e-9\n\
         [defaults.gps]\nrate_hz = 4.0\nsigma_m = 1e-9\n\
         [defaults.heading]\nrate_hz = 5.0\nsigma_rad = 1e-9\n\
         [defaults.relative]\nrate_hz = 5.0\nsee = \"both\"\nmin_range_m = 0.0\nmax_range_m = 90.0\n\
         sigma_range_m = 1e-9\nsigma_bearing_rad = 1e-9\n\
         [[robots]]\nid = 1\nstart = {{ x_m = 0.0, y_m = 0.0, heading_rad = 0.0 }}\n\
         motion = {{ policy = \"script\", script = {script} }}\n\
         [[robots]]\nid = 2\nstart = {{ x_m = 2.0, y_m = -1.0, heading_rad = 0.0 }}\nmotion.policy = \"parked\"\n"
    );
    Scenario::from_toml(&text, "effects.toml").unwrap()
}

/// A bit of everything: curves both ways, backing up, spinning, starts and stops, standing, a crawl.
const MIXED: &str = "[[0.5, 0.4, 4.0], [0.6, -0.7, 3.0], [0.0, 0.0, 1.0], [-0.4, 0.3, 3.0], [0.0, 0.9, 2.0], \
                     [0.0, 0.0, 1.0], [0.02, 0.1, 2.0], [0.7, 0.0, 3.0]]";

fn active(effect: Effect, values: &[f64]) -> ActiveEffect<f64> {
    ActiveEffect::new(effect, values).unwrap()
}

/// The run of a scenario with these effects on robot 1.
fn with(mut scenario: Scenario, effects: &[ActiveEffect<f64>]) -> SimulatedRun {
    scenario.robots.get_mut(&ROBOT).unwrap().effects.extend_from_slice(effects);
    simulate(&scenario, 7).unwrap()
}

/// The run of a script with one effect.
fn run(script: &str, effect: Effect, values: &[f64]) -> SimulatedRun {
    with(scenario(script), &[active(effect, values)])
}

fn channels(run: &SimulatedRun) -> &RobotRecording {
    &run.recording.robots[&ROBOT]
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_seconds(seconds)
}

/// Where robot 1 truly was.
fn pose(run: &SimulatedRun, seconds: f64) -> Pose2 {
    run.tracks[&ROBOT].pose_at(at(seconds))
}

/// Angles of the left and right wheel by stamp.
fn wheels(run: &SimulatedRun) -> Vec<(f64, [f64; 2])> {
    let angles = |sample: &Sample| match sample.reading {
        Reading::Wheels { left_rad, right_rad } => (sample.time.seconds(), [left_rad, right_rad]),
        other => panic!("{other:?}"),
    };
    channels(run).odometry.iter().map(angles).collect()
}

/// Forward distance and turn of the wheels by the nominal kinematics between two stamps.
fn rolled(run: &SimulatedRun, from_s: f64, to_s: f64) -> (f64, f64, f64) {
    let wheels = wheels(run);
    let nearest = |seconds: f64| {
        wheels.iter().min_by(|a, b| (a.0 - seconds).abs().total_cmp(&(b.0 - seconds).abs())).unwrap()
    };
    let (from, to) = (nearest(from_s), nearest(to_s));
    let [left, right] = [0, 1].map(|wheel| RADIUS_M * (to.1[wheel] - from.1[wheel]));
    (0.5 * (left + right), (right - left) / TRACK_M, to.0 - from.0)
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} within {tolerance}");
}
