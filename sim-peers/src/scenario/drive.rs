//! How the wheels of a robot make it move.

use pleiad_physics::Drive;
use serde::{Deserialize, Serialize};

/// A drive; each kind reads its own keys.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveSettings {
    /// Which.
    pub kind: DriveKind,
    /// Effective over geometric track of a skid-steered robot.
    pub track_ratio: f64,
    /// Distance between the axles of a car, metres.
    pub wheelbase_m: f64,
    /// Largest steering angle of a car, radians.
    pub max_steer_rad: f64,
    /// Whether a car steers its rear axle; its driven wheels are then in front.
    pub rear_steering: bool,
    /// Noise of a recorded steering angle, radians.
    pub steer_sigma_rad: f64,
}

impl Default for DriveSettings {
    fn default() -> Self {
        Self {
            kind: DriveKind::Differential,
            track_ratio: 1.6,
            wheelbase_m: 0.4,
            max_steer_rad: 0.6,
            rear_steering: false,
            steer_sigma_rad: 0.0,
        }
    }
}

/// Kinds of drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveKind {
    /// Two driven wheels.
    Differential,
    /// Wheels that skid in turns: a differential drive of a wider effective track.
    SkidSteer,
    /// Two driven wheels behind and steered ones in front, or the other way round.
    CarLike,
}

impl DriveSettings {
    /// As the signal chain has it.
    pub fn drive(&self) -> Drive {
        match self.kind {
            DriveKind::Differential => Drive::Differential,
            DriveKind::SkidSteer => Drive::SkidSteer { track_ratio: self.track_ratio },
            DriveKind::CarLike => Drive::CarLike { wheelbase_m: self.steered_ahead_m() },
        }
    }

    /// How far the steered axle of a car is ahead of the driven one, metres: negative for rear steering.
    pub fn steered_ahead_m(&self) -> f64 {
        if self.rear_steering { -self.wheelbase_m } else { self.wheelbase_m }
    }

    /// The track width that wheels turn the body about, where the geometric one is `track_width_m`.
    pub fn effective_track_m(&self, track_width_m: f64) -> f64 {
        match self.kind {
            DriveKind::SkidSteer => track_width_m * self.track_ratio,
            DriveKind::Differential | DriveKind::CarLike => track_width_m,
        }
    }
}
