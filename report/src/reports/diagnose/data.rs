//! What the report of a diagnosis shows: plain data, whoever made it.

use pleiad_estimation::RobotId;

use crate::Landmark;

/// The stages of the signal chain, in the order a signal passes them.
pub const STAGES: [&str; 8] =
    ["command", "actuator", "wheel", "body", "world", "sensor", "clock", "identity"];

/// What is claimed, of one finding or of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// One effect explains it, and no rival does about as well.
    Named,
    /// Several effects explain it about equally.
    CannotTell,
    /// No known effect explains it; a product of what the robot did describes it.
    Form,
    /// Something is missing that no known effect explains.
    Unnameable,
    /// Clock, truth or association is wrong.
    BadData,
    /// Nothing was found.
    NothingMissing,
    /// Too little could be tested.
    Untestable,
}

/// What a diagnosis showed.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoseReport {
    /// The recordings that were used.
    pub recordings: Vec<DiagnosedRecording>,
    /// Those the model was fitted on.
    pub fit_on: Vec<String>,
    /// Those it was tested on: other recordings, or parts of the same that were left out of the fit.
    pub test_on: Vec<String>,
    /// The strongest claim among the findings.
    pub claim: Claim,
    /// Every robot, in the order in which they take their colours.
    pub robots: Vec<RobotId>,
    /// What was found, the best supported first.
    pub findings: Vec<Found>,
    /// Which stages of which robot could be tested at all; a stage that is not in it was not tried.
    pub tested: Vec<StageTest>,
    /// Roll-outs per robot, all corrections applied.
    pub roll_outs: Vec<RobotRollOut>,
    /// Effects that were tested and not found.
    pub undetected: Vec<SmallestDetectable>,
    /// Effects that could not be tested.
    pub untestable: Vec<NotTested>,
    /// Remarks, for people.
    pub notes: Vec<String>,
    /// Residuals of every robot and channel.
    pub residuals: Vec<ResidualColumns>,
    /// The evidence of the findings.
    pub evidence: Vec<Evidence>,
    /// Of findings that depend on one thing and have no name: what is left of the residual over it.
    pub shapes: Vec<ShapeColumns>,
    /// True paths: robot, positions in metres.
    pub paths: Vec<(RobotId, Vec<[f64; 2]>)>,
    /// The map.
    pub landmarks: Vec<Landmark>,
    /// Commands: what each reproduces, and the command.
    pub commands: Vec<(String, String)>,
}

/// A recording that was used.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosedRecording {
    /// The name of its folder.
    pub name: String,
    /// Its length, seconds.
    pub seconds: f64,
}

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// What is claimed.
    pub claim: Claim,
    /// The robots it acts on.
    pub robots: Vec<RobotId>,
    /// One of [`STAGES`].
    pub stage: String,
    /// The channel that shows it most, for people.
    pub channel: String,
    /// The name in the catalogue, where it has one.
    pub effect: Option<String>,
    /// What it is, in a few words: `unequal wheel diameters`; an expression if it has no name.
    pub title: String,
    /// What it amounts to, a sentence per item, with intervals.
    pub sentences: Vec<String>,
    /// The parameters as estimated.
    pub parameters: Vec<ParameterEstimate>,
    /// Other effects that explain it about equally, in a few words each.
    pub rivals: Vec<String>,
    /// Where it acts: intervals of time, seconds; empty if throughout.
    pub time_s: Vec<[f64; 2]>,
    /// A rectangle of the floor `[x0, x1, y0, y1]`, metres.
    pub region_m: Option<[f64; 4]>,
    /// The regime of motion, in words; empty if any.
    pub regime: String,
    /// Probability that anything as strong is found anywhere in clean data.
    pub p_familywise: f64,
    /// Gain of log score on data that the fit did not see, and its standard error.
    pub gain: [f64; 2],
    /// Roll-out errors of the robots it acts on.
    pub roll_outs: Vec<HorizonError>,
    /// What to drive to tell the rivals apart.
    pub manoeuvre: Option<String>,
    /// The equation of the model.
    pub equation: Option<String>,
    /// The lines of configuration that apply it.
    pub configuration: String,
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEstimate {
    /// The name in findings and model files.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// Its 95 % confidence interval.
    pub ci95: [f64; 2],
    /// Its unit; `1` for a pure number.
    pub unit: String,
}

