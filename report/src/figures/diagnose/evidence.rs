//! What speaks for one finding: the partial residual, and when its likelihood is gained.

use crate::decimate::even_sample;
use crate::figures::diagnose::scale::readable;
use crate::figures::robot_name;
use crate::reports::diagnose::{Evidence, ShapeColumns};
use crate::{Axis, Colour, Dash, Figure, Trace, indices_keeping_extremes};

/// Points of a cloud: enough for its shape.
const CLOUD_POINTS: usize = 800;
/// Stripes of the cloud whose means are drawn over it, and the points that one needs.
const STRIPES: usize = 12;
const LEAST_IN_STRIPE: f64 = 3.0;
/// Points per line of the strip.
const STRIP_POINTS: usize = 1_000;

/// Whose evidence it is, in legends and headings.
pub(crate) fn name_of(evidence: &Evidence) -> String {
    let what = if evidence.channel == evidence.component {
        evidence.channel.clone()
    } else {
        format!("{}, {}", evidence.channel, evidence.component)
    };
    let of =
        if evidence.recording.is_empty() { String::new() } else { format!(" of {}", evidence.recording) };
    format!("{}{of}: {what}", robot_name(evidence.robot))
}

/// What is left of the residual without the finding, over what the finding predicts; the line has slope one.
/// `None` without two different predictions.
pub(crate) fn partial_figure(evidence: &Evidence) -> Option<Figure> {
    let mut points: Vec<[f64; 2]> = evidence
        .predicted
        .iter()
        .zip(&evidence.residual)
        .map(|(predicted, residual)| [*predicted, *residual])
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .collect();
    let (scale, unit) = readable(points.iter().flatten(), &evidence.unit);
    points.iter_mut().flatten().for_each(|value| *value *= scale);
    if points.is_empty() {
        return None;
    }
    // The line starts where nothing is predicted, so that a constant prediction has its place too.
    let least = points.iter().map(|point| point[0]).fold(0.0, f64::min);
    let greatest = points.iter().map(|point| point[0]).fold(0.0, f64::max);
    if least >= greatest {
        return None;
    }
    let cloud: Vec<[f64; 2]> =
        even_sample(points.len(), CLOUD_POINTS).into_iter().map(|index| points[index]).collect();
    let column =
        |points: &[[f64; 2]], axis: usize| points.iter().map(|point| point[axis]).collect::<Vec<f64>>();
    let ends = [least, greatest];
    let means = stripe_means(&points, ends);
    Some(
        Figure::new(Axis::new("predicted by the finding", &unit), Axis::new("left without it", &unit))
            .height(340)
            .trace(
                Trace::markers(
                    "residuals",
                    &column(&cloud, 0),
                    &column(&cloud, 1),
                    Colour::Series(4),
                    "circle",
                    3.0,
                )
                .opacity(0.5),
            )
            .trace(Trace::line("slope one", &ends, &ends, Colour::Ink).dash(Dash::Dash))
            .trace(Trace::markers(
                "means",
                &column(&means, 0),
                &column(&means, 1),
                Colour::Series(1),
                "circle",
                8.0,
            )),
    )
}

/// Whose shape it is, for a heading.
pub(crate) fn name_of_shape(shape: &ShapeColumns) -> String {
    let of = if shape.recording.is_empty() { String::new() } else { format!(" of {}", shape.recording) };
    format!("{}{of}: {}, over {}", robot_name(shape.robot), shape.component, shape.regressor)
}

/// What is left of the residual over what it depends on, with the curve that was found. `None` without points.
pub(crate) fn shape_figure(shape: &ShapeColumns) -> Option<Figure> {
    let mut points: Vec<[f64; 2]> = shape
        .x
        .iter()
        .zip(&shape.residual)
        .map(|(x, residual)| [*x, *residual])
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .collect();
    let (scale, unit) = readable(points.iter().map(|point| &point[1]), &shape.unit);
    for point in &mut points {
        point[1] *= scale;
    }
    let least = points.iter().map(|point| point[0]).fold(f64::INFINITY, f64::min);
    let greatest = points.iter().map(|point| point[0]).fold(f64::NEG_INFINITY, f64::max);
    if least >= greatest || points.is_empty() {
        return None;
    }
    let cloud: Vec<[f64; 2]> =
        even_sample(points.len(), CLOUD_POINTS).into_iter().map(|index| points[index]).collect();
    let column =
        |points: &[[f64; 2]], axis: usize| points.iter().map(|point| point[axis]).collect::<Vec<f64>>();
    let curve: Vec<[f64; 2]> = shape.curve.iter().map(|[x, y]| [*x, y * scale]).collect();
    let means = stripe_means(&points, [least, greatest]);
    let circle = |name: &str, points: &[[f64; 2]], colour, size| {
        Trace::markers(name, &column(points, 0), &column(points, 1), colour, "circle", size)
    };
    Some(
        Figure::new(Axis::new(&shape.regressor, &shape.regressor_unit), Axis::new("left without it", &unit))
            .height(340)
            .trace(circle("residuals", &cloud, Colour::Series(4), 3.0).opacity(0.5))
            .trace(Trace::line("curve found", &column(&curve, 0), &column(&curve, 1), Colour::Ink))
            .trace(circle("means", &means, Colour::Series(1), 8.0)),
    )
}

