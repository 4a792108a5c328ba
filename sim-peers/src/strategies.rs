//! Teams of any strategy in one process, under virtual time, over a network with faults that carries the
//! same bytes as the real one. What they believed at given times is kept, to be judged by others.

use std::collections::{BTreeMap, VecDeque};

use pleiad_agent::{NodeConfig, Participant};
use pleiad_bus::faults::{InvalidFaults, Traffic};
use pleiad_bus::{FaultPlan, LinkFaults, VirtualNetwork};
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::strategy::{
    Command, Event, JointView, Strategy, StrategyKind, View, joint_of_replica, joint_view,
};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::Message;

/// How a team runs.
#[derive(Clone, Debug)]
pub struct StrategyOptions {
    /// What it does with what it sees.
    pub kind: StrategyKind,
    /// Seed of the network's luck.
    pub seed: u64,
    /// What goes wrong, and when, seconds from the first sample.
    pub plan: FaultPlan,
    /// Between two digests of every robot, seconds: how often the exact strategy looks for what it misses.
    pub period_s: f64,
    /// Between two looks at what the robots believe, seconds.
    pub look_every_s: f64,
    /// Digest rounds granted after the last sample.
    pub settling_rounds: u32,
}

impl StrategyOptions {
    /// A strategy on a network without faults.
    pub fn new(kind: StrategyKind) -> Self {
        Self {
            kind,
            seed: 1,
            plan: FaultPlan::default(),
            period_s: 1.0,
            look_every_s: 1.0,
            settling_rounds: 50,
        }
    }
}

/// What a team believed at one time.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Seconds from the first sample.
    pub t_s: f64,
    /// Each robot's estimate of itself at its last odometry, with the time by a clock without fault.
    pub views: BTreeMap<RobotId, (Timestamp, View)>,
    /// What the team holds of the joint covariance: one replica of the exact strategy, the rows put
    /// together where there are rows, none for covariance intersection.
    pub joint: Option<JointView>,
}

/// What a run left behind.
pub struct StrategyOutcome {
    /// The robots as they ended.
    pub participants: BTreeMap<RobotId, Participant>,
    /// What they believed during the run.
    pub snapshots: Vec<Snapshot>,
    /// What they believed once all was settled.
    pub last: Snapshot,
    /// Messages each robot sent, one per publication whatever the number of receivers, and their bytes.
    pub sent: BTreeMap<RobotId, (u64, u64)>,
    /// Messages that the codec refused on arrival.
    pub refused_messages: u64,
    /// What the network did.
    pub traffic: Traffic,
    /// Whether the robots of the exact strategy held the same facts at the end, and nothing was open; true
    /// for the others.
    pub agreed: bool,
}

impl StrategyOutcome {
    /// Messages and bytes of the whole team.
    pub fn total(&self) -> (u64, u64) {
        let sum = |(messages, bytes): (u64, u64), sent: &(u64, u64)| (messages + sent.0, bytes + sent.1);
        self.sent.values().fold((0, 0), sum)
    }
}

struct Run {
    kind: StrategyKind,
    participants: BTreeMap<RobotId, Participant>,
    network: VirtualNetwork<Vec<u8>>,
    plan: FaultPlan,
    origin: Timestamp,
    /// When each robot's odometry was last read, by a clock without fault.
    read: BTreeMap<RobotId, Timestamp>,
    /// Observations of `factored` that wait for everyone's odometry, in the order of time.
    held: VecDeque<(Timestamp, RobotId, Sample)>,
    sent: BTreeMap<RobotId, (u64, u64)>,
    refused_messages: u64,
}

/// Runs a team on its samples, which are in the order of time.
///
/// # Errors
/// Never with a plan that was checked; the network's own faults are none.
pub fn run(
    configs: &BTreeMap<RobotId, NodeConfig>,
    samples: &BTreeMap<RobotId, Vec<Sample>>,
    options: &StrategyOptions,
) -> Result<StrategyOutcome, InvalidFaults> {
    let mut order: Vec<(Timestamp, RobotId, usize)> = samples
        .iter()
        .flat_map(|(robot, samples)| {
            samples.iter().enumerate().map(move |(index, sample)| (sample.time, *robot, index))
        })
        .collect();
    order.sort_unstable();
    let origin = order.first().map_or(Timestamp(0), |(time, ..)| *time);
    let mut network = VirtualNetwork::new(options.seed, LinkFaults::default())?;
    network.set_plan(options.plan.clone(), origin);
    let participant = |(robot, config): (&RobotId, &NodeConfig)| {
        let nonce = options.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(u64::from(robot.0));
        (*robot, Participant::new(options.kind, config.clone(), nonce))
    };
    let mut run = Run {
        kind: options.kind,
        participants: configs.iter().map(participant).collect(),
        network,
        plan: options.plan.clone(),
        origin,
        read: BTreeMap::new(),
        held: VecDeque::new(),
        sent: BTreeMap::new(),
        refused_messages: 0,
    };
    let mut snapshots = Vec::new();
    let (mut next_period, mut next_look) = (origin, origin.plus_seconds(options.look_every_s));
    let mut end = origin;
    for (time, robot, index) in order {
        while next_look <= time {
            run.deliver(next_look);
            snapshots.push(run.look(next_look));
            next_look = next_look.plus_seconds(options.look_every_s);
        }
        while next_period <= time {
            run.deliver(next_period);
            run.period(next_period);
            next_period = next_period.plus_seconds(options.period_s);
        }
        run.deliver(time);
        run.sample(time, robot, samples[&robot][index]);
        end = time;
    }
    run.exchange(end, None);
    let agreed = run.settle(end, options.period_s, options.settling_rounds);
    let last = run.look(end);
    Ok(StrategyOutcome {
        traffic: run.network.traffic(),
        participants: run.participants,
        snapshots,
        last,
        sent: run.sent,
        refused_messages: run.refused_messages,
        agreed,
    })
}

