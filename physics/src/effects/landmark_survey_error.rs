//! Entry 52. One landmark stands elsewhere than the map says.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::effects::places::label;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{SightingGeometry, Target};

/// Landmark survey error.
pub(super) struct LandmarkSurveyError;

impl EffectModel for LandmarkSurveyError {
    const INFO: EffectInfo = EffectInfo {
        number: 52,
        name: "landmark_survey_error",
        summary: "landmark survey error",
        stage: Stage::Sensor,
        bad_data: true,
        parameters: &[
            Parameter::choice("id", (0.0, 1e5)),
            Parameter::smooth("offset_m", "m", (-1.0, 1.0), Relevance::Size(0.01)).component("x"),
            Parameter::smooth("offset_m", "m", (-1.0, 1.0), Relevance::Size(0.01)).component("y"),
        ],
        channels: &[Channel::Relative],
        equation: "landmark id is at its surveyed place + offset_m",
        confounded_with: "sensor_yaw_misalignment",
        broken_by: "two viewpoints",
    };

    fn sighting_geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SightingGeometry<S>) {
        if signal.target == Target::Landmark(label(values[0])) {
            signal.target_m[0] += values[1];
            signal.target_m[1] += values[2];
        }
    }
}
