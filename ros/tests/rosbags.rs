//! The Python package rosbags as a witness: what it writes of random messages is read and written again to the same
//! bytes, and our definitions are its own.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests, outside a test function")]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pleiad_ros::messages::builtin_interfaces::Time;
use pleiad_ros::messages::geometry_msgs::{
    Point, Pose, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion, Transform,
    TransformStamped, Twist, TwistStamped, TwistWithCovariance, TwistWithCovarianceStamped, Vector3,
};
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::sensor_msgs::{Imu, JointState, NavSatFix, NavSatStatus};
use pleiad_ros::messages::std_msgs::Header;
use pleiad_ros::messages::tf2_msgs::TFMessage;
use pleiad_ros::{Message, from_cdr, to_cdr};

/// Messages of each type.
const MESSAGES: usize = 200;

/// The interpreter with the packages of `.ci/python-requirements.txt`.
fn python() -> PathBuf {
    let in_target = || {
        let target = std::env::var_os("CARGO_TARGET_DIR");
        let here = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../target");
        target.map_or_else(here, PathBuf::from).join("python/bin/python")
    };
    let path = std::env::var_os("PLEIAD_PYTHON").map_or_else(in_target, PathBuf::from);
    assert!(
        path.is_file(),
        "{} is missing: run .ci/python-venv, or name an interpreter that has the packages of \
         .ci/python-requirements.txt in PLEIAD_PYTHON",
        path.display()
    );
    path
}

/// What the witness prints.
fn ask(arguments: &[&str], input: &str) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/witness.py");
    let mut child = Command::new(python())
        .arg(script)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "the witness disagrees: see its message above");
    String::from_utf8(output.stdout).unwrap()
}

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn messages_of<M: Message>() {
    let answer = ask(&["messages", M::NAME, &MESSAGES.to_string()], "");
    let mut count = 0;
    for line in answer.lines() {
        let (little, big) = line.split_once(' ').unwrap();
        let (little, big) = (bytes(little), bytes(big));
        let message: M = from_cdr(&little).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(to_cdr(&message).unwrap(), little, "{message:?}");
        // NaN equals nothing, hence bytes.
        let other: M = from_cdr(&big).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(to_cdr(&other).unwrap(), little);
        count += 1;
    }
    assert_eq!(count, MESSAGES, "{}", M::NAME);
}

macro_rules! for_every_type {
    ($function:ident) => {
        $function::<Time>();
        $function::<Header>();
        $function::<Point>();
        $function::<Vector3>();
        $function::<Quaternion>();
        $function::<Pose>();
        $function::<PoseStamped>();
        $function::<PoseWithCovariance>();
        $function::<PoseWithCovarianceStamped>();
        $function::<Twist>();
        $function::<TwistStamped>();
        $function::<TwistWithCovariance>();
        $function::<TwistWithCovarianceStamped>();
        $function::<Transform>();
        $function::<TransformStamped>();
        $function::<Odometry>();
        $function::<Imu>();
        $function::<NavSatStatus>();
        $function::<NavSatFix>();
        $function::<JointState>();
        $function::<TFMessage>();
    };
}

#[test]
fn random_messages_have_the_bytes_of_rosbags() {
    for_every_type!(messages_of);
}

fn definition_of<M: Message>() {
    let answer = ask(&["definition", M::NAME], &M::description().text());
    assert_eq!(answer.trim(), M::description().hash(), "{}", M::NAME);
}

#[test]
fn definitions_are_parsed_to_the_types_and_hashes_of_rosbags() {
    for_every_type!(definition_of);
}
