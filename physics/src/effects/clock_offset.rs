//! Entry 10. The robot's clock is ahead of common time; its readings are older than their stamps.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Stamp;

/// Clock offset.
pub(super) struct ClockOffset;

impl EffectModel for ClockOffset {
    const INFO: EffectInfo = EffectInfo {
        number: 10,
        name: "clock_offset",
        summary: "clock offset",
        stage: Stage::Clock,
        bad_data: true,
        parameters: &[Parameter::smooth("offset_s", "s", (-1.0, 1.0), Relevance::Size(0.003))],
        channels: &[Channel::Truth],
        equation: "stamp = offset_s + t",
        confounded_with: "command delay; truth_latency (identical for one robot)",
        broken_by: "mutual sighting while both turn",
    };

    fn clock<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Stamp<S>) {
        signal.stamp_s += values[0];
    }
}
