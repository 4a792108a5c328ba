//! Entry 30. While the gyro warms up its bias settles exponentially, like its temperature.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GyroReading;

/// Gyro temperature drift.
pub(super) struct GyroThermalDrift;

impl EffectModel for GyroThermalDrift {
    const INFO: EffectInfo = EffectInfo {
        number: 30,
        name: "gyro_thermal_drift",
        summary: "gyro temperature drift",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("final_bias_rad_s", "rad/s", (-0.1, 0.1), Relevance::Size(6e-4)),
            Parameter::smooth("time_constant_s", "s", (1.0, 5e3), Relevance::Unbounded).off_at(60.0),
        ],
        channels: &[Channel::Gyro],
        equation: "b = final_bias_rad_s (1 - exp(-t / time_constant_s))",
        confounded_with: "gyro_random_walk",
        broken_by: "log temperature",
    };

    fn gyro<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut GyroReading<S>) {
        let settled = (S::constant(-context.time_s) / values[1]).exp();
        signal.rate_rad_s += values[0] * (S::one() - settled);
    }
}
