//! Entry 14. Wheels lose distance in proportion to the square of the speed, between encoder and ground.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Rolling;

/// Speed-dependent scale.
pub(super) struct SpeedDependentScale;

impl EffectModel for SpeedDependentScale {
    const INFO: EffectInfo = EffectInfo {
        number: 14,
        name: "speed_dependent_scale",
        summary: "speed-dependent scale",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("s_per_m", "s/m", (-0.3, 0.3), Relevance::Size(0.01))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dx = -s_per_m v |v|",
        confounded_with: "longitudinal_slip",
        broken_by: "constant-speed plateaus",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        let speed = context.motion.speed_m_s;
        signal.add_to_both(-values[0] * speed * speed.abs() * context.step_s);
    }
}
