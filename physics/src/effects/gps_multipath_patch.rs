//! Entry 37. In one place of the map reflections shift the position.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::effects::places::inside;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::GpsReading;

/// GPS multipath patch.
pub(super) struct GpsMultipathPatch;

impl EffectModel for GpsMultipathPatch {
    const INFO: EffectInfo = EffectInfo {
        number: 37,
        name: "gps_multipath_patch",
        summary: "GPS multipath patch",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("x_max"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_min"),
            Parameter::grid("region_m", "m", 0.0, (-1e4, 1e4)).component("y_max"),
            Parameter::smooth("offset_m", "m", (-50.0, 50.0), Relevance::Size(0.02)).component("x"),
            Parameter::smooth("offset_m", "m", (-50.0, 50.0), Relevance::Size(0.02)).component("y"),
        ],
        channels: &[Channel::Gps],
        equation: "measured = p + offset_m inside region_m",
        confounded_with: "low_friction_patch",
        broken_by: "revisit; other robot",
    };

    fn gps<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut GpsReading<S>) {
        if inside(values, context) {
            signal.error_m[0] += values[4];
            signal.error_m[1] += values[5];
        }
    }
}
