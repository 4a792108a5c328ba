//! Entry 57. A command never arrives and the one before it holds on.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{CommandTiming, Noise};

/// Lost commands.
pub(super) struct CommandLoss;

impl EffectModel for CommandLoss {
    const INFO: EffectInfo = EffectInfo {
        number: 57,
        name: "command_loss",
        summary: "lost commands",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::smooth("probability", "1", (0.0, 1.0), Relevance::Size(0.005))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "with probability the previous command holds",
        confounded_with: "command_delay",
        broken_by: "log of executed commands",
    };

    fn command_timing<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut CommandTiming<S>) {
        signal.lost |= values[0] > context.chance.uniform;
    }

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        signal.command_loss_probability += values[0];
    }
}
