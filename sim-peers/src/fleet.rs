//! A team of real nodes in one process, under virtual time, over an in-memory network that carries the
//! same bytes as the real one.

use std::collections::BTreeMap;

use pleiad_agent::results::online;
use pleiad_agent::{Command, Event, Node, NodeConfig, Notice, SettledEstimate};
use pleiad_bus::faults::InvalidFaults;
use pleiad_bus::{LinkFaults, VirtualNetwork};
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::{Message, encode_entries, limits};

/// How a fleet runs.
#[derive(Clone, Debug)]
pub struct FleetOptions {
    /// Seed of the network's luck.
    pub seed: u64,
    /// What the links do to messages.
    pub faults: LinkFaults,
    /// Between two digests of every node, seconds of virtual time.
    pub status_period_s: f64,
}

impl Default for FleetOptions {
    fn default() -> Self {
        Self { seed: 1, faults: LinkFaults::default(), status_period_s: 1.0 }
    }
}

/// A team of nodes. They know nothing of one another but the messages that arrive.
pub struct Fleet {
    nodes: BTreeMap<RobotId, Member>,
    network: VirtualNetwork<Vec<u8>>,
    status_period_s: f64,
    next_status: Option<Timestamp>,
    refused_messages: u64,
}

struct Member {
    node: Node,
    online: Vec<SettledEstimate>,
    notices: Vec<Notice>,
    messages: u64,
    bytes: u64,
}

/// What a run of a fleet left behind, for one robot.
pub struct MemberOutcome {
    /// The node as it ended.
    pub node: Node,
    /// Its estimates as they were when made.
    pub online: Vec<SettledEstimate>,
    /// What an operator would have been told.
    pub notices: Vec<Notice>,
    /// Messages sent, one per publication whatever the number of receivers.
    pub messages: u64,
    /// Their payload bytes.
    pub bytes: u64,
}

impl Fleet {
    /// A team that has not begun.
    ///
    /// # Errors
    /// Faults that make no sense.
    pub fn new(configs: Vec<NodeConfig>, options: &FleetOptions) -> Result<Self, InvalidFaults> {
        let members = configs.into_iter().map(|config| {
            let robot = config.robot;
            // Of no consequence to any estimate; only different from robot to robot.
            let nonce = options.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(u64::from(robot.0));
            let node = Node::new(config, nonce);
            (robot, Member { node, online: Vec::new(), notices: Vec::new(), messages: 0, bytes: 0 })
        });
        Ok(Self {
            nodes: members.collect(),
            network: VirtualNetwork::new(options.seed, options.faults)?,
            status_period_s: options.status_period_s,
            next_status: None,
            refused_messages: 0,
        })
    }

    /// The network, to change its faults while the team runs.
    pub fn network(&mut self) -> &mut VirtualNetwork<Vec<u8>> {
        &mut self.network
    }

    /// Feeds every robot its samples in the order of time, delivering messages as they fall due.
    /// `progress` is told how far the run has come, now and then.
    pub fn feed(&mut self, samples: &BTreeMap<RobotId, Vec<Sample>>, mut progress: impl FnMut(Timestamp)) {
        let mut order: Vec<(Timestamp, RobotId, usize)> = samples
            .iter()
            .flat_map(|(robot, samples)| {
                samples.iter().enumerate().map(move |(index, sample)| (sample.time, *robot, index))
            })
            .collect();
        order.sort_unstable();
        for (time, robot, index) in order {
            self.advance(time, &mut progress);
            self.act(robot, time, Event::Sample(samples[&robot][index]));
        }
    }

    /// Virtual time passes: due messages arrive, digests go out.
    fn advance(&mut self, now: Timestamp, progress: &mut impl FnMut(Timestamp)) {
        let next = *self.next_status.get_or_insert(now);
        if now >= next {
            self.digests(now);
            self.next_status = Some(now.plus_seconds(self.status_period_s));
            progress(now);
        }
        self.deliver(now);
    }

    fn digests(&mut self, now: Timestamp) {
        let robots: Vec<_> = self.nodes.keys().copied().collect();
        for robot in robots {
            let Some(member) = self.nodes.get_mut(&robot) else { continue };
            let status = member.node.status();
            self.broadcast(now, robot, &Message::Status(status).encode());
        }
    }

