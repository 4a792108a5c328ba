//! Entry 7. After a reversal the castors swing round and push the body aside; the kick dies out with the
//! path driven, not with time. It is to the left after a change to forward motion, to the right after one
//! to reverse.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::BodyMotion;

/// Castor swing drag.
pub(super) struct CastorFriction;

impl EffectModel for CastorFriction {
    const INFO: EffectInfo = EffectInfo {
        number: 7,
        name: "castor_friction",
        summary: "castor swing drag",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[
            Parameter::smooth("heading_kick_rad", "rad", (-0.3, 0.3), Relevance::Size(0.004)),
            Parameter::smooth("decay_m", "m", (0.005, 0.5), Relevance::Unbounded).off_at(0.03),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "after a reversal dw = direction heading_kick_rad / decay_m exp(-s / decay_m) |v|, s the path since then",
        confounded_with: "stiction",
        broken_by: "reversals with several pauses",
    };

    fn body<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut BodyMotion<S>) {
        let Some(since_m) = signal.castor.since_reversal_m else { return };
        let (kick, decay_m) = (values[0], values[1]);
        let until_m = since_m + signal.forward_m.abs();
        let from_m = since_m.max(S::zero());
        let share = (-from_m / decay_m).exp() - (-until_m / decay_m).exp();
        signal.yaw_rad += kick * share * f64::from(signal.castor.direction);
    }
}
