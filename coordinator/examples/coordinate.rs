//! A coordinator on its own: reads the configuration it is given and runs that team until Ctrl-C.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use pleiad_bus::{Bus, ZenohBus};
use pleiad_coordinator::{CoordinatorConfig, run};

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give the coordinator's configuration")?;
    let config = CoordinatorConfig::read(Path::new(&path))?;
    let bus = Arc::new(ZenohBus::open(&config.bus.zenoh()).await?);
    let stop = async {
        // Without a handler the signal would end this process at once.
        let _ = tokio::signal::ctrl_c().await;
    };
    let report = run(&config, Arc::clone(&bus), stop).await;
    bus.close().await;
    let failed = report?.failed();
    if failed.is_empty() { Ok(()) } else { Err(format!("these agents failed: {failed:?}").into()) }
}
