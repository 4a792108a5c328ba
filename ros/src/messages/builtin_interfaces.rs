//! `builtin_interfaces`.

use super::message;

const NANOS_PER_SECOND: i64 = 1_000_000_000;

message! {
    /// An instant, counted from the epoch of the clock that it was read from.
    #[derive(Copy)]
    Time = "builtin_interfaces/msg/Time" {
        /// Whole seconds, rounded down.
        sec: i32,
        /// Nanoseconds since then, below 1e9.
        nanosec: u32,
    }
}

impl Time {
    /// The instant `nanos` nanoseconds after the epoch; `None` before 1901 and after 2038, where seconds do not fit.
    pub fn from_nanos(nanos: i64) -> Option<Self> {
        let sec = i32::try_from(nanos.div_euclid(NANOS_PER_SECOND)).ok()?;
        let nanosec = u32::try_from(nanos.rem_euclid(NANOS_PER_SECOND)).ok()?;
        Some(Self { sec, nanosec })
    }

    /// Nanoseconds since the epoch; `None` if `nanosec` is a second or more.
    pub fn nanos(self) -> Option<i64> {
        let nanosec = i64::from(self.nanosec);
        (nanosec < NANOS_PER_SECOND).then(|| i64::from(self.sec) * NANOS_PER_SECOND + nanosec)
    }
}
