//! Scans whose sightings carry no names: nearest neighbour, one pair at a time.

use super::{Open, Outcome, Slam};
use crate::Timestamp;
use crate::slam::associate::{Candidate, associate};
use crate::slam::state::SlamState;

impl Slam {
    /// The sightings of a scan, the surest first; what is apart from every landmark founds one.
    pub(super) fn nearest(&mut self, time: Timestamp, mut open: Vec<Open>, outcomes: &mut [Outcome]) {
        // Landmarks that were there before this scan; what it founds is not seen twice in it.
        let mut free: Vec<usize> = (0..self.map.len()).collect();
        loop {
            let candidates = self.candidates(&open, &free);
            let Some(choice) = associate(&candidates, self.settings.margin) else { break };
            let sighting = open.remove(choice.sighting);
            let landmark = free.remove(choice.landmark);
            let outcome = self.use_for(landmark, &sighting);
            outcomes[sighting.index] = outcome;
            if let Outcome::Rejected { .. } = outcome {
                // On the gate but for rounding; the landmark may be gone, and the indices with it.
                break;
            }
        }
        let known = self.map.len();
        for sighting in open {
            outcomes[sighting.index] = if self.apart(&sighting, known) {
                self.found(time, None, &sighting)
            } else {
                Outcome::Ambiguous
            };
        }
    }

    fn candidates(&self, open: &[Open], free: &[usize]) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for (sighting, seen) in open.iter().enumerate() {
            for (landmark, entry) in free.iter().enumerate() {
                let block = self.map[*entry].block;
                let innovation =
                    self.state.innovation(SlamState::VEHICLE, block, &seen.relative, &seen.noise);
                if let Ok(innovation) = innovation
                    && innovation.nis <= self.settings.gate[innovation.dimension - 1]
                {
                    let (nis, log_determinant) = (innovation.nis, innovation.log_determinant);
                    candidates.push(Candidate { sighting, landmark, nis, log_determinant });
                }
            }
        }
        candidates
    }

    /// Whether a sighting is of none of the first `known` landmarks.
    fn apart(&self, seen: &Open, known: usize) -> bool {
        self.map.iter().take(known).all(|entry| {
            let innovation =
                self.state.innovation(SlamState::VEHICLE, entry.block, &seen.relative, &seen.noise);
            innovation
                .map_or(true, |innovation| innovation.nis > self.settings.apart[innovation.dimension - 1])
        })
    }
}
