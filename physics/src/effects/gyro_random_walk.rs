//! Entry 29. The bias of the gyro wanders: its increments are independent, with this density.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{GyroReading, Noise};

/// Gyro random walk.
pub(super) struct GyroRandomWalk;

impl EffectModel for GyroRandomWalk {
    const INFO: EffectInfo = EffectInfo {
        number: 29,
        name: "gyro_random_walk",
        summary: "gyro random walk",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("rad_s_sqrt_s", "rad/s/sqrt(s)", (0.0, 0.01), Relevance::Size(5e-5))],
        channels: &[Channel::Gyro],
        equation: "db = rad_s_sqrt_s dW",
        confounded_with: "gyro_thermal_drift",
        broken_by: "long standstill",
    };

    fn gyro<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut GyroReading<S>) {
        let step_s = libm::sqrt(context.step_s.value());
        signal.walk_rad_s += values[0] * (step_s * context.chance.normal);
        signal.rate_rad_s += signal.walk_rad_s;
    }

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        signal.gyro_walk_variance += values[0].square();
    }
}
