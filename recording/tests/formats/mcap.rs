//! MCAP files: the recording reads back to the bit, and what viewers are shown is what was estimated.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use crate::round_trip::{recording, small};
use mcap::records::MessageHeader;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};
use pleiad_recording::{
    Estimate, Form, LogLevel, LogLine, McapContents, Nominal, ReadOptions, Recording, TruthSample, open,
    open_mapped, read_estimates, write_estimates, write_mcap,
};
use pleiad_ros::from_cdr;
use pleiad_ros::messages::nav_msgs::Odometry;
use proptest::prelude::*;
use serde_json::{Value, json};

fn contents(recording: &Recording) -> McapContents<'_> {
    McapContents { recording: Some(recording), ..McapContents::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_recording_reads_back_to_the_same_bits(recording in recording()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("not/yet/run.mcap");
        write_mcap(&path, &contents(&recording)).unwrap_or_else(|error| panic!("{error}"));
        let (read, report) = open(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        // The debug form tells zeros of either sign apart, and no two numbers share one.
        prop_assert_eq!(format!("{read:?}"), format!("{recording:?}"));
        prop_assert_eq!(report.form, Form::Mcap);
    }
}

/// A recording of two robots with something in most channels.
fn team() -> Recording {
    let mut recording = small();
    recording.landmarks.insert(LandmarkId(7), [1.0, -0.25]);
    recording.walls.push([0.0, 0.0, 2.0, 0.0]);
    let mut robot = recording.robots[&RobotId(1)].clone();
    let start = robot.odometry[0].time;
    for step in 1..40 {
        let time = start.plus_seconds(0.1 * f64::from(step));
        let reading = Reading::Velocity { forward_m_s: 0.1, yaw_rate_rad_s: 0.2 };
        robot.push(Sample { time, reading });
        robot.truth.push(TruthSample { time, pose: Pose2::new(f64::from(step), 0.0, 0.0) });
    }
    let seen = Reading::Sighting {
        target: Target::Robot(RobotId(2)),
        relative: Relative::RangeBearing { range_m: 2.0, bearing_rad: 0.0 },
    };
    robot.push(Sample { time: start.plus_seconds(1.25), reading: seen });
    recording.robots.insert(RobotId(2), recording.robots[&RobotId(1)].clone());
    recording.robots.insert(RobotId(1), robot);
    recording
}

fn written(contents: &McapContents<'_>) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write_mcap(&path, contents).unwrap_or_else(|error| panic!("{error}"));
    (folder, path)
}

#[test]
fn nominal_values_and_files_within_are_read_back() {
    let mut recording = team();
    let mut nominal = Nominal::default();
    (nominal.range_sensor.max_range_m, nominal.range_sensor.half_fov_rad) = (5.0, 1.0);
    nominal.range_sensor.range_scale = 1.0;
    recording.nominal = Some(nominal);
    let attachments = BTreeMap::from([("priors.toml".to_owned(), "[1]\nx_m = 0.5\n".to_owned())]);
    let (_folder, path) = written(&McapContents { attachments: attachments.clone(), ..contents(&recording) });
    let opened = open_mapped(&path, None, &ReadOptions::default()).unwrap();
    assert_eq!(opened.recording, recording);
    assert_eq!(opened.attachments, attachments);
    let gyro = opened.report.file("/robot1/velocity").unwrap();
    assert_eq!((gyro.rows, gyro.kept), (40, 40));
}

#[test]
fn a_damaged_file_is_refused_or_reads_the_same() {
    let recording = team();
    let (_folder, path) = written(&contents(&recording));
    let whole = fs::read(&path).unwrap();
    let mut refused = 0;
    for at in (0..whole.len()).step_by(37) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        fs::write(&path, &bytes).unwrap();
        match open(&path, &ReadOptions::default()) {
            Ok((read, _)) => assert_eq!(read, recording, "byte {at}"),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 0, "the checksums were compared");
    for length in (0..whole.len()).step_by(41) {
        fs::write(&path, &whole[..length]).unwrap();
        let error = open(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("cannot be read as MCAP"), "{length}: {error}");
    }
}

/// Three poses 0.6 s apart, moving along x and turning.
fn estimates() -> Vec<Estimate> {
    let pose = |step: u32| Estimate {
        time: Timestamp(1_248_444_176_000_000_000).plus_seconds(0.6 * f64::from(step)),
        pose: Pose2::new(f64::from(step), 2.0, 0.5),
        covariance: Symmetric3([0.04, 0.01, 0.09, 0.001, 0.002, 0.0025]),
    };
    (0..3).map(pose).collect()
}

fn line() -> LogLine {
    LogLine {
        time: Timestamp(1_248_444_176_000_000_005),
        level: LogLevel::Warning,
        name: "replay".to_owned(),
        message: "robot 1: 3 samples refused".to_owned(),
    }
}

/// Topic, schema name and text, and payloads, in the order of the file.
fn messages(path: &Path) -> Vec<(String, String, String, u64, Vec<u8>)> {
    let bytes = fs::read(path).unwrap();
    let message = |message: Result<mcap::Message<'_>, _>| {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let text = String::from_utf8(schema.data.to_vec()).unwrap();
        (message.channel.topic.clone(), schema.name.clone(), text, message.log_time, message.data.to_vec())
    };
    mcap::MessageStream::new(&bytes).unwrap().map(message).collect()
}

