//! Entry 53. A robot that is near pushes this one away (wake, airflow, contact through a cable); the
//! velocity dies out with the distance.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::MapMotion;

/// Influence of a near partner.
pub(super) struct PartnerInfluence;

impl EffectModel for PartnerInfluence {
    const INFO: EffectInfo = EffectInfo {
        number: 53,
        name: "partner_influence",
        summary: "influence of a near partner",
        stage: Stage::World,
        bad_data: false,
        parameters: &[
            Parameter::smooth("amplitude", "m/s", (-1.0, 1.0), Relevance::Size(0.004)),
            Parameter::smooth("range_m", "m", (0.05, 10.0), Relevance::Unbounded).off_at(1.0),
        ],
        channels: &[Channel::Encoders, Channel::Truth],
        equation: "velocity amplitude exp(-distance / range_m) away from the partner",
        confounded_with: "low_friction_patch",
        broken_by: "separate the pair",
    };

    fn world<S: Scalar>(values: &[S], context: &Context<S>, signal: &mut MapMotion<S>) {
        let Some(partner) = context.surroundings.partner_m else { return };
        let [x, y] = context.motion.pose.position();
        let away = [x - partner[0], y - partner[1]];
        let distance = away[0].hypot(away[1]);
        if distance > 0.0 {
            let speed = values[0] * (-distance / values[1]).exp();
            for (shift, away) in signal.shift_m.iter_mut().zip(away) {
                *shift += speed * away / distance * context.step_s;
            }
        }
    }
}
