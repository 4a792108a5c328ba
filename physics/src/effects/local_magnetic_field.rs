//! Entry 33. In one place of the map the field points elsewhere: a cable, a steel beam.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::effects::places::inside;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::HeadingReading;

/// Local magnetic field.
pub(super) struct LocalMagneticField;

impl EffectModel for LocalMagneticField {
    const INFO: EffectInfo = EffectInfo {
        number: 33,
        name: "local_magnetic_field",
        summary: "local magnetic field",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_max"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_max"),
            Parameter::smooth("amplitude_rad", "rad", (-3.2, 3.2), Relevance::Size(0.004)),
        ],
        channels: &[Channel::Heading],
        equation: "error = amplitude_rad inside region_m",
        confounded_with: "low_friction_patch",
        broken_by: "same place, motors off",
    };

    fn heading<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut HeadingReading<S>) {
        if inside(values, context) {
            signal.heading_rad += values[4];
        }
    }
}
