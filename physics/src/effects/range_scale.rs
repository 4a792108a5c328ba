//! Entry 41. Ranges are too long in proportion.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// Range scale.
pub(super) struct RangeScale;

impl EffectModel for RangeScale {
    const INFO: EffectInfo = EffectInfo {
        number: 41,
        name: "range_scale",
        summary: "range scale",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.2, 0.2), Relevance::Size(0.003))],
        channels: &[Channel::Relative],
        equation: "measured = (1 + relative) r",
        confounded_with: "wheel_radius_error, map scale",
        broken_by: "surveyed map",
    };

    fn sighting<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Sighting<S>) {
        signal.range_m *= values[0] + 1.0;
    }
}
