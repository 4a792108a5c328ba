//! Entry 46. Now and then a sighting bears the name of another target in view.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{Identity, Noise};

/// Identity mix-up.
pub(super) struct IdentityMixUp;

impl EffectModel for IdentityMixUp {
    const INFO: EffectInfo = EffectInfo {
        number: 46,
        name: "identity_mix_up",
        summary: "identity mix-up",
        stage: Stage::Identity,
        bad_data: true,
        parameters: &[Parameter::smooth("probability", "1", (0.0, 1.0), Relevance::Size(0.001))],
        channels: &[Channel::Relative],
        equation: "with probability the name is drawn among the others in view",
        confounded_with: "heavy_tails",
        broken_by: "one target at a time",
    };

    fn identity<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Identity<'_>) {
        if values[0] <= context.chance.uniform || signal.others.is_empty() {
            return;
        }
        let count = signal.others.len();
        // The draw is in [0, 1), so the product is a valid position.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let position = (context.chance.choice * count as f64) as usize;
        signal.target = signal.others[position.min(count - 1)];
    }

    fn noise<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Noise<S>) {
        signal.wrong_identity_probability += values[0];
    }
}
