//! Measurements that arrive late.

use super::{Ekf, Measurement, Outcome, Process, SingleError};
use crate::Timestamp;

/// A filter that keeps the measurements of its last seconds, and the belief before each. A late one goes to its own
/// instant: the filter returns to the belief before it and takes what follows again. So the estimate is that of the
/// measurements in the order in which they were taken, bit for bit, whatever the order in which they arrived.
#[derive(Clone, Debug)]
pub struct Replay<P, const N: usize> {
    /// The filter after everything that was taken.
    filter: Ekf<P, N>,
    window_s: f64,
    /// In order of time and of rank.
    kept: Vec<Kept<P, N>>,
    /// The latest that was let go; nothing is placed before it.
    forgotten: Option<(Timestamp, u32)>,
}

#[derive(Clone, Debug)]
struct Kept<P, const N: usize> {
    key: (Timestamp, u32),
    measurement: Measurement<N>,
    before: Ekf<P, N>,
}

impl<P: Process<N> + Clone, const N: usize> Replay<P, N> {
    /// Begins with a filter; measurements are kept for `window_s` seconds.
    pub fn new(filter: Ekf<P, N>, window_s: f64) -> Self {
        Self { filter, window_s, kept: Vec::new(), forgotten: None }
    }

    /// The filter after everything that was taken.
    pub fn filter(&self) -> &Ekf<P, N> {
        &self.filter
    }

    /// How many measurements are kept.
    pub fn kept(&self) -> usize {
        self.kept.len()
    }

    /// Takes a measurement, late or not. `rank` orders those of one instant: a number for each sensor.
    ///
    /// # Errors
    /// [`SingleError::TooOld`] if it was taken before what is kept; the filter is then unchanged, as after any error.
    pub fn take(&mut self, measurement: Measurement<N>, rank: u32) -> Result<Outcome, SingleError> {
        let key = (measurement.time, rank);
        if let Some(forgotten) = self.forgotten
            && key <= forgotten
        {
            return Err(SingleError::TooOld { time: measurement.time, from: forgotten.0 });
        }
        let place = self.kept.partition_point(|kept| kept.key <= key);
        let before = self.kept.get(place).map_or_else(|| self.filter.clone(), |next| next.before.clone());
        // On copies: a refusal leaves everything as it was.
        let mut filter = before.clone();
        let outcome = filter.take(&measurement)?;
        let mut again = Vec::with_capacity(self.kept.len() - place);
        for kept in &self.kept[place..] {
            again.push(filter.clone());
            filter.take(&kept.measurement)?;
        }
        for (kept, before) in self.kept[place..].iter_mut().zip(again) {
            kept.before = before;
        }
        self.kept.insert(place, Kept { key, measurement, before });
        self.filter = filter;
        self.forget();
        Ok(outcome)
    }

    /// Lets go what is older than the window.
    fn forget(&mut self) {
        let from = self.filter.time().plus_seconds(-self.window_s);
        let gone = self.kept.partition_point(|kept| kept.key.0 < from);
        if let Some(last) = self.kept.drain(..gone).next_back() {
            self.forgotten = Some(last.key);
        }
    }
}
