//! Whether innovations are as large as the filter expects.

use crate::{Axis, Colour, Dash, Figure, NisSeries, ReportError, Trace, two_sided_95};

/// NIS over time on a logarithmic axis with the bounds that hold 95 % of a consistent filter's; rejected
/// observations are crosses.
///
/// # Errors
/// [`ReportError::NisDimension`] for a dimension other than 1 to 6.
pub fn nis_figure(series: &NisSeries) -> Result<Figure, ReportError> {
    let (low, high) = bounds(series)?;
    let column = |used: bool| -> (Vec<f64>, Vec<f64>) {
        series.points.iter().filter(|point| point.used == used).map(|point| (point.time_s, point.nis)).unzip()
    };
    let times = || series.points.iter().map(|point| point.time_s).filter(|time| time.is_finite());
    let ends = [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)];
    let ((used_t, used), (rejected_t, rejected)) = (column(true), column(false));
    let mut figure = Figure::new(Axis::new("time", "s"), Axis::new("NIS", "-").logarithmic()).height(320);
    if !used.is_empty() {
        figure = figure
            .trace(Trace::markers("used", &used_t, &used, Colour::Series(4), "circle", 3.0).opacity(0.8));
    }
    if !rejected.is_empty() {
        figure = figure.trace(Trace::markers(
            "rejected",
            &rejected_t,
            &rejected,
            Colour::Series(1),
            "x-thin",
            7.0,
        ));
    }
    if !series.points.is_empty() {
        let bound =
            |name: &str, value: f64| Trace::line(name, &ends, &[value, value], Colour::Ink).dash(Dash::Dash);
        figure = figure.trace(bound("95 % bounds", high).group("bounds"));
        figure = figure.trace(bound("lower 95 % bound", low).group("bounds").unlisted());
    }
    Ok(figure)
}

/// Share of the used observations whose NIS lies within the 95 % bounds, from 0 to 1; `None` if none was
/// used.
///
/// # Errors
/// [`ReportError::NisDimension`] for a dimension other than 1 to 6.
pub fn share_within_bounds(series: &NisSeries) -> Result<Option<f64>, ReportError> {
    let (low, high) = bounds(series)?;
    let used: Vec<f64> = series.points.iter().filter(|point| point.used).map(|point| point.nis).collect();
    let inside = used.iter().filter(|&&nis| (low..=high).contains(&nis)).count();
    Ok((!used.is_empty()).then(|| inside as f64 / used.len() as f64))
}

fn bounds(series: &NisSeries) -> Result<(f64, f64), ReportError> {
    two_sided_95(series.degrees_of_freedom).ok_or_else(|| ReportError::NisDimension {
        name: series.name.clone(),
        found: series.degrees_of_freedom,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NisPoint;

    fn series(degrees_of_freedom: usize, values: &[f64]) -> NisSeries {
        let point = |(i, &nis): (usize, &f64)| NisPoint { time_s: i as f64, nis, used: nis < 20.0 };
        NisSeries {
            name: "range and bearing".into(),
            degrees_of_freedom,
            points: values.iter().enumerate().map(point).collect(),
        }
    }

    #[test]
    fn exponential_quantiles_have_the_share_they_stand_for() {
        // Two degrees of freedom: quantile(p) = -2 ln(1 - p); 950 of 1000 mid-quantiles lie inside.
        let values: Vec<f64> = (0..1000).map(|i| -2.0 * (1.0 - (f64::from(i) + 0.5) / 1000.0).ln()).collect();
        let share = share_within_bounds(&series(2, &values)).unwrap().unwrap();
        assert!((share - 0.95).abs() < 0.002, "{share}");
    }

    #[test]
    fn an_overconfident_filter_is_seen() {
        // Covariance claimed four times too small: NIS four times too large.
        let values: Vec<f64> = (0..1000).map(|i| -8.0 * (1.0 - (f64::from(i) + 0.5) / 1000.0).ln()).collect();
        assert!(share_within_bounds(&series(2, &values)).unwrap().unwrap() < 0.85);
    }

    #[test]
    fn a_dimension_without_bounds_is_refused() {
        let error = nis_figure(&series(9, &[1.0])).unwrap_err();
        assert!(error.to_string().contains("found 9"), "{error}");
    }

    #[test]
    fn rejected_observations_are_a_trace_of_their_own() {
        let json = nis_figure(&series(2, &[1.0, 50.0, 2.0])).unwrap().to_json();
        assert_eq!(json["data"][0]["x"], serde_json::json!([0.0, 2.0]));
        assert_eq!(json["data"][1]["name"], "rejected");
        assert_eq!(json["data"][1]["y"], serde_json::json!([50.0]));
    }
}
