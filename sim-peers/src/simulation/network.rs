//! A network under virtual time: every directed link loses in bursts, delays, reorders and repeats, and a
//! partition cuts it.

use std::collections::BTreeMap;

use pleiad_estimation::{RobotId, Timestamp};
use pleiad_protocol::Message;

use super::chance::Chance;

/// What links do to messages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weather {
    /// Share of time a link loses everything.
    pub loss: f64,
    /// How long it does so at a time, in messages.
    pub burst: f64,
    /// Least time under way, s.
    pub delay_s: f64,
    /// More time under way, uniform, s: messages overtake one another.
    pub jitter_s: f64,
    /// Share of messages that arrive twice.
    pub repeated: f64,
}

/// A message on its way.
#[derive(Clone, Debug)]
pub struct Delivery {
    pub from: RobotId,
    pub to: RobotId,
    pub message: Message,
}

#[derive(Debug)]
pub struct Network {
    pub weather: Weather,
    /// The side of each robot while a partition is on.
    pub sides: Option<BTreeMap<RobotId, u32>>,
    chance: Chance,
    /// Links that lose everything at present.
    bad: BTreeMap<(RobotId, RobotId), bool>,
    under_way: BTreeMap<(Timestamp, u64), Delivery>,
    sent: u64,
}

impl Network {
    pub fn new(chance: Chance, weather: Weather) -> Self {
        let (bad, under_way) = (BTreeMap::new(), BTreeMap::new());
        Self { weather, sides: None, chance, bad, under_way, sent: 0 }
    }

    pub fn connected(&self, a: RobotId, b: RobotId) -> bool {
        self.sides.as_ref().is_none_or(|sides| sides.get(&a) == sides.get(&b))
    }

    /// Gilbert and Elliott's link: a good and a bad state, left with fixed probabilities.
    fn lost(&mut self, from: RobotId, to: RobotId) -> bool {
        let Weather { loss, burst, .. } = self.weather;
        if loss <= 0.0 {
            return false;
        }
        let bad = self.bad.entry((from, to)).or_insert(false);
        let leave_bad = 1.0 / burst.max(1.0);
        let enter_bad = (leave_bad * loss / (1.0 - loss).max(1e-3)).min(1.0);
        *bad = if *bad { !self.chance.happens(leave_bad) } else { self.chance.happens(enter_bad) };
        *bad
    }

    pub fn send(&mut self, now: Timestamp, from: RobotId, to: RobotId, message: &Message) {
        if self.lost(from, to) || !self.connected(from, to) {
            return;
        }
        let copies = 1 + u32::from(self.chance.happens(self.weather.repeated));
        for _ in 0..copies {
            let after_s = self.weather.delay_s + self.weather.jitter_s * self.chance.unit();
            self.sent += 1;
            let delivery = Delivery { from, to, message: message.clone() };
            self.under_way.insert((now.plus_seconds(after_s), self.sent), delivery);
        }
    }

    pub fn next_due(&self) -> Option<Timestamp> {
        self.under_way.first_key_value().map(|((due, _), _)| *due)
    }

    pub fn take(&mut self) -> Option<Delivery> {
        self.under_way.pop_first().map(|(_, delivery)| delivery)
    }

    pub fn sent(&self) -> u64 {
        self.sent
    }
}
