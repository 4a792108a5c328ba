//! A simulated team of nodes, and a network between them that loses, repeats and reorders. All choices
//! come from one seed.

use std::collections::BTreeMap;

use pleiad_agent::{AgentConfig, Command, Event, Node, Record};
use pleiad_estimation::fact::{Entry, EntryId, Fingerprint};
use pleiad_estimation::geometry::Vector3;
use pleiad_estimation::sample::{Reading, Relative, Sample, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId};
use pleiad_protocol::FactsRequest;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{agent, checked, node_of, sample};

const TICK_S: f64 = 0.1;
/// Random walk of the odometry, as configured: m and rad per root second.
const ODOMETRY: [f64; 2] = [0.02, 0.01];

/// What a team is to live through.
pub struct World {
    pub configs: BTreeMap<RobotId, AgentConfig>,
    /// Every robot's samples in the order of their delivery.
    pub samples: Vec<(RobotId, Sample)>,
}

fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// The reading of each kind in turn, with the noise that [`agent`] declares.
fn sighting(kind: u32, observer: &Pose2, target: &Pose2, random: &mut ChaCha8Rng) -> Relative {
    let seen = observer.between(target);
    let (range, bearing) = (seen.x_m().hypot(seen.y_m()), seen.y_m().atan2(seen.x_m()));
    let mut noise = |sigma: f64| sigma * gaussian(random);
    match kind % 5 {
        0 => {
            let error = Vector3::new(noise(0.05), noise(0.05), noise(0.02));
            Relative::Pose(seen.compose(&Pose2::exp(error)))
        }
        1 => Relative::Position { x_m: seen.x_m() + noise(0.06), y_m: seen.y_m() + noise(0.06) },
        2 => Relative::Range { range_m: range + noise(0.07) },
        3 => Relative::Bearing { bearing_rad: bearing + noise(0.03) },
        _ => Relative::RangeBearing { range_m: range + noise(0.08), bearing_rad: bearing + noise(0.04) },
    }
}

/// Robots 1 to `robots` in an arena, 10 m apart and more, seeing each other, a landmark and satellites.
pub fn world(seed: u64, robots: u32, seconds: f64) -> World {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut truth: BTreeMap<u32, Pose2> = BTreeMap::new();
    let mut configs = BTreeMap::new();
    for robot in 1..=robots {
        let place = Pose2::new(
            f64::from(robot) * 12.0,
            random.random_range(-9.0..9.0),
            random.random_range(-3.0..3.0),
        );
        let mut config = agent(robot);
        config.output.estimate_rate_hz = 2.0;
        let prior = config.prior.as_mut().expect("a prior");
        prior.x_m = place.x_m() + 0.1 * gaussian(&mut random);
        prior.y_m = place.y_m() + 0.1 * gaussian(&mut random);
        prior.heading_rad = place.yaw_rad() + 0.05 * gaussian(&mut random);
        truth.insert(robot, place);
        configs.insert(RobotId(robot), config);
    }
    let mut samples = Vec::new();
    for tick in 0..=(seconds / TICK_S).round() as u32 {
        let time = f64::from(tick) * TICK_S;
        let before = truth.clone();
        for (robot, place) in &mut truth {
            let (forward, rate) = (random.random_range(0.2..0.8), random.random_range(-0.6..0.6));
            let reading = Reading::Velocity { forward_m_s: forward, yaw_rate_rad_s: rate };
            samples.push((RobotId(*robot), sample(time, reading)));
            let seen_now = *place;
            let motion = Vector3::new(forward * TICK_S, 0.0, rate * TICK_S);
            let root = TICK_S.sqrt();
            let noise = ODOMETRY.map(|sigma| sigma * root * gaussian(&mut random));
            *place = place
                .compose(&Pose2::exp(motion))
                .compose(&Pose2::exp(Vector3::new(noise[0], 0.0, noise[1])));
            if random.random::<f64>() < 0.15 {
                let reading = if random.random() {
                    let mut noise = || 0.5 * gaussian(&mut random);
                    Reading::Gps { x_m: seen_now.x_m() + noise(), y_m: seen_now.y_m() + noise() }
                } else {
                    Reading::Heading { heading_rad: seen_now.yaw_rad() + 0.06 * gaussian(&mut random) }
                };
                samples.push((RobotId(*robot), sample(time, reading)));
            }
        }
        // Between two ticks, on the arc of the true motion; delivered before the odometry that reaches it.
        if tick % 2 == 1 {
            let between = |robot: u32| {
                let (from, to) = (before[&robot], truth[&robot]);
                from.compose(&Pose2::exp(from.between(&to).log() * 0.7))
            };
            let observer = random.random_range(1..=robots);
            let target = random.random_range(0..robots);
            let kind = random.random_range(0..5);
            let (target, place) = match if target + 1 == observer { 0 } else { target + 1 } {
                0 => (Target::Landmark(LandmarkId(7)), Pose2::new(3.0, -4.0, 0.0)),
                robot => (Target::Robot(RobotId(robot)), between(robot)),
            };
            let kind = if matches!(target, Target::Landmark(_)) { kind.max(1) } else { kind };
            let relative = sighting(kind, &between(observer), &place, &mut random);
            let reading = Reading::Sighting { target, relative };
            samples.push((RobotId(observer), sample(time + 0.7 * TICK_S, reading)));
        }
    }
    World { configs, samples }
}

