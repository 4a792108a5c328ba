//! Entry 19. In one place of the map the floor is slippery: wheels slip lengthwise and sideways there. Any
//! other effect can be confined to a place by its scope.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::effects::places::inside;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{BodyMotion, Rolling};

/// Friction patch.
pub(super) struct LowFrictionPatch;

impl EffectModel for LowFrictionPatch {
    const INFO: EffectInfo = EffectInfo {
        number: 19,
        name: "low_friction_patch",
        summary: "friction patch",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_max"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_max"),
            Parameter::smooth("slip_s", "s", (-0.5, 0.5), Relevance::Size(0.004)),
            Parameter::smooth("skid_s", "s", (-0.5, 0.5), Relevance::LateralSlip(0.005)),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "inside region_m: dx = -slip_s a, dy = -skid_s v w",
        confounded_with: "an event in time",
        broken_by: "revisit the place",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        if inside(values, context) {
            let gained_m_s = context.motion.acceleration_m_s2 * context.step_s;
            signal.add_to_both(-values[4] * gained_m_s);
        }
    }

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        if inside(values, context) {
            let motion = &context.motion;
            signal.left_m -= values[5] * motion.speed_m_s * motion.yaw_rate_rad_s * context.step_s;
        }
    }
}
