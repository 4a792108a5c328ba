//! Entry 10. The robot's clock runs faster than common time.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Stamp;

/// Clock drift.
pub(super) struct ClockDrift;

impl EffectModel for ClockDrift {
    const INFO: EffectInfo = EffectInfo {
        number: 10,
        name: "clock_drift",
        summary: "clock drift",
        stage: Stage::Clock,
        bad_data: true,
        parameters: &[Parameter::smooth("ppm", "1e-6", (-1000.0, 1000.0), Relevance::Size(60.0))],
        channels: &[Channel::Truth],
        equation: "stamp = (1 + ppm 1e-6) t",
        confounded_with: "command delay",
        broken_by: "mutual sighting while both turn; a long run",
    };

    fn clock<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Stamp<S>) {
        signal.stamp_s += values[0] * (1e-6 * context.time_s);
    }
}
