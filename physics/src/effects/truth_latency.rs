//! Entry 51. The reference pose is older than its stamp.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::TruthReading;

/// Truth latency.
pub(super) struct TruthLatency;

impl EffectModel for TruthLatency {
    const INFO: EffectInfo = EffectInfo {
        number: 51,
        name: "truth_latency",
        summary: "truth latency",
        stage: Stage::Sensor,
        bad_data: true,
        parameters: &[Parameter::smooth("latency_s", "s", (-0.2, 0.5), Relevance::SensorLag(0.002))],
        channels: &[Channel::Truth],
        equation: "measured = pose(t - latency_s)",
        confounded_with: "actuator_lag, command_delay; clock_offset (identical for one robot)",
        broken_by: "delay between on-board sensors",
    };

    fn truth<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut TruthReading<S>) {
        signal.latency_s += values[0];
    }
}
