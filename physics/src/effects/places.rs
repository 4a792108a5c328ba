//! Parameters that are places and labels.

use crate::context::Context;
use crate::model::Region;
use crate::scalar::Scalar;

/// Whether the robot is inside the region given by the first four values, `[x0, x1, y0, y1]`.
pub(super) fn inside<S: Scalar>(values: &[S], context: &Context<S>) -> bool {
    let region = Region::from_bounds([0, 1, 2, 3].map(|bound| values[bound].value()));
    region.contains(context.motion.pose.position().map(S::value))
}

/// The label that a value stands for: the nearest whole number.
// A cast from a float saturates, so that no value is outside the range.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(super) fn label<S: Scalar>(value: S) -> u32 {
    libm::round(value.value()) as u32
}
