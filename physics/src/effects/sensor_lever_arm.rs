//! Entry 38. The range sensor sits elsewhere on the robot than declared.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SightingGeometry;

/// Sensor mount offset (lever arm).
pub(super) struct SensorLeverArm;

impl EffectModel for SensorLeverArm {
    const INFO: EffectInfo = EffectInfo {
        number: 38,
        name: "sensor_lever_arm",
        summary: "sensor mount offset (lever arm)",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("offset_body_m", "m", (-0.5, 0.5), Relevance::Size(0.008)).component("forward"),
            Parameter::smooth("offset_body_m", "m", (-0.5, 0.5), Relevance::Size(0.008)).component("left"),
        ],
        channels: &[Channel::Relative],
        equation: "seen from p + R(h) offset_body_m",
        confounded_with: "sensor_yaw_misalignment at one range",
        broken_by: "vary range and aspect",
    };

    fn sighting_geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SightingGeometry<S>) {
        for (lever, offset) in signal.lever_m.iter_mut().zip(values) {
            *lever += *offset;
        }
    }
}
