//! Entry 1. The left wheel rolls farther per turn than the right: `E_d` of `borenstein1996`, here about the
//! mean, so that the mean radius stays nominal. In place, the turned angle is unchanged and the centre
//! shifts.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Unequal wheel diameters.
pub(super) struct UnequalWheelRadii;

impl EffectModel for UnequalWheelRadii {
    const INFO: EffectInfo = EffectInfo {
        number: 1,
        name: "unequal_wheel_radii",
        summary: "unequal wheel diameters",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("ratio", "1", (-0.05, 0.05), Relevance::Size(1.5e-3))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "r_left = r (1 + ratio/2), r_right = r (1 - ratio/2); dw = -ratio v / b",
        confounded_with: "gyro bias at one speed; steer trim",
        broken_by: "two speeds, reverse, standstill",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        let half = values[0] * 0.5;
        signal.wheel_radius_m[0] *= half + 1.0;
        signal.wheel_radius_m[1] *= -half + 1.0;
    }
}
