//! Figures of one run.

use pleiad_estimation::symmetric::Symmetric3;
use pleiad_estimation::{Pose2, Timestamp, geometry::wrap_angle};
use pleiad_report::{Axis, CONFIDENCE_95_TWO_DIMENSIONS, Colour, Dash, Figure, Trace, ellipse_points};

use super::input::SlamInput;
use super::run::{Moment, Ran};
use super::theorems::Likeness;

/// Corners of an ellipse.
const CORNERS: usize = 36;
/// Share of the map's extent that is left free around it.
const MARGIN: f64 = 0.06;

/// Likeness of the landmarks over time.
pub type LikenessSeries = Vec<(Timestamp, Likeness)>;

fn seconds(ran: &Ran) -> Vec<f64> {
    let first = ran.moments.first().map_or(Timestamp(0), |moment| moment.time);
    ran.moments.iter().map(|moment| moment.time.seconds_since(first)).collect()
}

/// True and estimated landmarks with their ellipses, and the ways. The estimate is moved by `aligned` first.
pub fn map_figure(input: &SlamInput, ran: &Ran, aligned: &Pose2) -> Figure {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    let mut hold = |point: [f64; 2]| {
        for axis in 0..2 {
            if point[axis].is_finite() {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
    };
    let truth: Vec<[f64; 2]> = ran
        .moments
        .iter()
        .map(|moment| moment.truth.map_or([f64::NAN; 2], |pose| [pose.x_m(), pose.y_m()]))
        .collect();
    let estimate: Vec<[f64; 2]> =
        ran.moments.iter().map(|moment| aligned.act(moment.pose.position())).map(|p| [p.x, p.y]).collect();
    let known: Vec<[f64; 2]> = input.landmarks.values().copied().collect();
    let mapped: Vec<[f64; 2]> =
        ran.map.iter().map(|mapped| aligned.act(mapped.position)).map(|p| [p.x, p.y]).collect();
    for point in truth.iter().chain(&estimate).chain(&known).chain(&mapped) {
        hold(*point);
    }
    let turn = nalgebra::Matrix3::new(
        aligned.yaw_rad().cos(),
        -aligned.yaw_rad().sin(),
        0.0,
        aligned.yaw_rad().sin(),
        aligned.yaw_rad().cos(),
        0.0,
        0.0,
        0.0,
        1.0,
    );
    let outlines: Vec<Vec<[f64; 2]>> = ran
        .map
        .iter()
        .zip(&mapped)
        .filter_map(|(mapped, centre)| {
            let covariance = Symmetric3::congruence(mapped.covariance, &turn);
            ellipse_points(*centre, covariance, CONFIDENCE_95_TWO_DIMENSIONS, CORNERS)
        })
        .collect();
    let column = |points: &[[f64; 2]], axis: usize| points.iter().map(|p| p[axis]).collect::<Vec<f64>>();
    let room = MARGIN * (high[0] - low[0]).max(high[1] - low[1]);
    let axis = |name: &str, k: usize| Axis::new(name, "m").range(low[k] - room, high[k] + room);
    Figure::new(axis("x", 0), axis("y", 1))
        .equal_aspect()
        .trace(
            Trace::path("true way", &column(&truth, 0), &column(&truth, 1), Colour::Muted).dash(Dash::Dash),
        )
        .trace(Trace::path("estimated way", &column(&estimate, 0), &column(&estimate, 1), Colour::Series(0)))
        .trace(Trace::polygons("95 % ellipse", &outlines, Colour::Series(1)))
        .trace(Trace::markers(
            "true landmark",
            &column(&known, 0),
            &column(&known, 1),
            Colour::Ink,
            "diamond-open",
            9.0,
        ))
        .trace(Trace::markers(
            "estimated landmark",
            &column(&mapped, 0),
            &column(&mapped, 1),
            Colour::Series(1),
            "x",
            6.0,
        ))
}

/// Standard deviation of every landmark and of the vehicle over time, and what the landmarks' cannot fall below.
pub fn sigma_figure(ran: &Ran, limit_m: Option<f64>) -> Figure {
    let time = seconds(ran);
    let mut figure = Figure::new(
        Axis::new("time", "s"),
        Axis::new("standard deviation of a position, per axis", "m").logarithmic(),
    );
    let ids: std::collections::BTreeSet<_> = ran.map.iter().map(|mapped| mapped.id).collect();
    for (k, id) in ids.iter().enumerate() {
        let sigma = |moment: &Moment| {
            moment.sigma_m.iter().find(|(other, _)| other == id).map_or(f64::NAN, |(_, sigma)| *sigma)
        };
        let values: Vec<f64> = ran.moments.iter().map(sigma).collect();
        let mut trace =
            Trace::line("landmarks", &time, &values, Colour::Series(1)).width(1.0).group("landmarks");
        if k > 0 {
            trace = trace.unlisted();
        }
        figure = figure.trace(trace);
    }
    let vehicle: Vec<f64> = ran
        .moments
        .iter()
        .map(|moment| (0.5 * (moment.covariance.0[0] + moment.covariance.0[2])).sqrt())
        .collect();
    figure = figure.trace(Trace::line("vehicle", &time, &vehicle, Colour::Series(0)));
    if let (Some(limit_m), Some(first), Some(last)) = (limit_m, time.first(), time.last()) {
        let trace = Trace::line("mean limit of the landmarks", &[*first, *last], &[limit_m; 2], Colour::Ink)
            .dash(Dash::Dash);
        figure = figure.trace(trace);
    }
    figure
}

/// How alike the errors of the landmarks are, over time.
pub fn likeness_figure(series: &LikenessSeries) -> Figure {
    let first = series.first().map_or(Timestamp(0), |(time, _)| *time);
    let time: Vec<f64> = series.iter().map(|(time, _)| time.seconds_since(first)).collect();
    let column = |of: fn(&Likeness) -> f64| series.iter().map(|(_, like)| of(like)).collect::<Vec<f64>>();
    Figure::new(Axis::new("time", "s"), Axis::new("least correlation", "-"))
        .row(Axis::new("greatest sigma", "m").logarithmic())
        .height(520)
        .trace(Trace::line(
            "correlation of two landmarks",
            &time,
            &column(|l| l.least_correlation),
            Colour::Series(0),
        ))
        .trace(
            Trace::line(
                "difference of two landmarks",
                &time,
                &column(|l| l.relative_sigma_m),
                Colour::Series(1),
            )
            .in_row(1),
        )
        .trace(
            Trace::line(
                "distance of two landmarks",
                &time,
                &column(|l| l.distance_sigma_m),
                Colour::Series(2),
            )
            .in_row(1),
        )
}

/// Errors of the vehicle with three standard deviations.
pub fn error_figure(ran: &Ran) -> Figure {
    let time = seconds(ran);
    let mut figure = Figure::new(Axis::new("time", "s"), Axis::new("x error", "m"))
        .row(Axis::new("y error", "m"))
        .row(Axis::new("heading error", "rad"))
        .height(640);
    for (row, entry) in [0, 2, 5].into_iter().enumerate() {
        let error = |moment: &Moment| {
            moment.truth.map_or(f64::NAN, |truth| match row {
                0 => moment.pose.x_m() - truth.x_m(),
                1 => moment.pose.y_m() - truth.y_m(),
                _ => wrap_angle(moment.pose.yaw_rad() - truth.yaw_rad()),
            })
        };
        let errors: Vec<f64> = ran.moments.iter().map(error).collect();
        let bound: Vec<f64> =
            ran.moments.iter().map(|moment| 3.0 * moment.covariance.0[entry].max(0.0).sqrt()).collect();
        let below: Vec<f64> = bound.iter().map(|bound| -bound).collect();
        let (mut band, mut line) = (
            Trace::band("3 sigma", &time, &below, &bound, Colour::Muted).in_row(row).group("bound"),
            Trace::line("error", &time, &errors, Colour::Series(0)).in_row(row).group("error"),
        );
        if row > 0 {
            (band, line) = (band.unlisted(), line.unlisted());
        }
        figure = figure.trace(band).trace(line);
    }
    figure
}
