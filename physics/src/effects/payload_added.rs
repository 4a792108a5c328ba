//! Entry 16. From an instant on a load presses the tyres flat, so that they roll less per turn, and makes
//! the servo slower.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{Geometry, Servo};

/// Payload and tyre compression.
pub(super) struct PayloadAdded;

impl EffectModel for PayloadAdded {
    const INFO: EffectInfo = EffectInfo {
        number: 16,
        name: "payload_added",
        summary: "payload and tyre compression",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[
            Parameter::grid("t_on_s", "s", 0.0, (0.0, 1e5)),
            Parameter::smooth("radius_relative", "1", (-0.05, 0.05), Relevance::Size(8e-4)),
            Parameter::smooth("lag_change_s", "s", (-0.02, 0.2), Relevance::LagChange(0.001)),
        ],
        channels: &[Channel::Command, Channel::Encoders, Channel::Truth],
        equation: "from t_on_s on: r (1 + radius_relative), tau + lag_change_s",
        confounded_with: "battery_sag; actuator_lag, if the onset is not modelled",
        broken_by: "odometry against command",
    };

    fn geometry<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Geometry<S>) {
        if context.time_s >= values[0].value() {
            for radius in &mut signal.wheel_radius_m {
                *radius *= values[1] + 1.0;
            }
        }
    }

    fn servo<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Servo<S>) {
        if context.time_s >= values[0].value() {
            signal.time_constant_s += values[2];
            signal.time_constant_turn_s += values[2];
        }
    }
}
