//! A team run to its end: in this process under virtual time, or as agent processes.

use std::time::Instant;

use anyhow::Context;
use pleiad_agent::results;
use pleiad_sim_peers::{Fleet, FleetOptions};

use crate::evaluation::{RobotResult, RunResult};
use crate::output;
use crate::setup::Team;

/// Digest rounds granted after the last sample; without faults one is enough.
const SETTLING_ROUNDS: u32 = 50;

/// Runs all nodes in this process.
pub fn in_process(team: &Team, label: &str) -> anyhow::Result<RunResult> {
    let configs = team.agents.values().map(pleiad_agent::AgentConfig::node).collect::<Result<_, _>>()?;
    let (first, last) = team.span().context("there is not a single sample to run on")?;
    let began = Instant::now();
    let mut fleet = Fleet::new(configs, &FleetOptions::default())?;
    let bar = output::progress(label, last.seconds_since(first));
    fleet.feed(&team.samples, |now| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds of a run")]
        bar.set_position(now.seconds_since(first).max(0.0) as u64);
    });
    let agreed = fleet.settle(last, SETTLING_ROUNDS);
    bar.finish_and_clear();
    let mut notes = team.notes.clone();
    if !agreed {
        notes.push(
            "the robots did not agree at the end: some observations stayed without their other half"
                .to_owned(),
        );
    }
    let mut robots = std::collections::BTreeMap::new();
    let mut ledger = None;
    for (robot, mut outcome) in fleet.into_outcomes() {
        for notice in &outcome.notices {
            notes.push(format!("robot {robot}: {notice}"));
        }
        let summary = results::summary(&mut outcome.node, outcome.messages, outcome.bytes);
        let result = RobotResult { settled: outcome.node.settled(), online: outcome.online, summary };
        ledger.get_or_insert_with(|| outcome.node.ledger().clone());
        robots.insert(robot, result);
    }
    let ledger = ledger.context("the team has no robot")?;
    Ok(RunResult { robots, ledger, notes, wall_s: began.elapsed().as_secs_f64(), processes: 0 })
}
