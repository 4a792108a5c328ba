//! A recording, prepared for comparison.

use std::collections::BTreeMap;

use pleiad_estimation::RobotId;
use pleiad_estimation::sample::Sample;
use pleiad_physics::{RobotModel, Surroundings};
use pleiad_recording::{Recording, RobotRecording};

use crate::track::Track;

/// What a recording says, prepared once and compared with as many models as wanted.
pub struct Evidence<'a> {
    pub(crate) recording: &'a Recording,
    pub(crate) tracks: BTreeMap<RobotId, Track>,
}

impl<'a> Evidence<'a> {
    /// Prepares the robots that have a model. The models' geometry carries truth from its own stamps to
    /// those of the other channels.
    pub fn new(recording: &'a Recording, models: &BTreeMap<RobotId, RobotModel<f64>>) -> Self {
        let track = |(&robot, model): (&RobotId, &RobotModel<f64>)| {
            Some((robot, Track::new(recording.robots.get(&robot)?, model)))
        };
        Self { recording, tracks: models.iter().filter_map(track).collect() }
    }

    pub(crate) fn robot(&self, robot: RobotId) -> Option<(&'a RobotRecording, &Track)> {
        Some((self.recording.robots.get(&robot)?, self.tracks.get(&robot)?))
    }

    /// The nearest other robot whose truth is known. Steering and voltage are not recorded.
    pub(crate) fn surroundings(&self, robot: RobotId, time_s: f64, place: Option<[f64; 2]>) -> Surroundings {
        let distance = |[x, y]: [f64; 2], [own_x, own_y]: [f64; 2]| (x - own_x).powi(2) + (y - own_y).powi(2);
        let others = self.tracks.iter().filter(|(other, _)| **other != robot);
        let partner_m = place.and_then(|own| {
            others
                .filter_map(|(_, track)| track.truth_at(time_s).map(|pose| pose.position()))
                .min_by(|a, b| distance(*a, own).total_cmp(&distance(*b, own)))
        });
        Surroundings { partner_m, ..Surroundings::default() }
    }
}

/// Whether there are several readings and all are equal.
pub(crate) fn is_constant(samples: &[Sample]) -> bool {
    samples.len() > 1 && samples.windows(2).all(|pair| pair[0].reading == pair[1].reading)
}
