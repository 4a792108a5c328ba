//! Entry 12. A wheel that rests stays at rest until its set-point exceeds the breakaway speed; once it
//! moves, small set-points move it. A wheel slower than a tenth of the breakaway speed counts as resting.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::WheelSetPoint;

/// Share of the breakaway speed below which a wheel counts as resting.
const RESTING_SHARE: f64 = 0.1;

/// Stiction.
pub(super) struct Stiction;

impl EffectModel for Stiction {
    const INFO: EffectInfo = EffectInfo {
        number: 12,
        name: "stiction",
        summary: "stiction",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::grid("breakaway", "m/s", 0.0, (0.0, 0.3)).relevant_from(Relevance::Size(0.005))
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "a resting wheel stays at rest while |u| < breakaway",
        confounded_with: "castor_friction, motor_deadband",
        broken_by: "ramp up against ramp down",
    };

    fn wheel_set_point<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut WheelSetPoint<S>) {
        let nominal = context.nominal;
        let turn = context.motion.yaw_rate_rad_s * nominal.track_width * 0.5;
        let rim_m_s = [context.motion.speed_m_s - turn, context.motion.speed_m_s + turn];
        for (speed, rim_m_s) in signal.speed_rad_s.iter_mut().zip(rim_m_s) {
            let resting = rim_m_s.abs() < values[0] * RESTING_SHARE;
            if resting && (*speed * nominal.wheel_radius).abs() < values[0] {
                *speed = S::zero();
            }
        }
    }
}
