//! What a diagnosis shows beside its findings: series to plot.

use crate::channel::Channel;

/// Residuals of one component of a channel, before and after the correction.
#[derive(Clone, Debug)]
pub struct ResidualSeries {
    /// The name of the recording.
    pub recording: String,
    /// Which robot.
    pub robot: u32,
    /// Which channel.
    pub channel: Channel,
    /// The position among the channel's components.
    pub component: usize,
    /// Seconds.
    pub time_s: Vec<f64>,
    /// Under the nominal model, in the component's unit.
    pub nominal: Vec<f64>,
    /// Under the corrected model.
    pub corrected: Vec<f64>,
    /// The spread of the residual that is noise, in the component's unit.
    pub sigma: f64,
    /// True position, metres; `None` without truth.
    pub position_m: Vec<Option<[f64; 2]>>,
}

/// A finding's partial residual: the residual of its channel when everything but the finding is corrected,
/// against what the finding predicts there. Points on a line of slope one are explained.
#[derive(Clone, Debug)]
pub struct PartialResidual {
    /// The position among the findings.
    pub finding: usize,
    /// The name of the recording.
    pub recording: String,
    /// Which robot.
    pub robot: u32,
    /// Which channel.
    pub channel: Channel,
    /// The position among the channel's components.
    pub component: usize,
    /// Seconds.
    pub time_s: Vec<f64>,
    /// What the finding predicts, in the component's unit.
    pub predicted: Vec<f64>,
    /// What is left without it.
    pub residual: Vec<f64>,
    /// Log-likelihood that the finding gains in each half second, summed from the start.
    pub gain: Vec<[f64; 2]>,
}

/// What is left without a finding over what it depends on, with the curve that was found.
#[derive(Clone, Debug)]
pub struct ShapePlot {
    /// The position among the findings.
    pub finding: usize,
    /// The name of the recording.
    pub recording: String,
    /// Which robot.
    pub robot: u32,
    /// Which channel.
    pub channel: Channel,
    /// The position among the channel's components.
    pub component: usize,
    /// The regressor: `v`.
    pub regressor: String,
    /// Its unit.
    pub regressor_unit: String,
    /// The regressor at every row; NaN where it is not known.
    pub x: Vec<f64>,
    /// What is left without the finding, in the component's unit.
    pub residual: Vec<f64>,
    /// The curve: regressor, residual.
    pub curve: Vec<[f64; 2]>,
}

/// Everything to plot.
#[derive(Clone, Debug, Default)]
pub struct Plots {
    /// Residuals of every robot and channel.
    pub residuals: Vec<ResidualSeries>,
    /// One or more per finding.
    pub partial: Vec<PartialResidual>,
    /// Of findings without a name that depend on one thing.
    pub shapes: Vec<ShapePlot>,
    /// True paths: robot, positions.
    pub paths: Vec<(u32, Vec<[f64; 2]>)>,
    /// Landmarks: number, position.
    pub landmarks: Vec<(u32, [f64; 2])>,
}
