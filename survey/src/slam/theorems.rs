//! The three theorems of (`dissanayake2001`) as measurements on a run.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, Matrix2, Matrix2x3};
use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::slam::{Block, MapId, Slam, SlamState};
use pleiad_estimation::{LandmarkId, Pose2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use super::input::SlamInput;

/// Random subsets of the map that are looked at after every scan, besides every landmark, every two neighbours in the
/// order of discovery, and all of it.
const RANDOM_SUBSETS: usize = 8;

/// Theorem 1: the largest growth of the determinant of any submatrix of the map covariance that was looked at.
#[derive(Clone, Debug)]
pub struct DeterminantWatch {
    last: Option<(Vec<MapId>, DMatrix<f64>)>,
    chance: ChaCha12Rng,
    /// Largest growth of a logarithm of a determinant over one scan.
    pub largest_growth: f64,
    /// Determinants compared.
    pub compared: usize,
    /// Those that were not positive.
    pub singular: usize,
}

impl DeterminantWatch {
    /// Before the first scan; the seed chooses the subsets.
    pub fn new(seed: u64) -> Self {
        let chance = ChaCha12Rng::seed_from_u64(seed);
        Self { last: None, chance, largest_growth: f64::NEG_INFINITY, compared: 0, singular: 0 }
    }

    /// Takes the covariance of the positions of these landmarks, two rows each.
    pub fn take(&mut self, ids: &[MapId], covariance: &DMatrix<f64>) {
        let Some((last_ids, last)) = self.last.replace((ids.to_vec(), covariance.clone())) else { return };
        // Rows of the landmarks that were there before the scan, then and now.
        let rows: Vec<(usize, usize)> = last_ids
            .iter()
            .enumerate()
            .filter_map(|(then, id)| Some((then, ids.iter().position(|now| now == id)?)))
            .collect();
        let count = rows.len();
        let mut subsets: Vec<Vec<usize>> = (0..count).map(|k| vec![k]).collect();
        subsets.extend((1..count).map(|k| vec![k - 1, k]));
        for _ in 0..RANDOM_SUBSETS {
            let share: f64 = self.chance.random();
            subsets.push((0..count).filter(|_| self.chance.random::<f64>() < share).collect());
        }
        subsets.push((0..count).collect());
        for subset in subsets.iter().filter(|subset| !subset.is_empty()) {
            let (then, now) = (
                log_determinant(&last, subset.iter().map(|k| rows[*k].0)),
                log_determinant(covariance, subset.iter().map(|k| rows[*k].1)),
            );
            match then.zip(now) {
                Some((then, now)) => {
                    self.compared += 1;
                    self.largest_growth = self.largest_growth.max(now - then);
                }
                None => self.singular += 1,
            }
        }
    }
}

/// Logarithm of the determinant of the submatrix of some landmarks; `None` if it is not positive definite.
fn log_determinant(covariance: &DMatrix<f64>, landmarks: impl Iterator<Item = usize>) -> Option<f64> {
    let rows: Vec<usize> = landmarks.flat_map(|k| [2 * k, 2 * k + 1]).collect();
    let part = DMatrix::from_fn(rows.len(), rows.len(), |i, j| covariance[(rows[i], rows[j])]);
    let lower = Cholesky::new(part)?.unpack();
    Some(2.0 * lower.diagonal().iter().map(|entry| entry.ln()).sum::<f64>())
}

/// Covariance of the positions of the map's landmarks with the coordinates fixed at the true positions: a linear map of
/// the filter's own covariance, the same before and after an update. In the additive form it is the published one.
pub fn covariance_at_truth(
    slam: &Slam,
    births: &BTreeMap<MapId, LandmarkId>,
    landmarks: &BTreeMap<LandmarkId, [f64; 2]>,
) -> (Vec<MapId>, DMatrix<f64>) {
    let state = slam.state();
    let known: Vec<(MapId, Block, Matrix2x3<f64>)> = slam
        .map()
        .iter()
        .filter_map(|entry| {
            let [x, y] = landmarks.get(births.get(&entry.id)?)?;
            let p = match state.form() {
                ErrorForm::Invariant => Vector2::new(*x, *y),
                ErrorForm::Additive => Vector2::zeros(),
            };
            Some((entry.id, entry.block, lever(p)))
        })
        .collect();
    let mut covariance = DMatrix::zeros(2 * known.len(), 2 * known.len());
    for (i, (_, a, of_a)) in known.iter().enumerate() {
        for (j, (_, b, of_b)) in known.iter().enumerate() {
            let block = of_a * state.error_covariance(*a, *b) * of_b.transpose();
            covariance.view_mut((2 * i, 2 * j), (2, 2)).copy_from(&block);
        }
    }
    (known.iter().map(|(id, ..)| *id).collect(), covariance)
}

/// `[I, J p]`.
fn lever(p: Vector2) -> Matrix2x3<f64> {
    Matrix2x3::new(1.0, 0.0, -p.y, 0.0, 1.0, p.x)
}

/// Theorem 2: how alike the errors of the landmarks have become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// Smallest correlation of the same coordinate of two landmarks.
    pub least_correlation: f64,
    /// Largest standard deviation of the difference of two landmarks along any axis of the map, m.
    pub relative_sigma_m: f64,
    /// Largest standard deviation of the distance of two landmarks, m: what a turn of the map does not change.
    pub distance_sigma_m: f64,
}