    /// Delivers all messages due by `now`, and those they cause.
    fn deliver(&mut self, now: Timestamp) {
        loop {
            let due = self.network.poll(now);
            if due.is_empty() {
                return;
            }
            for delivery in due {
                match Message::decode(&delivery.payload) {
                    Ok(message) => self.receive(now, delivery.from, delivery.to, message),
                    // Only a fault of the network's can cause this.
                    Err(_) => self.refused_messages += 1,
                }
            }
        }
    }

    fn receive(&mut self, now: Timestamp, from: RobotId, to: RobotId, message: Message) {
        match message {
            Message::Entries(entries) => self.act(to, now, Event::Entries(entries)),
            Message::Status(status) => self.act(to, now, Event::Status(status)),
            Message::FactsRequest(request) => {
                let Some(member) = self.nodes.get_mut(&to) else { return };
                let reply = Message::Entries(member.node.serve(&request, limits::ENTRIES)).encode();
                self.send(now, to, from, reply);
            }
            _ => self.refused_messages += 1,
        }
    }

    fn act(&mut self, robot: RobotId, now: Timestamp, event: Event) {
        let Some(member) = self.nodes.get_mut(&robot) else { return };
        for command in member.node.handle(event) {
            match command {
                Command::Publish(entries) => {
                    for chunk in entries.chunks(limits::ENTRIES) {
                        self.broadcast(now, robot, &encode_entries(chunk));
                    }
                }
                Command::Ask { peer, request } => {
                    self.send(now, robot, peer, Message::FactsRequest(request).encode());
                }
                Command::Estimate(estimate) => {
                    let bytes = Message::Estimate(estimate).encode().len();
                    if let Some(member) = self.nodes.get_mut(&robot) {
                        member.online.push(online(&estimate));
                        member.messages += 1;
                        member.bytes += bytes as u64;
                    }
                }
                Command::Notice(notice) => {
                    if let Some(member) = self.nodes.get_mut(&robot) {
                        member.notices.push(notice);
                    }
                }
                // Nothing dies here, so nothing needs to be remembered; a node is of the exact strategy.
                Command::Journal(_)
                | Command::Closed { .. }
                | Command::AskSnapshot { .. }
                | Command::Say { .. } => {}
            }
        }
    }

    fn count(&mut self, from: RobotId, bytes: usize) {
        if let Some(member) = self.nodes.get_mut(&from) {
            member.messages += 1;
            member.bytes += bytes as u64;
        }
    }

    fn send(&mut self, now: Timestamp, from: RobotId, to: RobotId, payload: Vec<u8>) {
        self.count(from, payload.len());
        self.network.send(now, from, to, payload);
    }

    fn broadcast(&mut self, now: Timestamp, from: RobotId, payload: &[u8]) {
        self.count(from, payload.len());
        let peers: Vec<_> = self.nodes.keys().copied().filter(|peer| *peer != from).collect();
        for peer in peers {
            self.network.send(now, from, peer, payload.to_vec());
        }
    }

    /// Ends the input of all robots and lets digests repair what was lost, for at most `rounds` of them.
    /// Tells whether the team then agreed.
    pub fn settle(&mut self, mut now: Timestamp, rounds: u32) -> bool {
        let robots: Vec<_> = self.nodes.keys().copied().collect();
        self.deliver(now);
        for robot in &robots {
            self.act(*robot, now, Event::InputEnded);
        }
        for _ in 0..rounds {
            self.deliver(now);
            if self.agreed() {
                return true;
            }
            now = now.plus_seconds(self.status_period_s);
            self.digests(now);
            now = now.plus_seconds(self.status_period_s);
        }
        self.deliver(now);
        self.agreed()
    }

    /// Whether all hold the same facts, nothing waits, and no message is under way.
    fn agreed(&mut self) -> bool {
        let mut fingerprints = self.nodes.values_mut().map(|member| member.node.status());
        let Some(first) = fingerprints.next() else { return true };
        let rest: Vec<_> = fingerprints.collect();
        let same = rest.iter().all(|status| status.estimate == first.estimate && status.drained);
        same && first.drained && first.facts.pending == 0 && self.network.under_way() == 0
    }

    /// Messages that could not be understood on arrival.
    pub fn refused_messages(&self) -> u64 {
        self.refused_messages
    }

    /// Ends the run.
    pub fn into_outcomes(self) -> BTreeMap<RobotId, MemberOutcome> {
        let outcome = |member: Member| {
            let Member { node, online, notices, messages, bytes } = member;
            MemberOutcome { node, online, notices, messages, bytes }
        };
        self.nodes.into_iter().map(|(robot, member)| (robot, outcome(member))).collect()
    }
}
