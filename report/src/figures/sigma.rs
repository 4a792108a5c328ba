//! How sure every robot is of its position, over time.

use std::collections::BTreeSet;

use super::robot_name;
use crate::{Axis, Colour, Dash, Figure, ReportError, TeamSeries, Trace, quantity};

/// Position sigma of every robot in every case on one axis: colour tells the robot, line pattern the case
/// ([`sigma_patterns`] says which).
///
/// Position sigma is `sqrt(P_xx + P_yy)`: by the filter's own account, the root mean square distance
/// between estimated and true position, in metres. With several cases, the root mean square over the
/// robots at the end of each is written beside its curves.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length.
pub fn sigma_figure(cases: &[(&str, &TeamSeries)]) -> Result<Figure, ReportError> {
    let mut figure =
        Figure::new(Axis::new("time", "s"), Axis::new("position sigma", "m").from_zero()).height(460);
    let robots: BTreeSet<_> =
        cases.iter().flat_map(|(_, team)| &team.robots).map(|robot| robot.robot).collect();
    let colours: Vec<_> = robots.into_iter().collect();
    // The legend names every robot once, with the solid line where there is one.
    let mut order: Vec<usize> = (0..cases.len()).collect();
    order.sort_by_key(|&index| dash_of(index, cases.len()) != Dash::Solid);
    let mut listed = BTreeSet::new();
    for index in order {
        let (case, team) = cases[index];
        team.check()?;
        let mut ends = Vec::new();
        for robot in &team.robots {
            let sigma = robot.position_sigma_m();
            ends.extend(robot.time_s.last().copied().zip(sigma.last().copied()));
            let name = robot_name(robot.robot);
            let colour = Colour::Series(colours.iter().position(|&id| id == robot.robot).unwrap_or_default());
            let label = if cases.len() > 1 { format!("{name}, {case}") } else { name.clone() };
            let trace = Trace::line(&name, &robot.time_s, &sigma, colour).hover_name(&label);
            let trace = trace.dash(dash_of(index, cases.len())).group(&name);
            figure = figure.trace(if listed.insert(robot.robot) { trace } else { trace.unlisted() });
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

/// Which line pattern stands for which case in [`sigma_figure`]: `dashed: relative only; solid: with GPS`.
pub fn sigma_patterns(cases: &[(&str, &TeamSeries)]) -> String {
    let pattern = |(index, (case, _)): (usize, &(&str, &TeamSeries))| {
        format!("{}: {case}", dash_of(index, cases.len()).word())
    };
    cases.iter().enumerate().map(pattern).collect::<Vec<_>>().join("; ")
}

fn dash_of(index: usize, cases: usize) -> Dash {
    if cases == 1 { Dash::Solid } else { Dash::of_case(index) }
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::symmetric::Symmetric3;
    use pleiad_estimation::{Pose2, RobotId};
    use serde_json::json;

    use super::*;
    use crate::RobotSeries;

    fn team(variance: f64) -> TeamSeries {
        let robot = RobotSeries {
            robot: RobotId(3),
            time_s: vec![0.0, 10.0],
            estimate: vec![Pose2::identity(); 2],
            covariance: vec![Symmetric3::diagonal(9.0 * variance, 16.0 * variance, 1.0); 2],
            truth: vec![None; 2],
            dead_reckoning: None,
        };
        TeamSeries { robots: vec![robot] }
    }

    #[test]
    fn cases_share_one_axis_and_a_robot_keeps_its_colour() {
        let (wide, narrow) = (team(1.0), team(0.01));
        let cases = [("relative only", &wide), ("with GPS", &narrow)];
        let json = sigma_figure(&cases).unwrap().to_json();
        // sqrt(9 + 16) = 5, and a tenth of it.
        assert_eq!(json["data"][0]["y"], json!([0.5, 0.5]));
        assert_eq!(json["data"][1]["y"], json!([5.0, 5.0]));
        assert_eq!(json["data"][0]["line"]["color"], json["data"][1]["line"]["color"]);
        assert_eq!(
            (&json["data"][0]["line"]["dash"], &json["data"][1]["line"]["dash"]),
            (&json!("solid"), &json!("dash"))
        );
        assert_eq!(json["data"][0]["yaxis"], json["data"][1]["yaxis"]);
        assert_eq!(json["data"][1]["showlegend"], false);
        assert_eq!(sigma_patterns(&cases), "dashed: relative only; solid: with GPS");
        assert_eq!(json["layout"]["annotations"][1]["text"], "relative only: 5.00 m");
    }
}
