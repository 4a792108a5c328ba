//! Entry 6. The body turns about a point that lies ahead of the axle midpoint by `offset_m`; the midpoint
//! moves sideways in every turn.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::BodyMotion;

/// Offset of the instantaneous centre of rotation.
pub(super) struct IcrOffset;

impl EffectModel for IcrOffset {
    const INFO: EffectInfo = EffectInfo {
        number: 6,
        name: "icr_offset",
        summary: "offset of the instantaneous centre of rotation",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("offset_m", "m", (-0.3, 0.3), Relevance::Size(0.004))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dy = -offset_m w",
        confounded_with: "truth_marker_offset (identical without a second sensor), gps_lever_arm",
        broken_by: "spin in place, two sensors",
    };

    fn body<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut BodyMotion<S>) {
        signal.left_m -= values[0] * context.motion.yaw_rate_rad_s * context.step_s;
    }
}
