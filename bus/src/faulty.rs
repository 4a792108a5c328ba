//! A layer of faults around a real bus: what reaches a robot from its peers is lost, delayed, doubled or
//! damaged as a plan says.
//!
//! Each robot judges what *it* receives, so that every directed link is judged once, by its receiver. A question
//! is judged both ways by who asks it. What does not come from a peer passes: the robot's own sensors, the
//! operator, liveliness. The plan's time is the robot's own ([`Bus::team_time`]), so that it holds at any pace of a
//! replay; delays are in seconds of the machine.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pleiad_protocol::keys::{Key, Kind};
use pleiad_protocol::{RobotId, Timestamp};
use tokio::sync::mpsc;

use crate::channel::CAPACITY;
use crate::faults::{FaultPlan, Injector, Verdict};
use crate::{Bus, BusError, Incoming, Liveliness, Query};

/// A bus of one robot with faults around it.
#[derive(Clone, Debug)]
pub struct FaultyBus<B> {
    inner: B,
    faults: Arc<Faults>,
}

#[derive(Debug)]
struct Faults {
    robot: RobotId,
    seed: u64,
    /// Changes step by step from one whole state to another, so a panic elsewhere does not spoil it.
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    plan: FaultPlan,
    /// Second 0 of the plan, if it is not the first instant told.
    origin: Option<Timestamp>,
    /// The last instant told, and the plan since the first; `None` before any.
    begun: Option<(Timestamp, Injector)>,
}

/// What reaches its receiver, after how long.
struct Arrival {
    after: Duration,
    payload: Vec<u8>,
}

impl Faults {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The copies of a message that arrive.
    fn judge(&self, from: RobotId, to: RobotId, payload: &[u8]) -> Vec<Arrival> {
        let verdict = {
            let mut state = self.state();
            // Before the first instant nothing has begun to go wrong.
            match &mut state.begun {
                Some((now, injector)) => injector.judge(*now, from, to, payload),
                None => Verdict::Delivered { after_s: 0.0, again_after_s: None, damage: None },
            }
        };
        let Verdict::Delivered { after_s, again_after_s, damage } = verdict else { return Vec::new() };
        let mut payload = payload.to_vec();
        if let Some(damage) = damage {
            damage.apply(&mut payload);
        }
        let arrival = |after_s| Arrival { after: Duration::from_secs_f64(after_s), payload: payload.clone() };
        [Some(after_s), again_after_s].into_iter().flatten().map(arrival).collect()
    }

    /// The peer whose message a key carries; `None` for what passes.
    fn peer(&self, key: &str) -> Option<RobotId> {
        let key: Key = key.parse().ok()?;
        let passes = matches!(key.kind, Kind::Sensor(_) | Kind::SensorBatch | Kind::Alive);
        (!passes && key.robot != self.robot).then_some(key.robot)
    }
}

impl<B: Bus> FaultyBus<B> {
    /// Faults around the bus of a robot. Second 0 of the plan is the first instant that the robot tells.
    pub fn new(inner: B, robot: RobotId, plan: FaultPlan, seed: u64) -> Self {
        let state = Mutex::new(State { plan, origin: None, begun: None });
        Self { inner, faults: Arc::new(Faults { robot, seed, state }) }
    }

    /// Second 0 of the plan is this instant, so that a robot that starts again in the middle of a run finds
    /// the faults where the others have them. To be said before the robot tells its first instant.
    pub fn since(self, origin: Timestamp) -> Self {
        self.faults.state().origin = Some(origin);
        self
    }

    /// Changes the plan; what is under way stays so.
    pub fn set_plan(&self, plan: FaultPlan) {
        let mut state = self.faults.state();
        if let Some((_, injector)) = &mut state.begun {
            injector.set_plan(plan.clone());
        }
        state.plan = plan;
    }
}

impl<B: Bus> Bus for FaultyBus<B> {
    type Token = B::Token;

    async fn publish(&self, key: &str, payload: Vec<u8>) -> Result<(), BusError> {
        self.inner.publish(key, payload).await
    }

    async fn subscribe(&self, expression: &str) -> Result<mpsc::Receiver<Incoming>, BusError> {
        let mut arriving = self.inner.subscribe(expression).await?;
        let (sender, receiver) = mpsc::channel(CAPACITY);
        let faults = Arc::clone(&self.faults);
        tokio::spawn(async move {
            while let Some(incoming) = arriving.recv().await {
                let arrivals = match faults.peer(&incoming.key) {
                    None => vec![Arrival { after: Duration::ZERO, payload: incoming.payload }],
                    Some(peer) => faults.judge(peer, faults.robot, &incoming.payload),
                };
                for Arrival { after, payload } in arrivals {
                    let incoming = Incoming { key: incoming.key.clone(), payload };
                    if after.is_zero() {
                        // The channel is as long as that of the bus: what waits there waits here.
                        if sender.send(incoming).await.is_err() {
                            return;
                        }
                    } else {
                        let sender = sender.clone();
                        tokio::spawn(async move {
                            tokio::time::sleep(after).await;
                            // The receiver is gone only when the agent is.
                            let _ = sender.send(incoming).await;
                        });
                    }
                }
            }
        });
        Ok(receiver)
    }

    async fn serve(&self, expression: &str) -> Result<mpsc::Receiver<Query>, BusError> {
        self.inner.serve(expression).await
    }

    async fn request(&self, key: &str, payload: Vec<u8>, timeout: Duration) -> Result<Vec<u8>, BusError> {
        let Some(peer) = self.faults.peer(key) else {
            return self.inner.request(key, payload, timeout).await;
        };
        let asked = async {
            // A second copy of a question gets the same answer.
            let there = self.faults.judge(self.faults.robot, peer, &payload).into_iter().next()?;
            tokio::time::sleep(there.after).await;
            let reply = self.inner.request(key, there.payload, timeout).await;
            match reply {
                Ok(reply) => {
                    let back = self.faults.judge(peer, self.faults.robot, &reply).into_iter().next()?;
                    tokio::time::sleep(back.after).await;
                    Some(Ok(back.payload))
                }
                Err(error) => Some(Err(error)),
            }
        };
        let lost = || BusError::NoReply { key: key.to_owned(), seconds: timeout.as_secs_f64() };
        let started = tokio::time::Instant::now();
        match tokio::time::timeout(timeout, asked).await {
            Ok(Some(reply)) => reply,
            Err(_) => Err(lost()),
            Ok(None) => {
                // Nobody is told that a message was lost: the answer just does not come.
                tokio::time::sleep_until(started + timeout).await;
                Err(lost())
            }
        }
    }

    async fn announce(&self, key: &str) -> Result<Self::Token, BusError> {
        self.inner.announce(key).await
    }

    async fn watch(&self, expression: &str) -> Result<mpsc::Receiver<Liveliness>, BusError> {
        self.inner.watch(expression).await
    }

    async fn close(&self) {
        self.inner.close().await;
    }

    fn dropped(&self) -> u64 {
        self.inner.dropped()
    }

    fn team_time(&self, now: Timestamp) {
        let mut state = self.faults.state();
        let state = &mut *state;
        let origin = state.origin.unwrap_or(now);
        let fresh = || (now, Injector::new(state.plan.clone(), self.faults.seed, origin));
        let (last, _) = state.begun.get_or_insert_with(fresh);
        *last = now.max(*last);
        self.inner.team_time(now);
    }
}
