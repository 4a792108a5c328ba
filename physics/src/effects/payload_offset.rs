//! Entry 16. A load beside the middle presses one tyre flatter than the other and moves the contact points.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Off-centre payload.
pub(super) struct PayloadOffset;

impl EffectModel for PayloadOffset {
    const INFO: EffectInfo = EffectInfo {
        number: 16,
        name: "payload_offset",
        summary: "off-centre payload",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[
            Parameter::smooth("ratio", "1", (-0.05, 0.05), Relevance::Size(1.5e-3)),
            Parameter::smooth("track_relative", "1", (-0.2, 0.2), Relevance::Size(0.003)),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "unequal_wheel_radii by ratio and track_width_error by track_relative",
        confounded_with: "unequal_wheel_radii with track_width_error (identical without an onset)",
        broken_by: "with and without the load",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        let half = values[0] * 0.5;
        signal.wheel_radius_m[0] *= half + 1.0;
        signal.wheel_radius_m[1] *= -half + 1.0;
        signal.track_width_m *= values[1] + 1.0;
    }
}