impl Run {
    fn sample(&mut self, time: Timestamp, robot: RobotId, mut sample: Sample) {
        if matches!(sample.reading, Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_))
        {
            self.read.insert(robot, time);
        }
        // The world goes by the right time; the robot stamps by its own.
        let ahead_s = self.plan.clock_error_s(robot, time.seconds_since(self.origin));
        sample.time = sample.time.plus_seconds(ahead_s);
        if self.kind != StrategyKind::Factored {
            self.act(robot, time, Event::Sample(sample));
        } else if self.read.get(&robot) == Some(&time) || matches!(sample.reading, Reading::Gyro { .. }) {
            self.act(robot, time, Event::Sample(sample));
            let reached = self.participants.keys().map(|robot| self.read.get(robot).copied());
            if let Some(reached) = reached.min().flatten() {
                self.exchange(time, Some(reached));
            }
        } else {
            self.held.push_back((time, robot, sample));
        }
    }

    /// The published form assumes that exchanges follow one another in one order. So an observation waits
    /// until everyone's odometry has reached it, and on a link without delay its exchange is then over before
    /// the next one begins.
    fn exchange(&mut self, now: Timestamp, reached: Option<Timestamp>) {
        while let Some((time, robot, sample)) = self.held.front().copied() {
            if reached.is_some_and(|reached| time > reached) {
                return;
            }
            self.held.pop_front();
            self.act(robot, now, Event::Sample(sample));
            self.deliver(now);
        }
    }

    fn act(&mut self, robot: RobotId, now: Timestamp, event: Event<Message>) {
        let Some(participant) = self.participants.get_mut(&robot) else { return };
        for command in participant.handle(event) {
            let (message, receivers) = match command {
                Command::Send { to, message } => (message, vec![to]),
                Command::Broadcast(message) => {
                    let others = self.participants.keys().copied().filter(|other| *other != robot);
                    (message, others.collect())
                }
            };
            let bytes = message.encode();
            let (sent, length) = self.sent.entry(robot).or_default();
            *sent += 1;
            *length += bytes.len() as u64;
            for receiver in receivers {
                self.network.send(now, robot, receiver, bytes.clone());
            }
        }
    }

    /// Delivers all messages due by `now`, each at its time, and those they cause.
    fn deliver(&mut self, now: Timestamp) {
        while let Some(due) = self.network.next_due().filter(|due| *due <= now) {
            for delivery in self.network.poll(due) {
                match Message::decode(&delivery.payload) {
                    Ok(message) => {
                        self.act(delivery.to, due, Event::Received { from: delivery.from, message });
                    }
                    Err(_) => self.refused_messages += 1,
                }
            }
        }
    }

    fn period(&mut self, now: Timestamp) {
        let robots: Vec<_> = self.participants.keys().copied().collect();
        for robot in robots {
            self.act(robot, now, Event::Period);
        }
        self.deliver(now);
    }

    fn settle(&mut self, end: Timestamp, period_s: f64, rounds: u32) -> bool {
        self.deliver(end);
        let robots: Vec<_> = self.participants.keys().copied().collect();
        for robot in robots {
            self.act(robot, end, Event::InputEnded);
        }
        let mut now = end;
        for _ in 0..rounds {
            self.deliver(now);
            if self.agreed() {
                return true;
            }
            now = now.plus_seconds(period_s);
            self.period(now);
        }
        self.deliver(Timestamp::MAX);
        self.agreed()
    }

    fn agreed(&mut self) -> bool {
        let idle = self.network.under_way() == 0;
        let statuses: Vec<_> = self
            .participants
            .values_mut()
            .filter_map(|participant| participant.node_mut().map(pleiad_agent::Node::status))
            .collect();
        let Some(first) = statuses.first() else { return idle };
        let same = statuses.iter().all(|status| status.estimate == first.estimate && status.drained);
        idle && same && first.facts.pending == 0
    }

    fn look(&mut self, now: Timestamp) -> Snapshot {
        let mut views = BTreeMap::new();
        for (robot, participant) in &mut self.participants {
            if let (Some(view), Some(read)) = (participant.view(), self.read.get(robot)) {
                views.insert(*robot, (*read, view));
            }
        }
        let complete = views.len() == self.participants.len();
        let rows = || joint_view(&views.iter().map(|(robot, (_, view))| (*robot, view.clone())).collect());
        let joint = match self.kind {
            _ if !complete => None,
            StrategyKind::Exact => self.replica(),
            StrategyKind::Factored
            | StrategyKind::Pairwise
            | StrategyKind::Naive
            | StrategyKind::Independent => rows(),
            // Says nothing of the correlation of two robots.
            StrategyKind::Intersection | StrategyKind::SplitIntersection => None,
        };
        Snapshot { t_s: now.seconds_since(self.origin), views, joint }
    }

    fn replica(&self) -> Option<JointView> {
        let nominal = |(robot, participant): (&RobotId, &Participant)| Some((*robot, participant.nominal()?));
        let states = self.participants.iter().map(nominal).collect::<Option<_>>()?;
        let node = self.participants.values().next()?.node()?;
        joint_of_replica(node.ledger().joint(), &states)
    }
}
