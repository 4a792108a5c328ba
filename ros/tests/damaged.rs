//! Whatever bytes come, reading ends with a message or with an error that says what is wrong where.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests, outside a test function")]

use pleiad_ros::messages::builtin_interfaces::Time;
use pleiad_ros::messages::geometry_msgs::Quaternion;
use pleiad_ros::messages::nav_msgs::Odometry;
use pleiad_ros::messages::sensor_msgs::JointState;
use pleiad_ros::messages::std_msgs::Header;
use pleiad_ros::messages::tf2_msgs::TFMessage;
use pleiad_ros::{CdrError, Message, Problem, from_cdr, to_cdr};
use proptest::prelude::*;

fn odometry() -> Vec<u8> {
    let mut odometry = Odometry::default();
    odometry.header.frame_id = "odom".into();
    odometry.child_frame_id = "base_link".into();
    to_cdr(&odometry).unwrap()
}

fn refusal<M: Message>(bytes: &[u8]) -> CdrError {
    from_cdr::<M>(bytes).unwrap_err()
}

#[test]
fn a_payload_cut_anywhere_is_refused_with_its_field() {
    let whole = odometry();
    for length in 0..whole.len() {
        let error = refusal::<Odometry>(&whole[..length]);
        assert_eq!(error.message, "nav_msgs/msg/Odometry");
        assert!(error.offset <= length, "{error}");
        assert_eq!(error.field.is_empty(), length < 4, "{length}: {error}");
    }
    // Header 4, time 8, frame 4 + 5, padding 3, child 4 + 10, padding 6: the pose begins at byte 44 of the payload.
    let error = refusal::<Odometry>(&whole[..44 + 7 * 8 + 3 * 8 + 5]);
    assert_eq!(
        error.to_string(),
        "nav_msgs/msg/Odometry, field pose.covariance[3], byte 124: 8 bytes needed, 5 left; the payload is cut short \
         or of another type"
    );
}

#[test]
fn a_length_beyond_the_payload_allocates_nothing() {
    let mut bytes = to_cdr(&JointState::default()).unwrap();
    // Header 4, time 8, empty frame 4 + 1 and 3 of padding: here the number of names stands.
    bytes[20..24].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = refusal::<JointState>(&bytes);
    assert_eq!((error.field.as_str(), error.offset), ("name", 20));
    assert_eq!(error.problem, Problem::Length { found: u32::MAX, left: 12, most: 3 });
    let many = [&[0, 1, 0, 0][..], &1_000_000_u32.to_le_bytes()].concat();
    assert!(matches!(refusal::<TFMessage>(&many).problem, Problem::Length { most: 0, .. }));
}

#[test]
fn other_representations_are_named() {
    let mut bytes = odometry();
    bytes[1] = 7;
    let error = refusal::<Odometry>(&bytes);
    assert_eq!((error.offset, error.field.as_str()), (0, ""));
    assert!(error.to_string().contains("0x0007 (CDR version 2), expected plain CDR"), "{error}");
}

#[test]
fn a_payload_of_a_longer_type_is_refused_and_padding_is_not() {
    let header = to_cdr(&Header::default()).unwrap();
    assert!(matches!(refusal::<Time>(&header).problem, Problem::LeftOver { left: 5 }));
    for padding in 0..4 {
        let padded = [header.clone(), vec![0; padding]].concat();
        assert_eq!(from_cdr::<Header>(&padded).unwrap(), Header::default());
    }
    assert!(from_cdr::<Header>(&[header, vec![0; 4]].concat()).is_err());
}

#[test]
fn text_has_to_end_and_to_be_text() {
    let frame = |bytes: &[u8]| {
        let length = u32::try_from(bytes.len()).unwrap().to_le_bytes();
        [&[0, 1, 0, 0][..], &[0; 8], &length, bytes].concat()
    };
    assert_eq!(from_cdr::<Header>(&frame(b"map\0")).unwrap().frame_id, "map");
    assert_eq!(from_cdr::<Header>(&frame(b"")).unwrap().frame_id, "");
    assert_eq!(refusal::<Header>(&frame(b"map")).problem, Problem::Unterminated);
    assert_eq!(refusal::<Header>(&frame(b"\xff\0")).problem, Problem::Text);
    assert_eq!(refusal::<Header>(&frame(b"m\0p\0")).problem, Problem::Text);
    let unwritable = Header { frame_id: "m\0p".to_owned(), ..Header::default() };
    assert_eq!(to_cdr(&unwritable).unwrap_err().field, "frame_id");
}

#[test]
fn a_new_rotation_turns_nothing_and_an_instant_knows_its_nanoseconds() {
    assert_eq!(Quaternion::default(), Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
    assert_eq!(Time::from_nanos(-1), Some(Time { sec: -1, nanosec: 999_999_999 }));
    assert_eq!(Time { sec: -1, nanosec: 999_999_999 }.nanos(), Some(-1));
    assert_eq!(Time { sec: 0, nanosec: 1_000_000_000 }.nanos(), None);
    assert_eq!(Time::from_nanos(i64::MAX), None);
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_read_or_refused(mut bytes in proptest::collection::vec(any::<u8>(), 0..400), little: bool) {
        if let [a, b, ..] = bytes.as_mut_slice() {
            (*a, *b) = (0, u8::from(little));
        }
        if let Ok(message) = from_cdr::<TFMessage>(&bytes) {
            let again = to_cdr(&message).unwrap();
            prop_assert_eq!(to_cdr(&from_cdr::<TFMessage>(&again).unwrap()).unwrap(), again);
        }
        let _ = from_cdr::<JointState>(&bytes);
    }

    #[test]
    fn a_changed_byte_never_ends_in_a_panic(at in 0_usize..700, value: u8) {
        let mut bytes = odometry();
        let at = at % bytes.len();
        bytes[at] = value;
        if let Err(error) = from_cdr::<Odometry>(&bytes) {
            prop_assert!(error.offset <= bytes.len());
        }
    }

    #[test]
    fn instants_survive_seconds_and_nanoseconds(nanos in -2_147_483_648_000_000_000..2_147_483_647_999_999_999_i64) {
        prop_assert_eq!(Time::from_nanos(nanos).unwrap().nanos(), Some(nanos));
    }
}
