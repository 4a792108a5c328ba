//! Entry 18. Gravity along a tilted floor pulls downhill; a velocity servo gives way by its time constant
//! times the acceleration, so the wheels turn faster downhill and slower uphill.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::GRAVITY_M_S2;
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Servo;

/// Slope (gravity).
pub(super) struct FloorTilt;

impl EffectModel for FloorTilt {
    const INFO: EffectInfo = EffectInfo {
        number: 18,
        name: "floor_tilt",
        summary: "slope (gravity)",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::smooth("slope_rad", "rad", (-0.2, 0.2), Relevance::Slope(8e-4)),
            Parameter::smooth("downhill_azimuth_rad", "rad", (-3.2, 3.2), Relevance::Unbounded),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "v = u + tau g sin(slope_rad) cos(downhill_azimuth_rad - h)",
        confounded_with: "world_force on one robot, map rotation",
        broken_by: "turn in place per site",
    };

    fn servo<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Servo<S>) {
        let along = (values[1] - context.heading_rad()).cos();
        signal.droop_m_s += signal.time_constant_s * values[0].sin() * along * GRAVITY_M_S2;
    }
}
