//! A simulated team whose agents are processes on this machine.

#![allow(clippy::unwrap_used, clippy::panic, clippy::missing_panics_doc, reason = "helpers of tests")]

mod started;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use pleiad_agent::config::{
    AgentConfig, BusSection, ClockSection, FilterSection, LedgerSection, OutputSection,
};
use pleiad_agent::journal::Journal;
use pleiad_agent::{Record, driver};
use pleiad_bus::{Bus, ZenohBus, ZenohConfig};
use pleiad_coordinator::{AgentEntry, Backoff, CoordinatorConfig, Restart, differences, endpoints};
use pleiad_estimation::fact::Entry;
use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::strategy::StrategyKind;
use pleiad_estimation::{Pose2, RobotId};
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{ControlReply, ControlRequest, Message, Status, TeamName};
use pleiad_sim_peers::agents;
use pleiad_sim_peers::{Fleet, FleetOptions, Prior, Scenario, SimulatedRun, simulate};
use tempfile::TempDir;
use tokio::time::Instant;

use crate::folded::fold;
use crate::program;

/// Far beyond what anything here takes; reached only by failure.
pub const PATIENCE: Duration = Duration::from_mins(1);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(50);
/// An agent that is there answers within this.
const ANSWER: Duration = Duration::from_secs(5);

/// Wanderers that see one another's pose; the first has GPS.
pub const SCENARIO: &str = r#"
name = "stage"
seed = 11
duration_s = 60.0
team_size = 3
truth_rate_hz = 10.0

[arena]
width_m = 12.0
height_m = 12.0

[defaults.odometry]
kind = "velocity"
rate_hz = 25.0

[defaults.relative]
rate_hz = 2.0
kind = "pose"
max_range_m = 17.0
sigma_position_m = 0.05
sigma_yaw_rad = 0.02

[[robots]]
id = 1
gps = { rate_hz = 1.0, sigma_m = 0.3 }
"#;

