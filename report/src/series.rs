//! What a report draws: plain data, whoever made it.

use pleiad_estimation::geometry::wrap_angle;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{LandmarkId, Pose2, RobotId};

use crate::{Accuracy, ReportError};

/// Estimates of a team over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TeamSeries {
    /// One series per robot; their order gives them their colours.
    pub robots: Vec<RobotSeries>,
}

/// Estimates of one robot over time: columns of equal length.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotSeries {
    /// Whose.
    pub robot: RobotId,
    /// Seconds from the start of the run, ascending.
    pub time_s: Vec<f64>,
    /// Estimated `map_from_robot`.
    pub estimate: Vec<Pose2>,
    /// Covariance of the additive error `(x, y, yaw)` in the map frame; m^2, m rad, rad^2.
    pub covariance: Vec<Symmetric3>,
    /// True `map_from_robot` where it is known.
    pub truth: Vec<Option<Pose2>>,
    /// Odometry alone, seconds and `map_from_robot`, on its own instants.
    pub dead_reckoning: Option<Vec<(f64, Pose2)>>,
}

/// A landmark of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Its number.
    pub id: LandmarkId,
    /// Position along x, metres.
    pub x_m: f64,
    /// Position along y, metres.
    pub y_m: f64,
}

/// Normalized innovations squared of observations of one dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct NisSeries {
    /// What was observed, for people: `range and bearing`.
    pub name: String,
    /// Dimension of the innovation, 1 to 6.
    pub degrees_of_freedom: usize,
    /// One point per observation.
    pub points: Vec<NisPoint>,
}

/// The normalized innovation squared of one observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisPoint {
    /// Seconds from the start of the run.
    pub time_s: f64,
    /// `r^T S^-1 r`.
    pub nis: f64,
    /// Whether the filter used it.
    pub used: bool,
}

impl TeamSeries {
    /// Whether the columns of every robot agree in length.
    ///
    /// # Errors
    /// [`ReportError::ColumnLength`] names the first that does not.
    pub fn check(&self) -> Result<(), ReportError> {
        self.robots.iter().try_for_each(RobotSeries::check)
    }

    /// The team's position sigma from `from_s` to `to_s` (both included): the root mean square of the
    /// robots' position sigmas at all instants between, metres. `None` if there is no instant between.
    pub fn position_sigma_m(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let (mut count, mut sum) = (0_u32, 0.0);
        for robot in &self.robots {
            for (time_s, sigma_m) in robot.time_s.iter().zip(robot.position_sigma_m()) {
                if (from_s..=to_s).contains(time_s) {
                    count += 1;
                    sum += sigma_m * sigma_m;
                }
            }
        }
        (count > 0).then(|| (sum / f64::from(count)).sqrt())
    }

    /// Position error against truth, root mean square over robots and instants, metres; `None` without any
    /// truth.
    pub fn position_rmse_m(&self) -> Option<f64> {
        let errors: Vec<[f64; 3]> = self.robots.iter().flat_map(RobotSeries::errors).collect();
        Accuracy::of_errors(&errors).map(|accuracy| accuracy.position_rmse_m)
    }
}

impl RobotSeries {
    fn check(&self) -> Result<(), ReportError> {
        let expected = self.time_s.len();
        let columns = [
            ("estimate", self.estimate.len()),
            ("covariance", self.covariance.len()),
            ("truth", self.truth.len()),
        ];
        match columns.into_iter().find(|&(_, found)| found != expected) {
            Some((column, found)) => {
                Err(ReportError::ColumnLength { robot: self.robot, column, found, expected })
            }
            None => Ok(()),
        }
    }

    /// Position sigma at every instant: `sqrt(P_xx + P_yy)`, the expected distance (root mean square)
    /// between estimated and true position, metres.
    pub fn position_sigma_m(&self) -> Vec<f64> {
        self.covariance.iter().map(|p| (p.0[0] + p.0[2]).sqrt()).collect()
    }

    /// Estimate minus truth in the map frame, `[x m, y m, yaw rad]`, yaw wrapped; not finite where the
    /// truth is unknown.
    pub fn errors(&self) -> Vec<[f64; 3]> {
        let error = |(estimate, truth): (&Pose2, &Option<Pose2>)| match truth {
            Some(truth) => [
                estimate.x_m() - truth.x_m(),
                estimate.y_m() - truth.y_m(),
                wrap_angle(estimate.yaw_rad() - truth.yaw_rad()),
            ],
            None => [f64::NAN; 3],
        };
        self.estimate.iter().zip(&self.truth).map(error).collect()
    }

    /// Root mean square errors against truth; `None` without any truth.
    pub fn accuracy(&self) -> Option<Accuracy> {
        Accuracy::of_errors(&self.errors())
    }

    /// Length of the path between known true positions, metres; `None` without any truth.
    pub fn true_distance_m(&self) -> Option<f64> {
        let known: Vec<&Pose2> = self.truth.iter().flatten().collect();
        (!known.is_empty())
            .then(|| known.windows(2).map(|pair| (pair[1].position() - pair[0].position()).norm()).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_column_that_differs_is_named() {
        let mut robot = RobotSeries {
            robot: RobotId(4),
            time_s: vec![0.0, 1.0],
            estimate: vec![Pose2::identity(); 2],
            covariance: vec![Symmetric3::zero(); 2],
            truth: vec![None; 2],
            dead_reckoning: None,
        };
        assert!(robot.check().is_ok());
        robot.covariance.pop();
        let message = robot.check().unwrap_err().to_string();
        assert!(message.contains("robot 4") && message.contains("`covariance` has 1"), "{message}");
    }

    #[test]
    fn distance_and_sigma_follow_their_definitions() {
        let at = |x, y| Pose2::new(x, y, 0.0);
        let robot = RobotSeries {
            robot: RobotId(1),
            time_s: vec![0.0, 1.0, 2.0],
            estimate: vec![at(0.0, 0.0); 3],
            covariance: vec![Symmetric3::diagonal(9.0, 16.0, 1.0); 3],
            truth: vec![Some(at(0.0, 0.0)), Some(at(3.0, 4.0)), Some(at(3.0, 5.0))],
            dead_reckoning: None,
        };
        assert_eq!(robot.position_sigma_m(), [5.0; 3]);
        assert!((robot.true_distance_m().unwrap() - 6.0).abs() < 1e-12);
        let mut other = robot.clone();
        other.covariance[2] = Symmetric3::diagonal(1.0, 0.0, 1.0);
        let team = TeamSeries { robots: vec![robot, other] };
        // sqrt((25 + 25 + 25 + 1) / 4)
        assert!((team.position_sigma_m(1.0, 2.0).unwrap() - 19.0_f64.sqrt()).abs() < 1e-12);
        assert!(team.position_sigma_m(2.5, 9.0).is_none());
        // Distances 0, 5, sqrt(34), twice.
        assert!((team.position_rmse_m().unwrap() - (59.0_f64 / 3.0).sqrt()).abs() < 1e-12);
    }
}
