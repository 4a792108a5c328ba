//! What every bus must do: one test body, run in memory and over zenoh on loopback.
//!
//! Zenoh needs a moment until a declaration has reached the other session, so a test first probes, again
//! and again, until one probe has come through; from then on it waits for what must arrive.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::future::Future;
use std::time::Duration;

use pleiad_bus::{Bus, BusError, Incoming, Liveliness, MemoryNetwork, Query, ZenohBus, ZenohConfig};
use tokio::sync::mpsc;

/// Far beyond what anything here takes; reached only by failure.
const PATIENCE: Duration = Duration::from_secs(30);

async fn within<T>(what: &str, future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future).await.unwrap_or_else(|_| panic!("in vain: {what}"))
}

async fn next<T>(what: &str, receiver: &mut mpsc::Receiver<T>) -> T {
    within(what, receiver.recv()).await.unwrap_or_else(|| panic!("the channel ended: {what}"))
}

/// Publishes probes until one has come through, then waits until the receiver holds none of them.
async fn until_subscribed<B: Bus>(from: &B, key: &str, receiver: &mut mpsc::Receiver<Incoming>) {
    let mut interval = tokio::time::interval(Duration::from_millis(10));
    within("a probe", async {
        loop {
            tokio::select! {
                _ = interval.tick() => from.publish(key, b"probe".to_vec()).await.unwrap(),
                incoming = receiver.recv() => return assert_eq!(incoming.unwrap().payload, b"probe"),
            }
        }
    })
    .await;
    from.publish(key, b"last probe".to_vec()).await.unwrap();
    while next("the last probe", receiver).await.payload != b"last probe" {}
}

/// The next that is not a probe: those for one subscription reach wider ones too.
async fn after_probes(what: &str, receiver: &mut mpsc::Receiver<Incoming>) -> Incoming {
    loop {
        let incoming = next(what, receiver).await;
        if !incoming.payload.ends_with(b"probe") {
            return incoming;
        }
    }
}

/// Answers with the question and its key, except `drop me`.
fn echo(mut queries: mpsc::Receiver<Query>) {
    tokio::spawn(async move {
        while let Some(Query { key, payload, reply }) = queries.recv().await {
            if payload != b"drop me" {
                reply.send([key.as_bytes(), b"?", &payload].concat()).unwrap();
            }
        }
    });
}

/// Asks until somebody answers.
async fn until_served<B: Bus>(from: &B, key: &str) {
    let mut interval = tokio::time::interval(Duration::from_millis(10));
    within("a first answer", async {
        loop {
            interval.tick().await;
            if from.request(key, b"probe".to_vec(), PATIENCE).await.is_ok() {
                return;
            }
        }
    })
    .await;
}

fn incoming(key: &str, payload: &str) -> Incoming {
    Incoming { key: key.into(), payload: payload.into() }
}

async fn publications_reach_matching_subscribers_in_order<B: Bus>(a: B, b: B) {
    let mut exact = b.subscribe("team/1/fact").await.unwrap();
    let mut robots = b.subscribe("team/*/fact").await.unwrap();
    let mut everything = b.subscribe("team/**").await.unwrap();
    until_subscribed(&a, "team/1/fact", &mut exact).await;
    until_subscribed(&a, "team/9/fact", &mut robots).await;
    until_subscribed(&a, "team/9/status/x", &mut everything).await;

    let sent: Vec<_> = (0..20).map(|number| incoming("team/1/fact", &number.to_string())).collect();
    a.publish("team/2/fact", b"other robot".to_vec()).await.unwrap();
    a.publish("team/1/fact/deeper", b"other depth".to_vec()).await.unwrap();
    a.publish("other/1/fact", b"other team".to_vec()).await.unwrap();
    for Incoming { key, payload } in &sent {
        a.publish(key, payload.clone()).await.unwrap();
    }

    for expected in &sent {
        assert_eq!(&after_probes("on the exact key", &mut exact).await, expected);
    }
    assert_eq!(after_probes("on *", &mut robots).await, incoming("team/2/fact", "other robot"));
    for expected in &sent {
        assert_eq!(&after_probes("on *", &mut robots).await, expected);
    }
    assert_eq!(after_probes("on **", &mut everything).await, incoming("team/2/fact", "other robot"));
    assert_eq!(after_probes("on **", &mut everything).await, incoming("team/1/fact/deeper", "other depth"));
    for expected in &sent {
        assert_eq!(&after_probes("on **", &mut everything).await, expected);
    }
}

