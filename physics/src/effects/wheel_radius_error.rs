//! Entry 3. Both wheels roll farther per turn than believed: `E_s` of `borenstein1996`.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Mean wheel diameter, scale.
pub(super) struct WheelRadiusError;

impl EffectModel for WheelRadiusError {
    const INFO: EffectInfo = EffectInfo {
        number: 3,
        name: "wheel_radius_error",
        summary: "mean wheel diameter, scale",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.1, 0.1), Relevance::Size(0.001))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dx = relative v and dw = relative w",
        confounded_with: "range scale, map scale",
        broken_by: "surveyed baseline",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        for radius in &mut signal.wheel_radius_m {
            *radius *= values[0] + 1.0;
        }
    }
}
