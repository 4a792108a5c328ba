//! Entry 2. The wheels turn the body about contact points that are farther apart than believed: `E_b` of
//! `borenstein1996`. Wheels that skid sideways in turns look the same (`goel1999`).

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Geometry;

/// Wheelbase or effective track.
pub(super) struct TrackWidthError;

impl EffectModel for TrackWidthError {
    const INFO: EffectInfo = EffectInfo {
        number: 2,
        name: "track_width_error",
        summary: "wheelbase or effective track",
        stage: Stage::Body,
        bad_data: false,
        parameters: &[Parameter::smooth("relative", "1", (-0.4, 1.0), Relevance::Size(0.003))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "w = w_odometry / (1 + relative)",
        confounded_with: "gyro scale, if heading comes from the gyro",
        broken_by: "absolute heading over 10 turns",
    };

    fn geometry<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Geometry<S>) {
        signal.track_width_m *= values[0] + 1.0;
    }
}
