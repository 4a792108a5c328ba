//! The plane as one of the spaces: the models of [`crate::measurement`].

use super::{Linearization, Measured, Space, Unusable};
use crate::Pose2;
use crate::fact::Absolute;
use crate::geometry::Vector2;
use crate::measurement;
use crate::sample::Relative;

impl Measured for Relative {
    fn dimension(&self) -> usize {
        measurement::dimension(self)
    }

    fn kind(&self) -> u64 {
        match self {
            Self::Pose(_) => 0,
            Self::Position { .. } => 1,
            Self::Range { .. } => 2,
            Self::Bearing { .. } => 3,
            Self::RangeBearing { .. } => 4,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let numbers = match *self {
            Self::Pose(pose) => vec![pose.x_m(), pose.y_m(), pose.yaw_rad()],
            Self::Position { x_m, y_m } => vec![x_m, y_m],
            Self::Range { range_m } => vec![range_m],
            Self::Bearing { bearing_rad } => vec![bearing_rad],
            Self::RangeBearing { range_m, bearing_rad } => vec![range_m, bearing_rad],
        };
        numbers.into_iter()
    }
}

impl Measured for Absolute {
    fn dimension(&self) -> usize {
        measurement::absolute_dimension(self)
    }

    fn kind(&self) -> u64 {
        match self {
            Self::Pose(_) => 0,
            Self::Position(_) => 1,
            Self::Heading(_) => 2,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let numbers = match *self {
            Self::Pose(pose) => vec![pose.x_m(), pose.y_m(), pose.yaw_rad()],
            Self::Position([x, y]) => vec![x, y],
            Self::Heading(heading) => vec![heading],
        };
        numbers.into_iter()
    }
}

impl Space<3> for Pose2 {
    type Point = Vector2;
    type Relative = Relative;
    type Absolute = Absolute;

    fn of_robot(relative: &Relative, observer: &Self, target: &Self) -> Result<Linearization<3>, Unusable> {
        measurement::of_robot(relative, observer, target).map(Into::into).map_err(Into::into)
    }

    fn of_point(relative: &Relative, observer: &Self, point: &Vector2) -> Result<Linearization<3>, Unusable> {
        measurement::of_point(relative, observer, *point).map(Into::into).map_err(Into::into)
    }

    fn of_map(absolute: &Absolute, robot: &Self) -> Linearization<3> {
        measurement::of_map(absolute, robot).into()
    }

    fn prior(absolute: &Absolute) -> Option<Self> {
        match absolute {
            Absolute::Pose(pose) => Some(*pose),
            Absolute::Position(_) | Absolute::Heading(_) => None,
        }
    }

    fn coordinates(point: &Vector2) -> impl Iterator<Item = f64> {
        [point.x, point.y].into_iter()
    }
}

impl From<measurement::Linearization> for Linearization<3> {
    fn from(planar: measurement::Linearization) -> Self {
        Self { dimension: planar.dimension, innovation: planar.innovation, jacobian: planar.jacobian }
    }
}

impl From<measurement::Unusable> for Unusable {
    fn from(planar: measurement::Unusable) -> Self {
        match planar {
            measurement::Unusable::TooClose { distance_m } => Self::TooClose { distance_m },
            measurement::Unusable::PointHasNoHeading => Self::PointHasNoOrientation,
        }
    }
}
