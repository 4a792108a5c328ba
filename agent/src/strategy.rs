//! Every strategy behind one trait, speaking the messages of the wire: the exact one is the [`Node`], the
//! others are [`Approximate`].

use std::collections::VecDeque;

use pleiad_estimation::fact::NominalState;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::motion::DeadReckoning;
use pleiad_estimation::nominal::NominalTrajectory;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::strategy::{Command, Counts, Event, Strategy, StrategyKind, View};
use pleiad_estimation::{Pose2, RobotId};
use pleiad_protocol::{Message, limits};

use crate::approximate::Approximate;
use crate::config::NodeConfig;
use crate::node::{self, Node};

/// One robot's part in a team, whatever its strategy.
#[derive(Debug)]
pub enum Participant {
    /// Folds facts.
    Exact(Box<Exact>),
    /// Follows an approximate strategy.
    Approximate(Box<Approximate>),
}

/// A node, with its dead reckoning once more: what the whole team's estimate is carried on along.
#[derive(Debug)]
pub struct Exact {
    node: Node,
    reckoning: DeadReckoning,
    trajectory: Option<NominalTrajectory>,
}

impl Participant {
    /// A robot that has seen nothing; `nonce` as for [`Node::new`].
    pub fn new(kind: StrategyKind, config: NodeConfig, nonce: u64) -> Self {
        match Approximate::new(kind, config.clone()) {
            Some(approximate) => Self::Approximate(Box::new(approximate)),
            None => Self::Exact(Box::new(Exact {
                reckoning: DeadReckoning::new(config.motion),
                trajectory: None,
                node: Node::new(config, nonce),
            })),
        }
    }

    /// The node of the exact strategy.
    pub fn node(&self) -> Option<&Node> {
        match self {
            Self::Exact(exact) => Some(&exact.node),
            Self::Approximate(_) => None,
        }
    }

    /// The same, to be asked for what it computes when asked.
    pub fn node_mut(&mut self) -> Option<&mut Node> {
        match self {
            Self::Exact(exact) => Some(&mut exact.node),
            Self::Approximate(_) => None,
        }
    }

    /// The robot of an approximate strategy.
    pub fn approximate_mut(&mut self) -> Option<&mut Approximate> {
        match self {
            Self::Exact(_) => None,
            Self::Approximate(approximate) => Some(approximate),
        }
    }

    /// The nominal state at the last odometry.
    pub fn nominal(&self) -> Option<NominalState> {
        let trajectory = match self {
            Self::Exact(exact) => exact.trajectory.as_ref(),
            Self::Approximate(approximate) => approximate.peer().trajectory(),
        };
        trajectory.map(|trajectory| trajectory.end().1)
    }
}

impl Exact {
    fn reckon(&mut self, sample: &Sample) {
        match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => self.reckoning.gyro(sample.time, yaw_rate_rad_s),
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                let step = self.reckoning.odometry(*sample);
                match (step, &mut self.trajectory) {
                    (Ok(Some(step)), Some(trajectory)) => trajectory.extend(&step),
                    (Ok(None), None) => {
                        let prior = self.node.config().prior;
                        let nominal = prior.map_or_else(Pose2::identity, |prior| prior.pose);
                        self.trajectory = Some(NominalTrajectory::new(sample.time, nominal, 2));
                    }
                    _ => {}
                }
            }
            Reading::Gps { .. } | Reading::Heading { .. } | Reading::Sighting { .. } => {}
        }
    }

    fn handle(&mut self, event: Event<Message>) -> Vec<Command<Message>> {
        let mut out = Vec::new();
        let mut events = VecDeque::new();
        match event {
            Event::Sample(sample) => {
                self.reckon(&sample);
                events.push_back(node::Event::Sample(sample));
            }
            Event::Received { from, message } => match message {
                Message::Entries(entries) => events.push_back(node::Event::Entries(entries)),
                Message::Status(status) => events.push_back(node::Event::Status(status)),
                Message::FactsRequest(request) => {
                    let message = Message::Entries(self.node.serve(&request, limits::ENTRIES));
                    out.push(Command::Send { to: from, message });
                }
                // Not for a node: nothing that it should act on.
                _ => {}
            },
            Event::Period => out.push(Command::Broadcast(Message::Status(self.node.status()))),
            Event::InputEnded => events.push_back(node::Event::InputEnded),
        }
        for command in events.into_iter().flat_map(|event| self.node.handle(event)) {
            match command {
                node::Command::Publish(entries) => {
                    let chunks = entries.chunks(limits::ENTRIES);
                    out.extend(chunks.map(|chunk| Command::Broadcast(Message::Entries(chunk.to_vec()))));
                }
                node::Command::Ask { peer, request } => {
                    out.push(Command::Send { to: peer, message: Message::FactsRequest(request) });
                }
                // Records, estimates and notices are no part of the exchange.
                _ => {}
            }
        }
        out
    }

    fn counts(&mut self) -> Counts {
        let counts = self.node.ledger().counts();
        let samples_refused = self.node.status().samples.refused;
        Counts {
            relative: counts.relative as u64,
            absolute: counts.absolute as u64,
            used: counts.used as u64,
            rejected: counts.rejected as u64,
            pending: counts.pending as u64,
            samples_refused,
            ..Counts::default()
        }
    }
}

impl Strategy for Participant {
    type Message = Message;

    fn handle(&mut self, event: Event<Message>) -> Vec<Command<Message>> {
        let approximate = match self {
            Self::Exact(exact) => return exact.handle(event),
            Self::Approximate(approximate) => approximate,
        };
        let event = match event {
            Event::Sample(sample) => node::Event::Sample(sample),
            Event::Received { from, message: Message::Strategy(message) } => node::Event::Said(from, message),
            Event::InputEnded => node::Event::InputEnded,
            // A message of another strategy; and nothing is repaired.
            Event::Received { .. } | Event::Period => return Vec::new(),
        };
        let said = approximate.handle(event).into_iter().filter_map(|command| match command {
            node::Command::Say { to: Some(to), message } => {
                Some(Command::Send { to, message: Message::Strategy(message) })
            }
            node::Command::Say { to: None, message } => Some(Command::Broadcast(Message::Strategy(message))),
            // Records, estimates and notices are no part of the exchange.
            _ => None,
        });
        said.collect()
    }

    fn robot(&self) -> RobotId {
        match self {
            Self::Exact(exact) => exact.node.robot(),
            Self::Approximate(approximate) => approximate.robot(),
        }
    }

    fn view(&mut self) -> Option<View> {
        match self {
            Self::Exact(exact) => {
                let estimate = exact.node.estimate()?;
                Some(View {
                    time: estimate.time,
                    pose: estimate.map_from_robot,
                    form: ErrorForm::Additive,
                    covariance: estimate.covariance.to_matrix(),
                    row: std::collections::BTreeMap::new(),
                })
            }
            Self::Approximate(approximate) => approximate.peer_mut().view(),
        }
    }

    fn counts(&mut self) -> Counts {
        match self {
            Self::Exact(exact) => exact.counts(),
            Self::Approximate(approximate) => approximate.peer_mut().counts(),
        }
    }
}
