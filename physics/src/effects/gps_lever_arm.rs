//! Entry 35. The antenna sits elsewhere on the robot than declared.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GpsReading;

/// GPS lever arm.
pub(super) struct GpsLeverArm;

impl EffectModel for GpsLeverArm {
    const INFO: EffectInfo = EffectInfo {
        number: 35,
        name: "gps_lever_arm",
        summary: "GPS lever arm",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("offset_body_m", "m", (-2.0, 2.0), Relevance::Size(0.02)).component("forward"),
            Parameter::smooth("offset_body_m", "m", (-2.0, 2.0), Relevance::Size(0.02)).component("left"),
        ],
        channels: &[Channel::Gps],
        equation: "measured = p + R(h) offset_body_m",
        confounded_with: "lateral_skid, icr_offset",
        broken_by: "spin in place",
    };

    fn gps<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut GpsReading<S>) {
        for (lever, offset) in signal.lever_m.iter_mut().zip(values) {
            *lever += *offset;
        }
    }
}
