//! The systems that the joint filter grew from, each as a study: a scenario, the system on it over many seeds,
//! and the claim it is known for with what was measured.
//!
//! A study uses the filters of `estimation`, the calibration of `mismatch` and the simulator of `sim-peers`; nothing
//! is simulated or filtered here by means of its own, but for the linear systems of `kalman`, which are their own
//! law.

mod error;
pub mod gyro;
pub mod hypotheses;
pub mod kalman;
pub mod map;
mod monte_carlo;
pub mod motion_policies;
mod pages;
pub mod rover;
pub mod skid_steer;
pub mod slam;
mod solo;
mod study;
pub mod umbmark;

pub use error::SurveyError;
pub use monte_carlo::{Estimate, over_seeds, share};
pub use study::{Claim, Known, Shown, Study, StudyOptions};

/// The studies of `pleiad survey`, in the order of the survey's sections.
pub const STUDIES: &[Known] = &[
    Known {
        name: "umbmark",
        about: "systematic odometry errors from squares in both directions",
        run: umbmark::run,
    },
    Known { name: "map", about: "odometry errors per metre from range scans against a map", run: map::run },
    Known { name: "kalman", about: "the filter itself: steady states, consistency", run: kalman::run },
    Known { name: "gyro", about: "wheels and a gyro; what correlated noise is worth", run: gyro::run },
    Known {
        name: "rover",
        about: "encoders, rear steering, gyro, and a slow or late sun sensor",
        run: rover::run,
    },
    Known { name: "skid-steer", about: "raw and calibrated odometry, gyro and GPS", run: skid_steer::run },
    Known {
        name: "slam",
        about: "EKF SLAM: what a map converges to, what the choice of the error does to it, association, bearings alone",
        run: slam::study,
    },
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
