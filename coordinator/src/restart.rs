//! Whether and when an agent that ended is started again.

use std::fmt;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// How a process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exit {
    /// By itself, with this code; 0 is success.
    Code(i32),
    /// By this signal.
    Signal(i32),
    /// It could not be started again.
    NotStarted,
}

impl Exit {
    /// Whether anything but success.
    pub fn failed(self) -> bool {
        self != Self::Code(0)
    }
}

impl From<ExitStatus> for Exit {
    fn from(status: ExitStatus) -> Self {
        // A status without a code has a signal.
        status.code().map_or_else(|| Self::Signal(status.signal().unwrap_or_default()), Self::Code)
    }
}

impl fmt::Display for Exit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Code(code) => write!(f, "exit code {code}"),
            Self::Signal(signal) => write!(f, "killed by signal {signal}"),
            Self::NotStarted => f.write_str("could not be started again"),
        }
    }
}

/// When an agent is started again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// Never by itself.
    #[default]
    Never,
    /// When it ended with a failure that nobody asked for.
    OnFailure,
}

/// `[backoff]`: how long to wait before an agent is started again, and how often.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Backoff {
    /// Before the first restart, s; doubled for each further one.
    pub first_s: f64,
    /// Longest wait, s.
    pub longest_s: f64,
    /// Failures in a row after which it is given up.
    pub max_restarts: u32,
    /// An agent that ran this long is taken to be healthy: the count starts anew.
    pub stable_s: f64,
}

impl Default for Backoff {
    fn default() -> Self {
        Self { first_s: 0.5, longest_s: 30.0, max_restarts: 5, stable_s: 60.0 }
    }
}

impl Backoff {
    /// The wait before the restart after so many earlier ones: `first_s 2^earlier`, at most `longest_s`.
    pub fn delay(&self, earlier: u32) -> Duration {
        let exponent = i32::try_from(earlier).unwrap_or(i32::MAX);
        seconds((self.first_s * 2.0_f64.powi(exponent)).min(self.longest_s))
    }
}

/// Seconds of a checked configuration.
pub(crate) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// What becomes of an agent that ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It stays ended.
    Leave,
    /// It is started again after this time.
    After(Duration),
    /// It would be, but has failed too often.
    GiveUp,
}

/// When and how often agents are started again.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RestartPolicy {
    pub(crate) when: Restart,
    pub(crate) backoff: Backoff,
}

impl RestartPolicy {
    /// What becomes of an agent that ended after `earlier` restarts in a row.
    pub(crate) fn verdict(&self, exit: Exit, earlier: u32) -> Verdict {
        match self.when {
            Restart::OnFailure if !exit.failed() => Verdict::Leave,
            Restart::Never => Verdict::Leave,
            Restart::OnFailure if earlier >= self.backoff.max_restarts => Verdict::GiveUp,
            Restart::OnFailure => Verdict::After(self.backoff.delay(earlier)),
        }
    }

    /// Whether an agent that ran this long counts as healthy.
    pub(crate) fn stable(&self, ran: Duration) -> bool {
        ran >= seconds(self.backoff.stable_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_double_up_to_the_longest() {
        let backoff = Backoff { first_s: 0.5, longest_s: 3.0, ..Backoff::default() };
        let delays: Vec<_> = (0..5).map(|earlier| backoff.delay(earlier).as_secs_f64()).collect();
        assert_eq!(delays, [0.5, 1.0, 2.0, 3.0, 3.0]);
        assert_eq!(backoff.delay(u32::MAX), Duration::from_secs(3));
    }

    #[test]
    fn only_failures_are_restarted_and_not_for_ever() {
        let backoff = Backoff { first_s: 1.0, max_restarts: 2, ..Backoff::default() };
        let policy = RestartPolicy { when: Restart::OnFailure, backoff };
        assert_eq!(policy.verdict(Exit::Code(0), 0), Verdict::Leave);
        for exit in [Exit::Code(1), Exit::Signal(9), Exit::NotStarted] {
            assert_eq!(policy.verdict(exit, 0), Verdict::After(Duration::from_secs(1)));
            assert_eq!(policy.verdict(exit, 1), Verdict::After(Duration::from_secs(2)));
            assert_eq!(policy.verdict(exit, 2), Verdict::GiveUp);
            assert_eq!(RestartPolicy::default().verdict(exit, 0), Verdict::Leave, "never is never");
        }
    }

    #[test]
    fn codes_and_signals_are_told_apart() {
        // Wait statuses as wait(2) lays them out: the code in the second byte, the signal in the first.
        assert_eq!(Exit::from(ExitStatus::from_raw(3 << 8)), Exit::Code(3));
        assert_eq!(Exit::from(ExitStatus::from_raw(9)), Exit::Signal(9));
        assert!(!Exit::Code(0).failed());
    }
}
