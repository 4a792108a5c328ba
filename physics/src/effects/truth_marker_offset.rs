//! Entry 50. The reference system tracks a marker that is not on the axle midpoint or not aligned with the
//! body.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::TruthReading;

/// Truth-marker offset or yaw.
pub(super) struct TruthMarkerOffset;

impl EffectModel for TruthMarkerOffset {
    const INFO: EffectInfo = EffectInfo {
        number: 50,
        name: "truth_marker_offset",
        summary: "truth-marker offset or yaw",
        stage: Stage::Sensor,
        bad_data: true,
        parameters: &[
            Parameter::smooth("offset_body_m", "m", (-0.5, 0.5), Relevance::Size(0.004)).component("forward"),
            Parameter::smooth("offset_body_m", "m", (-0.5, 0.5), Relevance::Size(0.004)).component("left"),
            Parameter::smooth("yaw_rad", "rad", (-0.5, 0.5), Relevance::Size(0.003)),
        ],
        channels: &[Channel::Truth],
        equation: "dx = -left w, dy = forward w; dy = -v sin(yaw_rad)",
        confounded_with: "lateral_skid, icr_offset at constant v",
        broken_by: "spin; straight",
    };

    fn truth<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut TruthReading<S>) {
        signal.lever_m[0] += values[0];
        signal.lever_m[1] += values[1];
        signal.yaw_rad += values[2];
    }
}
