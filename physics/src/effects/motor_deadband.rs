//! Entry 11. Small set-points move nothing: below `speed_m_s` the robot does not advance, below
//! `wheel_rad_s` a wheel does not turn.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::{SetPoint, WheelSetPoint};

/// Dead band.
pub(super) struct MotorDeadband;

impl EffectModel for MotorDeadband {
    const INFO: EffectInfo = EffectInfo {
        number: 11,
        name: "motor_deadband",
        summary: "dead band",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::grid("speed_m_s", "m/s", 0.0, (0.0, 0.2)).relevant_from(Relevance::Size(0.002)),
            Parameter::grid("wheel_rad_s", "rad/s", 0.0, (0.0, 3.0)).relevant_from(Relevance::Size(0.03)),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "u = 0 where |u| < speed_m_s; a wheel likewise below wheel_rad_s",
        confounded_with: "encoder quantization",
        broken_by: "slow triangle ramp",
    };

    fn set_point<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut SetPoint<S>) {
        if signal.speed_m_s.abs() < values[0] {
            signal.speed_m_s = S::zero();
        }
    }

    fn wheel_set_point<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut WheelSetPoint<S>) {
        for speed in &mut signal.speed_rad_s {
            if speed.abs() < values[1] {
                *speed = S::zero();
            }
        }
    }
}
