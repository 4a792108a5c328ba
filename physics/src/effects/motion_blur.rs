//! Entry 48. The spread of bearings grows with the yaw rate; the value, an exposure time, adds to the
//! declared standard deviation.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Noise;

/// Motion blur.
pub(super) struct MotionBlur;

impl EffectModel for MotionBlur {
    const INFO: EffectInfo = EffectInfo {
        number: 48,
        name: "motion_blur",
        summary: "motion blur",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("s", "s", (-0.1, 0.1), Relevance::Size(0.002))],
        channels: &[Channel::Relative],
        equation: "sigma_b = declared + s |w|",
        confounded_with: "camera_latency",
        broken_by: "spin both ways",
    };

    fn noise<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Noise<S>) {
        signal.bearing_sigma_rad += values[0] * context.motion.yaw_rate_rad_s.abs();
    }
}
