//! Entry 55. The wheels point to the left of the body's forward direction.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::BodyMotion;

/// Crab (wheel misalignment, toe).
pub(super) struct Crab;

impl EffectModel for Crab {
    const INFO: EffectInfo = EffectInfo {
        number: 55,
        name: "crab",
        summary: "crab (wheel misalignment, toe)",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("rad", "rad", (-0.2, 0.2), Relevance::Size(0.003))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dy = rad v",
        confounded_with: "truth_marker_offset (yaw)",
        broken_by: "two sensors; reverse",
    };

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        signal.left_m += values[0] * context.motion.speed_m_s * context.step_s;
    }
}
