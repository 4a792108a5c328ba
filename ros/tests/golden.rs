//! Bytes and hashes are those that the Python package rosbags gives (`data/make_golden.py`), whose code has nothing in
//! common with ours.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests, outside a test function")]

use std::collections::BTreeMap;

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

struct Golden {
    hash: &'static str,
    little: Vec<u8>,
    big: Vec<u8>,
}

fn golden() -> BTreeMap<&'static str, Golden> {
    let bytes = |hex: &str| -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    };
    let line = |line: &'static str| {
        let [name, hash, little, big] = line.split(' ').collect::<Vec<_>>().try_into().unwrap();
        (name, Golden { hash, little: bytes(little), big: bytes(big) })
    };
    include_str!("data/golden.txt").lines().map(line).collect()
}

/// The message of one type, after its hash and both byte orders have been compared.
fn check<M: Message>(seen: &mut Vec<&'static str>) -> M {
    let all = golden();
    let expected = &all[M::NAME];
    assert_eq!(M::description().hash(), expected.hash, "{}", M::NAME);
    let message: M = from_cdr(&expected.little).unwrap();
    assert_eq!(to_cdr(&message).unwrap(), expected.little, "{}", M::NAME);
    assert_eq!(from_cdr::<M>(&expected.big).unwrap(), message);
    seen.push(M::NAME);
    message
}

#[test]
fn every_type_has_the_hash_and_the_bytes_of_rosbags() {
    let mut seen = Vec::new();
    check::<Time>(&mut seen);
    check::<Header>(&mut seen);
    check::<Point>(&mut seen);
    check::<Vector3>(&mut seen);
    check::<Quaternion>(&mut seen);
    check::<Pose>(&mut seen);
    check::<PoseStamped>(&mut seen);
    check::<PoseWithCovariance>(&mut seen);
    check::<PoseWithCovarianceStamped>(&mut seen);
    check::<Twist>(&mut seen);
    check::<TwistStamped>(&mut seen);
    check::<TwistWithCovariance>(&mut seen);
    check::<TwistWithCovarianceStamped>(&mut seen);
    check::<Transform>(&mut seen);
    check::<TransformStamped>(&mut seen);
    check::<Odometry>(&mut seen);
    check::<Imu>(&mut seen);
    check::<NavSatStatus>(&mut seen);
    check::<NavSatFix>(&mut seen);
    check::<JointState>(&mut seen);
    check::<TFMessage>(&mut seen);
    seen.sort_unstable();
    assert_eq!(seen, golden().into_keys().collect::<Vec<_>>(), "every golden type is compared");
}

/// `count` numbers from `first` upwards, each with a half added, as the golden messages are filled.
fn counted<const N: usize>(first: u32) -> [f64; N] {
    std::array::from_fn(|at| f64::from(first + u32::try_from(at).unwrap()) + 0.5)
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn quaternion([x, y, z, w]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}

fn header() -> Header {
    Header { stamp: Time { sec: 1, nanosec: 2 }, frame_id: "s3".to_owned() }
}

#[test]
fn odometry_is_read_field_by_field() {
    let [x, y, z] = counted(5);
    let pose = Pose { position: Point { x, y, z }, orientation: quaternion(counted(8)) };
    let expected = Odometry {
        header: header(),
        child_frame_id: "s4".to_owned(),
        pose: PoseWithCovariance { pose, covariance: counted(12) },
        twist: TwistWithCovariance {
            twist: Twist { linear: vector(counted(48)), angular: vector(counted(51)) },
            covariance: counted(54),
        },
    };
    assert_eq!(check::<Odometry>(&mut Vec::new()), expected);
}

#[test]
fn an_inertial_measurement_is_read_field_by_field() {
    let expected = Imu {
        header: header(),
        orientation: quaternion(counted(4)),
        orientation_covariance: counted(8),
        angular_velocity: vector(counted(17)),
        angular_velocity_covariance: counted(20),
        linear_acceleration: vector(counted(29)),
        linear_acceleration_covariance: counted(32),
    };
    assert_eq!(check::<Imu>(&mut Vec::new()), expected);
}

#[test]
fn a_fix_is_read_field_by_field() {
    let expected = NavSatFix {
        header: header(),
        status: NavSatStatus { status: 4, service: 5 },
        latitude: 6.5,
        longitude: 7.5,
        altitude: 8.5,
        position_covariance: counted(9),
        position_covariance_type: 18,
    };
    assert_eq!(check::<NavSatFix>(&mut Vec::new()), expected);
}

#[test]
fn joints_are_read_field_by_field() {
    let expected = JointState {
        header: header(),
        name: vec!["s4".to_owned(), "s5".to_owned()],
        position: vec![6.5, 7.5],
        velocity: vec![8.5, 9.5],
        effort: vec![10.5, 11.5],
    };
    assert_eq!(check::<JointState>(&mut Vec::new()), expected);
}

#[test]
fn transforms_are_read_field_by_field() {
    let transform = |first: i32, at: u32| TransformStamped {
        header: Header { stamp: Time { sec: first, nanosec: at + 1 }, frame_id: format!("s{}", at + 2) },
        child_frame_id: format!("s{}", at + 3),
        transform: Transform { translation: vector(counted(at + 4)), rotation: quaternion(counted(at + 7)) },
    };
    let expected = TFMessage { transforms: vec![transform(1, 1), transform(12, 12)] };
    assert_eq!(check::<TFMessage>(&mut Vec::new()), expected);
}

/// Hashes that a ROS 2 installation of its own printed: `type_description_hash` in the metadata of Jazzy's bags and
/// `ros2 topic info --verbose`, as published in the trackers of several projects.
#[test]
fn hashes_are_those_of_a_ros_installation() {
    let published = [
        (Odometry::description(), "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        (TFMessage::description(), "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
        (Imu::description(), "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
        (Twist::description(), "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"),
    ];
    for (description, hash) in published {
        assert_eq!(description.hash(), hash, "{}", description.name);
    }
}

#[test]
fn a_definition_names_what_it_needs_once_and_in_order() {
    let text = PoseStamped::description().text();
    let line = "=".repeat(80);
    let expected = format!(
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n\
         {line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
         {line}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n\
         {line}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n\
         {line}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n\
         {line}\nMSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
    );
    assert_eq!(text, expected);
    assert!(NavSatStatus::description().text().starts_with("int8 STATUS_UNKNOWN=-2\n"));
}
