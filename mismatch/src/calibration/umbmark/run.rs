//! One run of the procedure: what a recording shows, and whether it can be used.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::sample::Sample;
use pleiad_estimation::{Pose2, RobotId};
use pleiad_physics::{Drive, Pose, RobotModel};
use pleiad_recording::Recording;
use serde::Serialize;

use super::corrected::with_factors;
use super::error::UmbmarkError;
use super::factors::WheelFactors;
use crate::calibration::reckoned::{Reckoned, reckon};

/// Shorter than this a square is too small against the errors of a measured pose, metres around.
const LEAST_AROUND_M: f64 = 2.0;
/// A straight run is at least so long, metres, and turned by no more than this, radians.
const LEAST_STRAIGHT_M: f64 = 1.0;
const STRAIGHT_RAD: f64 = 0.35;
/// A turn on the spot is at least so wide, radians, and comes no farther from its start than this, metres.
const LEAST_TURN_RAD: f64 = FRAC_PI_2;
const ON_THE_SPOT_M: f64 = 0.1;
/// A square turns by four corners, or by three if the run ends at the last side: between these, radians.
const CORNERS_RAD: [f64; 2] = [1.25 * PI, 2.4 * PI];
/// Return errors and corners may be off by this share of the side: errors of the formulas grow with its square.
const CLOSES_WITHIN: f64 = 0.5;
const CORNER_WITHIN: f64 = 0.4;
/// Driven before the first or after the last true pose at most, metres: it would be taken for an error.
const UNSEEN_M: f64 = 0.02;

/// A sense of turning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Turning {
    /// To the left.
    CounterClockwise,
    /// To the right.
    Clockwise,
}

impl Turning {
    /// +1 to the left, -1 to the right.
    pub fn sign(self) -> f64 {
        match self {
            Self::CounterClockwise => 1.0,
            Self::Clockwise => -1.0,
        }
    }

    /// The opposite sense.
    pub fn other(self) -> Self {
        match self {
            Self::CounterClockwise => Self::Clockwise,
            Self::Clockwise => Self::CounterClockwise,
        }
    }
}

impl fmt::Display for Turning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::CounterClockwise => "counter-clockwise",
            Self::Clockwise => "clockwise",
        })
    }
}

/// What was driven, by odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A square with sides of this length, metres.
    Square {
        /// In which direction.
        turning: Turning,
        /// Length of a side, metres.
        side_m: f64,
    },
    /// A straight line.
    Straight,
    /// A turn on the spot.
    Turn,
}

/// One run: odometry, and the true pose at its start and end. Truth in between is not looked at.
#[derive(Clone, Debug)]
pub struct Run {
    /// The recording it came from.
    pub recording: String,
    /// What was driven.
    pub kind: Kind,
    /// The robot as the recording declares it.
    pub model: RobotModel<f64>,
    odometry: Vec<Sample>,
    /// Start to end, in the frame of the start.
    truth: Pose2,
}

impl Run {
    /// The run of a robot in a recording.
    ///
    /// # Errors
    /// [`UmbmarkError::NoRun`]: there is no odometry, no true pose at start and end or no model of the robot; or what was
    /// driven is neither a square that closes nor a straight line nor a turn on the spot.
    pub fn of(recording: &Recording, robot: RobotId) -> Result<Self, UmbmarkError> {
        let refused = |found: String, expected: &str| UmbmarkError::NoRun {
            recording: format!("recording `{}`, robot {robot}", recording.name),
            found,
            expected: expected.to_owned(),
        };
        let Some(own) = recording.robots.get(&robot) else {
            return Err(refused("found no channel of it".to_owned(), "name a robot that recorded"));
        };
        let Some(model) = recording.nominal.as_ref().and_then(|nominal| nominal.model(robot)) else {
            return Err(refused(
                "found no nominal model of it".to_owned(),
                "write wheel_radius and track_width into the section of the robot in nominal.toml",
            ));
        };
        if let Drive::CarLike { .. } = model.drive {
            return Err(refused(
                "found drive = \"car_like\"".to_owned(),
                "UMBmark is for robots that turn on the spot; use `pleiad diagnose`",
            ));
        }
        let path = reckon(&own.odometry, &model);
        let ([_, .., _], Some(last)) = (path.as_slice(), path.last()) else {
            return Err(refused(
                format!("found {} samples of odometry", path.len()),
                "record wheel_odometry.csv, velocity.csv or increment.csv over the whole run",
            ));
        };
        let ([begun, .., ended], true) = (own.truth.as_slice(), own.truth.len() > 1) else {
            return Err(refused(
                format!("found {} true poses in truth.csv", own.truth.len()),
                "measure the pose at the start and at the end, and write both rows",
            ));
        };
        let before_m = path.iter().rev().find(|at| at.time <= begun.time).map_or(0.0, |at| at.path_m);
        let after_m = path.iter().find(|at| at.time >= ended.time).map_or(0.0, |at| last.path_m - at.path_m);
        if before_m.max(after_m) > UNSEEN_M {
            return Err(refused(
                format!(
                    "found {before_m:.3} m driven before the first true pose and {after_m:.3} m after the last"
                ),
                "measure the poses at standstill, before the start and after the end, with stamps of the same clock",
            ));
        }
        let kind = kind(&path, last).map_err(|(found, expected)| refused(found, expected))?;
        let truth = begun.pose.between(&ended.pose);
        if let Kind::Square { side_m, .. } = kind {
            let away_m = truth.x_m().hypot(truth.y_m());
            let reckoned_m = last.pose.x_m.hypot(last.pose.y_m);
            if away_m.max(reckoned_m) > CLOSES_WITHIN * side_m {
                return Err(refused(
                    format!(
                        "found the end {away_m:.2} m from the start by truth and {reckoned_m:.2} m by odometry, with \
                         sides of {side_m:.2} m"
                    ),
                    "a run has to come back to its start, within half a side: drive the whole square, or correct \
                     wheel_radius and track_width in nominal.toml",
                ));
            }
        }
        Ok(Self { recording: recording.name.clone(), kind, model, odometry: own.odometry.clone(), truth })
    }

