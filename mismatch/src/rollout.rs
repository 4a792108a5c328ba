//! How far a prediction is off after a while.

use std::ops::Range;

use pleiad_estimation::RobotId;
use pleiad_physics::chain::body::BodyState;
use pleiad_physics::{Pose, RobotModel, Scalar};

use crate::commanded::Driver;
use crate::evidence::Evidence;
use crate::plan::Plan;
use crate::{body, commanded};

/// The horizons over which predictions are usually judged, seconds.
pub const HORIZONS_S: [f64; 6] = [0.5, 1.0, 2.0, 5.0, 10.0, 30.0];

/// A prediction from a true pose to a later one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollout {
    /// Its beginning, seconds since the origin of the evidence.
    pub time_s: f64,
    /// Distance between the true and the predicted position at its end, metres.
    pub position_error_m: f64,
    /// True minus predicted heading at its end, wrapped, radians.
    pub heading_error_rad: f64,
}

/// Predictions over every horizon, in the order of the horizons: from true poses by the encoders alone, or
/// without encoders by the commands, with the servo as it stands. Those of one horizon do not overlap.
///
/// Where truth, odometry or commands have a gap there is none; a horizon that is not above 0 has none.
pub fn rollouts(
    evidence: &Evidence<'_>,
    robot: RobotId,
    model: &RobotModel<f64>,
    horizons_s: &[f64],
) -> Vec<Vec<Rollout>> {
    Planned::new(evidence, robot, horizons_s).rollouts(evidence, robot, model, &ALWAYS)
}

/// Of roll-outs that begin at any time.
pub(crate) const ALWAYS: Range<f64> = f64::NEG_INFINITY..f64::INFINITY;
/// Before the first roll-out the state of the body is followed for so long, seconds: what it remembers from earlier is
/// the last step, and a castor that has swung round since.
const REMEMBERED_S: f64 = 60.0;

/// The windows of roll-outs over several horizons: they depend on no model.
pub(crate) struct Planned(Vec<Over>);

/// Windows by the encoders, or without encoders by the commands.
enum Over {
    Encoders(Plan<body::Motion>),
    Commands(Plan<commanded::Motion>),
    Nothing,
}

impl Planned {
    pub(crate) fn new(evidence: &Evidence<'_>, robot: RobotId, horizons_s: &[f64]) -> Self {
        let by_commands = evidence.robot(robot).is_none_or(|(_, track)| track.encoders.is_empty());
        let over = |&horizon_s: &f64| {
            if horizon_s.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
                Over::Nothing
            } else if by_commands {
                Over::Commands(commanded::plan(evidence, robot, horizon_s))
            } else {
                Over::Encoders(body::plan_of_length(evidence, robot, horizon_s))
            }
        };
        Self(horizons_s.iter().map(over).collect())
    }

    /// Those that begin within a time, per horizon.
    pub(crate) fn rollouts(
        &self,
        evidence: &Evidence<'_>,
        robot: RobotId,
        model: &RobotModel<f64>,
        within: &Range<f64>,
    ) -> Vec<Vec<Rollout>> {
        let Some((_, track)) = evidence.robot(robot) else { return vec![Vec::new(); self.0.len()] };
        let over = |over: &Over| match over {
            Over::Nothing => Vec::new(),
            Over::Commands(plan) => {
                let mut driver = Driver::new(track, model);
                let one = |own: &commanded::Motion| {
                    end_error(own.window.from_s, &own.measured, &driver.predicted(model, own))
                };
                let all = plan.items.iter().map(one);
                all.filter(|rollout| within.contains(&rollout.time_s)).collect()
            }
            Over::Encoders(plan) => {
                let mut state = BodyState::default();
                let one = |own: &body::Motion| {
                    let from_s = track.encoders[own.window.first].time_s;
                    if within.contains(&from_s) {
                        let predicted = own.predicted(track, model, &mut state);
                        return Some(end_error(from_s, &own.measured, &predicted));
                    }
                    if (within.start - REMEMBERED_S..within.end).contains(&from_s) {
                        own.pass(track, model, &mut state);
                    }
                    None
                };
                plan.items.iter().filter_map(one).collect()
            }
        };
        self.0.iter().map(over).collect()
    }
}

fn end_error(time_s: f64, measured: &Pose<f64>, predicted: &Pose<f64>) -> Rollout {
    Rollout {
        time_s,
        position_error_m: (measured.x_m - predicted.x_m).hypot(measured.y_m - predicted.y_m),
        heading_error_rad: (measured.yaw_rad - predicted.yaw_rad).wrapped(),
    }
}
