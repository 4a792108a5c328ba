//! `pleiad coordinator`: launch and watch the agents of a configuration.

use std::sync::Arc;

use anyhow::Context;
use pleiad_bus::{Bus, ZenohBus};
use pleiad_coordinator::CoordinatorConfig;

use super::agent::{runtime, stopped};
use crate::cli::CoordinatorArgs;

pub fn run(args: &CoordinatorArgs) -> anyhow::Result<()> {
    let mut config = CoordinatorConfig::read(&args.config)?;
    if config.executable.is_none() {
        config.executable = Some(std::env::current_exe().context("cannot find this program's own file")?);
    }
    runtime()?.block_on(async {
        let bus = Arc::new(ZenohBus::open(&config.bus.zenoh()).await?);
        let outcome = pleiad_coordinator::run(&config, bus.clone(), stopped()).await;
        bus.close().await;
        outcome?;
        Ok(())
    })
}
