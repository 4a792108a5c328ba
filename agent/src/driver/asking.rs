//! What an agent asks its peers for, in the background.

use std::time::Duration;

use pleiad_bus::Bus;
use pleiad_estimation::RobotId;
use pleiad_protocol::keys::{self, Kind};
use pleiad_protocol::{ControlReply, ControlRequest, FactsRequest, Message, SnapshotRequest};

use super::{Agent, DriverError};
use crate::node::Event;

/// How long a peer has to answer. For facts it is asked again at its next status.
const ASK_TIMEOUT: Duration = Duration::from_secs(2);
/// How long an agent without a journal looks for a first peer that may know a former life of its robot, and
/// then for the next one.
const REJOIN_LIMIT: Duration = Duration::from_secs(1);
const REJOIN_NEXT: Duration = Duration::from_millis(200);

impl<B: Bus + Clone> Agent<'_, B> {
    /// Without a journal this could still not be the robot's first life. A second log under an index that
    /// peers already hold would contradict them, so whoever is there is asked first.
    pub(super) async fn ask_for_former_life(&mut self) -> Result<(), DriverError> {
        let question = Message::ControlRequest(ControlRequest::Status).encode();
        let mut present = self.bus.watch(&keys::all(&self.team, Kind::Alive)).await?;
        let limit = tokio::time::Instant::now() + REJOIN_LIMIT;
        let mut answered = false;
        loop {
            // Links may still be coming up, so that nobody there yet is not nobody there.
            let patience = if answered { tokio::time::Instant::now() + REJOIN_NEXT } else { limit };
            let Ok(Some(peer)) = tokio::time::timeout_at(patience.min(limit), present.recv()).await else {
                return Ok(());
            };
            let Some(robot) = self.sender(&peer.key).filter(|_| peer.alive) else { continue };
            let key = keys::of(&self.team, robot, Kind::Control);
            let Ok(reply) = self.bus.request(&key, question.clone(), ASK_TIMEOUT).await else { continue };
            if let Ok(Message::ControlReply(ControlReply::Status(status))) = Message::decode(&reply) {
                answered = true;
                self.act(Event::Status(status)).await?;
            }
        }
    }

    /// Asks for a snapshot, or a part of it, in the background.
    pub(super) fn ask_snapshot(&mut self, peer: RobotId, request: SnapshotRequest) {
        if !self.asked_snapshot.insert(peer) {
            return;
        }
        let (bus, parts) = (self.bus.clone(), self.parts.clone());
        let key = keys::of(&self.team, peer, Kind::Facts);
        tokio::spawn(async move {
            let question = Message::SnapshotRequest(request).encode();
            let reply = bus.request(&key, question, ASK_TIMEOUT).await;
            let part = match reply.map(|bytes| Message::decode(&bytes)) {
                Ok(Ok(Message::SnapshotPart(part))) => Some(part),
                Ok(other) => {
                    tracing::debug!(peer = peer.0, ?other, "no snapshot");
                    None
                }
                Err(error) => {
                    tracing::debug!(peer = peer.0, %error, "a request for a snapshot was not answered");
                    None
                }
            };
            let _ = parts.send((peer, part)).await;
        });
    }

    /// Asks in the background; one question per peer at a time.
    pub(super) fn ask(&mut self, peer: RobotId, request: FactsRequest) {
        if !self.asked.insert(peer) {
            return;
        }
        let (bus, answers) = (self.bus.clone(), self.answers.clone());
        let key = keys::of(&self.team, peer, Kind::Facts);
        tokio::spawn(async move {
            let question = Message::FactsRequest(request).encode();
            let reply = bus.request(&key, question, ASK_TIMEOUT).await;
            let entries = match reply.map(|bytes| pleiad_protocol::decode_entries(&bytes)) {
                Ok(Ok(entries)) => Some(entries),
                Ok(Err(error)) => {
                    tracing::warn!(peer = peer.0, %error, "an answer to a request for facts was refused");
                    None
                }
                Err(error) => {
                    tracing::debug!(peer = peer.0, %error, "a request for facts was not answered");
                    None
                }
            };
            // The receiver is gone only when the agent is.
            let _ = answers.send((peer, entries)).await;
        });
    }
}
