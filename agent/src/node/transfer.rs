//! Taking over a peer's snapshot, and giving out one's own, in parts.

use pleiad_estimation::ledger::Ledger;
use pleiad_estimation::{BootIndex, RobotId, Timestamp};
use pleiad_protocol::{SnapshotPart, SnapshotRequest, decode_checkpoint, encode_checkpoint, limits};

use super::{Command, Node, Notice, Record};

/// A snapshot on its way, and the one given out last.
#[derive(Debug, Default)]
pub(super) struct Transfer {
    /// The parts received: of whom, of which cut.
    from: Option<(RobotId, Timestamp)>,
    received: Vec<u8>,
    /// Whose snapshot this ledger rests on, or its own ones since.
    pub taken_from: Option<RobotId>,
    /// Encoded for peers.
    given: Option<(Timestamp, SnapshotPart)>,
}

impl Node {
    pub(super) fn ask_for_snapshot(&mut self, peer: RobotId) {
        let transfer = &mut self.membership.transfer;
        // Parts that arrived already are asked for no more, so a lost answer costs one round.
        let going_on = transfer.from.filter(|(from, _)| *from == peer);
        if going_on.is_none() {
            transfer.from = None;
            transfer.received.clear();
        }
        let request =
            SnapshotRequest { cut: going_on.map(|(_, cut)| cut), offset: transfer.received.len() as u64 };
        self.out.rest.push(Command::AskSnapshot { peer, request });
    }

    /// The part of this node's snapshot that a peer asked for; `None` if it has closed nothing yet.
    pub fn serve_snapshot(&mut self, request: &SnapshotRequest) -> Option<SnapshotPart> {
        if !self.vouches_for_its_base() {
            return None;
        }
        let checkpoint = self.ledger.checkpoint()?;
        let given = &mut self.membership.transfer.given;
        // A transfer under way goes on with the snapshot it began with.
        let under_way = given.as_ref().is_some_and(|(cut, _)| request.cut == Some(*cut));
        if !under_way && given.as_ref().is_none_or(|(cut, _)| *cut != checkpoint.time) {
            let bytes = encode_checkpoint(checkpoint);
            let (cut, hash, total) = (checkpoint.time, checkpoint.fingerprint(), bytes.len() as u64);
            *given = Some((cut, SnapshotPart { cut, hash, total, offset: 0, bytes }));
        }
        let (cut, whole) = given.as_ref()?;
        let offset = if request.cut.is_none_or(|wanted| wanted == *cut) { request.offset } else { 0 };
        let start = usize::try_from(offset).ok().filter(|start| *start <= whole.bytes.len())?;
        let end = (start + limits::SNAPSHOT_PART_BYTES).min(whole.bytes.len());
        let (cut, hash, total) = (*cut, whole.hash, whole.total);
        Some(SnapshotPart { cut, hash, total, offset, bytes: whole.bytes[start..end].to_vec() })
    }

    /// Whether the snapshot that this ledger rests on may be given on. Not if it is of a peer that this robot had
    /// given up before it lost its disk, or may have.
    fn vouches_for_its_base(&self) -> bool {
        let (Some(from), Some(views)) = (self.membership.transfer.taken_from, self.ledger.views()) else {
            return true;
        };
        let given_up = views.given_up(self.config.robot).contains(&from);
        self.membership.joining.is_some() || (self.knows_its_past() && !given_up)
    }

    pub(super) fn snapshot_part(&mut self, peer: RobotId, part: &SnapshotPart) {
        if self.ledger.closure().is_none() || part.total > limits::SNAPSHOT_BYTES as u64 {
            return;
        }
        let transfer = &mut self.membership.transfer;
        if transfer.from != Some((peer, part.cut)) {
            transfer.from = Some((peer, part.cut));
            transfer.received.clear();
        }
        if part.offset != transfer.received.len() as u64 {
            return;
        }
        transfer.received.extend(&part.bytes);
        if (transfer.received.len() as u64) < part.total && !part.bytes.is_empty() {
            self.ask_for_snapshot(peer);
            return;
        }
        let bytes = std::mem::take(&mut transfer.received);
        transfer.from = None;
        if let Err(cause) = self.take_over(peer, part, &bytes) {
            self.notice(Notice::SnapshotRefused { peer, cause });
        }
    }

    fn take_over(&mut self, peer: RobotId, part: &SnapshotPart, bytes: &[u8]) -> Result<(), String> {
        let checkpoint = decode_checkpoint(bytes).map_err(|error| error.to_string())?;
        let hash = checkpoint.fingerprint();
        if hash != part.hash || checkpoint.time != part.cut {
            return Err(format!("its hash is {hash}, announced was {}", part.hash));
        }
        if checkpoint.configuration != self.ledger.configuration() {
            return Err("it was made under another configuration".to_owned());
        }
        if self.ledger.cut().is_some_and(|cut| checkpoint.time <= cut) {
            return Ok(());
        }
        let own: Vec<BootIndex> =
            checkpoint.logs.keys().filter(|log| log.robot == self.config.robot).map(|log| log.boot).collect();
        let (cut, record) = (checkpoint.time, Record::Checkpoint(Box::new(checkpoint.clone())));
        // Who has lost his disk takes any: it may tell him what he has said himself.
        let given_up = self.ledger.views().is_some_and(|views| {
            checkpoint.views.epoch <= views.epoch && views.given_up(self.config.robot).contains(&peer)
        });
        let lost = !self.has_lived() || (self.membership.lost_disk && !self.knows_its_past());
        // An outsider may have his from someone who is given up.
        let doubtful = given_up || self.membership.applicants.contains_key(&peer);
        let may_take = !doubtful || lost || self.membership.joining.is_some();
        if !may_take || !self.ledger.take_over(checkpoint) {
            return Ok(());
        }
        self.membership.transfer.taken_from = Some(peer);
        self.known_boot = self.known_boot.max(own.into_iter().max());
        self.out.records.push(record);
        self.segments.forget_until(cut);
        self.remember_hash(cut, hash);
        self.notice(Notice::SnapshotTaken { peer, cut });
        Ok(())
    }
}

impl Node {
    /// The ledger of a node, by its configuration.
    pub(super) fn empty_ledger(config: &crate::config::NodeConfig) -> Ledger {
        match &config.closing.closure {
            Some(closure) => Ledger::closing(config.fold, closure.clone(), config.robot),
            None => Ledger::new(config.fold).kept_for(config.robot),
        }
    }
}
