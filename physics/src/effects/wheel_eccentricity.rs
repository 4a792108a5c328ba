//! Entry 24. A wheel's axle is off its centre: the rolling radius varies with the wheel's angle.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Rolling;

/// Wheel eccentricity.
pub(super) struct WheelEccentricity;

impl EffectModel for WheelEccentricity {
    const INFO: EffectInfo = EffectInfo {
        number: 24,
        name: "wheel_eccentricity",
        summary: "wheel eccentricity",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[
            Parameter::choice("wheel", (0.0, 1.0)),
            Parameter::smooth("offset_m", "m", (-0.01, 0.01), Relevance::Size(3e-4)),
            Parameter::smooth("phase_rad", "rad", (-3.2, 3.2), Relevance::Unbounded),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "r + offset_m cos(theta + phase_rad), theta the angle of the wheel",
        confounded_with: "floor tiles",
        broken_by: "change speed: fixed in path, not in time",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        let wheel = usize::from(values[0].value() > 0.5);
        let before = context.motion.wheel_angle_rad[wheel] + values[2];
        let after = before + signal.turned_rad[wheel];
        signal.rolled_m[wheel] += values[1] * (after.sin() - before.sin());
    }
}
