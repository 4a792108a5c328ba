//! The state of a map in the making and its algebra: blocks of three, one for the vehicle, one for every landmark,
//! one for every past pose that bearings still wait at.

use nalgebra::DMatrix;

use super::initialize::{Initialized, Matrix2, Matrix2x3};
use crate::Pose2;
use crate::fact::Noise;
use crate::geometry::{Matrix3, Vector2, Vector3};
use crate::joint::{ErrorForm, JointCovariance, Participant, Update, additive_transition};
use crate::measurement::{Linearization, Unusable, noise_matrix, of_point};
use crate::sample::Relative;
use crate::symmetric::Symmetric3;

/// A block of the state: the vehicle, a landmark, or a past pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Block(usize);

/// How a sighting compares with what the state predicts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Normalized innovation squared.
    pub nis: f64,
    /// Logarithm of the determinant of the innovation covariance.
    pub log_determinant: f64,
    /// 1 or 2.
    pub dimension: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Pose,
    Landmark,
    Free,
}

/// Vehicle, landmarks and past poses, with their joint covariance.
#[derive(Clone, Debug)]
pub struct SlamState {
    form: ErrorForm,
    // A landmark is a pose with the heading the vehicle had when it was first seen; only its position is used.
    places: Vec<(Kind, Pose2)>,
    covariance: JointCovariance,
}

impl SlamState {
    /// The block of the vehicle.
    pub const VEHICLE: Block = Block(0);

    /// A vehicle at `pose`, known as well as `noise` says in the body frame, and an empty map.
    pub fn new(form: ErrorForm, pose: Pose2, noise: Symmetric3) -> Self {
        let mut covariance = JointCovariance::default();
        covariance.grow();
        let mut block = noise.congruence(&pose.adjoint());
        if form == ErrorForm::Additive {
            block = block.congruence(&pose.additive_from_invariant());
        }
        covariance.set_diagonal(0, block);
        Self { form, places: vec![(Kind::Pose, pose)], covariance }
    }

    /// In which coordinates the error is Gaussian.
    pub fn form(&self) -> ErrorForm {
        self.form
    }

    /// Where the vehicle is.
    pub fn vehicle(&self) -> Pose2 {
        self.places[0].1
    }

    /// Covariance of the vehicle's position and yaw (additive).
    pub fn vehicle_covariance(&self) -> Symmetric3 {
        let block = Symmetric3::from_lower(&self.covariance.block(0, 0));
        match self.form {
            ErrorForm::Invariant => block.congruence(&self.vehicle().additive_from_invariant()),
            ErrorForm::Additive => block,
        }
    }

    /// A past pose, or a landmark with the heading of its first observer.
    pub fn place(&self, block: Block) -> Pose2 {
        self.places[block.0].1
    }

    /// Covariance of the error of two blocks in the coordinates of the error form.
    pub fn error_covariance(&self, a: Block, b: Block) -> Matrix3 {
        self.covariance.block(a.0, b.0)
    }

    /// Covariance of the positions of two blocks in the map, m^2.
    pub fn position_covariance(&self, a: Block, b: Block) -> Matrix2 {
        self.position_row(a) * self.covariance.block(a.0, b.0) * self.position_row(b).transpose()
    }

    /// Covariance of the positions of some blocks, two rows each, m^2.
    pub fn map_covariance(&self, blocks: &[Block]) -> DMatrix<f64> {
        let mut map = DMatrix::zeros(2 * blocks.len(), 2 * blocks.len());
        for (i, a) in blocks.iter().enumerate() {
            for (j, b) in blocks.iter().enumerate() {
                map.view_mut((2 * i, 2 * j), (2, 2)).copy_from(&self.position_covariance(*a, *b));
            }
        }
        map
    }

