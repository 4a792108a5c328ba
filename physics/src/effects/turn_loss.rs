//! Entry 15. Scrubbing in turns costs distance in proportion to the yaw rate.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::BodyMotion;

/// Turn loss.
pub(super) struct TurnLoss;

impl EffectModel for TurnLoss {
    const INFO: EffectInfo = EffectInfo {
        number: 15,
        name: "turn_loss",
        summary: "turn loss",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("coefficient_s", "s", (-2.0, 2.0), Relevance::Size(0.002))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dx = -coefficient_s |w| v",
        confounded_with: "wheel_radius_error, lateral_skid",
        broken_by: "arcs against straights at one speed",
    };

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        let motion = &context.motion;
        signal.forward_m -= values[0] * motion.yaw_rate_rad_s.abs() * motion.speed_m_s * context.step_s;
    }
}