enum Message {
    Entries(Vec<Entry>),
    Ask { from: RobotId, request: FactsRequest },
}

/// When a robot's process is killed: once its journal has this many frames, before or after what follows
/// from the last of them has been sent.
#[derive(Clone, Copy, Debug)]
pub struct Crash {
    pub robot: RobotId,
    pub frames: usize,
    pub silent: bool,
}

/// A team and the messages on their way.
pub struct Net {
    pub nodes: BTreeMap<RobotId, Node>,
    /// Every frame of every journal.
    pub journals: BTreeMap<RobotId, Vec<Vec<Record>>>,
    /// Everything that was ever journalled by its author: an identity has one content for ever.
    pub said: BTreeMap<EntryId, Entry>,
    configs: BTreeMap<RobotId, AgentConfig>,
    messages: Vec<(RobotId, Message)>,
    random: ChaCha8Rng,
    /// Shares of messages that are lost and repeated.
    pub lost: f64,
    pub repeated: f64,
    /// Most entries in one answer.
    pub most: usize,
    pub crash: Option<Crash>,
}

impl Net {
    pub fn new(configs: &BTreeMap<RobotId, AgentConfig>, seed: u64) -> Self {
        let node = |(robot, config): (&RobotId, &AgentConfig)| (*robot, node_of(config, u64::from(robot.0)));
        Self {
            nodes: configs.iter().map(node).collect(),
            journals: BTreeMap::new(),
            said: BTreeMap::new(),
            configs: configs.clone(),
            messages: Vec::new(),
            random: ChaCha8Rng::seed_from_u64(seed),
            lost: 0.0,
            repeated: 0.0,
            most: 512,
            crash: None,
        }
    }

    /// Hands an event to a node and does what follows from it.
    pub fn event(&mut self, robot: RobotId, event: Event) {
        let commands = self.nodes.get_mut(&robot).expect("a robot of the team").handle(event);
        checked(commands.clone());
        for command in commands {
            match command {
                Command::Journal(records) => {
                    self.keep(robot, records);
                    if self.crash.is_some_and(|crash| self.crashes(robot, crash)) {
                        return;
                    }
                }
                Command::Publish(entries) => {
                    let peers: Vec<RobotId> =
                        self.nodes.keys().copied().filter(|peer| *peer != robot).collect();
                    for peer in peers {
                        self.send(peer, || Message::Entries(entries.clone()));
                    }
                }
                Command::Ask { peer, request } => {
                    self.send(peer, || Message::Ask { from: robot, request: request.clone() });
                }
                Command::Estimate(_)
                | Command::Notice(_)
                | Command::Closed { .. }
                | Command::AskSnapshot { .. }
                | Command::Say { .. } => {}
            }
        }
        if self.crash.is_some_and(|crash| crash.robot == robot && self.frames(robot) == crash.frames) {
            self.restart(robot);
        }
    }

