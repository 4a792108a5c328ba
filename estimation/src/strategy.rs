//! How a team shares what its robots see of one another: the exact exchange of facts and the published
//! approximations it is compared with, behind one trait. `docs/strategies.md` compares them.
//!
//! A strategy is a pure state machine: an event in, messages out; no clock, no network, no chance. The
//! approximations are here, a [`Peer`] around the part in which they differ. The exact exchange is the
//! agent's node, which the agent puts behind the same trait.
//!
//! | name | sends per relative observation | keeps | error form |
//! |---|---|---|---|
//! | `exact` | a fact in two halves, to all | joint covariance | invariant (or additive) |
//! | `factored` | question, state and row, gains of every robot to all | own row of factors | additive |
//! | `pairwise` | question, belief, outcome between the two | own row of versioned factors | invariant |
//! | `intersection` | the observer's belief and measurement, one way | own block | invariant |
//! | `split_intersection` | the same, covariance in two parts | own block in two parts | invariant |
//! | `naive` | as `intersection` | own block | invariant |
//! | `independent` | nothing | own block | invariant |
//!
//! The approximations use the invariant error like `exact`, though they were published with the additive
//! one: what then differs between them and `exact` is the treatment of correlations and nothing else, and
//! a factor does not change while its robot moves. `factored` is kept as published.

mod block;
mod factored;
pub mod fusion;
mod message;
mod one_way;
mod pairwise;
mod peer;
mod setup;
mod view;

use std::fmt;
use std::str::FromStr;

pub use message::{
    Answer, Change, Gain, MeetingId, Message, Question, RowAnswer, Sighting, TeamUpdate, Verdict,
};
pub use peer::Peer;
pub use setup::{Noises, Setup};
pub use view::{Deviation, Factor, JointView, View, error, joint_of_replica, joint_view};

use crate::RobotId;
use crate::sample::Sample;

/// The strategies there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum StrategyKind {
    /// Every robot folds all facts.
    #[default]
    Exact,
    /// Roumeliotis & Bekey 2002: the participants broadcast everyone's gain.
    Factored,
    /// Luft, Schubert, Roumeliotis & Burgard 2018: only the participants update.
    Pairwise,
    /// Covariance intersection (Julier & Uhlmann 1997; one way as Carrillo-Arce et al. 2013).
    Intersection,
    /// Its split form: what cannot be correlated is not inflated.
    SplitIntersection,
    /// What another robot says of itself is taken as independent of oneself.
    Naive,
    /// Other robots are ignored.
    Independent,
}

impl StrategyKind {
    /// All of them, the exact one first.
    pub const ALL: [Self; 7] = [
        Self::Exact,
        Self::Factored,
        Self::Pairwise,
        Self::Intersection,
        Self::SplitIntersection,
        Self::Naive,
        Self::Independent,
    ];

    /// Its name in configurations and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Factored => "factored",
            Self::Pairwise => "pairwise",
            Self::Intersection => "intersection",
            Self::SplitIntersection => "split_intersection",
            Self::Naive => "naive",
            Self::Independent => "independent",
        }
    }
}

impl fmt::Display for StrategyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Not the name of a strategy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "found {found:?}, expected exact, factored, pairwise, intersection, split_intersection, naive or independent"
)]
pub struct UnknownStrategy {
    /// What was found.
    pub found: String,
}

impl FromStr for StrategyKind {
    type Err = UnknownStrategy;

    fn from_str(name: &str) -> Result<Self, UnknownStrategy> {
        let known = Self::ALL.into_iter().find(|kind| kind.name() == name);
        known.ok_or_else(|| UnknownStrategy { found: name.to_owned() })
    }
}

/// Something happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<M> {
    /// A sensor of this robot delivered, stamped in team time.
    Sample(Sample),
    /// A message arrived.
    Received {
        /// Who sent it.
        from: RobotId,
        /// The message.
        message: M,
    },
    /// The period of repairs is over: time to say what one holds, if the strategy does.
    Period,
    /// There will be no more samples.
    InputEnded,
}

/// Something is to be sent.
#[derive(Clone, Debug, PartialEq)]
pub enum Command<M> {
    /// To one robot.
    Send {
        /// To whom.
        to: RobotId,
        /// What.
        message: M,
    },
    /// To all others.
    Broadcast(M),
}

/// What became of observations and messages so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Observations of robots that this robot made.
    pub relative: u64,
    /// Measurements against the map that were used.
    pub absolute: u64,
    /// Relative observations that changed this robot's estimate, its own and others'.
    pub used: u64,
    /// Relative observations that took effect wherever they should, as counted by the robot that was the last
    /// to know.
    pub completed: u64,
    /// Updates of the whole team that this robot broadcast (`factored`).
    pub broadcast: u64,
    /// Such updates of others that it applied.
    pub applied: u64,
    /// Measurements that the gate refused.
    pub rejected: u64,
    /// Observations and messages that wait for an answer or for odometry.
    pub pending: u64,
    /// Messages that repeated an earlier one and were dropped.
    pub repeated: u64,
    /// Messages that repeated an earlier one and were used all the same.
    pub counted_twice: u64,
    /// Messages that came too late to be used, or whose premise had changed.
    pub refused: u64,
    /// Updates of pairs whose cross-covariance counted as unknown: factors of different versions, or a pair that is
    /// indefinite (`pairwise`).
    pub disagreed: u64,
    /// Samples that were not taken.
    pub samples_refused: u64,
}

/// One robot's part in a team.
pub trait Strategy {
    /// What travels.
    type Message;

    /// Handles an event; the commands are to be carried out in their order.
    fn handle(&mut self, event: Event<Self::Message>) -> Vec<Command<Self::Message>>;

    /// This robot.
    fn robot(&self) -> RobotId;

    /// The estimate at the last odometry; `None` while the robot has no place in the map.
    fn view(&mut self) -> Option<View>;

    /// What became of observations and messages.
    fn counts(&mut self) -> Counts;
}

#[cfg(test)]
mod tests;