/// A simulated team, configured but not started. Dropped, it kills every process that works in its
/// folder, whoever started it.
pub struct Stage {
    /// The team's name, like no other's.
    pub team: TeamName,
    /// What the robots sense, and where they truly are.
    pub run: SimulatedRun,
    /// A bus linked with every agent.
    pub bus: Arc<ZenohBus>,
    configs: BTreeMap<RobotId, AgentConfig>,
    scenario: Scenario,
    folder: TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Stage {
    /// The team of [`SCENARIO`] with this many robots.
    pub async fn set(robots: u32) -> Self {
        Self::of(&SCENARIO.replace("team_size = 3", &format!("team_size = {robots}"))).await
    }

    /// The team of a scenario.
    #[allow(clippy::await_holding_lock, reason = "the turn is for the whole of a test, on its own runtime")]
    pub async fn of(text: &str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let turn = program::turn();
        let scenario = Scenario::from_toml(text, "stage.toml").unwrap();
        let run = simulate(&scenario, scenario.seed).unwrap();
        let robots: Vec<_> = scenario.robots.keys().copied().collect();
        let endpoints = endpoints(&robots).unwrap();
        let connect = endpoints.values().map(|endpoint| endpoint.listen.clone()).collect();
        let network = ZenohConfig { connect, ..ZenohConfig::default() };
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("stage-{}-{count}", std::process::id());
        let mut stage = Self {
            team: TeamName::new(&name).unwrap(),
            bus: Arc::new(ZenohBus::open(&network).await.unwrap()),
            configs: BTreeMap::new(),
            folder: tempfile::tempdir().unwrap(),
            scenario,
            run,
            _turn: turn,
        };
        std::fs::write(stage.scenario_path(), text).unwrap();
        for (robot, endpoint) in endpoints {
            let bus = BusSection {
                listen: vec![endpoint.listen],
                connect: endpoint.connect,
                status_period_s: 0.1,
                ..BusSection::default()
            };
            std::fs::create_dir_all(stage.folder_of(robot)).unwrap();
            stage.configure(stage.agent(robot, bus));
        }
        stage
    }

    /// What a robot's agent is told of the world it is in.
    fn agent(&self, robot: RobotId, bus: BusSection) -> AgentConfig {
        let settings = &self.scenario.robots[&robot];
        AgentConfig {
            team: self.team.to_string(),
            robot: robot.0,
            strategy: StrategyKind::Exact,
            filter: FilterSection::default(),
            model: None,
            prior: self.run.priors.get(&robot).map(agents::prior),
            motion: agents::motion(settings),
            sensors: agents::sensors(settings),
            calibration: None,
            clock: ClockSection::default(),
            landmarks: Vec::new(),
            bus,
            ledger: LedgerSection::default(),
            output: OutputSection { directory: Some(self.folder_of(robot)), ..OutputSection::default() },
            faults: None,
        }
    }

    fn configure(&mut self, config: AgentConfig) {
        let robot = RobotId(config.robot);
        std::fs::write(self.config_path(robot), toml::to_string(&config).unwrap()).unwrap();
        self.configs.insert(robot, config);
    }

    /// Tells a robot another start than its first one.
    pub fn place(&mut self, robot: RobotId, pose: Pose2) {
        let settings = self.scenario.robots[&robot].prior;
        let prior = Prior {
            pose,
            sigma_position_m: settings.sigma_position_m,
            sigma_heading_rad: settings.sigma_heading_rad,
        };
        let mut config = self.configs[&robot].clone();
        config.prior = Some(agents::prior(&prior));
        self.configure(config);
    }

    /// Changes what all agents are told.
    pub fn tell(&mut self, change: impl Fn(&mut AgentConfig)) {
        for robot in self.robots() {
            let mut config = self.configs[&robot].clone();
            change(&mut config);
            self.configure(config);
        }
    }

    /// Asks and feeds the agents through another bus from now on.
    pub async fn reach(&mut self, network: &ZenohConfig) {
        self.bus.close().await;
        self.bus = Arc::new(ZenohBus::open(network).await.unwrap());
    }

    /// The robots.
    pub fn robots(&self) -> BTreeSet<RobotId> {
        self.configs.keys().copied().collect()
    }

    /// The scenario's file.
    pub fn scenario_path(&self) -> PathBuf {
        self.folder.path().join("scenario.toml")
    }

    /// Where a robot's agent keeps its journal.
    pub fn folder_of(&self, robot: RobotId) -> PathBuf {
        self.folder.path().join(format!("r{robot}"))
    }

    /// The configuration of a robot's agent.
    pub fn config_path(&self, robot: RobotId) -> PathBuf {
        self.folder_of(robot).join("agent.toml")
    }

    /// Where the agents listen.
    pub fn endpoints(&self) -> Vec<String> {
        self.configs.values().flat_map(|config| config.bus.listen.clone()).collect()
    }

    /// What each robot senses.
    pub fn samples(&self) -> BTreeMap<RobotId, Vec<Sample>> {
        self.run.recording.robots.iter().map(|(robot, channels)| (*robot, channels.samples())).collect()
    }

    /// The configuration of a coordinator of these agents.
    pub fn coordinator(&self) -> CoordinatorConfig {
        let agent = |robot: &RobotId| AgentEntry {
            robot: robot.0,
            config: self.config_path(*robot),
            log: Some(self.folder_of(*robot).join("agent.log")),
        };
        CoordinatorConfig {
            team: self.team.to_string(),
            executable: Some(program::pleiad().to_owned()),
            restart: Restart::Never,
            detached: false,
            status_period_s: 0.1,
            shutdown_timeout_s: PATIENCE.as_secs_f64(),
            record: None,
            backoff: Backoff::default(),
            bus: pleiad_coordinator::BusSection { connect: self.endpoints(), ..Default::default() },
            agents: self.configs.keys().map(agent).collect(),
        }
    }

    /// Asks a robot's agent; `None` if it does not answer.
    pub async fn ask(&self, robot: RobotId, request: ControlRequest) -> Option<ControlReply> {
        let key = keys::of(&self.team, robot, Kind::Control);
        let reply = self.bus.request(&key, Message::ControlRequest(request).encode(), ANSWER).await.ok()?;
        match Message::decode(&reply) {
            Ok(Message::ControlReply(reply)) => Some(reply),
            other => panic!("robot {robot} answered {other:?}"),
        }
    }

    /// The status of a robot's agent, if it answers.
    pub async fn status(&self, robot: RobotId) -> Result<Status, &'static str> {
        match self.ask(robot, ControlRequest::Status).await {
            Some(ControlReply::Status(status)) => Ok(status),
            Some(_) => Err("not a status"),
            None => Err("no answer"),
        }
    }

    /// Waits until this holds of the robot's status.
    pub async fn until(&self, robot: RobotId, holds: impl Fn(&Status) -> bool) -> Status {
        let deadline = Instant::now() + PATIENCE;
        let mut looks = tokio::time::interval(LOOK);
        loop {
            looks.tick().await;
            let status = self.status(robot).await;
            match status {
                Ok(status) if holds(&status) => return status,
                other => assert!(
                    Instant::now() < deadline,
                    "robot {robot} never got there: {other:?}\n{}",
                    self.logs()
                ),
            }
        }
    }

