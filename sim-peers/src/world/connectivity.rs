//! Whether the team held together: the graph of who saw whom.

use std::collections::BTreeMap;
use std::fmt;

use pleiad_estimation::sample::{Reading, Target};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_recording::Recording;

/// A stretch of time over which the team was in the same several groups, none of which saw another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disconnection {
    /// When it began.
    pub from: Timestamp,
    /// When it ended: a sighting, or the end of the recording.
    pub until: Timestamp,
    /// The groups, the largest first, at equal size the one with the smallest number first.
    pub groups: Vec<Vec<RobotId>>,
}

impl Disconnection {
    /// The robots cut off from the largest group, in ascending order.
    pub fn cut_off(&self) -> Vec<RobotId> {
        let mut robots: Vec<RobotId> = self.groups.iter().skip(1).flatten().copied().collect();
        robots.sort_unstable();
        robots
    }

    /// The robots cut off from `robot`, in ascending order: who, for example, lost the one with GPS.
    pub fn cut_off_from(&self, robot: RobotId) -> Vec<RobotId> {
        let others = self.groups.iter().filter(|group| !group.contains(&robot));
        let mut robots: Vec<RobotId> = others.flatten().copied().collect();
        robots.sort_unstable();
        robots
    }

    /// How long it lasted, seconds.
    pub fn duration_s(&self) -> f64 {
        self.until.seconds_since(self.from)
    }
}

impl fmt::Display for Disconnection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let groups: Vec<String> = self
            .groups
            .iter()
            .map(|group| group.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "))
            .collect();
        let (from, until) = (self.from.seconds(), self.until.seconds());
        write!(f, "{from:.1} s to {until:.1} s: no sighting between robots {}", groups.join(" | "))
    }
}

/// The stretches in which the graph of sightings between robots was not connected, in order of time. An
/// edge stands from a sighting, by either side, until `window_s` later. The first `window_s` of the
/// recording, in which the graph is still filling, are not judged.
pub fn connectivity(recording: &Recording, window_s: f64) -> Vec<Disconnection> {
    let robots: Vec<RobotId> = recording.robots.keys().copied().collect();
    let Some((first, last)) = span(recording) else { return Vec::new() };
    let begin = first.plus_seconds(window_s);
    let edges = edges(recording, window_s);
    let mut changes: Vec<Timestamp> = edges
        .values()
        .flatten()
        .flat_map(|(from, until)| [*from, *until])
        .filter(|time| *time > begin && *time < last)
        .chain([begin])
        .filter(|time| *time < last)
        .collect();
    changes.sort_unstable();
    changes.dedup();

    let mut found: Vec<Disconnection> = Vec::new();
    for (index, from) in changes.iter().enumerate() {
        let until = changes.get(index + 1).copied().unwrap_or(last);
        let standing = edges
            .iter()
            .filter(|(_, spans)| {
                let next = spans.partition_point(|(start, _)| start <= from);
                next > 0 && spans[next - 1].1 > *from
            })
            .map(|(pair, _)| *pair);
        let groups = groups(&robots, standing);
        match found.last_mut() {
            Some(before) if before.until == *from && before.groups == groups => before.until = until,
            _ if groups.len() > 1 => found.push(Disconnection { from: *from, until, groups }),
            _ => {}
        }
    }
    found
}

/// First and last odometry stamp of the recording.
fn span(recording: &Recording) -> Option<(Timestamp, Timestamp)> {
    let stamps = || recording.robots.values().flat_map(|robot| &robot.odometry).map(|sample| sample.time);
    stamps().min().zip(stamps().max())
}

/// Per pair, the disjoint stretches over which its edge stands, in order.
fn edges(recording: &Recording, window_s: f64) -> BTreeMap<(RobotId, RobotId), Vec<(Timestamp, Timestamp)>> {
    let mut stamps: BTreeMap<(RobotId, RobotId), Vec<Timestamp>> = BTreeMap::new();
    for (observer, robot) in &recording.robots {
        for sample in &robot.sightings {
            if let Reading::Sighting { target: Target::Robot(seen), .. } = sample.reading {
                let pair = (*observer.min(&seen), *observer.max(&seen));
                stamps.entry(pair).or_default().push(sample.time);
            }
        }
    }
    let merge = |mut stamps: Vec<Timestamp>| {
        stamps.sort_unstable();
        let mut spans: Vec<(Timestamp, Timestamp)> = Vec::new();
        for from in stamps {
            let until = from.plus_seconds(window_s);
            match spans.last_mut() {
                Some(span) if from <= span.1 => span.1 = until,
                _ => spans.push((from, until)),
            }
        }
        spans
    };
    stamps.into_iter().map(|(pair, stamps)| (pair, merge(stamps))).collect()
}

