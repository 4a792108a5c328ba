//! The channels between a transport and its users.

use std::sync::atomic::{AtomicU64, Ordering};

use tokio::sync::mpsc;

/// How much may wait in a channel. Above it something is wrong with the receiver, and what comes is
/// dropped: a full second of a team of 50 at 80 messages a second each.
pub const CAPACITY: usize = 4096;

/// Hands a value over without waiting; counts what does not fit.
pub fn offer<T>(sender: &mpsc::Sender<T>, value: T, dropped: &AtomicU64) {
    if let Err(mpsc::error::TrySendError::Full(_)) = sender.try_send(value) {
        dropped.fetch_add(1, Ordering::Relaxed);
    }
}
