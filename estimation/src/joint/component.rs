//! Robots without a common frame: each group that has one is a component, and what is seen across two components ties them.

use super::{Block, Joint};
use crate::geometry::{Matrix3, Vector3};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;
use crate::{Pose2, RobotId, Timestamp};

/// A frame that robots and landmarks have in common.
///
/// Named by the boot of the robot that began it; of two that join, the smaller one stays, and the map is the smallest of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Component {
    since: Timestamp,
    robot: RobotId,
}

impl Component {
    /// The map.
    pub const MAP: Self = Self { since: Timestamp::MIN, robot: RobotId(0) };

    /// The frame that a robot begins with a boot.
    pub fn new(since: Timestamp, robot: RobotId) -> Self {
        Self { since, robot }
    }

    /// When it began, and by whom.
    pub fn origin(self) -> (Timestamp, RobotId) {
        (self.since, self.robot)
    }
}

/// Where a robot or a landmark was when it was part of a tie: a copy that never moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Pose in its component.
    pub pose: Pose2,
    /// Of which component.
    pub component: Component,
}

/// One end of a tie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The frame of the map itself.
    Map,
    /// A point whose place in the map is known, m.
    Point([f64; 2]),
    /// The anchor in a block.
    Anchor(usize),
}

/// What was measured across two components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The second end as seen from the first.
    Relative(Relative),
    /// The heading of the second end in the map, rad.
    Heading(f64),
}

/// A measurement across two components, which says something about how they lie to one another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// When.
    pub time: Timestamp,
    /// Who saw, and what was seen.
    pub ends: [End; 2],
    /// What was measured.
    pub measured: Measured,
    /// Covariance of that, `[r00, r10, r11, r20, r21, r22]`.
    pub noise: Symmetric3,
}

impl Tie {
    /// The bits of it, for comparing two estimates.
    pub(super) fn words(&self) -> Vec<u64> {
        let mut words = vec![self.time.0.cast_unsigned()];
        for end in &self.ends {
            match end {
                End::Map => words.push(0),
                End::Point(place) => words.extend([1, place[0].to_bits(), place[1].to_bits()]),
                End::Anchor(index) => words.extend([2, *index as u64]),
            }
        }
        let numbers: Vec<f64> = match self.measured {
            Measured::Heading(heading) => vec![heading],
            Measured::Relative(Relative::Pose(pose)) => vec![pose.x_m(), pose.y_m(), pose.yaw_rad()],
            Measured::Relative(Relative::Position { x_m, y_m }) => vec![x_m, y_m],
            Measured::Relative(Relative::Range { range_m }) => vec![range_m],
            Measured::Relative(Relative::Bearing { bearing_rad }) => vec![bearing_rad],
            Measured::Relative(Relative::RangeBearing { range_m, bearing_rad }) => {
                vec![range_m, bearing_rad]
            }
        };
        words.extend(numbers.into_iter().chain(self.noise.0).map(f64::to_bits));
        words
    }
}

/// How a component comes to lie in another: what [`Joint::join`] needs of a solution.
pub(crate) struct Placement {
    /// `stays_from_moves`.
    pub transform: Pose2,
    /// Covariance of its error.
    pub spread: Matrix3,
    /// `V = P Hx^T L^-T` by columns, with `W = Hx P Hx^T + R = L L^T`.
    pub columns: Vec<Vec<f64>>,
    /// `Q = L^-1 Ht`, a row for every column of `V`.
    pub through: Vec<Vector3>,
    /// `L^-1 r` at the solution.
    pub whitened: Vec<f64>,
    /// Numbers of the ties that were used.
    pub used: Vec<usize>,
}

impl Joint {
    /// Component of a block; parameters and what is free have none.
    pub fn component(&self, index: usize) -> Option<Component> {
        match &self.blocks[index] {
            Block::Robot(member) => member.placed.then_some(member.component),
            Block::Landmark(mapped) => Some(mapped.component),
            Block::Anchor(anchor) => Some(anchor.component),
            Block::Parameters(_) | Block::Free => None,
        }
    }

