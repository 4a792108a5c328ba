//! Teams of real processes over zenoh. The agents are the example `fake_agent`, which shows a coordinator
//! what an agent does and can be told to misbehave.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use pleiad_bus::{Bus, ZenohBus, ZenohConfig};
use pleiad_coordinator::{
    AgentEntry, Backoff, BusSection, CoordinatorConfig, CoordinatorError, Difference, Exit, How, Restart,
    Team, TeamEvent, endpoints, run,
};
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{ControlRequest, Message, RobotId, TeamName};
use tokio::sync::{Mutex, MutexGuard, broadcast};

/// Far beyond what anything here takes; reached only by failure.
const PATIENCE: Duration = Duration::from_secs(30);
/// For what is expected not to happen.
const SHORT: Duration = Duration::from_millis(300);

const ONE: RobotId = RobotId(1);
const TWO: RobotId = RobotId(2);
const THREE: RobotId = RobotId(3);

/// One team at a time: a port that a team has been assigned and not yet bound could go to another.
static TURN: Mutex<()> = Mutex::const_new(());

/// Builds an example with the profile of this test, and says where it is.
fn example(name: &str) -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let profile = test.ancestors().nth(2).unwrap();
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "-p", "pleiad-coordinator", "--example", name]);
    if profile.ends_with("release") {
        build.arg("--release");
    }
    // Left in place, these have build scripts run again and half of the dependencies compiled anew.
    build.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
    let built = build.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    profile.join("examples").join(name)
}

/// A team of fake agents, not yet launched.
struct Stage {
    config: CoordinatorConfig,
    bus: Arc<ZenohBus>,
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

/// Robots 1, 2, ... that behave so and hold so many entries of robot 1's log.
async fn stage(agents: &[(&str, u64)]) -> Stage {
    let turn = TURN.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let robots: Vec<_> = (1..).map(RobotId).take(agents.len()).collect();
    let endpoints = endpoints(&robots).unwrap();
    let mut entries = Vec::new();
    for (robot, (mode, held)) in robots.iter().zip(agents) {
        let path = folder.path().join(format!("{robot}.toml"));
        let endpoint = &endpoints[robot];
        let mut text = format!("team = \"blue\"\nrobot = {robot}\nmode = \"{mode}\"\nheld = {held}\n");
        writeln!(text, "listen = {:?}\nconnect = {:?}", endpoint.listen, endpoint.connect).unwrap();
        std::fs::write(&path, text).unwrap();
        entries.push(AgentEntry { robot: robot.0, config: path, log: None });
    }
    let connect = endpoints.values().map(|endpoint| endpoint.listen.clone()).collect();
    let config = CoordinatorConfig {
        team: "blue".into(),
        executable: Some(example("fake_agent")),
        restart: Restart::Never,
        detached: false,
        status_period_s: 0.05,
        shutdown_timeout_s: PATIENCE.as_secs_f64(),
        record: None,
        backoff: Backoff { first_s: 0.01, ..Backoff::default() },
        bus: BusSection { connect, ..BusSection::default() },
        agents: entries,
    };
    let bus = Arc::new(ZenohBus::open(&config.bus.zenoh()).await.unwrap());
    Stage { config, bus, folder, _turn: turn }
}

impl Stage {
    async fn launch(&self) -> Team<Arc<ZenohBus>> {
        Team::launch(&self.config, Arc::clone(&self.bus)).await.unwrap()
    }

