//! Entry 9. A command takes effect later than its stamp says.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::CommandTiming;

/// Transport delay.
pub(super) struct CommandDelay;

impl EffectModel for CommandDelay {
    const INFO: EffectInfo = EffectInfo {
        number: 9,
        name: "command_delay",
        summary: "transport delay",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::grid("delay_s", "s", 0.0, (-0.05, 0.5)).relevant_from(Relevance::CommandLag(0.001))
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "u(t - delay_s)",
        confounded_with: "clock offset",
        broken_by: "step; a second sensor",
    };

    fn command_timing<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut CommandTiming<S>) {
        signal.delay_s += values[0];
    }
}