    /// The robot's wheels are no part of the model it was declared with.
    pub(super) fn reckoned(&self, factors: WheelFactors) -> Reckoned {
        let model = with_factors(&self.model, factors);
        reckon(&self.odometry, &model).last().copied().unwrap_or(Reckoned {
            time: pleiad_estimation::Timestamp(0),
            pose: Pose::identity(),
            path_m: 0.0,
        })
    }

    /// The motion from start to end by truth.
    pub fn truth(&self) -> Pose2 {
        self.truth
    }

    /// The angle truly turned, taken for the one nearest to what odometry says; `None` for other than turns.
    pub(super) fn turned_rad(&self, reckoned_rad: f64) -> Option<f64> {
        let Kind::Turn = self.kind else { return None };
        Some(reckoned_rad + wrap_angle(self.truth.yaw_rad() - reckoned_rad))
    }
}

/// What was driven; or what was found, and what was expected.
fn kind(path: &[Reckoned], last: &Reckoned) -> Result<Kind, (String, &'static str)> {
    let turned_rad = last.pose.yaw_rad;
    let greatest = |of: fn(&Reckoned) -> f64| path.iter().map(of).fold(0.0, f64::max);
    if greatest(|at| at.pose.x_m.hypot(at.pose.y_m)) < ON_THE_SPOT_M && turned_rad.abs() >= LEAST_TURN_RAD {
        return Ok(Kind::Turn);
    }
    if greatest(|at| at.pose.yaw_rad.abs()) < STRAIGHT_RAD && last.path_m >= LEAST_STRAIGHT_M {
        return Ok(Kind::Straight);
    }
    if last.path_m < LEAST_AROUND_M {
        return Err((
            format!(
                "found a path of {:.2} m that turns by {:.0} degrees",
                last.path_m,
                turned_rad.to_degrees()
            ),
            "a square is at least 2 m around (4 m a side in the original), a straight line 1 m, a turn on the spot 90 \
             degrees wide: drive one of them",
        ));
    }
    if !(CORNERS_RAD[0]..=CORNERS_RAD[1]).contains(&turned_rad.abs()) {
        return Err((
            format!("found a net turn of {:.0} degrees", turned_rad.to_degrees()),
            "one lap of a square turns by 360 degrees (270 if it ends at the last side): give each lap as a recording of \
             its own, and nothing else in it",
        ));
    }
    let turning = if turned_rad > 0.0 { Turning::CounterClockwise } else { Turning::Clockwise };
    let side_m = 0.25 * last.path_m;
    let corners = [[1.0, 0.0], [1.0, turning.sign()], [0.0, turning.sign()]];
    for (number, [x, y]) in (1_u8..).zip(corners) {
        let driven_m = f64::from(number) * side_m;
        let Some(at) = path.iter().find(|at| at.path_m >= driven_m) else { continue };
        let [x_m, y_m] = [at.pose.x_m, at.pose.y_m];
        if (x_m - x * side_m).hypot(y_m - y * side_m) > CORNER_WITHIN * side_m {
            return Err((
                format!(
                    "found the robot at ({x_m:.2}, {y_m:.2}) m after {driven_m:.2} m of {:.2} m",
                    last.path_m
                ),
                "a run starts at a corner, drives the first side straight ahead and turns on the spot at corners; all \
                 sides have the same length",
            ));
        }
    }
    Ok(Kind::Square { turning, side_m })
}
