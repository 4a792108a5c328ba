//! EKF SLAM (`dissanayake2001`): a car, ranges and bearings, landmarks in the state; the three theorems on its
//! runs, what the choice of the error does to them, and association without names.

mod input;
mod judge;
mod measure;
mod page;
mod report;
mod run;
mod study;
mod theorems;

pub use input::{Luck, SlamInput};
pub use judge::Associated;
pub use report::{Asked, SlamPage, on_recording, on_scenario};
pub use run::{Mapped, Moment, Ran, RunOptions, per_dimension, pose_error, run, seen_map_error};
pub use study::study;
pub use theorems::{
    DeterminantWatch, Likeness, OverLimit, covariance_at_truth, likeness, likeness_of, over_limit,
};

/// Name of the study.
pub(crate) const NAME: &str = "slam";

/// The ready scenario.
pub const SCENARIO: &str = include_str!("../../../scenarios/slam.toml");
