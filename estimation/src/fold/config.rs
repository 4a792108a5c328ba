//! What decides the bits of an estimate besides the facts.

use super::Relinearization;
use crate::Timestamp;
use crate::fact::{Absolute, Fingerprint, Quantity};
use crate::joint::ErrorForm;
use crate::sample::Relative;

/// Raised whenever the same facts would give other bits.
pub const FOLD_VERSION: u32 = 2;

/// Gate on the normalized innovation squared by dimension: chi-square at 99.9 %.
pub const DEFAULT_GATE: [f64; 3] = [10.828, 13.816, 16.266];

/// All that decides the bits of an estimate besides the facts. A team must agree on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoldConfig {
    /// Coordinates of the error.
    pub form: ErrorForm,
    /// Gate by dimension of the measurement, 1 to 3; infinite to accept everything.
    pub gate: [f64; 3],
    /// Some observations are of nothing; `None` if all are of what they say.
    pub clutter: Option<Clutter>,
    /// Share of sightings that are of another than they name, beside those that are of nothing; of use where there is clutter.
    pub misnamed: f64,
    /// Stated levels of noise are raised where readings surprise; `None` if they are what is stated.
    pub inflation: Option<Inflation>,
    /// A robot that contradicts the others is not believed any more; `None` if everybody always is.
    pub quarantine: Option<Quarantine>,
    /// A robot without a prior begins a frame of its own, until what is seen between frames tells how they lie to one another.
    /// Without it such a robot has no place.
    pub join: bool,
    /// Facts are linearized together; `None` for each where those before it put the robots.
    pub relinearize: Option<Relinearization>,
}

/// Observations of what is not there: any reading the sensor can give, as likely as any other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clutter {
    /// Share of observations that are of nothing.
    pub share: f64,
    /// How far sensors see, m, and how far from the origin a position fix may be.
    pub reach_m: f64,
}

impl Clutter {
    /// Logarithm of the odds of an observation's being of nothing, by the density of its readings.
    pub(super) fn log_odds(&self, quantity: &Quantity) -> f64 {
        libm::log(self.share / (1.0 - self.share)) - self.log_volume(quantity)
    }

    /// Logarithm of the volume of the readings that a sensor can give.
    pub(crate) fn log_volume(&self, quantity: &Quantity) -> f64 {
        let disc = std::f64::consts::PI * self.reach_m * self.reach_m;
        let turn = std::f64::consts::TAU;
        let volume = match quantity {
            Quantity::Robot { relative, .. }
            | Quantity::Landmark { relative, .. }
            | Quantity::Feature { relative, .. } => match relative {
                Relative::Pose(_) => disc * turn,
                Relative::Position { .. } => disc,
                Relative::Range { .. } => self.reach_m,
                Relative::Bearing { .. } => turn,
                Relative::RangeBearing { .. } => self.reach_m * turn,
            },
            Quantity::Absolute(Absolute::Pose(_)) => disc * turn,
            Quantity::Absolute(Absolute::Position(_)) => disc,
            Quantity::Absolute(Absolute::Heading(_)) => turn,
        };
        libm::log(volume)
    }
}

/// Levels of noise that follow the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflation {
    /// Over how many readings of a robot.
    pub readings: f64,
    /// Largest factor on its variances; they are never below what is stated.
    pub most: f64,
}

/// When a robot is not believed any more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quarantine {
    /// Logarithm of the odds, nats, by which the robot must be likelier to be what is wrong than any other.
    pub level: f64,
    /// Whom it has not measured, and who has not measured it, for so long is not asked, ns.
    pub window_ns: i64,
}

impl Quarantine {
    /// A robot that was taken out of its frame since, and contradicts the others again, is not believed.
    pub(super) fn last_chance(&self, now: Timestamp) -> Timestamp {
        Timestamp(now.0.saturating_sub(self.window_ns.saturating_mul(10)))
    }
}

impl Default for FoldConfig {
    fn default() -> Self {
        Self {
            form: ErrorForm::Invariant,
            gate: DEFAULT_GATE,
            clutter: None,
            misnamed: 0.0,
            inflation: None,
            quarantine: None,
            join: false,
            relinearize: None,
        }
    }
}

impl FoldConfig {
    /// Hash of the configuration and the version of the fold. Robots whose hashes differ cannot share a
    /// ledger.
    pub fn hash(&self) -> u64 {
        let form = match self.form {
            ErrorForm::Invariant => 0,
            ErrorForm::Additive => 1,
        };
        let words = [u64::from(FOLD_VERSION), form].into_iter().chain(self.gate.map(f64::to_bits));
        let together = self.relinearize.iter().flat_map(|how| {
            let lengths = [how.block_ns, how.ahead_ns, how.cell_ns].map(i64::cast_unsigned);
            lengths.into_iter().chain([u64::from(how.passes)])
        });
        let clutter = self.clutter.iter().flat_map(|of| [of.share, of.reach_m].map(f64::to_bits));
        // Told apart from what follows by their number.
        let words = words.chain(clutter).chain(self.clutter.iter().map(|_| 1)).chain(together);
        let words = words.chain(self.join.then_some(2));
        let inflation = self.inflation.iter().flat_map(|of| [of.readings.to_bits(), of.most.to_bits(), 3]);
        let quarantine =
            self.quarantine.iter().flat_map(|of| [of.level.to_bits(), of.window_ns.cast_unsigned(), 4]);
        let misnamed = (self.misnamed > 0.0).then_some([self.misnamed.to_bits(), 5]);
        let words = words.chain(inflation).chain(quarantine).chain(misnamed.into_iter().flatten());
        let Fingerprint(bytes) = Fingerprint::of_words(words);
        bytes[..8].iter().fold(0, |hash, byte| hash << 8 | u64::from(*byte))
    }
}
