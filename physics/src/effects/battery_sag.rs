//! Entry 17. As the supply sags, wheels reach less of what is commanded: by the measured voltage, or by
//! time where there is none.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SetPoint;

/// Battery sag.
pub(super) struct BatterySag;

impl EffectModel for BatterySag {
    const INFO: EffectInfo = EffectInfo {
        number: 17,
        name: "battery_sag",
        summary: "battery sag",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::smooth("gain_per_v", "1/V", (-0.5, 0.5), Relevance::Size(0.002)),
            Parameter::smooth("gain_per_s", "1/s", (-0.01, 0.01), Relevance::Size(2e-5)),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "u (1 + gain_per_v (V - V0) + gain_per_s t)",
        confounded_with: "payload_added",
        broken_by: "log voltage; encoders",
    };

    fn set_point<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut SetPoint<S>) {
        let change_v = context.surroundings.voltage_change_v;
        let gain = values[0] * change_v + values[1] * context.time_s + 1.0;
        signal.speed_m_s *= gain;
        signal.yaw_rate_rad_s *= gain;
    }
}
