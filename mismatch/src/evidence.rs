//! A recording, prepared for comparison.

use std::collections::BTreeMap;

use pleiad_estimation::sample::Sample;
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_physics::{RobotModel, Surroundings};
use pleiad_recording::{Recording, RobotRecording, effect_epoch};

use crate::channel::Channel;
use crate::plan::Plan;
use crate::track::Track;
use crate::{actuator, body, commanded, gyro, sensors, sightings};
use pleiad_recording::parallel;

/// What a recording says, prepared once and compared with as many models as wanted.
pub struct Evidence<'a> {
    pub(crate) recording: &'a Recording,
    pub(crate) tracks: BTreeMap<RobotId, Track>,
    plans: BTreeMap<RobotId, Plans>,
    origin: Timestamp,
    /// Whether truth is what a filter of the team says, and not what was recorded.
    by_reference: bool,
}

/// What there is to compare of one robot.
pub(crate) struct Plans {
    pub(crate) actuator: Plan<actuator::Turning>,
    pub(crate) body: Plan<body::Motion>,
    /// Of any robot that has commands, also where `body` and `actuator` are compared instead.
    pub(crate) commanded: Plan<commanded::Motion>,
    pub(crate) gyro: Plan<gyro::Stretch>,
    pub(crate) gps: Plan<sensors::Fix>,
    pub(crate) heading: Plan<sensors::Heading>,
    /// Range and bearing to landmarks, range and bearing to robots.
    pub(crate) sightings: [Plan<sightings::Sighted>; 4],
}

impl Plans {
    /// Of a channel of sightings.
    pub(crate) fn of_sightings(&self, channel: Channel) -> &Plan<sightings::Sighted> {
        let position = Channel::SIGHTINGS.as_flattened().iter().position(|own| *own == channel);
        &self.sightings[position.unwrap_or(0)]
    }
}

impl<'a> Evidence<'a> {
    /// Prepares the robots that have a model. The models' geometry carries truth from its own stamps to
    /// those of the other channels.
    pub fn new(recording: &'a Recording, models: &BTreeMap<RobotId, RobotModel<f64>>) -> Self {
        Self::prepared_by(recording, models, false)
    }

    /// The same of a recording whose truth is what a filter of the team says.
    pub(crate) fn by_reference(
        recording: &'a Recording,
        models: &BTreeMap<RobotId, RobotModel<f64>>,
    ) -> Self {
        Self::prepared_by(recording, models, true)
    }

    fn prepared_by(
        recording: &'a Recording,
        models: &BTreeMap<RobotId, RobotModel<f64>>,
        by_reference: bool,
    ) -> Self {
        let origin = origin(recording);
        let track = |(&robot, model): (&RobotId, &RobotModel<f64>)| {
            Some((robot, Track::new(recording.robots.get(&robot)?, model, origin)))
        };
        let mut tracks: BTreeMap<RobotId, Track> = models.iter().filter_map(track).collect();
        let robots: Vec<RobotId> = tracks.keys().copied().collect();
        let partners = parallel::map(&robots, |&robot| partners(&tracks, robot));
        for (track, partner_m) in tracks.values_mut().zip(partners) {
            track.partner_m = partner_m;
        }
        let mut evidence = Self { recording, tracks, plans: BTreeMap::new(), origin, by_reference };
        let plans = parallel::map(&robots, |&robot| evidence.plans_of(robot));
        evidence.plans = robots.into_iter().zip(plans).collect();
        evidence
    }

    fn plans_of(&self, robot: RobotId) -> Plans {
        Plans {
            actuator: actuator::plan(self, robot),
            body: body::plan(self, robot),
            commanded: commanded::plan(
                self,
                robot,
                if self.by_reference { 0.0 } else { commanded::WINDOW_S },
            ),
            gyro: gyro::plan(self, robot),
            gps: sensors::gps_plan(self, robot),
            heading: sensors::heading_plan(self, robot),
            sightings: sightings::plans(self, robot),
        }
    }

    /// The instant from which times in seconds count, of residuals and of what models say of time: zero,
    /// or the whole second in which the recording begins if its stamps are of another epoch (Unix time).
    pub fn origin(&self) -> Timestamp {
        self.origin
    }

    /// Whether truth is what a filter of the team says.
    pub(crate) fn is_by_reference(&self) -> bool {
        self.by_reference
    }

    pub(crate) fn seconds(&self, time: Timestamp) -> f64 {
        time.seconds_since(self.origin)
    }

    pub(crate) fn robot(&self, robot: RobotId) -> Option<(&'a RobotRecording, &Track)> {
        Some((self.recording.robots.get(&robot)?, self.tracks.get(&robot)?))
    }

    /// Whether there is no more than one robot.
    pub(crate) fn is_of_one(&self) -> bool {
        self.tracks.len() < 2
    }

    /// What is known of a robot, and what there is to compare.
    pub(crate) fn prepared(&self, robot: RobotId) -> Option<(&Track, &Plans)> {
        Some((self.tracks.get(&robot)?, self.plans.get(&robot)?))
    }

    /// The nearest other robot whose truth is known. The steering angle comes with the samples of the encoders;
    /// voltage is not recorded.
    pub(crate) fn surroundings(&self, robot: RobotId, time_s: f64, place: Option<[f64; 2]>) -> Surroundings {
        let others = self.tracks.iter().filter(|(other, _)| **other != robot);
        let partner_m = place.and_then(|own| {
            others
                .filter_map(|(_, track)| track.truth_at(time_s).map(|pose| pose.position()))
                .min_by(|a, b| squared_distance(*a, own).total_cmp(&squared_distance(*b, own)))
        });
        Surroundings { partner_m, ..Surroundings::default() }
    }
}

/// The nearest other robot at every sample of a robot's wheels.
fn partners(tracks: &BTreeMap<RobotId, Track>, robot: RobotId) -> Vec<Option<[f64; 2]>> {
    let Some(own) = tracks.get(&robot).filter(|_| tracks.len() > 1) else { return Vec::new() };
    let stamps = || own.encoders.iter().map(|sample| sample.time_s);
    let places = own.positions_at(stamps());
    let mut nearest: Vec<Option<[f64; 2]>> = vec![None; places.len()];
    for (_, other) in tracks.iter().filter(|(other, _)| **other != robot) {
        for ((place, best), there) in places.iter().zip(&mut nearest).zip(other.positions_at(stamps())) {
            let (Some(place), Some(there)) = (place, there) else { continue };
            if best.is_none_or(|best| squared_distance(there, *place) < squared_distance(best, *place)) {
                *best = Some(there);
            }
        }
    }
    nearest
}

fn squared_distance([x, y]: [f64; 2], [own_x, own_y]: [f64; 2]) -> f64 {
    (x - own_x).powi(2) + (y - own_y).powi(2)
}

pub(crate) fn origin(recording: &Recording) -> Timestamp {
    let firsts = recording.robots.values().flat_map(|own| {
        let channels = [&own.odometry, &own.gyro, &own.gps, &own.heading, &own.sightings];
        let samples = channels.into_iter().filter_map(|channel| channel.first().map(|sample| sample.time));
        let command = own.commands.first().map(|command| command.time);
        samples.chain(command).chain(own.truth.first().map(|sample| sample.time))
    });
    effect_epoch(firsts.min().unwrap_or(Timestamp(0)))
}

/// Whether there are several readings and all are equal.
pub(crate) fn is_constant(samples: &[Sample]) -> bool {
    samples.len() > 1 && samples.windows(2).all(|pair| pair[0].reading == pair[1].reading)
}
