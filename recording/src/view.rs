//! Views of a recording: a part of its time, a part of its map, the truth at an instant.

use std::collections::BTreeSet;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::{Reading, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId, Timestamp};

use crate::tidy::Stamped;
use crate::types::{Recording, RobotRecording};

impl Recording {
    /// What was recorded from `start` to `end`, both included. A command or velocity that was in force at
    /// `start` but stamped before it is not carried over.
    pub fn slice(&self, start: Timestamp, end: Timestamp) -> Self {
        let robots =
            self.robots.iter().map(|(&robot, channels)| (robot, channels.slice(start, end))).collect();
        Self {
            name: self.name.clone(),
            landmarks: self.landmarks.clone(),
            walls: self.walls.clone(),
            nominal: self.nominal.clone(),
            robots,
        }
    }

    /// The interval that odometry and ground truth of all robots cover.
    ///
    /// A robot without any ground truth limits it by its odometry alone. `None` if there is no robot, one
    /// has no odometry, or they have no time in common.
    pub fn common_time(&self) -> Option<(Timestamp, Timestamp)> {
        let mut common: Option<(Timestamp, Timestamp)> = None;
        for robot in self.robots.values() {
            let odometry = (robot.odometry.first()?.time, robot.odometry.last()?.time);
            let truth =
                robot.truth.first().zip(robot.truth.last()).map(|(first, last)| (first.time, last.time));
            for (first, last) in [Some(odometry), truth].into_iter().flatten() {
                let (start, end) = common.unwrap_or((first, last));
                common = Some((start.max(first), end.min(last)));
            }
        }
        common.filter(|(start, end)| start <= end)
    }

    /// The recording as if only the landmarks `keep` existed: the others leave the map and the sightings.
    pub fn with_landmarks(&self, keep: &BTreeSet<LandmarkId>) -> Self {
        let mut kept = self.clone();
        kept.landmarks.retain(|landmark, _| keep.contains(landmark));
        for robot in kept.robots.values_mut() {
            robot.sightings.retain(|sample| match sample.reading {
                Reading::Sighting { target: Target::Landmark(landmark), .. } => keep.contains(&landmark),
                _ => true,
            });
        }
        kept
    }

    /// Where `robot` really was at `time`; see [`RobotRecording::truth_at`].
    pub fn truth_at(&self, robot: RobotId, time: Timestamp, max_gap_s: f64) -> Option<Pose2> {
        self.robots.get(&robot)?.truth_at(time, max_gap_s)
    }
}

impl RobotRecording {
    /// What was recorded from `start` to `end`, both included.
    pub fn slice(&self, start: Timestamp, end: Timestamp) -> Self {
        Self {
            commands: part(&self.commands, start, end),
            odometry: part(&self.odometry, start, end),
            gyro: part(&self.gyro, start, end),
            gps: part(&self.gps, start, end),
            heading: part(&self.heading, start, end),
            sightings: part(&self.sightings, start, end),
            steer: part(&self.steer, start, end),
            scans: part(&self.scans, start, end),
            truth: part(&self.truth, start, end),
        }
    }

    /// Where the robot really was at `time`: the truth sample of that stamp, else interpolated between
    /// its neighbours, the position linearly and the heading along the shorter arc.
    ///
    /// `None` outside the ground truth and between neighbours more than `max_gap_s` seconds apart.
    pub fn truth_at(&self, time: Timestamp, max_gap_s: f64) -> Option<Pose2> {
        let after = self.truth.partition_point(|sample| sample.time < time);
        let next = self.truth.get(after)?;
        if next.time == time {
            return Some(next.pose);
        }
        let previous = self.truth.get(after.checked_sub(1)?)?;
        let gap_s = next.time.seconds_since(previous.time);
        if gap_s > max_gap_s {
            return None;
        }
        let share = time.seconds_since(previous.time) / gap_s;
        let (from, to) = (previous.pose, next.pose);
        let turn_rad = wrap_angle(to.yaw_rad() - from.yaw_rad());
        Some(Pose2::new(
            from.x_m() + share * (to.x_m() - from.x_m()),
            from.y_m() + share * (to.y_m() - from.y_m()),
            from.yaw_rad() + share * turn_rad,
        ))
    }
}

