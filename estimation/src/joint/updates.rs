//! What a measurement does to the joint: all of it, as much as is likely, or a mixture of what it may be of.

use super::{Block, ErrorForm, Joint, MappedLandmark, Participant, Prepared, Update};
use crate::LandmarkId;
use crate::geometry::{Matrix3, Vector3};

impl Joint {
    /// One update of the whole joint with an innovation of `dimension` and the given noise, if it passes
    /// the gate.
    pub(crate) fn update(
        &mut self,
        dimension: usize,
        innovation: &Vector3,
        noise: &Matrix3,
        participants: &mut [Participant],
        threshold: f64,
        clutter: Option<f64>,
    ) -> Update {
        if self.form == ErrorForm::Additive {
            for participant in participants.iter_mut() {
                let member = self.part(participant.index);
                let pose = member.correction.compose(&member.nominal);
                participant.jacobian *= pose.invariant_from_additive();
            }
        }
        let Some(prepared) = self.covariance.prepare(dimension, innovation, noise, participants) else {
            return Update::Indefinite;
        };
        let nis = prepared.nis();
        let weight = clutter.map_or(1.0, |odds| prepared.weight_in_clutter(odds));
        if nis > threshold {
            return Update::Rejected { nis, threshold, weight };
        }
        self.updates += 1;
        if clutter.is_some() {
            self.update_in_clutter(&prepared, weight);
            return Update::Used { nis, weight };
        }
        self.covariance.downdate(&prepared);
        for index in 0..self.blocks.len() {
            self.correct(index, prepared.correction(index));
        }
        Update::Used { nis, weight }
    }

    /// An update with a measurement that may be of nothing: the mixture of both, with its mean and covariance
    /// (`barshalom1975`); `weight` is the probability that it is not.
    fn update_in_clutter(&mut self, prepared: &Prepared, weight: f64) {
        self.reduce_in_clutter(prepared, weight);
        for index in 0..self.blocks.len() {
            self.correct(index, prepared.correction(index) * weight);
        }
    }

    /// The covariance of an update that is of nothing but for a `weight`; the corrections are left.
    pub(crate) fn reduce_in_clutter(&mut self, prepared: &Prepared, weight: f64) {
        let deltas: Vec<f64> =
            (0..self.blocks.len()).flat_map(|index| <[f64; 3]>::from(prepared.correction(index))).collect();
        self.covariance.downdate(&prepared.scaled(weight.sqrt()));
        self.covariance.add_outer(&deltas, weight * (1.0 - weight));
    }

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
