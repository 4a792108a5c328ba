//! Entry 32. Iron in the robot bends the Earth's field: an error of two periods per turn.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::HeadingReading;

/// Compass soft iron.
pub(super) struct CompassSoftIron;

impl EffectModel for CompassSoftIron {
    const INFO: EffectInfo = EffectInfo {
        number: 32,
        name: "compass_soft_iron",
        summary: "compass soft iron",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("amplitude_rad", "rad", (-0.5, 0.5), Relevance::Size(0.004)),
            Parameter::smooth("phase_rad", "rad", (-1.6, 1.6), Relevance::Unbounded),
        ],
        channels: &[Channel::Heading],
        equation: "error = amplitude_rad sin 2(h - phase_rad)",
        confounded_with: "compass_hard_iron on half circles",
        broken_by: "full turns",
    };

    fn heading<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut HeadingReading<S>) {
        let twice = (context.heading_rad() - values[1]) * 2.0;
        signal.heading_rad += values[0] * twice.sin();
    }
}
