//! What a model predicts for one window or instant of a recording, from the measured upstream channel.
//!
//! The residual of a stage is the measured downstream channel minus these. With
//! [`RobotModel::differentiated`](crate::RobotModel::differentiated) every prediction carries its derivatives.

mod actuator;
mod body;
mod sensors;

pub use actuator::{CommandWindow, wheel_turns};
pub use body::{
    BodyWindow, EncoderSample, body_motion, body_state, commanded_truth_change, mean_gyro, truth_change,
};
pub use sensors::{Anchor, Instant, Path, gps, heading, sighting, truth};
