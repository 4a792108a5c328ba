//! Keys, tokens and attachments are those that `rmw_zenoh` nodes use: expected texts were seen on the wire by others
//! (nodes of Jazzy, and firmware that such nodes accept).

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests, outside a test function")]

use pleiad_ros::Message;
use pleiad_ros::messages::geometry_msgs::Twist;
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::sensor_msgs::Imu;
use pleiad_ros::rmw::{Attachment, End, Node, RmwError, topic_key, topic_key_of_any_version};

const IMU: &str =
    "sensor_msgs::msg::dds_::Imu_/RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b";
const TWIST: &str = "geometry_msgs::msg::dds_::Twist_/RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a";

fn node() -> Node {
    Node {
        domain: 0,
        session: "100f0e0d0c0b0a090807060504030201".to_owned(),
        id: 0,
        namespace: "/".to_owned(),
        name: "nucleo_h743zi2".to_owned(),
    }
}

#[test]
fn a_topic_is_a_key_with_type_and_hash() {
    let key = topic_key(0, "/nucleo/imu/data", &Imu::description()).unwrap();
    assert_eq!(key, format!("0/nucleo/imu/data/{IMU}"));
    let any = topic_key_of_any_version(7, "/robot1/odom", &Odometry::description()).unwrap();
    assert_eq!(any, "7/robot1/odom/nav_msgs::msg::dds_::Odometry_/*");
}

#[test]
fn nodes_and_ends_of_topics_are_announced() {
    let token = "@ros2_lv/0/100f0e0d0c0b0a090807060504030201/0";
    assert_eq!(node().token().unwrap(), format!("{token}/0/NN/%/%/nucleo_h743zi2"));
    let published =
        node().end_token(11, End::Publisher, "/nucleo/imu/data", &Imu::description(), 10).unwrap();
    assert_eq!(published, format!("{token}/11/MP/%/%/nucleo_h743zi2/%nucleo%imu%data/{IMU}/::,10:,:,:,,"));
    let listened = Node { namespace: "/fleet/a".to_owned(), ..node() }
        .end_token(16, End::Subscription, "/nucleo/cmd_vel", &Twist::description(), 1)
        .unwrap();
    assert_eq!(
        listened,
        format!("{token}/16/MS/%/%fleet%a/nucleo_h743zi2/%nucleo%cmd_vel/{TWIST}/::,1:,:,:,,")
    );
}

#[test]
fn names_that_ros_does_not_allow_are_refused() {
    for topic in ["", "/", "odom", "/odom/", "//odom", "/1odom", "/odom-1", "/odom/*", "/odom/$x", "/öl"] {
        let error = topic_key(0, topic, &Odometry::description()).unwrap_err();
        assert!(matches!(&error, RmwError::Name { found, .. } if found == topic), "{error}");
    }
    let named = |change: fn(&mut Node)| {
        let mut node = node();
        change(&mut node);
        node.token().unwrap_err().to_string()
    };
    assert!(named(|node| node.name = "a/b".to_owned()).starts_with("node name `a/b`: expected letters"));
    assert!(named(|node| node.session = "xyz".to_owned()).starts_with("session `xyz`"));
    assert!(named(|node| node.namespace = "fleet".to_owned()).contains("expected an absolute name"));
}

#[test]
fn an_attachment_is_sequence_time_and_gid() {
    let gid: [u8; 16] = std::array::from_fn(|at| 0xa0 + u8::try_from(at).unwrap());
    let attachment = Attachment { sequence: 0x0102, source_time_ns: 1_700_000_000_000_000_001, gid };
    let mut expected = vec![0x02, 0x01, 0, 0, 0, 0, 0, 0];
    // 1_700_000_000_000_000_001 in hexadecimal: 17979cfe362a0001.
    expected.extend([0x01, 0x00, 0x2a, 0x36, 0xfe, 0x9c, 0x97, 0x17, 16]);
    expected.extend(gid);
    assert_eq!(attachment.to_bytes().as_slice(), expected);
    assert_eq!(Attachment::from_bytes(&expected), Ok(attachment));
}

#[test]
fn what_is_no_attachment_is_refused() {
    let bytes = Attachment { sequence: 1, source_time_ns: 2, gid: [3; 16] }.to_bytes();
    for length in 0..bytes.len() {
        assert_eq!(Attachment::from_bytes(&bytes[..length]), Err(RmwError::Attachment { found: length }));
    }
    let mut other = bytes;
    other[16] = 24;
    assert_eq!(Attachment::from_bytes(&other), Err(RmwError::Gid { found: 24 }));
}
