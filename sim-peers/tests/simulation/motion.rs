//! True motion against closed forms, and the rules of motion.

use std::collections::BTreeMap;

use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use pleiad_sim_peers::SimulatedRun;

use crate::run;

const NO_NOISE: &str =
    "noise = { speed_m_per_sqrt_s = 0.0, lateral_m_per_sqrt_s = 0.0, yaw_rad_per_sqrt_s = 0.0 }";

fn text(team_size: u32, motion: &str) -> String {
    format!(
        "name = \"motion\"\nduration_s = 120.0\nteam_size = {team_size}\n\
         [defaults.motion]\n{motion}\n[defaults.odometry]\n{NO_NOISE}\n"
    )
}

/// Mean speeds of all robots over the second from `t`, m/s.
fn speeds(run: &SimulatedRun, t: f64) -> BTreeMap<RobotId, f64> {
    let mean = |(robot, track): (&RobotId, &pleiad_sim_peers::world::Track)| {
        let (from, until) = (Timestamp::from_seconds(t), Timestamp::from_seconds(t + 1.0));
        (*robot, (track.pose_at(until).position() - track.pose_at(from).position()).norm())
    };
    run.tracks.iter().map(mean).collect()
}

#[test]
fn a_circle_without_slip_is_the_closed_form_of_a_first_order_servo_on_an_arc() {
    let (speed, radius, lag_s) = (0.8, 2.0, 0.1);
    let run = run(&text(1, "policy = \"circle\"\nspeed_m_s = 0.8\nradius_m = 2.0"), 1);
    let (robot, track) = (&run.recording.robots[&RobotId(1)], &run.tracks[&RobotId(1)]);
    let first = robot.commands[0].time;
    assert!(robot.odometry.len() > 2900);
    for sample in robot.odometry.iter().filter(|sample| sample.time >= first) {
        // Both speeds rise as 1 - exp(-t/lag), so that the path is one circle, driven this far:
        let t = sample.time.seconds_since(first);
        let driven_m = speed * (t - lag_s * (1.0 - (-t / lag_s).exp()));
        let expected = track.start().compose(&Pose2::exp(Vector3::new(driven_m, 0.0, driven_m / radius)));
        let error = expected.between(&track.pose_at(sample.time)).log().norm();
        // Ticks are rounded to nanoseconds; a few thousand roundings of a pose at 20 m.
        assert!(error < 1e-8, "{error} at {t} s");
    }
}

#[test]
fn truth_in_the_recording_is_the_track_from_zero_to_the_end_at_the_declared_rate() {
    let run = run(&text(2, "policy = \"figure_eight\""), 1);
    for (robot, recorded) in &run.recording.robots {
        assert_eq!(recorded.truth.len(), 120 * 50 + 1);
        assert_eq!(recorded.truth[0].time, Timestamp(0));
        for sample in &recorded.truth {
            assert_eq!(sample.pose, run.tracks[robot].pose_at(sample.time));
        }
    }
}

#[test]
fn a_square_visits_its_corners_in_the_sense_asked_for_and_comes_home() {
    for (direction, sense) in [("counter_clockwise", 1.0), ("clockwise", -1.0)] {
        let motion = format!("policy = \"square\"\nside_m = 4.0\ndirection = \"{direction}\"");
        let run = run(&text(1, &motion), 1);
        let track = &run.tracks[&RobotId(1)];
        let seen: Vec<_> = run.recording.robots[&RobotId(1)]
            .truth
            .iter()
            .map(|truth| track.start().between(&truth.pose).position())
            .collect();
        let mut reached_at = Vec::new();
        for (x, y) in [(4.0, 0.0), (4.0, 4.0 * sense), (0.0, 4.0 * sense), (0.0, 0.0)] {
            let from = reached_at.last().copied().unwrap_or(50);
            let near = |offset: &usize| (seen[from + offset].x - x).hypot(seen[from + offset].y - y) < 0.05;
            reached_at.push(from + (0..seen.len() - from).find(near).expect("corner not reached"));
        }
        assert!(seen.iter().all(|p| p.x > -0.1 && p.x < 4.1 && sense * p.y > -0.1 && sense * p.y < 4.1));
    }
}

#[test]
fn a_line_is_driven_forth_and_back_without_leaving_it() {
    let run = run(&text(1, "policy = \"line_back_and_forth\"\nside_m = 3.0"), 1);
    let start = run.tracks[&RobotId(1)].start();
    let truth = &run.recording.robots[&RobotId(1)].truth;
    let along: Vec<_> = truth.iter().map(|truth| start.between(&truth.pose).position()).collect();
    assert!(along.iter().all(|p| p.y.abs() < 0.05 && p.x > -0.05 && p.x < 3.05));
    let ends = along.windows(2).filter(|pair| (pair[0].x < 2.9) != (pair[1].x < 2.9)).count();
    assert!(ends >= 6, "{ends} passages near the far end in 120 s");
}

#[test]
fn portable_landmarks_move_half_the_team_at_a_time_and_everyone_in_turn() {
    let run = run(&text(4, "policy = \"portable_landmarks\"\nmove_s = 15.0"), 2);
    for turn in 0..8_u32 {
        // Two seconds after the change everybody told to stop stands: 20 time constants.
        for second in [2.0, 7.0, 12.0] {
            let moving: Vec<u32> = speeds(&run, f64::from(turn) * 15.0 + second)
                .iter()
                .filter(|(_, speed)| **speed > 1e-3)
                .map(|(robot, _)| robot.0)
                .collect();
            let expected = if turn % 2 == 0 { [1, 3] } else { [2, 4] };
            assert!(moving.iter().all(|robot| expected.contains(robot)), "turn {turn}: {moving:?}");
        }
    }
}

#[test]
fn one_mover_moves_one_robot_at_a_time_and_each_in_its_turn() {
    let run = run(&text(3, "policy = \"one_mover\"\nmove_s = 10.0"), 2);
    for turn in 0..12_u32 {
        for (robot, speed) in speeds(&run, f64::from(turn) * 10.0 + 3.0) {
            let mine = robot.0 == turn % 3 + 1;
            assert_eq!(speed > 1e-3, mine, "turn {turn}, robot {robot}: {speed} m/s");
        }
    }
}

#[test]
fn wandering_robots_keep_to_the_arena_to_their_speed_and_clear_of_each_other() {
    for seed in 1..=5 {
        let run = run(&text(5, "speed_m_s = 0.8\nmin_speed_m_s = 0.4"), seed);
        let mut driven_m = 0.0;
        let mut nearest = f64::INFINITY;
        for tick in 0..1200_u32 {
            let time = Timestamp::from_seconds(0.1 * f64::from(tick));
            let poses: Vec<Pose2> = run.tracks.values().map(|track| track.pose_at(time)).collect();
            for (index, pose) in poses.iter().enumerate() {
                assert!(pose.x_m().abs() < 10.0 && pose.y_m().abs() < 10.0, "{pose:?}");
                for other in &poses[index + 1..] {
                    nearest = nearest.min((other.position() - pose.position()).norm());
                }
            }
        }
        for second in 0..119_u32 {
            for speed in speeds(&run, f64::from(second)).values() {
                assert!(*speed < 0.8 + 1e-9);
                driven_m += speed;
            }
        }
        assert!(nearest > 0.4, "seed {seed}: two robots {nearest:.2} m apart");
        let mean = driven_m / (5.0 * 119.0);
        assert!(mean > 0.35, "seed {seed}: mean speed {mean:.2} m/s");
    }
}
