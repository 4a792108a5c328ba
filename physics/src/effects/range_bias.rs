//! Entry 40. Ranges are too long by a constant.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// Range bias.
pub(super) struct RangeBias;

impl EffectModel for RangeBias {
    const INFO: EffectInfo = EffectInfo {
        number: 40,
        name: "range_bias",
        summary: "range bias",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::smooth("bias_m", "m", (-1.0, 1.0), Relevance::Size(0.006))],
        channels: &[Channel::Relative],
        equation: "measured = r + bias_m",
        confounded_with: "range_scale at one range",
        broken_by: "near-far run",
    };

    fn sighting<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Sighting<S>) {
        signal.range_m += values[0];
    }
}
