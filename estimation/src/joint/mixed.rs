//! Measurements that may be of one thing or another.

use super::{Block, Joint, MappedLandmark, Prepared};
use crate::LandmarkId;
use crate::geometry::Vector3;

impl Joint {
    /// An update with a measurement that may be of each of several things with its probability, and of nothing with the rest: the
    /// mixture, with its mean and covariance, `P <- P - sum w V V^T + sum w d d^T - m m^T` with `m = sum w d`.
    pub(crate) fn update_mixed(&mut self, of: &[(Prepared, f64)]) {
        self.updates += 1;
        let mut mean = vec![0.0; self.covariance.size()];
        for (prepared, weight) in of {
            let deltas =
                (0..self.blocks.len()).flat_map(|index| <[f64; 3]>::from(prepared.correction(index)));
            let deltas: Vec<f64> = deltas.collect();
            self.covariance.downdate(&prepared.scaled(weight.sqrt()));
            self.covariance.add_outer(&deltas, *weight);
            for (sum, delta) in mean.iter_mut().zip(&deltas) {
                *sum += weight * delta;
            }
        }
        self.covariance.add_outer(&mean, -1.0);
        for index in 0..self.blocks.len() {
            self.correct(index, Vector3::new(mean[3 * index], mean[3 * index + 1], mean[3 * index + 2]));
        }
    }

    /// Where landmarks are said to be, as far as anyone has seen one, in the order of their numbers; kept where names may be wrong.
    pub fn stated(&self) -> &[(LandmarkId, [f64; 2])] {
        &self.stated
    }

    pub(crate) fn state_landmark(&mut self, landmark: LandmarkId, position_m: [f64; 2]) {
        match self.stated.binary_search_by_key(&landmark, |(id, _)| *id) {
            Ok(at) => self.stated[at].1 = position_m,
            Err(at) => self.stated.insert(at, (landmark, position_m)),
        }
    }

    /// Landmarks of the team's map, with their blocks.
    pub(crate) fn landmarks(&self) -> impl Iterator<Item = (usize, &MappedLandmark)> {
        self.blocks.iter().enumerate().filter_map(|(index, block)| match block {
            Block::Landmark(mapped) => Some((index, mapped)),
            _ => None,
        })
    }
}
