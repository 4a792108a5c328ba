//! Entry 13. The servo cannot change the speed faster than its motors allow: a ramp instead of an
//! exponential.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::scalar::Scalar;
use crate::signal::Servo;

/// Limit of acceleration.
pub(super) struct AccelerationLimit;

impl EffectModel for AccelerationLimit {
    const INFO: EffectInfo = EffectInfo {
        number: 13,
        name: "acceleration_limit",
        summary: "limit of acceleration",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::grid("m_s2", "m/s^2", f64::INFINITY, (0.05, 50.0))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "|dv/dt| <= m_s2",
        confounded_with: "actuator_lag",
        broken_by: "amplitude sweep",
    };

    fn servo<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Servo<S>) {
        signal.acceleration_limit_m_s2 = signal.acceleration_limit_m_s2.min(values[0]);
    }
}
