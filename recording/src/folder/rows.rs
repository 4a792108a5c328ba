//! Channels as rows of numbers in the order of their columns, in both directions: what csv files, messages of an MCAP
//! file and mapped topics have in common. Sightings, which name a target, are apart.

use pleiad_estimation::sample::{Reading, Sample};
use pleiad_estimation::{Pose2, Timestamp};

use super::{
    COMMAND, Channel, GPS, GYRO, HEADING, INCREMENT, ODOMETRY, RELATIVE, SCAN, STEER, TRUTH, VELOCITY, WHEELS,
};
use crate::number::time_text;
use crate::tidy::Stamped;
use crate::types::{BeamSample, Command, RobotRecording, SteerSample, TruthSample};

/// A channel that was found in order.
pub(crate) struct Rows<'a> {
    /// Which.
    pub(crate) channel: Channel,
    /// Stamps of its rows.
    pub(crate) times: Vec<Timestamp>,
    numbers: Box<dyn Fn(usize) -> Option<Vec<f64>> + 'a>,
}

impl Rows<'_> {
    /// The numbers of a row, one per column after the stamp, all finite.
    pub(crate) fn numbers(&self, row: usize) -> Result<Vec<f64>, String> {
        let time = self.times.get(row).copied().unwrap_or_default();
        let numbers = (self.numbers)(row).ok_or_else(|| foreign(self.channel, time))?;
        match numbers.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(at(self.channel, time, &format!("the number {value} is not finite"))),
            None => Ok(numbers),
        }
    }
}

/// The channels of `robot` that have rows, but for sightings.
///
/// # Errors
/// No odometry, or rows out of order.
pub(crate) fn channels(robot: &RobotRecording) -> Result<Vec<Rows<'_>>, String> {
    let odometry = match robot.odometry.first().map(|sample| sample.reading) {
        None => return Err("odometry: none, and a recording without it cannot be read back".to_owned()),
        Some(Reading::Velocity { .. }) => VELOCITY,
        Some(Reading::Increment(_)) => INCREMENT,
        Some(_) => WHEELS,
    };
    let mut all = vec![
        rows(COMMAND, &robot.commands, |command| Some(vec![command.forward_m_s, command.yaw_rate_rad_s]))?,
        rows(odometry, &robot.odometry, move |sample| numbers_of(odometry, sample))?,
        rows(GYRO, &robot.gyro, |sample| numbers_of(GYRO, sample))?,
        rows(GPS, &robot.gps, |sample| numbers_of(GPS, sample))?,
        rows(HEADING, &robot.heading, |sample| numbers_of(HEADING, sample))?,
        rows(STEER, &robot.steer, |steer| Some(vec![steer.angle_rad]))?,
        rows(SCAN, &robot.scans, |beam| Some(vec![beam.bearing_rad, beam.range_m]))?,
        rows(TRUTH, &robot.truth, |truth| {
            Some(vec![truth.pose.x_m(), truth.pose.y_m(), truth.pose.yaw_rad()])
        })?,
    ];
    all.retain(|rows| !rows.times.is_empty());
    Ok(all)
}

fn rows<'a, T: Stamped>(
    channel: Channel,
    all: &'a [T],
    numbers: impl Fn(&T) -> Option<Vec<f64>> + 'a,
) -> Result<Rows<'a>, String> {
    check_order(channel, all)?;
    let times = all.iter().map(Stamped::time).collect();
    Ok(Rows { channel, times, numbers: Box::new(move |row| numbers(all.get(row)?)) })
}

/// The numbers of a sample if it belongs to `channel`.
fn numbers_of(channel: Channel, sample: &Sample) -> Option<Vec<f64>> {
    let (of, numbers) = match sample.reading {
        Reading::Velocity { forward_m_s, yaw_rate_rad_s } => (VELOCITY, vec![forward_m_s, yaw_rate_rad_s]),
        Reading::Wheels { left_rad, right_rad } => (WHEELS, vec![left_rad, right_rad]),
        Reading::Increment(pose) => (INCREMENT, vec![pose.x_m(), pose.y_m(), pose.yaw_rad()]),
        Reading::Gyro { yaw_rate_rad_s } => (GYRO, vec![yaw_rate_rad_s]),
        Reading::Gps { x_m, y_m } => (GPS, vec![x_m, y_m]),
        Reading::Heading { heading_rad } => (HEADING, vec![heading_rad]),
        Reading::Sighting { .. } => return None,
    };
    (of == channel).then_some(numbers)
}

