//! `pleiad agent`: one robot's agent, until told to shut down.

use std::sync::Arc;

use anyhow::Context;
use pleiad_agent::AgentConfig;
use pleiad_agent::config::BusMode;
use pleiad_bus::{Bus, FaultyBus, ZenohBus, ZenohConfig, ZenohMode};
use pleiad_estimation::{RobotId, Timestamp};

use crate::cli::AgentArgs;

/// Runs an agent from its configuration file.
pub fn run(args: &AgentArgs) -> anyhow::Result<()> {
    let config = AgentConfig::read(&args.config)?;
    runtime()?.block_on(async {
        let _limits = report_file_limits();
        let bus = Arc::new(ZenohBus::open(&zenoh_config(&config)).await?);
        // Every start of the process is told apart from every other by a number nobody can guess.
        let nonce = getrandom::u64().context("the system gives no random number")?;
        let outcome = match (config.fault_plan()?, &config.faults) {
            (Some(plan), Some(faults)) => {
                tracing::warn!(plan = %faults.plan.display(), "messages of peers are lost and delayed on purpose");
                let mut faulty = FaultyBus::new(bus.clone(), RobotId(config.robot), plan, faults.seed);
                if let Some(origin_s) = faults.origin_s {
                    faulty = faulty.since(Timestamp::from_seconds(origin_s));
                }
                pleiad_agent::driver::run(&config, &faulty, nonce, stopped()).await
            }
            _ => pleiad_agent::driver::run(&config, &bus, nonce, stopped()).await,
        };
        bus.close().await;
        Ok(outcome?)
    })
}

/// A file that may not grow any further is an error of the write, by file and cause, rather than the end of
/// the process by a signal (SIGXFSZ), for as long as this is kept.
fn report_file_limits() -> Option<tokio::signal::unix::Signal> {
    const SIGXFSZ: i32 = 25;
    let caught = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::from_raw(SIGXFSZ));
    caught.inspect_err(|error| tracing::warn!(%error, "SIGXFSZ cannot be caught")).ok()
}

/// The runtime that zenoh needs: several threads.
pub fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the asynchronous runtime")
}

fn zenoh_config(config: &AgentConfig) -> ZenohConfig {
    ZenohConfig {
        mode: match config.bus.mode {
            BusMode::Peer => ZenohMode::Peer,
            BusMode::Client => ZenohMode::Client,
        },
        listen: config.bus.listen.clone(),
        connect: config.bus.connect.clone(),
        multicast: config.bus.multicast,
    }
}

/// Ends at Ctrl-C or SIGTERM.
pub async fn stopped() {
    let interrupt = tokio::signal::ctrl_c();
    let mut terminate = match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
        Ok(terminate) => terminate,
        Err(error) => {
            tracing::warn!(%error, "SIGTERM cannot be caught: results will not be written on it");
            // A signal that cannot be awaited leaves the other one.
            let _ = interrupt.await;
            return;
        }
    };
    tokio::select! {
        _ = interrupt => {}
        _ = terminate.recv() => {}
    }
}
