//! Entry 27. The gyro reads a rate at rest.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GyroReading;

/// Gyro bias.
pub(super) struct GyroBias;

impl EffectModel for GyroBias {
    const INFO: EffectInfo = EffectInfo {
        number: 27,
        name: "gyro_bias",
        summary: "gyro bias",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("bias_rad_s", "rad/s", (-0.1, 0.1), Relevance::Size(6e-4))],
        channels: &[Channel::Gyro],
        equation: "measured = w + bias_rad_s",
        confounded_with: "unequal_wheel_radii",
        broken_by: "standstill",
    };

    fn gyro<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut GyroReading<S>) {
        signal.rate_rad_s += values[0];
    }
}
