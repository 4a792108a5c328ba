//! The textbook joint filter in space: every robot is stepped at every tick, poses are 4 x 4 matrices, derivatives are
//! central differences, the covariance is dense and updated in the Joseph form.
//!
//! Nothing of [`crate::geometry::Pose3`], of its measurement models or of the fold is used.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3, Vector6};

use crate::RobotId;

/// `map_from_robot` as a homogeneous matrix.
pub type Matrix = Matrix4<f64>;

/// What is measured, in the frame of the observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen {
    /// A pose, with noise on its right.
    Pose(Matrix),
    /// A position, metres.
    Position(Vector3<f64>),
    /// A distance, metres.
    Range(f64),
    /// A unit vector, with noise that is the same in all directions.
    Bearing(Vector3<f64>),
    /// A distance and a unit vector.
    RangeBearing(f64, Vector3<f64>),
}

/// Of what it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Another robot.
    Robot(RobotId),
    /// A place in the map, metres.
    Point(Vector3<f64>),
    /// The observer itself, seen from the map.
    Map,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct SpatialEkf {
    poses: BTreeMap<RobotId, Matrix>,
    covariance: DMatrix<f64>,
}

/// Step of the central differences; the error of a derivative is some 1e-10.
const STEP: f64 = 1e-5;

impl SpatialEkf {
    /// A team at these poses, each known with a covariance in its body frame.
    pub fn new(priors: &BTreeMap<RobotId, (Matrix, DMatrix<f64>)>) -> Self {
        let poses = priors.iter().map(|(robot, (pose, _))| (*robot, *pose)).collect();
        let mut covariance = DMatrix::zeros(6 * priors.len(), 6 * priors.len());
        for (index, (pose, noise)) in priors.values().enumerate() {
            let a = error_from_body(pose);
            covariance.view_mut((6 * index, 6 * index), (6, 6)).copy_from(&(&a * noise * a.transpose()));
        }
        Self { poses, covariance }
    }

    /// The estimate of a robot.
    pub fn pose(&self, robot: RobotId) -> Option<&Matrix> {
        self.poses.get(&robot)
    }

    /// Covariance of the right-invariant errors, robots ascending.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// `X <- X exp(u) exp(w)`, `w` of this covariance.
    pub fn step(&mut self, robot: RobotId, motion: &Vector6<f64>, noise: &DMatrix<f64>) {
        let Some(index) = self.poses.keys().position(|other| *other == robot) else { return };
        let Some(pose) = self.poses.get_mut(&robot) else { return };
        *pose *= exp(motion);
        let a = error_from_body(pose);
        let mut block = self.covariance.view_mut((6 * index, 6 * index), (6, 6));
        block += &a * noise * a.transpose();
    }

    /// Uses a measurement of this covariance; its NIS, or `None` if a participant is unknown or the covariance of the
    /// innovation is not positive definite.
    pub fn observe(
        &mut self,
        observer: RobotId,
        target: &Target,
        seen: &Seen,
        noise: &DMatrix<f64>,
    ) -> Option<f64> {
        let order: Vec<RobotId> = self.poses.keys().copied().collect();
        let innovation = self.innovation(observer, target, seen)?;
        let mut h = DMatrix::zeros(innovation.len(), 6 * order.len());
        for (index, robot) in order.iter().enumerate() {
            if *robot != observer && *target != Target::Robot(*robot) {
                continue;
            }
            let pose = *self.poses.get(robot)?;
            for axis in 0..6 {
                let mut at = |by: f64| {
                    let mut error = Vector6::zeros();
                    error[axis] = by;
                    self.poses.insert(*robot, exp(&error) * pose);
                    self.innovation(observer, target, seen)
                };
                // The innovation falls by what the prediction grows.
                let column = (at(-STEP)? - at(STEP)?) / (2.0 * STEP);
                h.set_column(6 * index + axis, &column);
            }
            self.poses.insert(*robot, pose);
        }
        let s = &h * &self.covariance * h.transpose() + noise;
        let factor = s.cholesky()?;
        let gain = factor.solve(&(&h * &self.covariance)).transpose();
        let correction = &gain * &innovation;
        for (index, pose) in self.poses.values_mut().enumerate() {
            *pose = exp(&correction.fixed_rows::<6>(6 * index).into_owned()) * *pose;
        }
        let keep = DMatrix::identity(h.ncols(), h.ncols()) - &gain * &h;
        self.covariance = &keep * &self.covariance * keep.transpose() + &gain * noise * gain.transpose();
        Some(innovation.dot(&factor.solve(&innovation)))
    }

