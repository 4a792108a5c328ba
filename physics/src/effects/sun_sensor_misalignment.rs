//! Entry 34. The sun sensor is mounted at an angle about the vertical.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::HeadingReading;

/// Sun-sensor misalignment.
pub(super) struct SunSensorMisalignment;

impl EffectModel for SunSensorMisalignment {
    const INFO: EffectInfo = EffectInfo {
        number: 34,
        name: "sun_sensor_misalignment",
        summary: "sun-sensor misalignment",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("rad", "rad", (-0.5, 0.5), Relevance::Size(0.004))],
        channels: &[Channel::Heading],
        equation: "error = rad",
        confounded_with: "map yaw; heading_offset (identical)",
        broken_by: "different hours",
    };

    fn heading<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut HeadingReading<S>) {
        signal.heading_rad += values[0];
    }
}
