//! Entry 20. At one instant something moves the robot; no wheel notices.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::MapMotion;

/// Bump, collision, kidnapping.
pub(super) struct Push;

impl EffectModel for Push {
    const INFO: EffectInfo = EffectInfo {
        number: 20,
        name: "push",
        summary: "bump, collision, kidnapping",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::grid("t_on_s", "s", 0.0, (0.0, 1e5)),
            Parameter::smooth("jump", "m", (-10.0, 10.0), Relevance::Size(0.02)).component("x"),
            Parameter::smooth("jump", "m", (-10.0, 10.0), Relevance::Size(0.02)).component("y"),
            Parameter::smooth("jump", "rad", (-3.2, 3.2), Relevance::Size(0.02)).component("yaw"),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "at t_on_s the pose jumps by (x, y, yaw) in the map",
        confounded_with: "GPS jump, identity swap",
        broken_by: "does a second sensor agree?",
    };

    fn world<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut MapMotion<S>) {
        let end_s = context.time_s + context.step_s.value();
        if (context.time_s..end_s).contains(&values[0].value()) {
            signal.shift_m[0] += values[1];
            signal.shift_m[1] += values[2];
            signal.yaw_rad += values[3];
        }
    }
}
