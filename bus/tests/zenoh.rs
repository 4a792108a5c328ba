//! What only the bus over zenoh does: links, listeners and their loss.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::io::{ErrorKind, Read};
use std::net::TcpListener;
use std::time::Duration;

use pleiad_bus::{Bus, BusError, ZenohBus, ZenohConfig, ZenohMode};

/// Far beyond what anything here takes; reached only by failure.
const PATIENCE: Duration = Duration::from_secs(30);

/// Publishes from one bus until the other has received.
async fn until_heard(from: &ZenohBus, to: &ZenohBus) {
    let mut receiver = to.subscribe("team/1/fact").await.unwrap();
    let mut interval = tokio::time::interval(Duration::from_millis(10));
    let heard = async {
        loop {
            tokio::select! {
                _ = interval.tick() => from.publish("team/1/fact", b"x".to_vec()).await.unwrap(),
                incoming = receiver.recv() => return assert_eq!(incoming.unwrap().payload, b"x"),
            }
        }
    };
    tokio::time::timeout(PATIENCE, heard).await.expect("nothing was heard");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_configured_endpoint_is_dialled_again_after_its_peer_restarted() {
    let first = ZenohBus::open(&ZenohConfig::default()).await.unwrap();
    let endpoint = first.locators().await;
    let dialling = ZenohConfig { connect: endpoint.clone(), ..ZenohConfig::default() };
    let other = ZenohBus::open(&dialling).await.unwrap();
    until_heard(&first, &other).await;
    first.close().await;
    let listening = ZenohConfig { listen: endpoint, ..ZenohConfig::default() };
    let second = ZenohBus::open(&listening).await.unwrap();
    until_heard(&second, &other).await;
    until_heard(&other, &second).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn clients_hear_one_another_through_a_router() {
    let router = ZenohConfig { mode: ZenohMode::Router, ..ZenohConfig::default() };
    let router = ZenohBus::open(&router).await.unwrap();
    let client =
        ZenohConfig { mode: ZenohMode::Client, connect: router.locators().await, ..ZenohConfig::default() };
    let [a, b] = [ZenohBus::open(&client).await.unwrap(), ZenohBus::open(&client).await.unwrap()];
    until_heard(&a, &b).await;
    until_heard(&b, &a).await;
    assert_eq!(a.locators().await, Vec::<String>::new(), "a client listens nowhere");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_peer_listens_on_loopback_unless_told() {
    let peer = ZenohBus::open(&ZenohConfig::default()).await.unwrap();
    let locators = peer.locators().await;
    assert_eq!(locators.len(), 1);
    assert!(locators[0].starts_with("tcp/127.0.0.1:"), "{locators:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_taken_port_is_an_error_that_names_the_endpoint() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let listen = vec![format!("tcp/{}", taken.local_addr().unwrap())];
    let refused = ZenohBus::open(&ZenohConfig { listen: listen.clone(), ..ZenohConfig::default() }).await;
    let Err(BusError::Open { endpoint, .. }) = refused else { panic!("opened") };
    assert_eq!(endpoint, listen[0]);
}

/// With SO_LINGER at 0 a closed connection is reset; with any other it ends in order, and a receive
/// thread of zenoh waits for that up to the time given. This shows that TCP_LINGER_TIMEOUT of
/// `.cargo/config.toml` reached the compilation of zenoh.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_closed_link_does_not_linger() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let connect = vec![format!("tcp/{}", listener.local_addr().unwrap())];
    let accepted = tokio::task::spawn_blocking(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        // The first message of zenoh's handshake, which is never answered.
        assert!(stream.read(&mut [0; 4096]).unwrap() > 0);
        stream
    });
    let bus = ZenohBus::open(&ZenohConfig { connect, ..ZenohConfig::default() }).await.unwrap();
    let mut stream = tokio::time::timeout(PATIENCE, accepted).await.expect("never dialled").unwrap();
    bus.close().await;
    let end = tokio::task::spawn_blocking(move || {
        loop {
            match stream.read(&mut [0; 4096]) {
                Ok(0) => return Ok(()),
                Ok(_) => {}
                Err(cause) => return Err(cause.kind()),
            }
        }
    });
    assert_eq!(end.await.unwrap(), Err(ErrorKind::ConnectionReset));
}
