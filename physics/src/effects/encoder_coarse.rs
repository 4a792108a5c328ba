//! Entry 22. The encoder counts fewer ticks per turn than declared; 0 stands for as declared.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::scalar::Scalar;
use crate::signal::EncoderReading;

/// Encoder quantization.
pub(super) struct EncoderCoarse;

impl EffectModel for EncoderCoarse {
    const INFO: EffectInfo = EffectInfo {
        number: 22,
        name: "encoder_coarse",
        summary: "encoder quantization",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::grid("actual_ticks_per_rev", "1", 0.0, (0.0, 1e5))],
        channels: &[Channel::Encoders],
        equation: "angle rounded down to 2 pi / actual_ticks_per_rev",
        confounded_with: "noise",
        broken_by: "slow constant speed",
    };

    fn encoder<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut EncoderReading<S>) {
        if values[0] > 0.0 {
            signal.ticks_per_rev = values[0];
        }
    }
}
