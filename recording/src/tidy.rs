//! Puts a channel into the order a recording promises, and counts what had to be done for it.

use pleiad_estimation::Timestamp;
use pleiad_estimation::sample::{Reading, Relative, Sample};

use crate::report::{FileReport, Gaps};
use crate::types::{BeamSample, Command, RobotRecording, SteerSample, TruthSample};

/// A row with a stamp.
pub(crate) trait Stamped: Copy + PartialEq {
    /// Its stamp.
    fn time(&self) -> Timestamp;

    /// Whether it takes the same place as `other` at the same stamp, so that only one can be right.
    fn same_place(&self, _other: &Self) -> bool {
        true
    }
}

impl Stamped for Command {
    fn time(&self) -> Timestamp {
        self.time
    }
}

impl Stamped for SteerSample {
    fn time(&self) -> Timestamp {
        self.time
    }
}

impl Stamped for TruthSample {
    fn time(&self) -> Timestamp {
        self.time
    }
}

impl Stamped for BeamSample {
    fn time(&self) -> Timestamp {
        self.time
    }

    /// A scan has one beam in a direction.
    fn same_place(&self, other: &Self) -> bool {
        self.bearing_rad.to_bits() == other.bearing_rad.to_bits()
    }
}

impl Stamped for Sample {
    fn time(&self) -> Timestamp {
        self.time
    }

    /// Several targets may be seen at once, and one target's range and bearing by different sensors.
    fn same_place(&self, other: &Self) -> bool {
        match (self.reading, other.reading) {
            (
                Reading::Sighting { target: a, relative: a_is },
                Reading::Sighting { target: b, relative: b_is },
            ) => a == b && relative_rank(&a_is) == relative_rank(&b_is),
            _ => true,
        }
    }
}

fn relative_rank(relative: &Relative) -> u8 {
    match relative {
        Relative::Pose(_) => 0,
        Relative::Position { .. } => 1,
        Relative::Range { .. } => 2,
        Relative::Bearing { .. } => 3,
        Relative::RangeBearing { .. } => 4,
    }
}

/// Sorts `rows` by stamp (stably), drops what repeats a stamp, and enters everything into `report`.
pub(crate) fn tidy<T: Stamped>(rows: &mut Vec<T>, report: &mut FileReport) {
    report.out_of_order = rows.windows(2).filter(|pair| pair[1].time() < pair[0].time()).count();
    if report.out_of_order > 0 {
        rows.sort_by_key(Stamped::time);
    }
    let mut kept = 0;
    let mut stamp_begins = 0;
    for index in 0..rows.len() {
        let row = rows[index];
        if kept > 0 && rows[kept - 1].time() != row.time() {
            stamp_begins = kept;
        }
        match rows[stamp_begins..kept].iter().find(|earlier| earlier.same_place(&row)) {
            Some(earlier) if *earlier == row => report.duplicates += 1,
            Some(_) => report.conflicts += 1,
            None => {
                rows[kept] = row;
                kept += 1;
            }
        }
    }
    rows.truncate(kept);
    report.kept = kept;
    report.gaps = gaps(rows);
}

/// Tidies every channel of `robot`, each into the report that `reports` has for it by the channel's name.
pub(crate) fn tidy_robot(robot: &mut RobotRecording, reports: Vec<(&str, &mut FileReport)>) {
    for (name, report) in reports {
        match name {
            "command" => tidy(&mut robot.commands, report),
            "gyro" => tidy(&mut robot.gyro, report),
            "gps" => tidy(&mut robot.gps, report),
            "heading" => tidy(&mut robot.heading, report),
            "relative" => tidy(&mut robot.sightings, report),
            "steer" => tidy(&mut robot.steer, report),
            "scan" => tidy(&mut robot.scans, report),
            "truth" => tidy(&mut robot.truth, report),
            _ => tidy(&mut robot.odometry, report),
        }
    }
}

