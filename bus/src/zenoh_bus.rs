//! The bus over zenoh.
//!
//! Callbacks run on zenoh's receive threads, where waiting for anything deadlocks or delays every peer:
//! they only put into bounded channels. Sending never blocks either (`CongestionControl::Drop`): one
//! stopped receiver would otherwise hold up what is sent to everyone.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::sync::{mpsc, oneshot, watch};
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::query::ConsolidationMode;
use zenoh::sample::{Sample, SampleKind};

use crate::channel::{self, CAPACITY};
use crate::expression::{check_expression, check_key};
use crate::{Bus, BusError, Incoming, Liveliness, Query, ZenohConfig};

/// Zenoh's own limit is ten seconds, and with a stopped peer it takes them.
const CLOSE_LIMIT: Duration = Duration::from_secs(2);
/// What is kept of it for the answers that are still to be sent.
const LAST_ANSWERS: Duration = Duration::from_millis(500);

/// What `.cargo/config.toml` sets for the compilation of zenoh, as seen by the compilation of this crate.
const LINGER: Option<&str> = option_env!("TCP_LINGER_TIMEOUT");

/// A bus over zenoh. It needs a tokio runtime of several threads.
#[derive(Debug)]
pub struct ZenohBus {
    session: Session,
    /// Turns true when the bus is closed; ends the tasks that keep declarations.
    closing: watch::Sender<bool>,
    dropped: Arc<AtomicU64>,
}

/// A liveliness token on zenoh.
#[derive(Debug)]
pub struct ZenohToken {
    /// Undeclares itself when dropped.
    _token: LivelinessToken,
}

impl ZenohBus {
    /// Opens a session. A peer does not wait for the endpoints it dials (half a second at most); a client
    /// does.
    ///
    /// # Errors
    /// [`BusError::Open`] if an endpoint is malformed, a listener cannot be bound, or a client finds
    /// nobody to speak through.
    pub async fn open(config: &ZenohConfig) -> Result<Self, BusError> {
        let failed = |cause: String| BusError::Open { endpoint: config.endpoint(), cause };
        if LINGER != Some("0") {
            tracing::warn!(
                found = LINGER,
                "zenoh was compiled without TCP_LINGER_TIMEOUT=0: a lost link can stall the others for ten seconds"
            );
        }
        let settings = config.to_zenoh()?;
        // Opening does its waiting on the thread that asks for it.
        let session = tokio::task::spawn_blocking(|| zenoh::Wait::wait(zenoh::open(settings)))
            .await
            .map_err(|cause| failed(cause.to_string()))?
            .map_err(|cause| failed(cause.to_string()))?;
        Ok(Self { session, closing: watch::Sender::new(false), dropped: Arc::default() })
    }

    /// Where others can reach this session, with the ports the system chose.
    pub async fn locators(&self) -> Vec<String> {
        self.session.info().locators().await.iter().map(ToString::to_string).collect()
    }

    /// Keeps what was declared until its receiver is dropped or the bus is closed.
    fn keep<D: Send + 'static, T: Send + 'static>(&self, declared: D, sender: mpsc::Sender<T>) {
        let mut closing = self.closing.subscribe();
        tokio::spawn(async move {
            tokio::select! {
                () = sender.closed() => {}
                _ = closing.wait_for(|closing| *closing) => {}
            }
            drop(declared);
        });
    }
}

fn failed(operation: &'static str, key: &str) -> impl FnOnce(zenoh::Error) -> BusError {
    let key = key.to_owned();
    move |cause| BusError::Operation { operation, key, cause: cause.to_string() }
}

impl Bus for ZenohBus {
    type Token = ZenohToken;

    async fn publish(&self, key: &str, payload: Vec<u8>) -> Result<(), BusError> {
        check_key("publish", key)?;
        self.session
            .put(key, payload)
            .congestion_control(CongestionControl::Drop)
            .await
            .map_err(failed("publish", key))
    }

    async fn subscribe(&self, expression: &str) -> Result<mpsc::Receiver<Incoming>, BusError> {
        check_expression("subscribe", expression)?;
        let (sender, receiver) = mpsc::channel(CAPACITY);
        let (to_user, dropped) = (sender.clone(), Arc::clone(&self.dropped));
        let on_sample = move |sample: Sample| {
            let key = sample.key_expr().as_str().to_owned();
            let payload = sample.payload().to_bytes().into_owned();
            channel::offer(&to_user, Incoming { key, payload }, &dropped);
        };
        let subscriber = self.session.declare_subscriber(expression).callback(on_sample).await;
        self.keep(subscriber.map_err(failed("subscribe", expression))?, sender);
        Ok(receiver)
    }