/// Whether a stage of a robot's chain could be tested.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageTest {
    /// Which robot.
    pub robot: RobotId,
    /// One of [`STAGES`].
    pub stage: String,
    /// False if none of its effects could be.
    pub testable: bool,
}

/// Error of the predicted pose after a horizon, root mean square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonError {
    /// Length of the prediction, seconds.
    pub horizon_s: f64,
    /// Position under the nominal, the refitted nominal and the corrected model, metres.
    pub position_m: [f64; 3],
    /// The same for the heading, radians.
    pub heading_rad: [f64; 3],
}

/// Roll-outs of one robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotRollOut {
    /// Which robot.
    pub robot: RobotId,
    /// One entry per horizon.
    pub horizons: Vec<HorizonError>,
    /// Error per 100 m driven, before and after, metres.
    pub per_100_m: [f64; 2],
}

/// An effect that was tested and not found.
#[derive(Clone, Debug, PartialEq)]
pub struct SmallestDetectable {
    /// In a few words.
    pub title: String,
    /// The robot; `None` for an effect of the world.
    pub robot: Option<RobotId>,
    /// The parameter that the size is of.
    pub parameter: String,
    /// The size that would have been found with a probability of 80 %.
    pub size: f64,
    /// Its unit.
    pub unit: String,
}

/// An effect that could not be tested.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotTested {
    /// In a few words.
    pub title: String,
    /// The robot; `None` for every robot.
    pub robot: Option<RobotId>,
    /// Why.
    pub why: String,
}

/// Residuals of one component of a channel: columns of equal length.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualColumns {
    /// The recording it is from; empty if there is only one.
    pub recording: String,
    /// Which robot.
    pub robot: RobotId,
    /// The channel, for people; one after the other along the chain.
    pub channel: String,
    /// The component, for people: `forward`.
    pub component: String,
    /// The component's unit.
    pub unit: String,
    /// Seconds.
    pub time_s: Vec<f64>,
    /// Under the nominal model.
    pub nominal: Vec<f64>,
    /// Under the corrected model.
    pub corrected: Vec<f64>,
    /// The part of the residual's spread that is noise, in the component's unit.
    pub sigma: f64,
    /// True position, metres, where it is known.
    pub position_m: Vec<Option<[f64; 2]>>,
}

/// What is left of a residual over what it depends on: columns of equal length, and a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeColumns {
    /// The position among the findings.
    pub finding: usize,
    /// The recording it is from; empty if there is only one.
    pub recording: String,
    /// Which robot.
    pub robot: RobotId,
    /// The channel, for people.
    pub channel: String,
    /// The component, for people.
    pub component: String,
    /// The component's unit.
    pub unit: String,
    /// What it depends on: `v`.
    pub regressor: String,
    /// Its unit.
    pub regressor_unit: String,
    /// The regressor; NaN where it is not known.
    pub x: Vec<f64>,
    /// The residual with everything but this finding corrected.
    pub residual: Vec<f64>,
    /// The curve: regressor, residual.
    pub curve: Vec<[f64; 2]>,
}

/// The evidence of one finding in one component of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// The position among the findings.
    pub finding: usize,
    /// The recording it is from; empty if there is only one.
    pub recording: String,
    /// Which robot.
    pub robot: RobotId,
    /// The channel, for people.
    pub channel: String,
    /// The component, for people.
    pub component: String,
    /// The component's unit.
    pub unit: String,
    /// Seconds.
    pub time_s: Vec<f64>,
    /// What the finding predicts of the residual.
    pub predicted: Vec<f64>,
    /// The residual with everything but this finding corrected.
    pub residual: Vec<f64>,
    /// Time, seconds, and the log-likelihood gained up to it; every half second.
    pub gain: Vec<[f64; 2]>,
}