    /// Waits until the agents of these robots answer.
    pub async fn until_up(&self, robots: impl IntoIterator<Item = RobotId>) {
        for robot in robots {
            self.until(robot, |_| true).await;
        }
    }

    /// Waits until the team has settled: all input ended, all observations answered, all the same.
    pub async fn settled(&self) -> BTreeMap<RobotId, Status> {
        let deadline = Instant::now() + PATIENCE;
        let mut looks = tokio::time::interval(LOOK);
        loop {
            looks.tick().await;
            let mut statuses = BTreeMap::new();
            for robot in self.robots() {
                statuses.insert(robot, self.status(robot).await);
            }
            let differences = differences(&statuses);
            if differences.is_empty() {
                return statuses.into_iter().map(|(robot, status)| (robot, status.unwrap())).collect();
            }
            assert!(Instant::now() < deadline, "not settled: {differences:#?}\n{}", self.logs());
        }
    }

    /// Tells a robot's agent to end. Its agreement can be lost while it does.
    pub async fn end(&self, robot: RobotId) {
        let reply = self.ask(robot, ControlRequest::Shutdown).await;
        assert!(matches!(reply, None | Some(ControlReply::Accepted)), "robot {robot}: {reply:?}");
    }

    /// Tells all agents to end, and waits until there is no process left.
    pub async fn shut_down(&self) {
        for robot in self.robots() {
            self.end(robot).await;
        }
        let deadline = Instant::now() + PATIENCE;
        let mut looks = tokio::time::interval(LOOK);
        while !self.processes().is_empty() {
            assert!(Instant::now() < deadline, "still there: {:?}\n{}", self.processes(), self.logs());
            looks.tick().await;
        }
    }

    /// The entries in a robot's journal, as it wrote them down.
    pub fn journal(&self, robot: RobotId) -> Vec<Entry> {
        let records = Journal::read(&self.folder_of(robot).join(driver::JOURNAL)).unwrap();
        let entry = |record| match record {
            Record::Entry(entry) => Some(entry),
            _ => None,
        };
        records.into_iter().filter_map(entry).collect()
    }

    /// All entries of all journals folded from nothing: what an undisturbed robot would believe.
    pub fn fold(&self) -> Ledger {
        fold(self.robots().into_iter().flat_map(|robot| self.journal(robot)))
    }

    /// Asserts that all agents have one estimate, and that it is what a fold from nothing of what they
    /// wrote down gives: of all journals together, and of each by itself. Returns that fold.
    pub fn assert_undisturbed(&self, statuses: &BTreeMap<RobotId, Status>) -> Ledger {
        assert_eq!(statuses.keys().copied().collect::<BTreeSet<_>>(), self.robots());
        let mut ledger = self.fold();
        let expected = ledger.fingerprint();
        for (robot, status) in statuses {
            assert_eq!(status.estimate, expected, "estimate of robot {robot}");
            assert_eq!(fold(self.journal(*robot)).fingerprint(), expected, "journal of robot {robot}");
        }
        ledger
    }

    /// The same samples through nodes in this process, without processes, network or disk.
    pub fn in_process(&self) -> Ledger {
        let configs = self.configs.values().map(|config| config.node().unwrap()).collect();
        let mut fleet = Fleet::new(configs, &FleetOptions::default()).unwrap();
        let samples = self.samples();
        fleet.feed(&samples, |_| {});
        let last = samples.values().flatten().map(|sample| sample.time).max().unwrap();
        assert!(fleet.settle(last, 10), "the fleet did not agree");
        fleet.into_outcomes().into_values().next().unwrap().node.ledger().clone()
    }

    /// The ends of what the agents logged, for messages.
    fn logs(&self) -> String {
        let tail = |robot: RobotId| {
            let text = std::fs::read_to_string(self.folder_of(robot).join("agent.log")).unwrap_or_default();
            let lines: Vec<_> = text.lines().rev().take(10).collect();
            format!("robot {robot}: {}", lines.into_iter().rev().collect::<Vec<_>>().join("\n"))
        };
        self.robots().into_iter().map(tail).collect::<Vec<_>>().join("\n")
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let pids = self.processes().into_iter().map(|pid| pid.to_string());
        let _ = Command::new("kill").arg("-KILL").args(pids).stderr(Stdio::null()).status();
    }
}
