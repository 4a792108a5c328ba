//! A network under virtual time, for fleets in one thread: rules from a packet to a [`Verdict`], seeded.
//! [`FaultPlan`] says what goes wrong where and when, [`Injector`] applies it.
//!
//! Every directed link draws from a stream of its own, so that more traffic on one link does not change
//! the luck of another; deliveries come in the order of their due time, then of sending. Equal calls on
//! equal seeds give equal runs.

mod injector;
mod plan;
mod read;
mod script;
mod write;

use std::collections::BTreeMap;

pub use injector::Injector;
pub use plan::{Again, Fault, FaultPlan, InvalidRule, Rule};
pub use read::FaultsError;

use pleiad_protocol::{RobotId, Timestamp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What goes wrong on one directed link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkFaults {
    /// Probability that a message is lost, 0 to 1.
    pub loss: f64,
    /// Least time under way, s.
    pub delay_s: f64,
    /// Further time under way, uniform between 0 and this, s. Messages overtake one another by it.
    pub jitter_s: f64,
    /// Probability that a message which is not lost arrives twice, each copy with a jitter of its own.
    pub duplicate: f64,
}

/// A value of [`LinkFaults`] that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("link faults: {field} is {found}, expected {expected}")]
pub struct InvalidFaults {
    /// Which value.
    pub field: &'static str,
    /// What it is.
    pub found: f64,
    /// What it may be.
    pub expected: &'static str,
}

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is lost.
    Lost(Cause),
    /// It arrives after this many seconds, and perhaps once more.
    Delivered {
        /// Seconds under way.
        after_s: f64,
        /// Seconds under way of the second copy.
        again_after_s: Option<f64>,
        /// What happens to its bytes.
        damage: Option<Damage>,
    },
}

/// Why a message is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// By chance.
    Chance,
    /// There is no link: one-way, a partition, out of range.
    Cut,
    /// The receiver is too slow and its queue full.
    Overflow,
}

/// Bytes flipped on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Decides which bytes, and how.
    pub seed: u64,
    /// How many at most; two flips may meet on one byte, but never undo one another.
    pub bytes: u8,
}

impl Damage {
    /// Flips the bytes.
    pub fn apply(&self, bytes: &mut [u8]) {
        if bytes.is_empty() {
            return;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let before = bytes.to_vec();
        for _ in 0..self.bytes {
            let index = rng.random_range(0..bytes.len());
            bytes[index] = bytes[index].wrapping_add(rng.random_range(1..=255));
            if bytes[index] == before[index] {
                bytes[index] ^= 1;
            }
        }
    }
}

impl LinkFaults {
    /// Checked.
    ///
    /// # Errors
    /// A probability outside 0 to 1, or a time that is negative or not finite.
    pub fn check(self) -> Result<Self, InvalidFaults> {
        for (field, found) in [("loss", self.loss), ("duplicate", self.duplicate)] {
            if !(0.0..=1.0).contains(&found) {
                return Err(InvalidFaults { field, found, expected: "a probability from 0 to 1" });
            }
        }
        for (field, found) in [("delay_s", self.delay_s), ("jitter_s", self.jitter_s)] {
            if !(0.0..=MAX_TIME_S).contains(&found) {
                return Err(InvalidFaults { field, found, expected: "seconds from 0 to 1e6" });
            }
        }
        Ok(self)
    }

    /// What becomes of the next message. Four draws whatever the outcome, so that the messages after it
    /// meet the same luck under other rules.
    pub fn verdict(&self, rng: &mut ChaCha8Rng) -> Verdict {
        let [lost, doubled, first, second] = [(); 4].map(|()| rng.random::<f64>());
        if lost < self.loss {
            return Verdict::Lost(Cause::Chance);
        }
        let after = |luck: f64| self.delay_s + luck * self.jitter_s;
        let again_after_s = (doubled < self.duplicate).then(|| after(second));
        Verdict::Delivered { after_s: after(first), again_after_s, damage: None }
    }
}

/// Longest delay or jitter; within it, times keep their nanoseconds.
const MAX_TIME_S: f64 = 1e6;

/// A message that has arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivery<T> {
    /// Who sent it.
    pub from: RobotId,
    /// Who gets it.
    pub to: RobotId,
    /// The message.
    pub payload: T,
}

/// Messages and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// How many.
    pub messages: u64,
    /// How many bytes together.
    pub bytes: u64,
}

impl Tally {
    fn add(&mut self, bytes: usize) {
        self.messages += 1;
        self.bytes += bytes as u64;
    }
}

/// What happened so far. `sent + duplicated = delivered + lost + cut + overflowed + under way`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Handed in by senders.
    pub sent: Tally,
    /// Second copies.
    pub duplicated: Tally,
    /// Handed out to receivers.
    pub delivered: Tally,
    /// Lost by chance.
    pub lost: Tally,
    /// Dropped where there is no link.
    pub cut: Tally,
    /// Dropped because the receiver is too slow.
    pub overflowed: Tally,
    /// Copies put under way with flipped bytes.
    pub damaged: Tally,
}

/// A network under virtual time.
#[derive(Clone, Debug)]
pub struct VirtualNetwork<T> {
    seed: u64,
    faults: LinkFaults,
    /// Links that differ from the rest.
    exceptions: BTreeMap<(RobotId, RobotId), LinkFaults>,
    /// The luck of each link that has been used.
    luck: BTreeMap<(RobotId, RobotId), ChaCha8Rng>,
    /// The rules of a plan, on top of the faults above.
    injector: Option<Injector>,
    /// While a partition is on: the side of every robot named in it. The others are one more side.
    sides: Option<BTreeMap<RobotId, usize>>,
    /// Under way, by due time and order of sending.
    under_way: BTreeMap<(Timestamp, u64), Delivery<T>>,
    /// Copies that have been put under way.
    count: u64,
    traffic: Traffic,
}

