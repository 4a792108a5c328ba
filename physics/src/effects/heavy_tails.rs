//! Entry 45. Range and bearing errors follow Student's t instead of a Gaussian, at the declared scale.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::scalar::Scalar;
use crate::signal::Noise;

/// Heavy-tailed outliers.
pub(super) struct HeavyTails;

impl EffectModel for HeavyTails {
    const INFO: EffectInfo = EffectInfo {
        number: 45,
        name: "heavy_tails",
        summary: "heavy-tailed outliers",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[Parameter::grid("degrees_of_freedom", "1", f64::INFINITY, (1.0, 100.0))],
        channels: &[Channel::Relative],
        equation: "error ~ sigma t(degrees_of_freedom)",
        confounded_with: "push, identity_mix_up",
        broken_by: "static",
    };

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        signal.degrees_of_freedom = signal.degrees_of_freedom.min(values[0]);
    }
}
