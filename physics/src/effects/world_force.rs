//! Entry 21. A force fixed in the map makes a velocity servo give way; the same droop as a slope. Equal
//! acceleration on robots of different mass favours a slope.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Servo;

/// Wind on a wheeled robot.
pub(super) struct WorldForce;

impl EffectModel for WorldForce {
    const INFO: EffectInfo = EffectInfo {
        number: 21,
        name: "world_force",
        summary: "wind on a wheeled robot",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::smooth("droop_m_s", "m/s", (-0.2, 0.2), Relevance::Size(8e-4)),
            Parameter::smooth("azimuth_rad", "rad", (-3.2, 3.2), Relevance::Unbounded),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "v = u + droop_m_s cos(azimuth_rad - h)",
        confounded_with: "floor_tilt (identical on one robot), map rotation",
        broken_by: "opposite headings, same place; robots of different mass",
    };

    fn servo<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Servo<S>) {
        signal.droop_m_s += values[0] * (values[1] - context.heading_rad()).cos();
    }
}
