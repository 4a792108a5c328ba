//! What befell a team's processes, and what is left of what they said.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, bail};
use pleiad_agent::journal::Journal;
use pleiad_agent::{Record, driver};
use pleiad_bus::faults::Fault;
use pleiad_coordinator::Act;
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::{Absolute, Body, Entry, EntryId, Fingerprint, Quantity};
use pleiad_estimation::ledger::Ledger;
use serde::Serialize;

use crate::evaluation::RunResult;
use crate::folder;
use crate::setup::Team;

/// How often what befell a process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Befallen {
    /// Agents killed, and started again.
    pub kills: usize,
    /// Agents stopped, and let go on.
    pub stops: usize,
    /// Disks filled under a journal.
    pub full_disks: usize,
    /// Coordinators killed.
    pub coordinator_deaths: usize,
}

impl Befallen {
    pub(super) fn count(&mut self, act: Act) {
        match act {
            Act::Kill(_) => self.kills += 1,
            Act::Stop(_) => self.stops += 1,
            Act::FillDisk(_) => self.full_disks += 1,
            Act::KillCoordinator => self.coordinator_deaths += 1,
            Act::Start(_) | Act::Resume(_) | Act::EmptyDisk(_) => {}
        }
    }
}

/// `faults` of `run --json`: what went wrong, and what became of what the robots wrote down.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Survived {
    #[serde(flatten)]
    pub befallen: Befallen,
    /// Partitions, and robots out of range.
    pub partitions: usize,
    /// Boots of all robots: one each, and one more for every gap.
    pub boots: usize,
    /// Entries in the union of all journals.
    pub entries: usize,
    /// Observations among them.
    pub observations: usize,
    /// Entries that are in one journal and missing in another, summed over the journals, and observations
    /// that no estimate accounts for.
    pub lost: usize,
    /// What the estimates account for beyond these observations.
    pub counted_twice: usize,
    /// Different estimates at the end, the undisturbed one included: 1 if all is well.
    pub estimates: usize,
}

/// Compares every journal with the union of all, and every estimate with a fold of the union from nothing,
/// which nothing has disturbed.
///
/// # Errors
/// Journals that cannot be read, and any difference.
pub fn survived(
    team: &Team,
    out: &Path,
    befallen: Befallen,
    result: &RunResult,
    partitions: usize,
) -> anyhow::Result<Survived> {
    let mut journals: BTreeMap<RobotId, BTreeMap<EntryId, Fingerprint>> = BTreeMap::new();
    let mut union: BTreeMap<EntryId, Entry> = BTreeMap::new();
    for robot in team.agents.keys() {
        let own = journals.entry(*robot).or_default();
        for record in Journal::read(&folder::agent(out, *robot).join(driver::JOURNAL))? {
            let Record::Entry(entry) = record else { continue };
            let print = Fingerprint::of(&entry);
            if let Some(other) = union.get(&entry.id).filter(|other| Fingerprint::of(*other) != print) {
                bail!("{} has two contents: {:?} and {:?}", entry.id, other.body, entry.body);
            }
            own.insert(entry.id, print);
            union.insert(entry.id, entry);
        }
    }
    let missing: usize = journals.values().map(|own| union.len() - own.len()).sum();
    let observed = union.values().filter(|entry| match &entry.body {
        // A prior places a robot; it is not counted among the facts.
        Body::Observation(seen) => !matches!(seen.quantity, Quantity::Absolute(Absolute::Pose(_))),
        _ => false,
    });
    let observations = observed.count();
    let boots = union.values().filter(|entry| matches!(entry.body, Body::Boot(_))).count();
    let entries = union.len();
    let agent = team.agents.values().next().context("the team has no robot")?;
    let mut undisturbed = Ledger::new(agent.node()?.fold);
    for entry in union.into_values() {
        undisturbed.insert(entry);
    }
    let counts = result.ledger.counts();
    let counted = counts.relative + counts.absolute + counts.void + counts.pending;
    let announced = result.robots.values().map(|robot| robot.summary.estimate.clone());
    let estimates: BTreeSet<String> = announced.chain([undisturbed.fingerprint().to_string()]).collect();
    let survived = Survived {
        befallen,
        partitions,
        boots,
        entries,
        observations,
        lost: missing + observations.saturating_sub(counted),
        counted_twice: counted.saturating_sub(observations),
        estimates: estimates.len(),
    };
    if survived.lost > 0 || survived.counted_twice > 0 || survived.estimates > 1 {
        bail!("the team did not come through its faults whole: {survived:?}");
    }
    Ok(survived)
}

/// How often a plan takes robots from one another.
pub fn partitions(plan: &pleiad_bus::FaultPlan) -> usize {
    let parts = |fault: &Fault| matches!(fault, Fault::Partition { .. } | Fault::Away { .. });
    plan.rules.iter().filter(|rule| parts(&rule.fault)).count()
}
