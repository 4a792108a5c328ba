//! Entry 44. Ranges are too long towards the edge of the field of view.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// Bearing-dependent range bias.
pub(super) struct BearingDependentRangeBias;

impl EffectModel for BearingDependentRangeBias {
    const INFO: EffectInfo = EffectInfo {
        number: 44,
        name: "bearing_dependent_range_bias",
        summary: "bearing-dependent range bias",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("m_per_rad2", "m/rad^2", (-0.5, 0.5), Relevance::Size(0.006))],
        channels: &[Channel::Relative],
        equation: "range error = m_per_rad2 b^2",
        confounded_with: "bearing_distortion",
        broken_by: "static sweep",
    };

    fn sighting<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Sighting<S>) {
        signal.range_m += values[0] * signal.bearing_rad.square();
    }
}