fn run() -> (tempfile::TempDir, std::path::PathBuf) {
    let recording = team();
    let estimates = BTreeMap::from([(RobotId(1), estimates())]);
    written(&McapContents { estimates, logs: vec![line()], ..contents(&recording) })
}

#[test]
fn viewers_find_poses_scene_and_log_under_the_names_they_know() {
    let (_folder, path) = run();
    let all = messages(&path);
    let count = |topic: &str, schema: &str| all.iter().filter(|m| m.0 == topic && m.1 == schema).count();
    assert_eq!(count("/robot1/estimate", "foxglove.PoseInFrame"), 3);
    assert_eq!(count("/robot1/estimate_odometry", "nav_msgs/msg/Odometry"), 3);
    assert_eq!(count("/tf", "foxglove.FrameTransform"), 3);
    assert_eq!(count("/scene/robot1", "foxglove.SceneUpdate"), 3);
    assert_eq!(count("/scene/world", "foxglove.SceneUpdate"), 1);
    assert_eq!(count("/log", "foxglove.Log"), 1);
    assert!(count("/robot1/truth_pose", "foxglove.PoseInFrame") > 10);
    assert!(all.windows(2).all(|pair| pair[0].3 <= pair[1].3), "in the order of their times");
}

/// Asserts that `value` has the fields of `schema` and no others, with their types.
fn check(schema: &Value, value: &Value, place: &str) {
    match schema["type"].as_str().unwrap() {
        "object" if schema.get("properties").is_none() => assert!(value.is_object(), "{place}"),
        "object" => {
            let names = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
            assert_eq!(names(&schema["properties"]), names(value), "{place}");
            for (name, property) in schema["properties"].as_object().unwrap() {
                check(property, &value[name], &format!("{place}.{name}"));
            }
        }
        "array" => {
            value.as_array().unwrap().iter().for_each(|element| check(&schema["items"], element, place));
        }
        "number" => assert!(value.is_number(), "{place}: {value}"),
        "integer" => assert!(value.is_i64(), "{place}: {value}"),
        "boolean" => assert!(value.is_boolean(), "{place}: {value}"),
        "string" => assert!(value.is_string(), "{place}: {value}"),
        other => panic!("{place}: {other}"),
    }
}

