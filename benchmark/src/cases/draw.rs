//! Chance of a case: one generator, keyed by the name of the case.

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardUniform};

use crate::seal::digest;

/// Ends every key, so that no other use of a name shares a stream.
const PURPOSE: &str = " of the benchmark on concealed data";

/// A stream of draws.
pub(crate) struct Draw(ChaCha12Rng);

impl Draw {
    /// That of a case.
    pub(crate) fn of(id: &str) -> Self {
        Self(ChaCha12Rng::from_seed(digest(format!("{id}{PURPOSE}").as_bytes())))
    }

    /// The seed of a simulation.
    pub(crate) fn seed(&mut self) -> u64 {
        StandardUniform.sample(&mut self.0)
    }

    /// Uniform in `[from, to)`.
    pub(crate) fn between(&mut self, from: f64, to: f64) -> f64 {
        let share: f64 = StandardUniform.sample(&mut self.0);
        from + (to - from) * share
    }

    /// Plus or minus one.
    pub(crate) fn sign(&mut self) -> f64 {
        if self.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }
    }

    /// One of `0..count`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a small count")]
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.between(0.0, count as f64)) as usize).min(count.saturating_sub(1))
    }
}
