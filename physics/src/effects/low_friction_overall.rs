//! Entry 19. The floor is slippery everywhere: wheels slip lengthwise and sideways.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{BodyMotion, Rolling};

/// Slippery floor.
pub(super) struct LowFrictionOverall;

impl EffectModel for LowFrictionOverall {
    const INFO: EffectInfo = EffectInfo {
        number: 19,
        name: "low_friction_overall",
        summary: "slippery floor",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::smooth("slip_s", "s", (-0.5, 0.5), Relevance::Size(0.004)),
            Parameter::smooth("skid_s", "s", (-0.5, 0.5), Relevance::LateralSlip(0.005)),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dx = -slip_s a, dy = -skid_s v w",
        confounded_with: "longitudinal_slip with lateral_skid (identical on one robot)",
        broken_by: "robots with different tyres",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        let gained_m_s = context.motion.acceleration_m_s2 * context.step_s;
        signal.add_to_both(-values[0] * gained_m_s);
    }

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        let motion = &context.motion;
        signal.left_m -= values[1] * motion.speed_m_s * motion.yaw_rate_rad_s * context.step_s;
    }
}
