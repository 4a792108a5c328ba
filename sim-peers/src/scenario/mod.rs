//! A scenario: who takes part, how they move, what they sense and how well. The file format is TOML;
//! every key is described in `docs/scenario.md`.

mod declared;
mod drive;
mod keys;
mod load;
mod manoeuvre;
mod settings;
mod validate;

use std::collections::BTreeMap;

use pleiad_bus::FaultPlan;
use pleiad_estimation::{LandmarkId, RobotId};
use serde::{Deserialize, Serialize};

pub use declared::Declared;
pub use drive::{DriveKind, DriveSettings};
pub use manoeuvre::{ManoeuvreKind, UnknownManoeuvre};
pub use settings::{
    Direction, Gps, Gyro, Heading, Kidnap, LastingSlip, Motion, MotionNoise, Odometry, OdometryKind, Policy,
    PriorSettings, RangeScan, RelativeKind, RelativeSensor, RobotSettings, See, Start,
};

/// A simulation to run: complete, with the defaults already applied to every robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name, for people; the name of the recording.
    pub name: String,
    /// The seed used where none is asked for.
    pub seed: u64,
    /// Length of the run, seconds.
    pub duration_s: f64,
    /// Where it takes place.
    pub arena: Arena,
    /// Rate of the ground truth in the recording, Hz.
    pub truth_rate_hz: f64,
    /// Noise of the ground truth per axis, metres.
    pub truth_sigma_m: f64,
    /// Noise of the heading of the ground truth, radians.
    pub truth_sigma_rad: f64,
    /// Landmarks at given places, metres.
    pub landmarks: BTreeMap<LandmarkId, [f64; 2]>,
    /// Walls that range scans meet: segments `[x0, y0, x1, y1]`, metres. They do not stop robots.
    pub walls_m: Vec<[f64; 4]>,
    /// What given landmarks look like: those of one kind look alike. It is in no recording, which names landmarks.
    pub landmark_kinds: BTreeMap<LandmarkId, u32>,
    /// Further landmarks at random places, numbered on from the largest given one.
    pub random_landmarks: u32,
    /// The team.
    pub robots: BTreeMap<RobotId, RobotSettings>,
    /// What goes wrong with messages and clocks, where a run has a network: `[[fault]]`.
    pub faults: FaultPlan,
}

/// The rectangle the robots move in, centred on the origin of the map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Arena {
    /// Extent along x, metres.
    pub width_m: f64,
    /// Extent along y, metres.
    pub height_m: f64,
}

impl Default for Arena {
    fn default() -> Self {
        Self { width_m: 20.0, height_m: 20.0 }
    }
}

impl Arena {
    /// `[x_min, x_max, y_min, y_max]`, metres.
    pub fn bounds_m(&self) -> [f64; 4] {
        let (half_width, half_height) = (0.5 * self.width_m, 0.5 * self.height_m);
        [-half_width, half_width, -half_height, half_height]
    }
}
