//! Entry 4. A driven wheel creeps in proportion to the force it transmits, so to the acceleration. Over a
//! window the loss is `slip_s` times the speed gained.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Rolling;

/// Longitudinal slip.
pub(super) struct LongitudinalSlip;

impl EffectModel for LongitudinalSlip {
    const INFO: EffectInfo = EffectInfo {
        number: 4,
        name: "longitudinal_slip",
        summary: "longitudinal slip",
        stage: Stage::Wheel,
        bad_data: false,
        parameters: &[Parameter::smooth("slip_s", "s", (-0.1, 0.1), Relevance::Size(0.004))],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "dx = -slip_s a",
        confounded_with: "actuator lag, command delay",
        broken_by: "slip is in x only, latency in x and w with one time constant",
    };

    fn rolling<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut Rolling<S>) {
        let gained_m_s = context.motion.acceleration_m_s2 * context.step_s;
        signal.add_to_both(-values[0] * gained_m_s);
    }
}
