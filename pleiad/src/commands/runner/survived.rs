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
use pleiad_estimation::fold::FoldConfig;
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

/// What the robots wrote down, and what they made of it.
struct Evidence {
    /// Entries of each journal.
    journals: BTreeMap<RobotId, Vec<Entry>>,
    /// Observations that the estimates account for: used, rejected, void or pending.
    counted: usize,
    /// The estimate that each agent announced at its end.
    announced: BTreeMap<RobotId, String>,
    fold: FoldConfig,
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
    let mut journals = BTreeMap::new();
    for robot in team.agents.keys() {
        let records = Journal::read(&folder::agent(out, *robot).join(driver::JOURNAL))?;
        let entries = records.into_iter().filter_map(|record| match record {
            Record::Entry(entry) => Some(entry),
            _ => None,
        });
        journals.insert(*robot, entries.collect());
    }
    let agent = team.agents.values().next().context("the team has no robot")?;
    let counts = result.ledger.as_ref().context("a team that keeps facts")?.counts();
    let announced = result.robots.iter().map(|(robot, own)| (*robot, own.summary.estimate.clone()));
    let evidence = Evidence {
        journals,
        counted: counts.relative + counts.absolute + counts.void + counts.pending,
        announced: announced.collect(),
        fold: agent.node()?.fold,
    };
    let survived = evidence.compared(befallen, partitions)?;
    if survived.lost > 0 || survived.counted_twice > 0 || survived.estimates > 1 {
        bail!(
            "the team did not come through its faults whole: {survived:?}; estimates {:?}",
            evidence.announced
        );
    }
    Ok(survived)
}

impl Evidence {
    fn compared(&self, befallen: Befallen, partitions: usize) -> anyhow::Result<Survived> {
        let mut union: BTreeMap<EntryId, &Entry> = BTreeMap::new();
        for entry in self.journals.values().flatten() {
            let first = union.entry(entry.id).or_insert(entry);
            if Fingerprint::of(first) != Fingerprint::of(entry) {
                bail!("{} has two contents: {:?} and {:?}", entry.id, first.body, entry.body);
            }
        }
        let held = |own: &Vec<Entry>| own.iter().map(|entry| entry.id).collect::<BTreeSet<_>>().len();
        let missing: usize = self.journals.values().map(|own| union.len() - held(own)).sum();
        let observed = union.values().filter(|entry| match &entry.body {
            // A prior places a robot; it is not counted among the facts.
            Body::Observation(seen) => !matches!(seen.quantity, Quantity::Absolute(Absolute::Pose(_))),
            _ => false,
        });
        let observations = observed.count();
        let boots = union.values().filter(|entry| matches!(entry.body, Body::Boot(_))).count();
        let mut undisturbed = Ledger::new(self.fold);
        for entry in union.values() {
            undisturbed.insert((*entry).clone());
        }
        let estimates = self.announced.values().cloned().chain([undisturbed.fingerprint().to_string()]);
        Ok(Survived {
            befallen,
            partitions,
            boots,
            entries: union.len(),
            observations,
            lost: missing + observations.saturating_sub(self.counted),
            counted_twice: self.counted.saturating_sub(observations),
            estimates: estimates.collect::<BTreeSet<String>>().len(),
        })
    }
}

