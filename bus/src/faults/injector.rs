//! A plan applied: from a packet to a [`Verdict`], seeded. The same object serves a network under virtual
//! time and a layer around a real one.

use std::collections::BTreeMap;

use pleiad_protocol::{Message, RobotId, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::plan::{Fault, FaultPlan};
use super::{Cause, Damage, Verdict};

/// Applies a plan. Equal calls on equal seeds give equal verdicts; every rule draws for every directed link
/// from a stream of its own, so that neither traffic elsewhere nor another rule changes its luck.
#[derive(Clone, Debug)]
pub struct Injector {
    plan: FaultPlan,
    seed: u64,
    /// Second 0 of the plan.
    origin: Timestamp,
    links: BTreeMap<(usize, RobotId, RobotId), Link>,
    /// When each receiver of a `slow` rule is done with what it has.
    busy_until_s: BTreeMap<(usize, RobotId), f64>,
}

/// What a rule remembers of a directed link.
#[derive(Clone, Debug)]
struct Link {
    luck: ChaCha8Rng,
    /// Whether a bursty link is bad.
    bad: bool,
}

/// The probabilities of turning bad and good again, per message.
pub(super) fn gilbert(loss: f64, mean_length: f64) -> (f64, f64) {
    let recovery = 1.0 / mean_length;
    // Stationary share of bad: p / (p + r) = loss.
    (recovery * loss / (1.0 - loss), recovery)
}

impl Injector {
    /// Begins a run at `origin`.
    pub fn new(plan: FaultPlan, seed: u64, origin: Timestamp) -> Self {
        Self { plan, seed, origin, links: BTreeMap::new(), busy_until_s: BTreeMap::new() }
    }

    /// The plan.
    pub fn plan(&self) -> &FaultPlan {
        &self.plan
    }

    /// Changes the plan while the run goes on; the luck of rules that keep their place in it goes on too.
    pub fn set_plan(&mut self, plan: FaultPlan) {
        self.plan = plan;
    }

    /// What becomes of a message. Its kind is read from its bytes.
    pub fn judge(&mut self, now: Timestamp, from: RobotId, to: RobotId, bytes: &[u8]) -> Verdict {
        let t_s = now.seconds_since(self.origin);
        let kind = Message::kind_of(bytes);
        let (mut lost, mut after_s, mut again_after_s, mut damage) = (None, 0.0, None, None);
        for (index, rule) in self.plan.rules.iter().enumerate() {
            if !rule.is_on(t_s) || !rule.concerns(from, to, kind) {
                continue;
            }
            let seed = self.seed;
            let link = self.links.entry((index, from, to)).or_insert_with(|| {
                let mut luck =
                    ChaCha8Rng::seed_from_u64(seed ^ (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
                luck.set_stream(u64::from(from.0) << 32 | u64::from(to.0));
                // A link is met in the middle of its life.
                let bad = match rule.fault {
                    Fault::Burst { loss, .. } => luck.random::<f64>() < loss,
                    _ => false,
                };
                Link { luck, bad }
            });
            // As many draws whatever becomes of it, so that those after it meet the same luck.
            let [first, second, third] = [(); 3].map(|()| link.luck.random::<f64>());
            let standing = lost.is_none();
            let mut lose = |cause| lost = lost.or(Some(cause));
            match &rule.fault {
                Fault::Loss { loss } => {
                    if first < *loss {
                        lose(Cause::Chance);
                    }
                }
                Fault::Burst { loss, mean_length } => {
                    if link.bad {
                        lose(Cause::Chance);
                    }
                    let (worse, better) = gilbert(*loss, *mean_length);
                    link.bad = if link.bad { first >= better } else { first < worse };
                }
                Fault::Delay { delay_s, jitter_s } => after_s += delay_s + first * jitter_s,
                Fault::Reorder { probability, by_s } => {
                    if first < *probability {
                        after_s += by_s;
                    }
                }
                Fault::Duplicate { probability, within_s } => {
                    if first < *probability {
                        again_after_s = Some(second * within_s);
                    }
                }
                Fault::Corrupt { probability, bytes } => {
                    if first < *probability {
                        damage = Some(Damage { seed: second.to_bits() ^ third.to_bits(), bytes: *bytes });
                    }
                }
                Fault::Cut => lose(Cause::Cut),
                Fault::Partition { groups } => {
                    let side = |robot| groups.iter().position(|group| group.contains(&robot));
                    if side(from) != side(to) {
                        lose(Cause::Cut);
                    }
                }
                Fault::Away { robots } => {
                    if robots.contains(&from) || robots.contains(&to) {
                        lose(Cause::Cut);
                    }
                }
                Fault::Slow { messages_per_s, queue } => {
                    // A message lost before does not burden the receiver.
                    if standing {
                        let busy = self.busy_until_s.entry((index, to)).or_insert(t_s);
                        let begin = busy.max(t_s);
                        if (begin - t_s) * messages_per_s > f64::from(*queue) {
                            lose(Cause::Overflow);
                        } else {
                            *busy = begin + 1.0 / messages_per_s;
                            after_s += *busy - t_s;
                        }
                    }
                }
                // Not of messages.
                Fault::Clock { .. }
                | Fault::Kill { .. }
                | Fault::Stop { .. }
                | Fault::DiskFull { .. }
                | Fault::CoordinatorDies => {}
            }
        }
        if let Some(cause) = lost {
            return Verdict::Lost(cause);
        }
        let again_after_s = again_after_s.map(|later| after_s + later);
        Verdict::Delivered { after_s, again_after_s, damage }
    }
}

#[cfg(test)]
mod tests;
