//! What a team looks like at an instant: ellipses, trails and lines of sight, as `foxglove.SceneUpdate`.

use std::f64::consts::TAU;

use pleiad_estimation::geometry::Vector2;
use pleiad_estimation::sample::{Reading, Relative};
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, RobotId, Timestamp};
use serde::Serialize;

use super::frame;
use super::views::{Instant, MAP, PoseView, Vector, instant, level, pose};
use super::write::Estimate;
use crate::types::{Recording, RobotRecording};

/// Quantile of chi-square with two degrees of freedom at 95 %.
const CHI_SQUARE_95: f64 = 5.991;
const CORNERS: usize = 36;
/// Seconds of the past that a trail shows, and seconds between its points at least.
const TRAIL_S: f64 = 30.0;
const TRAIL_STEP_S: f64 = 0.5;
/// How far a sighting is drawn that says only a direction, metres.
const BEARING_LENGTH_M: f64 = 3.0;
/// Half the size of a landmark's cross, metres.
const CROSS_M: f64 = 0.1;
/// Colours that can be told apart (Okabe & Ito 2008), by robot.
const COLOURS: [[f64; 3]; 7] = [
    [0.0, 0.447, 0.698],
    [0.835, 0.369, 0.0],
    [0.0, 0.62, 0.451],
    [0.8, 0.475, 0.655],
    [0.902, 0.624, 0.0],
    [0.337, 0.706, 0.914],
    [0.941, 0.894, 0.259],
];
const GREY: Colour = Colour { r: 0.5, g: 0.5, b: 0.5, a: 0.8 };
/// `LINE_STRIP`, `LINE_LOOP` and `LINE_LIST`.
const STRIP: u8 = 0;
const LOOP: u8 = 1;
const SEGMENTS: u8 = 2;

fn colour(robot: RobotId, a: f64) -> Colour {
    let [r, g, b] = COLOURS[robot.0.saturating_sub(1) as usize % COLOURS.len()];
    Colour { r, g, b, a }
}

/// `foxglove.Color`.
#[derive(Clone, Copy, Serialize)]
struct Colour {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

/// `foxglove.LinePrimitive`.
#[derive(Serialize)]
struct Line {
    #[serde(rename = "type")]
    kind: u8,
    pose: PoseView,
    thickness: f64,
    scale_invariant: bool,
    points: Vec<Vector>,
    color: Colour,
    colors: [Colour; 0],
    indices: [u32; 0],
}

/// `foxglove.TextPrimitive`.
#[derive(Serialize)]
struct Label {
    pose: PoseView,
    billboard: bool,
    font_size: f64,
    scale_invariant: bool,
    color: Colour,
    text: String,
}

/// Primitives that are never drawn.
type Nothing = [(); 0];

/// `foxglove.SceneEntity`.
#[derive(Serialize)]
struct Entity {
    timestamp: Instant,
    frame_id: &'static str,
    id: String,
    lifetime: Instant,
    frame_locked: bool,
    metadata: Nothing,
    arrows: Nothing,
    cubes: Nothing,
    spheres: Nothing,
    cylinders: Nothing,
    lines: Vec<Line>,
    triangles: Nothing,
    texts: Vec<Label>,
    models: Nothing,
}

/// `foxglove.SceneUpdate`.
#[derive(Serialize)]
pub(super) struct Update {
    deletions: Nothing,
    entities: [Entity; 1],
}

fn line(kind: u8, thickness: f64, color: Colour, points: &[[f64; 2]]) -> Line {
    let points = points.iter().map(|point| level(*point)).collect();
    let pose = pose(&Pose2::identity());
    Line { kind, pose, thickness, scale_invariant: true, points, color, colors: [], indices: [] }
}

fn label([x, y]: [f64; 2], text: String, color: Colour) -> Label {
    let pose = pose(&Pose2::new(x, y, 0.0));
    Label { pose, billboard: true, font_size: 14.0, scale_invariant: true, color, text }
}

fn update(time: Timestamp, id: String, lines: Vec<Line>, texts: Vec<Label>) -> Update {
    let entity = Entity {
        timestamp: instant(time),
        frame_id: MAP,
        id,
        // For ever, until the next of its name.
        lifetime: instant(Timestamp(0)),
        frame_locked: false,
        metadata: [],
        arrows: [],
        cubes: [],
        spheres: [],
        cylinders: [],
        lines,
        triangles: [],
        texts,
        models: [],
    };
    Update { deletions: [], entities: [entity] }
}

/// Landmarks, walls and the true paths, told once.
pub(super) fn world(time: Timestamp, recording: &Recording) -> Update {
    let mut crosses = Vec::new();
    let mut names = Vec::new();
    for (landmark, [x, y]) in &recording.landmarks {
        crosses.extend([[x - CROSS_M, *y], [x + CROSS_M, *y], [*x, y - CROSS_M], [*x, y + CROSS_M]]);
        names.push(label([*x, *y], format!("L{landmark}"), GREY));
    }
    let walls: Vec<[f64; 2]> =
        recording.walls.iter().flat_map(|[x0, y0, x1, y1]| [[*x0, *y0], [*x1, *y1]]).collect();
    let mut lines = vec![line(SEGMENTS, 2.0, GREY, &crosses), line(SEGMENTS, 3.0, GREY, &walls)];
    for robot in recording.robots.values() {
        let path = thinned(robot.truth.iter().map(|truth| (truth.time, truth.pose)));
        lines.push(line(STRIP, 1.0, GREY, &path));
    }
    update(time, "world".to_owned(), lines, names)
}

/// One point per step of a path.
fn thinned(path: impl Iterator<Item = (Timestamp, Pose2)>) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    let mut last: Option<Timestamp> = None;
    for (time, pose) in path {
        if last.is_none_or(|last| time.seconds_since(last) >= TRAIL_STEP_S) {
            points.push([pose.x_m(), pose.y_m()]);
            last = Some(time);
        }
    }
    points
}

