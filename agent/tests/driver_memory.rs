//! The driver over the network in memory: processes as tasks, their journals and results in real files, all
//! waiting done by asking for the status.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests are tests")]

#[path = "support/field.rs"]
mod field;
mod support;

use std::collections::BTreeMap;
use std::sync::Arc;

use field::{DEADLINE, Field, filed, kill};
use pleiad_agent::driver::{DriverError, JOURNAL, run};
use pleiad_agent::journal::{Journal, JournalError};
use pleiad_agent::results::{self, ONLINE, SETTLED};
use pleiad_agent::{AgentConfig, Record};
use pleiad_bus::Bus;
use pleiad_estimation::fact::Entry;
use pleiad_estimation::reference::{ErrorForm, JointEkf, facts_from_entries};
use pleiad_estimation::sample::{Reading, Sample, Target};
use pleiad_estimation::{BootIndex, RobotId};
use pleiad_protocol::keys::Kind;
use pleiad_protocol::{
    ControlReply, ControlRequest, Message, SensorBatch, SensorKind, Status, encode_entries, encode_sample,
};
use support::team::world;
use support::{agent, assert_pose, folded, log, on_circle, sample, sees, standing_log, start, velocity};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_fed_team_comes_to_hold_the_bits_of_one_ledger_and_leaves_its_results() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let world = world(3, 3, 6.0);
    let mut processes = Vec::new();
    for config in world.configs.values() {
        processes.push(field.start(&filed(config.clone(), folder.path())).await);
    }
    field.feed(&world.samples, &mut BTreeMap::new()).await;
    field.end([1, 2, 3]).await;
    let agreed = field.agreed([1, 2, 3]).await;

    let fold = world.configs[&RobotId(1)].node().unwrap().fold;
    let entries = field.entries(2).await;
    let mut ledger = folded(&entries, fold);
    assert_eq!(ledger.fingerprint(), agreed.estimate);
    let reference = JointEkf::new(ErrorForm::Invariant).fold(&facts_from_entries(&entries));

    for (robot, process) in (1..).zip(processes) {
        field.shut_down(robot, process).await;
        let folder = folder.path().join(format!("r{robot}"));
        let summary = results::read_summary(&folder).unwrap();
        assert_eq!((summary.robot, summary.boots), (robot, 1));
        assert_eq!(summary.estimate, agreed.estimate.to_string());
        let count = |wanted: fn(&Reading) -> bool| {
            world.samples.iter().filter(|(_, sample)| wanted(&sample.reading)).count() as u64
        };
        let of_robots =
            |reading: &Reading| matches!(reading, Reading::Sighting { target: Target::Robot(_), .. });
        let of_the_map = |reading: &Reading| {
            let landmark = matches!(reading, Reading::Sighting { target: Target::Landmark(_), .. });
            landmark || matches!(reading, Reading::Gps { .. } | Reading::Heading { .. })
        };
        assert_eq!((summary.facts_relative, summary.facts_absolute), (count(of_robots), count(of_the_map)));
        assert_eq!((summary.facts_pending, summary.facts_void), (0, 0));
        let own = world.samples.iter().filter(|(id, _)| id.0 == robot).count() as u64;
        assert_eq!((summary.samples_accepted, summary.samples_refused.len()), (own, 0));
        assert!(summary.messages > 0 && summary.bytes > summary.messages);

        let settled = results::read_estimates(&folder.join(SETTLED)).unwrap();
        // Two a second over six seconds, both ends included.
        let times: Vec<f64> = settled.iter().map(|estimate| estimate.time.seconds()).collect();
        assert_eq!(times, (0..=12).map(|k| f64::from(k) / 2.0).collect::<Vec<_>>());
        let expected = reference.robot(RobotId(robot)).unwrap();
        let last = settled.last().unwrap();
        assert_pose(&last.pose, &expected.correction.compose(&last.nominal), 1e-9);
        let online = results::read_estimates(&folder.join(ONLINE)).unwrap();
        assert_eq!(online.len(), 13);
        assert!(online.iter().all(|estimate| estimate.boot == BootIndex(0)));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_and_started_again_an_agent_carries_on_from_its_journal() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let world = world(4, 3, 6.0);
    let configs: Vec<AgentConfig> = world.configs.values().map(|c| filed(c.clone(), folder.path())).collect();
    let mut processes = Vec::new();
    for config in &configs {
        processes.push(field.start(config).await);
    }
    let (before, after) = world.samples.split_at(world.samples.len() / 2);
    let mut numbers = BTreeMap::new();
    field.feed(before, &mut numbers).await;
    let said = field.status(1).await.unwrap();
    kill(processes.remove(0)).await;
    assert!(field.status(1).await.is_none(), "a dead agent does not answer");

    processes.insert(0, field.start(&configs[0]).await);
    let again = field.status(1).await.unwrap();
    let held = |status: &Status| status.logs.iter().find(|held| held.log == log(1, 0)).copied();
    assert_eq!(held(&said), held(&again));
    assert_eq!(again.odometry_until, said.odometry_until);
    field.feed(after, &mut numbers).await;
    field.end([1, 2, 3]).await;
    let agreed = field.agreed([1, 2, 3]).await;
    assert!(agreed.logs.iter().any(|held| held.log == log(1, 1)), "a second boot");
    assert!(!agreed.logs.iter().any(|held| held.log == log(1, 2)), "and no third");
    let fold = configs[0].node().unwrap().fold;
    assert_eq!(folded(&field.entries(3).await, fold).fingerprint(), agreed.estimate);
    for (robot, process) in (1..).zip(processes) {
        field.shut_down(robot, process).await;
    }
    let records = Journal::read(&folder.path().join("r1").join(JOURNAL)).unwrap();
    let own = records.iter().filter(|record| matches!(record, Record::Entry(entry) if entry.id.robot.0 == 1));
    assert!(own.count() > 20);
    let summary = results::read_summary(&folder.path().join("r1")).unwrap();
    assert_eq!(summary.boots, 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lost_journal_makes_the_next_boot_because_the_team_remembers() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let configs = [1, 2].map(|robot| filed(agent(robot), folder.path()));
    let first = field.start(&configs[0]).await;
    let witness = field.start(&configs[1]).await;
    // One more that knows nothing, so that whoever is asked first need not be the one who knows.
    let stranger = field.start(&filed(agent(3), folder.path())).await;
    let samples: Vec<Sample> = (0..10).map(|k| velocity(0.1 * f64::from(k))).collect();
    field.batch(1, SensorBatch { number: 1, samples, ..Default::default() }).await;
    field.until(2, |status| status.logs.iter().any(|held| held.log == log(1, 0))).await;
    kill(first).await;
    std::fs::remove_file(folder.path().join("r1").join(JOURNAL)).unwrap();

    let second = field.start(&configs[0]).await;
    field.batch(1, SensorBatch { number: 1, samples: vec![velocity(60.0)], ..Default::default() }).await;
    let status = field.until(1, |status| status.logs.len() == 2).await;
    assert_eq!(status.boot, BootIndex(1));
    let status = field.until(2, |status| status.logs.iter().any(|held| held.log == log(1, 1))).await;
    assert_eq!(status.logs.iter().filter(|held| held.log.robot == RobotId(1)).count(), 2);
    for (robot, process) in [(1, second), (2, witness), (3, stranger)] {
        field.shut_down(robot, process).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_sent_again_is_acknowledged_again_and_taken_once() {
    let field = Field::new();
    let process = field.start(&agent(1)).await;
    // Number 0 is a number like any other.
    for number in [0, 1, 2] {
        let start = f64::from(u32::try_from(number).unwrap());
        let samples = vec![velocity(start), velocity(start + 0.5), sees(start + 0.25, 2), velocity(start)];
        let batch = SensorBatch { number, samples, ..Default::default() };
        let ack = field.batch(1, batch.clone()).await;
        assert_eq!((ack.number, ack.accepted, ack.refused), (number, 3, 1));
        assert!(ack.first_refusal.as_ref().is_some_and(|why| why.contains("not after the last")), "{ack:?}");
        let before = field.status(1).await.unwrap();
        assert_eq!(field.batch(1, batch).await, ack);
        let after = field.status(1).await.unwrap();
        assert_eq!((after.logs, after.samples), (before.logs, before.samples));
    }
    // A new feeder counts from 0 again.
    let again = SensorBatch { number: 2, samples: vec![velocity(2.6)], ..Default::default() };
    assert_eq!(field.batch(1, again).await.accepted, 1);
    field.shut_down(1, process).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn entries_under_another_robots_key_are_refused_and_under_their_own_taken() {
    let field = Field::new();
    let process = field.start(&agent(1)).await;
    let fold = agent(1).node().unwrap().fold;
    let forged = standing_log(2, fold, &[]);
    let genuine = standing_log(3, fold, &[]);
    // Robot 3 speaks for robot 2, and then for itself: what it says of robot 2 has been seen by then.
    let both: Vec<Entry> = forged.iter().chain(&genuine).cloned().collect();
    field.bus.publish(&field.key(3, Kind::Fact), encode_entries(&both)).await.unwrap();
    let status = field.until(1, |status| !status.logs.is_empty()).await;
    let logs: Vec<_> = status.logs.iter().map(|held| (held.log, held.held)).collect();
    assert_eq!(logs, [(log(3, 0), genuine.len() as u64)]);
    field.bus.publish(&field.key(2, Kind::Fact), encode_entries(&forged)).await.unwrap();
    field.until(1, |status| status.logs.iter().any(|held| held.log == log(2, 0))).await;
    field.shut_down(1, process).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bytes_that_are_no_message_change_nothing() {
    let field = Field::new();
    let process = field.start(&agent(1)).await;
    let status = Message::Status(field.status(1).await.unwrap()).encode();
    for kind in [Kind::Fact, Kind::Status, Kind::Sensor(SensorKind::Gps)] {
        for payload in [vec![], vec![1], vec![255; 40], status.clone()] {
            field.bus.publish(&field.key(2, kind), payload.clone()).await.unwrap();
            field.bus.publish(&field.key(1, kind), payload).await.unwrap();
        }
    }
    for kind in [Kind::Control, Kind::Facts, Kind::SensorBatch] {
        let reply = field.bus.request(&field.key(1, kind), vec![9, 9, 9], DEADLINE).await;
        assert!(reply.is_err(), "an answer to nonsense on {kind}");
    }
    let after = Message::Status(field.status(1).await.unwrap()).encode();
    assert_eq!(after, status);
    field.shut_down(1, process).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn single_samples_on_the_sensor_keys_are_taken() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let config = filed(agent(1), folder.path());
    let process = field.start(&config).await;
    let others = [
        sample(0.45, Reading::Gps { x_m: 1.3, y_m: 2.2 }),
        sample(0.55, Reading::Heading { heading_rad: 0.7 }),
        sample(0.65, Reading::Gyro { yaw_rate_rad_s: 0.4 }),
        sees(0.75, 2),
    ];
    for sample in (0..=10).map(|k| velocity(0.1 * f64::from(k))).chain(others) {
        let key = field.key(1, Kind::Sensor(SensorKind::of(&sample.reading)));
        field.bus.publish(&key, encode_sample(&sample)).await.unwrap();
    }
    let status = field.until(1, |status| status.samples.accepted == 15).await;
    assert_eq!(status.samples.refused, 0);
    assert_eq!((status.facts.absolute, status.facts.pending), (2, 1));
    field.shut_down(1, process).await;
    let settled = results::read_estimates(&folder.path().join("r1").join(SETTLED)).unwrap();
    assert_eq!(settled.len(), 1001);
    for estimate in settled {
        assert_pose(&estimate.nominal, &on_circle(start(), estimate.time.seconds()), 1e-12);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn results_are_written_at_finish_and_the_agent_keeps_serving() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let process = field.start(&filed(agent(1), folder.path())).await;
    field.batch(1, SensorBatch { number: 1, samples: vec![velocity(0.0)], ..Default::default() }).await;
    assert_eq!(field.control(1, ControlRequest::Finish).await, Some(ControlReply::Accepted));
    for file in [SETTLED, ONLINE, results::SUMMARY, JOURNAL] {
        assert!(folder.path().join("r1").join(file).exists(), "{file}");
    }
    let status = field.status(1).await.unwrap();
    assert!(status.input_ended && status.drained);
    field.shut_down(1, process).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn told_to_stop_an_agent_writes_its_results_and_leaves() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let config = filed(agent(1), folder.path());
    let bus = Arc::new(field.network.join("robot 1"));
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let process = tokio::spawn(async move {
        let stop = async {
            stopped.await.ok();
        };
        run(&config, &bus, 1, stop).await
    });
    field.until(1, |_| true).await;
    stop.send(()).unwrap();
    process.await.unwrap().unwrap();
    assert!(folder.path().join("r1").join(results::SUMMARY).exists());
    assert!(field.status(1).await.is_none());
}

/// What an agent says when it cannot use its journal.
async fn refused_journal(bytes: &[u8]) -> (JournalError, String) {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let config = filed(agent(1), folder.path());
    let path = folder.path().join("r1").join(JOURNAL);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    let ended = field.spawn(&config).await.unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "a journal that cannot be used is left as it is");
    let error = ended.unwrap_err();
    let text = error.to_string();
    assert!(text.contains(path.to_str().unwrap()), "{text}");
    match error {
        DriverError::Journal(error) => (error, text),
        other => panic!("{other}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_or_foreign_journal_is_an_error_with_file_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(JOURNAL);
    let (mut journal, _) = Journal::open(&path).unwrap();
    for k in 0..3 {
        journal.append(&[Record::Sample(velocity(f64::from(k)))]).unwrap();
    }
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[30] ^= 0x10;
    let (error, text) = refused_journal(&bytes).await;
    assert!(matches!(error, JournalError::Damaged { offset: 8, .. }), "{error:?}");
    assert!(text.contains("byte 8") && text.contains("move it away"), "{text}");

    let (error, text) = refused_journal(b"t_ns,x_m\n1,2\n").await;
    assert!(matches!(error, JournalError::NotAJournal { .. }), "{error:?}");
    assert!(text.contains("not a journal"), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_journal_cut_off_in_its_last_frame_is_no_obstacle() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let config = filed(agent(1), folder.path());
    let process = field.start(&config).await;
    let samples = |from: u32| (from..from + 10).map(|k| velocity(0.1 * f64::from(k))).collect();
    field.batch(1, SensorBatch { number: 1, samples: samples(0), ..Default::default() }).await;
    field.batch(1, SensorBatch { number: 2, samples: samples(10), ..Default::default() }).await;
    kill(process).await;
    let path = folder.path().join("r1").join(JOURNAL);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();

    let process = field.start(&config).await;
    let status = field.status(1).await.unwrap();
    assert_eq!(
        status.odometry_until,
        Some(velocity(0.9).time),
        "the second batch was one frame, and is gone"
    );
    field.batch(1, SensorBatch { number: 3, samples: samples(20), ..Default::default() }).await;
    assert_eq!(field.status(1).await.unwrap().boot, BootIndex(1));
    field.shut_down(1, process).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bad_configuration_is_refused_before_anything_is_touched() {
    let (field, folder) = (Field::new(), tempfile::tempdir().unwrap());
    let mut config = filed(agent(1), folder.path());
    config.motion.longest_gap_s = -1.0;
    let error = field.spawn(&config).await.unwrap().unwrap_err();
    assert!(matches!(error, DriverError::Config(_)), "{error}");
    assert!(!folder.path().join("r1").exists());
}