    fn frames(&self, robot: RobotId) -> usize {
        self.journals.get(&robot).map_or(0, Vec::len)
    }

    fn crashes(&mut self, robot: RobotId, crash: Crash) -> bool {
        let now = crash.silent && crash.robot == robot && self.frames(robot) == crash.frames;
        if now {
            self.restart(robot);
        }
        now
    }

    /// A new process from the journal.
    pub fn restart(&mut self, robot: RobotId) {
        self.crash = None;
        let records: Vec<Record> =
            self.journals.get(&robot).into_iter().flatten().flatten().cloned().collect();
        let config = self.configs[&robot].node().expect("a valid configuration");
        self.nodes.insert(robot, Node::recover(config, self.random.random(), records));
    }

    fn keep(&mut self, robot: RobotId, records: Vec<Record>) {
        for record in &records {
            if let Record::Entry(entry) = record {
                let first = self.said.entry(entry.id).or_insert_with(|| entry.clone());
                assert_eq!(first, entry, "one identity with two contents");
            }
        }
        self.journals.entry(robot).or_default().push(records);
    }

    fn send(&mut self, to: RobotId, message: impl Fn() -> Message) {
        if self.random.random::<f64>() >= self.lost {
            self.messages.push((to, message()));
        }
        if self.random.random::<f64>() < self.repeated {
            self.messages.push((to, message()));
        }
    }

    /// Delivers one message, whichever.
    fn deliver(&mut self) {
        let index = self.random.random_range(0..self.messages.len());
        let (to, message) = self.messages.swap_remove(index);
        match message {
            Message::Entries(entries) => self.event(to, Event::Entries(entries)),
            Message::Ask { from, request } => {
                let entries = self.nodes[&to].serve(&request, self.most);
                self.send(from, || Message::Entries(entries.clone()));
            }
        }
    }

    /// Lives through the samples, delivering messages in between in any order, then ends the input.
    pub fn live(&mut self, samples: &[(RobotId, Sample)]) {
        for (robot, sample) in samples {
            self.event(*robot, Event::Sample(*sample));
            while !self.messages.is_empty() && self.random.random::<f64>() < 0.7 {
                self.deliver();
            }
            if self.random.random::<f64>() < 0.02 {
                self.statuses();
            }
        }
        let robots: Vec<RobotId> = self.nodes.keys().copied().collect();
        for robot in robots {
            self.event(robot, Event::InputEnded);
        }
    }

    /// Everyone tells everyone what it holds.
    pub fn statuses(&mut self) {
        let statuses: Vec<_> = self.nodes.values_mut().map(Node::status).collect();
        for status in statuses {
            let peers: Vec<RobotId> =
                self.nodes.keys().copied().filter(|peer| *peer != status.robot).collect();
            for peer in peers {
                self.event(peer, Event::Status(status.clone()));
            }
        }
    }

    /// Statuses and what follows from them, until all hold the same.
    pub fn settle(&mut self) -> Fingerprint {
        for _ in 0..300 {
            while !self.messages.is_empty() {
                self.deliver();
            }
            let prints = self.fingerprints();
            let drained = self.nodes.values().all(Node::drained);
            if drained && prints.windows(2).all(|pair| pair[0] == pair[1]) {
                return prints[0];
            }
            self.statuses();
        }
        panic!("the team does not come to hold the same in 300 rounds of statuses");
    }

    pub fn fingerprints(&mut self) -> Vec<Fingerprint> {
        self.nodes.values_mut().map(|node| node.status().estimate).collect()
    }
}