/// Of the landmarks at `points` with this covariance; `None` of fewer than two.
pub fn likeness(covariance: &DMatrix<f64>, points: &[Vector2]) -> Option<Likeness> {
    let mut found: Option<Likeness> = None;
    let block = |i: usize, j: usize| -> Matrix2<f64> {
        Matrix2::from_fn(|row, column| covariance[(2 * i + row, 2 * j + column)])
    };
    for i in 0..points.len() {
        for j in 0..i {
            let (own, other, cross) = (block(i, i), block(j, j), block(i, j));
            let relative = own + other - cross - cross.transpose();
            let correlation =
                (0..2).map(|axis| cross[(axis, axis)] / (own[(axis, axis)] * other[(axis, axis)]).sqrt());
            let along = (points[i] - points[j]).normalize();
            let distance_sigma_m = (along.transpose() * relative * along)[(0, 0)].max(0.0).sqrt();
            let relative_sigma_m = relative.symmetric_eigenvalues().max().max(0.0).sqrt();
            let pair = Likeness {
                least_correlation: correlation.fold(f64::INFINITY, f64::min),
                relative_sigma_m,
                distance_sigma_m,
            };
            found = Some(found.map_or(pair, |worst| Likeness {
                least_correlation: worst.least_correlation.min(pair.least_correlation),
                relative_sigma_m: worst.relative_sigma_m.max(relative_sigma_m),
                distance_sigma_m: worst.distance_sigma_m.max(distance_sigma_m),
            }));
        }
    }
    found
}

/// The likeness of the confirmed landmarks.
pub fn likeness_of(slam: &Slam) -> Option<Likeness> {
    let confirmed: Vec<_> = slam.map().iter().filter(|entry| entry.confirmed).collect();
    let blocks: Vec<Block> = confirmed.iter().map(|entry| entry.block).collect();
    let points: Vec<Vector2> = confirmed.iter().map(|entry| slam.position(entry)).collect();
    likeness(&slam.state().map_covariance(&blocks), &points)
}

/// The closed form of theorem 3: the vehicle's first covariance carried to a landmark,
/// `[I, J (l - p0)] P0 [I, J (l - p0)]^T`, with `P0` that of the told position and heading.
pub fn limit(input: &SlamInput, start: &Pose2, landmark: Vector2) -> Matrix2<f64> {
    let m = lever(landmark - start.position());
    // The told position is as uncertain in every direction, so that the body frame and the map agree.
    m * input.start_noise.to_matrix() * m.transpose()
}

/// Theorem 3: a landmark's covariance over its limit, least and greatest over all directions and landmarks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverLimit {
    /// Below 1: the filter claims to know what nothing told it.
    pub least: f64,
    /// Towards 1 as the map converges.
    pub greatest: f64,
    /// Greatest variance of a landmark beyond its limit, in any direction, m^2.
    pub excess_m2: f64,
    /// Mean over the landmarks of the limit's standard deviation, root of the mean over both axes, m.
    pub limit_sigma_m: f64,
    /// The same of the covariance found.
    pub sigma_m: f64,
}

/// Of the confirmed landmarks; `None` if there is none or the limit is singular (a start known exactly).
pub fn over_limit(input: &SlamInput, slam: &Slam) -> Option<OverLimit> {
    let state: &SlamState = slam.state();
    let confirmed: Vec<_> = slam.map().iter().filter(|entry| entry.confirmed).collect();
    let mut found =
        OverLimit { least: f64::INFINITY, greatest: 0.0, excess_m2: 0.0, limit_sigma_m: 0.0, sigma_m: 0.0 };
    let sigma = |m: &Matrix2<f64>| (0.5 * m.trace()).sqrt();
    for entry in &confirmed {
        let limit = limit(input, &input.start, slam.position(entry));
        let covariance = state.position_covariance(entry.block, entry.block);
        let lower = limit.cholesky()?.l();
        let half = lower.solve_lower_triangular(&covariance)?;
        let ratio = lower.solve_lower_triangular(&half.transpose())?.symmetric_eigenvalues();
        found.least = found.least.min(ratio.min());
        found.greatest = found.greatest.max(ratio.max());
        found.excess_m2 = found.excess_m2.max((covariance - limit).symmetric_eigenvalues().max());
        found.limit_sigma_m += sigma(&limit) / confirmed.len() as f64;
        found.sigma_m += sigma(&covariance) / confirmed.len() as f64;
    }
    (!confirmed.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grown(factor: f64) -> DeterminantWatch {
        let covariance = DMatrix::from_row_slice(
            4,
            4,
            &[2.0, 0.1, 1.0, 0.0, 0.1, 3.0, 0.0, 1.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 2.0],
        );
        let ids = [MapId(0), MapId(1)];
        let mut watch = DeterminantWatch::new(1);
        watch.take(&ids, &covariance);
        watch.take(&ids, &(covariance * factor));
        watch
    }

    #[test]
    fn a_map_that_grows_by_a_millionth_is_seen_to_grow_and_one_that_shrinks_is_not() {
        assert!(grown(1.000_001).largest_growth > 1.9e-6);
        let shrunk = grown(0.999);
        assert!(shrunk.largest_growth < 0.0 && shrunk.compared >= 4 && shrunk.singular == 0);
    }

    #[test]
    fn landmarks_with_one_error_are_fully_correlated_and_their_distance_is_known() {
        // Both displaced by the same vector of covariance diag(4, 9), and 0.01 of their own.
        let mut covariance = DMatrix::zeros(4, 4);
        for (i, j) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
            covariance[(i, j)] = 4.0;
            covariance[(i + 1, j + 1)] = 9.0;
        }
        for i in 0..4 {
            covariance[(i, i)] += 0.01;
        }
        let found = likeness(&covariance, &[Vector2::zeros(), Vector2::new(5.0, 0.0)]).unwrap();
        assert!((found.least_correlation - 4.0 / 4.01).abs() < 1e-12);
        assert!((found.relative_sigma_m - 0.02f64.sqrt()).abs() < 1e-12);
        assert!((found.distance_sigma_m - 0.02f64.sqrt()).abs() < 1e-12);
    }
}
