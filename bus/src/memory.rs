//! A network in memory: everything arrives at once, unless a receiver's channel is full.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinSet;

use crate::channel::{self, CAPACITY};
use crate::expression::{check_expression, check_key, matches};
use crate::{Bus, BusError, Incoming, Liveliness, Query};

/// A network in memory, from which any number of buses are made.
#[derive(Clone, Debug, Default)]
pub struct MemoryNetwork {
    hub: Arc<Mutex<Hub>>,
}

/// What all members have declared, in the order of declaration.
#[derive(Debug, Default)]
struct Hub {
    /// The number of the next member or declaration.
    next: u64,
    subscribers: BTreeMap<u64, Declared<Incoming>>,
    queryables: BTreeMap<u64, Declared<Query>>,
    watchers: BTreeMap<u64, Declared<Liveliness>>,
    /// Liveliness tokens: whose, and the key. A key may be announced more than once.
    tokens: BTreeMap<u64, (u64, String)>,
}

#[derive(Debug)]
struct Declared<T> {
    /// The member that receives.
    owner: u64,
    expression: String,
    sender: mpsc::Sender<T>,
    /// The owner's count of what did not fit.
    dropped: Arc<AtomicU64>,
}

/// A member of a [`MemoryNetwork`]. Leaves it when dropped.
#[derive(Debug)]
pub struct MemoryBus {
    name: String,
    member: u64,
    hub: Arc<Mutex<Hub>>,
    closed: AtomicBool,
    dropped: Arc<AtomicU64>,
}

/// A liveliness token on a [`MemoryNetwork`].
pub struct MemoryToken {
    number: u64,
    hub: Arc<Mutex<Hub>>,
}

impl MemoryNetwork {
    /// An empty network.
    pub fn new() -> Self {
        Self::default()
    }

    /// A new member; the name is for error messages.
    pub fn join(&self, name: &str) -> MemoryBus {
        MemoryBus {
            name: name.to_owned(),
            member: lock(&self.hub).number(),
            hub: Arc::clone(&self.hub),
            closed: AtomicBool::new(false),
            dropped: Arc::default(),
        }
    }
}

/// The maps are consistent between any two statements, so a panic elsewhere does not spoil them.
fn lock(hub: &Mutex<Hub>) -> MutexGuard<'_, Hub> {
    hub.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    fn number(&mut self) -> u64 {
        self.next += 1;
        self.next
    }

    fn announced(&self, key: &str) -> bool {
        self.tokens.values().any(|(_, announced)| announced == key)
    }

    fn announce(&mut self, owner: u64, key: &str) -> u64 {
        let known = self.announced(key);
        let number = self.number();
        self.tokens.insert(number, (owner, key.to_owned()));
        if !known {
            self.tell_watchers(key, true);
        }
        number
    }

    fn withdraw(&mut self, token: u64) {
        if let Some((_, key)) = self.tokens.remove(&token)
            && !self.announced(&key)
        {
            self.tell_watchers(&key, false);
        }
    }

    fn tell_watchers(&mut self, key: &str, alive: bool) {
        offer_all(&mut self.watchers, key, || Liveliness { key: key.to_owned(), alive });
    }

    fn leave(&mut self, member: u64) {
        self.subscribers.retain(|_, declared| declared.owner != member);
        self.queryables.retain(|_, declared| declared.owner != member);
        self.watchers.retain(|_, declared| declared.owner != member);
        let tokens: Vec<_> =
            self.tokens.iter().filter(|(_, (owner, _))| *owner == member).map(|(token, _)| *token).collect();
        for token in tokens {
            self.withdraw(token);
        }
    }
}

/// Hands a value to everyone whose expression covers the key, and forgets who listens no more.
fn offer_all<T>(receivers: &mut BTreeMap<u64, Declared<T>>, key: &str, make: impl Fn() -> T) {
    receivers.retain(|_, declared| !declared.sender.is_closed());
    for declared in receivers.values().filter(|declared| matches(&declared.expression, key)) {
        channel::offer(&declared.sender, make(), &declared.dropped);
    }
}

impl MemoryBus {
    fn check_open(&self, operation: &'static str, key: &str) -> Result<(), BusError> {
        if self.closed.load(Ordering::Relaxed) {
            let cause = format!("the bus of {} is closed", self.name);
            return Err(BusError::Operation { operation, key: key.to_owned(), cause });
        }
        Ok(())
    }