fn gaps<T: Stamped>(sorted: &[T]) -> Gaps {
    let pauses = || {
        let pairs =
            sorted.windows(2).map(|pair| (pair[0].time(), pair[1].time().0.saturating_sub(pair[0].time().0)));
        pairs.filter(|(_, nanos)| *nanos > 0)
    };
    let mut periods: Vec<i64> = pauses().map(|(_, nanos)| nanos).collect();
    if periods.len() < 2 {
        return Gaps::default();
    }
    let middle = periods.len() / 2;
    let median = *periods.select_nth_unstable(middle).1;
    let mut gaps = Gaps { median_period_s: Some(Timestamp(median).seconds()), ..Gaps::default() };
    for (at, nanos) in pauses() {
        if nanos as f64 > Gaps::FACTOR * median as f64 {
            gaps.count += 1;
            let seconds = Timestamp(nanos).seconds();
            if seconds > gaps.largest_s {
                (gaps.largest_s, gaps.at) = (seconds, Some(at));
            }
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::sample::Target;
    use pleiad_estimation::{LandmarkId, RobotId};

    use super::*;

    fn command(millis: i64, forward_m_s: f64) -> Command {
        Command { time: Timestamp(millis * 1_000_000), forward_m_s, yaw_rate_rad_s: 0.0 }
    }

    fn tidied<T: Stamped>(rows: &[T]) -> (Vec<T>, FileReport) {
        let mut rows = rows.to_vec();
        let mut report = FileReport::new("channel");
        tidy(&mut rows, &mut report);
        (rows, report)
    }

    #[test]
    fn a_clean_channel_passes_unchanged_with_nothing_counted() {
        let rows: Vec<Command> = (0..50).map(|i| command(20 * i, 0.5)).collect();
        let (kept, report) = tidied(&rows);
        assert_eq!(kept, rows);
        assert_eq!((report.duplicates, report.conflicts, report.out_of_order), (0, 0, 0));
        assert_eq!((report.gaps.count, report.gaps.at), (0, None));
        assert_eq!(report.gaps.median_period_s, Some(0.02));
    }

    #[test]
    fn rows_out_of_order_are_sorted_and_counted() {
        let (kept, report) = tidied(&[command(0, 0.0), command(40, 2.0), command(20, 1.0), command(60, 3.0)]);
        assert_eq!(kept, [command(0, 0.0), command(20, 1.0), command(40, 2.0), command(60, 3.0)]);
        assert_eq!(report.out_of_order, 1);
    }

    #[test]
    fn an_identical_row_is_a_duplicate_and_a_different_one_a_conflict() {
        let (kept, report) = tidied(&[command(0, 0.1), command(0, 0.1), command(0, 0.2), command(20, 0.2)]);
        assert_eq!(kept, [command(0, 0.1), command(20, 0.2)]);
        assert_eq!((report.duplicates, report.conflicts), (1, 1));
    }

    #[test]
    fn sightings_share_a_stamp_unless_of_one_target_and_kind() {
        let seen =
            |target, relative| Sample { time: Timestamp(0), reading: Reading::Sighting { target, relative } };
        let robot = Target::Robot(RobotId(2));
        let landmark = Target::Landmark(LandmarkId(2));
        let rows = [
            seen(robot, Relative::Range { range_m: 1.0 }),
            seen(landmark, Relative::Range { range_m: 1.0 }),
            seen(robot, Relative::Bearing { bearing_rad: 1.0 }),
            seen(robot, Relative::Range { range_m: 1.0 }),
            seen(landmark, Relative::Range { range_m: 2.0 }),
        ];
        let (kept, report) = tidied(&rows);
        assert_eq!(kept, rows[..3]);
        assert_eq!((report.duplicates, report.conflicts), (1, 1));
    }

    #[test]
    fn a_gap_is_longer_than_five_median_periods() {
        // Periods 20 ms but for one of exactly five periods, which is none, and two longer ones.
        let mut millis = vec![0, 20, 40, 60, 80, 180, 200, 220, 321, 341, 361, 1361];
        millis.extend((1..20).map(|i| 1361 + 20 * i));
        let rows: Vec<Command> = millis.into_iter().map(|at| command(at, 0.5)).collect();
        let gaps = tidied(&rows).1.gaps;
        assert_eq!((gaps.count, gaps.largest_s, gaps.at), (2, 1.0, Some(Timestamp(361_000_000))));
    }
}
