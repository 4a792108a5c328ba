//! A node from the journal of its former life.

use pleiad_estimation::fact::{Body, Boot, Entry};
use pleiad_estimation::ledger::Checkpoint;
use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{BootIndex, Timestamp};

use super::{Node, Record};
use crate::config::NodeConfig;

impl Node {
    /// Rebuilds what a journal tells: the ledger from the entries, the nominal trajectories from the
    /// samples. Nothing is published again and no boot begins: that waits for the first odometry, which
    /// carries the last boot on.
    pub fn recover(config: NodeConfig, nonce: u64, records: impl IntoIterator<Item = Record>) -> Self {
        let mut node = Self::new(config, nonce);
        // A boot's entries stand before the sample that began it; that sample starts dead reckoning anew.
        // A boot without its sample was lived without this journal and came back from a peer.
        let mut announced: Option<(BootIndex, Boot)> = None;
        // What was said on a sample stands before it too, and was not known yet when it was taken.
        let mut said: Vec<Entry> = Vec::new();
        for record in records {
            match record {
                Record::Entry(entry) => {
                    if entry.id.robot == node.config.robot {
                        node.known_boot = node.known_boot.max(Some(entry.id.boot));
                        if let Body::Boot(boot) = &entry.body {
                            announced = Some((entry.id.boot, *boot));
                            node.membership.joining.take_if(|joining| entry.id.boot >= *joining);
                        }
                        if node.corrector.is_some() {
                            said.push(entry.clone());
                        }
                    }
                    node.ledger.insert(entry);
                    node.drop_contradicted();
                }
                Record::Tick { boot, time, state, odom } => {
                    node.known_boot = node.known_boot.max(Some(boot));
                    node.segments.restore(boot, time, state, odom, node.config.history_samples);
                }
                Record::Closed(cut) => {
                    // What could be closed then can be closed now, or the peers have the snapshot.
                    if node.ledger.closable().is_some_and(|closable| closable >= cut)
                        && let Some(hash) = node.ledger.close(cut)
                    {
                        node.remember_hash(cut, hash);
                        node.segments.forget_until(cut);
                    }
                }
                Record::Checkpoint(checkpoint) => node.resume(*checkpoint),
                Record::Earlier(earlier) => node.ledger.keep_earlier(earlier),
                // Of an approximate strategy.
                Record::Said(..) => {}
                Record::Sample(sample) => {
                    node.relive(sample, &mut announced);
                    let boot = node.segments.last().map(|(boot, _)| boot);
                    for entry in said.drain(..).filter(|entry| Some(entry.id.boot) == boot) {
                        node.hear(&entry);
                    }
                }
            }
        }
        node
    }

    /// Goes on from a snapshot in the journal.
    fn resume(&mut self, checkpoint: Checkpoint) {
        let own = checkpoint.logs.keys().filter(|log| log.robot == self.config.robot);
        self.known_boot = self.known_boot.max(own.map(|log| log.boot).max());
        let (cut, hash) = (checkpoint.time, checkpoint.fingerprint());
        if cut == Timestamp::MIN {
            // Evicted: it had asked to be admitted, and has not forgotten it. The entries it keeps come next.
            self.ledger = Self::empty_ledger(&self.config);
            self.membership.joining = Some(self.next_boot());
            self.membership.forget_cuts();
        } else {
            self.ledger.take_over(checkpoint);
            self.segments.forget_until(cut);
            self.remember_hash(cut, hash);
        }
    }

    /// A sample of the journal. An observation became a fact in the same batch of records, or was never
    /// reached by the odometry of its boot.
    fn relive(&mut self, sample: Sample, announced: &mut Option<(BootIndex, Boot)>) {
        let sample = self.on_time(sample);
        match sample.reading {
            Reading::Gyro { yaw_rate_rad_s } => self.gyro(sample.time, yaw_rate_rad_s),
            Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                // Whoever wrote the journal took the sample: nothing is refused now that was not then.
                if self.ledger.closure().is_some() {
                    // Its state stands in the journal by itself.
                    self.correct_again(sample);
                    return;
                }
                let rebased = |boot: &Boot| boot.time.0 == sample.time.0 + 1;
                if let Some((index, boot)) = announced.take_if(|(_, boot)| rebased(boot)) {
                    let _ = self.reckon(sample);
                    let odom = self.odom_of(&boot);
                    self.segments.begin(index, boot.time, boot.nominal, odom, self.config.history_samples);
                } else if let Some((index, boot)) = announced.take_if(|(_, boot)| boot.time == sample.time) {
                    let horizon = self.config.history_samples;
                    if self.restart(sample).is_ok() {
                        let odom = self.odom_of(&boot);
                        self.segments.begin(index, boot.time, boot.nominal, odom, horizon);
                    }
                } else {
                    let _ = self.reckon(sample);
                }
            }
            _ => {}
        }
    }
}
