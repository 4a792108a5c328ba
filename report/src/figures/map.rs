//! Trajectories in the map frame.

use pleiad_estimation::Pose2;

use super::robot_name;
use crate::{
    Axis, CONFIDENCE_95_TWO_DIMENSIONS, Colour, Dash, Figure, Landmark, ReportError, RobotSeries, TeamSeries,
    Trace, ellipse_points,
};

/// Ellipses drawn per robot, evenly spread in time, the last at the end.
const ELLIPSES_PER_ROBOT: usize = 6;
/// Corners of a drawn ellipse: smooth at the size of a screen.
const ELLIPSE_CORNERS: usize = 48;
/// How much of the box around everything is left free on either side.
const MARGIN: f64 = 0.06;
/// How far, in lengths of that box, an ellipse may widen it. Wider ones are cut by the frame: otherwise
/// the ellipses of a team that knows little would shrink the trajectories to a dot.
const ELLIPSE_ALLOWANCE: f64 = 0.25;

/// A part of the plane, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Smallest x and y.
    pub low: [f64; 2],
    /// Largest x and y.
    pub high: [f64; 2],
}

impl Extent {
    /// The part that shows the trajectories, the landmarks and (within limits) the ellipses of all given
    /// teams: maps of the same extent can be compared by eye. `None` if there is not one finite point.
    pub fn around(teams: &[&TeamSeries], landmarks: &[Landmark]) -> Option<Self> {
        let robots = || teams.iter().flat_map(|team| &team.robots);
        let poses = robots().flat_map(|robot| robot.estimate.iter().chain(robot.truth.iter().flatten()));
        let points = poses.map(position).chain(landmarks.iter().map(|landmark| [landmark.x_m, landmark.y_m]));
        let inner = Self::of_points(points)?;
        let size = inner.longer_side().max(1e-3);
        let allowed = inner.widened(ELLIPSE_ALLOWANCE * size);
        let outlines = robots()
            .flat_map(ellipses)
            .flatten()
            .map(|point| [0, 1].map(|axis| point[axis].clamp(allowed.low[axis], allowed.high[axis])));
        let corners = [inner.low, inner.high];
        Some(Self::of_points(outlines.chain(corners))?.widened(MARGIN * size))
    }

    fn of_points(points: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        points.filter(|point| point.iter().all(|value| value.is_finite())).fold(None, |extent, point| {
            let Self { low, high } = extent.unwrap_or(Self { low: point, high: point });
            Some(Self {
                low: [low[0].min(point[0]), low[1].min(point[1])],
                high: [high[0].max(point[0]), high[1].max(point[1])],
            })
        })
    }

    fn longer_side(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1])
    }

    fn widened(&self, by_m: f64) -> Self {
        Self { low: self.low.map(|value| value - by_m), high: self.high.map(|value| value + by_m) }
    }
}

/// The map of a team: per robot its estimated trajectory (thin) over its true one (wide and pale), 95 %
/// ellipses at regular times, an open circle at the start and a dot at the end, and landmarks.
/// Dead reckoning, where given, can be switched on in the legend.
///
/// # Errors
/// [`ReportError::ColumnLength`] if the columns of a robot differ in length.
pub fn map_figure(
    team: &TeamSeries,
    landmarks: &[Landmark],
    extent: Option<Extent>,
) -> Result<Figure, ReportError> {
    team.check()?;
    let (mut x, mut y) = (Axis::new("x", "m"), Axis::new("y", "m"));
    if let Some(Extent { low, high }) = extent.or_else(|| Extent::around(&[team], landmarks)) {
        x = x.range(low[0], high[0]);
        y = y.range(low[1], high[1]);
    }
    let mut figure = Figure::new(x, y).equal_aspect();
    for (index, robot) in team.robots.iter().enumerate() {
        figure = figure.traces(below(robot, Colour::Series(index)));
    }
    if !landmarks.is_empty() {
        let xs: Vec<f64> = landmarks.iter().map(|landmark| landmark.x_m).collect();
        let ys: Vec<f64> = landmarks.iter().map(|landmark| landmark.y_m).collect();
        figure = figure.trace(Trace::markers("landmarks", &xs, &ys, Colour::Muted, "diamond-open", 8.0));
    }
    for (index, robot) in team.robots.iter().enumerate() {
        figure = figure.traces(above(robot, Colour::Series(index)));
    }
    let mut listed = false;
    for (index, robot) in team.robots.iter().enumerate() {
        if let Some(path) = dead_reckoning(robot, Colour::Series(index)) {
            figure = figure.trace(if listed { path.unlisted() } else { path });
            listed = true;
        }
    }
    Ok(figure)
}

