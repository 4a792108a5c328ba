//! The map: landmarks, and what each of them looks like.

use crate::LandmarkId;
use crate::geometry::Vector2;

/// What a landmark looks like, by number from 0: landmarks of one kind look alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct KindOfLandmark(pub usize);

/// A landmark of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedLandmark {
    /// Its number in the map.
    pub id: LandmarkId,
    /// What it looks like.
    pub kind: KindOfLandmark,
    /// Its place in the map, metres.
    pub position_m: Vector2,
}

/// A known map.
#[derive(Clone, Debug, PartialEq)]
pub struct KindedMap {
    /// The landmarks.
    pub landmarks: Vec<MappedLandmark>,
    /// Where the robot can be: `[x_min, x_max, y_min, y_max]`, metres.
    pub bounds_m: [f64; 4],
}

impl KindedMap {
    /// Area in which the robot can be, m^2.
    pub fn area_m2(&self) -> f64 {
        let [left, right, bottom, top] = self.bounds_m;
        (right - left) * (top - bottom)
    }

    /// Whether a robot can be at a place.
    pub fn contains(&self, position_m: Vector2) -> bool {
        let [left, right, bottom, top] = self.bounds_m;
        (left..=right).contains(&position_m.x) && (bottom..=top).contains(&position_m.y)
    }
}
