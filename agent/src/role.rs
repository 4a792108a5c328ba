//! What an agent's driver runs: the exact strategy's node, or a robot of an approximate strategy.

use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Entry;
use pleiad_protocol::{FactsRequest, SnapshotPart, SnapshotRequest, Status};

use crate::approximate::Approximate;
use crate::config::NodeConfig;
use crate::node::{Command, Event, Node, Record, SettledEstimate};
use crate::results::{self, AgentSummary};

/// One robot, whatever its strategy.
#[derive(Debug)]
pub enum Role {
    /// Folds facts.
    Exact(Box<Node>),
    /// Follows an approximate strategy.
    Approximate(Box<Approximate>),
}

impl Role {
    /// The robot that a journal tells of, of the strategy in its configuration; `nonce` as for [`Node::new`].
    pub fn recover(config: NodeConfig, nonce: u64, records: Vec<Record>) -> Self {
        match Approximate::recover(config.strategy, config.clone(), records.iter().cloned()) {
            Some(approximate) => Self::Approximate(Box::new(approximate)),
            None => Self::Exact(Box::new(Node::recover(config, nonce, records))),
        }
    }

    /// Whether there may be a former life of this robot that its peers know of and it does not.
    pub fn may_have_lived(&self) -> bool {
        match self {
            Self::Exact(node) => !node.has_lived(),
            // Nobody keeps anything for anybody.
            Self::Approximate(_) => false,
        }
    }

    /// This robot.
    pub fn robot(&self) -> RobotId {
        match self {
            Self::Exact(node) => node.robot(),
            Self::Approximate(approximate) => approximate.robot(),
        }
    }

    /// Handles an event; the commands are to be carried out in their order.
    pub fn handle(&mut self, event: Event) -> Vec<Command> {
        match self {
            Self::Exact(node) => node.handle(event),
            Self::Approximate(approximate) => approximate.handle(event),
        }
    }

    /// Its digest for peers, its state for operators.
    pub fn status(&mut self) -> Status {
        match self {
            Self::Exact(node) => node.status(),
            Self::Approximate(approximate) => approximate.status(),
        }
    }

    /// Entries a peer asks for; none where there are no facts.
    pub fn serve(&self, request: &FactsRequest, most: usize) -> Vec<Entry> {
        match self {
            Self::Exact(node) => node.serve(request, most),
            Self::Approximate(_) => Vec::new(),
        }
    }

    /// A part of a snapshot a peer asks for.
    pub fn serve_snapshot(&mut self, request: &SnapshotRequest) -> Option<SnapshotPart> {
        match self {
            Self::Exact(node) => node.serve_snapshot(request),
            Self::Approximate(_) => None,
        }
    }

    /// What a journal has to hold once the past is closed.
    pub fn compacted(&self) -> Vec<Record> {
        match self {
            Self::Exact(node) => node.compacted(),
            Self::Approximate(_) => Vec::new(),
        }
    }

    /// Whether a robot can be evicted: where nothing is closed together, nobody has to go.
    pub fn has_members(&self) -> bool {
        matches!(self, Self::Exact(_))
    }

    /// The estimates that will not change any more, since the last cut if the team closes its past.
    pub fn settled(&self) -> Vec<SettledEstimate> {
        match self {
            Self::Exact(node) => node.settled(),
            Self::Approximate(approximate) => approximate.settled().to_vec(),
        }
    }

    /// Why the sample refused last was refused.
    pub fn last_refusal(&self) -> Option<String> {
        let refusal = match self {
            Self::Exact(node) => node.last_refusal(),
            Self::Approximate(approximate) => approximate.peer().samples().last,
        };
        refusal.map(|refusal| refusal.to_string())
    }

    /// What it did, in numbers; messages and bytes are the driver's to know.
    pub fn summary(&mut self, messages: u64, bytes: u64) -> AgentSummary {
        match self {
            Self::Exact(node) => results::summary(node, messages, bytes),
            Self::Approximate(approximate) => results::approximate_summary(approximate, messages, bytes),
        }
    }
}
