//! Entry 25. The steered wheels stand at an angle when they are said to be straight.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Steer trim (car-like).
pub(super) struct SteerTrim;

impl EffectModel for SteerTrim {
    const INFO: EffectInfo = EffectInfo {
        number: 25,
        name: "steer_trim",
        summary: "steer trim (car-like)",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("rad", "rad", (-0.1, 0.1), Relevance::Size(0.001))],
        channels: &[Channel::Encoders, Channel::Steer, Channel::Truth],
        equation: "w = v tan(steer + rad) / L",
        confounded_with: "unequal_wheel_radii",
        broken_by: "steer sweep",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        signal.steer_offset_rad += values[0];
    }
}
