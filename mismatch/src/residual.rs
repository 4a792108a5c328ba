//! Residuals, the regime each was measured in, and what could not be compared.

use std::fmt;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Target;
use pleiad_physics::{Pose, Scalar};

use crate::channel::{Channel, MAX_COMPONENTS};
use crate::plan::Plan;

/// What the robot was doing, by its encoders, or without them by the reference system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regime {
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Forward acceleration, m/s^2.
    pub acceleration_m_s2: f64,
    /// The true pose; `None` where no truth is near.
    pub pose: Option<Pose<f64>>,
}

/// Measured minus predicted.
#[derive(Clone, Copy, Debug)]
pub struct Residual<S> {
    /// Seconds since the origin of the evidence: the stamp, or the middle of the window.
    pub time_s: f64,
    /// What the robot was doing then.
    pub regime: Regime,
    /// What was seen.
    pub target: Option<Target>,
    values: [S; MAX_COMPONENTS],
    sigmas: [S; MAX_COMPONENTS],
    components: usize,
}

impl<S: Scalar> Residual<S> {
    /// Of as many components as there are values, each with its standard deviation.
    pub(crate) fn new(
        time_s: f64,
        regime: Regime,
        target: Option<Target>,
        values: &[S],
        sigmas: &[S],
    ) -> Self {
        let mut own = Self {
            time_s,
            regime,
            target,
            values: [S::zero(); MAX_COMPONENTS],
            sigmas: [S::one(); MAX_COMPONENTS],
            components: values.len().min(MAX_COMPONENTS),
        };
        for (slot, &value) in own.values.iter_mut().zip(values) {
            *slot = value;
        }
        for (slot, &sigma) in own.sigmas.iter_mut().zip(sigmas) {
            *slot = sigma;
        }
        own
    }

    /// The values in the order of the channel's components.
    pub fn values(&self) -> &[S] {
        &self.values[..self.components]
    }

    /// The standard deviation that the model declares for each value, with its derivatives; 1 in the
    /// channels [`Channel::Actuator`], [`Channel::Body`] and [`Channel::CommandedBody`], whose noise no
    /// model declares.
    pub fn sigmas(&self) -> &[S] {
        &self.sigmas[..self.components]
    }

    fn is_finite(&self) -> bool {
        self.values().iter().all(|value| value.value().is_finite())
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
    /// So many readings or windows lie where a robot's odometry was not recorded without a pause.
    NoWheels(RobotId, usize),
    /// So many readings or windows have no truth of this robot near.
    NoTruth(RobotId, usize),
    /// So many sightings are of landmarks that the map does not have.
    NotInMap(usize),
    /// So many windows began before the servo could have forgotten the state it started in, or ended after
    /// the last command.
    NoCommand(usize),
    /// So many windows lie in gaps of the commands, or so soon after one that the servo's state is unknown.
    CommandGap(usize),
    /// The channel's end points are compared stage by stage, because the stage between them was recorded.
    ByStages,
    /// So many windows have too few readings.
    SparseWindow(usize),
    /// So many predictions or readings are no finite numbers.
    NotFinite(usize),
    /// Fewer residuals than a summary needs: found, needed.
    TooFew(usize, usize),
    /// Commands and motion do not go together: the correlation of their windows in hundredths.
    Unrelated(i32),
}

impl Omission {
    /// Whether it says more than that a few rows, at most so many, are missing.
    pub(crate) fn matters(&self, few: usize) -> bool {
        match self {
            Self::ByStages => false,
            Self::NoWheels(_, count)
            | Self::NoTruth(_, count)
            | Self::NotInMap(count)
            | Self::NoCommand(count)
            | Self::CommandGap(count)
            | Self::SparseWindow(count)
            | Self::NotFinite(count) => *count > few,
            Self::NotRecorded(_) | Self::Constant(..) | Self::TooFew(..) | Self::Unrelated(_) => true,
        }
    }
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotRecorded(what) => write!(f, "{what} not recorded"),
            Self::Constant(what, count) => write!(f, "{what} never change ({count} equal readings)"),
            Self::NoWheels(robot, count) => {
                write!(f, "{count} left out, no odometry of robot {robot} around")
            }
            Self::NoTruth(robot, count) => write!(f, "{count} left out, no truth of robot {robot} near"),
            Self::NotInMap(count) => write!(f, "{count} left out, of landmarks that are not in the map"),
            Self::NoCommand(count) => write!(f, "{count} windows left out at the ends of the commands"),
            Self::CommandGap(count) => {
                write!(f, "{count} windows left out, in or soon after gaps of the commands")
            }
            Self::ByStages => write!(f, "wheel angles are recorded: compared stage by stage"),
            Self::SparseWindow(count) => write!(f, "{count} windows left out, with too few readings"),
            Self::NotFinite(count) => write!(f, "{count} left out that are no finite numbers"),
            Self::TooFew(found, needed) => write!(f, "{found} residuals, a summary needs {needed}"),
            Self::Unrelated(hundredths) => write!(
                f,
                "commands and motion do not go together (correlation {:.2}): are the commands of this run, \
                 of this robot and by its clock?",
                f64::from(*hundredths) / 100.0
            ),
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
    /// Nothing to compare, and why.
    pub(crate) fn without(channel: Channel, omission: Omission) -> Self {
        Self { channel, rows: Vec::new(), omissions: vec![omission] }
    }

    /// As many residuals as will be pushed, and what the plan left out.
    pub(crate) fn planned<T>(channel: Channel, plan: &Plan<T>) -> Self {
        let rows = Vec::with_capacity(plan.items.len());
        Self { channel, rows, omissions: plan.omissions.clone() }
    }

    /// Adds a residual; one that is not finite is counted instead.
    pub(crate) fn push(&mut self, residual: Residual<S>) {
        if residual.is_finite() {
            self.rows.push(residual);
        } else {
            tally(&mut self.omissions, 1, Omission::NotFinite);
        }
    }
}

/// Counts `more` omissions of the kind that `of` makes of a count.
pub(crate) fn tally(omissions: &mut Vec<Omission>, more: usize, of: impl Fn(usize) -> Omission) {
    if more == 0 {
        return;
    }
    let kind = std::mem::discriminant(&of(0));
    for omission in omissions.iter_mut().filter(|omission| std::mem::discriminant(*omission) == kind) {
        let counted = match omission {
            Omission::NoWheels(_, count)
            | Omission::NoTruth(_, count)
            | Omission::NotInMap(count)
            | Omission::NoCommand(count)
            | Omission::CommandGap(count)
            | Omission::SparseWindow(count)
            | Omission::NotFinite(count) => *count,
            _ => continue,
        };
        if of(counted) == *omission {
            *omission = of(counted + more);
            return;
        }
    }
    omissions.push(of(more));
}
