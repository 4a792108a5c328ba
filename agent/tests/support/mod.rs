//! Configurations, samples and hand-written logs for the tests of the agent.

#![allow(dead_code, reason = "each test target uses its part")]
#![allow(missing_docs, reason = "a fixture")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of a fixture")]

pub mod model;
pub mod team;

use pleiad_agent::{AgentConfig, Command, Event, Node, Notice, Record};
use pleiad_estimation::fact::{
    Absolute, Body, Boot, Entry, EntryId, Half, LogId, Noise, NoiseRef, NominalState, Observation, Quantity,
};
use pleiad_estimation::fold::FoldConfig;
use pleiad_estimation::ledger::{Insertion, Ledger};
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{BootIndex, Pose2, RobotId, Sequence, Timestamp};
use pleiad_protocol::{Estimate, FactsRequest};

pub const FORWARD_M_S: f64 = 0.8;
pub const YAW_RATE_RAD_S: f64 = 0.4;

/// Where robot 1 begins: its prior, which is where its nominal trajectory begins.
pub fn start() -> Pose2 {
    Pose2::new(1.0, 2.0, 0.5)
}

/// An agent with every kind of sensor, at [`start`], that gives an estimate at every odometry.
pub fn agent(robot: u32) -> AgentConfig {
    let text = format!(
        "team = 'test'\nrobot = {robot}\n\
         prior = {{ x_m = 1.0, y_m = 2.0, heading_rad = 0.5, sigma_position_m = 0.1, sigma_heading_rad = 0.05 }}\n\
         landmarks = [{{ id = 7, x_m = 3.0, y_m = -4.0 }}]\n\
         [sensors]\n\
         relative_pose = {{ sigma_position_m = 0.05, sigma_yaw_rad = 0.02 }}\n\
         relative_position = {{ sigma_m = 0.06 }}\n\
         range = {{ sigma_m = 0.07 }}\n\
         bearing = {{ sigma_rad = 0.03 }}\n\
         range_bearing = {{ sigma_range_m = 0.08, sigma_bearing_rad = 0.04 }}\n\
         gps = {{ sigma_m = 0.5 }}\n\
         heading = {{ sigma_rad = 0.06 }}\n\
         [output]\nestimate_rate_hz = 1000.0\n"
    );
    toml::from_str(&text).expect("a valid configuration")
}

pub fn node_of(config: &AgentConfig, nonce: u64) -> Node {
    Node::new(config.node().expect("a valid configuration"), nonce)
}

pub fn node(robot: u32) -> Node {
    node_of(&agent(robot), 1000 + u64::from(robot))
}

pub fn seconds(seconds: f64) -> Timestamp {
    Timestamp::from_seconds(seconds)
}

pub fn sample(time_s: f64, reading: Reading) -> Sample {
    Sample { time: seconds(time_s), reading }
}

/// The velocity at which robot 1 drives its circle.
pub fn velocity(time_s: f64) -> Sample {
    sample(time_s, Reading::Velocity { forward_m_s: FORWARD_M_S, yaw_rate_rad_s: YAW_RATE_RAD_S })
}

pub fn gps(time_s: f64) -> Sample {
    sample(time_s, Reading::Gps { x_m: 1.5, y_m: 2.5 })
}

pub fn sighting(time_s: f64, target: Target, relative: Relative) -> Sample {
    sample(time_s, Reading::Sighting { target, relative })
}

pub fn sees(time_s: f64, robot: u32) -> Sample {
    sighting(time_s, Target::Robot(RobotId(robot)), Relative::Pose(Pose2::new(1.0, 0.5, 0.2)))
}

/// Closed form of the circle driven from `from` at the velocity of [`velocity`].
pub fn on_circle(from: Pose2, after_s: f64) -> Pose2 {
    circle(from, FORWARD_M_S, YAW_RATE_RAD_S, after_s)
}

/// The unicycle at constant velocities: an arc of radius v/w.
pub fn circle(from: Pose2, v: f64, w: f64, after_s: f64) -> Pose2 {
    let (x, y, yaw) = (from.x_m(), from.y_m(), from.yaw_rad());
    let end = yaw + w * after_s;
    Pose2::new(x + v / w * (end.sin() - yaw.sin()), y - v / w * (end.cos() - yaw.cos()), end)
}

pub fn assert_pose(found: &Pose2, expected: &Pose2, tolerance: f64) {
    let apart = expected.between(found);
    let error = apart.x_m().abs().max(apart.y_m().abs()).max(apart.yaw_rad().abs());
    assert!(error < tolerance, "found {found:?}, expected {expected:?}");
}

