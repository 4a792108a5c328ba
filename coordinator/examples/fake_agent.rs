//! What a coordinator sees of an agent, and nothing else: a liveliness token, a published status, answers
//! on the control key. How it misbehaves is in its configuration.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::time::Duration;

use pleiad_bus::{Bus, Query, ZenohBus, ZenohConfig};
use pleiad_estimation::fact::{Fingerprint, LogId};
use pleiad_estimation::{BootIndex, RobotId};
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{
    ControlReply, ControlRequest, FactCounts, LogStatus, Message, SampleCounts, Status, TeamName,
};
use serde::Deserialize;
use tokio::signal::unix::{SignalKind, signal};

/// It ends by itself after this, so that nothing is left behind by a test that failed.
const LIFETIME: Duration = Duration::from_mins(3);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    team: String,
    robot: u32,
    listen: String,
    connect: Vec<String>,
    mode: Mode,
    /// Entries it claims to hold of robot 1's log.
    held: u64,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Mode {
    /// As it should be.
    Normal,
    /// Ends with code 3.
    Crash,
    /// Ends with code 3 the first time.
    CrashOnce,
    /// Runs without a word.
    Silent,
    /// Refuses to end, and does not heed SIGTERM.
    Stubborn,
}

fn status(config: &Config, finished: bool) -> Status {
    let log = LogId { robot: RobotId(1), boot: BootIndex(0) };
    Status {
        robot: RobotId(config.robot),
        boot: BootIndex(0),
        configuration: 7,
        logs: vec![LogStatus { log, held: config.held, chain: Fingerprint([1; 16]) }],
        facts: FactCounts::default(),
        estimate: Fingerprint([2; 16]),
        odometry_until: None,
        samples: SampleCounts::default(),
        input_ended: finished,
        drained: finished,
        closure: None,
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [agent, option, path] = arguments.as_slice() else { return Err("agent --config FILE".into()) };
    if agent != "agent" || option != "--config" {
        return Err("agent --config FILE".into());
    }
    let config: Config = toml::from_str(&std::fs::read_to_string(path)?)?;
    let first = std::fs::File::create_new(Path::new(path).with_extension("started")).is_ok();
    if config.mode == Mode::Crash || config.mode == Mode::CrashOnce && first {
        writeln!(std::io::stderr(), "planted crash of robot {}", config.robot)?;
        std::process::exit(3);
    }
    // Whoever outlives this has been forgotten.
    tokio::time::timeout(LIFETIME, live(&config)).await?
}

async fn live(config: &Config) -> Result<(), Box<dyn Error>> {
    if config.mode == Mode::Silent {
        std::future::pending::<()>().await;
    }
    let mut terminate = signal(SignalKind::terminate())?;
    let (team, robot) = (TeamName::new(&config.team)?, RobotId(config.robot));
    let (listen, connect) = (vec![config.listen.clone()], config.connect.clone());
    let bus = ZenohBus::open(&ZenohConfig { listen, connect, ..ZenohConfig::default() }).await?;
    let mut control = bus.serve(&keys::of(&team, robot, Kind::Control)).await?;
    let _token = bus.announce(&keys::of(&team, robot, Kind::Alive)).await?;
    let mut period = tokio::time::interval(Duration::from_millis(50));
    let mut finished = false;
    loop {
        tokio::select! {
            _ = period.tick() => {
                let status = Message::Status(status(config, finished)).encode();
                bus.publish(&keys::of(&team, robot, Kind::Status), status).await?;
            }
            _ = terminate.recv() => {
                if config.mode != Mode::Stubborn {
                    break;
                }
            }
            query = control.recv() => {
                if answer(config, query.ok_or("the control key is lost")?, &mut finished)? {
                    break;
                }
            }
        }
    }
    bus.close().await;
    Ok(())
}

/// Answers a control request; true if this is the end.
fn answer(config: &Config, query: Query, finished: &mut bool) -> Result<bool, Box<dyn Error>> {
    let Message::ControlRequest(request) = Message::decode(&query.payload)? else {
        return Err("not a control request".into());
    };
    let (reply, end) = match request {
        ControlRequest::Status => (ControlReply::Status(status(config, *finished)), false),
        ControlRequest::Finish => {
            *finished = true;
            (ControlReply::Accepted, false)
        }
        ControlRequest::Evict(_) => (ControlReply::Refused("nobody to evict".into()), false),
        ControlRequest::Shutdown if config.mode == Mode::Stubborn => {
            (ControlReply::Refused("planted".into()), false)
        }
        ControlRequest::Shutdown => (ControlReply::Accepted, true),
    };
    // Who asked may have stopped waiting.
    let _ = query.reply.send(Message::ControlReply(reply).encode());
    Ok(end)
}
