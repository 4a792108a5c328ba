//! The distributed joint filter of Roumeliotis & Bekey (2000, 2002) in its factor form.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::RobotId;
use crate::geometry::{Matrix3, Vector3};

/// Why a reference filter could not take a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// A robot that was never added.
    #[error("robot {0} is not in the team; add it first")]
    UnknownRobot(RobotId),
    /// A robot that meets itself.
    #[error("robot {0} cannot meet itself; name two robots")]
    SelfMeeting(RobotId),
    /// Shapes that do not fit together.
    #[error("measurement of {rows} rows: the Jacobians must be {rows}x3 and the noise {rows}x{rows}")]
    Shape {
        /// Length of the residual.
        rows: usize,
    },
    /// A matrix that has to be inverted cannot be.
    #[error("{what} cannot be inverted; check the noise, the covariance and the transition")]
    Singular {
        /// Which matrix.
        what: &'static str,
    },
}

/// What a meeting sends to the whole team, in order and without loss: O(N) numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Broadcast {
    /// Measured less predicted.
    pub residual: DVector<f64>,
    /// `S`.
    pub innovation_covariance: DMatrix<f64>,
    /// Of every robot the gain with its own motion taken out, `Phi_i^-1 K_i`.
    pub gains: BTreeMap<RobotId, DMatrix<f64>>,
}

/// A team whose members keep their own block and their own row of factors.
///
/// `P_ij = s_ij s_ji^T`, and in motion `s_ij <- Phi_i s_ij`. How a product is split is free; here the
/// robot of the smaller number keeps `Phi_i Pi_ij` and the other `Phi_j`, where `Phi_i` is the product
/// of its transitions and `Pi_ij = Phi_i^-1 P_ij Phi_j^-T` changes at meetings only. That is what lets
/// the two participants compute the gain of every robot from their rows, and every robot update its row
/// from the broadcast alone.
#[derive(Clone, Debug, Default)]
pub struct RoumeliotisBekey {
    members: BTreeMap<RobotId, Member>,
}

/// What one robot keeps.
#[derive(Clone, Debug)]
struct Member {
    robot: RobotId,
    state: Vector3,
    covariance: Matrix3,
    /// The product of its transitions.
    motion: Matrix3,
    /// `Pi_ij` for every other robot `j` it has a correlation with.
    row: BTreeMap<RobotId, Matrix3>,
}

impl RoumeliotisBekey {
    /// An empty team.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a robot without correlations.
    pub fn add(&mut self, robot: RobotId, state: Vector3, covariance: Matrix3) {
        for member in self.members.values_mut() {
            member.row.remove(&robot);
        }
        let row = BTreeMap::new();
        self.members.insert(robot, Member { robot, state, covariance, motion: Matrix3::identity(), row });
    }

    /// Moves a robot to a predicted state: `P_ii <- Phi P_ii Phi^T + Q`, `s_ij <- Phi s_ij`. Nothing is
    /// sent.
    pub fn step(
        &mut self,
        robot: RobotId,
        state: Vector3,
        transition: &Matrix3,
        noise: &Matrix3,
    ) -> Result<(), ReferenceError> {
        let member = self.members.get_mut(&robot).ok_or(ReferenceError::UnknownRobot(robot))?;
        member.state = state;
        member.covariance = transition * member.covariance * transition.transpose() + noise;
        member.motion = transition * member.motion;
        Ok(())
    }

    /// A relative measurement between two robots, `residual = H_a e_a + H_b e_b + n`: the participants
    /// compute the gains of the whole team from their two rows, and every robot obeys the broadcast.
    pub fn meet(
        &mut self,
        observer: (RobotId, &DMatrix<f64>),
        observed: (RobotId, &DMatrix<f64>),
        residual: &DVector<f64>,
        noise: &DMatrix<f64>,
    ) -> Result<Broadcast, ReferenceError> {
        if observer.0 == observed.0 {
            return Err(ReferenceError::SelfMeeting(observer.0));
        }
        let broadcast = self.gains(&[observer, observed], residual, noise)?;
        self.deliver(&broadcast);
        Ok(broadcast)
    }

    /// A measurement of one robot against the map, `residual = H e + n`.
    pub fn fix(
        &mut self,
        observer: (RobotId, &DMatrix<f64>),
        residual: &DVector<f64>,
        noise: &DMatrix<f64>,
    ) -> Result<Broadcast, ReferenceError> {
        let broadcast = self.gains(&[observer], residual, noise)?;
        self.deliver(&broadcast);
        Ok(broadcast)
    }

