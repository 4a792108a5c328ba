//! GPS, heading, gyro and the prior against truth and their declared noise; stamps of all channels.

use std::f64::consts::PI;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::Reading;
use pleiad_estimation::{RobotId, Timestamp};

use crate::{assert_standard, run};

const ROBOT: RobotId = RobotId(1);

const ALL: &str = "name = \"channels\"\nduration_s = 200.0\nteam_size = 3\n\
    [defaults.gps]\nrate_hz = 5.0\nsigma_m = 0.4\n\
    [defaults.heading]\nrate_hz = 5.0\nsigma_rad = 0.03\n\
    [defaults.gyro]\nrate_hz = 50.0\n\
    [defaults.relative]\nrate_hz = 2.0\n";

#[test]
fn gps_and_heading_are_truth_plus_the_declared_noise() {
    let run = run(ALL, 21);
    let (robot, track) = (&run.recording.robots[&ROBOT], &run.tracks[&ROBOT]);
    let (mut east, mut north, mut heading) = (Vec::new(), Vec::new(), Vec::new());
    for sample in robot.gps.iter().chain(&robot.heading) {
        let truth = track.pose_at(sample.time);
        match sample.reading {
            Reading::Gps { x_m, y_m } => {
                east.push((x_m - truth.x_m()) / 0.4);
                north.push((y_m - truth.y_m()) / 0.4);
            }
            Reading::Heading { heading_rad } => {
                assert!(heading_rad > -PI && heading_rad <= PI);
                heading.push(wrap_angle(heading_rad - truth.yaw_rad()) / 0.03);
            }
            other => panic!("{other:?}"),
        }
    }
    for (claim, values) in [("gps x", east), ("gps y", north), ("heading", heading)] {
        assert!(values.len() > 990, "{claim}");
        assert_standard(claim, &values);
    }
}

#[test]
fn a_gyro_on_a_circle_reads_speed_over_radius_plus_bias_and_noise() {
    let text = "name = \"gyro\"\nduration_s = 100.0\nteam_size = 1\n\
        [defaults.motion]\npolicy = \"circle\"\nspeed_m_s = 0.6\nradius_m = 1.5\n\
        [defaults.odometry]\nnoise = { speed_m_per_sqrt_s = 0.0, lateral_m_per_sqrt_s = 0.0, yaw_rad_per_sqrt_s = 0.0 }\n\
        [defaults.gyro]\nrate_hz = 50.0\nsigma_rad_s = 0.004\nbias_rad_s = 0.01\n";
    let run = run(text, 22);
    let settled = Timestamp::from_seconds(4.0);
    let mut values = Vec::new();
    for sample in run.recording.robots[&ROBOT].gyro.iter().filter(|sample| sample.time > settled) {
        let Reading::Gyro { yaw_rate_rad_s } = sample.reading else { panic!("not a gyro") };
        values.push((yaw_rate_rad_s - 0.01 - 0.6 / 1.5) / 0.004);
    }
    assert_standard("gyro", &values);
}

#[test]
fn a_nearly_noiseless_gyro_integrates_to_the_true_heading_slip_included() {
    let text = "name = \"gyro\"\nduration_s = 100.0\nteam_size = 1\n\
        [defaults.odometry.noise]\nyaw_rad_per_sqrt_s = 0.05\n\
        [defaults.gyro]\nrate_hz = 50.0\nsigma_rad_s = 1e-9\n";
    let run = run(text, 23);
    let gyro = &run.recording.robots[&ROBOT].gyro;
    let turned: f64 = gyro
        .iter()
        .map(|sample| match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => yaw_rate_rad_s / 50.0,
            other => panic!("{other:?}"),
        })
        .sum();
    let track = &run.tracks[&ROBOT];
    let from = track.pose_at(gyro[0].time.plus_seconds(-0.01));
    let until = track.pose_at(gyro[gyro.len() - 1].time.plus_seconds(0.01));
    let error = wrap_angle(turned - (until.yaw_rad() - from.yaw_rad()));
    assert!(error.abs() < 1e-5, "{error} rad after 100 s: windows of one period tile the time");
}

#[test]
fn priors_err_from_the_start_as_declared_over_two_hundred_seeds() {
    let text = "name = \"prior\"\nduration_s = 1.0\nteam_size = 1\n\
        [defaults.prior]\nsigma_position_m = 0.3\nsigma_heading_rad = 0.1\n";
    let mut values = [const { Vec::new() }; 3];
    for seed in 0..200 {
        let run = run(text, seed);
        let error = run.tracks[&ROBOT].start().between(&run.priors[&ROBOT].pose).log();
        for (axis, sigma) in [0.3, 0.3, 0.1].into_iter().enumerate() {
            values[axis].push(error[axis] / sigma);
        }
    }
    for (axis, values) in values.iter().enumerate() {
        assert_standard(&format!("prior axis {axis}"), values);
    }
}

#[test]
fn a_robot_that_is_told_nothing_has_no_prior() {
    let text = "name = \"p\"\nduration_s = 1.0\nteam_size = 2\n[[robots]]\nid = 2\nprior.known = false\n";
    let run = run(text, 1);
    assert_eq!(run.priors.keys().copied().collect::<Vec<_>>(), vec![RobotId(1)]);
}

#[test]
fn every_observation_lies_within_the_odometry_of_every_robot_and_stamps_ascend() {
    for seed in 1..=20 {
        let run =
            run(&ALL.replace("[defaults.gps]", "[defaults.odometry]\nrate_hz = 5.0\n[defaults.gps]"), seed);
        let robots = run.recording.robots.values();
        let first = robots.clone().map(|robot| robot.odometry[0].time).max().unwrap();
        let last = robots.clone().map(|robot| robot.odometry[robot.odometry.len() - 1].time).min().unwrap();
        for robot in robots {
            for channel in [&robot.gyro, &robot.gps, &robot.heading, &robot.sightings] {
                assert!(!channel.is_empty());
                assert!(
                    channel.iter().all(|sample| sample.time > first && sample.time <= last),
                    "seed {seed}"
                );
                assert!(channel.windows(2).all(|pair| pair[0].time <= pair[1].time));
            }
            assert!(robot.odometry.windows(2).all(|pair| pair[0].time < pair[1].time));
        }
    }
}

#[test]
fn phases_differ_between_channels_and_robots() {
    let run = run(ALL, 1);
    let mut stamps = Vec::new();
    for robot in run.recording.robots.values() {
        stamps.extend(
            [&robot.odometry, &robot.gyro, &robot.gps, &robot.heading, &robot.sightings].map(|c| c[0].time),
        );
    }
    let count = stamps.len();
    stamps.sort_unstable();
    stamps.dedup();
    assert_eq!((stamps.len(), count), (15, 15));
}

#[test]
fn gps_is_heard_only_within_its_windows_and_unchanged_there() {
    let whole = run(ALL, 4);
    let windows = "[defaults.gps]\nwindows_s = [[20.0, 50.0], [100.0, 120.0]]\n";
    let part = run(&ALL.replace("[defaults.gps]\n", windows), 4);
    let within = |t: f64| (20.0..50.0).contains(&t) || (100.0..120.0).contains(&t);
    let expected: Vec<_> = whole.recording.robots[&ROBOT]
        .gps
        .iter()
        .filter(|sample| within(sample.time.seconds()))
        .copied()
        .collect();
    assert_eq!(expected.len(), 250);
    assert_eq!(part.recording.robots[&ROBOT].gps, expected);
}
