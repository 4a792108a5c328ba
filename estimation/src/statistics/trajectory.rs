//! Truth at the times of an estimate.

use crate::{Pose2, Timestamp};

/// An estimated pose and the true one at the same time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePair {
    /// When.
    pub time: Timestamp,
    /// The estimate.
    pub estimate: Pose2,
    /// The truth, or the reference taken for it.
    pub truth: Pose2,
}

/// A true trajectory, interpolated on the group.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    samples: Vec<(Timestamp, Pose2)>,
    max_gap_s: f64,
}

impl Truth {
    /// From samples in any order (of several at one time the first counts); no pose is given between
    /// samples more than `max_gap_s` seconds apart.
    pub fn new(samples: impl IntoIterator<Item = (Timestamp, Pose2)>, max_gap_s: f64) -> Self {
        let mut samples: Vec<_> = samples.into_iter().collect();
        samples.sort_by_key(|(time, _)| *time);
        samples.dedup_by_key(|(time, _)| *time);
        Self { samples, max_gap_s }
    }

    /// The pose at a time: `A exp(s log(A^-1 B))` between the samples around it. `None` outside the
    /// trajectory and in its gaps.
    pub fn at(&self, time: Timestamp) -> Option<Pose2> {
        let next = self.samples.partition_point(|(sample, _)| *sample < time);
        let (after, to) = self.samples.get(next)?;
        if *after == time {
            return Some(*to);
        }
        let (before, from) = self.samples.get(next.checked_sub(1)?)?;
        let gap = after.seconds_since(*before);
        if gap > self.max_gap_s {
            return None;
        }
        let share = time.seconds_since(*before) / gap;
        Some(from.compose(&Pose2::exp(from.inverse().compose(to).log() * share)))
    }
}

/// Pairs an estimated trajectory with the truth; where there is no truth, there is no pair.
pub fn associate(estimate: impl IntoIterator<Item = (Timestamp, Pose2)>, truth: &Truth) -> Vec<PosePair> {
    let pair = |(time, estimate)| truth.at(time).map(|truth| PosePair { time, estimate, truth });
    estimate.into_iter().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_seconds(seconds)
    }

    #[test]
    fn a_quarter_circle_is_interpolated_along_the_circle() {
        let end = Pose2::new(1.0, 1.0, FRAC_PI_2);
        let truth = Truth::new([(at(1.0), end), (at(0.0), Pose2::identity())], 2.0);
        for share in [0.25, 0.5, 0.9_f64] {
            let angle = share * FRAC_PI_2;
            let pose = truth.at(at(share)).unwrap();
            let expected = Pose2::new(angle.sin(), 1.0 - angle.cos(), angle);
            assert!((pose.between(&expected)).log().norm() < 1e-9);
        }
    }

    #[test]
    fn heading_is_interpolated_the_short_way_over_the_seam() {
        let truth = Truth::new(
            [(at(0.0), Pose2::new(0.0, 0.0, PI - 0.1)), (at(1.0), Pose2::new(0.0, 0.0, 0.1 - PI))],
            2.0,
        );
        assert!((truth.at(at(0.25)).unwrap().yaw_rad() - (PI - 0.05)).abs() < 1e-9);
    }

    #[test]
    fn gaps_and_ends_give_nothing_but_samples_always_do() {
        let pose = Pose2::new(1.0, 2.0, 0.3);
        let truth = Truth::new([(at(0.0), pose), (at(0.1), pose), (at(5.0), pose)], 0.5);
        assert!(truth.at(at(0.05)).is_some());
        assert!(truth.at(at(5.0)).is_some());
        assert!(truth.at(at(2.0)).is_none());
        assert!(truth.at(at(-0.1)).is_none());
        assert!(truth.at(at(5.1)).is_none());
        assert_eq!(associate([(at(0.0), pose), (at(2.0), pose)], &truth).len(), 1);
    }
}