#[test]
fn every_json_message_is_what_its_schema_says() {
    let (_folder, path) = run();
    let mut seen = BTreeSet::new();
    for (topic, name, schema, _, data) in messages(&path) {
        // A sighting has only the numbers of its kind.
        if !topic.ends_with("_odometry") && name != "pleiad.relative" {
            check(&serde_json::from_str(&schema).unwrap(), &serde_json::from_slice(&data).unwrap(), &topic);
            seen.insert(name);
        }
    }
    let known = ["foxglove.FrameTransform", "foxglove.Log", "foxglove.PoseInFrame", "foxglove.SceneUpdate"];
    assert!(known.iter().all(|name| seen.contains(*name)), "{seen:?}");
}

#[test]
fn an_estimate_is_the_same_pose_in_every_view() {
    let (_folder, path) = run();
    let all = messages(&path);
    let of = |topic: &'static str| all.iter().filter(move |m| m.0 == topic).map(|m| m.4.as_slice());
    let expected = &estimates()[2];
    let odometry: Odometry = from_cdr(of("/robot1/estimate_odometry").nth(2).unwrap()).unwrap();
    assert_eq!(odometry.header.stamp.nanos(), Some(expected.time.0));
    assert_eq!((odometry.header.frame_id.as_str(), odometry.child_frame_id.as_str()), ("map", "robot1"));
    assert_eq!((odometry.pose.pose.position.x, odometry.pose.pose.position.y), (2.0, 2.0));
    assert!((odometry.pose.pose.orientation.z - 0.25_f64.sin()).abs() < 1e-15);
    assert!((odometry.pose.pose.orientation.w - 0.25_f64.cos()).abs() < 1e-15);
    // By rows over (x, y, z, roll, pitch, yaw): REP 103.
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[35]) = (0.04, 0.09, 0.0025);
    (covariance[1], covariance[6]) = (0.01, 0.01);
    (covariance[5], covariance[30], covariance[11], covariance[31]) = (0.001, 0.001, 0.002, 0.002);
    assert_eq!(odometry.pose.covariance.map(f64::to_bits), covariance.map(f64::to_bits));
    let pose: Value = serde_json::from_slice(of("/robot1/estimate").nth(2).unwrap()).unwrap();
    assert_eq!(pose["timestamp"], json!({ "sec": 1_248_444_177, "nsec": 200_000_000 }));
    assert_eq!(pose["pose"]["position"], json!({ "x": 2.0, "y": 2.0, "z": 0.0 }));
    let moved: Value = serde_json::from_slice(of("/tf").nth(2).unwrap()).unwrap();
    assert_eq!(moved["rotation"], pose["pose"]["orientation"]);
    let log: Value = serde_json::from_slice(of("/log").next().unwrap()).unwrap();
    assert_eq!((log["level"].as_u64(), log["name"].as_str()), (Some(3), Some("replay")));
}

#[test]
fn estimates_are_read_back_and_written_as_csv() {
    let (folder, path) = run();
    let read = read_estimates(&path).unwrap();
    assert_eq!(read.keys().collect::<Vec<_>>(), [&RobotId(1)]);
    assert_eq!(read[&RobotId(1)].len(), 3);
    for (read, written) in read[&RobotId(1)].iter().zip(estimates()) {
        assert_eq!((read.time, read.covariance), (written.time, written.covariance));
        assert_eq!(read.pose.position(), written.pose.position());
        assert!((read.pose.yaw_rad() - written.pose.yaw_rad()).abs() < 1e-15);
    }
    let csv = folder.path().join("settled/robot-1.csv");
    write_estimates(&csv, &estimates()[..1]).unwrap();
    assert_eq!(
        fs::read_to_string(&csv).unwrap(),
        "t,x,y,heading,cov_xx,cov_xy,cov_yy,cov_x_heading,cov_y_heading,cov_heading_heading\n\
         1248444176.000000000,0.0,2.0,0.5,0.04,0.01,0.09,0.001,0.002,0.0025\n"
    );
}

