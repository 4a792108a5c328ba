//! The filter: scans of sightings into a map.

mod delayed;
mod joint;
mod nearest;

pub use joint::{JointRules, JointSlam};

use super::bearings::{BearingTrack, DelayedRules};
use super::initialize::{Sight, from_one};
use super::state::{Block, SlamState};
use crate::fact::Noise;
use crate::geometry::Vector2;
use crate::joint::{ErrorForm, Update};
use crate::sample::{Relative, SampleRefusal};
use crate::strategy::Noises;
use crate::symmetric::Symmetric3;
use crate::{LandmarkId, Pose2, Timestamp};

/// How sightings find their landmarks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Association {
    /// By the names they carry.
    #[default]
    Identity,
    /// By what they measure alone: nearest neighbour.
    Nearest,
    /// By what they measure alone, decided jointly over time by [`JointSlam`]; one [`Slam`] for itself takes it for
    /// [`Association::Nearest`].
    Joint,
}

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlamSettings {
    /// In which coordinates errors are Gaussian.
    pub form: ErrorForm,
    /// How well is measured.
    pub noises: Noises,
    /// How sightings find their landmarks.
    pub association: Association,
    /// Largest NIS with which a sighting is used, by dimension.
    pub gate: [f64; 3],
    /// A sighting founds a landmark if its NIS with every known one is above this, by dimension; what lies between
    /// the gate and this is neither. Not used where sightings carry names.
    pub apart: [f64; 3],
    /// The second best explanation of a sighting has to be worse by this (NIS plus log-determinant).
    pub margin: f64,
    /// A landmark is confirmed when it has been seen so often; before that, a sighting of its name that does not fit
    /// removes it.
    pub confirm_sightings: u32,
    /// A nameless landmark that is not confirmed within so many seconds is forgotten.
    pub confirm_within_s: f64,
    /// When bearings make a landmark.
    pub delayed: DelayedRules,
}

impl SlamSettings {
    /// With these noises, by name, under the gate of the team's filter (99.9 %).
    pub fn new(form: ErrorForm, noises: Noises) -> Self {
        Self {
            form,
            noises,
            association: Association::Identity,
            gate: crate::fold::DEFAULT_GATE,
            // A share of 1e-6 of all sightings of a known landmark lies beyond.
            apart: [23.9, 27.6, 30.7],
            margin: 4.0,
            confirm_sightings: 4,
            confirm_within_s: 6.0,
            delayed: DelayedRules::default(),
        }
    }
}

/// A landmark of the map, by the order in which it was first seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MapId(pub u32);

/// A landmark of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapEntry {
    /// Which.
    pub id: MapId,
    /// Its block in the state.
    pub block: Block,
    /// Its name, where sightings carry one.
    pub name: Option<LandmarkId>,
    /// How often it was seen.
    pub sightings: u32,
    /// When it was first seen.
    pub since: Timestamp,
    /// Whether it has been seen often enough to be believed.
    pub confirmed: bool,
}

/// What became of a sighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It updated the map through this landmark.
    Used {
        /// Which.
        landmark: MapId,
        /// Normalized innovation squared.
        nis: f64,
        /// 1 or 2.
        dimension: usize,
    },
    /// It founded this landmark.
    Founded {
        /// Which.
        landmark: MapId,
    },
    /// Its NIS with the landmark of its name was too large.
    Rejected {
        /// Which.
        landmark: MapId,
        /// Normalized innovation squared.
        nis: f64,
        /// 1 or 2.
        dimension: usize,
    },
    /// A bearing that waits for others to cross, or was not kept because it would not.
    Waiting,
    /// Several landmarks would explain it, or none well and one badly.
    Ambiguous,
    /// It has no linearization, or its kind does not fix a landmark.
    Unusable,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct Slam {
    settings: SlamSettings,
    state: SlamState,
    map: Vec<MapEntry>,
    tracks: Vec<BearingTrack>,
    poses: Vec<Block>,
    /// The pose kept of the scan that is being taken.
    here: Option<Block>,
    next: u32,
}

/// A sighting of a scan in the making.
struct Open {
    index: usize,
    relative: Relative,
    noise: Noise,
}

impl Open {
    fn all(noises: &Noises, sightings: &[(LandmarkId, Relative)]) -> Result<Vec<Self>, SampleRefusal> {
        let one = |(index, (_, relative)): (usize, &(LandmarkId, Relative))| {
            Ok(Self { index, relative: *relative, noise: noises.of(relative)? })
        };
        sightings.iter().enumerate().map(one).collect()
    }
}

impl Slam {
    /// A vehicle at `pose`, known as well as `noise` says in the body frame, and an empty map.
    pub fn new(settings: SlamSettings, pose: Pose2, noise: Symmetric3) -> Self {
        let state = SlamState::new(settings.form, pose, noise);
        Self { settings, state, map: Vec::new(), tracks: Vec::new(), poses: Vec::new(), here: None, next: 0 }
    }

    /// The state.
    pub fn state(&self) -> &SlamState {
        &self.state
    }

