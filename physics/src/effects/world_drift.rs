//! Entry 21. The medium carries the robot with it, whatever its drive does.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::MapMotion;

/// Wind or current on a hull or a wing.
pub(super) struct WorldDrift;

impl EffectModel for WorldDrift {
    const INFO: EffectInfo = EffectInfo {
        number: 21,
        name: "world_drift",
        summary: "wind or current on a hull or a wing",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::smooth("velocity_m_s", "m/s", (-1.0, 1.0), Relevance::Size(0.004)).component("x"),
            Parameter::smooth("velocity_m_s", "m/s", (-1.0, 1.0), Relevance::Size(0.004)).component("y"),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "the position drifts by velocity_m_s in the map: d = R(h)' velocity_m_s",
        confounded_with: "floor_tilt with slipping wheels, map rotation",
        broken_by: "opposite headings, same place",
    };

    fn world<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut MapMotion<S>) {
        for (shift, velocity) in signal.shift_m.iter_mut().zip(values) {
            *shift += *velocity * context.step_s;
        }
    }
}