fn part<T: Stamped>(rows: &[T], start: Timestamp, end: Timestamp) -> Vec<T> {
    let first = rows.partition_point(|row| row.time() < start);
    let past = rows.partition_point(|row| row.time() <= end);
    rows.get(first..past).unwrap_or_default().to_vec()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use pleiad_estimation::sample::{Relative, Sample};

    use super::*;
    use crate::types::TruthSample;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_seconds(seconds)
    }

    fn robot(odometry: &[f64], truth: &[(f64, Pose2)]) -> RobotRecording {
        let still = Reading::Velocity { forward_m_s: 0.0, yaw_rate_rad_s: 0.0 };
        RobotRecording {
            odometry: odometry.iter().map(|&t| Sample { time: at(t), reading: still }).collect(),
            truth: truth.iter().map(|&(t, pose)| TruthSample { time: at(t), pose }).collect(),
            ..RobotRecording::default()
        }
    }

    fn team(robots: Vec<RobotRecording>) -> Recording {
        let robots = (1..).map(RobotId).zip(robots).collect();
        Recording { robots, ..Recording::default() }
    }

    #[test]
    fn truth_is_interpolated_across_half_a_turn_by_the_shorter_arc() {
        // From 170 to -170 degrees: the middle is 180, not 0.
        let degrees = PI / 180.0;
        let truth =
            [(0.0, Pose2::new(1.0, 0.0, 170.0 * degrees)), (1.0, Pose2::new(3.0, -4.0, -170.0 * degrees))];
        let robot = robot(&[], &truth);
        let middle = robot.truth_at(at(0.5), 1.0).expect("covered");
        assert!((middle.x_m() - 2.0).abs() < 1e-12 && (middle.y_m() + 2.0).abs() < 1e-12);
        assert!((middle.yaw_rad().abs() - PI).abs() < 1e-12);
        let later = robot.truth_at(at(0.75), 1.0).expect("covered");
        assert!((later.yaw_rad() + 175.0 * degrees).abs() < 1e-12);
    }

    #[test]
    fn truth_is_not_made_up_across_a_gap_or_beyond_the_ends() {
        let pose = |x| Pose2::new(x, 0.0, 0.0);
        let robot = robot(&[], &[(0.0, pose(0.0)), (1.0, pose(1.0)), (3.0, pose(2.0))]);
        assert_eq!(robot.truth_at(at(2.0), 1.5), None);
        assert_eq!(robot.truth_at(at(2.0), 2.0), Some(pose(1.5)));
        assert_eq!(robot.truth_at(at(3.0), 0.1), Some(pose(2.0)), "a sample itself needs no neighbour");
        assert_eq!(robot.truth_at(at(-0.1), 9.0), None);
        assert_eq!(robot.truth_at(at(3.1), 9.0), None);
    }

    #[test]
    fn common_time_is_what_odometry_and_truth_of_all_robots_cover() {
        let pose = Pose2::identity();
        let both = team(vec![
            robot(&[0.0, 5.0, 20.0], &[(1.0, pose), (12.0, pose)]),
            robot(&[2.0, 18.0], &[(0.0, pose), (30.0, pose)]),
        ]);
        assert_eq!(both.common_time(), Some((at(2.0), at(12.0))));
        let truthless = team(vec![robot(&[0.0, 5.0], &[])]);
        assert_eq!(truthless.common_time(), Some((at(0.0), at(5.0))));
        assert_eq!(team(vec![robot(&[0.0, 1.0], &[]), robot(&[2.0, 3.0], &[])]).common_time(), None);
        assert_eq!(team(vec![robot(&[0.0, 1.0], &[]), robot(&[], &[])]).common_time(), None);
        assert_eq!(team(vec![]).common_time(), None);
    }

    #[test]
    fn a_slice_keeps_both_ends_and_nothing_outside() {
        let whole =
            team(vec![robot(&[0.0, 1.0, 2.0, 3.0], &[(0.5, Pose2::identity()), (2.5, Pose2::identity())])]);
        assert_eq!(whole.slice(at(1.0), at(2.0)), team(vec![robot(&[1.0, 2.0], &[])]));
        assert_eq!(whole.slice(at(0.0), at(3.0)), whole);
        assert_eq!(whole.slice(at(2.0), at(1.0)), team(vec![robot(&[], &[])]));
    }

    #[test]
    fn a_restricted_map_takes_the_sightings_of_other_landmarks_with_it() {
        let seen = |target| Sample {
            time: at(0.0),
            reading: Reading::Sighting { target, relative: Relative::Range { range_m: 1.0 } },
        };
        let (kept, lost) = (LandmarkId(1), LandmarkId(2));
        let mut whole = team(vec![RobotRecording {
            sightings: vec![
                seen(Target::Landmark(kept)),
                seen(Target::Landmark(lost)),
                seen(Target::Robot(RobotId(2))),
            ],
            ..RobotRecording::default()
        }]);
        whole.landmarks = [(kept, [0.0, 0.0]), (lost, [1.0, 1.0])].into();
        let restricted = whole.with_landmarks(&[kept].into());
        assert_eq!(restricted.landmarks, [(kept, [0.0, 0.0])].into());
        let sightings = &restricted.robots[&RobotId(1)].sightings;
        assert_eq!(*sightings, [seen(Target::Landmark(kept)), seen(Target::Robot(RobotId(2)))]);
    }
}
