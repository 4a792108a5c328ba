//! How the filter is to be run, for every command that runs it.

use clap::Args;
use pleiad_agent::config::{ErrorName, FilterSection};
use pleiad_estimation::RobotId;
use pleiad_estimation::strategy::StrategyKind;

use super::{CalibrateArg, ClutterArg, ErrorArg, InflateArg, QuarantineArg, RelinearizeArg, ToldArg};

#[derive(Clone, Debug, Args)]
pub struct FilterArgs {
    /// How the robots share what they see: exact, pairwise, intersection, split_intersection, naive or
    /// independent (docs/strategies.md).
    #[arg(long, default_value_t = StrategyKind::Exact)]
    pub strategy: StrategyKind,
    /// Coordinates of the filter's error.
    #[arg(long, value_enum, default_value_t = ErrorArg::Invariant)]
    pub error: ErrorArg,
    /// Linearize facts together: blocks of so many seconds, smoothed so far beyond, in so many passes, as in 5:5:4.
    #[arg(long, value_name = "BLOCK_S:AHEAD_S:PASSES")]
    pub relinearize: Option<RelinearizeArg>,
    /// So large a share of observations is of nothing, seen up to so far away: each is weighed by its probability. With a third
    /// number, such a share of the sightings is of another than they name.
    #[arg(long, value_name = "SHARE:REACH_M[:MISNAMED]")]
    pub clutter: Option<ClutterArg>,
    /// Raise stated noise where readings surprise, over so many readings of a robot, by at most such a factor on its
    /// variances, as in 20:10.
    #[arg(long, value_name = "READINGS:MOST")]
    pub inflate: Option<InflateArg>,
    /// Do not believe a robot that contradicts the others: logarithm of the odds that it takes, and for how long robots are
    /// compared after they measured one another, s, as in 15:30.
    #[arg(long, value_name = "LEVEL:WINDOW_S")]
    pub quarantine: Option<QuarantineArg>,
    /// What is not sure about the robots and is to be found out, by standard deviations: forward and yaw (scales of the odometry),
    /// bias (yaw rate, rad/s), mount_m and mount_rad (the sensor of others), clock (s) and
    /// drift_ppm (of all robots but the first).
    #[arg(long, value_name = "NAME=SIGMA,...")]
    pub calibrate: Option<CalibrateArg>,
    /// Which robots are told where they start: all, none, or numbers as in 1,2. The others find out.
    #[arg(long, default_value = "all")]
    pub told: ToldArg,
}

impl FilterArgs {
    /// The exact strategy as it comes.
    pub fn exact(error: ErrorArg) -> Self {
        Self {
            strategy: StrategyKind::Exact,
            error,
            relinearize: None,
            clutter: None,
            inflate: None,
            quarantine: None,
            calibrate: None,
            told: ToldArg::All,
        }
    }
}

impl FilterArgs {
    pub fn tells(&self, robot: RobotId) -> bool {
        match &self.told {
            ToldArg::All => true,
            ToldArg::Only(robots) => robots.contains(&robot),
        }
    }

    pub fn apply(&self, filter: &FilterSection) -> FilterSection {
        let error = match self.error {
            ErrorArg::Invariant => ErrorName::Invariant,
            ErrorArg::Additive => ErrorName::Additive,
        };
        let relinearize = self.relinearize.map(|how| how.0).or(filter.relinearize);
        let clutter = self.clutter.map(|clutter| clutter.0).or(filter.clutter);
        let join = filter.join || self.told != ToldArg::All;
        let inflation = self.inflate.map(|inflation| inflation.0).or(filter.inflation);
        let quarantine = self.quarantine.map(|quarantine| quarantine.0).or(filter.quarantine);
        FilterSection { error, gate: filter.gate, clutter, inflation, quarantine, join, relinearize }
    }
}
