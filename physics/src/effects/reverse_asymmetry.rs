//! Entry 56. A wheel that turns backwards rolls farther per turn. By wheel and not by robot, so that a spin,
//! in which the robot's speed is zero but for roundings, is well defined: one wheel turns backwards.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Rolling;

/// Forward/reverse asymmetry.
pub(super) struct ReverseAsymmetry;

impl EffectModel for ReverseAsymmetry {
    const INFO: EffectInfo = EffectInfo {
        number: 56,
        name: "reverse_asymmetry",
        summary: "forward/reverse asymmetry",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.1, 0.1), Relevance::Size(0.001))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "a wheel with dtheta < 0 rolls r (1 + relative) dtheta; where both do: dx = relative v, dw = relative w",
        confounded_with: "wheel_radius_error with one direction",
        broken_by: "both directions",
    };

    fn rolling<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Rolling<S>) {
        for (rolled, turned) in signal.rolled_m.iter_mut().zip(signal.turned_rad) {
            if turned < 0.0 {
                *rolled *= values[0] + 1.0;
            }
        }
    }
}