    /// `[I, J p]`, or `[I, 0]` in the additive form: from the error of a block to that of its position.
    fn position_row(&self, block: Block) -> Matrix2x3 {
        let p = match self.form {
            ErrorForm::Invariant => self.place(block).position(),
            ErrorForm::Additive => Vector2::zeros(),
        };
        Matrix2x3::new(1.0, 0.0, -p.y, 0.0, 1.0, p.x)
    }

    /// The vehicle moves by `exp(motion)`, body frame, with this process noise in the frame after it.
    pub fn propagate(&mut self, motion: &Vector3, noise: Symmetric3) {
        let last = self.vehicle();
        let pose = last.compose(&Pose2::exp(*motion));
        self.places[0].1 = pose;
        let mut added = noise.congruence(&pose.adjoint());
        if self.form == ErrorForm::Additive {
            self.covariance.transform(0, &additive_transition(&last, &pose));
            added = added.congruence(&pose.additive_from_invariant());
        }
        self.covariance.add_diagonal(0, added);
    }

    /// Keeps the vehicle's present pose in the state, fully correlated with it.
    pub fn keep_pose(&mut self) -> Block {
        let block = self.take(Kind::Pose, self.vehicle());
        for other in self.others(block) {
            let cross = self.covariance.block(0, other);
            self.covariance.set_cross(block.0, other, &cross);
        }
        let own = Symmetric3::from_lower(&self.covariance.block(0, 0));
        self.covariance.set_diagonal(block.0, own);
        block
    }

    /// Leaves a landmark or a past pose out of the state. What the others know stays (marginalization).
    pub fn remove(&mut self, block: Block) {
        if block != Self::VEHICLE {
            self.places[block.0].0 = Kind::Free;
            self.covariance.clear(block.0);
        }
    }

    /// A landmark that is known beforehand, without error.
    pub fn insert_known(&mut self, point: Vector2) -> Block {
        self.take(Kind::Landmark, Pose2::new(point.x, point.y, 0.0))
    }

    /// A new landmark, seen from `observers` (the same twice if from one place).
    ///
    /// Its heading, which nothing measures, is that of the first observer: `xi_L = sum_k F_k xi_k + n`, with
    /// `F_k = [T_k; 0]` less `[J p; -1]` in the heading's column of the first.
    pub fn insert(&mut self, landmark: &Initialized, observers: [Block; 2]) -> Block {
        let p = landmark.point;
        let mut factors = [Matrix3::zeros(); 2];
        for (k, factor) in factors.iter_mut().enumerate() {
            let t = &landmark.d_point_d_observer[k];
            factor.fixed_view_mut::<2, 3>(0, 0).copy_from(t);
            if k == 0 && self.form == ErrorForm::Invariant {
                factor[(0, 2)] += p.y;
                factor[(1, 2)] -= p.x;
                factor[(2, 2)] += 1.0;
            }
            if self.form == ErrorForm::Additive {
                *factor *= self.place(observers[k]).invariant_from_additive();
            }
        }
        let heading = self.place(observers[0]).yaw_rad();
        let block = self.take(Kind::Landmark, Pose2::new(p.x, p.y, heading));
        for other in self.others(block) {
            let mut cross = Matrix3::zeros();
            for (factor, observer) in factors.iter().zip(observers) {
                cross += factor * self.covariance.block(observer.0, other);
            }
            self.covariance.set_cross(block.0, other, &cross);
        }
        let mut own = Matrix3::zeros();
        own.fixed_view_mut::<2, 2>(0, 0).copy_from(&landmark.covariance);
        for (factor, observer) in factors.iter().zip(observers) {
            own += self.covariance.block(block.0, observer.0) * factor.transpose();
        }
        self.covariance.set_diagonal(block.0, Symmetric3::from_lower(&own));
        block
    }

    /// The blocks in use but for this one.
    fn others(&self, block: Block) -> Vec<usize> {
        let used = |index: &usize| *index != block.0 && self.places[*index].0 != Kind::Free;
        (0..self.places.len()).filter(used).collect()
    }

