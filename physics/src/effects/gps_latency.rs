//! Entry 36. The position is older than its stamp.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GpsReading;

/// GPS latency.
pub(super) struct GpsLatency;

impl EffectModel for GpsLatency {
    const INFO: EffectInfo = EffectInfo {
        number: 36,
        name: "gps_latency",
        summary: "GPS latency",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("latency_s", "s", (-0.2, 1.0), Relevance::Size(0.02))],
        channels: &[Channel::Gps],
        equation: "measured = p(t - latency_s)",
        confounded_with: "gps_lever_arm forward",
        broken_by: "reverse; change speed",
    };

    fn gps<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut GpsReading<S>) {
        signal.latency_s += values[0];
    }
}
