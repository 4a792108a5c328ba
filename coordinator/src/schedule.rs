//! When the faults of a plan befall processes: a state machine without I/O, asked with the team's time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use pleiad_bus::FaultPlan;
use pleiad_bus::faults::{Fault, Rule};
use pleiad_protocol::RobotId;

/// What is to be done to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Act {
    /// Start it again, if it has ended.
    Start(RobotId),
    /// Let it go on.
    Resume(RobotId),
    /// Let its files grow again, and start it again if it has ended of it.
    EmptyDisk(RobotId),
    /// Kill it.
    Kill(RobotId),
    /// Let it stand still.
    Stop(RobotId),
    /// Let its files grow no more.
    FillDisk(RobotId),
    /// Kill the coordinator.
    KillCoordinator,
}

/// A plan that cannot be carried out.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScheduleError {
    /// A robot that the team does not have.
    #[error("fault[{index}].robots names {robot}; expected robots of this team: {team}")]
    UnknownRobot {
        /// Which fault of the plan.
        index: usize,
        /// Whom it names.
        robot: RobotId,
        /// Who there is.
        team: String,
    },
    /// Two things at once.
    #[error(
        "fault[{index}] and fault[{other}] befall the process of robot {robot} at the same time; let one end \
         before the other starts"
    )]
    Overlap {
        /// Which fault of the plan.
        index: usize,
        /// An earlier one.
        other: usize,
        /// Whom both befall.
        robot: RobotId,
    },
    /// Random times that nobody has drawn.
    #[error("fault[{index}].every_s: the random times of this plan have not been drawn")]
    Random {
        /// Which fault of the plan.
        index: usize,
    },
    /// The death of a coordinator that somebody still needs.
    #[error(
        "fault[{index}] is the death of the coordinator and fault[{other}] befalls an agent's process, which \
         nobody would start again; put them into two plans"
    )]
    NobodyLeft {
        /// The death of the coordinator.
        index: usize,
        /// The other.
        other: usize,
    },
    /// It dies but once.
    #[error("fault[{index}] is the second death of the coordinator; remove it")]
    Twice {
        /// The second.
        index: usize,
    },
}

/// What is still to be done, and to whom something has been done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule {
    /// By time, s; what ends before what begins.
    acts: VecDeque<(f64, Act)>,
}

impl Schedule {
    /// The faults of a plan that befall processes; times are seconds into the run.
    ///
    /// # Errors
    /// [`ScheduleError`] for the first that makes no sense.
    pub fn new(plan: &FaultPlan, team: &BTreeSet<RobotId>) -> Result<Self, ScheduleError> {
        let mut taken: BTreeMap<RobotId, Vec<(usize, &Rule)>> = BTreeMap::new();
        let mut death = None;
        let mut acts = Vec::new();
        let rules = plan.rules.iter().enumerate().filter(|(_, rule)| rule.fault.is_of_processes());
        for (index, rule) in rules {
            if rule.again.is_some() {
                return Err(ScheduleError::Random { index });
            }
            if rule.fault == Fault::CoordinatorDies {
                if death.replace(index).is_some() {
                    return Err(ScheduleError::Twice { index });
                }
                acts.push((rule.start_s, Act::KillCoordinator));
            }
            for robot in rule.fault.robots().into_iter().flatten().copied() {
                if !team.contains(&robot) {
                    let team = team.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                    return Err(ScheduleError::UnknownRobot { index, robot, team });
                }
                let befallen = taken.entry(robot).or_default();
                let overlaps =
                    |(_, other): &&(usize, &Rule)| rule.start_s < other.end_s && other.start_s < rule.end_s;
                if let Some((other, _)) = befallen.iter().find(overlaps) {
                    return Err(ScheduleError::Overlap { index, other: *other, robot });
                }
                befallen.push((index, rule));
                let (begin, end) = match rule.fault {
                    Fault::Stop { .. } => (Act::Stop(robot), Act::Resume(robot)),
                    Fault::DiskFull { .. } => (Act::FillDisk(robot), Act::EmptyDisk(robot)),
                    _ => (Act::Kill(robot), Act::Start(robot)),
                };
                acts.push((rule.start_s, begin));
                acts.push((rule.end_s, end));
            }
        }
        let other = taken.values().flatten().map(|(index, _)| *index).min();
        if let (Some(index), Some(other)) = (death, other) {
            return Err(ScheduleError::NobodyLeft { index, other });
        }
        acts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Ok(Self { acts: acts.into() })
    }

    /// Whether nothing befalls any process.
    pub fn is_empty(&self) -> bool {
        self.acts.is_empty()
    }

    /// Whether the coordinator is to die.
    pub fn kills_coordinator(&self) -> bool {
        self.acts.iter().any(|(_, act)| *act == Act::KillCoordinator)
    }

    /// What is due by `t_s`, in order. Each act is told once.
    pub fn due(&mut self, t_s: f64) -> Vec<Act> {
        let due = self.acts.partition_point(|(at_s, _)| *at_s <= t_s);
        self.acts.drain(..due).map(|(_, act)| act).collect()
    }

    /// Ends everything that has begun, and begins nothing any more.
    pub fn end(&mut self) -> Vec<Act> {
        let mut coming = BTreeSet::new();
        let mut acts = Vec::new();
        for (_, act) in std::mem::take(&mut self.acts) {
            match act {
                Act::Kill(robot) | Act::Stop(robot) | Act::FillDisk(robot) => {
                    coming.insert(robot);
                }
                // What ends without beginning before has begun already.
                Act::Start(robot) | Act::Resume(robot) | Act::EmptyDisk(robot) => {
                    if !coming.remove(&robot) {
                        acts.push(act);
                    }
                }
                Act::KillCoordinator => {}
            }
        }
        acts
    }
}

#[cfg(test)]
mod tests;
