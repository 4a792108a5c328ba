//! Entry 5. Tyres creep sideways in proportion to the centripetal force: outwards, to the right in a left
//! turn.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::BodyMotion;

/// Lateral skid (centripetal).
pub(super) struct LateralSkid;

impl EffectModel for LateralSkid {
    const INFO: EffectInfo = EffectInfo {
        number: 5,
        name: "lateral_skid",
        summary: "lateral skid (centripetal)",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("skid_s", "s", (-0.3, 0.3), Relevance::LateralSlip(0.005))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dy = -skid_s v w",
        confounded_with: "sensor lever arm in x; abs(v) w",
        broken_by: "vary v at fixed w; reverse",
    };

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        let motion = &context.motion;
        signal.left_m -= values[0] * motion.speed_m_s * motion.yaw_rate_rad_s * context.step_s;
    }
}
