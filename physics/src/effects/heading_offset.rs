//! Entry 58. The heading sensor's north is not the map's.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::HeadingReading;

/// Compass declination, constant heading offset.
pub(super) struct HeadingOffset;

impl EffectModel for HeadingOffset {
    const INFO: EffectInfo = EffectInfo {
        number: 58,
        name: "heading_offset",
        summary: "compass declination, constant heading offset",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("rad", "rad", (-3.2, 3.2), Relevance::Size(0.004))],
        channels: &[Channel::Heading],
        equation: "error = rad",
        confounded_with: "map rotation, sensor_yaw_misalignment",
        broken_by: "surveyed map or GPS track",
    };

    fn heading<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut HeadingReading<S>) {
        signal.heading_rad += values[0];
    }
}
