//! Agents started by hand with their configurations, as on separate machines, and fed through their
//! sensor keys.

use std::process::{Command, Stdio};

use pleiad_bus::Bus;
use pleiad_estimation::fact::Body;
use pleiad_protocol::keys::{self, Kind, SensorKind};
use pleiad_protocol::{ControlReply, ControlRequest, encode_sample};
use pleiad_tests::program;
use pleiad_tests::stage::Stage;

use crate::{ONE, TWO};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_agents_started_by_hand_become_one_team() {
    let stage = Stage::set(2).await;
    // The second one dials the first, which is not there yet.
    let mut agents = vec![stage.start_agent(TWO)];
    stage.until_up([TWO]).await;
    agents.push(stage.start_agent(ONE));
    stage.until_up([ONE]).await;

    let mut feeder = Command::new(program::pleiad());
    feeder.arg("sim-peers").arg(stage.scenario_path()).args(["--team", stage.team.as_str(), "--progress"]);
    for endpoint in stage.endpoints() {
        feeder.args(["--connect", &endpoint]);
    }
    let fed = tokio::task::block_in_place(|| feeder.stdin(Stdio::null()).output().unwrap());
    assert!(fed.status.success(), "{}", String::from_utf8_lossy(&fed.stderr));
    let seconds: Vec<u32> =
        String::from_utf8(fed.stdout).unwrap().lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!(seconds, (0..=60).collect::<Vec<_>>());

    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);
    for (robot, status) in &statuses {
        let sensed = stage.samples()[robot].len() as u64;
        assert_eq!((status.samples.accepted, status.samples.refused), (sensed, 0), "robot {robot}");
    }
    assert!(ledger.counts().relative > 100, "{:?}", ledger.counts());
    assert_eq!(ledger.clone().fingerprint(), stage.in_process().fingerprint());
    stage.shut_down().await;
    for mut agent in agents {
        assert!(agent.wait().unwrap().success());
    }
}

/// Few enough that none can be lost where nothing waits for an acknowledgement.
const SAMPLES: usize = 200;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_driver_can_publish_its_samples_one_by_one() {
    let stage = Stage::set(2).await;
    let mut agent = stage.start_agent(ONE);
    stage.until_up([ONE]).await;
    let samples = stage.samples()[&ONE][..SAMPLES].to_vec();
    let gps = samples.iter().filter(|sample| SensorKind::of(&sample.reading) == SensorKind::Gps).count();
    let seen =
        samples.iter().filter(|sample| SensorKind::of(&sample.reading) == SensorKind::Relative).count();
    assert!(gps > 0 && seen > 0);
    for (sent, sample) in (1..).zip(&samples) {
        let key = keys::of(&stage.team, ONE, Kind::Sensor(SensorKind::of(&sample.reading)));
        stage.bus.publish(&key, encode_sample(sample)).await.unwrap();
        if sent % 50 == 0 {
            stage.until(ONE, |status| status.samples.accepted == sent).await;
        }
    }
    assert_eq!(stage.ask(ONE, ControlRequest::Finish).await, Some(ControlReply::Accepted));
    let status = stage.status(ONE).await.unwrap();
    assert_eq!((status.samples.accepted, status.samples.refused), (SAMPLES as u64, 0));
    // Every observation is in its log; the other robot never came, so that what was seen of it is pending.
    let count =
        |is_one: fn(&Body) -> bool| stage.journal(ONE).iter().filter(|entry| is_one(&entry.body)).count();
    let with_prior = 1;
    assert_eq!(count(|body| matches!(body, Body::Observation(_))), gps + seen + with_prior);
    assert_eq!((status.facts.absolute, status.facts.pending), (gps as u64, seen as u64));
    stage.end(ONE).await;
    assert!(agent.wait().unwrap().success());
}