/// Appends a row to `channel` of `robot`.
///
/// # Errors
/// What was expected in place of these numbers.
pub(crate) fn insert(
    robot: &mut RobotRecording,
    channel: Channel,
    time: Timestamp,
    numbers: &[f64],
) -> Result<(), String> {
    if let Some(at) = numbers.iter().position(|value| !value.is_finite()) {
        let name = channel.columns.get(at + 1).copied().unwrap_or_default();
        return Err(format!("a finite number for `{name}`, not {}", numbers[at]));
    }
    let reading = match (channel.name, numbers) {
        (name, &[forward_m_s, yaw_rate_rad_s]) if name == COMMAND.name => {
            robot.commands.push(Command { time, forward_m_s, yaw_rate_rad_s });
            return Ok(());
        }
        (name, &[angle_rad]) if name == STEER.name => {
            robot.steer.push(SteerSample { time, angle_rad });
            return Ok(());
        }
        (name, &[bearing_rad, range_m]) if name == SCAN.name => {
            if range_m <= 0.0 {
                return Err("a range above 0; a beam that met nothing has no row".to_owned());
            }
            robot.scans.push(BeamSample { time, bearing_rad, range_m });
            return Ok(());
        }
        (name, &[x, y, yaw]) if name == TRUTH.name => {
            robot.truth.push(TruthSample { time, pose: Pose2::new(x, y, yaw) });
            return Ok(());
        }
        (name, &[forward_m_s, yaw_rate_rad_s]) if name == VELOCITY.name => {
            Reading::Velocity { forward_m_s, yaw_rate_rad_s }
        }
        (name, &[left_rad, right_rad]) if name == WHEELS.name => Reading::Wheels { left_rad, right_rad },
        (name, &[x, y, yaw]) if name == INCREMENT.name => Reading::Increment(Pose2::new(x, y, yaw)),
        (name, &[yaw_rate_rad_s]) if name == GYRO.name => Reading::Gyro { yaw_rate_rad_s },
        (name, &[x_m, y_m]) if name == GPS.name => Reading::Gps { x_m, y_m },
        (name, &[heading_rad]) if name == HEADING.name => Reading::Heading { heading_rad },
        _ => {
            let columns = channel.columns.join(", ");
            return Err(format!("the numbers {columns} of channel {}, not {}", channel.name, numbers.len()));
        }
    };
    robot.push(Sample { time, reading });
    Ok(())
}

/// The kinds of odometry that `robot` has; a robot has one.
pub(crate) fn odometry_kinds(robot: &RobotRecording) -> Vec<&'static str> {
    let has = |channel: &Channel| robot.odometry.iter().any(|sample| numbers_of(*channel, sample).is_some());
    ODOMETRY.iter().filter(|channel| has(channel)).map(|channel| channel.name).collect()
}

/// Sightings in order, each with its target and measurement.
pub(crate) fn sightings(
    samples: &[Sample],
) -> Result<Vec<(Timestamp, pleiad_estimation::sample::Target, pleiad_estimation::sample::Relative)>, String>
{
    check_order(RELATIVE, samples)?;
    let of = |sample: &Sample| match sample.reading {
        Reading::Sighting { target, relative } => Ok((sample.time, target, relative)),
        _ => Err(foreign(RELATIVE, sample.time)),
    };
    samples.iter().map(of).collect()
}

fn check_order<T: Stamped>(channel: Channel, rows: &[T]) -> Result<(), String> {
    match rows.windows(2).find(|pair| pair[1].time() < pair[0].time()) {
        Some(pair) => Err(at(channel, pair[1].time(), "stamped before the row in front of it")),
        None => Ok(()),
    }
}

fn foreign(channel: Channel, time: Timestamp) -> String {
    at(channel, time, "a reading of another channel")
}

/// A message about a row that cannot be written.
pub(crate) fn at(channel: Channel, time: Timestamp, what: &str) -> String {
    format!("{} at {} s: {what}", channel.name, time_text(time))
}
