//! The facts of a team, in a form in which their noise can be stated anew.

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use pleiad_agent::NodeConfig;
use pleiad_agent::config::{AgentConfig, ErrorName};
use pleiad_estimation::likelihood::{Level, Levels, TunableFact, UnitTrajectory};
use pleiad_sim_peers::{Fleet, FleetOptions};

use crate::levels;
use crate::setup::Team;

/// Digest rounds granted after the last sample; without faults one is enough.
const SETTLING_ROUNDS: u32 = 50;

/// What a search needs to know.
pub struct Gathered {
    /// In the order of the fold.
    pub facts: Vec<TunableFact>,
    /// As stated; where robots differ, the first that states a level.
    pub start: Levels,
    /// The levels that some robot's configuration has room for.
    pub stated: Vec<Level>,
    pub notes: Vec<String>,
}

/// Runs the team once, in this process.
pub fn gather(team: &Team) -> anyhow::Result<Gathered> {
    for (robot, agent) in &team.agents {
        if agent.filter.error == ErrorName::Additive {
            bail!(
                "filter.error = \"additive\" (robot {robot}): innovations of the invariant filter are what is \
                 maximized; take it out of the noise, and put it back into what is found"
            );
        }
        if agent.filter.join {
            bail!(
                "filter.join = true (robot {robot}): how many sightings it takes to join frames depends on the noise, so that \
                 likelihoods would be of different readings; take it out of the noise, and put it back into what is found"
            );
        }
        if agent.filter.clutter.is_some_and(|clutter| clutter.misnamed > 0.0) {
            bail!(
                "filter.clutter.misnamed (robot {robot}): likelihoods are of readings that are of what they name, or of nothing; \
                 take it out of the noise, and put it back into what is found"
            );
        }
        if agent.calibration.is_some() {
            bail!(
                "[calibration] (robot {robot}): noise levels are found with parameters known; take the table out of \
                 the noise, and put it back into what is found"
            );
        }
    }
    let configs = team.agents.values().map(|agent| {
        // The estimates that an agent publishes are not needed.
        Ok(NodeConfig { estimate_rate_hz: 0.01, ..agent.node()? })
    });
    let configs = configs.collect::<Result<Vec<_>, pleiad_agent::ConfigError>>()?;
    let mut fleet = Fleet::new(configs, &FleetOptions::default())?;
    fleet.feed(&team.samples, |_| {});
    let (_, last) = team.span().context("there is not a single sample in the recording")?;
    let mut notes = team.notes.clone();
    if !fleet.settle(last, SETTLING_ROUNDS) {
        notes.push(
            "the robots did not agree at the end: some observations stayed without their other half"
                .to_owned(),
        );
    }
    let outcomes = fleet.into_outcomes();
    let mut units = BTreeMap::new();
    for (robot, outcome) in &outcomes {
        let quiet = team.agents.get(robot).is_some_and(|agent| agent.motion.quiet_at_standstill);
        for (boot, ticks) in outcome.node.nominal_ticks() {
            units.insert((*robot, boot), UnitTrajectory::new(ticks, quiet));
        }
    }
    let ledger = outcomes.values().next().context("there is no robot in the recording")?.node.ledger();
    let mut facts = Vec::new();
    for (key, record) in ledger.facts() {
        let units =
            |robot, boot, time| units.get(&(robot, boot)).and_then(|own: &UnitTrajectory| own.at(time));
        let fact = TunableFact::new(*key, record.fact, units).with_context(|| {
            format!(
                "the trajectory of robot {} is no longer kept at {:.1} s: raise motion.history_samples",
                key.id.robot,
                key.time.seconds()
            )
        })?;
        facts.push(fact);
    }
    let (start, stated) = start(&team.agents, &mut notes);
    Ok(Gathered { facts, start, stated, notes })
}

/// One level for the team, where its robots were told different ones too.
fn start<'a, K: Ord + std::fmt::Display + 'a>(
    agents: impl IntoIterator<Item = (&'a K, &'a AgentConfig)>,
    notes: &mut Vec<String>,
) -> (Levels, Vec<Level>) {
    let told: Vec<_> = agents
        .into_iter()
        .map(|(robot, agent)| (robot, levels::stated(&agent.motion, &agent.sensors)))
        .collect();
    let mut start = Levels::default();
    let mut stated = Vec::new();
    for level in Level::ALL {
        let mut values = told.iter().filter_map(|(robot, told)| Some((robot, told[level as usize]?)));
        let Some((_, first)) = values.next() else { continue };
        stated.push(level);
        start[level] = first;
        if let Some((robot, other)) = values.find(|(_, other)| other.to_bits() != first.to_bits()) {
            notes.push(format!(
                "{}: robot {robot} was told {other}, another one {first}: one level is sought for all, from {first}",
                levels::key(level)
            ));
        }
    }
    (start, stated)
}
