//! `pleiad evict`: an operator's word that a robot will not come back.

use std::sync::Arc;
use std::time::Duration;

use anyhow::bail;
use pleiad_bus::{Bus, ZenohBus, ZenohConfig};
use pleiad_coordinator::{CoordinatorError, EvictError, Remote};
use pleiad_estimation::RobotId;
use pleiad_protocol::TeamName;

use super::agent::runtime;
use crate::cli::EvictArgs;
use crate::output;

/// How long agents are looked for.
const FOUND_WITHIN: Duration = Duration::from_secs(10);

pub fn run(args: &EvictArgs) -> anyhow::Result<()> {
    let team = TeamName::new(&args.team)?;
    if !(args.within.is_finite() && args.within > 0.0) {
        bail!("--within {}: expected a positive number of seconds", args.within);
    }
    let robot = RobotId(args.robot);
    let found = runtime()?.block_on(async {
        let config = ZenohConfig { connect: args.connect.clone(), ..ZenohConfig::default() };
        let bus = Arc::new(ZenohBus::open(&config).await.map_err(CoordinatorError::from)?);
        let outcome = async {
            let others = Remote::find(bus.clone(), team, FOUND_WITHIN).await?;
            if others.robots().is_empty() {
                let seconds = FOUND_WITHIN.as_secs_f64();
                return Err(EvictError::Nobody { team: args.team.clone(), seconds });
            }
            others.evict(robot, args.anyway, Duration::from_secs_f64(args.within)).await?;
            Ok(others)
        };
        let outcome = outcome.await;
        bus.close().await;
        outcome
    })?;
    let decided = found.robots().iter().filter(|other| **other != robot).map(ToString::to_string);
    let decided = decided.collect::<Vec<_>>().join(", ");
    output::raw(&format!("robot {robot} is evicted from team {}; decided by {decided}\n", args.team))
}