    /// A robot's state.
    pub fn state(&self, robot: RobotId) -> Option<Vector3> {
        self.members.get(&robot).map(|member| member.state)
    }

    /// The factor `s_ij` that robot `i` keeps; `None` without correlation.
    pub fn factor(&self, i: RobotId, j: RobotId) -> Option<Matrix3> {
        self.members.get(&i)?.factor(j)
    }

    /// `P_ij`: a robot's own block, or the product of two factors (zero if the two never met, not even
    /// through others).
    pub fn covariance(&self, i: RobotId, j: RobotId) -> Option<Matrix3> {
        let (first, second) = (self.members.get(&i)?, self.members.get(&j)?);
        if i == j {
            return Some(first.covariance);
        }
        Some(match (first.factor(j), second.factor(i)) {
            (Some(own), Some(other)) => own * other.transpose(),
            _ => Matrix3::zeros(),
        })
    }

    /// What the participants compute: reads nothing but their own two states and rows. `S = H P H^T + R`
    /// over the participants, `K_i = sum_p P_ip H_p^T S^-1` for every `i`.
    fn gains(
        &self,
        participants: &[(RobotId, &DMatrix<f64>)],
        residual: &DVector<f64>,
        noise: &DMatrix<f64>,
    ) -> Result<Broadcast, ReferenceError> {
        let rows = residual.len();
        let fits = participants.iter().all(|(_, h)| h.shape() == (rows, 3)) && noise.shape() == (rows, rows);
        if !fits {
            return Err(ReferenceError::Shape { rows });
        }
        if let Some((stranger, _)) = participants.iter().find(|(robot, _)| !self.members.contains_key(robot))
        {
            return Err(ReferenceError::UnknownRobot(*stranger));
        }
        let mut innovation_covariance = noise.clone();
        for (i, h_i) in participants {
            for (j, h_j) in participants {
                let block = self.covariance(*i, *j).ok_or(ReferenceError::UnknownRobot(*i))?;
                innovation_covariance += *h_i * block * h_j.transpose();
            }
        }
        let cholesky = Cholesky::new(innovation_covariance.clone())
            .ok_or(ReferenceError::Singular { what: "the innovation covariance" })?;

        let mut gains = BTreeMap::new();
        for robot in self.members.keys() {
            // Phi_i^-1 P_ip H_p^T, summed over the participants; Pi_ip = Pi_pi^T is in p's row.
            let mut sum = DMatrix::zeros(3, rows);
            for (p, h) in participants {
                let Some(member) = self.members.get(p) else { return Err(ReferenceError::UnknownRobot(*p)) };
                if p == robot {
                    let own = member
                        .motion
                        .lu()
                        .solve(&member.covariance)
                        .ok_or(ReferenceError::Singular { what: "a transition" })?;
                    sum += own * h.transpose();
                } else if let Some(base) = member.row.get(robot) {
                    sum += base.transpose() * member.motion.transpose() * h.transpose();
                }
            }
            gains.insert(*robot, cholesky.solve(&sum.transpose()).transpose());
        }
        Ok(Broadcast { residual: residual.clone(), innovation_covariance, gains })
    }

    fn deliver(&mut self, broadcast: &Broadcast) {
        for member in self.members.values_mut() {
            member.receive(broadcast);
        }
    }
}

impl Member {
    fn factor(&self, other: RobotId) -> Option<Matrix3> {
        let base = self.row.get(&other)?;
        Some(if self.robot < other { self.motion * base } else { self.motion })
    }

    /// `x_i += K_i r`, `P_ii -= K_i S K_i^T`, and for its own row `P_ij -= K_i S K_j^T`.
    fn receive(&mut self, broadcast: &Broadcast) {
        let Some(own) = broadcast.gains.get(&self.robot) else { return };
        let gain = self.motion * own;
        self.state += &gain * &broadcast.residual;
        self.covariance -= &gain * &broadcast.innovation_covariance * gain.transpose();
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        for (other, other_gain) in &broadcast.gains {
            if *other != self.robot {
                let base = self.row.entry(*other).or_insert_with(Matrix3::zeros);
                *base -= own * &broadcast.innovation_covariance * other_gain.transpose();
            }
        }
    }
}

#[cfg(test)]
mod tests;
