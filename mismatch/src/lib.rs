//! What a recording says that its nominal model does not.
//!
//! A **residual** is measured minus predicted, between two recorded channels that are neighbours in the
//! signal chain: encoders against commands, truth against encoders, a sensor against its prediction from
//! the true pose. [`residuals`] is generic over [`Scalar`](pleiad_physics::Scalar), so that the same code
//! gives residuals and, with a model of [`Dual`](pleiad_physics::Dual), their derivatives.
//!
//! [`compare`] does it for every robot of a recording against its own nominal model. What cannot be
//! compared is said ([`Omission`]); nothing here panics on a recording, and no residual is NaN.

mod actuator;
mod agitation;
mod body;
mod builtin;
pub mod calibration;
mod channel;
mod commanded;
mod compare;
mod diagnose;
mod diagnosis;
mod end_points;
mod error;
mod evidence;
mod findings;
mod gyro;
mod model;
mod plan;
mod reckoning;
mod reference;
mod residual;
mod rollout;
mod schedule;
mod search;
mod sensors;
mod sightings;
mod summary;
mod track;
mod view;
mod windows;

pub use builtin::models;
pub use channel::{Channel, Component, MAX_COMPONENTS};
pub use compare::{
    ChannelComparison, RobotComparison, command_agitation, compare, end_to_end, residuals, residuals_of,
};
pub use diagnose::{DiagnoseOptions, Diagnosis, TruthUse, Without, diagnose};
pub use diagnosis::{
    Design, DesignColumn, Explained, Interval, KnownFit, KnownParameter, Rival, Structure,
    acts_on_every_robot, composition, design, explained, fit_known, log_likelihood,
};
pub use error::MismatchError;
pub use evidence::Evidence;
pub use findings::{
    Estimate, Finding, Findings, HeldOut, Place, RobotRollOuts, RollOut, Shape, Undetected, Untestable,
    Verdict,
};
pub use model::{nominal_model, nominal_models};
pub use residual::{ChannelResiduals, Omission, Regime, Residual};
pub use rollout::{HORIZONS_S, Rollout, rollouts};
pub use summary::{MIN_RESIDUALS, Summary, summarize};
pub use view::{PartialResidual, Plots, ResidualSeries, ShapePlot};
