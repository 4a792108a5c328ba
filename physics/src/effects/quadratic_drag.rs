//! Entry 14. A load that grows with the square of the speed makes the servo droop, between command and
//! encoder.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SetPoint;

/// Quadratic drag.
pub(super) struct QuadraticDrag;

impl EffectModel for QuadraticDrag {
    const INFO: EffectInfo = EffectInfo {
        number: 14,
        name: "quadratic_drag",
        summary: "quadratic drag",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::smooth("s_per_m", "s/m", (-0.3, 0.3), Relevance::Size(0.01))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "v = u - s_per_m u |u|",
        confounded_with: "longitudinal_slip",
        broken_by: "constant-speed plateaus",
    };

    fn set_point<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SetPoint<S>) {
        let speed = signal.speed_m_s;
        signal.speed_m_s -= values[0] * speed * speed.abs();
    }
}
