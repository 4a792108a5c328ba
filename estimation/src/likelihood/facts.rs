//! Facts whose noise can be stated anew.

use super::{Level, Levels};
use crate::fact::{Boot, Continuation, NominalState, Quantity};
use crate::fold::{Fact, FactKey};
use crate::symmetric::Symmetric3;
use crate::{BootIndex, RobotId, Timestamp};

/// What each level of the motion would have accumulated were it 1, in the order of [`Level::ALL`]: the noise sum is linear in
/// the squares of the levels.
pub type UnitSums = [Symmetric3; Level::MOTION];

/// The noise sums of a nominal trajectory per unit of each level.
#[derive(Clone, Debug)]
pub struct UnitTrajectory {
    ticks: Vec<(Timestamp, UnitSums)>,
}

impl UnitTrajectory {
    /// Of the ticks of a trajectory, by time; `quiet_at_standstill` as in [`MotionNoise`](crate::motion::MotionNoise).
    pub fn new(
        ticks: impl IntoIterator<Item = (Timestamp, NominalState)>,
        quiet_at_standstill: bool,
    ) -> Self {
        let mut ticks = ticks.into_iter();
        let mut units = Vec::new();
        let Some((mut before, mut last)) = ticks.next() else { return Self { ticks: units } };
        let mut sums = [Symmetric3::zero(); Level::MOTION];
        units.push((before, sums));
        for (time, state) in ticks {
            let motion = last.nominal.between(&state.nominal).log();
            let distance_m = (motion.x * motion.x + motion.y * motion.y).sqrt();
            let turn_rad = motion.z.abs();
            if !(quiet_at_standstill && distance_m == 0.0 && turn_rad == 0.0) {
                let seconds = time.seconds_since(before);
                let axes = [
                    Symmetric3::diagonal(seconds, 0.0, 0.0),
                    Symmetric3::diagonal(0.0, seconds, 0.0),
                    Symmetric3::diagonal(0.0, 0.0, seconds),
                    Symmetric3::diagonal(distance_m, 0.0, 0.0),
                    Symmetric3::diagonal(0.0, 0.0, distance_m),
                    Symmetric3::diagonal(0.0, 0.0, turn_rad),
                ];
                // At the pose after the step, as the trajectory does.
                let adjoint = state.nominal.adjoint();
                for (sum, axis) in sums.iter_mut().zip(axes) {
                    *sum = sum.plus(axis.congruence(&adjoint));
                }
            }
            units.push((time, sums));
            (before, last) = (time, state);
        }
        Self { ticks: units }
    }

    /// The sums at a time, linear between ticks; `None` outside.
    pub fn at(&self, time: Timestamp) -> Option<UnitSums> {
        let after = self.ticks.partition_point(|(tick, _)| *tick < time);
        let (next_time, next) = self.ticks.get(after)?;
        if *next_time == time {
            return Some(*next);
        }
        let (last_time, last) = self.ticks.get(after.checked_sub(1)?)?;
        let share = time.seconds_since(*last_time) / next_time.seconds_since(*last_time);
        Some(std::array::from_fn(|k| last[k].plus(next[k].minus(last[k]).scaled(share))))
    }
}

/// A fact, and what its noise sums are made of.
#[derive(Clone, Debug)]
pub struct TunableFact {
    key: FactKey,
    fact: Fact,
    observer: UnitSums,
    other: UnitSums,
}

impl TunableFact {
    /// A fact with the unit sums that `units` knows of a robot's boot at a time.
    ///
    /// `None` if `units` does not know them: the trajectory is no longer kept there.
    pub fn new(
        key: FactKey,
        fact: Fact,
        units: impl Fn(RobotId, BootIndex, Timestamp) -> Option<UnitSums>,
    ) -> Option<Self> {
        let none = [Symmetric3::zero(); Level::MOTION];
        let robot = key.id.robot;
        let (observer, other) = match &fact {
            Fact::Boot(Boot { continuation, .. }) => {
                let last = match continuation {
                    Some(from) => units(robot, from.previous, from.time)?,
                    None => none,
                };
                (last, none)
            }
            Fact::Observation { quantity, other, .. } => {
                let observer = units(robot, key.id.boot, key.time)?;
                let other = match (quantity, other) {
                    (Quantity::Robot { robot, .. }, Some((boot, _))) => units(*robot, *boot, key.time)?,
                    _ => none,
                };
                (observer, other)
            }
        };
        Some(Self { key, fact, observer, other })
    }

    /// Where it stands in the order of the fold.
    pub fn key(&self) -> &FactKey {
        &self.key
    }

    /// The fact as it was gathered.
    pub fn gathered(&self) -> &Fact {
        &self.fact
    }

    /// The fact as it would have been under these levels.
    pub fn under(&self, levels: &Levels) -> Fact {
        let state = |state: &NominalState, unit: &UnitSums| NominalState {
            noise_sum: levels.noise_sum(unit),
            ..*state
        };
        match &self.fact {
            Fact::Boot(boot) => Fact::Boot(Boot {
                continuation: boot
                    .continuation
                    .map(|from| Continuation { last: state(&from.last, &self.observer), ..from }),
                ..*boot
            }),
            Fact::Observation { quantity, noise, observer, other } => Fact::Observation {
                quantity: *quantity,
                noise: levels.noise(quantity).or(*noise),
                observer: state(observer, &self.observer),
                other: other.as_ref().map(|(boot, of)| (*boot, state(of, &self.other))),
            },
        }
    }
}
