//! Sending, and counting what was sent.

use pleiad_bus::{Bus, Query};
use pleiad_estimation::RobotId;
use pleiad_estimation::fact::Entry;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{Message, TeamName, encode_entries, limits};

/// Publishes under one robot's keys.
pub(super) struct Publisher<'a, B> {
    bus: &'a B,
    team: TeamName,
    robot: RobotId,
    messages: u64,
    bytes: u64,
}

impl<'a, B: Bus> Publisher<'a, B> {
    pub(super) fn new(bus: &'a B, team: TeamName, robot: RobotId) -> Self {
        Self { bus, team, robot, messages: 0, bytes: 0 }
    }

    /// Messages and payload bytes sent so far, answers included.
    pub(super) fn sent(&self) -> (u64, u64) {
        (self.messages, self.bytes)
    }

    pub(super) async fn entries(&mut self, entries: &[Entry]) {
        for chunk in entries.chunks(limits::ENTRIES) {
            self.send(Kind::Fact, encode_entries(chunk)).await;
        }
    }

    pub(super) async fn publish(&mut self, kind: Kind, message: &Message) {
        self.send(kind, message.encode()).await;
    }

    /// What does not get through is repaired by the digests; a failure to send is not the node's business.
    async fn send(&mut self, kind: Kind, payload: Vec<u8>) {
        self.count(&payload);
        let key = keys::of(&self.team, self.robot, kind);
        if let Err(error) = self.bus.publish(&key, payload).await {
            tracing::warn!(%error, "publishing failed");
        }
    }

    pub(super) fn reply(&mut self, query: Query, message: &Message) {
        let payload = message.encode();
        self.count(&payload);
        if query.reply.send(payload).is_err() {
            tracing::debug!(key = query.key, "nobody waits for this answer any more");
        }
    }

    fn count(&mut self, payload: &[u8]) {
        self.messages += 1;
        self.bytes += payload.len() as u64;
    }
}