    /// Waits until these robots' tokens are there, or all gone, as seen by a bus of its own.
    async fn until_alive(&self, robots: &[RobotId], alive: bool) {
        let config = ZenohConfig { connect: self.config.bus.connect.clone(), ..ZenohConfig::default() };
        let bus = ZenohBus::open(&config).await.unwrap();
        // What is there already may be told late; that nobody is there, only an answer can tell.
        if alive {
            let mut tokens = bus.watch(&keys::all(&team(), Kind::Alive)).await.unwrap();
            let mut there = BTreeMap::new();
            let all = async {
                while robots.iter().any(|robot| there.get(robot) != Some(&true)) {
                    let token = tokens.recv().await.unwrap();
                    there.insert(token.key.parse::<keys::Key>().unwrap().robot, token.alive);
                }
            };
            tokio::time::timeout(PATIENCE, all).await.expect("not all came up");
        } else {
            for robot in robots {
                let gone = async { while answers(&bus, *robot, ControlRequest::Status).await {} };
                tokio::time::timeout(PATIENCE, gone).await.expect("not all are gone");
            }
        }
        bus.close().await;
    }
}

fn team() -> TeamName {
    TeamName::new("blue").unwrap()
}

async fn answers(bus: &ZenohBus, robot: RobotId, request: ControlRequest) -> bool {
    let key = keys::of(&team(), robot, Kind::Control);
    bus.request(&key, Message::ControlRequest(request).encode(), Duration::from_secs(1)).await.is_ok()
}

/// Waits for an event, skipping others.
async fn until_event(events: &mut broadcast::Receiver<TeamEvent>, expected: TeamEvent) {
    let came = async { while events.recv().await.unwrap() != expected {} };
    tokio::time::timeout(PATIENCE, came).await.unwrap_or_else(|_| panic!("no {expected:?}"));
}

/// Whether a process is there and not a zombie.
fn runs(pid: u32) -> bool {
    let stat = std::fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("stat"));
    stat.is_ok_and(|stat| !stat.contains(") Z "))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_team_comes_up_settles_and_ends_as_asked() {
    let stage = stage(&[("normal", 10), ("normal", 10), ("normal", 10)]).await;
    let team = stage.launch().await;
    team.wait_until_alive(PATIENCE).await.unwrap();
    assert_eq!(team.pids().len(), 3);
    assert!(team.pids().values().all(|pid| runs(*pid)));
    assert!(team.statuses().await.values().all(Result::is_ok));

    let twice = Team::launch(&stage.config, Arc::clone(&stage.bus)).await.err().unwrap();
    assert!(matches!(twice, CoordinatorError::AlreadyRunning { ref robots, .. } if robots.len() == 3));

    let nobody = BTreeSet::new();
    match team.wait_until_settled(&nobody, SHORT).await.unwrap_err() {
        CoordinatorError::NotSettled { differences, .. } => {
            assert_eq!(differences, [ONE, TWO, THREE].map(|robot| Difference::InputOpen { robot }));
        }
        other => panic!("{other}"),
    }
    assert!(team.finish().await.values().all(Result::is_ok));
    let settled = team.wait_until_settled(&nobody, PATIENCE).await.unwrap();
    assert!(settled.values().all(|status| status.drained) && settled.len() == 3);

    let departures = team.shutdown(PATIENCE).await.unwrap();
    for departure in departures.values() {
        assert_eq!((departure.how, departure.exit), (How::Asked, Exit::Code(0)));
    }
    assert_eq!(team.pids(), BTreeMap::new());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_lacks_entries_is_named_and_who_is_dead_can_be_left_out() {
    let stage = stage(&[("normal", 10), ("normal", 10), ("normal", 9)]).await;
    let team = stage.launch().await;
    team.wait_until_alive(PATIENCE).await.unwrap();
    assert!(team.finish().await.values().all(Result::is_ok));
    let behind = team.wait_until_settled(&BTreeSet::new(), SHORT).await.unwrap_err().to_string();
    assert!(behind.contains("robot 3 holds 9 entries of the log of robot 1 boot 0, robot 1 10"), "{behind}");

    assert_eq!(team.kill(THREE).await.unwrap(), Exit::Signal(9));
    let dead = team.wait_until_settled(&BTreeSet::new(), PATIENCE).await.unwrap_err();
    assert!(matches!(dead, CoordinatorError::Ended { .. }) && dead.to_string().contains("robot 3"), "{dead}");
    let settled = team.wait_until_settled(&BTreeSet::from([THREE]), PATIENCE).await.unwrap();
    assert_eq!(settled.into_keys().collect::<Vec<_>>(), [ONE, TWO]);
    let departures = team.shutdown(PATIENCE).await.unwrap();
    assert_eq!(departures[&THREE].how, How::Before);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_does_not_come_up_is_named_with_its_log_and_the_others_are_not_left_behind() {
    let stage = stage(&[("normal", 0), ("crash", 0), ("silent", 0)]).await;
    let team = stage.launch().await;
    let crashed = team.wait_until_alive(PATIENCE).await.unwrap_err().to_string();
    for words in ["robot 2 ended", "exit code 3", "2.log", "planted crash of robot 2"] {
        assert!(crashed.contains(words), "{words} is missing in: {crashed}");
    }
    stage.until_alive(&[ONE], true).await;
    let pids = team.pids();
    drop(team);
    stage.until_alive(&[ONE, THREE], false).await;
    let gone = async {
        while pids.values().any(|pid| runs(*pid)) {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(PATIENCE, gone).await.expect("a process was left behind");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_silent_agent_is_missed_and_terminated() {
    let stage = stage(&[("normal", 0), ("silent", 0)]).await;
    let mut team = stage.launch().await;
    let mut events = team.events();
    until_event(&mut events, TeamEvent::AgentUp { robot: ONE }).await;
    let missing = team.wait_until_alive(SHORT).await.unwrap_err().to_string();
    assert!(missing.starts_with("robot 2 not up after 0.3 s"), "{missing}");
    let departures = team.shutdown(PATIENCE).await.unwrap();
    assert_eq!(departures[&ONE].how, How::Asked);
    assert_eq!((departures[&TWO].how, departures[&TWO].exit), (How::Terminated, Exit::Signal(15)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn failures_are_restarted_deliberate_ends_are_not_and_the_stubborn_are_killed() {
    let mut stage = stage(&[("crash_once", 0), ("stubborn", 0)]).await;
    stage.config.restart = Restart::OnFailure;
    let mut team = stage.launch().await;
    let mut events = team.events();
    until_event(&mut events, TeamEvent::Exited { robot: ONE, exit: Exit::Code(3) }).await;
    until_event(&mut events, TeamEvent::Restarted { robot: ONE, restarts: 1 }).await;
    team.wait_until_alive(PATIENCE).await.unwrap();

    let before = team.pids()[&ONE];
    assert_eq!(team.kill(ONE).await.unwrap(), Exit::Signal(9));
    assert_eq!(team.members()[&ONE].ended(), Some(Exit::Signal(9)), "not restarted");
    until_event(&mut events, TeamEvent::AgentDown { robot: ONE }).await;
    team.restart(ONE).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();
    assert_ne!(team.pids()[&ONE], before);
    assert_eq!(team.members()[&ONE].restarts, 2);
    team.restart(ONE).await.unwrap();
    until_event(&mut events, TeamEvent::Restarted { robot: ONE, restarts: 3 }).await;
    team.wait_until_alive(PATIENCE).await.unwrap();

    let departures = team.shutdown(PATIENCE).await.unwrap();
    assert_eq!((departures[&ONE].how, departures[&ONE].exit), (How::Asked, Exit::Code(0)));
    assert_eq!((departures[&TWO].how, departures[&TWO].exit), (How::Killed, Exit::Signal(9)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_run_records_what_is_published_and_ends_when_told() {
    let mut stage = stage(&[("normal", 0), ("normal", 0)]).await;
    stage.config.record = Some(stage.folder.path().to_owned());
    let mut statuses = stage.bus.subscribe(&keys::all(&team(), Kind::Status)).await.unwrap();
    let stop = async {
        // Until several have come from each: the recorder then has the first ones.
        let mut heard = BTreeMap::new();
        while heard.len() < 2 || heard.values().any(|count| *count < 5) {
            *heard.entry(statuses.recv().await.unwrap().key).or_insert(0) += 1;
        }
    };
    let running = run(&stage.config, Arc::clone(&stage.bus), stop);
    let report = tokio::time::timeout(PATIENCE, running).await.unwrap().unwrap();
    assert_eq!(report.failed(), BTreeSet::new());
    let traffic = report.traffic.unwrap();
    for robot in [ONE, TWO] {
        assert!(traffic.of_robot(robot).messages > 0);
    }
    assert_eq!((traffic.refused, traffic.misattributed), (0, 0));
    assert!(stage.folder.path().join("recorder").join("traffic.json").exists());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn agents_do_not_notice_that_their_coordinator_is_killed() {
    let stage = stage(&[("normal", 0), ("normal", 0)]).await;
    let path = stage.folder.path().join("coordinator.toml");
    std::fs::write(&path, toml::to_string(&stage.config).unwrap()).unwrap();
    let mut coordinator =
        Command::new(example("coordinate")).arg(&path).stdin(Stdio::null()).spawn().unwrap();
    stage.until_alive(&[ONE, TWO], true).await;
    coordinator.kill().unwrap();
    coordinator.wait().unwrap();
    let mut statuses = stage.bus.subscribe(&keys::all(&team(), Kind::Status)).await.unwrap();
    let mut heard = BTreeSet::new();
    let both = async {
        while heard.len() < 2 {
            heard.insert(statuses.recv().await.unwrap().key);
        }
    };
    tokio::time::timeout(PATIENCE, both).await.expect("an agent is gone");
    for robot in [ONE, TWO] {
        assert!(answers(&stage.bus, robot, ControlRequest::Shutdown).await);
    }
    stage.until_alive(&[ONE, TWO], false).await;
}