    /// Whether a robot has a place in the map.
    pub fn is_in_map(&self, robot: RobotId) -> bool {
        self.member(robot).is_some_and(|member| member.component == Component::MAP)
    }

    /// What was measured across components that do not lie in one frame yet.
    pub fn ties(&self) -> &[Tie] {
        &self.ties
    }

    /// Component of an end of a tie.
    pub(crate) fn component_of(&self, end: &End) -> Component {
        match end {
            End::Map | End::Point(_) => Component::MAP,
            End::Anchor(index) => self.component(*index).unwrap_or(Component::MAP),
        }
    }

    /// Keeps where the robot or landmark in a block is now.
    pub(crate) fn anchor(&mut self, index: usize, pose: Pose2) -> End {
        let component = self.component(index).unwrap_or(Component::MAP);
        let at = self.add(&Block::Anchor(Anchor { pose, component }));
        self.covariance.couple(at, index, &Matrix3::identity());
        End::Anchor(at)
    }

    pub(crate) fn tie(&mut self, tie: Tie) {
        self.ties.push(tie);
    }

    /// Drops a tie with its anchors.
    pub(crate) fn untie(&mut self, number: usize) {
        let tie = self.ties.remove(number);
        for end in &tie.ends {
            if let End::Anchor(index) = end {
                self.blocks[*index] = Block::Free;
                self.covariance.clear(*index);
            }
        }
    }

    /// Drops the ties of components that no robot is in any more.
    pub(crate) fn untie_the_lost(&mut self) {
        let inhabited: Vec<Component> = self.members().map(|member| member.component).collect();
        for number in (0..self.ties.len()).rev() {
            let ends = self.ties[number].ends;
            let lost = |end: &End| {
                let component = self.component_of(end);
                component != Component::MAP && !inhabited.contains(&component)
            };
            if ends.iter().any(lost) {
                self.untie(number);
            }
        }
    }

    /// Brings one component into the frame of another, with the covariance of that
    /// (`docs/theory.md`, unknown start): `xi_j <- tau + Ad_T xi_j`.
    pub(crate) fn join(&mut self, stays: Component, moves: Component, placement: &Placement) {
        let Placement { transform, spread, columns, through, whitened, used } = placement;
        let size = self.covariance.size();
        // K r with tau zero at the solution, and U = K Ht.
        let mut mean = vec![0.0; size];
        let mut by_transform = vec![Vector3::zeros(); size];
        for ((column, q), r) in columns.iter().zip(through).zip(whitened) {
            for (row, v) in column.iter().enumerate() {
                mean[row] += v * r;
                by_transform[row] += q * *v;
            }
        }
        self.covariance.downdate_by(columns);
        let cross: Vec<Vector3> = by_transform.iter().map(|u| -(spread * u)).collect();
        self.covariance.add_through(&by_transform, spread);
        for index in 0..self.blocks.len() {
            let delta = Vector3::new(mean[3 * index], mean[3 * index + 1], mean[3 * index + 2]);
            self.correct(index, delta);
        }
        let moved: Vec<bool> =
            (0..self.blocks.len()).map(|index| self.component(index) == Some(moves)).collect();
        self.covariance.move_blocks(&moved, &transform.adjoint(), spread, &cross);
        for (index, moved) in moved.into_iter().enumerate() {
            if moved {
                let frame = transform.compose(self.frame(index));
                self.set_frame(index, frame);
                match &mut self.blocks[index] {
                    Block::Robot(member) => member.component = stays,
                    Block::Landmark(mapped) => mapped.component = stays,
                    Block::Anchor(anchor) => anchor.component = stays,
                    Block::Parameters(_) | Block::Free => {}
                }
            }
        }
        for number in (0..self.ties.len()).rev() {
            if used.contains(&number) {
                self.untie(number);
            }
        }
        self.updates += used.len() as u64;
    }
}
