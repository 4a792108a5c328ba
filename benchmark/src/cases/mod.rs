//! The cases: a class and a seed give a recording and what is to be found in it, always the same.
//!
//! The rules were fixed before any result was looked at; `docs/benchmarks/concealed.md` has them in words.

mod build;
mod draw;
mod inject;
mod listed;
mod rare;
mod told_apart;

use pleiad_physics::Effect;
use pleiad_sim_peers::Scenario;

use crate::class::{Class, Noise};
use crate::error::BenchmarkError;
use crate::seal::Answer;

pub use listed::plans;
pub use told_apart::added;

/// What is done to a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum What {
    Nothing,
    /// One effect at a size over the typical one.
    Effect {
        effect: Effect,
        size: f64,
    },
    Masked,
    Absorbed(Effect),
    /// The first of the pair, which the second cancels on average.
    Cancelling(Effect),
    Buried {
        small: Effect,
        large: Effect,
    },
    Rare(Effect),
    LeftOut(Effect),
    Circling(Effect),
}

/// A case that is not built yet.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Its name: class, what, size, noise, seed.
    pub id: String,
    /// Its class.
    pub class: Class,
    /// Its noise.
    pub noise: Noise,
    pub(crate) what: What,
}

/// A recording to be made, and its answer.
#[derive(Clone, Debug)]
pub struct Case {
    /// What is to be found.
    pub answer: Answer,
    /// What is simulated.
    pub scenario: Scenario,
    /// From which seed.
    pub seed: u64,
    /// What the tool's catalogue is made to lack.
    pub left_out: Vec<Effect>,
}

impl Plan {
    /// Builds the case.
    ///
    /// # Errors
    /// The scenario cannot be simulated, or an effect cannot be injected.
    pub fn build(&self) -> Result<Case, BenchmarkError> {
        build::build(self)
    }
}
