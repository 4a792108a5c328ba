//! Names of robots, landmarks, boots and instants. Newtypes, so that two numbers cannot be swapped.

use std::fmt;

/// A robot of the team. On every surface it is written as its number: `1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RobotId(pub u32);

/// A landmark of the map, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LandmarkId(pub u32);

/// The how-manieth start of a robot's agent: 0 for its first log, one more for each later one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BootIndex(pub u32);

/// Position of an entry in its log, from 0, without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sequence(pub u64);

/// Nanoseconds per second, as the field's integer unit of time.
const NANOS_PER_SECOND: f64 = 1e9;

/// An instant of team time in integer nanoseconds from the epoch of the run or recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Timestamp(pub i64);

impl Timestamp {
    /// The earliest instant that can be expressed.
    pub const MIN: Self = Self(i64::MIN);
    /// The latest instant that can be expressed.
    pub const MAX: Self = Self(i64::MAX);

    /// From seconds after the epoch, rounded to the nanosecond; saturates at the ends of the range.
    #[allow(clippy::cast_possible_truncation, reason = "the cast saturates, as documented")]
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * NANOS_PER_SECOND).round() as i64)
    }

    /// Seconds after the epoch. Exact to the nanosecond only within about 100 days of the epoch.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / NANOS_PER_SECOND
    }

    /// Seconds from `earlier` to `self`; negative if `self` comes first.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 / NANOS_PER_SECOND
    }

    /// The instant `seconds` later (earlier if negative).
    pub fn plus_seconds(self, seconds: f64) -> Self {
        Self(self.0.saturating_add(Self::from_seconds(seconds).0))
    }
}

impl fmt::Display for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for LandmarkId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for BootIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for Sequence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // From the integer: a Unix time has more digits than an f64.
        let (sign, nanos) = (if self.0 < 0 { "-" } else { "" }, self.0.unsigned_abs());
        write!(f, "{sign}{}.{:09} s", nanos / 1_000_000_000, nanos % 1_000_000_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_round_trip_at_epoch_scale_times() {
        // MRCLAM stamps are Unix seconds with milliseconds.
        let t = Timestamp::from_seconds(1_248_273_546.275);
        assert!((t.seconds() - 1_248_273_546.275).abs() < 5e-7);
        assert_eq!(Timestamp(1_248_273_546_275_000_001).to_string(), "1248273546.275000001 s");
        assert_eq!(Timestamp(-1_500_000_000).to_string(), "-1.500000000 s");
        assert!((t.plus_seconds(0.5).seconds_since(t) - 0.5).abs() < 1e-12);
    }
}
