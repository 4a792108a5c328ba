//! What a diagnosis says: the object that `findings.json` holds.
//!
//! Names and parameters are those of the catalogue ([`Effect`](pleiad_physics::Effect)); SI units and
//! radians. A field that does not apply is `null` or empty.

use std::collections::BTreeMap;

use serde::Serialize;

/// What is claimed, of one finding or of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// One effect of the catalogue explains it, and no rival does about as well.
    Named,
    /// Several effects explain it about equally on these data.
    CannotTell,
    /// A product of what the robot did describes it, and no entry of the catalogue explains it: a form with a
    /// unit, not a cause.
    Form,
    /// Something is missing that no entry of the catalogue explains, and no simple product either.
    Unnameable,
    /// Clock, truth or association is wrong: no physics.
    BadData,
    /// Of all findings: there is none.
    NothingMissing,
    /// Of all findings: too little could be tested to say that nothing is missing.
    Untestable,
}

/// Everything that was found, and what could not be.
#[derive(Clone, Debug, Serialize)]
pub struct Findings {
    /// The strongest claim among the findings.
    pub verdict: Verdict,
    /// The recordings that were used.
    pub recordings: Vec<String>,
    /// Those the model was fitted on.
    pub fit_on: Vec<String>,
    /// Those it was tested on: other recordings, or the folds left out of the fit.
    pub test_on: Vec<String>,
    /// What is missing, the best supported first.
    pub findings: Vec<Finding>,
    /// Effects that were tested and not found.
    pub undetected: Vec<Undetected>,
    /// Effects that could not be tested.
    pub untestable: Vec<Untestable>,
    /// Change per robot of roll-outs when everything found is applied.
    pub roll_outs: Vec<RobotRollOuts>,
    /// What was noticed about the data and is no finding.
    pub notes: Vec<String>,
}

/// One finding.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// What is claimed.
    pub verdict: Verdict,
    /// The robots it acts on; an effect of the world lists every robot.
    pub robots: Vec<u32>,
    /// The stage of the signal chain.
    pub stage: String,
    /// The channel of residuals that shows it most.
    pub channel: String,
    /// The name in the catalogue; of several rivals, the one that explains the data best.
    pub effect: Option<String>,
    /// The expression, if it is not in the catalogue.
    pub expression: Option<String>,
    /// The units of the expression's coefficient.
    pub expression_units: Option<String>,
    /// Every effect that explains it about equally, the named one included.
    pub support_set: Vec<String>,
    /// The parameters by name (a component of a vector as `offset_body_m.forward`).
    pub parameters: BTreeMap<String, Estimate>,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: Place,
    /// Probability that anything as strong is found anywhere in clean data.
    pub p_familywise: f64,
    /// What it is worth on data that the fit did not see.
    pub held_out: HeldOut,
    /// What is known of something unnameable.
    pub shape: Option<Shape>,
    /// What to drive to tell the rivals apart.
    pub manoeuvre: Option<String>,
    /// What it is, in words.
    pub summary: String,
    /// The model equation.
    pub equation: Option<String>,
    /// The line or section of configuration that applies it.
    pub configuration: String,
}

/// A curve that stands in for an expression: a natural cubic spline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// What is off by the curve: `left velocity`.
    pub of: String,
    /// The unit of the curve.
    pub unit: String,
    /// What it is drawn over: `v`, `w`, `t`, `x`, `r` and so on.
    pub regressor: String,
    /// Its unit.
    pub regressor_unit: String,
    /// Knots of the spline, in the unit of the regressor. Beyond the ends the curve is constant.
    pub knots: Vec<f64>,
    /// The curve at the knots.
    pub values: Vec<f64>,
    /// Standard errors of these.
    pub errors: Vec<f64>,
    /// The share of the residual variance of the channel that it explains on data that the fit did not see.
    pub residual_share: Estimate,
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its unit; `1` for a pure number.
    pub unit: String,
    /// The 95 % confidence interval.
    pub ci95: [f64; 2],
}

/// Where a finding acts.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// Intervals of time, seconds; empty if throughout.
    pub time: Vec<[f64; 2]>,
    /// A rectangle of the map `[x0, x1, y0, y1]`, metres; `None` if everywhere.
    pub region_m: Option<[f64; 4]>,
    /// The regime of motion in which it shows, in words; empty if in all.
    pub regime: String,
}

/// The worth of a finding on data that the fit did not see.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// Gain of log score over the model without it, nominal parameters refitted; natural logarithm.
    pub log_score_gain: f64,
    /// Its standard error, robust against correlation in time.
    pub log_score_gain_se: f64,
    /// Roll-out errors of the finding's robots.
    pub rollout_rmse: Vec<RollOut>,
}

/// Error of the predicted pose after a horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RollOut {
    /// Length of the prediction, seconds.
    pub horizon_s: f64,
    /// Root mean square error of position under the nominal model, metres.
    pub nominal: f64,
    /// Under the nominal model with its own parameters refitted, metres.
    pub refit: f64,
    /// Under the corrected model, metres.
    pub corrected: f64,
    /// The same three for the heading, radians.
    pub heading_rad: [f64; 3],
}

/// The roll-outs of one robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotRollOuts {
    /// Which robot.
    pub robot: u32,
    /// One entry per horizon.
    pub horizons: Vec<RollOut>,
    /// Root mean square error of the nominal model at the end of 100 m, metres, from the distance driven and
    /// the error at the longest horizon; and of the corrected one.
    pub error_per_100_m: [f64; 2],
}

/// An effect that was tested and not found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undetected {
    /// Its name.
    pub effect: String,
    /// The robot; `None` for an effect of the world.
    pub robot: Option<u32>,
    /// The parameter that the size is of.
    pub parameter: String,
    /// The least size that would have been found with a probability of 80 %.
    pub minimum_detectable: f64,
    /// Its unit.
    pub unit: String,
}

/// An effect that could not be tested.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Untestable {
    /// Its name.
    pub effect: String,
    /// The robot; `None` for every robot.
    pub robot: Option<u32>,
    /// Why.
    pub why: String,
}