    /// The landmarks in the state, tentative ones included.
    pub fn map(&self) -> &[MapEntry] {
        &self.map
    }

    /// Position of a landmark, m.
    pub fn position(&self, entry: &MapEntry) -> Vector2 {
        self.state.place(entry.block).position()
    }

    /// Past poses in the state at which bearings wait.
    pub fn waiting_poses(&self) -> usize {
        self.poses.len()
    }

    /// A landmark that is known beforehand.
    pub fn know(&mut self, name: LandmarkId, point: Vector2, since: Timestamp) -> MapId {
        let block = self.state.insert_known(point);
        let id = self.enter(block, Some(name), since);
        if let Some(entry) = self.map.last_mut() {
            entry.confirmed = true;
        }
        id
    }

    /// The vehicle moves; see [`SlamState::propagate`].
    pub fn propagate(&mut self, motion: &crate::geometry::Vector3, noise: Symmetric3) {
        self.state.propagate(motion, noise);
    }

    /// Takes what was seen at one instant; the outcomes are in the order of the sightings.
    ///
    /// # Errors
    /// [`SampleRefusal::NoNoise`] if a sighting's kind has no noise in the settings; nothing is then changed.
    pub fn scan(
        &mut self,
        time: Timestamp,
        sightings: &[(LandmarkId, Relative)],
    ) -> Result<Vec<Outcome>, SampleRefusal> {
        let open = Open::all(&self.settings.noises, sightings)?;
        self.here = None;
        let mut outcomes = vec![Outcome::Unusable; sightings.len()];
        match self.settings.association {
            Association::Identity => {
                for sighting in &open {
                    let name = sightings[sighting.index].0;
                    outcomes[sighting.index] = self.named(time, name, sighting);
                }
            }
            Association::Nearest | Association::Joint => self.nearest(time, open, &mut outcomes),
        }
        self.forget(time);
        Ok(outcomes)
    }

    fn named(&mut self, time: Timestamp, name: LandmarkId, sighting: &Open) -> Outcome {
        match self.map.iter().position(|entry| entry.name == Some(name)) {
            Some(known) => self.use_for(known, sighting),
            None => self.found(time, Some(name), sighting),
        }
    }

    fn use_for(&mut self, known: usize, sighting: &Open) -> Outcome {
        let MapEntry { id: landmark, block, .. } = self.map[known];
        let dimension = crate::measurement::dimension(&sighting.relative);
        let update = self.state.update(
            SlamState::VEHICLE,
            block,
            &sighting.relative,
            &sighting.noise,
            &self.settings.gate,
        );
        match update {
            Ok(Update::Used { nis, .. }) => {
                let entry = &mut self.map[known];
                entry.sightings += 1;
                entry.confirmed |= entry.sightings >= self.settings.confirm_sightings;
                Outcome::Used { landmark, nis, dimension }
            }
            Ok(Update::Rejected { nis, .. }) => {
                // One of the two is wrong; before the landmark is confirmed nobody knows which.
                if !self.map[known].confirmed {
                    self.state.remove(block);
                    self.map.remove(known);
                }
                Outcome::Rejected { landmark, nis, dimension }
            }
            Ok(Update::Indefinite) | Err(_) => Outcome::Unusable,
        }
    }

    /// A landmark that is not in the map.
    fn found(&mut self, time: Timestamp, name: Option<LandmarkId>, seen: &Open) -> Outcome {
        if let Relative::Bearing { bearing_rad } = seen.relative {
            return self.wait(time, name, bearing_rad, &seen.noise);
        }
        let sight = Sight { observer: self.state.vehicle(), relative: seen.relative, noise: seen.noise };
        let Ok(landmark) = from_one(&sight) else { return Outcome::Unusable };
        let block = self.state.insert(&landmark, [SlamState::VEHICLE; 2]);
        Outcome::Founded { landmark: self.enter(block, name, time) }
    }

    fn enter(&mut self, block: Block, name: Option<LandmarkId>, since: Timestamp) -> MapId {
        let id = MapId(self.next);
        self.next += 1;
        let entry = MapEntry { id, block, name, sightings: 1, since, confirmed: false };
        self.map.push(entry);
        id
    }

    /// Leaves out tentative landmarks that were not seen again, nameless bearings that ended, and poses at which
    /// nothing waits.
    fn forget(&mut self, time: Timestamp) {
        let within_s = self.settings.confirm_within_s;
        let state = &mut self.state;
        self.map.retain(|entry| {
            let keep = entry.confirmed || entry.name.is_some() || time.seconds_since(entry.since) <= within_s;
            if !keep {
                state.remove(entry.block);
            }
            keep
        });
        self.tracks.retain(|track| {
            let recent = track.name.is_some() || time.seconds_since(track.last_seen) <= within_s;
            recent && !track.kept.is_empty()
        });
        let tracks = &self.tracks;
        self.poses.retain(|pose| {
            let waits = tracks.iter().any(|track| track.kept.iter().any(|kept| kept.pose == *pose));
            if !waits {
                state.remove(*pose);
            }
            waits
        });
    }
}
