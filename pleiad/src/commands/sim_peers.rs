//! `pleiad sim-peers`: simulated or recorded robots as a process of their own, which speaks only to the
//! agents' sensor keys.

use std::sync::Arc;
use std::time::Duration;

use anyhow::bail;
use pleiad_bus::{Bus, ZenohBus, ZenohConfig, ZenohMode};
use pleiad_protocol::TeamName;
use pleiad_recording::ReadOptions;
use pleiad_sim_peers::{FeedOptions, Scenario, feed, simulate};

use super::agent::runtime;
use crate::cli::SimPeersArgs;
use crate::{output, setup};

/// Team time per step: far below the two seconds beyond which a stamp counts as wrong, and short enough
/// that online estimates lag by little.
const STEP_S: f64 = 0.1;

pub fn run(args: &SimPeersArgs) -> anyhow::Result<()> {
    let team = TeamName::new(&args.team)?;
    if let Some(speed) = args.speed.filter(|speed| !(speed.is_finite() && *speed > 0.0)) {
        bail!("--speed {speed}: expected a positive number");
    }
    if !(args.patience.is_finite() && args.patience > 0.0) {
        bail!("--patience {}: expected a positive number of seconds", args.patience);
    }
    let recording = if setup::is_recording(&args.input) {
        pleiad_recording::open(&setup::recording_folder(&args.input), &ReadOptions::default())?.0
    } else {
        let scenario = Scenario::load(&args.input)?;
        simulate(&scenario, args.seed.unwrap_or(scenario.seed))?.recording
    };
    let samples = recording.robots.iter().map(|(robot, channels)| (*robot, channels.samples())).collect();
    let acknowledge_within = Duration::from_secs_f64(args.patience);
    let options = FeedOptions { step_s: STEP_S, speed: args.speed, acknowledge_within };
    let reports = runtime()?.block_on(async {
        let config = ZenohConfig {
            mode: ZenohMode::Peer,
            listen: Vec::new(),
            connect: args.connect.clone(),
            multicast: false,
        };
        let bus = Arc::new(ZenohBus::open(&config).await?);
        let mut told = i64::MIN;
        let reports = feed(&bus, &team, samples, options, |now| {
            let second = now.0.div_euclid(1_000_000_000);
            if args.progress && second > told {
                told = second;
                // Whoever started this process may have gone; the agents are fed all the same.
                let _ = output::raw(&format!("{second}\n"));
            }
        })
        .await;
        bus.close().await;
        anyhow::Ok(reports)
    })?;
    for (robot, report) in &reports {
        if report.lost + report.refused > 0 {
            tracing::warn!(
                robot = robot.0,
                accepted = report.accepted,
                refused = report.refused,
                lost = report.lost,
                first_refusal = report.first_refusal.as_deref().unwrap_or("-"),
                "not every sample was taken"
            );
        }
    }
    let accepted: u64 = reports.values().map(|report| report.accepted).sum();
    if accepted == 0 {
        bail!(
            "no agent of team {} took a single sample: are they running at the endpoints given?",
            args.team
        );
    }
    Ok(())
}
