//! What can go wrong in a study.

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// A scenario that could not be simulated.
    #[error("the scenario of {study}: {source}")]
    Scenario {
        /// Name of the study.
        study: &'static str,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Too few seeds for an interval.
    #[error("{study} was given {found} seeds: an interval needs at least {least}; raise --seeds")]
    TooFewSeeds {
        /// Name of the study.
        study: &'static str,
        /// How many were given.
        found: usize,
        /// How many are needed.
        least: usize,
    },
    /// A filter that left its domain; a bug, or a scenario outside it.
    #[error("{study}, seed {seed}: {what}")]
    Diverged {
        /// Name of the study.
        study: &'static str,
        /// Of which run.
        seed: u64,
        /// What was found.
        what: String,
    },
}
