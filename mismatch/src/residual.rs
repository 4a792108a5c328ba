//! Residuals, the regime each was measured in, and what could not be compared.

use std::fmt;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{Pose, Scalar};

use crate::channel::{Channel, MAX_COMPONENTS};

/// What the robot was doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regime {
    /// Forward speed by the encoders, m/s.
    pub speed_m_s: f64,
    /// Yaw rate by the encoders, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Forward acceleration by the encoders, m/s^2.
    pub acceleration_m_s2: f64,
    /// The true pose; `None` where no truth is near.
    pub pose: Option<Pose<f64>>,
}

/// Measured minus predicted.
#[derive(Clone, Copy, Debug)]
pub struct Residual<S> {
    /// Seconds: the stamp, or the middle of the window.
    pub time_s: f64,
    /// What the robot was doing then.
    pub regime: Regime,
    /// What was seen.
    pub target: Option<Target>,
    values: [S; MAX_COMPONENTS],
    components: usize,
}

impl<S: Scalar> Residual<S> {
    /// The values in the order of the channel's components.
    pub fn values(&self) -> &[S] {
        &self.values[..self.components]
    }
}

/// Why something was not compared.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Omission {
    /// The robot did not record this.
    NotRecorded(&'static str),
    /// The channel holds this many readings, and all are equal.
    Constant(&'static str, usize),
    /// So many readings or windows lie where a robot's wheels were not recorded without a pause.
    NoWheels(RobotId, usize),
    /// So many readings or windows have no truth of this robot near.
    NoTruth(RobotId, usize),
    /// So many sightings are of landmarks that the map does not have.
    NotInMap(usize),
    /// So many windows began before the servo could have forgotten the state it started in, or ended after
    /// the last command.
    NoCommand(usize),
    /// So many windows have too few readings.
    SparseWindow(usize),
    /// So many predictions or readings are no finite numbers.
    NotFinite(usize),
    /// Fewer residuals than a summary needs: found, needed.
    TooFew(usize, usize),
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotRecorded(what) => write!(f, "{what} not recorded"),
            Self::Constant(what, count) => write!(f, "{what} never change ({count} equal readings)"),
            Self::NoWheels(robot, count) => write!(f, "{count} without wheel angles of robot {robot} around"),
            Self::NoTruth(robot, count) => write!(f, "{count} without truth of robot {robot} near"),
            Self::NotInMap(count) => write!(f, "{count} of landmarks that are not in the map"),
            Self::NoCommand(count) => write!(f, "{count} windows at the ends of the commands"),
            Self::SparseWindow(count) => write!(f, "{count} windows with too few readings"),
            Self::NotFinite(count) => write!(f, "{count} that are no finite numbers"),
            Self::TooFew(found, needed) => write!(f, "{found} residuals, a summary needs {needed}"),
        }
    }
}

/// The residuals of one channel in the order of time, and what is not among them.
#[derive(Clone, Debug)]
pub struct ChannelResiduals<S> {
    /// Which channel.
    pub channel: Channel,
    /// Those that could be computed; every value is finite.
    pub rows: Vec<Residual<S>>,
    /// What could not, and why.
    pub omissions: Vec<Omission>,
}

impl<S: Scalar> ChannelResiduals<S> {
    pub(crate) fn new(channel: Channel) -> Self {
        Self { channel, rows: Vec::new(), omissions: Vec::new() }
    }

    /// Nothing to compare, and why.
    pub(crate) fn without(channel: Channel, omission: Omission) -> Self {
        Self { channel, rows: Vec::new(), omissions: vec![omission] }
    }

    /// Adds a residual; one that is not finite is counted instead.
    pub(crate) fn push(&mut self, time_s: f64, regime: Regime, target: Option<Target>, values: &[S]) {
        if values.iter().any(|value| !value.value().is_finite()) {
            self.count(Omission::NotFinite);
            return;
        }
        let mut all = [S::zero(); MAX_COMPONENTS];
        for (slot, &value) in all.iter_mut().zip(values) {
            *slot = value;
        }
        let components = values.len().min(MAX_COMPONENTS);
        self.rows.push(Residual { time_s, regime, target, values: all, components });
    }

    /// Counts one more omission of the kind that `of` makes of a count.
    pub(crate) fn count(&mut self, of: impl Fn(usize) -> Omission) {
        self.count_many(1, of);
    }

    pub(crate) fn count_many(&mut self, more: usize, of: impl Fn(usize) -> Omission) {
        if more == 0 {
            return;
        }
        let kind = std::mem::discriminant(&of(0));
        for omission in &mut self.omissions {
            if std::mem::discriminant(omission) != kind {
                continue;
            }
            let counted = match omission {
                Omission::NoWheels(_, count)
                | Omission::NoTruth(_, count)
                | Omission::NotInMap(count)
                | Omission::NoCommand(count)
                | Omission::SparseWindow(count)
                | Omission::NotFinite(count) => *count,
                _ => continue,
            };
            if of(counted) == *omission {
                *omission = of(counted + more);
                return;
            }
        }
        self.omissions.push(of(more));
    }
}