#[test]
fn a_scene_has_ellipse_trail_and_line_of_sight() {
    let (_folder, path) = run();
    let scenes: Vec<Value> = messages(&path)
        .iter()
        .filter(|message| message.0 == "/scene/robot1")
        .map(|message| serde_json::from_slice(&message.4).unwrap())
        .collect();
    let lines = |scene: usize| scenes[scene]["entities"][0]["lines"].as_array().unwrap();
    let point = |line: &Value, at: usize| {
        let point = &line["points"][at];
        (point["x"].as_f64().unwrap(), point["y"].as_f64().unwrap())
    };
    // sigma_x = 0.2: the first corner of the ellipse is sqrt(5.991) of it ahead along x.
    let (x, _) = point(&lines(1)[0], 0);
    assert!((x - (1.0 + 5.991_f64.sqrt() * 0.2)).abs() < 1e-12);
    assert_eq!(lines(2)[1]["points"].as_array().unwrap().len(), 3, "the trail of all three poses");
    // Seen 1.25 s after the first odometry, which is 0.897 s before the first estimate: between the first two.
    let sight = &lines(1)[3];
    assert_eq!(sight["points"].as_array().unwrap().len(), 2);
    assert_eq!(point(sight, 0), (0.0, 2.0));
    let (x, y) = point(sight, 1);
    assert!((x - 2.0 * 0.5_f64.cos()).abs() < 1e-12 && (y - 2.0 - 2.0 * 0.5_f64.sin()).abs() < 1e-12);
    assert!(lines(0)[3]["points"].as_array().unwrap().is_empty());
}

#[test]
fn what_could_not_be_read_back_is_not_written_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut Recording)| {
        let mut recording = team();
        change(&mut recording);
        let path = folder.path().join("run.mcap");
        let error = write_mcap(&path, &contents(&recording)).unwrap_err().to_string();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was written");
        error
    };
    assert!(refused(|recording| recording.robots.clear()).contains("it has no robot"));
    let error = refused(|recording| {
        let robot = recording.robots.get_mut(&RobotId(1)).unwrap();
        robot.gps = robot.odometry.clone();
    });
    assert!(error.contains("robot 1, gps at") && error.contains("a reading of another channel"), "{error}");
    let error =
        refused(|recording| recording.landmarks.insert(LandmarkId(1), [f64::NAN, 0.0]).map_or((), drop));
    assert!(error.contains("map: the number NaN is not finite"), "{error}");
}

/// A file of robot 1 whose velocity topic holds these messages.
fn by_hand(messages: &[&str]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let values = [("format_version", "3"), ("name", "by hand"), ("robots", "1")];
    let metadata = values.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
    writer.write_metadata(&mcap::records::Metadata { name: "pleiad".to_owned(), metadata }).unwrap();
    let schema = writer.add_schema("pleiad.velocity", "jsonschema", b"{}").unwrap();
    let channel = writer.add_channel(schema, "/robot1/velocity", "json", &BTreeMap::new()).unwrap();
    for text in messages {
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn a_message_that_cannot_be_used_is_named_or_skipped_and_counted() {
    let good = r#"{"t":{"sec":1,"nsec":0},"v":1.0,"w":0.0}"#;
    for (bad, expected) in [
        (r#"{"t":{"sec":2,"nsec":0},"v":1.0}"#, "expected a finite number `w`"),
        (r#"{"t":{"sec":2,"nsec":1000000000},"v":1.0,"w":0}"#, "with `nsec` below 1e9"),
        (r#"{"t":2.0,"v":1.0,"w":0}"#, "expected a stamp `t`"),
        ("[1]", "expected a JSON object"),
        ("{", "expected a JSON object (EOF"),
    ] {
        let (_folder, path) = by_hand(&[good, bad]);
        let error = open(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("topic /robot1/velocity, message 2") && error.contains(expected), "{error}");
        let (read, report) = open(&path, &ReadOptions { skip_bad_rows: true }).unwrap();
        let file = report.file("/robot1/velocity").unwrap();
        assert_eq!((file.rows, file.kept, file.skipped), (2, 1, 1));
        assert_eq!(read.robots[&RobotId(1)].odometry.len(), 1);
    }
}
