//! Commands that were written down.

use super::Twist;

/// A row ends this much early, seconds: times of commands are sums and off by roundings.
const ROUNDING_S: f64 = 1e-6;

/// Commands one after the other, each held for its time.
pub(super) struct Script {
    rows: Vec<[f64; 3]>,
    /// When the first command was asked for, seconds.
    begun_s: Option<f64>,
}

impl Script {
    /// `rows` are `[forward m/s, yaw rate rad/s, seconds]`.
    pub(super) fn new(rows: &[[f64; 3]]) -> Self {
        Self { rows: rows.to_vec(), begun_s: None }
    }

    /// The command at this time; none when all are over.
    pub(super) fn next(&mut self, time_s: f64) -> Option<Twist> {
        let mut since_s = time_s - *self.begun_s.get_or_insert(time_s);
        for &[forward_m_s, yaw_rate_rad_s, lasts_s] in &self.rows {
            if since_s < lasts_s - ROUNDING_S {
                return Some(Twist { forward_m_s, yaw_rate_rad_s });
            }
            since_s -= lasts_s;
        }
        None
    }
}