    fn take(&mut self, kind: Kind, place: Pose2) -> Block {
        if let Some(index) = self.places.iter().position(|(kind, _)| *kind == Kind::Free) {
            self.places[index] = (kind, place);
            return Block(index);
        }
        self.places.push((kind, place));
        self.covariance.grow();
        Block(self.places.len() - 1)
    }

    fn linearize(
        &self,
        observer: Block,
        landmark: Block,
        relative: &Relative,
    ) -> Result<(Linearization, [Participant; 2]), Unusable> {
        let from = self.place(observer);
        let linear = of_point(relative, &from, self.place(landmark).position())?;
        let (mut by_observer, mut by_landmark) = (-linear.jacobian, linear.jacobian);
        if self.form == ErrorForm::Additive {
            by_observer *= from.invariant_from_additive();
            by_landmark.set_column(2, &Vector3::zeros());
        }
        let participants = [
            Participant { index: observer.0, jacobian: by_observer },
            Participant { index: landmark.0, jacobian: by_landmark },
        ];
        Ok((linear, participants))
    }

    /// How a sighting of a landmark from a pose compares with the prediction; in constant time.
    ///
    /// # Errors
    /// [`Unusable`] if it has no linearization, or an innovation covariance that is not positive definite.
    pub fn innovation(
        &self,
        observer: Block,
        landmark: Block,
        relative: &Relative,
        noise: &Noise,
    ) -> Result<Innovation, Unusable> {
        let (linear, participants) = self.linearize(observer, landmark, relative)?;
        let mut s = noise_matrix(noise);
        for a in &participants {
            for b in &participants {
                s += a.jacobian * self.covariance.block(a.index, b.index) * b.jacobian.transpose();
            }
        }
        let r = linear.innovation;
        let (nis, determinant) = if linear.dimension == 1 {
            (r.x * r.x / s[(0, 0)], s[(0, 0)])
        } else {
            let determinant = s[(0, 0)] * s[(1, 1)] - s[(1, 0)] * s[(1, 0)];
            let weighted = s[(1, 1)] * r.x * r.x - 2.0 * s[(1, 0)] * r.x * r.y + s[(0, 0)] * r.y * r.y;
            (weighted / determinant, determinant)
        };
        if determinant > 0.0 && nis.is_finite() {
            let log_determinant = libm::log(determinant);
            Ok(Innovation { nis, log_determinant, dimension: linear.dimension })
        } else {
            Err(Unusable::TooClose { distance_m: 0.0 })
        }
    }

    /// Updates everything with a sighting of a landmark from a pose, if it passes the gate.
    ///
    /// # Errors
    /// [`Unusable`] if it has no linearization.
    pub fn update(
        &mut self,
        observer: Block,
        landmark: Block,
        relative: &Relative,
        noise: &Noise,
        gate: &[f64; 3],
    ) -> Result<Update, Unusable> {
        let (linear, participants) = self.linearize(observer, landmark, relative)?;
        let noise = noise_matrix(noise);
        let prepared = self.covariance.prepare(linear.dimension, &linear.innovation, &noise, &participants);
        let Some(prepared) = prepared else { return Ok(Update::Indefinite) };
        let (nis, threshold) = (prepared.nis(), gate[linear.dimension - 1]);
        if nis > threshold {
            return Ok(Update::Rejected { nis, threshold, weight: 1.0 });
        }
        self.covariance.downdate(&prepared);
        for (index, (kind, place)) in self.places.iter_mut().enumerate() {
            if *kind == Kind::Free {
                continue;
            }
            let delta = prepared.correction(index);
            *place = match self.form {
                ErrorForm::Invariant => Pose2::exp(delta).compose(place),
                ErrorForm::Additive => {
                    Pose2::new(place.x_m() + delta.x, place.y_m() + delta.y, place.yaw_rad() + delta.z)
                }
            };
        }
        Ok(Update::Used { nis, weight: 1.0 })
    }
}
