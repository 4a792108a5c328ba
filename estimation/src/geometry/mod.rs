//! Lie groups of rigid motion. Each group offers the same set of operations ([`LieGroup`]): `compose`, `inverse`,
//! `between`, `exp`, `log`, `adjoint`. SE(2) has the left and right Jacobians besides.

mod group;
pub mod ordered;
mod se2;
mod se3;

pub use group::{LieGroup, Square, Tangent};
pub use se2::{Matrix3, Pose2, Vector2, Vector3, skew_times, wrap_angle};
pub use se3::{Pose3, Tangent6, skew};

#[cfg(test)]
mod laws;
