//! How much was published.

use std::collections::BTreeMap;
use std::ops::AddAssign;

use pleiad_protocol::RobotId;
use pleiad_protocol::keys::Kind;
use serde::Serialize;

/// Messages and their payload bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Count {
    /// How many.
    pub messages: u64,
    /// How long together, without keys and the transport's own bytes.
    pub bytes: u64,
}

impl AddAssign for Count {
    fn add_assign(&mut self, other: Self) {
        self.messages += other.messages;
        self.bytes += other.bytes;
    }
}

/// How much a team published while it was recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// By whose key it came, and of which kind.
    pub counts: BTreeMap<(RobotId, Kind), Count>,
    /// Messages that are not what their key says, or not valid.
    pub refused: u64,
    /// Messages that name another robot than their key does.
    pub misattributed: u64,
}

impl Traffic {
    pub(super) fn add(&mut self, robot: RobotId, kind: Kind, bytes: usize) {
        *self.counts.entry((robot, kind)).or_default() += Count { messages: 1, bytes: bytes as u64 };
    }

    /// Everything together.
    pub fn total(&self) -> Count {
        self.sum(|_, _| true)
    }

    /// Everything of one kind.
    pub fn of_kind(&self, kind: Kind) -> Count {
        self.sum(|_, found| found == kind)
    }

    /// Everything of one robot.
    pub fn of_robot(&self, robot: RobotId) -> Count {
        self.sum(|found, _| found == robot)
    }

    fn sum(&self, belongs: impl Fn(RobotId, Kind) -> bool) -> Count {
        let mut sum = Count::default();
        for ((robot, kind), count) in &self.counts {
            if belongs(*robot, *kind) {
                sum += *count;
            }
        }
        sum
    }

    /// As JSON: robots, and in each the kinds, by the names they have in keys.
    pub(super) fn to_json(&self) -> serde_json::Value {
        let mut robots: BTreeMap<String, BTreeMap<String, Count>> = BTreeMap::new();
        let mut kinds: BTreeMap<String, Count> = BTreeMap::new();
        for ((robot, kind), count) in &self.counts {
            robots.entry(robot.to_string()).or_default().insert(kind.to_string(), *count);
            *kinds.entry(kind.to_string()).or_default() += *count;
        }
        serde_json::json!({
            "robots": robots,
            "kinds": kinds,
            "total": self.total(),
            "refused": self.refused,
            "misattributed": self.misattributed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_up_by_robot_and_by_kind() {
        let mut traffic = Traffic::default();
        let (one, two) = (RobotId(1), RobotId(2));
        for (robot, kind, bytes) in
            [(one, Kind::Fact, 100), (one, Kind::Fact, 50), (one, Kind::Status, 7), (two, Kind::Fact, 1)]
        {
            traffic.add(robot, kind, bytes);
        }
        assert_eq!(traffic.counts[&(one, Kind::Fact)], Count { messages: 2, bytes: 150 });
        assert_eq!(traffic.of_robot(one), Count { messages: 3, bytes: 157 });
        assert_eq!(traffic.of_kind(Kind::Fact), Count { messages: 3, bytes: 151 });
        assert_eq!(traffic.of_kind(Kind::Estimate), Count::default());
        assert_eq!(traffic.total(), Count { messages: 4, bytes: 158 });
        let json = traffic.to_json();
        assert_eq!(json["robots"]["1"]["fact"]["bytes"], 150);
        assert_eq!(json["kinds"]["fact"]["messages"], 3);
        assert_eq!(json["total"]["messages"], 4);
    }
}
