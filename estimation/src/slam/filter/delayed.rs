//! Bearings of landmarks that are not in the map: kept with the pose they were taken from until two of them cross.

use super::{Outcome, Slam};
use crate::fact::Noise;
use crate::joint::Update;
use crate::sample::Relative;
use crate::slam::bearings::{BearingTrack, KeptBearing};
use crate::slam::initialize::Initialized;
use crate::slam::state::{Block, SlamState};
use crate::{LandmarkId, Timestamp};

impl Slam {
    /// A bearing of a landmark that is not in the map: crossed with one kept, kept, or let go.
    pub(super) fn wait(
        &mut self,
        time: Timestamp,
        name: Option<LandmarkId>,
        bearing_rad: f64,
        noise: &Noise,
    ) -> Outcome {
        let rules = self.settings.delayed;
        let vehicle = self.state.vehicle();
        let slack_rad = 3.0 * libm::sqrt(noise.lower[0]);
        let fits = |track: &&BearingTrack| match name {
            Some(_) => track.name == name,
            None => track.last_seen < time && track.misfit_rad(&vehicle, bearing_rad, &rules) <= slack_rad,
        };
        let mut fitting = self.tracks.iter().enumerate().filter(|(_, track)| fits(track));
        let (found, other) = (fitting.next().map(|(index, _)| index), fitting.next());
        if other.is_some() {
            return Outcome::Ambiguous;
        }
        if let Some(index) = found {
            self.tracks[index].last = (vehicle, bearing_rad);
            self.tracks[index].last_seen = time;
            if let Some((best, landmark)) = self.tracks[index].cross(&self.state, bearing_rad, noise, &rules)
            {
                return self.crossed(time, index, best, &landmark, noise);
            }
        }
        if let Some(pose) = self.pose_here() {
            let kept = KeptBearing { pose, bearing_rad };
            match found {
                Some(index) if self.tracks[index].kept.iter().any(|kept| kept.pose == pose) => {}
                Some(index) => self.tracks[index].kept.push(kept),
                None => self.tracks.push(BearingTrack {
                    name,
                    kept: vec![kept],
                    last_seen: time,
                    last: (vehicle, bearing_rad),
                }),
            }
        }
        Outcome::Waiting
    }

    /// The pose kept of this scan; a new one if the vehicle has come far enough since the last.
    fn pose_here(&mut self) -> Option<Block> {
        if self.here.is_some() {
            return self.here;
        }
        if let Some(last) = self.poses.last() {
            let gone = self.state.vehicle().position() - self.state.place(*last).position();
            if gone.norm() < self.settings.delayed.baseline_m {
                return None;
            }
        }
        if self.poses.len() >= self.settings.delayed.most_poses {
            let oldest = self.poses.remove(0);
            self.state.remove(oldest);
            for track in &mut self.tracks {
                track.kept.retain(|kept| kept.pose != oldest);
            }
        }
        let pose = self.state.keep_pose();
        self.poses.push(pose);
        self.here = Some(pose);
        self.here
    }

    /// A landmark enters the state; its other kept bearings update it.
    fn crossed(
        &mut self,
        time: Timestamp,
        track: usize,
        best: usize,
        landmark: &Initialized,
        noise: &Noise,
    ) -> Outcome {
        let track = self.tracks.remove(track);
        let block = self.state.insert(landmark, [track.kept[best].pose, SlamState::VEHICLE]);
        let id = self.enter(block, track.name, time);
        let mut used = 2;
        for (index, kept) in track.kept.iter().enumerate() {
            let relative = Relative::Bearing { bearing_rad: kept.bearing_rad };
            if index != best {
                // One that does not fit is left out, as a later one would be.
                let update = self.state.update(kept.pose, block, &relative, noise, &self.settings.gate);
                used += u32::from(matches!(update, Ok(Update::Used { .. })));
            }
        }
        if let Some(entry) = self.map.last_mut() {
            entry.sightings = used;
            entry.confirmed = used >= self.settings.confirm_sightings;
        }
        Outcome::Founded { landmark: id }
    }
}
