//! The kinds of concealment.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::BenchmarkError;

/// How an answer is concealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Nothing acts.
    Clean,
    /// One effect of the catalogue.
    Single,
    /// Two errors that cancel where the robot comes back to.
    Masked,
    /// A nominal model that is tuned so that it hides the effect.
    Absorbed,
    /// Two effects that cancel on average.
    Cancelling,
    /// A small effect under a large one and coloured noise.
    Buried,
    /// An effect that acts in at most 3 % of the time or place.
    Rare,
    /// An effect that the catalogue is made to lack.
    OutOfCatalogue,
    /// What the driving cannot tell from others.
    Unidentifiable,
    /// A wrong clock, marker or name that is no physics.
    Decoy,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Clean,
        Self::Single,
        Self::Masked,
        Self::Absorbed,
        Self::Cancelling,
        Self::Buried,
        Self::Rare,
        Self::OutOfCatalogue,
        Self::Unidentifiable,
        Self::Decoy,
    ];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Single => "single",
            Self::Masked => "masked",
            Self::Absorbed => "absorbed",
            Self::Cancelling => "cancelling",
            Self::Buried => "buried",
            Self::Rare => "rare",
            Self::OutOfCatalogue => "out_of_catalogue",
            Self::Unidentifiable => "unidentifiable",
            Self::Decoy => "decoy",
        }
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Class {
    type Err = BenchmarkError;

    fn from_str(name: &str) -> Result<Self, BenchmarkError> {
        let known = Self::ALL.into_iter().find(|class| class.name() == name);
        known.ok_or_else(|| BenchmarkError::UnknownClass { found: name.to_owned() })
    }
}

/// A class that is asked for, with a number of seeds of its own or not: `clean`, `clean:100`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Which class.
    pub class: Class,
    /// How many seeds; `None`: as many as the others.
    pub seeds: Option<u64>,
}

impl From<Class> for Asked {
    fn from(class: Class) -> Self {
        Self { class, seeds: None }
    }
}

impl fmt::Display for Asked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.seeds {
            None => write!(f, "{}", self.class),
            Some(seeds) => write!(f, "{}:{seeds}", self.class),
        }
    }
}

impl FromStr for Asked {
    type Err = BenchmarkError;

    fn from_str(text: &str) -> Result<Self, BenchmarkError> {
        let Some((class, seeds)) = text.split_once(':') else {
            return Ok(Self::from(text.parse::<Class>()?));
        };
        let wrong = || BenchmarkError::NoNumber { found: text.to_owned() };
        match seeds.parse() {
            Ok(0) => Err(BenchmarkError::NoSeeds),
            Ok(seeds) => Ok(Self { class: class.parse()?, seeds: Some(seeds) }),
            Err(_) => Err(wrong()),
        }
    }
}

/// The noise of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// No slip besides the effects; normal noise of the sensors.
    Quiet,
    /// White slip, normal.
    White,
    /// Slip that lasts (an Ornstein-Uhlenbeck process).
    Coloured,
    /// White slip and noise of gyro, GPS and heading, all of Student's distribution.
    HeavyTailed,
}

impl Noise {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Quiet => "quiet",
            Self::White => "white",
            Self::Coloured => "coloured",
            Self::HeavyTailed => "heavy_tailed",
        }
    }
}

impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
