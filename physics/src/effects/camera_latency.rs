//! Entry 49. Range and bearing are older than their stamps; the target is seen from where the robot was.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::SightingGeometry;

/// Camera latency.
pub(super) struct CameraLatency;

impl EffectModel for CameraLatency {
    const INFO: EffectInfo = EffectInfo {
        number: 49,
        name: "camera_latency",
        summary: "camera latency",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("latency_s", "s", (-0.1, 0.5), Relevance::Size(0.005))],
        channels: &[Channel::Relative],
        equation: "bearing + latency_s (w - v sin b / r), range + latency_s v cos b",
        confounded_with: "sensor_yaw_misalignment if w has one sign",
        broken_by: "both signs of w",
    };

    fn sighting_geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SightingGeometry<S>) {
        signal.latency_s += values[0];
    }
}