    async fn serve(&self, expression: &str) -> Result<mpsc::Receiver<Query>, BusError> {
        check_expression("serve", expression)?;
        let (to_task, mut asked) = mpsc::channel(CAPACITY);
        let dropped = Arc::clone(&self.dropped);
        let on_query = move |query: zenoh::query::Query| channel::offer(&to_task, query, &dropped);
        let queryable = self.session.declare_queryable(expression).callback(on_query).await;
        let queryable = queryable.map_err(failed("serve", expression))?;

        let (sender, receiver) = mpsc::channel(CAPACITY);
        let to_user = sender.clone();
        let (closing, dropped) = (self.closing.subscribe(), Arc::clone(&self.dropped));
        // Ends with the queryable: its callback holds the only sender.
        tokio::spawn(async move {
            while let Some(query) = asked.recv().await {
                let (reply, answer) = oneshot::channel();
                let key = query.key_expr().as_str().to_owned();
                let payload = query.payload().map(|payload| payload.to_bytes().into_owned());
                channel::offer(
                    &to_user,
                    Query { key, payload: payload.unwrap_or_default(), reply },
                    &dropped,
                );
                tokio::spawn(answer_query(query, answer, closing.clone()));
            }
        });
        self.keep(queryable, sender);
        Ok(receiver)
    }

    async fn request(&self, key: &str, payload: Vec<u8>, timeout: Duration) -> Result<Vec<u8>, BusError> {
        check_key("request", key)?;
        let replies = self
            .session
            .get(key)
            .payload(payload)
            .timeout(timeout)
            .congestion_control(CongestionControl::Drop)
            // Otherwise the first reply is held back until the last one is in.
            .consolidation(ConsolidationMode::None)
            .await
            .map_err(failed("request", key))?;
        let first = async {
            // The channel ends, without an error, when all who were asked are done, even if nobody was.
            while let Ok(reply) = replies.recv_async().await {
                if let Ok(sample) = reply.result() {
                    return Some(sample.payload().to_bytes().into_owned());
                }
            }
            None
        };
        let no_reply = || BusError::NoReply { key: key.to_owned(), seconds: timeout.as_secs_f64() };
        tokio::time::timeout(timeout, first).await.ok().flatten().ok_or_else(no_reply)
    }

    async fn announce(&self, key: &str) -> Result<ZenohToken, BusError> {
        check_key("announce", key)?;
        let token = self.session.liveliness().declare_token(key).await;
        Ok(ZenohToken { _token: token.map_err(failed("announce", key))? })
    }

    async fn watch(&self, expression: &str) -> Result<mpsc::Receiver<Liveliness>, BusError> {
        check_expression("watch", expression)?;
        let (sender, receiver) = mpsc::channel(CAPACITY);
        let (to_user, dropped) = (sender.clone(), Arc::clone(&self.dropped));
        let on_change = move |sample: Sample| {
            let key = sample.key_expr().as_str().to_owned();
            let alive = sample.kind() == SampleKind::Put;
            channel::offer(&to_user, Liveliness { key, alive }, &dropped);
        };
        let liveliness = self.session.liveliness();
        let subscriber = liveliness.declare_subscriber(expression).history(true).callback(on_change).await;
        self.keep(subscriber.map_err(failed("watch", expression))?, sender);
        Ok(receiver)
    }

    async fn close(&self) {
        self.closing.send_replace(true);
        // On a task of its own, so that whatever it waits for does not keep the caller.
        let (session, closing) = (self.session.clone(), self.closing.clone());
        let closing = tokio::spawn(async move {
            // Every task has let go when the answers already given are sent and nothing is declared.
            let _ = tokio::time::timeout(LAST_ANSWERS, closing.closed()).await;
            session.close().await
        });
        match tokio::time::timeout(CLOSE_LIMIT, closing).await {
            Ok(Ok(Ok(()))) => {}
            Ok(Ok(Err(cause))) => tracing::warn!(%cause, "the zenoh session did not close cleanly"),
            Ok(Err(cause)) => tracing::warn!(%cause, "closing the zenoh session ended abnormally"),
            Err(_) => tracing::warn!(
                limit_s = CLOSE_LIMIT.as_secs_f64(),
                "the zenoh session is still closing; not waiting any longer"
            ),
        }
    }

    fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

/// Sends the user's answer, if one comes. Zenoh ends the question when the query is dropped.
async fn answer_query(
    query: zenoh::query::Query,
    answer: oneshot::Receiver<Vec<u8>>,
    mut closing: watch::Receiver<bool>,
) {
    let answer = tokio::select! {
        // An answer given just before the bus is closed is still sent.
        biased;
        answer = answer => answer,
        _ = closing.wait_for(|closing| *closing) => return,
    };
    let Ok(payload) = answer else { return };
    // It is sent under the congestion control of the question: dropped rather than waited for.
    if let Err(cause) = query.reply(query.key_expr(), payload).await {
        tracing::debug!(key = query.key_expr().as_str(), %cause, "a reply could not be sent");
    }
}
