//! Entry 12. From an instant on, dry friction in one wheel holds it back by a constant speed, whichever way
//! it turns: what a velocity servo makes of a friction torque.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::WheelSetPoint;

/// One sticky wheel.
pub(super) struct StickyWheel;

impl EffectModel for StickyWheel {
    const INFO: EffectInfo = EffectInfo {
        number: 12,
        name: "sticky_wheel",
        summary: "one sticky wheel",
        stage: Stage::Actuator,
        bad_data: false,
        parameters: &[
            Parameter::choice("wheel", (0.0, 1.0)),
            Parameter::grid("t_on_s", "s", 0.0, (0.0, 1e5)),
            Parameter::smooth("droop", "rad/s", (0.0, 5.0), Relevance::Size(0.01)),
        ],
        channels: &[Channel::Command, Channel::Encoders],
        equation: "from t_on_s on: wheel speed u - sign(u) min(droop, |u|)",
        confounded_with: "castor_friction, motor_deadband",
        broken_by: "ramp up against ramp down",
    };

    fn wheel_set_point<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut WheelSetPoint<S>) {
        if context.time_s < values[1].value() {
            return;
        }
        let [left, right] = &mut signal.speed_rad_s;
        let speed = if values[0].value() < 0.5 { left } else { right };
        *speed -= speed.sign() * values[2].min(speed.abs());
    }
}
