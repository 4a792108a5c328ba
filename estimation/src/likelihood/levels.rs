//! Noise levels by name.

use std::ops::{Index, IndexMut};

use super::UnitSums;
use crate::fact::{Absolute, Noise, Quantity};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;

/// A noise level: a standard deviation, or one per root of time, distance or angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Forward noise of the odometry, m per root second.
    Forward,
    /// Sideways, m per root second.
    Lateral,
    /// Yaw, rad per root second.
    Yaw,
    /// Forward, m per root metre.
    ForwardPerMetre,
    /// Yaw, rad per root metre.
    YawPerMetre,
    /// Yaw, rad per root radian.
    YawPerRadian,
    /// Full relative pose: position, m.
    PosePosition,
    /// Full relative pose: yaw, rad.
    PoseYaw,
    /// Relative position, m.
    Position,
    /// Range alone, m.
    Range,
    /// Range alone, what grows with the distance, m per m.
    RangePerMetre,
    /// Bearing alone, rad.
    Bearing,
    /// Range and bearing: range, m.
    PolarRange,
    /// Range and bearing: what of the range's grows with the distance, m per m.
    PolarRangePerMetre,
    /// Range and bearing: bearing, rad.
    PolarBearing,
    /// Position fix, m.
    Gps,
    /// Heading, rad.
    Heading,
}

impl Level {
    /// How many levels there are.
    pub const COUNT: usize = 17;
    /// How many of them are of the motion; they come first.
    pub const MOTION: usize = 6;

    /// All of them, those of the motion first.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Forward,
        Self::Lateral,
        Self::Yaw,
        Self::ForwardPerMetre,
        Self::YawPerMetre,
        Self::YawPerRadian,
        Self::PosePosition,
        Self::PoseYaw,
        Self::Position,
        Self::Range,
        Self::RangePerMetre,
        Self::Bearing,
        Self::PolarRange,
        Self::PolarRangePerMetre,
        Self::PolarBearing,
        Self::Gps,
        Self::Heading,
    ];

    /// Whether it is of the motion.
    pub fn is_motion(self) -> bool {
        (self as usize) < Self::MOTION
    }

    /// The level beside which it grows with distance or angle, if it does: that one is never left out.
    pub fn grows_beside(self) -> Option<Self> {
        match self {
            Self::ForwardPerMetre => Some(Self::Forward),
            Self::YawPerMetre | Self::YawPerRadian => Some(Self::Yaw),
            Self::RangePerMetre => Some(Self::Range),
            Self::PolarRangePerMetre => Some(Self::PolarRange),
            _ => None,
        }
    }

    /// The levels that the noise of a measurement is made of; none for a pose in the map, which states its own.
    pub fn of(quantity: &Quantity) -> &'static [Self] {
        match quantity {
            Quantity::Robot { relative, .. }
            | Quantity::Landmark { relative, .. }
            | Quantity::Feature { relative, .. } => match relative {
                Relative::Pose(_) => &[Self::PosePosition, Self::PoseYaw],
                Relative::Position { .. } => &[Self::Position],
                Relative::Range { .. } => &[Self::Range, Self::RangePerMetre],
                Relative::Bearing { .. } => &[Self::Bearing],
                Relative::RangeBearing { .. } => {
                    &[Self::PolarRange, Self::PolarRangePerMetre, Self::PolarBearing]
                }
            },
            Quantity::Absolute(Absolute::Pose(_)) => &[],
            Quantity::Absolute(Absolute::Position(_)) => &[Self::Gps],
            Quantity::Absolute(Absolute::Heading(_)) => &[Self::Heading],
        }
    }
}

/// A value for every level; zero where there is no such noise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels([f64; Level::COUNT]);

impl Index<Level> for Levels {
    type Output = f64;

    fn index(&self, level: Level) -> &f64 {
        &self.0[level as usize]
    }
}

impl IndexMut<Level> for Levels {
    fn index_mut(&mut self, level: Level) -> &mut f64 {
        &mut self.0[level as usize]
    }
}

impl Levels {
    /// The same with four significant digits, which is more than data determine.
    #[must_use]
    pub fn rounded(&self) -> Self {
        Self(self.0.map(|level| {
            if level <= 0.0 {
                return level;
            }
            let scale = libm::pow(10.0, 3.0 - libm::floor(libm::log10(level)));
            libm::round(level * scale) / scale
        }))
    }

    /// The noise of a measurement; `None` for a pose in the map, which states its own.
    pub fn noise(&self, quantity: &Quantity) -> Option<Noise> {
        let sigma = |level: Level| self[level];
        let far = |near: Level, per_metre: Level, range_m: f64| {
            let (near, far) = (self[near], self[per_metre] * range_m);
            (near * near + far * far).sqrt()
        };
        let sigmas = match quantity {
            Quantity::Robot { relative, .. }
            | Quantity::Landmark { relative, .. }
            | Quantity::Feature { relative, .. } => match *relative {
                Relative::Pose(_) => {
                    let position = sigma(Level::PosePosition);
                    vec![position, position, sigma(Level::PoseYaw)]
                }
                Relative::Position { .. } => vec![sigma(Level::Position); 2],
                Relative::Range { range_m } => vec![far(Level::Range, Level::RangePerMetre, range_m)],
                Relative::Bearing { .. } => vec![sigma(Level::Bearing)],
                Relative::RangeBearing { range_m, .. } => {
                    let range = far(Level::PolarRange, Level::PolarRangePerMetre, range_m);
                    vec![range, sigma(Level::PolarBearing)]
                }
            },
            Quantity::Absolute(Absolute::Pose(_)) => return None,
            Quantity::Absolute(Absolute::Position(_)) => vec![sigma(Level::Gps); 2],
            Quantity::Absolute(Absolute::Heading(_)) => vec![sigma(Level::Heading)],
        };
        Some(Noise::from_sigmas(&sigmas))
    }

    /// The process noise accumulated, from what each level would contribute were it 1.
    pub fn noise_sum(&self, unit: &UnitSums) -> Symmetric3 {
        let mut sum = Symmetric3::zero();
        for (level, unit) in self.0.iter().zip(unit) {
            if *level != 0.0 {
                sum = sum.plus(unit.scaled(level * level));
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_where_their_order_says() {
        for (index, level) in Level::ALL.into_iter().enumerate() {
            assert_eq!(level as usize, index, "{level:?}");
        }
        assert!(Level::YawPerRadian.is_motion() && !Level::PosePosition.is_motion());
    }

    #[test]
    fn the_variance_of_a_range_is_the_sum_of_both() {
        let mut levels = Levels::default();
        (levels[Level::PolarRange], levels[Level::PolarRangePerMetre]) = (0.3, 0.1);
        levels[Level::PolarBearing] = 0.02;
        let relative = Relative::RangeBearing { range_m: 4.0, bearing_rad: 1.0 };
        let noise = levels.noise(&Quantity::Robot { robot: crate::RobotId(2), relative }).unwrap();
        // 0.3^2 + (0.1 * 4)^2 = 0.25.
        assert!((noise.lower[0] - 0.25).abs() < 1e-15 && (noise.lower[2] - 4e-4).abs() < 1e-15);
    }
}
