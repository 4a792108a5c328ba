//! Recordings with a known change, to see whether a diagnosis finds it as a difference, and recordings in
//! which commands and motion no longer belong together.
//!
//! Odometry of velocity commands counts as commands: it is changed wherever commands are.

use std::ops::Range;

use pleiad_estimation::Timestamp;
use pleiad_estimation::sample::{Reading, Relative, Sample};
use pleiad_recording::{Command, Recording, RobotRecording};
use rand::seq::SliceRandom as _;
use rand::{Rng, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Commands multiplied by a factor: forward speed by `forward`, yaw rate by `yaw`.
pub fn commands_scaled(mut recording: Recording, [forward, yaw]: [f64; 2]) -> Recording {
    for own in recording.robots.values_mut() {
        each_command(own, |[speed, yaw_rate]| [forward * speed, yaw * yaw_rate]);
    }
    recording
}

/// Commands and odometry stamped later by `by_s` seconds. What they drove then seems to come earlier.
pub fn commands_later(mut recording: Recording, by_s: f64) -> Recording {
    for own in recording.robots.values_mut() {
        for command in &mut own.commands {
            command.time = command.time.plus_seconds(by_s);
        }
        for sample in &mut own.odometry {
            sample.time = sample.time.plus_seconds(by_s);
        }
    }
    recording
}

/// Bearings `b` read as `b + c1 b + c3 b^3`.
pub fn bearings_bent(mut recording: Recording, c1: f64, c3: f64) -> Recording {
    each_sighting(&mut recording, |relative| match relative {
        Relative::RangeBearing { bearing_rad, .. } | Relative::Bearing { bearing_rad } => {
            let angle = *bearing_rad;
            *bearing_rad += c1 * angle + c3 * angle.powi(3);
        }
        Relative::Pose(_) | Relative::Position { .. } | Relative::Range { .. } => {}
    });
    recording
}

/// Ranges longer by `by_m` metres.
pub fn ranges_biased(mut recording: Recording, by_m: f64) -> Recording {
    each_sighting(&mut recording, |relative| match relative {
        Relative::RangeBearing { range_m, .. } | Relative::Range { range_m } => *range_m += by_m,
        Relative::Pose(_) | Relative::Position { .. } | Relative::Bearing { .. } => {}
    });
    recording
}

/// Commands keep their stamps, and their values are those of another time: blocks of `block_s` seconds in a
/// random order, each robot's its own.
pub fn commands_permuted(mut recording: Recording, block_s: f64, seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for own in recording.robots.values_mut() {
        let order = permuted(&stamps(own), block_s, &mut random);
        reorder(own, &order);
    }
    recording
}

/// Commands keep their stamps, and their values come in the opposite order.
pub fn commands_reversed(mut recording: Recording) -> Recording {
    for own in recording.robots.values_mut() {
        let order: Vec<usize> = (0..stamps(own).len()).rev().collect();
        reorder(own, &order);
    }
    recording
}

fn each_command(own: &mut RobotRecording, change: impl Fn([f64; 2]) -> [f64; 2]) {
    for command in &mut own.commands {
        [command.forward_m_s, command.yaw_rate_rad_s] = change([command.forward_m_s, command.yaw_rate_rad_s]);
    }
    for sample in &mut own.odometry {
        if let Reading::Velocity { forward_m_s, yaw_rate_rad_s } = &mut sample.reading {
            [*forward_m_s, *yaw_rate_rad_s] = change([*forward_m_s, *yaw_rate_rad_s]);
        }
    }
}

fn each_sighting(recording: &mut Recording, change: impl Fn(&mut Relative)) {
    let sightings = recording.robots.values_mut().flat_map(|own| &mut own.sightings);
    for Sample { reading, .. } in sightings {
        if let Reading::Sighting { relative, .. } = reading {
            change(relative);
        }
    }
}

/// When commands were given. Odometry of commands has the same stamps.
fn stamps(own: &RobotRecording) -> Vec<Timestamp> {
    own.commands.iter().map(|command| command.time).collect()
}

/// Puts the values of the commands, and of the odometry that repeats them, into another order.
fn reorder(own: &mut RobotRecording, order: &[usize]) {
    let values: Vec<Command> = order.iter().map(|&index| own.commands[index]).collect();
    for (command, value) in own.commands.iter_mut().zip(&values) {
        *command = Command { time: command.time, ..*value };
    }
    for (sample, value) in own.odometry.iter_mut().zip(&values) {
        if let Reading::Velocity { forward_m_s, yaw_rate_rad_s } = &mut sample.reading {
            (*forward_m_s, *yaw_rate_rad_s) = (value.forward_m_s, value.yaw_rate_rad_s);
        }
    }
}

/// The positions of stamps, block by block in a random order.
#[allow(clippy::float_cmp, reason = "whole numbers")]
fn permuted(stamps: &[Timestamp], block_s: f64, random: &mut impl Rng) -> Vec<usize> {
    let Some(&first) = stamps.first() else { return Vec::new() };
    let block = |time: &Timestamp| (time.seconds_since(first) / block_s).floor();
    let mut blocks: Vec<Range<usize>> = Vec::new();
    for (index, time) in stamps.iter().enumerate() {
        match blocks.last_mut() {
            Some(last) if block(&stamps[last.start]) == block(time) => last.end = index + 1,
            _ => blocks.push(index..index + 1),
        }
    }
    blocks.shuffle(random);
    blocks.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "values that are copied")]

    use super::*;
    use pleiad_estimation::sample::Target;
    use pleiad_estimation::{LandmarkId, RobotId};

    /// Commands 1, 2, ... 100 at 10 Hz, and one sighting.
    fn recording() -> Recording {
        let mut own = RobotRecording::default();
        for index in 0..100 {
            let time = Timestamp::from_seconds(0.1 * f64::from(index));
            let (forward_m_s, yaw_rate_rad_s) = (f64::from(index + 1), -0.5);
            own.commands.push(Command { time, forward_m_s, yaw_rate_rad_s });
            own.push(Sample { time, reading: Reading::Velocity { forward_m_s, yaw_rate_rad_s } });
        }
        let relative = Relative::RangeBearing { range_m: 3.0, bearing_rad: 0.5 };
        let reading = Reading::Sighting { target: Target::Landmark(LandmarkId(6)), relative };
        own.push(Sample { time: Timestamp::from_seconds(1.0), reading });
        Recording { robots: [(RobotId(1), own)].into(), ..Recording::default() }
    }

    fn robot(recording: &Recording) -> &RobotRecording {
        &recording.robots[&RobotId(1)]
    }

    fn speeds(recording: &Recording) -> Vec<f64> {
        robot(recording).commands.iter().map(|command| command.forward_m_s).collect()
    }

    fn odometry(recording: &Recording) -> Vec<f64> {
        let speed = |sample: &Sample| match sample.reading {
            Reading::Velocity { forward_m_s, .. } => Some(forward_m_s),
            _ => None,
        };
        robot(recording).odometry.iter().filter_map(speed).collect()
    }

    fn sighted(recording: &Recording) -> (f64, f64) {
        match robot(recording).sightings[0].reading {
            Reading::Sighting { relative: Relative::RangeBearing { range_m, bearing_rad }, .. } => {
                (range_m, bearing_rad)
            }
            _ => (f64::NAN, f64::NAN),
        }
    }

    #[test]
    fn scaled_commands_are_scaled_in_both_places_and_sightings_are_not() {
        let changed = commands_scaled(recording(), [2.0, 3.0]);
        assert_eq!(speeds(&changed)[..3], [2.0, 4.0, 6.0]);
        assert_eq!(odometry(&changed), speeds(&changed));
        assert_eq!(robot(&changed).commands[7].yaw_rate_rad_s, -1.5);
        assert_eq!(sighted(&changed), (3.0, 0.5));
    }

    #[test]
    fn later_commands_are_later_in_both_places_and_sightings_are_not() {
        let changed = commands_later(recording(), 0.08);
        let own = robot(&changed);
        assert_eq!(own.commands[10].time, Timestamp::from_seconds(1.08));
        assert_eq!(own.odometry[10].time, Timestamp::from_seconds(1.08));
        assert_eq!(own.sightings[0].time, Timestamp::from_seconds(1.0));
    }

    #[test]
    fn bent_bearings_and_biased_ranges_follow_their_formulas() {
        // 0.5 + 0.1 * 0.5 + 0.4 * 0.5^3, to rounding.
        let (range_m, bearing_rad) = sighted(&bearings_bent(recording(), 0.1, 0.4));
        assert!((range_m - 3.0).abs() < 1e-12 && (bearing_rad - 0.6).abs() < 1e-12);
        assert_eq!(sighted(&ranges_biased(recording(), 0.25)), (3.25, 0.5));
    }

    #[test]
    fn permuted_commands_are_whole_blocks_in_another_order() {
        let changed = commands_permuted(recording(), 2.0, 1);
        let values = speeds(&changed);
        assert_eq!(odometry(&changed), values);
        let firsts: Vec<f64> = values.chunks(20).map(|block| block[0]).collect();
        for block in values.chunks(20) {
            assert!(block.windows(2).all(|pair| pair[1] == pair[0] + 1.0), "{block:?}");
        }
        let mut sorted = firsts.clone();
        sorted.sort_by(f64::total_cmp);
        assert_eq!(sorted, [1.0, 21.0, 41.0, 61.0, 81.0]);
        assert_ne!(firsts, sorted);
        assert_eq!(robot(&changed).commands[5].time, Timestamp::from_seconds(0.5));
    }

    #[test]
    fn reversed_commands_come_in_the_opposite_order_at_the_same_times() {
        let changed = commands_reversed(recording());
        assert_eq!(speeds(&changed)[..2], [100.0, 99.0]);
        assert_eq!(odometry(&changed), speeds(&changed));
        assert_eq!(robot(&changed).commands[0].time, Timestamp(0));
    }
}
