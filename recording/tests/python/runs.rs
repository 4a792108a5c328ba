//! A file that we wrote is read by the reference implementation of MCAP in Python, and its CDR by rosbags from the
//! definitions in the file alone; views are what Foxglove's definitions of their schemas allow.

use std::collections::BTreeMap;

use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{
    Estimate, LogLevel, LogLine, McapContents, Recording, RobotRecording, TruthSample, write_mcap,
};
use serde_json::{Value, json};

use crate::{Chance, ask};

const START: Timestamp = Timestamp(1_700_000_000_000_000_001);

fn recording(chance: &mut Chance) -> Recording {
    let mut robot = RobotRecording::default();
    for step in 0..300 {
        let time = START.plus_seconds(0.02 * f64::from(step));
        let reading = Reading::Velocity { forward_m_s: chance.next(), yaw_rate_rad_s: 1e-9 * chance.next() };
        robot.push(Sample { time, reading });
        robot.truth.push(TruthSample { time, pose: Pose2::new(chance.next(), chance.next(), 0.5) });
        let relative =
            Relative::RangeBearing { range_m: 1.0 + chance.next().abs(), bearing_rad: chance.next() };
        robot.push(Sample {
            time,
            reading: Reading::Sighting { target: Target::Landmark(LandmarkId(3)), relative },
        });
    }
    let mut recording = Recording { name: "python \"reads\" this".to_owned(), ..Recording::default() };
    recording.landmarks.insert(LandmarkId(3), [1.0, 2.0]);
    recording.robots.insert(RobotId(1), robot);
    recording
}

fn estimates(chance: &mut Chance) -> Vec<Estimate> {
    let one = |step: u32| Estimate {
        time: START.plus_seconds(0.1 * f64::from(step)),
        pose: Pose2::new(10.0 * chance.next(), 10.0 * chance.next(), chance.next()),
        covariance: Symmetric3(std::array::from_fn(|_| chance.next().abs())),
    };
    (0..60).map(one).collect()
}

/// A double as `float.hex` of Python reads it: from the number itself, since both are exact.
fn same(hex: &Value, number: f64) -> bool {
    let text = hex.as_str().unwrap();
    let (sign, rest) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let (mantissa, exponent) = rest.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, "0"));
    let digits = u64::from_str_radix(&format!("{whole}{fraction:0<13}"), 16).unwrap();
    let scale: i32 = exponent.parse::<i32>().unwrap() - 52;
    (sign * digits as f64 * 2.0_f64.powi(scale)).to_bits() == number.to_bits()
}

#[test]
fn python_reads_a_run_to_the_bit() {
    let mut chance = Chance(3);
    let recording = recording(&mut chance);
    let estimates = estimates(&mut chance);
    let line = LogLine {
        time: START,
        level: LogLevel::Info,
        name: "run".to_owned(),
        message: "60 facts".to_owned(),
    };
    let attachments = BTreeMap::from([("priors.toml".to_owned(), "[1]\nx_m = 0.5\n".to_owned())]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let contents = McapContents {
        recording: Some(&recording),
        estimates: BTreeMap::from([(RobotId(1), estimates.clone())]),
        logs: vec![line],
        attachments,
    };
    write_mcap(&path, &contents).unwrap_or_else(|error| panic!("{error}"));
    let found = ask("read_run.py", &[&path]);

    let velocity = found["velocity"].as_array().unwrap();
    assert_eq!(velocity.len(), 300);
    for (row, sample) in velocity.iter().zip(&recording.robots[&RobotId(1)].odometry) {
        let Reading::Velocity { forward_m_s, yaw_rate_rad_s } = sample.reading else { panic!() };
        assert_eq!(row[0].as_i64(), Some(sample.time.0));
        assert!(same(&row[1], forward_m_s) && same(&row[2], yaw_rate_rad_s), "{row} {sample:?}");
    }
    let (odometry, poses) = (found["odometry"].as_array().unwrap(), found["estimate"].as_array().unwrap());
    assert_eq!((odometry.len(), poses.len()), (60, 60));
    for ((row, pose), estimate) in odometry.iter().zip(poses).zip(&estimates) {
        assert_eq!((row[0].as_str(), row[1].as_str()), (Some("map"), Some("robot1")));
        assert!(same(&row[2], estimate.pose.x_m()) && same(&row[3], estimate.pose.y_m()), "{row}");
        assert!(same(&pose[1], estimate.pose.x_m()) && same(&pose[2], estimate.pose.y_m()), "{pose}");
        let [xx, yx, yy, tx, ty, tt] = estimate.covariance.0;
        for (hex, number) in row[4].as_array().unwrap().iter().zip([xx, yx, yy, tx, ty, tt]) {
            assert!(same(hex, number), "{hex} {number}");
        }
    }
    assert_eq!(found["counts"]["/robot1/relative"], 300);
    assert_eq!(found["schemas"]["/robot1/estimate"], json!(["foxglove.PoseInFrame", "jsonschema", "json"]));
    assert_eq!(
        found["schemas"]["/robot1/estimate_odometry"],
        json!(["nav_msgs/msg/Odometry", "ros2msg", "cdr"])
    );
    // 300 true poses of which every fifth is shown, a view every half second of six.
    assert_eq!(
        found["foxglove"],
        json!({
            "foxglove.FrameTransform": 60, "foxglove.Log": 1, "foxglove.PoseInFrame": 60 + 60,
            "foxglove.SceneUpdate": 1 + 12
        })
    );
    let told = json!({ "format_version": "3", "name": recording.name, "robots": "1" });
    assert_eq!(found["metadata"], json!([["pleiad", told]]));
    assert_eq!(found["attachments"], json!([["priors.toml", "[1]\nx_m = 0.5\n"]]));
}
