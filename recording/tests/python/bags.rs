//! A bag that rosbags wrote is read field by field.

use std::path::Path;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_recording::{Form, ReadOptions, open_mapped};
use serde_json::Value;

use crate::ask;

const MAPPING: &str = r#"
origin = { latitude_deg = 48.2, longitude_deg = 11.6, altitude_m = 520.0 }
[[topic]]
topic = "/odom"
robot = 1
channel = "velocity"
[[topic]]
topic = "/joints"
robot = 2
channel = "wheel_odometry"
left = ["wheel_left_joint"]
right = ["wheel_right_joint"]
[[topic]]
topic = "/cmd_vel"
robot = 1
channel = "command"
[[topic]]
topic = "/imu"
robot = 1
channel = "gyro"
[[topic]]
topic = "/imu"
robot = 1
channel = "heading"
[[topic]]
topic = "/fix"
robot = 1
channel = "gps"
[[topic]]
topic = "/tf"
robot = 1
channel = "truth"
frame = "map"
child_frame = "mocap/robot"
"#;

/// Asserts that rows are those of `expected`, numbers within `tolerance`.
fn check(expected: &Value, rows: &[(i64, Vec<f64>)], tolerance: f64, name: &str) {
    let expected = expected[name].as_array().unwrap();
    assert_eq!(rows.len(), expected.len(), "{name}");
    assert!(!rows.is_empty());
    for ((time, numbers), row) in rows.iter().zip(expected) {
        assert_eq!(Some(*time), row[0].as_i64(), "{name}: exact to the nanosecond");
        assert_eq!(numbers.len() + 1, row.as_array().unwrap().len());
        for (at, number) in numbers.iter().enumerate() {
            let told = row[at + 1].as_f64().unwrap();
            assert!((number - told).abs() <= tolerance, "{name}: {number} {told}");
        }
    }
}

fn rows(samples: &[Sample]) -> Vec<(i64, Vec<f64>)> {
    let numbers = |sample: &Sample| match sample.reading {
        Reading::Velocity { forward_m_s, yaw_rate_rad_s } => vec![forward_m_s, yaw_rate_rad_s],
        Reading::Wheels { left_rad, right_rad } => vec![left_rad, right_rad],
        Reading::Gyro { yaw_rate_rad_s } => vec![yaw_rate_rad_s],
        Reading::Heading { heading_rad } => vec![heading_rad],
        Reading::Gps { x_m, y_m } => vec![x_m, y_m],
        other => panic!("{other:?}"),
    };
    samples.iter().map(|sample| (sample.time.0, numbers(sample))).collect()
}

#[test]
fn a_bag_of_rosbags_is_read_field_by_field_with_and_without_compression() {
    for compression in ["none", "storage"] {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        let expected = ask("write_bag.py", &[&bag, Path::new(compression)]);
        let mapping = folder.path().join("mapping.toml");
        std::fs::write(&mapping, MAPPING).unwrap();
        let opened = open_mapped(&bag, Some(&mapping), &ReadOptions::default())
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(opened.report.form, Form::Bag);
        assert!(opened.report.is_clean(), "{}", opened.report);
        let own = &opened.recording.robots[&RobotId(1)];
        check(&expected, &rows(&own.odometry), 0.0, "velocity");
        check(&expected, &rows(&opened.recording.robots[&RobotId(2)].odometry), 0.0, "wheel_odometry");
        check(&expected, &rows(&own.gyro), 0.0, "gyro");
        // Through a quaternion and back.
        check(&expected, &rows(&own.heading), 1e-14, "heading");
        // pymap3d computes the same in another order: within a few units in the last place of the Earth's radius.
        check(&expected, &rows(&own.gps), 1e-8, "gps");
        let commands: Vec<_> = own
            .commands
            .iter()
            .map(|command| (command.time.0, vec![command.forward_m_s, command.yaw_rate_rad_s]))
            .collect();
        check(&expected, &commands, 0.0, "command");
        let pose = |truth: &pleiad_recording::TruthSample| {
            (truth.time.0, vec![truth.pose.x_m(), truth.pose.y_m(), truth.pose.yaw_rad()])
        };
        check(&expected, &own.truth.iter().map(pose).collect::<Vec<_>>(), 1e-14, "truth");
    }
}
