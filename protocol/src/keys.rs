//! The keys of the protocol, declared once; nothing else puts a key together or takes one apart.
//!
//! `pleiad/<team>/<robot>/...` with, for each robot: `fact`, `estimate`, `status` (published by it),
//! `sensor/{odometry,wheels,gyro,gps,heading,relative}` (single samples published to it),
//! `sensor/batch` (asked of it: acknowledged batches), `facts`, `snapshot`, `control` (asked of it), `alive`
//! (its liveliness token), and `strategy/<robot>` (published by it for one other robot alone). A robot is
//! written as its number.

use std::fmt;
use std::str::FromStr;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Reading;

use crate::error::KeyError;

/// First segment of every key.
const ROOT: &str = "pleiad";
/// First segment after the robot of what an approximate strategy says.
const STRATEGY: &str = "strategy";
/// Longest team name.
const TEAM_CHARACTERS: usize = 32;

/// Name of a team: 1 to 32 of `a-z`, `0-9`, `_` and `-`, hence a single segment of a key.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TeamName(String);

impl TeamName {
    /// A checked name.
    pub fn new(name: &str) -> Result<Self, KeyError> {
        let allowed = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'_' || c == b'-';
        if (1..=TEAM_CHARACTERS).contains(&name.len()) && name.bytes().all(allowed) {
            Ok(Self(name.to_owned()))
        } else {
            Err(KeyError::Team { found: name.to_owned() })
        }
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for TeamName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for TeamName {
    type Err = KeyError;

    fn from_str(name: &str) -> Result<Self, KeyError> {
        Self::new(name)
    }
}

/// Which of a robot's sensors a sample is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SensorKind {
    /// Velocities and increments.
    Odometry,
    /// Wheel angles.
    Wheels,
    /// Yaw rates.
    Gyro,
    /// Absolute positions.
    Gps,
    /// Absolute headings.
    Heading,
    /// Sightings of robots and landmarks.
    Relative,
}

impl SensorKind {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Odometry, Self::Wheels, Self::Gyro, Self::Gps, Self::Heading, Self::Relative];

    /// Where a reading belongs.
    pub fn of(reading: &Reading) -> Self {
        match reading {
            Reading::Velocity { .. } | Reading::Increment(_) => Self::Odometry,
            Reading::Wheels { .. } => Self::Wheels,
            Reading::Gyro { .. } => Self::Gyro,
            Reading::Gps { .. } => Self::Gps,
            Reading::Heading { .. } => Self::Heading,
            Reading::Sighting { .. } => Self::Relative,
        }
    }

    /// Its segment in a key.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Odometry => "odometry",
            Self::Wheels => "wheels",
            Self::Gyro => "gyro",
            Self::Gps => "gps",
            Self::Heading => "heading",
            Self::Relative => "relative",
        }
    }
}

/// What a key of a robot is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Entries as they are made.
    Fact,
    /// The robot's estimate of itself.
    Estimate,
    /// What it says to one other robot, of an approximate strategy.
    Strategy {
        /// To whom.
        to: RobotId,
    },
    /// Its periodic status, which doubles as the digest of what it holds.
    Status,
    /// A single sample for it.
    Sensor(SensorKind),
    /// Ask: acknowledged batches of samples for it.
    SensorBatch,
    /// Ask: ranges of logs it holds.
    Facts,
    /// Ask: its closure snapshot.
    Snapshot,
    /// Ask: control of its process.
    Control,
    /// Its liveliness token.
    Alive,
}

impl Kind {
    /// All that have one key per robot.
    pub const ALL: [Self; 14] = [
        Self::Fact,
        Self::Estimate,
        Self::Status,
        Self::Sensor(SensorKind::Odometry),
        Self::Sensor(SensorKind::Wheels),
        Self::Sensor(SensorKind::Gyro),
        Self::Sensor(SensorKind::Gps),
        Self::Sensor(SensorKind::Heading),
        Self::Sensor(SensorKind::Relative),
        Self::SensorBatch,
        Self::Facts,
        Self::Snapshot,
        Self::Control,
        Self::Alive,
    ];

    /// The segment after the robot.
    const fn first_segment(self) -> &'static str {
        match self {
            Self::Fact => "fact",
            Self::Estimate => "estimate",
            Self::Strategy { .. } => STRATEGY,
            Self::Status => "status",
            Self::Sensor(_) | Self::SensorBatch => "sensor",
            Self::Facts => "facts",
            Self::Snapshot => "snapshot",
            Self::Control => "control",
            Self::Alive => "alive",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first = self.first_segment();
        match self {
            Self::Sensor(sensor) => write!(f, "{first}/{}", sensor.as_str()),
            Self::SensorBatch => write!(f, "{first}/batch"),
            Self::Strategy { to } => write!(f, "{first}/{to}"),
            _ => f.write_str(first),
        }
    }
}

