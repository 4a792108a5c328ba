//! The task that owns a team's processes: it feeds what happens to them into the state machine and does
//! what that says.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Duration;

use pleiad_bus::Liveliness;
use pleiad_protocol::RobotId;
use pleiad_protocol::keys::Key;
use tokio::sync::{broadcast, mpsc, oneshot, watch};
use tokio::task::JoinSet;

use crate::membership::{Action, Input, Member, Membership, TeamEvent};
use crate::process::{Launcher, Order, Process, Treatment};
use crate::restart::Exit;

/// What is asked of the supervisor. Each request is answered when it is done.
#[derive(Debug)]
pub(crate) enum Request {
    /// Do not start these again when they end.
    Hold { robots: BTreeSet<RobotId>, done: oneshot::Sender<()> },
    /// Start an ended one.
    Start { robot: RobotId, done: oneshot::Sender<()> },
    /// Do something to a process. The sender is dropped where there is none.
    Treat { robot: RobotId, treatment: Treatment, done: oneshot::Sender<io::Result<()>> },
}

/// Everything known of everyone.
pub(crate) type Members = BTreeMap<RobotId, Member>;

/// The owner of a team's processes. Dropping it drops them: they are killed or let go, as configured.
pub(crate) struct Supervisor {
    launcher: Launcher,
    detached: bool,
    membership: Membership,
    /// One task per process, which ends with it.
    processes: JoinSet<(RobotId, Exit, Duration)>,
    /// Where signals for the running processes go.
    orders: BTreeMap<RobotId, mpsc::Sender<Order>>,
    /// Agents that are meant to end: their going is no cause for alarm.
    held: BTreeSet<RobotId>,
    /// Waits before restarts.
    waits: JoinSet<Input>,
    members: watch::Sender<Members>,
    events: broadcast::Sender<TeamEvent>,
}

impl Supervisor {
    /// Takes over the processes of a team.
    pub(crate) fn new(
        launcher: Launcher,
        detached: bool,
        membership: Membership,
        processes: BTreeMap<RobotId, Process>,
        events: broadcast::Sender<TeamEvent>,
    ) -> Self {
        let members = watch::Sender::new(membership.members());
        let mut supervisor = Self {
            launcher,
            detached,
            membership,
            processes: JoinSet::new(),
            orders: BTreeMap::new(),
            held: BTreeSet::new(),
            waits: JoinSet::new(),
            members,
            events,
        };
        for (robot, process) in processes {
            supervisor.adopt(robot, process);
        }
        supervisor
    }

    /// Follows what is known of everyone.
    pub(crate) fn members(&self) -> watch::Receiver<Members> {
        self.members.subscribe()
    }

    /// Supervises until nobody can ask for anything any more.
    pub(crate) async fn run(
        mut self,
        mut requests: mpsc::Receiver<Request>,
        mut liveliness: mpsc::Receiver<Liveliness>,
    ) {
        loop {
            // A branch whose source has ended is left out; the others go on without it.
            tokio::select! {
                request = requests.recv() => match request {
                    Some(request) => self.request(request),
                    None => return,
                },
                Some(ended) = self.processes.join_next() => match ended {
                    Ok((robot, exit, ran)) => {
                        self.orders.remove(&robot);
                        self.handle(Input::Exited { robot, exit, ran });
                    }
                    Err(cause) => tracing::error!(%cause, "a process is no longer watched"),
                },
                Some(change) = liveliness.recv() => match change.key.parse::<Key>() {
                    Ok(key) => self.handle(Input::Liveliness { robot: key.robot, alive: change.alive }),
                    Err(error) => tracing::warn!(%error, "a liveliness token was not understood"),
                },
                Some(Ok(due)) = self.waits.join_next() => self.handle(due),
            }
        }
    }

    fn request(&mut self, request: Request) {
        // Who asked may have stopped waiting.
        match request {
            Request::Hold { robots, done } => {
                for robot in robots {
                    self.held.insert(robot);
                    self.handle(Input::Hold { robot });
                }
                let _ = done.send(());
            }
            Request::Start { robot, done } => {
                self.held.remove(&robot);
                self.handle(Input::Start { robot });
                let _ = done.send(());
            }
            Request::Treat { robot, treatment, done } => {
                tracing::info!(robot = robot.0, %treatment, "to the agent's process");
                if let Some(orders) = self.orders.get(&robot) {
                    let _ = orders.try_send((treatment, done));
                }
            }
        }
    }

    /// Takes an input and does everything that follows from it.
    fn handle(&mut self, input: Input) {
        let mut inputs = vec![input];
        while let Some(input) = inputs.pop() {
            for action in self.membership.handle(input) {
                match action {
                    Action::Tell(event) => {
                        self.log(event);
                        // Nobody need be listening.
                        let _ = self.events.send(event);
                    }
                    Action::Spawn(robot) => inputs.push(self.spawn(robot)),
                    Action::Wait { robot, restarts, delay } => {
                        tracing::info!(
                            robot = robot.0,
                            delay_s = delay.as_secs_f64(),
                            "the agent will be restarted"
                        );
                        self.waits.spawn(async move {
                            tokio::time::sleep(delay).await;
                            Input::Due { robot, restarts }
                        });
                    }
                }
            }
        }
        let members = self.membership.members();
        self.members.send_if_modified(|known| {
            let changed = *known != members;
            *known = members;
            changed
        });
    }

    fn spawn(&mut self, robot: RobotId) -> Input {
        match self.launcher.spawn(robot) {
            Ok(process) => {
                let pid = process.pid();
                self.adopt(robot, process);
                Input::Spawned { robot, pid }
            }
            Err(error) => {
                tracing::error!(robot = robot.0, %error, "the agent could not be restarted");
                Input::NotSpawned { robot }
            }
        }
    }

    fn adopt(&mut self, robot: RobotId, mut process: Process) {
        if self.detached {
            process.keep_on_drop();
        }
        let (sender, orders) = mpsc::channel(16);
        self.orders.insert(robot, sender);
        self.processes.spawn(async move {
            let (exit, ran) = process.wait(orders).await;
            (robot, exit, ran)
        });
    }

    fn log(&self, event: TeamEvent) {
        match event {
            TeamEvent::AgentUp { robot } => tracing::info!(robot = robot.0, "agent is up"),
            TeamEvent::AgentDown { robot } if self.held.contains(&robot) => {
                tracing::info!(robot = robot.0, "agent has left");
            }
            TeamEvent::AgentDown { robot } => {
                tracing::warn!(robot = robot.0, "agent is down or out of reach");
            }
            TeamEvent::Exited { robot, exit } if exit.failed() => {
                tracing::warn!(robot = robot.0, %exit, "the agent's process ended");
            }
            TeamEvent::Exited { robot, exit } => {
                tracing::info!(robot = robot.0, %exit, "the agent's process ended");
            }
            TeamEvent::Restarted { robot, restarts } => {
                tracing::info!(robot = robot.0, restarts, "agent restarted");
            }
            TeamEvent::GaveUp { robot, attempts } => {
                tracing::error!(robot = robot.0, attempts, "the agent failed too often and stays ended");
            }
        }
    }
}
