//! A node from the journal of its former life.

use pleiad_estimation::BootIndex;
use pleiad_estimation::fact::{Body, Boot};
use pleiad_estimation::sample::Reading;

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
        for record in records {
            match record {
                Record::Entry(entry) => {
                    if entry.id.robot == node.config.robot {
                        node.known_boot = node.known_boot.max(Some(entry.id.boot));
                        if let Body::Boot(boot) = &entry.body {
                            announced = Some((entry.id.boot, *boot));
                        }
                    }
                    node.ledger.insert(entry);
                }
                Record::Sample(sample) => match sample.reading {
                    Reading::Gyro { yaw_rate_rad_s } => node.dead_reckoning.gyro(sample.time, yaw_rate_rad_s),
                    Reading::Velocity { .. } | Reading::Wheels { .. } | Reading::Increment(_) => {
                        if let Some((index, boot)) = announced.take_if(|(_, boot)| boot.time == sample.time) {
                            let horizon = node.config.history_samples;
                            node.segments.begin(index, boot.time, boot.nominal, horizon);
                            node.dead_reckoning.restart(sample);
                        } else if let Ok(Some(step)) = node.dead_reckoning.odometry(sample) {
                            node.segments.extend(&step);
                        }
                    }
                    // An observation became a fact in the same batch of records, or was never reached by
                    // the odometry of its boot.
                    _ => {}
                },
            }
        }
        node
    }
}
