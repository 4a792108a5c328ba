//! Entry 8. The servo is slower than declared, alike for speed and yaw rate; the value adds to the declared
//! time constants.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Servo;

/// Actuator lag (first order).
pub(super) struct ActuatorLag;

impl EffectModel for ActuatorLag {
    const INFO: EffectInfo = EffectInfo {
        number: 8,
        name: "actuator_lag",
        summary: "actuator lag (first order)",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::smooth("time_constant_s", "s", (-0.05, 1.0), Relevance::Lag(0.001))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "(tau + time_constant_s) dv/dt = u - v",
        confounded_with: "command_delay, on slow commands",
        broken_by: "steps, chirp",
    };

    fn servo<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Servo<S>) {
        signal.time_constant_s += values[0];
        signal.time_constant_turn_s += values[0];
    }
}