    /// Measured minus predicted, with the differences of poses and directions as the shortest way between them.
    fn innovation(&self, observer: RobotId, target: &Target, seen: &Seen) -> Option<DVector<f64>> {
        let own = self.poses.get(&observer)?;
        let other = match target {
            Target::Robot(robot) => inverse(own) * self.poses.get(robot)?,
            Target::Point(point) => inverse(own) * Matrix::new_translation(point),
            Target::Map => *own,
        };
        let place: Vector3<f64> = other.fixed_view::<3, 1>(0, 3).into_owned();
        let distance = place.norm();
        Some(match seen {
            Seen::Pose(z) => DVector::from_column_slice(log(&(inverse(&other) * z)).as_slice()),
            Seen::Position(z) => DVector::from_column_slice((z - place).as_slice()),
            Seen::Range(range) => DVector::from_element(1, range - distance),
            Seen::Bearing(z) => DVector::from_row_slice(&turn(z, &place)),
            Seen::RangeBearing(range, z) => {
                let [a, b] = turn(z, &place);
                DVector::from_row_slice(&[range - distance, a, b])
            }
        })
    }
}

/// From the direction of `place` to the unit vector `z`, in two angles across `z`: the rotation that takes one to the other.
fn turn(z: &Vector3<f64>, place: &Vector3<f64>) -> [f64; 2] {
    // Any two axes across z will do: by Gram and Schmidt from the axis that z is farthest from.
    let mut axis = Vector3::zeros();
    axis[z.iamin()] = 1.0;
    let first = (axis - z * z.dot(&axis)).normalize();
    let second = z.cross(&first);
    let rotation = Rotation3::rotation_between(place, z).map_or_else(Vector3::zeros, |rotation| {
        UnitQuaternion::from_rotation_matrix(&rotation).scaled_axis()
    });
    // What turns about z x f moves along f.
    [rotation.dot(&second), -rotation.dot(&first)]
}

/// What takes a small motion in the body frame to the error in the map: derivative of `log(X exp(w) X^-1)`.
fn error_from_body(pose: &Matrix) -> DMatrix<f64> {
    let mut a = DMatrix::zeros(6, 6);
    let back = inverse(pose);
    for axis in 0..6 {
        let mut w = Vector6::zeros();
        w[axis] = STEP;
        let column = (log(&(pose * exp(&w) * back)) - log(&(pose * exp(&-w) * back))) / (2.0 * STEP);
        a.set_column(axis, &DVector::from_column_slice(column.as_slice()));
    }
    a
}

/// The exponential of the 4 x 4 matrix of a tangent `(x, y, z, rx, ry, rz)`.
pub fn exp(tangent: &Vector6<f64>) -> Matrix {
    let mut hat = Matrix::zeros();
    hat.fixed_view_mut::<3, 3>(0, 0).copy_from(&tangent.fixed_rows::<3>(3).into_owned().cross_matrix());
    hat.fixed_view_mut::<3, 1>(0, 3).copy_from(&tangent.fixed_rows::<3>(0));
    hat.exp()
}

/// The tangent of a pose: the rotation by its quaternion, the translation by the series of the mean rotation along the way.
pub fn log(pose: &Matrix) -> Vector6<f64> {
    let rotation = Rotation3::from_matrix_unchecked(pose.fixed_view::<3, 3>(0, 0).into_owned());
    let turn = UnitQuaternion::from_rotation_matrix(&rotation).scaled_axis();
    let hat = turn.cross_matrix();
    let (mut mean, mut term) = (Matrix3::identity(), Matrix3::identity());
    for n in 2..40 {
        term = term * hat / f64::from(n);
        mean += term;
    }
    let place: Vector3<f64> = pose.fixed_view::<3, 1>(0, 3).into_owned();
    let along = mean.lu().solve(&place).unwrap_or(place);
    Vector6::new(along.x, along.y, along.z, turn.x, turn.y, turn.z)
}

fn inverse(pose: &Matrix) -> Matrix {
    let turned: Matrix3<f64> = pose.fixed_view::<3, 3>(0, 0).transpose();
    let mut inverse = Matrix::identity();
    inverse.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
    inverse.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-turned * pose.fixed_view::<3, 1>(0, 3)));
    inverse
}