async fn a_bus_receives_its_own_publications<B: Bus>(a: B, _b: B) {
    let mut receiver = a.subscribe("team/*/status").await.unwrap();
    a.publish("team/1/status", b"mine".to_vec()).await.unwrap();
    assert_eq!(next("the own status", &mut receiver).await, incoming("team/1/status", "mine"));
}

async fn binary_payloads_arrive_unchanged<B: Bus>(a: B, b: B) {
    let mut receiver = b.subscribe("team/1/fact").await.unwrap();
    until_subscribed(&a, "team/1/fact", &mut receiver).await;
    // A message of entries may be this long.
    for length in [0, 1, 256, 1 << 20] {
        #[allow(clippy::cast_possible_truncation, reason = "the low byte is wanted")]
        let payload: Vec<_> = (0..length).map(|i: usize| (i % 251) as u8).collect();
        a.publish("team/1/fact", payload.clone()).await.unwrap();
        assert!(next("a payload", &mut receiver).await.payload == payload, "{length} bytes");
    }
}

async fn questions_are_answered<B: Bus>(a: B, b: B) {
    echo(a.serve("team/1/facts").await.unwrap());
    until_served(&b, "team/1/facts").await;
    for question in ["one", "two", ""] {
        let answer = b.request("team/1/facts", question.into(), PATIENCE).await.unwrap();
        assert_eq!(String::from_utf8(answer).unwrap(), format!("team/1/facts?{question}"));
    }
}

async fn a_question_to_nobody_has_no_reply<B: Bus>(a: B, b: B) {
    echo(a.serve("team/1/facts").await.unwrap());
    until_served(&b, "team/1/facts").await;
    let refused = b.request("team/2/facts", b"anybody".to_vec(), PATIENCE).await;
    let Err(BusError::NoReply { key, seconds }) = refused else { panic!("{refused:?}") };
    assert_eq!((key.as_str(), seconds), ("team/2/facts", PATIENCE.as_secs_f64()));
}

async fn a_dropped_question_has_no_reply<B: Bus>(a: B, b: B) {
    echo(a.serve("team/1/facts").await.unwrap());
    until_served(&b, "team/1/facts").await;
    let refused = b.request("team/1/facts", b"drop me".to_vec(), PATIENCE).await;
    assert!(matches!(refused, Err(BusError::NoReply { .. })), "{refused:?}");
    assert!(b.request("team/1/facts", b"again".to_vec(), PATIENCE).await.is_ok());
}

async fn a_question_never_answered_ends_at_its_timeout<B: Bus>(a: B, b: B) {
    let mut queries = a.serve("team/1/facts").await.unwrap();
    let mut held = Vec::new();
    let asked = async {
        // The first questions may find nobody yet; the one that arrives is held.
        while let Err(BusError::NoReply { .. }) =
            b.request("team/1/facts", b"hello".to_vec(), Duration::from_millis(100)).await
        {}
    };
    tokio::select! {
        () = within("the end of the questions", asked) => panic!("answered by nobody"),
        () = async {
            // Once the second one is here, the first one has ended without an answer.
            while held.len() < 2 {
                held.push(next("a question", &mut queries).await);
            }
        } => {}
    }
    assert!(held.iter().all(|query| query.payload == b"hello"));
}

async fn tokens_appear_and_vanish<B: Bus>(a: B, b: B) {
    let first = a.announce("team/1/alive").await.unwrap();
    let mut changes = b.watch("team/*/alive").await.unwrap();
    let change = |robot: u32, alive| Liveliness { key: format!("team/{robot}/alive"), alive };
    assert_eq!(next("a token there before", &mut changes).await, change(1, true));
    let second = a.announce("team/2/alive").await.unwrap();
    assert_eq!(next("a token that appears", &mut changes).await, change(2, true));
    drop(first);
    assert_eq!(next("a token that vanishes", &mut changes).await, change(1, false));
    let again = a.announce("team/1/alive").await.unwrap();
    assert_eq!(next("a token that is back", &mut changes).await, change(1, true));
    drop((second, again));
    let mut gone = [next("both vanish", &mut changes).await, next("both vanish", &mut changes).await];
    gone.sort_by(|x, y| x.key.cmp(&y.key));
    assert_eq!(gone, [change(1, false), change(2, false)]);
}

