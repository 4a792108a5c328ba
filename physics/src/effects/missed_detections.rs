//! Entry 47. Targets are missed more often far away and at the edge of the view: a logistic regression
//! whose values add to the declared log-odds of a miss.

use crate::context::Context;
use crate::effect::EffectModel;
use crate::info::{Channel, EffectInfo, Parameter, Stage};
use crate::relevance::Relevance;
use crate::scalar::Scalar;
use crate::signal::Sighting;

/// A declared detection probability of one has no log-odds; it counts as one miss in a thousand.
const LEAST_MISS_ODDS: f64 = 1e-3;

/// Missed detections by range and aspect.
pub(super) struct MissedDetections;

impl EffectModel for MissedDetections {
    const INFO: EffectInfo = EffectInfo {
        number: 47,
        name: "missed_detections",
        summary: "missed detections by range and aspect",
        stage: Stage::Sensor,
        bad_data: false,
        parameters: &[
            Parameter::smooth("logit", "1", (-10.0, 10.0), Relevance::Size(0.1)).component("constant"),
            Parameter::smooth("logit", "1/m", (-5.0, 5.0), Relevance::Size(0.05)).component("range"),
            Parameter::smooth("logit", "1/rad^2", (-5.0, 5.0), Relevance::Size(0.05))
                .component("bearing_squared"),
        ],
        channels: &[Channel::Relative],
        equation: "logit(miss) = declared + constant + range r + bearing_squared b^2",
        confounded_with: "occlusion",
        broken_by: "static grid",
    };

    fn sighting<S: Scalar>(values: &[S], _context: &Context<S>, signal: &mut Sighting<S>) {
        let raised = values[0] + values[1] * signal.range_m + values[2] * signal.bearing_rad.square();
        let declared = signal.detection_probability;
        let miss_odds = ((S::one() - declared) / declared).max(S::constant(LEAST_MISS_ODDS));
        let detected = |odds: S| S::one() / (odds + 1.0);
        // As a difference, so that nothing changes at zero even where no miss was declared.
        signal.detection_probability += detected(miss_odds * raised.exp()) - detected(miss_odds);
    }
}
