//! Entry 13. No wheel turns faster than its motor can.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::scalar::Scalar;
use crate::signal::WheelSetPoint;

/// Saturation of wheel speed.
pub(super) struct SpeedSaturation;

impl EffectModel for SpeedSaturation {
    const INFO: EffectInfo = EffectInfo {
        number: 13,
        name: "speed_saturation",
        summary: "saturation of wheel speed",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::grid("wheel_speed_max_rad_s", "rad/s", f64::INFINITY, (0.1, 200.0))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "|u_wheel| <= wheel_speed_max_rad_s",
        confounded_with: "actuator_lag",
        broken_by: "amplitude sweep",
    };

    fn wheel_set_point<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut WheelSetPoint<S>) {
        for speed in &mut signal.speed_rad_s {
            *speed = speed.clamp(-values[0], values[0]);
        }
    }
}
