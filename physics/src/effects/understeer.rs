//! Entry 26. The faster a car, the wider its curve at one steering angle: the characteristic speed is
//! `1/sqrt(K)`.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Understeer (car-like).
pub(super) struct Understeer;

impl EffectModel for Understeer {
    const INFO: EffectInfo = EffectInfo {
        number: 26,
        name: "understeer",
        summary: "understeer (car-like)",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("s2_per_m2", "s^2/m^2", (-0.5, 0.5), Relevance::Size(0.005))],
        channels: &[Channel::Encoders, Channel::Steer, Channel::Truth],
        equation: "w = v tan(steer) / (L (1 + s2_per_m2 v^2))",
        confounded_with: "speed_dependent_scale",
        broken_by: "skid pad",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        signal.understeer_s2_per_m2 += values[0];
    }
}
