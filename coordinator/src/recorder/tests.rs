use std::sync::Arc;

use pleiad_bus::MemoryNetwork;
use pleiad_estimation::fact::{Body, ClockMap, Entry, EntryId};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Sequence, Timestamp};
use pleiad_protocol::{Estimate, Message};

use super::*;

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);

fn team() -> TeamName {
    TeamName::new("blue").unwrap()
}

fn incoming(robot: RobotId, kind: Kind, payload: Vec<u8>) -> Incoming {
    Incoming { key: keys::of(&team(), robot, kind), payload }
}

fn facts(robot: RobotId) -> Vec<u8> {
    let body = Body::ClockMap(ClockMap { reference: Timestamp(0), offset_ns: 5, rate_ppb: 0 });
    let id = EntryId { robot, boot: BootIndex(0), sequence: Sequence(0) };
    pleiad_protocol::encode_entries(&[Entry { id, body, extension: Vec::new() }])
}

fn estimate(robot: RobotId, x_m: f64) -> Vec<u8> {
    let pose = Pose2::new(x_m, -2.5, 0.5);
    let estimate = Estimate {
        robot,
        boot: BootIndex(3),
        time: Timestamp(1_248_273_546_275_000_001),
        map_from_odom: Pose2::new(0.0, 0.0, 0.0),
        odom_from_robot: pose,
        map_from_robot: pose,
        covariance: Symmetric3([0.01, 0.0, 0.04, 0.0, 0.0, 0.09]),
        sigma: [0.1, 0.2, 0.3],
        facts_used: 42,
    };
    Message::Estimate(estimate).encode()
}

fn lines(folder: &Path) -> Vec<String> {
    std::fs::read_to_string(folder.join(ESTIMATES)).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn messages_are_kept_as_they_came_and_estimates_become_rows() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(folder.path()).unwrap();
    let at = Duration::from_millis;
    writer.take(at(1), &incoming(ONE, Kind::Fact, facts(ONE))).unwrap();
    writer.take(at(2), &incoming(TWO, Kind::Estimate, estimate(TWO, 0.1 + 0.2))).unwrap();
    writer.take(at(3), &incoming(TWO, Kind::Fact, facts(TWO))).unwrap();
    let traffic = writer.finish().unwrap();
    let found = read_frames(&folder.path().join(FACTS)).unwrap();
    let frame = |robot, elapsed| Frame { elapsed: at(elapsed), robot, message: facts(robot) };
    assert_eq!(found, Frames { frames: vec![frame(ONE, 1), frame(TWO, 3)], torn_bytes: 0 });
    assert_eq!(read_frames(&folder.path().join(STATUSES)).unwrap(), Frames::default());
    // 0.1 + 0.2 is not 0.3; 17 digits say so.
    let row = "1248273546275000001,2,3,0.30000000000000004,-2.5,0.5,0.1,0.2,0.3,42";
    assert_eq!(lines(folder.path()), [ESTIMATE_COLUMNS, row]);
    assert_eq!((traffic.refused, traffic.misattributed), (0, 0));
    let bytes = facts(ONE).len() as u64;
    assert_eq!(traffic.of_kind(Kind::Fact), Count { messages: 2, bytes: 2 * bytes });
}

#[test]
fn what_is_not_the_sender_s_own_or_not_valid_is_counted_and_never_a_row() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(folder.path()).unwrap();
    for planted in [
        incoming(ONE, Kind::Fact, facts(TWO)),
        incoming(ONE, Kind::Estimate, estimate(TWO, 1.0)),
        incoming(ONE, Kind::Estimate, facts(ONE)),
        incoming(ONE, Kind::Fact, vec![1, 2, 3]),
        incoming(ONE, Kind::Fact, vec![0; pleiad_protocol::limits::MESSAGE_BYTES + 1]),
        Incoming { key: "elsewhere/1/fact".into(), payload: Vec::new() },
    ] {
        writer.take(Duration::ZERO, &planted).unwrap();
    }
    let traffic = writer.finish().unwrap();
    assert_eq!((traffic.misattributed, traffic.refused), (2, 4));
    assert_eq!(lines(folder.path()), [ESTIMATE_COLUMNS]);
    let kept = read_frames(&folder.path().join(FACTS)).unwrap().frames;
    let kept: Vec<_> = kept.into_iter().map(|frame| frame.message).collect();
    assert_eq!(kept, [facts(TWO), vec![1, 2, 3]], "evidence, except what no message can be");
}

#[tokio::test]
async fn a_recorder_takes_everything_published_before_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let network = MemoryNetwork::new();
    let bus = Arc::new(network.join("recorder"));
    let agent = network.join("agent");
    let recorder = Recorder::start(&bus, &team(), folder.path()).await.unwrap();
    for _ in 0..100 {
        agent.publish(&keys::of(&team(), ONE, Kind::Fact), facts(ONE)).await.unwrap();
        agent.publish(&keys::of(&team(), TWO, Kind::Estimate), estimate(TWO, 1.0)).await.unwrap();
    }
    let other = TeamName::new("red").unwrap();
    agent.publish(&keys::of(&other, ONE, Kind::Fact), facts(ONE)).await.unwrap();
    let path = recorder.folder().to_owned();
    assert_eq!(path, folder.path().join("recorder"));
    let traffic = recorder.finish().await.unwrap();
    assert_eq!((traffic.of_robot(ONE).messages, traffic.of_robot(TWO).messages), (100, 100));
    assert_eq!(read_frames(&path.join(FACTS)).unwrap().frames.len(), 100);
    assert_eq!(lines(&path).len(), 101);
    let counts = std::fs::read_to_string(path.join(TRAFFIC)).unwrap();
    let counts: serde_json::Value = serde_json::from_str(&counts).unwrap();
    assert_eq!(counts["robots"]["1"]["fact"]["messages"], 100);
}

#[tokio::test]
async fn an_earlier_recording_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let bus = MemoryNetwork::new().join("recorder");
    for expected in ["recorder", "recorder-2", "recorder-3"] {
        let recorder = Recorder::start(&bus, &team(), folder.path()).await.unwrap();
        assert_eq!(recorder.folder(), folder.path().join(expected));
        recorder.finish().await.unwrap();
    }
}
