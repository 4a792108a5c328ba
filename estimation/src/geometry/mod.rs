//! Lie groups of rigid motion. Each group offers the same set of operations: `compose`, `inverse`,
//! `exp`, `log`, `adjoint`, `left_jacobian`, `right_jacobian`.

mod se2;

pub use se2::{Matrix3, Pose2, Vector2, Vector3, skew_times, wrap_angle};