impl<T: Clone + AsRef<[u8]> + From<Vec<u8>>> VirtualNetwork<T> {
    /// A network whose links all have the same faults.
    ///
    /// # Errors
    /// Faults that make no sense.
    pub fn new(seed: u64, faults: LinkFaults) -> Result<Self, InvalidFaults> {
        Ok(Self {
            seed,
            faults: faults.check()?,
            exceptions: BTreeMap::new(),
            luck: BTreeMap::new(),
            injector: None,
            sides: None,
            under_way: BTreeMap::new(),
            count: 0,
            traffic: Traffic::default(),
        })
    }

    /// Puts a plan on top of the faults; second 0 of it is `origin`.
    pub fn set_plan(&mut self, plan: FaultPlan, origin: Timestamp) {
        self.injector = Some(Injector::new(plan, self.seed, origin));
    }

    /// Changes the faults of all links, those set apart included; what is under way stays so.
    ///
    /// # Errors
    /// Faults that make no sense.
    pub fn set_faults(&mut self, faults: LinkFaults) -> Result<(), InvalidFaults> {
        self.faults = faults.check()?;
        self.exceptions.clear();
        Ok(())
    }

    /// Changes the faults of one directed link.
    ///
    /// # Errors
    /// Faults that make no sense.
    pub fn set_link(&mut self, from: RobotId, to: RobotId, faults: LinkFaults) -> Result<(), InvalidFaults> {
        self.exceptions.insert((from, to), faults.check()?);
        Ok(())
    }

    /// Cuts the network into groups that do not reach one another; robots in no group form one more. What
    /// is under way still arrives.
    pub fn partition(&mut self, groups: &[Vec<RobotId>]) {
        let sides = groups.iter().enumerate();
        self.sides =
            Some(sides.flat_map(|(side, robots)| robots.iter().map(move |robot| (*robot, side))).collect());
    }

    /// Ends the partition.
    pub fn heal(&mut self) {
        self.sides = None;
    }

    /// Sends a message at an instant.
    pub fn send(&mut self, now: Timestamp, from: RobotId, to: RobotId, payload: T) {
        let bytes = payload.as_ref().len();
        self.traffic.sent.add(bytes);
        // Drawn even if the message is cut, so that a partition does not change the luck after it.
        let verdict = self.verdict(from, to);
        if self.sides.as_ref().is_some_and(|sides| sides.get(&from) != sides.get(&to)) {
            self.traffic.cut.add(bytes);
            return;
        }
        let ruled = match &mut self.injector {
            Some(injector) => injector.judge(now, from, to, payload.as_ref()),
            None => Verdict::Delivered { after_s: 0.0, again_after_s: None, damage: None },
        };
        match (verdict, ruled) {
            (Verdict::Lost(cause), _) | (_, Verdict::Lost(cause)) => match cause {
                Cause::Chance => self.traffic.lost.add(bytes),
                Cause::Cut => self.traffic.cut.add(bytes),
                Cause::Overflow => self.traffic.overflowed.add(bytes),
            },
            (
                Verdict::Delivered { after_s, again_after_s, .. },
                Verdict::Delivered { after_s: later_s, again_after_s: again_later_s, damage },
            ) => {
                let payload = match damage {
                    None => payload,
                    Some(damage) => {
                        self.traffic.damaged.add(bytes);
                        let mut bytes = payload.as_ref().to_vec();
                        damage.apply(&mut bytes);
                        T::from(bytes)
                    }
                };
                let copies = [
                    again_after_s.map(|again_s| again_s + later_s),
                    again_later_s.map(|again_s| after_s + again_s),
                ];
                for again_s in copies.into_iter().flatten() {
                    self.traffic.duplicated.add(bytes);
                    self.put(now.plus_seconds(again_s), Delivery { from, to, payload: payload.clone() });
                }
                self.put(now.plus_seconds(after_s + later_s), Delivery { from, to, payload });
            }
        }
    }

    /// Everything due by `now` that has not been handed out yet, in order.
    pub fn poll(&mut self, now: Timestamp) -> Vec<Delivery<T>> {
        let later = now.0.checked_add(1).map(|later| self.under_way.split_off(&(Timestamp(later), 0)));
        let due = std::mem::replace(&mut self.under_way, later.unwrap_or_default());
        let due: Vec<_> = due.into_values().collect();
        for delivery in &due {
            self.traffic.delivered.add(delivery.payload.as_ref().len());
        }
        due
    }

    /// When the next message is due.
    pub fn next_due(&self) -> Option<Timestamp> {
        self.under_way.first_key_value().map(|((due, _), _)| *due)
    }

    /// How many copies are under way.
    pub fn under_way(&self) -> usize {
        self.under_way.len()
    }

    /// What happened so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn put(&mut self, due: Timestamp, delivery: Delivery<T>) {
        self.under_way.insert((due, self.count), delivery);
        self.count += 1;
    }

    fn verdict(&mut self, from: RobotId, to: RobotId) -> Verdict {
        let seed = self.seed;
        let luck = self.luck.entry((from, to)).or_insert_with(|| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(u64::from(from.0) << 32 | u64::from(to.0));
            rng
        });
        self.exceptions.get(&(from, to)).unwrap_or(&self.faults).verdict(luck)
    }
}

#[cfg(test)]
mod tests;
