//! Bags and mappings that do not fit are refused with their place and what to do.

use std::collections::BTreeMap;
use std::fs;

use mcap::records::MessageHeader;
use pleiad_estimation::Timestamp;
use pleiad_recording::{ReadOptions, open, open_mapped};
use pleiad_ros::messages::geometry_msgs::{Transform, TransformStamped, Twist};
use pleiad_ros::messages::tf2_msgs::TFMessage;

use super::bag::{ODOMETRY, header, robot, small, small_with};

/// The message that a mapping of [`small`] is refused with.
fn refused(mapping: &str) -> String {
    small().done(mapping).refusal()
}

#[test]
fn a_mapping_that_does_not_fit_is_refused_with_its_place() {
    for (from, to, expected) in [
        ("/robot1/odom", "/odom", "topic[1] (/odom): the bag has no topic `/odom`"),
        ("velocity", "gyro", "found `gyro`, but nav_msgs/msg/Odometry gives velocity, increment"),
        ("velocity", "velocty", "found `velocty`, expected one of command, wheel_odometry, velocity"),
        ("velocity", "velocty", "did you mean `velocity`?"),
        ("robot = 1", "robot = 1\nspeed = 2", "unknown field `speed`"),
        (
            "robot = 1",
            "robot = 1\nscale = [1.0, 2.0, 3.0]",
            "found 3 numbers, expected one, or one for each of v, w",
        ),
        ("robot = 1", "robot = 1\nscale = [0.0]", "expected finite numbers other than 0"),
        (
            "robot = 1",
            "robot = 1\ntarget = { robot = 2 }",
            "expected for channel `relative` and for no other",
        ),
        ("robot = 1", "robot = 1\nframe = \"map\"", "message 1: found the frame `odom`, expected `map`"),
        ("robot = 1", "robot = 1\nmax_tilt_rad = 4", "found 4, expected an angle from 0 to pi"),
        ("velocity", "truth", "robot 1 cannot be localized without odometry; map a topic to velocity"),
        (ODOMETRY, "name = \"x\"", "found neither [[topic]] nor [[csv]]"),
        (
            ODOMETRY,
            "origin = { latitude_deg = 91, longitude_deg = 0 }\n[[topic]]\ntopic=\"/a\"\nrobot=1\n\
                    channel=\"gps\"",
            "origin: expected a latitude from -90 to 90",
        ),
    ] {
        let error = refused(&ODOMETRY.replace(from, to));
        assert!(error.contains(expected), "{expected}\n{error}");
    }
    assert!(
        refused(&ODOMETRY.replace("/robot1/odom", "/odom"))
            .contains("\n  /robot1/odom (nav_msgs/msg/Odometry)")
    );
    let both = format!("{ODOMETRY}{}", ODOMETRY.replace("velocity", "increment"));
    assert!(refused(&both).contains("velocity and increment of robot 1, expected only one"));
}

#[test]
fn what_a_bag_holds_is_told_where_nobody_says_what_it_is() {
    let mut bag = small();
    bag.add_bytes("/scan", "sensor_msgs/msg/LaserScan", "", &[], 0);
    let done = bag.done("");
    fs::remove_file(done.path.with_file_name("mapping.toml")).expect("removed");
    let error = done.refusal();
    assert!(error.contains("there is no mapping") && error.contains("--mapping"), "{error}");
    assert!(error.contains("/robot1/odom (nav_msgs/msg/Odometry)\n"), "{error}");
    assert!(error.contains("/scan (sensor_msgs/msg/LaserScan, not read)"), "{error}");
    // Elsewhere than beside the bag, it is named.
    let other = tempfile::tempdir().expect("a temporary folder");
    let mapping = other.path().join("any.toml");
    fs::write(&mapping, ODOMETRY).expect("written");
    let opened = open_mapped(&done.path, Some(&mapping), &ReadOptions::default()).expect("mapped");
    assert_eq!(robot(&opened.recording).odometry.len(), 2);
    assert!(opened.report.warnings.contains(&"topics that the mapping leaves out: /scan".to_owned()));
}