async fn closing_withdraws_everything_and_ends_the_receivers<B: Bus>(a: B, b: B) {
    let mut changes = b.watch("team/*/alive").await.unwrap();
    let _token = a.announce("team/1/alive").await.unwrap();
    assert!(next("a token", &mut changes).await.alive);
    let mut subscribed = a.subscribe("team/**").await.unwrap();
    let mut served = a.serve("team/1/facts").await.unwrap();
    let mut watched = a.watch("other/*/alive").await.unwrap();

    within("closing", a.close()).await;
    within("closing twice", a.close()).await;

    assert_eq!(
        next("the token vanishes", &mut changes).await,
        Liveliness { key: "team/1/alive".into(), alive: false }
    );
    assert_eq!(within("the end", subscribed.recv()).await, None);
    assert!(within("the end", served.recv()).await.is_none());
    assert_eq!(within("the end", watched.recv()).await, None);
    let refused = a.publish("team/1/fact", Vec::new()).await;
    assert!(matches!(refused, Err(BusError::Operation { operation: "publish", .. })), "{refused:?}");
    assert!(a.subscribe("team/**").await.is_err());
    assert!(a.serve("team/1/facts").await.is_err());
    assert!(a.announce("team/1/alive").await.is_err());
    assert!(a.watch("team/**").await.is_err());
    assert!(a.request("team/1/facts", Vec::new(), PATIENCE).await.is_err());

    // The other one does not notice.
    let mut own = b.subscribe("team/2/fact").await.unwrap();
    b.publish("team/2/fact", b"still here".to_vec()).await.unwrap();
    assert_eq!(next("the other bus", &mut own).await, incoming("team/2/fact", "still here"));
}

async fn a_full_receiver_drops_and_counts_and_holds_nobody_up<B: Bus>(a: B, _b: B) {
    let mut slow = a.subscribe("team/1/fact").await.unwrap();
    let mut quick = a.subscribe("team/*/fact").await.unwrap();
    let (sent, capacity) = (5000_u32, 4096);
    for number in 0..sent {
        within("publishing", a.publish("team/1/fact", number.to_string().into())).await.unwrap();
        assert_eq!(next("the quick one", &mut quick).await.payload, number.to_string().into_bytes());
    }
    assert_eq!(a.dropped(), u64::from(sent - capacity));
    for number in 0..capacity {
        assert_eq!(next("the slow one", &mut slow).await.payload, number.to_string().into_bytes());
    }
    a.publish("team/1/fact", b"after".to_vec()).await.unwrap();
    assert_eq!(next("the slow one", &mut slow).await.payload, b"after");
}

async fn keys_that_are_none_are_refused<B: Bus>(a: B, _b: B) {
    for bad in ["", "/team", "team//fact", "team/*/fact"] {
        assert!(a.publish(bad, Vec::new()).await.is_err(), "{bad}");
        assert!(a.announce(bad).await.is_err(), "{bad}");
        assert!(
            matches!(a.request(bad, Vec::new(), PATIENCE).await, Err(BusError::Operation { .. })),
            "{bad}"
        );
    }
    for bad in ["", "team//*", "**/**"] {
        assert!(a.subscribe(bad).await.is_err(), "{bad}");
        assert!(a.serve(bad).await.is_err(), "{bad}");
        assert!(a.watch(bad).await.is_err(), "{bad}");
    }
}

async fn zenoh_pair() -> (ZenohBus, ZenohBus) {
    let a = ZenohBus::open(&ZenohConfig::default()).await.unwrap();
    // The listener's own port: no other process can have taken it in between.
    let connect = a.locators().await;
    assert_eq!(connect.len(), 1, "{connect:?}");
    let b = ZenohBus::open(&ZenohConfig { connect, ..ZenohConfig::default() }).await.unwrap();
    (a, b)
}

macro_rules! on_both {
    ($($name:ident)*) => {
        mod in_memory {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                let network = super::MemoryNetwork::new();
                super::$name(network.join("a"), network.join("b")).await;
            })*
        }
        mod over_zenoh {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                let (a, b) = super::zenoh_pair().await;
                super::$name(a, b).await;
            })*
        }
    };
}

on_both! {
    publications_reach_matching_subscribers_in_order
    a_bus_receives_its_own_publications
    binary_payloads_arrive_unchanged
    questions_are_answered
    a_question_to_nobody_has_no_reply
    a_dropped_question_has_no_reply
    a_question_never_answered_ends_at_its_timeout
    tokens_appear_and_vanish
    closing_withdraws_everything_and_ends_the_receivers
    a_full_receiver_drops_and_counts_and_holds_nobody_up
    keys_that_are_none_are_refused
}
