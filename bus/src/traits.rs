//! What a bus offers.

use std::future::Future;
use std::time::Duration;

use pleiad_protocol::Timestamp;
use tokio::sync::{mpsc, oneshot};

/// A payload published on a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incoming {
    /// The key it was published on.
    pub key: String,
    /// What was published.
    pub payload: Vec<u8>,
}

/// A question to a queryable. Dropping it without an answer counts as no reply.
#[derive(Debug)]
pub struct Query {
    /// The key that was asked.
    pub key: String,
    /// The question.
    pub payload: Vec<u8>,
    /// Where the answer goes: one payload.
    pub reply: oneshot::Sender<Vec<u8>>,
}

/// A liveliness token appeared or disappeared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Liveliness {
    /// The token's key.
    pub key: String,
    /// Whether it is there now.
    pub alive: bool,
}

/// What can go wrong on a bus.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BusError {
    /// The bus could not be opened.
    #[error("cannot open the bus at {endpoint}: {cause}")]
    Open {
        /// The endpoint that was tried.
        endpoint: String,
        /// What the transport said.
        cause: String,
    },
    /// An operation failed.
    #[error("{operation} on {key} failed: {cause}")]
    Operation {
        /// publish, subscribe, serve, request, announce, watch.
        operation: &'static str,
        /// The key.
        key: String,
        /// What the transport said.
        cause: String,
    },
    /// Nobody answered a request in time.
    #[error("no reply from {key} within {seconds} s")]
    NoReply {
        /// The key that was asked.
        key: String,
        /// How long was waited.
        seconds: f64,
    },
}

/// A bus: publish and subscribe, ask and answer, announce and watch who is there. Keys are
/// slash-separated; in expressions `*` stands for one segment, `**` for any number of them.
///
/// A bus receives what it publishes itself, if it subscribes to it.
///
/// Publishing never blocks on a slow receiver: what does not fit is dropped, and the layer above repairs
/// it. Receivers are channels, filled without any work in the transport's own threads.
pub trait Bus: Send + Sync + 'static {
    /// Keeps a liveliness token declared until dropped.
    type Token: Send + 'static;

    /// Sends a payload to all subscribers of a key.
    fn publish(&self, key: &str, payload: Vec<u8>) -> impl Future<Output = Result<(), BusError>> + Send;

    /// Receives what is published on keys matching the expression, from now on.
    fn subscribe(
        &self,
        expression: &str,
    ) -> impl Future<Output = Result<mpsc::Receiver<Incoming>, BusError>> + Send;

    /// Answers questions on keys matching the expression.
    fn serve(&self, expression: &str)
    -> impl Future<Output = Result<mpsc::Receiver<Query>, BusError>> + Send;

    /// Asks one queryable on a key; the first answer counts.
    ///
    /// # Errors
    /// [`BusError::NoReply`] if nobody answers in time, including when nobody serves the key.
    fn request(
        &self,
        key: &str,
        payload: Vec<u8>,
        timeout: Duration,
    ) -> impl Future<Output = Result<Vec<u8>, BusError>> + Send;

    /// Declares a liveliness token.
    fn announce(&self, key: &str) -> impl Future<Output = Result<Self::Token, BusError>> + Send;

    /// Follows liveliness tokens matching the expression, beginning with those already there.
    fn watch(
        &self,
        expression: &str,
    ) -> impl Future<Output = Result<mpsc::Receiver<Liveliness>, BusError>> + Send;

    /// Leaves the bus in bounded time: withdraws everything declared through it, ends its receivers and
    /// makes every later operation an error.
    fn close(&self) -> impl Future<Output = ()> + Send;

    /// How much has been dropped so far because a receiver of this bus did not take it in time.
    fn dropped(&self) -> u64;

    /// Tells the time that the robot has reached, for a layer that acts by it.
    fn team_time(&self, _now: Timestamp) {}
}

/// A shared bus is a bus.
impl<B: Bus> Bus for std::sync::Arc<B> {
    type Token = B::Token;

    fn publish(&self, key: &str, payload: Vec<u8>) -> impl Future<Output = Result<(), BusError>> + Send {
        (**self).publish(key, payload)
    }

    fn subscribe(
        &self,
        expression: &str,
    ) -> impl Future<Output = Result<mpsc::Receiver<Incoming>, BusError>> + Send {
        (**self).subscribe(expression)
    }

    fn serve(
        &self,
        expression: &str,
    ) -> impl Future<Output = Result<mpsc::Receiver<Query>, BusError>> + Send {
        (**self).serve(expression)
    }

    fn request(
        &self,
        key: &str,
        payload: Vec<u8>,
        timeout: Duration,
    ) -> impl Future<Output = Result<Vec<u8>, BusError>> + Send {
        (**self).request(key, payload, timeout)
    }

    fn announce(&self, key: &str) -> impl Future<Output = Result<Self::Token, BusError>> + Send {
        (**self).announce(key)
    }

    fn watch(
        &self,
        expression: &str,
    ) -> impl Future<Output = Result<mpsc::Receiver<Liveliness>, BusError>> + Send {
        (**self).watch(expression)
    }

    fn dropped(&self) -> u64 {
        (**self).dropped()
    }

    fn close(&self) -> impl Future<Output = ()> + Send {
        (**self).close()
    }

    fn team_time(&self, now: Timestamp) {
        (**self).team_time(now);
    }
}