#[test]
fn frames_are_asked_for_and_those_that_there_are_are_told() {
    let tf = "[[topic]]\ntopic = \"/tf\"\nrobot = 1\nchannel = \"truth\"\n";
    let with = |more: &str| {
        let mut bag = small();
        let transform = TransformStamped {
            header: header(0, "odom"),
            child_frame_id: "base".to_owned(),
            transform: Transform::default(),
        };
        bag.add("/tf", &TFMessage { transforms: vec![transform] }, 0);
        bag.done(&format!("{ODOMETRY}{tf}{more}")).refusal()
    };
    assert!(with("").contains("name the two that are meant in `frame` and `child_frame`"));
    let error = with("frame = \"map\"\nchild_frame = \"base\"");
    assert!(error.contains("no transform from `map` to `base`; it has odom -> base"), "{error}");
}

#[test]
fn bags_of_other_kinds_are_refused_with_what_to_do() {
    let mut bag = small();
    let schema = bag.writer.add_schema("geometry_msgs/Twist", "ros1msg", b"").expect("added");
    let channel = bag.writer.add_channel(schema, "/cmd", "ros1", &BTreeMap::new()).expect("added");
    let header = MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    bag.writer.write_to_known_channel(&header, &[]).expect("written");
    let mapping = format!("{ODOMETRY}[[topic]]\ntopic = \"/cmd\"\nrobot = 1\nchannel = \"command\"\n");
    let error = bag.done(&mapping).refusal();
    assert!(error.contains("found messages written as `ros1`, expected `cdr`"), "{error}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("bag_0.db3"), "SQLite format 3").expect("written");
    fs::write(folder.path().join("mapping.toml"), ODOMETRY).expect("written");
    let error = open(folder.path(), &ReadOptions::default()).expect_err("refused").to_string();
    assert!(error.contains("convert it with `ros2 bag convert`"), "{error}");
    let unstamped = |time: &str| {
        let mut bag = small();
        bag.add("/cmd", &Twist::default(), 3);
        bag.done(&format!("{mapping}{time}"))
    };
    assert!(unstamped("time = \"header\"").refusal().contains("geometry_msgs/msg/Twist has none"));
    assert_eq!(robot(&unstamped("").read().0).commands[0].time, Timestamp(3));
}

/// Each byte in turn, with checksums and without, packed and not: lengths lead nowhere that they should not.
#[test]
fn a_bag_with_any_one_byte_changed_is_read_or_refused() {
    for (packed, checked) in [(None, true), (None, false), (Some(mcap::Compression::Zstd), false)] {
        let options = mcap::WriteOptions::new()
            .compression(packed)
            .calculate_chunk_crcs(checked)
            .calculate_data_section_crc(checked);
        let done = small_with(options).done(ODOMETRY);
        let sound = fs::read(&done.path).expect("written");
        let mut refused = 0;
        for at in 0..sound.len() {
            for value in [0, 255] {
                let mut bytes = sound.clone();
                bytes[at] = value;
                fs::write(&done.path, &bytes).expect("written");
                refused += usize::from(open(&done.path, &ReadOptions::default()).is_err());
            }
        }
        assert!(refused > sound.len() / 10, "{refused} of {}", 2 * sound.len());
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]

    #[test]
    fn a_bag_with_changed_bytes_is_read_or_refused(
        changes in proptest::collection::vec((proptest::prelude::any::<usize>(), proptest::prelude::any::<u8>()), 1..6),
    ) {
        let done = small().done(ODOMETRY);
        let mut bytes = fs::read(&done.path).expect("written");
        for (at, value) in changes {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        fs::write(&done.path, &bytes).expect("written");
        if let Ok((recording, _)) = open(&done.path, &ReadOptions::default()) {
            proptest::prop_assert_eq!(robot(&recording).odometry.len(), 2);
        }
    }

    #[test]
    fn any_bytes_behind_the_magic_are_refused(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300)) {
        let done = small().done(ODOMETRY);
        fs::write(&done.path, [&b"\x89MCAP0\r\n"[..], &bytes].concat()).expect("written");
        proptest::prop_assert!(done.refusal().contains("cannot be read as MCAP"));
    }
}
