//! What arrives at an agent: decoded, believed only as far as it may be, and answered.

use pleiad_bus::{Bus, Incoming, Query};
use pleiad_estimation::RobotId;
use pleiad_protocol::{ControlReply, ControlRequest, Message, SensorAck, SensorBatch, keys, limits};

use super::{Agent, DriverError};
use crate::node::{Command, Event, Record};

impl<B: Bus + Clone> Agent<'_, B> {
    pub(super) async fn fact(&mut self, incoming: Incoming) -> Result<(), DriverError> {
        let Some(sender) = self.sender(&incoming.key) else { return Ok(()) };
        match pleiad_protocol::decode_entries(&incoming.payload) {
            Ok(mut entries) => {
                // A robot publishes its own log only; other entries under its key are not believed.
                let all = entries.len();
                entries.retain(|entry| entry.id.robot == sender);
                if entries.len() < all {
                    self.misattributed += (all - entries.len()) as u64;
                    tracing::warn!(
                        sender = sender.0,
                        total = self.misattributed,
                        "entries of another robot under this robot's key were refused"
                    );
                }
                self.act(Event::Entries(entries)).await
            }
            Err(error) => {
                tracing::warn!(sender = sender.0, %error, "facts refused");
                Ok(())
            }
        }
    }

    /// The robot a key belongs to; `None` for this one, whose own publications come back.
    pub(super) fn sender(&self, key: &str) -> Option<RobotId> {
        let robot = key.parse::<keys::Key>().ok()?.robot;
        (robot != self.role.robot()).then_some(robot)
    }

    pub(super) async fn status(&mut self, incoming: Incoming) -> Result<(), DriverError> {
        let Some(sender) = self.sender(&incoming.key) else { return Ok(()) };
        match Message::decode(&incoming.payload) {
            Ok(Message::Status(status)) if status.robot == sender => self.act(Event::Status(status)).await,
            Ok(other) => {
                tracing::warn!(sender = sender.0, kind = other.kind(), "not the sender's status");
                Ok(())
            }
            Err(error) => {
                tracing::warn!(sender = sender.0, %error, "status refused");
                Ok(())
            }
        }
    }

    /// What a peer of an approximate strategy says to this robot.
    pub(super) async fn said(&mut self, incoming: Incoming) -> Result<(), DriverError> {
        let Some(sender) = self.sender(&incoming.key) else { return Ok(()) };
        match Message::decode(&incoming.payload) {
            Ok(Message::Strategy(message)) => self.act(Event::Said(sender, message)).await,
            Ok(other) => {
                tracing::warn!(sender = sender.0, kind = other.kind(), "not a message of a strategy");
                Ok(())
            }
            Err(error) => {
                tracing::warn!(sender = sender.0, %error, "a message of a strategy refused");
                Ok(())
            }
        }
    }

    pub(super) async fn single_sample(&mut self, incoming: Incoming) -> Result<(), DriverError> {
        match pleiad_protocol::decode_sample(&incoming.payload) {
            Ok(sample) => {
                self.bus.team_time(sample.time);
                self.act(Event::Sample(sample)).await
            }
            Err(error) => {
                tracing::warn!(key = incoming.key, %error, "sample refused");
                Ok(())
            }
        }
    }

    pub(super) async fn batch(&mut self, query: Query) -> Result<(), DriverError> {
        let batch = match Message::decode(&query.payload) {
            Ok(Message::SensorBatch(batch)) => batch,
            Ok(other) => {
                tracing::warn!(kind = other.kind(), "not a batch of samples");
                return Ok(());
            }
            Err(error) => {
                tracing::warn!(%error, "batch refused");
                return Ok(());
            }
        };
        let ack = match &self.last_batch {
            Some((last, ack)) if *last == query.payload => ack.clone(),
            _ => {
                let ack = self.take_batch(batch).await?;
                self.last_batch = Some((query.payload.clone(), ack.clone()));
                ack
            }
        };
        self.publisher.reply(query, &Message::SensorAck(ack));
        Ok(())
    }

    async fn take_batch(&mut self, batch: SensorBatch) -> Result<SensorAck, DriverError> {
        let mut ack = SensorAck { number: batch.number, ..SensorAck::default() };
        let (mut records, mut entries, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        if let Some(last) = batch.samples.last() {
            self.bus.team_time(last.time);
        }
        for sample in batch.samples {
            // A sample that is taken is always journalled; one that is not never is.
            let mut taken = false;
            for command in self.role.handle(Event::Sample(sample)) {
                match command {
                    Command::Journal(more) => {
                        taken |= more.iter().any(|record| matches!(record, Record::Sample(_)));
                        records.extend(more);
                    }
                    Command::Publish(more) => entries.extend(more),
                    other => rest.push(other),
                }
            }
            if taken {
                ack.accepted += 1;
            } else {
                ack.refused += 1;
                ack.first_refusal = ack.first_refusal.or_else(|| self.role.last_refusal());
            }
        }
        if batch.end {
            rest.extend(self.role.handle(Event::InputEnded));
        }
        // One write and one message for the whole batch, in the order that the rule asks for.
        let first = [Command::Journal(records), Command::Publish(entries)];
        let first = first.into_iter().filter(|command| match command {
            Command::Journal(records) => !records.is_empty(),
            Command::Publish(entries) => !entries.is_empty(),
            _ => true,
        });
        let commands = first.chain(rest).collect();
        self.execute(commands).await?;
        Ok(ack)
    }

    pub(super) fn request(&mut self, query: Query) {
        match Message::decode(&query.payload) {
            Ok(Message::FactsRequest(request)) => {
                let entries = self.role.serve(&request, limits::ENTRIES);
                self.publisher.reply(query, &Message::Entries(entries));
            }
            Ok(Message::SnapshotRequest(request)) => {
                if let Some(part) = self.role.serve_snapshot(&request) {
                    self.publisher.reply(query, &Message::SnapshotPart(part));
                }
            }
            Ok(other) => tracing::warn!(kind = other.kind(), "not a request for facts"),
            Err(error) => tracing::warn!(%error, "request for facts refused"),
        }
    }

    /// Answers a control request; `true` if the agent is to end.
    pub(super) async fn control(&mut self, query: Query) -> Result<bool, DriverError> {
        let Ok(Message::ControlRequest(request)) = Message::decode(&query.payload) else {
            tracing::warn!("a control request was not understood");
            return Ok(false);
        };
        let (reply, end) = match request {
            ControlRequest::Status => (ControlReply::Status(self.role.status()), false),
            ControlRequest::Finish => {
                self.act(Event::InputEnded).await?;
                self.finish()?;
                (ControlReply::Accepted, false)
            }
            ControlRequest::Shutdown => (ControlReply::Accepted, true),
            ControlRequest::Evict(_) if !self.role.has_members() => {
                let reason = "a team that keeps no facts together has nobody to evict".to_owned();
                (ControlReply::Refused(reason), false)
            }
            ControlRequest::Evict(robot) => {
                self.act(Event::Evict(robot)).await?;
                (ControlReply::Accepted, false)
            }
        };
        if end {
            // Who asked may look for the results as soon as it has its answer.
            self.finish()?;
        }
        self.publisher.reply(query, &Message::ControlReply(reply));
        Ok(end)
    }
}