/// The means of the points in stripes of equal width between `least` and `greatest`, where there are enough.
fn stripe_means(points: &[[f64; 2]], [least, greatest]: [f64; 2]) -> Vec<[f64; 2]> {
    let mut sums = [[0.0; 3]; STRIPES];
    for &[x, y] in points {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the stripes")]
        let stripe = ((x - least) / (greatest - least) * STRIPES as f64) as usize;
        let sum = &mut sums[stripe.min(STRIPES - 1)];
        *sum = [sum[0] + x, sum[1] + y, sum[2] + 1.0];
    }
    let enough = sums.iter().filter(|[_, _, count]| *count >= LEAST_IN_STRIPE);
    enough.map(|[x, y, count]| [x / count, y / count]).collect()
}

/// Log-likelihood gained per half second, and summed; intervals in which the finding acts are shaded.
/// `None` if nothing is known of it.
pub(crate) fn strip_figure(evidence: &[&Evidence], acts_s: &[[f64; 2]]) -> Option<Figure> {
    let known: Vec<&&Evidence> = evidence.iter().filter(|evidence| evidence.gain.len() > 1).collect();
    if known.is_empty() {
        return None;
    }
    let mut figure = Figure::new(Axis::new("time", "s"), Axis::new("gain", "nat"))
        .row(Axis::new("sum", "nat"))
        .height(360);
    let highest = known.iter().map(|evidence| top(evidence)).fold(0.0, f64::max);
    let shades: Vec<Vec<[f64; 2]>> = acts_s
        .iter()
        .filter(|[from, to]| from.is_finite() && to.is_finite())
        .map(|&[from, to]| vec![[from, 0.0], [to, 0.0], [to, highest], [from, highest], [from, 0.0]])
        .collect();
    if !shades.is_empty() {
        figure = figure.trace(Trace::polygons("acts", &shades, Colour::Muted).in_row(1));
    }
    for (index, evidence) in known.iter().enumerate() {
        let name = name_of(evidence);
        let times: Vec<f64> = evidence.gain.iter().map(|[time, _]| *time).collect();
        let sums: Vec<f64> = evidence.gain.iter().map(|[_, sum]| *sum).collect();
        let steps: Vec<f64> = increments(evidence).iter().map(|[_, step]| *step).collect();
        let colour = Colour::Series(index);
        let line = |values: &[f64]| {
            let kept = indices_keeping_extremes(&[values, &times], STRIP_POINTS);
            let pick = |column: &[f64]| kept.iter().map(|&i| column[i]).collect::<Vec<f64>>();
            Trace::line(&name, &pick(&times), &pick(values), colour).group(&name)
        };
        figure = figure.trace(line(&steps).width(1.0).unlisted()).trace(line(&sums).in_row(1));
    }
    Some(figure)
}

fn top(evidence: &Evidence) -> f64 {
    evidence.gain.iter().map(|[_, sum]| *sum).filter(|sum| sum.is_finite()).fold(0.0, f64::max)
}

/// Time and gain of every half second.
pub(super) fn increments(evidence: &Evidence) -> Vec<[f64; 2]> {
    let mut before = 0.0;
    let step = |&[time, sum]: &[f64; 2]| {
        let gained = sum - before;
        before = sum;
        [time, gained]
    };
    evidence.gain.iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_stripes_follow_a_line_through_noise() {
        // 1200 points in twelve stripes; the noise of two neighbours cancels.
        let points: Vec<[f64; 2]> = (0..1_200)
            .map(|i| {
                let x = f64::from(i / 2) / 100.0;
                [x, 2.0 * x + if i % 2 == 0 { 50.0 } else { -50.0 }]
            })
            .collect();
        let means = stripe_means(&points, [0.0, 6.0]);
        assert_eq!(means.len(), STRIPES);
        assert!(means.iter().all(|[x, y]| (y - 2.0 * x).abs() < 1e-9), "{means:?}");
    }
}
