//! The systems that the joint filter grew from, each as a study: a scenario, the system on it over many seeds,
//! and the claim it is known for with what was measured.
//!
//! A study uses the filters of `estimation`, the calibration of `mismatch` and the simulator of `sim-peers`; nothing
//! is simulated or filtered here by means of its own.

mod error;
pub mod hypotheses;
mod monte_carlo;
pub mod motion_policies;
mod study;

pub use error::SurveyError;
pub use monte_carlo::{Estimate, over_seeds, share};
pub use study::{Claim, Known, Shown, Study, StudyOptions};

/// The studies of `pleiad survey`, in the order of the survey's sections.
pub const STUDIES: &[Known] = &[
    Known {
        name: hypotheses::NAME,
        about: "several hypotheses on a map of look-alike landmarks",
        run: hypotheses::study,
    },
    Known {
        name: motion_policies::NAME,
        about: "rules of motion for teams, beside the joint filter",
        run: motion_policies::study,
    },
];
