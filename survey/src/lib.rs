//! The systems that the joint filter grew from, each as a study: a scenario, the system on it over many seeds,
//! and the claim it is known for with what was measured.
//!
//! A study uses the filters of `estimation`, the calibration of `mismatch` and the simulator of `sim-peers`; nothing
//! is simulated or filtered here by means of its own, but for the linear systems of `kalman`, which are their own
//! law.

mod error;
pub mod gyro;
pub mod kalman;
mod monte_carlo;
mod pages;
pub mod rover;
pub mod skid_steer;
mod solo;
mod study;

pub use error::SurveyError;
pub use monte_carlo::{Estimate, over_seeds, share};
pub use study::{Claim, Known, Shown, Study, StudyOptions};

/// The studies of `pleiad survey`, in the order of the survey's sections.
pub const STUDIES: &[Known] = &[
    Known { name: "kalman", about: "the filter itself: steady states, consistency", run: kalman::run },
    Known { name: "gyro", about: "wheels and a gyro; what correlated noise is worth", run: gyro::run },
    Known {
        name: "rover",
        about: "encoders, rear steering, gyro, and a slow or late sun sensor",
        run: rover::run,
    },
    Known { name: "skid-steer", about: "raw and calibrated odometry, gyro and GPS", run: skid_steer::run },
];
