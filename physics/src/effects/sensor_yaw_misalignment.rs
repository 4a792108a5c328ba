//! Entry 39. The range sensor looks to the left of where it is declared to look; targets appear to the
//! right.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SightingGeometry;

/// Sensor yaw misalignment.
pub(super) struct SensorYawMisalignment;

impl EffectModel for SensorYawMisalignment {
    const INFO: EffectInfo = EffectInfo {
        number: 39,
        name: "sensor_yaw_misalignment",
        summary: "sensor yaw misalignment",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("yaw_rad", "rad", (-0.5, 0.5), Relevance::Size(0.003))],
        channels: &[Channel::Relative],
        equation: "bearing residual = -yaw_rad",
        confounded_with: "heading bias",
        broken_by: "near and far, two targets",
    };

    fn sighting_geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SightingGeometry<S>) {
        signal.yaw_rad += values[0];
    }
}
