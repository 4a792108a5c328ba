//! Observability of a recorded or planned set of facts.

use std::collections::{BTreeMap, BTreeSet};

use super::analysis::{Coordinates, MeasurementRow, Observability};
use crate::fact::{Absolute, Entry, NominalState, Quantity};
use crate::reference::{ErrorForm, FactContent, facts_from_entries, linearize};
use crate::{BootIndex, Pose2, RobotId};

/// The rows of a set of entries in invariant coordinates, with the robots they speak of (ascending) and
/// each robot's last pose.
///
/// `pose` gives the linearization point of a robot at a nominal state of a boot, usually
/// `G compose N(t)`; where it gives none (a trajectory that is no longer part of the robot's state), the
/// measurement is left out. Left out, too, are measurements that cannot be linearized, and priors: of
/// each boot that is not continued from another, the first absolute pose.
pub fn rows_from(
    entries: &[Entry],
    pose: impl Fn(RobotId, BootIndex, &NominalState) -> Option<Pose2>,
) -> (Vec<RobotId>, Vec<Pose2>, Vec<MeasurementRow>) {
    let mut last: BTreeMap<RobotId, Pose2> = BTreeMap::new();
    let mut waiting = BTreeSet::new();
    let mut linearized = Vec::new();
    for fact in facts_from_entries(entries) {
        let measurement = match &fact.content {
            FactContent::Boot(boot) => {
                if boot.continuation.is_none() {
                    waiting.insert(fact.id.robot);
                }
                if let Some(at) =
                    pose(fact.id.robot, fact.id.boot, &NominalState { nominal: boot.nominal, ..start() })
                {
                    last.insert(fact.id.robot, at);
                }
                continue;
            }
            FactContent::Measurement(measurement) => measurement,
        };
        let is_prior = matches!(measurement.quantity, Quantity::Absolute(Absolute::Pose(_)))
            && waiting.remove(&fact.id.robot);
        let at = |state: &crate::reference::State| pose(state.robot, state.boot, &state.nominal);
        let Some(observer) = at(&measurement.observer) else { continue };
        let observed = measurement.observed.as_ref().map(at);
        if observed == Some(None) {
            continue;
        }
        last.insert(fact.id.robot, observer);
        if let (Some(state), Some(Some(observed))) = (measurement.observed, observed) {
            last.insert(state.robot, observed);
        }
        if is_prior {
            continue;
        }
        let observed = observed.flatten();
        if let Ok(row) = linearize(ErrorForm::Invariant, &measurement.quantity, &observer, observed.as_ref())
        {
            let target = measurement.observed.map(|state| state.robot);
            linearized.push((fact.id.robot, target, row));
        }
    }

    let robots: Vec<RobotId> = last.keys().copied().collect();
    let index = |robot: RobotId| robots.binary_search(&robot).ok();
    let rows = linearized.into_iter().map(|(observer, target, row)| {
        let observer = index(observer).map(|at| (at, row.d_measurement_d_observer));
        let target = target.and_then(index).zip(row.d_measurement_d_observed);
        MeasurementRow { blocks: observer.into_iter().chain(target).collect() }
    });
    let rows = rows.collect();
    (robots, last.into_values().collect(), rows)
}

/// Analyses a set of entries; arguments as for [`rows_from`].
pub fn of_entries(
    entries: &[Entry],
    pose: impl Fn(RobotId, BootIndex, &NominalState) -> Option<Pose2>,
) -> Observability {
    let (robots, poses, rows) = rows_from(entries, pose);
    let positions = poses.iter().map(Pose2::position).collect();
    Observability::of_rows(&robots, &Coordinates::Invariant(positions), &rows)
}

/// The nominal state at the start of a boot, which has no noise behind it.
fn start() -> NominalState {
    NominalState::new(Pose2::identity(), crate::symmetric::Symmetric3::zero())
}
