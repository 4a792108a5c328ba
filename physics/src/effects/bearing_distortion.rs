//! Entry 42. The lens draws angles apart: an odd polynomial in the bearing.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// Bearing distortion.
pub(super) struct BearingDistortion;

impl EffectModel for BearingDistortion {
    const INFO: EffectInfo = EffectInfo {
        number: 42,
        name: "bearing_distortion",
        summary: "bearing distortion",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("c1", "1", (-0.3, 0.3), Relevance::Size(0.003)),
            Parameter::smooth("c3", "1/rad^2", (-0.5, 0.5), Relevance::Size(0.003)),
        ],
        channels: &[Channel::Relative],
        equation: "bearing error = c1 b + c3 b^3",
        confounded_with: "sensor_yaw_misalignment in a narrow view",
        broken_by: "sweep the target",
    };

    fn sighting<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Sighting<S>) {
        let bearing = signal.bearing_rad;
        signal.bearing_rad += values[0] * bearing + values[1] * bearing.powi(3);
    }
}
