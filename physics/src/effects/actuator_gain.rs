//! Entry 54. Wheels reach more or less than what is commanded, separately along and in turns.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SetPoint;

/// Actuator gain.
pub(super) struct ActuatorGain;

impl EffectModel for ActuatorGain {
    const INFO: EffectInfo = EffectInfo {
        number: 54,
        name: "actuator_gain",
        summary: "actuator gain",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::smooth("v_relative", "1", (-0.5, 0.5), Relevance::Size(0.003)),
            Parameter::smooth("w_relative", "1", (-0.5, 0.5), Relevance::Size(0.008)),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "v = (1 + v_relative) u_v, w = (1 + w_relative) u_w",
        confounded_with: "track_width_error, wheel_radius_error where there are no encoders",
        broken_by: "encoders, or truth with known geometry",
    };

    fn set_point<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SetPoint<S>) {
        signal.speed_m_s *= values[0] + 1.0;
        signal.yaw_rate_rad_s *= values[1] + 1.0;
    }
}