/// What one event led to, checked: at most one journal, first of all, which holds everything published.
#[derive(Debug, Default)]
pub struct Handled {
    pub journal: Vec<Record>,
    pub published: Vec<Entry>,
    pub asked: Vec<(RobotId, FactsRequest)>,
    pub estimates: Vec<Estimate>,
    pub notices: Vec<Notice>,
}

pub fn checked(commands: Vec<Command>) -> Handled {
    let mut handled = Handled::default();
    for (place, command) in commands.into_iter().enumerate() {
        match command {
            Command::Journal(records) => {
                assert_eq!(place, 0, "the journal comes before everything else");
                handled.journal = records;
            }
            Command::Publish(entries) => {
                for entry in &entries {
                    let kept = handled.journal.contains(&Record::Entry(entry.clone()));
                    assert!(kept, "{} is published but not journalled before", entry.id);
                }
                handled.published.extend(entries);
            }
            Command::Ask { peer, request } => handled.asked.push((peer, request)),
            Command::Estimate(estimate) => handled.estimates.push(estimate),
            Command::Notice(notice) => handled.notices.push(notice),
            Command::Closed { .. } | Command::AskSnapshot { .. } | Command::Say { .. } => {}
        }
    }
    handled
}

pub fn handle(node: &mut Node, event: Event) -> Handled {
    checked(node.handle(event))
}

pub fn feed(node: &mut Node, sample: Sample) -> Handled {
    handle(node, Event::Sample(sample))
}

/// Odometry on the circle from `from` to `to`, both included, in steps of `step` seconds.
pub fn drive(node: &mut Node, from: f64, to: f64, step: f64) -> Vec<Handled> {
    let count = ((to - from) / step).round() as u32;
    (0..=count).map(|k| feed(node, velocity(from + f64::from(k) * step))).collect()
}

pub fn observations(entries: &[Entry]) -> Vec<Observation> {
    let observation = |entry: &Entry| match entry.body {
        Body::Observation(observation) => Some(observation),
        _ => None,
    };
    entries.iter().filter_map(observation).collect()
}

pub fn halves(entries: &[Entry]) -> Vec<Half> {
    let half = |entry: &Entry| match entry.body {
        Body::Half(half) => Some(half),
        _ => None,
    };
    entries.iter().filter_map(half).collect()
}

pub fn log(robot: u32, boot: u32) -> LogId {
    LogId { robot: RobotId(robot), boot: BootIndex(boot) }
}

pub fn id(robot: u32, boot: u32, sequence: u64) -> EntryId {
    EntryId { robot: RobotId(robot), boot: BootIndex(boot), sequence: Sequence(sequence) }
}

pub fn entry(id: EntryId, body: Body) -> Entry {
    Entry { id, body, extension: Vec::new() }
}

/// The log of a robot that stands at the origin, was placed there at time 0, and saw others, `(when, whom)`,
/// where robot 1 would be had it started at time 0.
pub fn standing_log(robot: u32, fold: FoldConfig, saw: &[(f64, u32)]) -> Vec<Entry> {
    let still = NominalState::new(Pose2::identity(), Symmetric3::zero());
    let boot = Boot {
        time: seconds(0.0),
        nonce: 1,
        configuration: fold.hash(),
        nominal: Pose2::identity(),
        continuation: None,
        calibration: None,
    };
    let noise = NoiseRef::Explicit(Noise::from_sigmas(&[0.1, 0.1, 0.05]));
    let observation = |time_s: f64, quantity| {
        Body::Observation(Observation { time: seconds(time_s), quantity, noise, observer: still })
    };
    let mut bodies =
        vec![Body::Boot(boot), observation(0.0, Quantity::Absolute(Absolute::Pose(Pose2::identity())))];
    bodies.extend(saw.iter().map(|(time_s, whom)| {
        let relative = Relative::Pose(on_circle(start(), *time_s));
        observation(*time_s, Quantity::Robot { robot: RobotId(*whom), relative })
    }));
    (0..).zip(bodies).map(|(sequence, body)| entry(id(robot, 0, sequence), body)).collect()
}

/// One ledger folding all entries, given log by log in order.
pub fn folded<'a>(entries: impl IntoIterator<Item = &'a Entry>, fold: FoldConfig) -> Ledger {
    let mut entries: Vec<&Entry> = entries.into_iter().collect();
    entries.sort_by_key(|entry| entry.id);
    let mut ledger = Ledger::new(fold);
    for entry in entries {
        let insertion = ledger.insert(entry.clone());
        assert_eq!(insertion, Insertion::Added { released: 0 }, "{}", entry.id);
    }
    ledger
}

/// All entries that a node holds in prefixes without a gap.
pub fn held(node: &Node) -> Vec<Entry> {
    let logs: Vec<LogId> = node.ledger().digests().map(|digest| digest.log).collect();
    logs.into_iter().flat_map(|log| node.ledger().entries(log, 0).to_vec()).collect()
}
