//! Entry 31. Magnetized parts of the robot add a field that turns with it, given as a share of the Earth's
//! horizontal field, which points along the map's y axis (north). Exact, not only for a small share.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::HeadingReading;

/// Compass hard iron.
pub(super) struct CompassHardIron;

impl EffectModel for CompassHardIron {
    const INFO: EffectInfo = EffectInfo {
        number: 31,
        name: "compass_hard_iron",
        summary: "compass hard iron",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("body_field_fraction", "1", (-0.5, 0.5), Relevance::Size(0.004))
                .component("forward"),
            Parameter::smooth("body_field_fraction", "1", (-0.5, 0.5), Relevance::Size(0.004))
                .component("left"),
        ],
        channels: &[Channel::Heading],
        equation: "tan(error) = (f cos h - l sin h) / (1 + f sin h + l cos h), [f, l] = body_field_fraction",
        confounded_with: "landmark map bias",
        broken_by: "slow full turns",
    };

    fn heading<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut HeadingReading<S>) {
        let (forward, left) = (values[0], values[1]);
        let (sin, cos) = context.heading_rad().sin_cos();
        let across = forward * cos - left * sin;
        signal.heading_rad += across.atan2(forward * sin + left * cos + 1.0);
    }
}
