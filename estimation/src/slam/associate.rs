//! Which landmark was seen: nearest neighbour under a gate, one sighting per landmark and scan, and nothing
//! where two answers are about as good.

/// A sighting and a landmark that it may be of: its innovation passes the gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Index of the sighting within its scan.
    pub sighting: usize,
    /// Index of the landmark among those asked about.
    pub landmark: usize,
    /// Normalized innovation squared.
    pub nis: f64,
    /// Logarithm of the determinant of the innovation covariance: without it a landmark of which little is known
    /// would be near to everything.
    pub log_determinant: f64,
}

impl Candidate {
    /// Minus twice the logarithm of the likelihood, but for a constant.
    fn score(&self) -> f64 {
        self.nis + self.log_determinant
    }
}

/// What [`associate`] decided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index of the sighting.
    pub sighting: usize,
    /// Index of the landmark.
    pub landmark: usize,
    /// Normalized innovation squared.
    pub nis: f64,
}

/// The surest pair of a scan, or `None` if there is none that is not ambiguous.
///
/// A pair is sure if no other landmark explains the sighting, and no other sighting the landmark, with a score
/// (NIS plus log-determinant) within `margin` of its own. Of the sure pairs the one of smallest NIS comes first;
/// the caller updates with it, takes both from the candidates, and asks again with the innovations as they then
/// are. So every later pair is judged given the earlier ones, and the error of the vehicle, common to the scan, is
/// taken out once: pairs that are compatible one by one and not together are told apart (joint compatibility
/// (`neira2001`), taken sequentially).
pub fn associate(candidates: &[Candidate], margin: f64) -> Option<Choice> {
    let rival = |one: &Candidate, other: &Candidate| {
        let same = (one.sighting == other.sighting) != (one.landmark == other.landmark);
        same && other.score() < one.score() + margin
    };
    let sure = candidates.iter().filter(|one| !candidates.iter().any(|other| rival(one, other)));
    let best = sure.min_by(|a, b| a.nis.total_cmp(&b.nis))?;
    Some(Choice { sighting: best.sighting, landmark: best.landmark, nis: best.nis })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(sighting: usize, landmark: usize, nis: f64) -> Candidate {
        Candidate { sighting, landmark, nis, log_determinant: 0.0 }
    }

    #[test]
    fn the_surest_pair_comes_first() {
        let candidates = [candidate(0, 0, 2.0), candidate(1, 1, 0.5)];
        let choice = associate(&candidates, 3.0).unwrap();
        assert_eq!((choice.sighting, choice.landmark), (1, 1));
    }

    #[test]
    fn two_landmarks_that_explain_a_sighting_alike_leave_it_open() {
        assert_eq!(associate(&[candidate(0, 0, 1.0), candidate(0, 1, 2.0)], 3.0), None);
        assert!(associate(&[candidate(0, 0, 1.0), candidate(0, 1, 6.0)], 3.0).is_some());
    }

    #[test]
    fn two_sightings_of_one_landmark_are_left_open() {
        assert_eq!(associate(&[candidate(0, 0, 1.0), candidate(1, 0, 2.0)], 3.0), None);
    }

    #[test]
    fn a_landmark_of_which_little_is_known_does_not_win_by_its_wide_ellipse() {
        let vague = Candidate { sighting: 0, landmark: 1, nis: 0.1, log_determinant: 9.0 };
        let choice = associate(&[candidate(0, 0, 2.0), vague], 3.0).unwrap();
        assert_eq!(choice.landmark, 0);
    }
}
