//! A run of agent processes, from their launch to the end of the last one, with everything that is to befall
//! them on the way.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use pleiad_agent::driver;
use pleiad_bus::ZenohBus;
use pleiad_coordinator::{Act, CoordinatorConfig, Remote, Schedule, Team as Agents};
use pleiad_estimation::{RobotId, Timestamp};
use tokio::io::{AsyncBufReadExt, BufReader};

use super::survived::Befallen;
use super::{ENDED_WITHIN, ProcessOptions, executable};
use crate::{folder, output};

/// Limits for a machine that is very busy; a run that goes well never comes near them.
const ALIVE_WITHIN: Duration = Duration::from_mins(1);
const SETTLED_WITHIN: Duration = Duration::from_mins(1);
/// How long samples may stay without acknowledgement where processes are stopped on purpose, s.
const PATIENCE_S: f64 = 0.5;
/// An agent that gets samples writes within this.
const WRITTEN_WITHIN: Duration = Duration::from_secs(1);
/// Where a coordinator that is a process of its own finds its configuration.
const COORDINATOR: &str = "coordinator.toml";

/// What a run takes.
pub(super) struct Conduct<'a> {
    pub config: &'a CoordinatorConfig,
    pub bus: &'a Arc<ZenohBus>,
    /// What the feeding process is told to read.
    pub input: &'a [String],
    pub options: &'a ProcessOptions<'a>,
    /// Endpoints of the agents.
    pub connect: &'a [String],
    /// First and last sample.
    pub span: (Timestamp, Timestamp),
    pub out: &'a Path,
}

