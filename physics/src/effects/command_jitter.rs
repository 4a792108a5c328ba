//! Entry 57. The delay of a command is uniform from zero to `delay_s`; half of it is the mean, which a
//! declared servo time constant may already contain.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{CommandTiming, Noise};

/// The standard deviation of a uniform distribution on `[0, 1]`: `1/sqrt(12)`.
const UNIFORM_SIGMA: f64 = 0.288_675_134_594_812_9;

/// Jittering commands.
pub(super) struct CommandJitter;

impl EffectModel for CommandJitter {
    const INFO: EffectInfo = EffectInfo {
        number: 57,
        name: "command_jitter",
        summary: "jittering commands",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::smooth("delay_s", "s", (0.0, 0.2), Relevance::CommandLag(0.001))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "u(t - D), D ~ U(0, delay_s)",
        confounded_with: "command_delay",
        broken_by: "log of executed commands",
    };

    fn command_timing<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut CommandTiming<S>) {
        signal.delay_s += values[0] * context.chance.uniform;
    }

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        signal.command_delay_sigma_s += values[0] * UNIFORM_SIGMA;
    }
}