/// What lies under the estimates: ellipses and truth.
fn below(robot: &RobotSeries, colour: Colour) -> Vec<Trace> {
    let name = robot_name(robot.robot);
    let mut traces = Vec::new();
    let outlines = ellipses(robot);
    if !outlines.is_empty() {
        traces.push(Trace::polygons(&format!("{name}, 95 %"), &outlines, colour).unlisted().group(&name));
    }
    if robot.truth.iter().any(Option::is_some) {
        let (x, y) = columns(robot.truth.iter().copied());
        let truth = Trace::path(&format!("{name}, truth"), &x, &y, colour);
        traces.push(truth.width(6.0).opacity(0.3).unlisted().group(&name));
    }
    traces
}

/// The estimate with its ends.
fn above(robot: &RobotSeries, colour: Colour) -> Vec<Trace> {
    let name = robot_name(robot.robot);
    let (x, y) = columns(robot.estimate.iter().map(|pose| Some(*pose)));
    let mut traces = vec![Trace::path(&name, &x, &y, colour).group(&name)];
    let ends =
        [(x.first().zip(y.first()), "start", "circle-open"), (x.last().zip(y.last()), "end", "circle")];
    for (point, which, symbol) in ends {
        if let Some((&x, &y)) = point {
            let mark = Trace::markers(&format!("{name}, {which}"), &[x], &[y], colour, symbol, 9.0);
            traces.push(mark.unlisted().group(&name));
        }
    }
    traces
}

fn dead_reckoning(robot: &RobotSeries, colour: Colour) -> Option<Trace> {
    let path = robot.dead_reckoning.as_ref().filter(|path| !path.is_empty())?;
    let (x, y) = columns(path.iter().map(|&(_, pose)| Some(pose)));
    let trace = Trace::path("dead reckoning", &x, &y, colour).dash(Dash::Dot);
    Some(trace.group("dead reckoning").on_request())
}

/// 95 % ellipses of the position at regular times.
fn ellipses(robot: &RobotSeries) -> Vec<Vec<[f64; 2]>> {
    let instants = robot.estimate.len().min(robot.covariance.len());
    let count = ELLIPSES_PER_ROBOT.min(instants);
    let outline = |k: usize| {
        let index = instants * (k + 1) / count - 1;
        let centre = position(&robot.estimate[index]);
        ellipse_points(centre, robot.covariance[index], CONFIDENCE_95_TWO_DIMENSIONS, ELLIPSE_CORNERS)
    };
    (0..count).filter_map(outline).collect()
}

fn position(pose: &Pose2) -> [f64; 2] {
    [pose.x_m(), pose.y_m()]
}

/// Positions as two columns; unknown ones are gaps.
fn columns(poses: impl Iterator<Item = Option<Pose2>>) -> (Vec<f64>, Vec<f64>) {
    poses.map(|pose| pose.map_or((f64::NAN, f64::NAN), |pose| (pose.x_m(), pose.y_m()))).unzip()
}

#[cfg(test)]
mod tests {
    use pleiad_estimation::RobotId;
    use pleiad_estimation::symmetric::Symmetric3;

    use super::*;

    fn along_x(length_m: f64, sigma_m: f64) -> TeamSeries {
        let poses: Vec<Pose2> =
            (0..=10).map(|i| Pose2::new(f64::from(i) / 10.0 * length_m, 0.0, 0.0)).collect();
        let robot = RobotSeries {
            robot: RobotId(1),
            time_s: (0..=10).map(f64::from).collect(),
            covariance: vec![Symmetric3::diagonal(sigma_m * sigma_m, sigma_m * sigma_m, 0.01); poses.len()],
            truth: poses.iter().copied().map(Some).collect(),
            estimate: poses,
            dead_reckoning: None,
        };
        TeamSeries { robots: vec![robot] }
    }

    #[test]
    fn the_extent_holds_trajectories_and_small_ellipses() {
        // 95 % radius 2.4477 * 0.1 m, margin 6 % of 10 m.
        let extent = Extent::around(&[&along_x(10.0, 0.1)], &[]).unwrap();
        assert!((extent.high[0] - (10.0 + 0.244_77 + 0.6)).abs() < 1e-3, "{extent:?}");
        assert!((extent.low[1] + 0.244_77 + 0.6).abs() < 1e-3, "{extent:?}");
    }

    #[test]
    fn huge_ellipses_cannot_shrink_the_trajectories_to_a_dot() {
        let extent = Extent::around(&[&along_x(10.0, 1_000.0)], &[]).unwrap();
        assert!(extent.high[0] - extent.low[0] < 10.0 * (1.0 + 2.0 * (0.25 + 0.06)) + 1e-9);
    }

    #[test]
    fn the_last_ellipse_stands_at_the_end() {
        let outlines = ellipses(&along_x(10.0, 0.1).robots[0]);
        assert_eq!(outlines.len(), ELLIPSES_PER_ROBOT);
        let centre_x = f64::midpoint(outlines[5][0][0], outlines[5][24][0]);
        assert!((centre_x - 10.0).abs() < 1e-9);
    }
}