    fn declare<T>(&self, expression: &str) -> (Declared<T>, mpsc::Receiver<T>) {
        let (sender, receiver) = mpsc::channel(CAPACITY);
        let (expression, dropped) = (expression.to_owned(), Arc::clone(&self.dropped));
        (Declared { owner: self.member, expression, sender, dropped }, receiver)
    }

    fn leave(&self) {
        if !self.closed.swap(true, Ordering::Relaxed) {
            lock(&self.hub).leave(self.member);
        }
    }
}

impl Bus for MemoryBus {
    type Token = MemoryToken;

    async fn publish(&self, key: &str, payload: Vec<u8>) -> Result<(), BusError> {
        check_key("publish", key)?;
        self.check_open("publish", key)?;
        offer_all(&mut lock(&self.hub).subscribers, key, || Incoming {
            key: key.to_owned(),
            payload: payload.clone(),
        });
        Ok(())
    }

    async fn subscribe(&self, expression: &str) -> Result<mpsc::Receiver<Incoming>, BusError> {
        check_expression("subscribe", expression)?;
        self.check_open("subscribe", expression)?;
        let (declared, receiver) = self.declare(expression);
        let mut hub = lock(&self.hub);
        let number = hub.number();
        hub.subscribers.insert(number, declared);
        Ok(receiver)
    }

    async fn serve(&self, expression: &str) -> Result<mpsc::Receiver<Query>, BusError> {
        check_expression("serve", expression)?;
        self.check_open("serve", expression)?;
        let (declared, receiver) = self.declare(expression);
        let mut hub = lock(&self.hub);
        let number = hub.number();
        hub.queryables.insert(number, declared);
        Ok(receiver)
    }

    async fn request(&self, key: &str, payload: Vec<u8>, timeout: Duration) -> Result<Vec<u8>, BusError> {
        check_key("request", key)?;
        self.check_open("request", key)?;
        let mut answers = JoinSet::new();
        {
            let mut hub = lock(&self.hub);
            hub.queryables.retain(|_, declared| !declared.sender.is_closed());
            for declared in hub.queryables.values().filter(|declared| matches(&declared.expression, key)) {
                let (reply, answer) = oneshot::channel();
                let query = Query { key: key.to_owned(), payload: payload.clone(), reply };
                channel::offer(&declared.sender, query, &declared.dropped);
                answers.spawn(answer);
            }
        }
        let first = async {
            while let Some(answer) = answers.join_next().await {
                if let Ok(Ok(payload)) = answer {
                    return Some(payload);
                }
            }
            None
        };
        let no_reply = || BusError::NoReply { key: key.to_owned(), seconds: timeout.as_secs_f64() };
        tokio::time::timeout(timeout, first).await.ok().flatten().ok_or_else(no_reply)
    }

    async fn announce(&self, key: &str) -> Result<MemoryToken, BusError> {
        check_key("announce", key)?;
        self.check_open("announce", key)?;
        let number = lock(&self.hub).announce(self.member, key);
        Ok(MemoryToken { number, hub: Arc::clone(&self.hub) })
    }

    async fn watch(&self, expression: &str) -> Result<mpsc::Receiver<Liveliness>, BusError> {
        check_expression("watch", expression)?;
        self.check_open("watch", expression)?;
        let (declared, receiver) = self.declare(expression);
        let mut hub = lock(&self.hub);
        let mut present: Vec<_> = hub.tokens.values().map(|(_, key)| key.clone()).collect();
        present.sort();
        present.dedup();
        for key in present.into_iter().filter(|key| matches(expression, key)) {
            channel::offer(&declared.sender, Liveliness { key, alive: true }, &declared.dropped);
        }
        let number = hub.number();
        hub.watchers.insert(number, declared);
        Ok(receiver)
    }

    async fn close(&self) {
        self.leave();
    }

    fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

impl Drop for MemoryBus {
    fn drop(&mut self) {
        self.leave();
    }
}

impl fmt::Debug for MemoryToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MemoryToken").field("number", &self.number).finish_non_exhaustive()
    }
}

impl Drop for MemoryToken {
    fn drop(&mut self) {
        lock(&self.hub).withdraw(self.number);
    }
}
