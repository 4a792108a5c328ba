//! Entry 28. The gyro reads a multiple of the rate.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GyroReading;

/// Gyro scale.
pub(super) struct GyroScale;

impl EffectModel for GyroScale {
    const INFO: EffectInfo = EffectInfo {
        number: 28,
        name: "gyro_scale",
        summary: "gyro scale",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.2, 0.2), Relevance::Size(0.002))],
        channels: &[Channel::Gyro, Channel::Encoders],
        equation: "measured = (1 + relative) w",
        confounded_with: "track_width_error",
        broken_by: "absolute heading",
    };

    fn gyro<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut GyroReading<S>) {
        signal.rate_rad_s += values[0] * context.motion.yaw_rate_rad_s;
    }
}