/// A key of one robot. Written by `to_string()`, read by `parse()`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// The robot's team.
    pub team: TeamName,
    /// The robot.
    pub robot: RobotId,
    /// What for.
    pub kind: Kind,
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{ROOT}/{}/{}/{}", self.team, self.robot, self.kind)
    }
}

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(key: &str) -> Result<Self, KeyError> {
        let shape = |expected| KeyError::Shape { key: key.to_owned(), expected };
        let mut segments = key.splitn(4, '/');
        if segments.next() != Some(ROOT) {
            return Err(shape("pleiad/ at the beginning"));
        }
        let team = TeamName::new(segments.next().ok_or_else(|| shape("a team after pleiad/"))?)?;
        let robot = segments.next().ok_or_else(|| shape("a robot after the team"))?;
        let robot = parse_robot(robot)
            .ok_or_else(|| KeyError::Robot { key: key.to_owned(), found: robot.to_owned() })?;
        let tail = segments.next().ok_or_else(|| shape("a kind after the robot"))?;
        let kind = match tail.split_once('/') {
            Some((STRATEGY, to)) => parse_robot(to).map(|to| Kind::Strategy { to }),
            _ => Kind::ALL.into_iter().find(|kind| kind.to_string() == tail),
        };
        let kind = kind.ok_or_else(|| {
            shape(
                "fact, estimate, strategy/<robot>, status, sensor/<which>, facts, snapshot, control or alive",
            )
        })?;
        Ok(Self { team, robot, kind })
    }
}

/// Only the canonical decimal, so that a robot has one key.
fn parse_robot(segment: &str) -> Option<RobotId> {
    let canonical = segment == "0" || !segment.starts_with(['0', '+']);
    segment.parse().ok().filter(|_| canonical).map(RobotId)
}

/// The key of one robot of a team.
pub fn of(team: &TeamName, robot: RobotId, kind: Kind) -> String {
    Key { team: team.clone(), robot, kind }.to_string()
}

/// The expression for all robots of a team.
pub fn all(team: &TeamName, kind: Kind) -> String {
    format!("{ROOT}/{team}/*/{kind}")
}

/// The expression for all single samples for a robot. It matches `sensor/batch` as well, where nothing
/// is published: that key is only asked.
pub fn sensors(team: &TeamName, robot: RobotId) -> String {
    format!("{ROOT}/{team}/{robot}/sensor/*")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn team() -> TeamName {
        TeamName::new("blue-2_x").unwrap()
    }

    #[test]
    fn keys_are_the_documented_ones() {
        let key = |kind| of(&team(), RobotId(7), kind);
        assert_eq!(key(Kind::Fact), "pleiad/blue-2_x/7/fact");
        assert_eq!(key(Kind::Sensor(SensorKind::Gps)), "pleiad/blue-2_x/7/sensor/gps");
        assert_eq!(key(Kind::SensorBatch), "pleiad/blue-2_x/7/sensor/batch");
        assert_eq!(key(Kind::Alive), "pleiad/blue-2_x/7/alive");
        assert_eq!(key(Kind::Strategy { to: RobotId(2) }), "pleiad/blue-2_x/7/strategy/2");
        assert_eq!(all(&team(), Kind::Status), "pleiad/blue-2_x/*/status");
        assert_eq!(all(&team(), Kind::Strategy { to: RobotId(7) }), "pleiad/blue-2_x/*/strategy/7");
        assert_eq!(sensors(&team(), RobotId(7)), "pleiad/blue-2_x/7/sensor/*");
    }

    #[test]
    fn every_key_reads_back() {
        let strategy = [0, 17, u32::MAX].map(|to| Kind::Strategy { to: RobotId(to) });
        for kind in Kind::ALL.into_iter().chain(strategy) {
            for robot in [0, 1, 10, u32::MAX] {
                let key = Key { team: team(), robot: RobotId(robot), kind };
                assert_eq!(key.to_string().parse(), Ok(key));
            }
        }
    }

    #[test]
    fn every_sensor_is_a_kind() {
        for sensor in SensorKind::ALL {
            assert!(Kind::ALL.contains(&Kind::Sensor(sensor)));
        }
    }

    #[test]
    fn foreign_keys_are_refused_with_the_segment_at_fault() {
        let refused = |key: &str| key.parse::<Key>().unwrap_err();
        for key in ["", "pleiad", "pleiad/t", "pleiad/t/1", "other/t/1/fact", "pleiad/t/1/fact/x"] {
            assert!(matches!(refused(key), KeyError::Shape { .. }), "{key}");
        }
        for to in ["01", "", "*", "x", "1/2"] {
            assert!(matches!(refused(&format!("pleiad/t/1/strategy/{to}")), KeyError::Shape { .. }), "{to}");
        }
        for key in [
            "pleiad/t/1/",
            "pleiad/t/1/strategy",
            "pleiad/t/1/gps",
            "pleiad/t/1/sensor/fact",
            "pleiad/t/1/sensor",
            "/pleiad/t/1/fact",
        ] {
            assert!(matches!(refused(key), KeyError::Shape { .. }), "{key}");
        }
        for robot in ["01", "+1", "-1", "", "*", "r1", "4294967296", "00"] {
            let key = format!("pleiad/t/{robot}/fact");
            assert_eq!(refused(&key), KeyError::Robot { key: key.clone(), found: robot.into() });
        }
        assert_eq!(refused("pleiad/T/1/fact"), KeyError::Team { found: "T".into() });
    }

    #[test]
    fn team_names_are_one_plain_segment() {
        for name in ["a", "0", "-", "_", "team-1_b", &"x".repeat(32)] {
            assert_eq!(TeamName::new(name).unwrap().as_str(), name);
        }
        for name in ["", "A", "a b", "a/b", "*", "**", "a$*", "é", "a#", "a?", &"x".repeat(33)] {
            assert_eq!(TeamName::new(name), Err(KeyError::Team { found: name.into() }), "{name}");
        }
    }
}