/// How often a plan takes robots from one another.
pub fn partitions(plan: &pleiad_bus::FaultPlan) -> usize {
    let parts = |fault: &Fault| matches!(fault, Fault::Partition { .. } | Fault::Away { .. });
    plan.rules.iter().filter(|rule| parts(&rule.fault)).count()
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::fact::{Boot, Noise, NoiseRef, NominalState, Observation, Profile};
    use pleiad_estimation::symmetric::Symmetric3;
    use pleiad_estimation::{BootIndex, Pose2, Sequence, Timestamp};

    use super::*;

    fn entry(robot: u32, sequence: u64, body: Body) -> Entry {
        let id = EntryId { robot: RobotId(robot), boot: BootIndex(0), sequence: Sequence(sequence) };
        Entry { id, body, extension: Vec::new() }
    }

    /// The log of a robot that starts and gets three position fixes.
    fn log(robot: u32) -> Vec<Entry> {
        let configuration = Ledger::new(FoldConfig::default()).configuration();
        let boot = Boot {
            time: Timestamp(0),
            nonce: 1,
            configuration,
            nominal: Pose2::identity(),
            continuation: None,
            calibration: None,
        };
        let noise = Noise::from_sigmas(&[0.1, 0.1]);
        let mut entries = vec![
            entry(robot, 0, Body::Boot(boot)),
            entry(robot, 1, Body::Profile(Profile { index: 0, noise })),
        ];
        for number in 2..5 {
            let observation = Observation {
                time: Timestamp(number),
                quantity: Quantity::Absolute(Absolute::Position([f64::from(robot), 0.0])),
                noise: NoiseRef::Profile(0),
                observer: NominalState::new(Pose2::identity(), Symmetric3::zero()),
            };
            entries.push(entry(robot, u64::try_from(number).unwrap(), Body::Observation(observation)));
        }
        entries
    }

    fn whole() -> Evidence {
        let all: Vec<Entry> = [log(1), log(2)].concat();
        let mut ledger = Ledger::new(FoldConfig::default());
        for entry in all.clone() {
            ledger.insert(entry);
        }
        let estimate = ledger.fingerprint().to_string();
        Evidence {
            journals: [1, 2].map(|robot| (RobotId(robot), all.clone())).into(),
            counted: 6,
            announced: [1, 2].map(|robot| (RobotId(robot), estimate.clone())).into(),
            fold: FoldConfig::default(),
        }
    }

    #[test]
    fn a_team_that_is_whole_is_found_so() {
        let found = whole().compared(Befallen::default(), 3).unwrap();
        assert_eq!((found.boots, found.entries, found.observations, found.partitions), (2, 10, 6, 3));
        assert_eq!((found.lost, found.counted_twice, found.estimates), (0, 0, 1));
    }

    #[test]
    fn what_is_missing_in_one_journal_is_lost() {
        let mut evidence = whole();
        evidence.journals.get_mut(&RobotId(2)).unwrap().remove(3);
        assert_eq!(evidence.compared(Befallen::default(), 0).unwrap().lost, 1);
    }

    #[test]
    fn what_is_counted_too_often_or_not_at_all_is_found() {
        let twice = Evidence { counted: 7, ..whole() }.compared(Befallen::default(), 0).unwrap();
        assert_eq!((twice.lost, twice.counted_twice), (0, 1));
        let never = Evidence { counted: 5, ..whole() }.compared(Befallen::default(), 0).unwrap();
        assert_eq!((never.lost, never.counted_twice), (1, 0));
    }

    #[test]
    fn an_estimate_of_its_own_is_found_and_so_is_one_that_all_share_and_the_journals_do_not_give() {
        let mut evidence = whole();
        evidence.announced.insert(RobotId(1), "another".to_owned());
        assert_eq!(evidence.compared(Befallen::default(), 0).unwrap().estimates, 2);
        evidence.announced.insert(RobotId(2), "another".to_owned());
        assert_eq!(evidence.compared(Befallen::default(), 0).unwrap().estimates, 2);
    }

    #[test]
    fn two_contents_of_one_entry_are_an_error() {
        let mut evidence = whole();
        let entries = evidence.journals.get_mut(&RobotId(2)).unwrap();
        let (third, fourth) = (entries[3].id, entries[4].body.clone());
        entries[3] = Entry { id: third, body: fourth, extension: Vec::new() };
        let error = evidence.compared(Befallen::default(), 0).unwrap_err().to_string();
        assert!(error.contains("two contents"), "{error}");
    }
}
