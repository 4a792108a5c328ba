//! How sure every robot is of its position, over time.

use super::robot_name;
use crate::{Axis, Colour, Dash, Figure, ReportError, TeamSeries, Trace, quantity};

/// Position sigma of every robot in every case on one axis: colour tells the robot, line pattern the case.
///
/// Position sigma is `sqrt(P_xx + P_yy)`: by the filter's own account, the root mean square distance
/// between estimated and true position, in metres. The root mean square over the robots at the end of
/// each case is written beside its curves.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length.
pub fn sigma_figure(cases: &[(&str, &TeamSeries)]) -> Result<Figure, ReportError> {
    let mut figure =
        Figure::new(Axis::new("time", "s"), Axis::new("position sigma", "m").from_zero()).height(460);
    for (case_index, (case, team)) in cases.iter().enumerate() {
        team.check()?;
        let dash = if cases.len() == 1 { Dash::Solid } else { Dash::of_case(case_index) };
        let mut ends = Vec::new();
        for (index, robot) in team.robots.iter().enumerate() {
            let sigma = robot.position_sigma_m();
            if let (Some(&time), Some(&last)) = (robot.time_s.last(), sigma.last()) {
                ends.push((time, last));
            }
            let mut trace =
                Trace::line(&robot_name(robot.robot), &robot.time_s, &sigma, Colour::Series(index))
                    .dash(dash);
            if cases.len() > 1 {
                trace = trace.group(case).group_heading(case);
            }
            figure = figure.trace(trace);
        }
        if cases.len() > 1 && !ends.is_empty() {
            let mean_square = ends.iter().map(|(_, sigma)| sigma * sigma).sum::<f64>() / ends.len() as f64;
            let time = ends.iter().map(|&(time, _)| time).fold(f64::NEG_INFINITY, f64::max);
            let top = ends.iter().map(|&(_, sigma)| sigma).fold(f64::NEG_INFINITY, f64::max);
            figure = figure.note(time, top, &format!("{case}: {}", quantity(mean_square.sqrt(), "m")));
        }
    }
    Ok(figure)
}
