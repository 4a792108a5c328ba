//! Errors against what the filter believes of them.

use crate::{Axis, Colour, Figure, Panel, ReportError, RobotSeries, TeamSeries, Trace};

/// Share of three-sigma bounds of all instants that decides the scale: the few instants before the
/// first absolute observation, where the bounds may be huge, would otherwise flatten everything else.
const SCALE_QUANTILE: f64 = 0.9;

const COMPONENTS: [(&str, &str); 3] = [("x error", "m"), ("y error", "m"), ("yaw error", "rad")];

/// One panel per robot with known truth: error of x, y (metres, map frame) and yaw (radians) over
/// time within the filter's own three-sigma bounds. All panels have the same scales. The heading says
/// how many of the errors lie within the bounds.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length.
pub fn error_figures(team: &TeamSeries) -> Result<Vec<Panel>, ReportError> {
    team.check()?;
    let known: Vec<(usize, &RobotSeries)> =
        team.robots.iter().enumerate().filter(|(_, robot)| robot.truth.iter().any(Option::is_some)).collect();
    let limits: [f64; 3] = std::array::from_fn(|component| {
        known.iter().map(|(_, robot)| limit(robot, component)).fold(0.0, f64::max)
    });
    Ok(known.into_iter().map(|(index, robot)| panel(robot, Colour::Series(index), limits)).collect())
}

/// Share of all error components `(x, y, heading)` with known truth that lie within three sigma, from 0 to
/// 1; a consistent Gaussian filter has 0.9973. `None` without any truth.
pub fn share_within_three_sigma(robot: &RobotSeries) -> Option<f64> {
    let (mut inside, mut all) = (0_u32, 0_u32);
    for (error, covariance) in robot.errors().iter().zip(&robot.covariance) {
        for (component, error) in error.iter().enumerate().filter(|(_, error)| error.is_finite()) {
            all += 1;
            inside += u32::from(error.abs() <= 3.0 * variance(covariance.0, component).sqrt());
        }
    }
    (all > 0).then(|| f64::from(inside) / f64::from(all))
}

fn panel(robot: &RobotSeries, colour: Colour, limits: [f64; 3]) -> Panel {
    let axis = |component: usize| {
        let (quantity, unit) = COMPONENTS[component];
        Axis::new(quantity, unit).range(-limits[component], limits[component])
    };
    let mut figure = Figure::new(Axis::new("time", "s"), axis(0)).row(axis(1)).row(axis(2)).height(470);
    let errors = robot.errors();
    for component in 0..3 {
        let bound = three_sigma(robot, component);
        let below: Vec<f64> = bound.iter().map(|bound| -bound).collect();
        let error: Vec<f64> = errors.iter().map(|error| error[component]).collect();
        figure = figure
            .trace(
                Trace::band("three sigma", &robot.time_s, &below, &bound, Colour::Muted)
                    .unlisted()
                    .in_row(component),
            )
            .trace(
                Trace::line("error", &robot.time_s, &error, colour).width(1.25).unlisted().in_row(component),
            );
    }
    let share = share_within_three_sigma(robot)
        .map_or(String::new(), |share| format!(": {:.1} % within 3σ", 100.0 * share));
    Panel { heading: format!("Robot {}{share}", robot.robot), figure }
}

fn three_sigma(robot: &RobotSeries, component: usize) -> Vec<f64> {
    robot.covariance.iter().map(|covariance| 3.0 * variance(covariance.0, component).sqrt()).collect()
}

/// The largest value that the panels show: every error, and nine in ten of the bounds.
fn limit(robot: &RobotSeries, component: usize) -> f64 {
    let errors = robot.errors();
    let largest =
        errors.iter().map(|error| error[component].abs()).filter(|e| e.is_finite()).fold(0.0, f64::max);
    let mut bounds = three_sigma(robot, component);
    bounds.retain(|bound| bound.is_finite());
    bounds.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let quantile = bounds.get((bounds.len() as f64 * SCALE_QUANTILE) as usize).copied().unwrap_or(0.0);
    1.1 * largest.max(quantile)
}

fn variance([xx, _, yy, _, _, yaw]: [f64; 6], component: usize) -> f64 {
    [xx, yy, yaw][component]
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::symmetric::Symmetric3;
    use pleiad_estimation::{Pose2, RobotId};

    use super::*;

    #[test]
    fn the_share_within_three_sigma_counts_components() {
        // Of two instants times three components, only the first x error (4 sigma) is outside.
        let robot = RobotSeries {
            robot: RobotId(1),
            time_s: vec![0.0, 1.0, 2.0],
            estimate: vec![Pose2::new(0.4, 0.0, 0.0), Pose2::new(0.1, 0.0, 0.0), Pose2::identity()],
            covariance: vec![Symmetric3::diagonal(0.01, 0.01, 0.01); 3],
            truth: vec![Some(Pose2::identity()), Some(Pose2::identity()), None],
            dead_reckoning: None,
        };
        let share = share_within_three_sigma(&robot).unwrap();
        assert!((share - 5.0 / 6.0).abs() < 1e-12);
    }
}
