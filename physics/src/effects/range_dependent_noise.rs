//! Entry 43. The spread of ranges grows with range; the values add to the declared standard deviation.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Noise;

/// Range-dependent noise.
pub(super) struct RangeDependentNoise;

impl EffectModel for RangeDependentNoise {
    const INFO: EffectInfo = EffectInfo {
        number: 43,
        name: "range_dependent_noise",
        summary: "range-dependent noise",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("s0_m", "m", (-0.5, 0.5), Relevance::Size(0.003)),
            Parameter::smooth("s1", "1", (-0.2, 0.2), Relevance::Size(0.002)),
            Parameter::smooth("s2_per_m", "1/m", (-0.1, 0.1), Relevance::Size(0.001)),
        ],
        channels: &[Channel::Relative],
        equation: "sigma_r = declared + s0_m + s1 r + s2_per_m r^2",
        confounded_with: "heavy_tails",
        broken_by: "static near-far",
    };

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        let range = signal.range_m;
        signal.range_sigma_m += values[0] + values[1] * range + values[2] * range * range;
    }
}