impl Conduct<'_> {
    /// Runs; says what befell the processes.
    pub(super) async fn to_the_end(&self) -> anyhow::Result<Befallen> {
        let schedule = self.options.faults.as_ref().map(|faults| faults.schedule.clone()).unwrap_or_default();
        if schedule.kills_coordinator() {
            self.without_coordinator(schedule).await
        } else {
            self.with_coordinator(schedule).await
        }
    }

    /// This process is the coordinator.
    async fn with_coordinator(&self, mut schedule: Schedule) -> anyhow::Result<Befallen> {
        let agents = Agents::launch(self.config, self.bus.clone()).await?;
        agents.wait_until_alive(ALIVE_WITHIN).await?;
        let mut befallen = Befallen::default();
        let disturbed = !schedule.is_empty();
        // The others do not wait long for the sensors of one that stands still.
        let patience = disturbed.then_some(PATIENCE_S);
        self.feed(patience, async |t_s| {
            for act in schedule.due(t_s) {
                self.carry_out(&agents, act).await?;
                befallen.count(act);
            }
            Ok(())
        })
        .await?;
        if disturbed {
            for act in schedule.end() {
                self.carry_out(&agents, act).await?;
            }
            // Whoever ended of what befell him by itself.
            for (robot, member) in agents.members() {
                if member.ended().is_some() {
                    agents.restart(robot).await?;
                }
            }
            // By their answers: the liveliness of one that stood still can stay unseen after it is back.
            let all = Remote::new(self.bus.clone(), self.config.team()?, self.config.robots());
            all.wait_until_up(ALIVE_WITHIN).await?;
            // Nobody else tells those who were away when the samples ended.
            for (robot, told) in agents.finish().await {
                told.with_context(|| format!("robot {robot} was told that its samples have ended"))?;
            }
        }
        let settled = agents.wait_until_settled(&BTreeSet::new(), SETTLED_WITHIN).await;
        let ended = agents.shutdown(ENDED_WITHIN).await;
        settled?;
        ended?;
        Ok(befallen)
    }

    async fn carry_out(&self, agents: &Agents<Arc<ZenohBus>>, act: Act) -> anyhow::Result<()> {
        use pleiad_coordinator::ProcessSignal::{Pause, Resume};
        tracing::info!(?act, "fault");
        match act {
            Act::Kill(robot) => {
                agents.kill(robot).await?;
            }
            Act::Start(robot) => agents.restart(robot).await?,
            Act::Stop(robot) => agents.signal(robot, Pause).await?,
            Act::Resume(robot) => agents.signal(robot, Resume).await?,
            Act::FillDisk(robot) => agents.limit_files(robot, Some(self.journal_bytes(robot)?)).await?,
            Act::EmptyDisk(robot) => {
                // However short the fault was by the clock, a write is to have met it.
                match agents.ended(robot, WRITTEN_WITHIN).await? {
                    Some(_) => agents.restart(robot).await?,
                    None => agents.limit_files(robot, None).await?,
                }
            }
            Act::KillCoordinator => bail!("the coordinator of this run is this process"),
        }
        Ok(())
    }

    fn journal_bytes(&self, robot: RobotId) -> anyhow::Result<u64> {
        let path = folder::agent(self.out, robot).join(driver::JOURNAL);
        let found = std::fs::metadata(&path).with_context(|| format!("cannot look at {}", path.display()))?;
        Ok(found.len())
    }

    /// The coordinator is a process of its own, and is killed on the way. What is left for this process is what
    /// an operator can do: look at the agents, and tell them to end.
    async fn without_coordinator(&self, mut schedule: Schedule) -> anyhow::Result<Befallen> {
        let path = self.out.join(COORDINATOR);
        let text = toml::to_string(self.config).context("writing the coordinator's configuration")?;
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        let mut command = tokio::process::Command::new(executable()?);
        command.arg("coordinator").arg("--config").arg(&path).stdin(Stdio::null()).kill_on_drop(true);
        let mut coordinator = command.spawn().context("cannot start the coordinator")?;
        let agents = Remote::new(self.bus.clone(), self.config.team()?, self.config.robots());
        let mut befallen = Befallen::default();
        let lived = async {
            agents.wait_until_up(ALIVE_WITHIN).await?;
            self.feed(None, async |t_s| {
                for act in schedule.due(t_s) {
                    coordinator.kill().await.context("cannot kill the coordinator")?;
                    befallen.count(act);
                }
                Ok(())
            })
            .await?;
            agents.wait_until_settled(SETTLED_WITHIN).await?;
            anyhow::Ok(())
        };
        let lived = lived.await;
        // A coordinator that still lives would take their end for a reason to end itself.
        let ended = agents.shutdown(ENDED_WITHIN).await;
        lived?;
        ended?;
        Ok(befallen)
    }

    /// Feeds the agents by a process of its own; `on_second` is told the seconds of the run, one by one.
    async fn feed(
        &self,
        patience_s: Option<f64>,
        mut on_second: impl AsyncFnMut(f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let (first, last) = self.span;
        let mut command = tokio::process::Command::new(executable()?);
        command.arg("sim-peers").args(self.input).args(["--team", &self.config.team, "--progress"]);
        for endpoint in self.connect {
            command.args(["--connect", endpoint]);
        }
        if let Some(speed) = self.options.speed {
            command.args(["--speed", &speed.to_string()]);
        }
        if let Some(patience_s) = patience_s {
            command.args(["--patience", &patience_s.to_string()]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).kill_on_drop(true);
        let mut child = command.spawn().context("cannot start the process that feeds the agents")?;
        let bar = output::progress(self.options.label, last.seconds_since(first));
        if let Some(stdout) = child.stdout.take() {
            let mut lines = BufReader::new(stdout).lines();
            while let Some(line) = lines.next_line().await? {
                if let Ok(second) = line.parse::<f64>() {
                    let t_s = second - first.seconds();
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "seconds of a run"
                    )]
                    bar.set_position(t_s.max(0.0) as u64);
                    on_second(t_s).await?;
                }
            }
        }
        let status = child.wait().await?;
        bar.finish_and_clear();
        if !status.success() {
            bail!("the process that feeds the agents ended with {status}; what it said is above");
        }
        Ok(())
    }
}
