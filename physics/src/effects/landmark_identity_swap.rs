//! Entry 46. Two landmarks bear each other's number.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::effects::places::label;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::scalar::Scalar;
use crate::signal::{Identity, Target};

/// Two landmarks swapped.
pub(super) struct LandmarkIdentitySwap;

impl EffectModel for LandmarkIdentitySwap {
    const INFO: EffectInfo = EffectInfo {
        number: 46,
        name: "landmark_identity_swap",
        summary: "two landmarks swapped",
        stage: Stage::Identity,
        bad_data: true,
        parameters: &[
            Parameter::choice("ids", (0.0, 1e5)).component("first"),
            Parameter::choice("ids", (0.0, 1e5)).component("second"),
        ],
        channels: &[Channel::Relative],
        equation: "landmark ids[0] is reported as ids[1] and the reverse",
        confounded_with: "heavy_tails; landmark_survey_error",
        broken_by: "one target at a time",
    };

    fn identity<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Identity<'_>) {
        let Target::Landmark(id) = signal.target else { return };
        let (first, second) = (label(values[0]), label(values[1]));
        if id == first {
            signal.target = Target::Landmark(second);
        } else if id == second {
            signal.target = Target::Landmark(first);
        }
    }
}