/// Connected components, the largest first.
fn groups(robots: &[RobotId], edges: impl Iterator<Item = (RobotId, RobotId)>) -> Vec<Vec<RobotId>> {
    let mut label: BTreeMap<RobotId, RobotId> = robots.iter().map(|robot| (*robot, *robot)).collect();
    for (a, b) in edges {
        if let (Some(keep), Some(give_up)) = (label.get(&a).copied(), label.get(&b).copied()) {
            for group in label.values_mut().filter(|group| **group == give_up) {
                *group = keep;
            }
        }
    }
    let mut members: BTreeMap<RobotId, Vec<RobotId>> = BTreeMap::new();
    for (robot, group) in label {
        members.entry(group).or_default().push(robot);
    }
    let mut groups: Vec<Vec<RobotId>> = members.into_values().collect();
    groups.sort_by_key(|group| (usize::MAX - group.len(), group.first().copied()));
    groups
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::sample::{Relative, Sample};

    use super::*;

    /// Odometry at 0 and 20 s for three robots, and sightings `(observer, seen, seconds)`.
    fn recording(sightings: &[(u32, u32, f64)]) -> Recording {
        let mut recording = Recording::default();
        for id in 1..=3 {
            let robot = recording.robots.entry(RobotId(id)).or_default();
            let reading = Reading::Velocity { forward_m_s: 0.0, yaw_rate_rad_s: 0.0 };
            robot.odometry =
                [0.0, 20.0].map(|t| Sample { time: Timestamp::from_seconds(t), reading }).to_vec();
        }
        for (observer, seen, t) in sightings {
            let reading = Reading::Sighting {
                target: Target::Robot(RobotId(*seen)),
                relative: Relative::Range { range_m: 1.0 },
            };
            let sample = Sample { time: Timestamp::from_seconds(*t), reading };
            recording.robots.entry(RobotId(*observer)).or_default().sightings.push(sample);
        }
        recording
    }

    #[test]
    fn a_robot_unseen_for_longer_than_the_window_is_cut_off_until_it_is_seen_again() {
        let mut sightings: Vec<(u32, u32, f64)> = (0..20).map(|k| (1, 2, f64::from(k))).collect();
        // Robot 3 sees robot 2 until 6 s and again from 15 s; with a window of 3 s it is alone from 9 s.
        sightings.extend((0..7).chain(15..20).map(|k| (3, 2, f64::from(k))));
        let found = connectivity(&recording(&sightings), 3.0);
        let expected = Disconnection {
            from: Timestamp::from_seconds(9.0),
            until: Timestamp::from_seconds(15.0),
            groups: vec![vec![RobotId(1), RobotId(2)], vec![RobotId(3)]],
        };
        assert_eq!(found, vec![expected]);
        assert_eq!(found[0].cut_off(), vec![RobotId(3)]);
        assert_eq!(found[0].cut_off_from(RobotId(3)), vec![RobotId(1), RobotId(2)]);
        assert_eq!(found[0].to_string(), "9.0 s to 15.0 s: no sighting between robots 1 2 | 3");
    }

    #[test]
    fn a_chain_of_sightings_keeps_the_team_connected() {
        let sightings: Vec<(u32, u32, f64)> =
            (0..20).flat_map(|k| [(1, 2, f64::from(k)), (3, 2, f64::from(k) + 0.5)]).collect();
        assert_eq!(connectivity(&recording(&sightings), 3.0), vec![]);
    }

    #[test]
    fn robots_that_see_nobody_are_apart_from_the_first_judged_instant_to_the_end() {
        let found = connectivity(&recording(&[]), 3.0);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].from.seconds(), found[0].until.seconds()), (3.0, 20.0));
        assert_eq!(found[0].groups.len(), 3);
    }
}