/// A robot at estimate `at` of `estimates`: its 95 % ellipse, the way it came, and what it saw since `since`.
pub(super) fn robot(
    robot: RobotId,
    estimates: &[Estimate],
    at: usize,
    since: Timestamp,
    channels: Option<&RobotRecording>,
) -> Option<Update> {
    let now = estimates.get(at)?;
    let begin = now.time.plus_seconds(-TRAIL_S);
    let past = &estimates[estimates[..at].partition_point(|estimate| estimate.time < begin)..=at];
    let trail = thinned(past.iter().map(|estimate| (estimate.time, estimate.pose)));
    let place = [now.pose.x_m(), now.pose.y_m()];
    let ahead = now.pose.act(Vector2::new(0.3, 0.0));
    let lines = vec![
        line(LOOP, 2.0, colour(robot, 1.0), &ellipse(place, &now.covariance).unwrap_or_default()),
        line(STRIP, 1.5, colour(robot, 0.6), &trail),
        line(STRIP, 4.0, colour(robot, 1.0), &[place, [ahead.x, ahead.y]]),
        line(SEGMENTS, 1.0, colour(robot, 0.4), &sights(estimates, since, now.time, channels)),
    ];
    let name = frame(robot);
    let label = label(place, name.clone(), colour(robot, 1.0));
    Some(update(now.time, name, lines, vec![label]))
}

/// Lines from where the robot is estimated to what it saw after `since` and until `until`.
fn sights(
    estimates: &[Estimate],
    since: Timestamp,
    until: Timestamp,
    channels: Option<&RobotRecording>,
) -> Vec<[f64; 2]> {
    let all = channels.map(|channels| channels.sightings.as_slice()).unwrap_or_default();
    let begin = all.partition_point(|sample| sample.time <= since);
    let mut ends = Vec::new();
    for sample in all[begin..].iter().take_while(|sample| sample.time <= until) {
        let Reading::Sighting { relative, .. } = sample.reading else { continue };
        let (range, bearing) = match relative {
            Relative::RangeBearing { range_m, bearing_rad } => (range_m, bearing_rad),
            Relative::Bearing { bearing_rad } => (BEARING_LENGTH_M, bearing_rad),
            Relative::Position { x_m, y_m } => (libm::hypot(x_m, y_m), libm::atan2(y_m, x_m)),
            Relative::Pose(pose) => {
                (libm::hypot(pose.x_m(), pose.y_m()), libm::atan2(pose.y_m(), pose.x_m()))
            }
            // Somewhere on a circle.
            Relative::Range { .. } => continue,
        };
        let after = estimates.partition_point(|estimate| estimate.time <= sample.time);
        let Some(from) = after.checked_sub(1).and_then(|index| estimates.get(index)) else { continue };
        let seen = from.pose.act(Vector2::new(range * libm::cos(bearing), range * libm::sin(bearing)));
        ends.extend([[from.pose.x_m(), from.pose.y_m()], [seen.x, seen.y]]);
    }
    ends
}

/// The outline that holds the position with 95 %: `centre + sqrt(q) L u` with the Cholesky factor `L` and `u` on the
/// unit circle. `None` for what is no covariance.
fn ellipse(centre: [f64; 2], covariance: &Symmetric3) -> Option<Vec<[f64; 2]>> {
    let [xx, yx, yy, ..] = covariance.0;
    let l_xx = xx.max(0.0).sqrt();
    let l_yx = if l_xx > 0.0 { yx / l_xx } else { 0.0 };
    let l_yy = (yy - l_yx * l_yx).max(0.0).sqrt();
    let radius = CHI_SQUARE_95.sqrt();
    let corner = |corner: usize| {
        let angle = TAU * corner as f64 / CORNERS as f64;
        let (sin, cos) = libm::sincos(angle);
        [centre[0] + radius * l_xx * cos, centre[1] + radius * (l_yx * cos + l_yy * sin)]
    };
    [xx, yx, yy].iter().all(|value| value.is_finite()).then(|| (0..CORNERS).map(corner).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_corner_is_at_the_distance_of_95_percent() {
        let (xx, yx, yy) = (0.9, -0.5, 0.4);
        let determinant = xx * yy - yx * yx;
        let points = ellipse([1.0, 2.0], &Symmetric3([xx, yx, yy, 0.1, 0.2, 0.3])).unwrap();
        assert_eq!(points.len(), CORNERS);
        for [x, y] in points {
            let (dx, dy) = (x - 1.0, y - 2.0);
            let squared = (yy * dx * dx - 2.0 * yx * dx * dy + xx * dy * dy) / determinant;
            assert!((squared - CHI_SQUARE_95).abs() < 1e-9, "{squared}");
        }
        assert!(ellipse([0.0; 2], &Symmetric3([f64::NAN, 0.0, 1.0, 0.0, 0.0, 1.0])).is_none());
    }
}
