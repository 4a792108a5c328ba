//! Encoders, predicted from commands.

use crate::chain::actuator::{ActuatorState, Scheduled, turn};
use crate::context::{Context, Motion, Surroundings};
use crate::model::RobotModel;
use crate::scalar::Scalar;

/// A window between two encoder samples; 0.2 s is usual.
#[derive(Clone, Copy, Debug)]
pub struct CommandWindow {
    /// Its beginning, seconds by the robot's clock.
    pub from_s: f64,
    /// Its end, seconds by the robot's clock.
    pub to_s: f64,
    /// The motion in its middle, for loads that depend on heading or place: from truth, or from the filter.
    pub motion: Motion<f64>,
    /// Voltage, neighbours.
    pub surroundings: Surroundings,
}

/// The angles in radians by which the left and right wheel turn in the window. Run windows in order: the
/// servo's state goes from one to the next. See [`schedule`](crate::chain::actuator::schedule).
pub fn wheel_turns<S: Scalar>(
    model: &RobotModel<S>,
    scheduled: &[Scheduled<S>],
    window: &CommandWindow,
    state: &mut ActuatorState<S>,
) -> [S; 2] {
    let middle_s = f64::midpoint(window.from_s, window.to_s);
    let context = Context {
        surroundings: window.surroundings,
        ..Context::new(&model.nominal, middle_s, window.motion.lift())
    };
    turn(model, &context, scheduled, (window.from_s, window.to_s), state)
}
