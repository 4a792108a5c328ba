//! Absolute and relative trajectory errors as `evo` (Grupp 2017, `evo_ape` and `evo_rpe`) defines them.

use super::trajectory::PosePair;
use crate::Pose2;
use crate::geometry::{Vector2, skew_times, wrap_angle};

/// Whether an estimate is moved as a whole before it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// As it is: `evo_ape` without options.
    None,
    /// By the rotation and translation that fit best in the least-squares sense (Umeyama 1991 without
    /// scale): `evo_ape --align`.
    Se2,
}

/// Statistics of a list of errors, named and defined as by `evo`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorStatistics {
    /// Number of errors.
    pub count: usize,
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median; of an even number the mean of the two in the middle.
    pub median: f64,
    /// Standard deviation about the mean, divided by the count.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// Sum of squares.
    pub sse: f64,
}

impl ErrorStatistics {
    /// Of some errors; `None` of none.
    pub fn of(errors: &[f64]) -> Option<Self> {
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let count = sorted.len();
        let n = count as f64;
        let mean = sorted.iter().sum::<f64>() / n;
        let sse = sorted.iter().map(|error| error * error).sum::<f64>();
        let variance = sorted.iter().map(|error| (error - mean) * (error - mean)).sum::<f64>() / n;
        let median = 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
        Some(Self { count, rmse: (sse / n).sqrt(), mean, median, std: variance.sqrt(), min, max, sse })
    }
}

/// The motion that takes the estimates closest to the truths: least squares of positions over rotation
/// and translation (Umeyama 1991 without scale; in the plane the rotation is an arctangent). `None`
/// without pairs.
pub fn alignment_se2(pairs: &[PosePair]) -> Option<Pose2> {
    if pairs.is_empty() {
        return None;
    }
    let n = pairs.len() as f64;
    let from: Vector2 = pairs.iter().map(|pair| pair.estimate.position()).sum::<Vector2>() / n;
    let to: Vector2 = pairs.iter().map(|pair| pair.truth.position()).sum::<Vector2>() / n;
    let (mut cross, mut dot) = (0.0, 0.0);
    for pair in pairs {
        let a = pair.estimate.position() - from;
        let b = pair.truth.position() - to;
        cross += skew_times(a).dot(&b);
        dot += a.dot(&b);
    }
    let turn = Pose2::new(0.0, 0.0, cross.atan2(dot));
    let shift = to - turn.rotate(from);
    Some(Pose2::new(shift.x, shift.y, turn.yaw_rad()))
}

/// Absolute trajectory error: distances between estimated and true positions, metres. `None` without
/// pairs.
pub fn absolute_trajectory_error(pairs: &[PosePair], alignment: Alignment) -> Option<ErrorStatistics> {
    let moved = match alignment {
        Alignment::None => Pose2::identity(),
        Alignment::Se2 => alignment_se2(pairs)?,
    };
    let distance = |pair: &PosePair| (moved.act(pair.estimate.position()) - pair.truth.position()).norm();
    ErrorStatistics::of(&pairs.iter().map(distance).collect::<Vec<_>>())
}

/// Root mean square of the wrapped heading errors, radians, without alignment. `None` without pairs.
pub fn heading_rmse_rad(pairs: &[PosePair]) -> Option<f64> {
    let error = |pair: &PosePair| wrap_angle(pair.estimate.yaw_rad() - pair.truth.yaw_rad());
    ErrorStatistics::of(&pairs.iter().map(error).collect::<Vec<_>>()).map(|statistics| statistics.rmse)
}

/// Relative pose errors over a number of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeError {
    /// Length of the translation part of `E`, metres.
    pub translation_m: ErrorStatistics,
    /// Size of the rotation of `E`, radians.
    pub rotation_rad: ErrorStatistics,
}

/// Relative pose error over `delta` frames: `E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j)` with truth `Q` and estimate
/// `P`; `j = i + delta` with `i = 0, delta, 2 delta, ...` (the default of `evo_rpe`) or, with `all_pairs`,
/// every `i`. `None` if there is no such pair or `delta` is zero.
pub fn relative_pose_error(pairs: &[PosePair], delta: usize, all_pairs: bool) -> Option<RelativeError> {
    if delta == 0 {
        return None;
    }
    let stride = if all_pairs { 1 } else { delta };
    let errors: Vec<Pose2> = (0..pairs.len().saturating_sub(delta))
        .step_by(stride)
        .map(|i| {
            let (a, b) = (&pairs[i], &pairs[i + delta]);
            a.truth.between(&b.truth).between(&a.estimate.between(&b.estimate))
        })
        .collect();
    let lengths: Vec<f64> = errors.iter().map(|error| error.position().norm()).collect();
    let turns: Vec<f64> = errors.iter().map(|error| error.yaw_rad().abs()).collect();
    Some(RelativeError {
        translation_m: ErrorStatistics::of(&lengths)?,
        rotation_rad: ErrorStatistics::of(&turns)?,
    })
}

#[cfg(test)]
mod tests;
