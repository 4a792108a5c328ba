//! Entry 23. After a reversal the shaft crosses its play before the wheel follows: the play operator of
//! hysteresis theory.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Transmission;

/// Backlash.
pub(super) struct Backlash;

impl EffectModel for Backlash {
    const INFO: EffectInfo = EffectInfo {
        number: 23,
        name: "backlash",
        summary: "backlash",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[Parameter::smooth("rad", "rad", (0.0, 0.2), Relevance::Size(0.003))],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "the wheel moves when its shaft is more than rad/2 from the middle of its play",
        confounded_with: "motor_deadband",
        broken_by: "micro-reversals",
    };

    fn transmission<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Transmission<S>) {
        let half = values[0] * 0.5;
        for (turned, play) in signal.turned_rad.iter_mut().zip(&mut signal.play_rad) {
            let shaft = *play + *turned;
            *play = shaft.clamp(-half, half);
            *turned = shaft - *play;
        }
    }
}
