//! The manoeuvres by their names.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A kind of manoeuvre of the programme that tells effects apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ManoeuvreKind {
    /// Standing still.
    Standstill,
    /// Straights forth and back at three speeds.
    Straight,
    /// Turns on the spot, both ways, fast and slow. Not for cars.
    Turn,
    /// Turns on the spot in steps, both ways. Not for cars.
    TurnSteps,
    /// Full circles at the greatest yaw rate, both ways; for cars the tightest arcs, slowly.
    Circle,
    /// Arcs of two radii, both ways, forth and back.
    Arc,
    /// Two circles in opposite senses, forwards and backwards.
    FigureEight,
    /// Squares both ways.
    Square,
    /// Starts and stops, forwards and backwards.
    Steps,
    /// Slowly up to a speed and down again, forth and back.
    Ramp,
    /// A wavy line ahead, and back along it.
    Weave,
    /// Speeds about a dead band.
    Crawl,
}

impl ManoeuvreKind {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Standstill,
        Self::Straight,
        Self::Turn,
        Self::TurnSteps,
        Self::Circle,
        Self::Arc,
        Self::FigureEight,
        Self::Square,
        Self::Steps,
        Self::Ramp,
        Self::Weave,
        Self::Crawl,
    ];

    /// Its name in scenarios and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standstill => "standstill",
            Self::Straight => "straight",
            Self::Turn => "turn",
            Self::TurnSteps => "turn_steps",
            Self::Circle => "circle",
            Self::Arc => "arc",
            Self::FigureEight => "figure_eight",
            Self::Square => "square",
            Self::Steps => "steps",
            Self::Ramp => "ramp",
            Self::Weave => "weave",
            Self::Crawl => "crawl",
        }
    }

    /// Whether a robot has to turn on the spot for it.
    pub const fn on_the_spot(self) -> bool {
        matches!(self, Self::Turn | Self::TurnSteps)
    }
}

impl fmt::Display for ManoeuvreKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Not the name of a manoeuvre.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found:?}, expected one of {}", ManoeuvreKind::ALL.map(ManoeuvreKind::name).join(", "))]
pub struct UnknownManoeuvre {
    /// What was found.
    pub found: String,
}

impl FromStr for ManoeuvreKind {
    type Err = UnknownManoeuvre;

    fn from_str(name: &str) -> Result<Self, UnknownManoeuvre> {
        let known = Self::ALL.into_iter().find(|kind| kind.name() == name);
        known.ok_or_else(|| UnknownManoeuvre { found: name.to_owned() })
    }
}
