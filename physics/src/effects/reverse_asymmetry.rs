//! Entry 56. While the robot backs up, its wheels roll farther per turn.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Rolling;

/// Forward/reverse asymmetry.
pub(super) struct ReverseAsymmetry;

impl EffectModel for ReverseAsymmetry {
    const INFO: EffectInfo = EffectInfo {
        number: 56,
        name: "reverse_asymmetry",
        summary: "forward/reverse asymmetry",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.1, 0.1), Relevance::Size(0.001))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "where v < 0: dx = relative v, dw = relative w",
        confounded_with: "wheel_radius_error with one direction",
        broken_by: "both directions",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        if context.motion.speed_m_s < 0.0 {
            signal.scale_both(values[0] + 1.0);
        }
    }
}
